"""The generator of kernels in this process: if a model is a function, SymPy is loaded here already."""

from __future__ import annotations

import importlib
import importlib.util
import io
import re
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

_NAME = "pendula_codegen"
_one_at_a_time = threading.RLock()  # a model may itself use models
_imported: dict[Path, int] = {}  # files of the generator, and their modification times


def generate(codegen: str, python: str, arguments: list[str]) -> tuple[int, str] | None:
    """Does what ``python -m pendula_codegen`` does. Returns its exit status and its output.

    None if a process of its own has to do it: ``python`` is another one, or the packages here are not those that the
    folder ``codegen`` requires.
    """
    if python != sys.executable:
        return None
    with _one_at_a_time:
        main = _main_of(Path(codegen))
        return None if main is None else _run(main, arguments)


def _main_of(codegen: Path) -> Callable[[list[str]], int] | None:
    folder = codegen / _NAME
    found = {file: file.stat().st_mtime_ns for kind in ("*.py", "*.j2") for file in folder.rglob(kind)}
    if _NAME not in sys.modules:
        if not _has_packages(codegen / "requirements.txt") or not _import_package(folder):
            return None
        _imported.update(found)
    # The imported generator is another one, or its files have changed since: the names of kept kernels depend on them.
    if _imported != found:
        return None
    main: Callable[[list[str]], int] = importlib.import_module(f"{_NAME}.__main__").main
    return main


def _has_packages(requirements: Path) -> bool:
    """Whether the packages that generated text depends on are new enough here."""
    try:
        text = requirements.read_text(encoding="utf-8")
        needed = re.findall(r"^(mpmath|sympy)>=(\S+)", text, re.MULTILINE)
        found = [(importlib.import_module(name).__version__, version) for name, version in needed]
        return bool(found) and all(_numbers(here) >= _numbers(version) for here, version in found)
    except Exception:  # another module of that name may be found first
        return False


def _numbers(version: str) -> list[int]:
    """1.13 of 1.13rc2."""
    return [int(part) for part in re.findall(r"\d+", version)[:2]]


def _import_package(folder: Path) -> bool:
    """Imports the generator from a folder, regardless of sys.path. Returns whether that worked."""
    spec = importlib.util.spec_from_file_location(
        _NAME, folder / "__init__.py", submodule_search_locations=[str(folder)]
    )
    if spec is None or spec.loader is None:
        return False
    package = importlib.util.module_from_spec(spec)
    sys.modules[_NAME] = package
    try:
        spec.loader.exec_module(package)
        importlib.import_module(f"{_NAME}.__main__")
    except BaseException as error:
        del sys.modules[_NAME]
        if isinstance(error, Exception):  # a package is missing, or another module has its name
            return False
        raise
    return True


def _run(main: Callable[[list[str]], int], arguments: list[str]) -> tuple[int, str]:
    import mpmath  # type: ignore[import-untyped]

    memory = io.BytesIO()
    printed = io.TextIOWrapper(memory, encoding="utf-8", errors="backslashreplace", write_through=True)
    with _printing_to(printed), mpmath.workprec(53):
        try:
            status = main(arguments)
        except SystemExit as end:  # also if a model raises it
            status = _status_of(end)
        except Exception:
            traceback.print_exc()
            status = 1
    return status, memory.getvalue().decode(errors="replace")


def _status_of(end: SystemExit) -> int:
    if end.code is None or isinstance(end.code, int):
        return end.code or 0
    print(end.code, file=sys.stderr)
    return 1


class _Printer:
    """Standard output or error: one file for this thread, another for all others."""

    def __init__(self, ours: TextIO, theirs: TextIO) -> None:
        self._ours, self._theirs = ours, theirs
        self._thread = threading.get_ident()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._ours if threading.get_ident() == self._thread else self._theirs, name)


@contextmanager
def _printing_to(printed: TextIO) -> Iterator[None]:
    """Redirects the output of this thread; others print as before."""
    usual = {name: getattr(sys, name) for name in ("stdout", "stderr")}
    ours = {name: _Printer(printed, stream or io.StringIO()) for name, stream in usual.items()}
    for name, stream in ours.items():
        setattr(sys, name, stream)
    try:
        yield
    finally:
        for name, stream in usual.items():
            if getattr(sys, name) is ours[name]:
                setattr(sys, name, stream)
