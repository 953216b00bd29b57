"""Model files made of functions that were written in a notebook or a program."""

from __future__ import annotations

import ast
import builtins
import dis
import functools
import hashlib
import inspect
import math
import os
import re
import textwrap
import types
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ._core import InputError
from ._models import Model


class _Text:
    """The text of a function and of all that it uses, as one that stands alone."""

    def __init__(self, function: types.FunctionType) -> None:
        self.imports: set[str] = set()
        self.parts: list[str] = []
        self._known: dict[str, object] = {}
        self._add(function, "define", is_model=True)

    def text(self) -> str:
        return "\n".join([*sorted(self.imports), "", "", "\n\n\n".join(self.parts), ""])

    def _add(self, function: types.FunctionType, name: str, is_model: bool = False) -> None:
        self._require_one(function.__name__, name, function)
        definition = _definition(function, is_model)
        definition.name = name
        surroundings = {**function.__globals__, **_cells(function)}
        own = {*function.__code__.co_varnames, *function.__code__.co_cellvars}
        for used in sorted({node.id for node in ast.walk(definition) if isinstance(node, ast.Name)} - own):
            if used in surroundings:
                self._use(function.__name__, used, surroundings[used])
            elif not hasattr(builtins, used) and used in function.__code__.co_names:
                raise InputError(f"{function.__name__}: expected to use names that are known, got {used}")
        self.parts.append(ast.unparse(definition))

    def _require_one(self, where: str, name: str, what: object) -> bool:
        """Whether a name is new. Raises InputError where it means something else elsewhere."""
        if name not in self._known:
            self._known[name] = what
            return True
        before = self._known[name]
        if before is what or (type(before) is type(what) and _is_plain(what) and before == what):
            return False
        raise InputError(f"{where}: expected one meaning of {name} in all functions of a model, got two")

    def _use(self, where: str, name: str, what: object) -> None:
        if name in self._known and self._known[name] is what:
            return
        if isinstance(what, types.FunctionType) and not _comes_from(what, "sympy"):
            self._add(what, name)
            return
        if not self._require_one(where, name, what):
            return
        if isinstance(what, types.ModuleType):
            self.imports.add(f"import {what.__name__} as {name}")
        elif _is_plain(what):
            self.parts.append(f"{name} = {_literal(what)}")
        elif hasattr(what, "__module__") and hasattr(what, "__name__") and _comes_from(what, "sympy"):
            self.imports.add(f"from {what.__module__} import {getattr(what, '__name__')} as {name}")  # noqa: B009
        elif _comes_from(type(what), "sympy"):
            import sympy  # type: ignore[import-untyped]

            self.imports.add("from sympy import *")
            self.parts.append(f"{name} = {sympy.srepr(what)}")
        else:
            raise InputError(
                f"{where}: expected to use SymPy, numbers, texts and functions, "
                f"got {name}, of type {type(what).__name__}"
            )


def _is_plain(what: object) -> bool:
    return isinstance(what, (bool, int, float, complex, str))


def _literal(what: object) -> str:
    """Of a number or a text, whatever class of them it is of."""
    if isinstance(what, float):
        number = float(what)
        return repr(number) if math.isfinite(number) else f'float("{number}")'
    if isinstance(what, bool):
        return repr(what)
    if isinstance(what, int):
        return repr(int(what))
    return repr(complex(what)) if isinstance(what, complex) else repr(str(what))


def _definition(function: types.FunctionType, is_model: bool) -> ast.FunctionDef:
    """The text of a function, which is compiled to what the function is. Raises InputError."""
    name = function.__name__
    if hasattr(function, "__wrapped__"):
        raise InputError(f"{name}: expected a function without decorators, got one that wraps another")
    try:
        source = textwrap.dedent(inspect.getsource(function))
        tree = ast.parse(source)
    except (OSError, TypeError, SyntaxError):
        raise InputError(f"{name}: expected a function whose text is known, got none") from None
    definition = tree.body[0] if tree.body else None
    if not isinstance(definition, ast.FunctionDef) or definition.name != name:
        raise InputError(
            f"{name}: expected a function by def, whose text has not changed since, got another text"
        )
    if len(definition.decorator_list) > (1 if is_model else 0):
        raise InputError(
            f"{name}: expected a function without other decorators, got {len(definition.decorator_list)}"
        )
    definition.decorator_list = []
    if not _is_text_of(definition, function):
        raise InputError(f"{name}: expected a function whose text has not changed since, got another text")
    definition.returns = None
    for argument in [*definition.args.posonlyargs, *definition.args.args, *definition.args.kwonlyargs]:
        argument.annotation = None
    return definition


