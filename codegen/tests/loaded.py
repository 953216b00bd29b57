"""Kernels in C, compiled and called: rows of numbers in, rows of numbers out."""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from platform import machine
from typing import Any

from pendula_codegen.backends.c_series import lanes_of, padded_state
from pendula_codegen.kernel_program import render_c, render_llvm
from pendula_codegen.model import Model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.table import OF_MANY, PLAIN, KernelTable, TableFunction, kernel_table

LLVM = "llvm"
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)] + [LLVM] * bool(find_spec("llvmlite"))
# What LLVM's text calls them; the widest that this processor has.
FEATURES = Path("/proc/cpuinfo").read_text() if machine() == "x86_64" else ""
WIDEST = "avx512" if " avx512dq " in FEATURES else "avx2" if " avx2 " in FEATURES else "baseline"
INSTRUCTION_SETS = {"native": WIDEST, "haswell": "avx2", "x86-64": "sse2"}
WIDTHS = (1, 2, 4, 8)
SERIES_FUNCTIONS = (1, 2)  # after those of a table, and the iteration
FLAGS = ("-O2", "-fPIC", "-shared", "-ffp-contract=fast", "-fno-math-errno", "-Wall", "-Wextra", "-Werror")

Rows = list[list[float]]  # of a coordinate, a parameter …, a number of each state


class _Conditions(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("context", "parameters", "times", "inputs")]


class _Kernel(ctypes.Structure):
    _fields_ = [
        ("interface", ctypes.c_int),
        ("description", ctypes.c_char_p),
        ("functions", ctypes.POINTER(ctypes.c_void_p) * len(WIDTHS)),
        ("plain", ctypes.POINTER(ctypes.c_void_p)),
    ]


class _StageIteration(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("m", "hb", "start", "weights", "increments")]


class _SeriesRows(ctypes.Structure):
    _fields_ = [(name, ctypes.c_void_p) for name in ("unit", "state", "kept", "operands")]


class _IterationChange(ctypes.Structure):
    _fields_ = [("change", ctypes.c_double), ("size", ctypes.c_double)]


class Numbers:
    """Numbers at an address that any register may be loaded from."""

    def __init__(self, values: list[float]):
        self._memory = (ctypes.c_double * (len(values) + 8))()
        start = ctypes.addressof(self._memory)
        self._first = (-start % 64) // 8
        self.address = start + 8 * self._first
        for k, value in enumerate(values):
            self._memory[self._first + k] = value
        self._count = len(values)

    def all(self) -> list[float]:
        return self._memory[self._first : self._first + self._count]


def flat(rows: Rows) -> Numbers:
    return Numbers([number for row in rows for number in row])


