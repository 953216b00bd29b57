"""Model files made of functions that were written in a notebook or a program."""

from __future__ import annotations

import ast
import base64
import builtins
import dis
import functools
import hashlib
import importlib.util
import inspect
import marshal
import math
import os
import re
import sys
import textwrap
import types
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ._core import InputError
from ._models import Model
from ._runs import did_you_mean, written_from


class _NoText(Exception):  # noqa: N818  (nobody sees it)
    """The text of a function is not known."""


# The beginning of a file with compiled functions.
COMPILED = """import base64
import importlib.util
import marshal
import types

if importlib.util.MAGIC_NUMBER.hex() != "{magic}":
    raise ImportError("expected Python {version}, which compiled this model; in a file it would have a text")


def _here(code):
    inside = tuple(_here(one) if isinstance(one, types.CodeType) else one for one in code.co_consts)
    return code.replace(co_filename=__file__, co_consts=inside)


def _function(name, code, defaults, keywords, cells):
    code = _here(marshal.loads(base64.b64decode(code)))
    made = types.FunctionType(code, globals(), name, defaults, tuple(map(types.CellType, cells)))
    made.__kwdefaults__ = keywords
    return made"""


class _Text:
    """The text of a function and of all that it uses, as a self-contained file.

    If the text of one of them is unknown, as in a plain interpreter, the file has all of them in compiled form.
    """

    def __init__(self, function: types.FunctionType, *, compiled: bool = False) -> None:
        self._compiled = compiled
        self._imports: set[str] = set()
        self._parts: list[
            tuple[str, dict[int, str]]
        ] = []  # and where lines come from, of a text counted in it
        self._known: dict[str, object] = {}
        if compiled:
            magic, version = importlib.util.MAGIC_NUMBER.hex(), "{}.{}".format(*sys.version_info)
            self._parts.append((COMPILED.replace("{magic}", magic).replace("{version}", version), {}))
        self._add(function, "define", is_model=True)

    def text(self) -> str:
        return "\n".join([*sorted(self._imports), "", "", "\n\n\n".join(part for part, _ in self._parts), ""])

    def lines(self) -> dict[int, str]:
        """The origins of lines of the text. Compiled functions keep their own line numbers."""
        found: dict[int, str] = {}
        first = len(self._imports) + 3
        for part, lines in self._parts:
            found |= {line + (0 if self._compiled else first - 1): where for line, where in lines.items()}
            first += part.count("\n") + 3
        return found

    def _add(self, function: types.FunctionType, name: str, is_model: bool = False) -> None:
        self._require_one(function.__name__, name, function)
        if hasattr(function, "__wrapped__"):
            raise InputError(
                f"{function.__name__}: expected a function without decorators, got one that wraps another"
            )
        if self._compiled:
            self._add_compiled(function, name)
            return
        definition = _definition(function, is_model)
        definition.name = name
        code = function.__code__
        own = {*code.co_varnames, *code.co_cellvars}
        lines: dict[str, int] = {}
        for node in ast.walk(definition):
            if isinstance(node, ast.Name) and node.id not in own:
                lines[node.id] = min(node.lineno, lines.get(node.id, node.lineno))
        self._use_all(function, {used: code.co_firstlineno + line - 1 for used, line in lines.items()})
        text = ast.unparse(definition)
        statements = (
            [node for node in ast.walk(tree) if isinstance(node, ast.stmt)]
            for tree in (definition, ast.parse(text).body[0])
        )
        where = {
            here.lineno: f"{code.co_filename}:{code.co_firstlineno + there.lineno - 1}"
            for there, here in zip(*statements, strict=True)
        }
        self._parts.append((text, where))

    def _add_compiled(self, function: types.FunctionType, name: str) -> None:
        self._use_all(function, dict.fromkeys(_names_in(function.__code__), function.__code__.co_firstlineno))
        defaults = [self._value(function.__name__, "a default", one) for one in function.__defaults__ or ()]
        keywords = {
            key: self._value(function.__name__, key, one)
            for key, one in (function.__kwdefaults__ or {}).items()
        }
        code = base64.b64encode(marshal.dumps(_nowhere(function.__code__), 2)).decode()
        arguments = [
            repr(name),
            repr(code),
            f"({''.join(f'{one}, ' for one in defaults)})",
            f"{{{', '.join(f'{key!r}: {one}' for key, one in keywords.items())}}}",
            f"({''.join(f'{one}, ' for one in function.__code__.co_freevars)})",
        ]
        lines = {line for _, _, line in function.__code__.co_lines() if line is not None}
        where = {line: f"{function.__code__.co_filename}:{line}" for line in lines}
        self._parts.append((f"{name} = _function({', '.join(arguments)})", where))

    def _use_all(self, function: types.FunctionType, lines: Mapping[str, int]) -> None:
        """Adds the names that a function uses from its surroundings, given the lines of their use."""
        surroundings = {**function.__globals__, **_cells(function)}
        for used, line in sorted(lines.items()):
            if used in surroundings:
                self._use(function.__name__, used, surroundings[used])
            elif not hasattr(builtins, used) and used in _names_in(function.__code__):
                raise _unknown_name(function, used, line)

    def _require_one(self, where: str, name: str, what: object) -> bool:
        """Whether a name is new. Raises InputError if it means something else elsewhere."""
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
            self._imports.add(f"import {what.__name__} as {name}")
        elif hasattr(what, "__module__") and hasattr(what, "__name__") and _comes_from(what, "sympy"):
            self._imports.add(f"from {what.__module__} import {getattr(what, '__name__')} as {name}")  # noqa: B009
        else:
            self._parts.append((f"{name} = {self._value(where, name, what)}", {}))

    def _value(self, where: str, name: str, what: object) -> str:
        """A number, a text or an expression of SymPy as text."""
        if _is_plain(what) or what is None:
            return _literal(what)
        if _comes_from(type(what), "sympy"):
            import sympy  # type: ignore[import-untyped]

            self._imports.add("from sympy import *")
            return str(sympy.srepr(what))
        raise InputError(
            f"{where}: expected to use SymPy, numbers, texts and functions, "
            f"got {name}, of type {type(what).__name__}"
        )