def _is_text_of(definition: ast.FunctionDef, function: types.FunctionType) -> bool:
    """Compiles it where the same names are free."""
    arguments = [ast.arg(free) for free in function.__code__.co_freevars]
    around = ast.FunctionDef(
        name="around",
        args=ast.arguments(posonlyargs=[], args=arguments, kwonlyargs=[], kw_defaults=[], defaults=[]),
        body=[definition],
        decorator_list=[],
        lineno=1,
        col_offset=0,
    )
    module = ast.fix_missing_locations(ast.Module([around], []))
    flags = function.__code__.co_flags & 0x1000000  # from __future__ import annotations
    outer = next(
        c for c in compile(module, "", "exec", flags, True).co_consts if isinstance(c, types.CodeType)
    )
    return any(_same(c, function.__code__) for c in outer.co_consts if isinstance(c, types.CodeType))


def _same(a: types.CodeType, b: types.CodeType) -> bool:
    """Whether they do the same; how methods are called depends on where a function stands."""
    if _operations(a) != _operations(b) or len(a.co_consts) != len(b.co_consts):
        return False
    for one, other in zip(a.co_consts, b.co_consts, strict=True):
        if isinstance(one, types.CodeType) and isinstance(other, types.CodeType):
            if not _same(one, other):
                return False
        elif type(one) is not type(other) or one != other:
            return False
    return True


def _operations(code: types.CodeType) -> list[str]:
    told = ("LOAD_", "STORE_", "BINARY_", "UNARY_", "COMPARE_", "CONTAINS_", "IS_", "BUILD_")
    return [
        one.argrepr.replace("NULL + ", "")
        for one in dis.get_instructions(code)
        if one.opname.startswith(told) and not isinstance(one.argval, types.CodeType)
    ]


def _cells(function: types.FunctionType) -> dict[str, object]:
    """What surrounds it where it was defined."""
    found: dict[str, object] = {}
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        try:
            found[name] = cell.cell_contents
        except ValueError:
            raise InputError(
                f"{function.__name__}: expected {name} to be known by now, got nothing"
            ) from None
    return found


def _comes_from(what: Any, package: str) -> bool:
    return str(getattr(what, "__module__", "")).split(".")[0] == package


def _cache() -> Path:
    kept = os.environ.get("XDG_CACHE_HOME", "")
    return (Path(kept) if os.path.isabs(kept) else Path.home() / ".cache") / "pendula" / "functions"


def kept_model(name: str, text: str) -> Path:
    """A file with that text."""
    folder = _cache() / hashlib.sha256(text.encode()).hexdigest()[:16]
    file = folder / f"{name}.py"
    try:
        if file.exists() and file.read_text(encoding="utf-8") == text:
            return file
        folder.mkdir(parents=True, exist_ok=True)
        written = file.with_suffix(f".{os.getpid()}")
        written.write_text(text, encoding="utf-8")
        written.replace(file)
    except OSError as error:
        raise InputError(
            f"{name}: expected to write the model to {folder}, got: {error.strerror} "
            "(XDG_CACHE_HOME names another folder)"
        ) from None
    return file


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
        name = function.__name__
        arguments = inspect.signature(function).parameters
        kinds = {argument.kind for argument in arguments.values()}
        if len(arguments) != 2 or kinds != {inspect.Parameter.POSITIONAL_OR_KEYWORD}:
            raise InputError(
                f"{name}: expected the arguments (model, links), got {inspect.signature(function)}"
            )
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            raise InputError(
                f"{name}: expected a name of letters, digits and underscores, as files have them"
            )
        given = list(arguments.values())[1].default
        self._links = given if isinstance(given, int) else None
        self.file: Path = kept_model(name, _Text(function).text())
        functools.update_wrapper(self, function)

    def __call__(
        self,
        links: int | None = None,
        *,
        inputs: Mapping[str, float] | None = None,
        drives: Sequence[Mapping[str, object]] = (),
        feedback: Sequence[Mapping[str, object]] = (),
        **parameters: object,
    ) -> Model:
        how_many = self._links if links is None else links
        return Model(self.file, how_many, inputs=inputs, drives=drives, feedback=feedback, **parameters)

    def __repr__(self) -> str:
        return f"<model {self.__name__}: {self.file}>"  # type: ignore[attr-defined]


def model(function: Callable[[Any, int], None]) -> ModelFunction:
    """A model of one's own, by its Lagrangian, as a decorator.

    The function may use SymPy, numbers, texts, and functions like it, which are kept as they are now: what changes
    later has no effect. Its kernel is derived and compiled once (or interpreted where there is no C compiler), and
    kept.

    Raises
    ------
    InputError
        It uses something else, or its text is not known.

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
