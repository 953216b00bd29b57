"""Kernels by LLVM in this process, without a C compiler, if llvmlite is installed: ``pendula[jit]``."""

from __future__ import annotations

import hashlib
import threading
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

OLDEST = (0, 45)  # the first llvmlite whose LLVM reads such text; pyproject.toml says it, too

_one_at_a_time = threading.Lock()
_engines: dict[
    bytes, Any
] = {}  # what runs kernels, by hashes of these: a kernel stays as long as the process


@cache
def is_there() -> bool:
    """Whether llvmlite is installed and new enough; does not import it."""
    try:
        found = version("llvmlite").split(".")[:2]
    except PackageNotFoundError:
        return False
    return all(part.isdigit() for part in found) and tuple(map(int, found)) >= OLDEST


def compile_text(text: str, made: str) -> str:
    """Compiles the file ``text`` to the object file ``made``. Returns an error message, or an empty text."""
    import llvmlite.binding as llvm  # type: ignore[import-not-found, import-untyped, unused-ignore]

    try:
        with _one_at_a_time:
            machine = _machine(llvm)
            module = llvm.parse_assembly(Path(text).read_text(encoding="utf-8"))
            module.verify()
            passes = llvm.create_new_module_pass_manager()
            # The only pass: it turns stack slots into registers. Further passes made no difference when measured,
            # because each step's result is assigned once.
            passes.add_sroa_pass()
            passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
            Path(made).write_bytes(machine.emit_object(module))
    except (RuntimeError, OSError) as error:
        return " ".join(str(error).split())
    return ""


def load(made: bytes) -> int | str:
    """The address of the kernel in an object file, or an error message."""
    try:
        import llvmlite.binding as llvm

        with _one_at_a_time:
            key = hashlib.sha256(made).digest()
            if key not in _engines:
                machine = _machine(llvm)
                engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
                engine.add_object_file(llvm.ObjectFileRef.from_data(made))
                engine.finalize_object()
                _engines[key] = engine
            address: int = _engines[key].get_global_value_address("pendula_kernel")
    except (ImportError, RuntimeError) as error:
        return " ".join(str(error).split())
    return address or "it has no pendula_kernel"


def _machine(llvm: Any) -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    # The kernel itself says which instructions it may use.
    return llvm.Target.from_default_triple().create_target_machine(opt=2, codemodel="jitdefault", jit=True)