def jit(text: str) -> Any:
    """The engine that has a kernel of LLVM's text; what is wrong with that is an error."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    module = llvm.parse_assembly(text)
    module.verify()
    machine = llvm.Target.from_default_triple().create_target_machine(jit=True)
    passes = llvm.create_new_module_pass_manager()
    passes.add_sroa_pass()  # as python/pendula/_jit.py has it
    passes.run(module, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.finalize_object()
    return engine


@cache
def table_of(model: Model) -> KernelTable:
    """It is derived once."""
    return kernel_table(ModelKernel(model))


class LoadedKernel:
    """The kernel of a model, by a compiler, with instructions that `march` names; or by LLVM from its own text."""

    def __init__(self, model: Model, folder: Path, compiler: str, march: str = "native"):
        self.model = model
        self.table = table_of(model)
        if compiler == LLVM:
            self._library = jit(render_llvm(model, INSTRUCTION_SETS[march]))
            self._kernel = _Kernel.from_address(self._library.get_global_value_address("pendula_kernel"))
        else:
            self._library = self._compiled(model, folder, compiler, march)
            self._kernel = _Kernel.in_dll(self._library, "pendula_kernel")
        self.interface = self._kernel.interface
        self.description = self._kernel.description.decode()

    @staticmethod
    def _compiled(model: Model, folder: Path, compiler: str, march: str) -> ctypes.CDLL:
        source = folder / f"{model.name}.c"
        source.write_text(render_c(model, Path(model.file).name, source.name), encoding="utf-8")
        shared = folder / f"{model.name}-{compiler}-{march}.so"
        command = [compiler, *FLAGS, f"-march={march}", str(source), "-o", str(shared), "-lm"]
        ended = subprocess.run(command, capture_output=True, text=True)
        assert ended.returncode == 0 and ended.stderr == "", f"{' '.join(command)}:\n{ended.stderr}"
        return ctypes.CDLL(str(shared))

    def call(self, name: str, width: int, given: dict[str, Rows]) -> dict[str, Rows]:
        """What a function gives; `given` has rows of all that functions take."""
        if name in PLAIN:
            function, address = self.table.plain[PLAIN.index(name)], self._kernel.plain[PLAIN.index(name)]
        else:
            place = OF_MANY.index(name)
            function = self.table.of_many[place]
            address = self._kernel.functions[WIDTHS.index(width)][place]
        assert function is not None and address is not None
        taken = [flat(given[array]) for array in function.takes]
        found = [Numbers([0.0] * rows * width) for rows in sizes(function).values()]
        conditions, kept = self._conditions(given)
        places = [numbers.address for numbers in (*taken, *found)]
        ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * (1 + len(places)))(address)(
            ctypes.addressof(conditions), *places
        )
        del kept
        return {
            array: [[*numbers.all()[k : k + width]] for k in range(0, len(numbers.all()), width)]
            for array, numbers in zip(sizes(function), found, strict=True)
        }

    def iterate(
        self, width: int, given: dict[str, Rows], stages: dict[str, list[float]]
    ) -> tuple[list[float], float, float]:
        """The new increments, the largest change, and the largest of them."""
        address = self._kernel.functions[WIDTHS.index(width)][len(OF_MANY)]
        conditions, kept = self._conditions(given)
        held = {name: Numbers(values) for name, values in stages.items()}
        on = _StageIteration(**{name: numbers.address for name, numbers in held.items()})
        function = ctypes.CFUNCTYPE(_IterationChange, ctypes.c_void_p, ctypes.c_void_p)(address)
        change = function(ctypes.addressof(conditions), ctypes.addressof(on))
        del kept
        return held["increments"].all(), change.change, change.size

    def series(
        self, width: int, given: dict[str, Rows], inputs: list[Rows], unit: list[float], parts: list[range]
    ) -> list[Rows]:
        """The state's coefficients, order by order.

        given    parameters, times, and the state at order 0
        inputs   their coefficients, order by order
        parts    orders that are asked for together
        """
        tapes = self.table.series
        order, size = parts[-1].stop, 2 * tapes.series.size
        state_row = padded_state(tapes.series.size) if width == 1 else size * width
        lanes = 2 * lanes_of(len(tapes.series.sums))
        row = lanes if width == 1 else len(tapes.series.operands) * width
        flat_state = [number for each in given["state"] for number in each]
        held = {
            "unit": Numbers(unit),
            "state": Numbers([*flat_state, *[math.nan] * (state_row * (order + 1) - len(flat_state))]),
            "kept": Numbers([math.nan] * max(1, tapes.kept * width)),
            "operands": Numbers([math.nan] * max(1, row * order)),
        }
        rows = _SeriesRows(**{name: numbers.address for name, numbers in held.items()})
        conditions, kept = self._conditions({**given, "inputs": [each for rows in inputs for each in rows]})
        place = ctypes.addressof(conditions), ctypes.addressof(rows)
        start, following = (
            self._kernel.functions[WIDTHS.index(width)][len(OF_MANY) + k] for k in SERIES_FUNCTIONS
        )
        ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(start)(*place)
        take = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int, ctypes.c_int)(following)
        for part in parts:
            take(*place, part.start, part.stop - 1)
        del kept
        found = held["state"].all()
        return [
            [found[k * state_row + i * width : k * state_row + (i + 1) * width] for i in range(size)]
            for k in range(order + 1)
        ]

    @staticmethod
    def _conditions(given: dict[str, Rows]) -> tuple[_Conditions, list[Numbers]]:
        kept = [flat(given[name]) for name in ("parameters", "times", "inputs")]
        return _Conditions(None, *(numbers.address for numbers in kept)), kept


def sizes(function: TableFunction) -> dict[str, int]:
    """How many rows each array has that it gives."""
    rows = [array for array, _ in function.tape.outputs]
    return {array: rows.count(array) for array in function.gives}