def _unknown_name(function: types.FunctionType, name: str, line: int) -> InputError:
    """The error for an unknown name, with its line and similar names."""
    import sympy

    code = function.__code__
    known = [*function.__globals__, *code.co_freevars, *code.co_varnames, *dir(builtins)]
    near = did_you_mean(name, known)
    if hasattr(sympy, name):
        near = f"; SymPy has it: from sympy import {name}"
    return InputError(
        f"{code.co_filename}:{line}: {function.__name__}: expected to use names that are known, got {name}{near}"
    )


def _names_in(code: types.CodeType) -> set[str]:
    """The names that code uses from its surroundings."""
    found = {*code.co_freevars}
    for one in dis.get_instructions(code):
        if one.opname in ("LOAD_GLOBAL", "LOAD_NAME"):
            found.add(one.argval)
    for inside in code.co_consts:
        if isinstance(inside, types.CodeType):
            found |= _names_in(inside) - {*code.co_cellvars}
    return found


def _nowhere(code: types.CodeType) -> types.CodeType:
    """The same code without a file name, so that a model does not depend on where it was typed."""
    inside = tuple(_nowhere(one) if isinstance(one, types.CodeType) else one for one in code.co_consts)
    return code.replace(co_filename="", co_consts=inside)


def _is_plain(what: object) -> bool:
    return isinstance(what, (bool, int, float, complex, str))


def _literal(what: object) -> str:
    """The literal of a number or a text, of a subclass, too."""
    if isinstance(what, float):
        number = float(what)
        return repr(number) if math.isfinite(number) else f'float("{number}")'
    if isinstance(what, bool):
        return repr(what)
    if isinstance(what, int):
        return repr(int(what))
    if what is None or isinstance(what, complex):
        return repr(what)
    return repr(str(what))


def _definition(function: types.FunctionType, is_model: bool) -> ast.FunctionDef:
    """The definition of a function, checked to compile to the same code. Raises InputError, and _NoText."""
    name = function.__name__
    try:
        source = textwrap.dedent(inspect.getsource(function))
        tree = ast.parse(source)
    except (OSError, TypeError, SyntaxError):
        raise _NoText from None
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
    """Whether a definition, compiled with the same free names, gives the code of the function."""
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
    """Whether two codes do the same. They need not be equal: calls of methods depend on where a function stands."""
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
    """The values of a function's free variables."""
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
    """A file with that text, in the cache."""
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
    """The result of :func:`model`. Called with parameters by name it returns a :class:`Model`.

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
        try:
            written: _Text | None = _Text(function)
        except _NoText:
            written = None
        if written is None:  # outside the handler, so that errors do not show its exception
            written = _Text(function, compiled=True)
        self.file: Path = kept_model(name, written.text())
        written_from[str(self.file)] = written.lines()
        functools.update_wrapper(self, function)

    def __call__(
        self,
        links: int | None = None,
        *,
        inputs: Mapping[str, object] | None = None,
        drives: Sequence[Mapping[str, object]] = (),
        feedback: Sequence[Mapping[str, object]] = (),
        **parameters: object,
    ) -> Model:
        how_many = self._links if links is None else links
        made = Model(self.file, how_many, inputs=inputs, drives=drives, feedback=feedback, **parameters)
        made._made_by = self.__name__  # type: ignore[attr-defined]
        return made

    def __repr__(self) -> str:
        return f"<model {self.__name__}>"  # type: ignore[attr-defined]


def model(function: Callable[[Any, int], None]) -> ModelFunction:
    """A decorator that makes an own model from its Lagrangian.

    The function may use SymPy, numbers, texts, and functions of the same kind. They are kept as they are now: later
    changes have no effect. Its kernel is derived and compiled once (or interpreted without a C compiler), and kept. In
    a plain interpreter, where the text of functions is unknown, the compiled function is kept, for this version of
    Python.

    Raises
    ------
    InputError
        It uses something else.

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
