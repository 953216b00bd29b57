"""Model files made of functions that were written in a notebook or a program."""

from __future__ import annotations

import ast
import functools
import hashlib
import inspect
import os
import textwrap
import types
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ._core import InputError
from ._systems import Model


class _Text:
    """The text of a function and of all that it uses, as one that stands alone."""

    def __init__(self, function: types.FunctionType) -> None:
        self.imports: list[str] = []
        self.parts: list[str] = []
        self._known: set[str] = set()
        self._add(function, "define")

    def text(self) -> str:
        return "\n".join([*sorted(set(self.imports)), "", "", "\n\n\n".join(self.parts), ""])

    def _add(self, function: types.FunctionType, name: str) -> None:
        try:
            source = textwrap.dedent(inspect.getsource(function))
        except (OSError, TypeError):
            raise InputError(
                f"{function.__name__}: expected a function whose text is known, got none"
            ) from None
        tree = ast.parse(source)
        definition = tree.body[0]
        if not isinstance(definition, ast.FunctionDef):
            raise InputError(
                f"{function.__name__}: expected a function by def, got {type(definition).__name__}"
            )
        definition.decorator_list = []
        definition.name = name
        definition.returns = None
        for argument in [*definition.args.posonlyargs, *definition.args.args, *definition.args.kwonlyargs]:
            argument.annotation = None
        for used in inspect.getclosurevars(function).globals.items():
            self._use(function, *used)
        for used in inspect.getclosurevars(function).nonlocals.items():
            self._use(function, *used)
        self.parts.append(ast.unparse(definition))

    def _use(self, function: types.FunctionType, name: str, what: object) -> None:
        if name in self._known:
            return
        self._known.add(name)
        if isinstance(what, types.ModuleType):
            self.imports.append(f"import {what.__name__} as {name}")
        elif isinstance(what, (bool, int, float, complex, str)):
            self.parts.append(f"{name} = {what!r}")
        elif isinstance(what, types.FunctionType) and not _comes_from(what, "sympy"):
            self._add(what, name)
        elif hasattr(what, "__module__") and hasattr(what, "__name__") and _comes_from(what, "sympy"):
            self.imports.append(f"from {what.__module__} import {what.__name__} as {name}")
        elif _comes_from(type(what), "sympy"):
            import sympy  # type: ignore[import-untyped]

            self.imports.append("from sympy import *")
            self.parts.append(f"{name} = {sympy.srepr(what)}")
        else:
            raise InputError(
                f"{function.__name__}: expected to use SymPy, numbers, texts and functions, "
                f"got {name}, of type {type(what).__name__}"
            )


def _comes_from(what: Any, package: str) -> bool:
    return str(getattr(what, "__module__", "")).split(".")[0] == package


def _cache() -> Path:
    kept = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(kept) if os.path.isabs(kept) else Path.home() / ".cache") / "pendula" / "functions"


class ModelFunction:
    """What :func:`model` makes: called with parameters by name it gives a :class:`Model`.

    Attributes
    ----------
    file : Path
        A model file with the function and all that it uses, as ``pendula simulate`` takes it, too.
    """

    def __init__(self, function: Callable[[Any, int], None]) -> None:
        if not isinstance(function, types.FunctionType):
            raise TypeError(f"model: expected a function, got {type(function).__name__}")
        arguments = list(inspect.signature(function).parameters)
        if len(arguments) != 2:
            raise InputError(f"{function.__name__}: expected the arguments (model, links), got {arguments}")
        text = _Text(function).text()
        folder = _cache() / hashlib.sha256(text.encode()).hexdigest()[:16]
        folder.mkdir(parents=True, exist_ok=True)
        self.file = folder / f"{function.__name__}.py"
        if not self.file.exists():
            written = self.file.with_suffix(f".{os.getpid()}")
            written.write_text(text, encoding="utf-8")
            written.replace(self.file)
        functools.update_wrapper(self, function)

    def __call__(
        self,
        links: int | None = None,
        *,
        inputs: Mapping[str, float] | None = None,
        drives: Sequence[Mapping[str, object]] = (),
        **parameters: object,
    ) -> Model:
        return Model(self.file, links, inputs=inputs, drives=drives, **parameters)

    def __repr__(self) -> str:
        return f"<model {self.__name__}: {self.file}>"  # type: ignore[attr-defined]


def model(function: Callable[[Any, int], None]) -> ModelFunction:
    """A model of one's own, by its Lagrangian, as a decorator.

    The function may use SymPy, numbers and other functions of its module. Its kernel is derived and compiled once (or
    interpreted where there is no C compiler), and kept.

    Examples
    --------
    >>> import pendula
    >>> from sympy import cos
    >>> @pendula.model  # doctest: +SKIP
    ... def swing(model, links):
    ...     theta = model.coordinate("theta", "rad")
    ...     length = model.parameter("length", "m", default=1.0, positive=True)
    ...     model.lagrangian = length**2 * model.rate(theta) ** 2 / 2 + 9.81 * length * cos(theta)
    >>> swing(length=2.0).simulate(1.0, theta=0.5)  # doctest: +SKIP
    """
    return ModelFunction(function)
