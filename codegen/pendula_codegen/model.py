"""What a model file may say: `define(model, links)` is given a Model and tells it a mechanical system.

    def define(model, links):
        x = model.coordinate("x", "m")
        m = model.parameter("m", "kg", default=1.0, positive=True)
        model.lagrangian = m * model.rate(x)**2 / 2

Everything that is wrong raises GenerationError with the file and the line of the model that said it.
"""

from __future__ import annotations

import builtins
import keyword
import math
import random
import re
import sys
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cached_property
from numbers import Real
from pathlib import Path
from typing import NoReturn

import mpmath
import sympy
from sympy import Add, Expr, Integer, Symbol, expand, lambdify, simplify, sympify

from pendula_codegen.errors import GenerationError
from pendula_codegen.exact import exact
from pendula_codegen.language import refusal
from pendula_codegen.mechanics import LagrangianSystem, jacobian, momenta
from pendula_codegen.simplify import shortest
from pendula_codegen.switches import Switch, Switches, UnknownPieceError, jump

MAX_LINKS = 64  # a slip of the keyboard should not be derived for ever

_KEYWORDS = (
    "alignas alignof and asm auto bitand bitor bool break case catch char class compl concept const consteval "
    "constexpr constinit continue decltype default delete do double dynamic_cast else enum explicit export extern "
    "false float for friend goto if inline int long mutable namespace new noexcept not nullptr operator or private "
    "protected public register reinterpret_cast requires return short signed sizeof static static_assert static_cast "
    "struct switch template this throw true try typedef typeid typename union unsigned using virtual void volatile "
    "wchar_t while xor"
)
CPP_KEYWORDS = frozenset(_KEYWORDS.split())
# What the columns of a file and the members of a kernel are called anyhow.
TAKEN = frozenset(
    {"t", "time", "energy", "links", "link", "name", "inputs", "points", "coordinates", "run", "events"}
)


@dataclass(frozen=True)
class Coordinate:
    symbol: Symbol
    unit: str

    @property
    def is_angle(self) -> bool:
        return self.unit == "rad"


@dataclass(frozen=True)
class Parameter:
    """symbols: one, or one a link; default None where the scenario has to say it."""

    name: str
    unit: str
    symbols: tuple[Symbol, ...]
    default: float | None
    positive: bool
    per_link: bool

    @property
    def names(self) -> list[str]:
        """Of its numbers."""
        return [f"{self.name}_{k + 1}" for k in range(len(self.symbols))] if self.per_link else [self.name]


@dataclass(frozen=True)
class Input:
    symbol: Symbol
    unit: str


@dataclass(frozen=True)
class Motion:
    """What moves as somebody prescribes: a function of time, and what its rates are called."""

    symbol: Symbol
    unit: str
    default: float

    @property
    def rates(self) -> tuple[Symbol, Symbol]:
        first = _rate_symbol(self.symbol)
        return first, _rate_symbol(first)


POINT_KINDS = ("bob", "cart", "pivot", "weight", "floor")
ORIGIN = "origin"  # where springs and threads may end, too


@dataclass(frozen=True)
class Point:
    """kind: what it is drawn as, one of POINT_KINDS."""

    name: str
    components: tuple[Expr, ...]
    kind: str = "bob"


@dataclass(frozen=True)
class Constraint:
    """g(q, t) = 0, or of rates: A(q, t) v + b(q, t) = 0; and the line of the model that said it."""

    name: str
    unit: str
    value: Expr
    where: str
    of_rates: bool = False


@dataclass(frozen=True)
class Connection:
    """Something drawn between two points, by number, -1 for the origin. kind: "rod", "spring",
    "thread" or "pulleys"."""

    kind: str
    ends: tuple[int, int]


@dataclass
class _Said:
    """An expression, and the line of the model that said it."""

    value: Expr
    where: str


@dataclass(eq=False)  # it is what it is by identity, so that results can be kept for it
class Model:
    """A mechanical system as its file tells it; see `define` in the documentation."""

    name: str
    links: int
    file: str
    coordinates: list[Coordinate] = field(default_factory=list)
    parameters: list[Parameter] = field(default_factory=list)
    inputs: list[Input] = field(default_factory=list)
    motions: list[Motion] = field(default_factory=list)
    constraints: list[Constraint] = field(default_factory=list)
    points: list[Point] = field(default_factory=list)
    connections: list[Connection] = field(default_factory=list)
    _forces: list[tuple[Symbol, _Said]] = field(default_factory=list)
    _lagrangian: _Said | None = None
    _dissipation: _Said | None = None
    _names: dict[str, str] = field(default_factory=dict)  # name -> what it is
    _switches: Switches | None = None

    def __post_init__(self) -> None:
        self._switches = Switches(self._new_indicators)

    def __setattr__(self, name: str, value: object) -> None:
        known = name in type(self).__dataclass_fields__ or isinstance(
            getattr(type(self), name, None), property
        )
        if not known:
            raise GenerationError(
                f"{self._line()}: model.{name}: expected lagrangian or dissipation, which can be set"
            )
        object.__setattr__(self, name, value)

    # --- what a model file calls

    def coordinate(self, name: str, unit: str) -> Symbol:
        """A coordinate. Of the unit "rad" it is an angle; anything else is not."""
        symbol = self._declare(name, "a coordinate")
        for rate in dict.fromkeys([rate_name(name), f"{name}_dot"]):
            self._declare(rate, f"the rate of {name}")
        self.coordinates.append(Coordinate(symbol, self._text(unit, "a unit")))
        return symbol

    def rate(self, of: Expr) -> Expr:
        """dq/dt of a coordinate, a symbol; of an expression in coordinates, motions and time, its derivative.

        Of rates and inputs there is none: accelerations are what the equations are solved for. A motion has two.
        """
        value = self._expression(of, "rate")
        slopes = [(c.symbol, _rate_symbol(c.symbol)) for c in self.coordinates]
        for motion in self.motions:
            first, second = motion.rates
            slopes += [(motion.symbol, first), (first, second)]
        fed = sorted({i.symbol.name: i for i in self.inputs if value.has(i.symbol)}.items())
        if fed:
            name, one = fed[0]
            self._fail(
                f"rate holds '{name}', an input, whose rates nobody knows: "
                f'model.motion("{name}", "{one.unit}") is an input that has rates'
            )
        self._check(value, "rate", (*self._positions(), *(symbol for symbol, _ in slopes), self.time))
        for symbol, slope in slopes:
            if value == symbol:
                return slope
        return Add(*(value.diff(q) * v for q, v in slopes), value.diff(self.time))

    def parameter(
        self,
        name: str,
        unit: str,
        *,
        default: float | None = None,
        positive: bool = False,
        per_link: bool = False,
    ) -> Symbol | list[Symbol]:
        """A number that the scenario or a program gives; with per_link a list of one a link, name_1, name_2, …"""
        self._declare(name, "a parameter")
        if default is not None and not isinstance(default, Real):
            self._fail(f"parameter {name}: default: expected a number, got {default!r}")
        if positive and default is not None and not default > 0:
            self._fail(f"parameter {name}: default: expected a number > 0, got {default!r}")
        names = [f"{name}_{i + 1}" for i in range(self.links)] if per_link else [name]
        symbols = tuple(Symbol(each, real=True, positive=positive or None) for each in names)
        for each in names if per_link else ():
            self._declare(each, f"an element of {name}")
        value = None if default is None else float(default)
        self.parameters.append(
            Parameter(name, self._text(unit, "a unit"), symbols, value, positive, per_link)
        )
        return list(symbols) if per_link else symbols[0]

    def input(self, name: str, unit: str) -> Symbol:
        """A number that the scenario or a program gives at every time; it may stand in forces only."""
        symbol = self._declare(name, "an input")
        self.inputs.append(Input(symbol, self._text(unit, "a unit")))
        return symbol

    def motion(self, name: str, unit: str, *, default: float = 0.0) -> Symbol:
        """A prescribed motion: an input that may stand in the Lagrangian and in points, too, and that has rates.

        Drives of a scenario say what it is as an expression of time: `value = "0.1 * sin(3*t)"`. `default` is what it
        is without.
        """
        symbol = self._declare(name, "a motion")
        if not isinstance(default, Real) or isinstance(default, bool):
            self._fail(f"motion {name}: default: expected a number, got {default!r}")
        motion = Motion(symbol, self._text(unit, "a unit"), float(default))
        for rate, which in zip(motion.rates, ("rate", "second rate"), strict=True):
            self._declare(rate.name, f"the {which} of {name}")
        self.motions.append(motion)
        return symbol

    @property
    def time(self) -> Symbol:
        """t, s. It may stand in the Lagrangian, too."""
        return Symbol("t", real=True)

    @property
    def lagrangian(self) -> Expr | None:
        return None if self._lagrangian is None else self._lagrangian.value

    @lagrangian.setter
    def lagrangian(self, value: Expr) -> None:
        self._lagrangian = self._said(value, "lagrangian")

    @property
    def dissipation(self) -> Expr:
        """Rayleigh's function: −∂/∂v of it are forces."""
        return Integer(0) if self._dissipation is None else self._dissipation.value

    @dissipation.setter
    def dissipation(self, value: Expr) -> None:
        self._dissipation = self._said(value, "dissipation")

    def force(self, coordinate: Symbol, value: Expr) -> None:
        """A generalised force along a coordinate, beside what L gives; several add up."""
        if coordinate not in [c.symbol for c in self.coordinates]:
            self._fail(f"force: expected a coordinate of the model first, got {coordinate}")
        self._forces.append((coordinate, self._said(value, "force")))

    def constraint(self, name: str, value: Expr, unit: str) -> None:
        """What is 0 at all times: an expression of coordinates, motions, parameters and time, that may be linear in
        rates, too. Forces keep it so.

        The force is the column force_<name>: J over the unit of the expression; W over it where that has rates.
        """
        self._declare(name, "a constraint")
        self._declare(f"force_{name}", f"the force of {name}")
        value = self._expression(value, f"constraint {name}")
        of_rates = bool(self._switches.behind(value) & {*self._rates()})
        motions = [m.symbol for m in self.motions]
        if of_rates:
            motions += [m.rates[0] for m in self.motions]
        known = (*self._positions(), *(self._rates() if of_rates else ()), *motions, self.time)
        self._check(value, f"constraint {name}", known)
        if self._switches.held_by(value):
            self._fail(
                f"constraint {name}: expected one smooth function, got one of several pieces: a bend in it is a blow"
            )
        if of_rates:
            value = self._linear_in_rates(name, value)
        self.constraints.append(Constraint(name, self._text(unit, "a unit"), value, self._line(), of_rates))

    def _linear_in_rates(self, name: str, value: Expr) -> Expr:
        """The same as A v + b."""
        rates = self._rates()
        slopes = [value.diff(rate) for rate in rates]
        for rate, slope in zip(rates, slopes, strict=True):
            if any(simplify(slope.diff(other)) != 0 for other in rates if slope.has(other)):
                self._fail(
                    f"constraint {name}: expected an expression of positions, or one that is linear in rates, got "
                    f"another function of {rate}"
                )
        still = dict.fromkeys(rates, Integer(0))
        parts = [slope.xreplace(still) * rate for slope, rate in zip(slopes, rates, strict=True)]
        return Add(*parts, value.xreplace(still))

    def point(self, name: str, components: Sequence[Expr], *, kind: str = "bob") -> Point:
        """A point for files and pictures: 2 or 3 components, m.

        kind: what it is drawn as. A "bob" is a ball, a "cart" a box with wheels on the line along which it runs, a
        "pivot" a ring: what others hang on, a "weight" a box, a "floor" a level line below.
        """
        if kind not in POINT_KINDS:
            self._fail(f"point {name}: kind: expected {_listed(POINT_KINDS)}, got {kind!r}")
        if isinstance(components, str) or not isinstance(components, Iterable):
            self._fail(f"point {name}: expected 2 or 3 components, got {components!r}")
        values = tuple(self._expression(value, f"point {name}") for value in components)
        if len(values) not in (2, 3):
            self._fail(f"point {name}: expected 2 or 3 components, got {len(values)}")
        self._name(name)
        for axis in "xyz"[: len(values)]:
            self._declare(f"{name}_{axis}", f"a component of the point {name}")
        motions = (m.symbol for m in self.motions)
        self._check(Add(*values), f"point {name}", (*self._positions(), *motions, self.time))
        self.points.append(Point(name, values, kind))
        return self.points[-1]

    def rod(self, start: Point | str, end: Point | str) -> None:
        """Draws a rod between two points, or a point and "origin".

        Rods between a point and the one before it, whose distance does not change, are drawn without being asked for.
        """
        self._connect("rod", start, end)

    def spring(self, start: Point | str, end: Point | str) -> None:
        """Draws a spring between two points, or a point and "origin". What it does stands in the Lagrangian."""
        self._connect("spring", start, end)

    def thread(self, start: Point | str, end: Point | str) -> None:
        """Draws a thread between two points, or a point and "origin", whose length may change."""
        self._connect("thread", start, end)

    def pulleys(self, start: Point | str, end: Point | str) -> None:
        """Draws a thread up from a point, over a pulley there, to a pulley at another point that is as high."""
        self._connect("pulleys", start, end)

    def _connect(self, kind: str, start: Point | str, end: Point | str) -> None:
        ends = self._end(kind, start), self._end(kind, end)
        if ends[0] == ends[1]:
            self._fail(f"{kind}: expected two different points, got {self._end_name(ends[0])} twice")
        self.connections.append(Connection(kind, ends))

    def _end(self, kind: str, given: Point | str) -> int:
        """The number of a point."""
        names = [point.name for point in self.points]
        name = given.name if isinstance(given, Point) else given
        if name in names:
            return names.index(name)
        if name == ORIGIN:
            return -1
        known = ", ".join([*names, ORIGIN])
        self._fail(f"{kind}: expected a point that the model has by now, one of {known}; got {given!r}")

    def _end_name(self, number: int) -> str:
        return ORIGIN if number < 0 else self.points[number].name

    # --- what the generator asks

    def feed(self, to: Symbol, value: Expr) -> None:
        """Adds a value to an input wherever forces hold it."""
        fed = to + self._expression(value, "feedback")
        self._switches.substitute({to: fed})
        self._forces[:] = [
            (along, _Said(said.value.xreplace({to: fed}), said.where)) for along, said in self._forces
        ]
        vars(self).pop("system", None)  # it was derived without

    def move(self, by: dict[Symbol, Expr]) -> None:
        """Puts functions of time in place of motions, their default in place of the others, and drops them."""
        changes: dict[Symbol, Expr] = {}
        for motion in self.motions:
            value = exact(sympify(motion.default))
            if motion.symbol in by:
                value = self._expression(by[motion.symbol], f"the motion {motion.symbol.name}")
                self._check(value, f"the motion {motion.symbol.name}", (self.time,), self.file)
                for switch in self._switches.held_by(value):
                    if jump(value, switch, self.switches, (self.time,)):
                        self._fail(
                            f"the motion {motion.symbol.name} or its rate jumps where {switch.text} = 0, which would "
                            "be a blow: expected pieces that meet"
                        )
            first, second = motion.rates
            changes |= {motion.symbol: value, first: value.diff(self.time)}
            changes[second] = changes[first].diff(self.time)
        if not changes:
            return

        def moved(said: _Said | None) -> _Said | None:
            return said and _Said(said.value.xreplace(changes), said.where)

        self._switches.substitute(changes)
        self._lagrangian, self._dissipation = moved(self._lagrangian), moved(self._dissipation)
        self._forces[:] = [(along, moved(said)) for along, said in self._forces]
        self.constraints[:] = [replace(each, value=each.value.xreplace(changes)) for each in self.constraints]
        self.points[:] = [
            replace(point, components=tuple(each.xreplace(changes) for each in point.components))
            for point in self.points
        ]
        self.motions.clear()
        vars(self).pop("system", None)  # it was derived without

    @property
    def ordered_parameters(self) -> list[Parameter]:
        """Parameters in the order of the kernel: those of links first, indicators last."""
        return [*sorted(self.parameters, key=lambda parameter: not parameter.per_link), *self.indicators]

    @property
    def switches(self) -> list[Switch]:
        """What decides between pieces of functions."""
        return self._switches.all

    @property
    def indicators(self) -> list[Parameter]:
        """Parameters that who moves the system gives: of each switching function g, 1 where g > 0, and where g < 0."""
        return [
            Parameter(symbol.name, "1", (symbol,), standard, positive=False, per_link=False)
            for switch in self.switches
            for symbol, standard in ((switch.above, 1.0), (switch.below, 0.0))
        ]

    @cached_property
    def system(self) -> LagrangianSystem:
        """The model as mechanics.py takes it, checked. Raises GenerationError."""
        if not self.coordinates:
            raise GenerationError(f"{self.file}: expected a coordinate: model.coordinate(name, unit)")
        if self._lagrangian is None:
            raise GenerationError(f"{self.file}: expected model.lagrangian to be set")
        self._check_lagrangian(self._lagrangian)
        self._check_forces()
        angles = [c.symbol for c in self.coordinates if c.is_angle]
        system = LagrangianSystem(
            name=self.name,
            coordinates=tuple(c.symbol for c in self.coordinates),
            velocities=self._rates(),
            # Motions are known once drives are.
            parameters=(
                *(symbol for p in (*self.parameters, *self.indicators) for symbol in p.symbols),
                *(symbol for m in self.motions for symbol in (m.symbol, *m.rates)),
            ),
            inputs=tuple(i.symbol for i in self.inputs),
            lagrangian=shortest(self._lagrangian.value, angles, self._rates()),
            forces=tuple(self._shortest_force(c.symbol, angles) for c in self.coordinates),
            time=self.time,
        )
        self._check_kinetic(system, self._lagrangian.where)
        self._check_constraints()
        return system

    def held_expressions(self) -> list[Expr]:
        """What moves it."""
        return [
            self.system.lagrangian,
            *self.system.forces,
            *(switch.value for switch in self.switches),
            *(constraint.value for constraint in self.constraints),
        ]

    def constraint_slopes(self, constraint: Constraint) -> list[Expr]:
        """Of a constraint by coordinates, or of one of rates by these: forces are along them."""
        by = self._rates() if constraint.of_rates else [c.symbol for c in self.coordinates]
        return [constraint.value.diff(symbol) for symbol in by]

    def force_along(self, q: Symbol) -> Expr:
        """Generalised force along a coordinate that L does not give, as the file says it."""
        given = [said.value for along, said in self._forces if along == q]
        return Add(*given, -self.dissipation.diff(_rate_symbol(q)))

    def _check_forces(self) -> None:
        known = (*self._moving(), self.time)
        for _, said in self._forces:
            self._check(said.value, "force", (*known, *(i.symbol for i in self.inputs)), said.where)
        if self._dissipation is not None:
            self._check(self._dissipation.value, "dissipation", known, self._dissipation.where)

    def _shortest_force(self, q: Symbol, angles: Sequence[Symbol]) -> Expr:
        return shortest(self.force_along(q), angles, self._rates())

    def _check_lagrangian(self, said: _Said) -> None:
        inputs = {i.symbol for i in self.inputs} & self._switches.behind(said.value)
        if inputs:
            name = min(symbol.name for symbol in inputs)
            raise GenerationError(
                f"{said.where}: lagrangian: the input {name} may stand in forces only: model.force(q, {name})"
            )
        self._check(said.value, "lagrangian", (*self._moving(), self.time), said.where)
        fixed = {symbol for p in self.parameters for symbol in p.symbols}
        for switch in self._switches.held_by(said.value):
            moves = self._switches.behind(switch.value) - fixed
            by_place = bool(moves - {self.time})  # else a jump has no slope in space: there is no blow
            if moves and jump(said.value, switch, self.switches, self._rates(), by_place):
                raise GenerationError(
                    f"{said.where}: lagrangian: it or a momentum jumps where {switch.text} = 0, which would be a "
                    "blow: expected pieces that meet"
                )

    def _check_kinetic(self, system: LagrangianSystem, where: str) -> None:
        rates = set(system.velocities)
        mass = [[expand(entry) for entry in row] for row in jacobian(momenta(system), system.velocities)]
        for q, row in zip(system.coordinates, mass, strict=True):
            if all(entry == 0 for entry in row):
                raise GenerationError(
                    f"{where}: lagrangian: the coordinate {q} has no kinetic energy: its rate {rate_name(q.name)} "
                    "does not stand in it with the power 2"
                )
            if any(entry.free_symbols & rates for entry in row):
                raise GenerationError(
                    f"{where}: lagrangian: expected powers of the rates up to 2, got others of {rate_name(q.name)}"
                )
        if _dependent(mass) is not None:
            raise GenerationError(f"{where}: lagrangian: its mass matrix is singular everywhere")

    def _check_constraints(self) -> None:
        """Refuses those that coordinates cannot meet, or that say again what others say."""
        slopes = [self.constraint_slopes(each) for each in self.constraints]
        dependent = _dependent(slopes) if slopes else None
        for k, (constraint, row) in enumerate(zip(self.constraints, slopes, strict=True)):
            said = f"{constraint.where}: constraint {constraint.name}"
            if constraint.value.is_number and constraint.value != 0:
                raise GenerationError(
                    f"{said}: expected 0 somewhere, got {constraint.value}, which is never 0"
                )
            if not any(row):
                raise GenerationError(f"{said}: expected one that some coordinate or rate changes, got none")
            if k == dependent:
                others = ", ".join(each.name for each in self.constraints[:k])
                raise GenerationError(
                    f"{said}: expected one that others do not contain, got what {others} fix already"
                )

    # --- names, lines and messages

    def _positions(self) -> tuple[Symbol, ...]:
        return (*(c.symbol for c in self.coordinates), *(s for p in self.parameters for s in p.symbols))

    def _moving(self) -> tuple[Symbol, ...]:
        """What equations may hold besides time and inputs."""
        motions = (symbol for m in self.motions for symbol in (m.symbol, *m.rates))
        return (*self._positions(), *self._rates(), *motions)

    def _rates(self) -> tuple[Symbol, ...]:
        return tuple(_rate_symbol(c.symbol) for c in self.coordinates)

    def _said(self, value: object, what: str) -> _Said:
        return _Said(self._expression(value, what), self._line())

    def _expression(self, value: object, what: str) -> Expr:
        if not isinstance(value, (Real, Expr)) or isinstance(value, bool):
            self._fail(f"{what}: expected a SymPy expression, got {type(value).__name__} {value!r}")
        expression = exact(sympify(value))
        try:
            expression = self._switches.without_pieces(
                expression, {s for p in self.parameters for s in p.symbols}
            )
        except UnknownPieceError as error:
            self._fail(f"{what}: {error}")
        refused = refusal(expression)
        if refused is not None:
            self._fail(f"{what}: {refused}")
        return expression

    def _check(self, value: Expr, what: str, known: Sequence[Symbol], where: str | None = None) -> None:
        strangers = sorted(self._switches.behind(value) - set(known), key=lambda symbol: symbol.name)
        if not strangers:
            return
        symbol = strangers[0]
        what_it_is = self._names.get(symbol.name)
        own = {*self._positions(), *self._rates(), *(i.symbol for i in self.inputs)}
        if what_it_is is None:
            why = f"the symbol '{symbol}', which the model does not declare"
        elif symbol in own:
            why = f"'{symbol}', {what_it_is}, which may not stand in it"
        else:
            why = f"a symbol '{symbol}' that is not the model's own, {what_it_is}"
        raise GenerationError(f"{where or self._line()}: {what} holds {why}")

    def _new_indicators(self, number: int) -> tuple[Symbol, Symbol]:
        names = f"above_{number}", f"below_{number}"
        for name in names:
            self._declare(name, "the indicator of a switching function")
        above, below = (Symbol(name, real=True) for name in names)
        return above, below

    def _declare(self, name: str, what: str) -> Symbol:
        self._name(name)
        if name in TAKEN:
            self._fail(f"expected another name than '{name}', which means something already")
        if name in self._names:
            self._fail(f"expected a new name, got '{name}', which is {self._names[name]} already")
        self._names[name] = what
        return Symbol(name, real=True)

    def _name(self, name: object) -> None:
        if (
            not isinstance(name, str)
            or not re.fullmatch(r"[A-Za-z]([A-Za-z0-9_]*[A-Za-z0-9])?", name)
            or "__" in name
        ):
            self._fail(f"expected a name of letters, digits and underscores, got {name!r}")
        if name in CPP_KEYWORDS or (keyword.iskeyword(name) and name != "lambda"):
            self._fail(f"expected a name that no programming language uses, got '{name}'")

    def _text(self, value: object, what: str) -> str:
        if not isinstance(value, str) or not value.isprintable() or '"' in value or "\\" in value:
            self._fail(f"expected {what}, got {value!r}")
        return value

    def _fail(self, what: str) -> NoReturn:
        raise GenerationError(f"{self._line()}: {what}")

    def _line(self) -> str:
        """The line of the model file that is being carried out."""
        frame = sys._getframe()
        while frame is not None:
            if frame.f_code.co_filename == self.file:
                return f"{self.file}:{frame.f_lineno}"
            frame = frame.f_back
        return self.file


def _listed(words: Sequence[str]) -> str:
    return f"{', '.join(map(repr, words[:-1]))} or {words[-1]!r}"


def rate_name(coordinate: str) -> str:
    """x_dot of x, theta_dot_1 of theta_1: an index stays last."""
    stem, index = re.fullmatch(r"(.+?)(_\d+)?", coordinate).groups("")
    return f"{stem}_dot{index}"


def _rate_symbol(q: Symbol) -> Symbol:
    return Symbol(rate_name(q.name), real=True)


def _dependent(rows: list[list[Expr]]) -> int | None:
    """The first row that those before it contain wherever one looks: at a few places, none of which is special."""
    least = 1e-8  # of a row, across those before it; a determinant would shrink with the number of rows
    symbols = sorted({s for row in rows for entry in row for s in entry.free_symbols}, key=lambda s: s.name)
    evaluate = lambdify(symbols, rows, "mpmath")
    draw = random.Random(1)
    contained = {*range(len(rows))}
    for _ in range(3):
        across: list[list[complex]] = []
        for k, row in enumerate(evaluate(*(mpmath.mpf(draw.uniform(0.5, 2)) for _ in symbols))):
            left = whole = [complex(entry) for entry in row]
            for other in across:
                along = sum(x * y.conjugate() for x, y in zip(left, other, strict=True))
                left = [x - along * y for x, y in zip(left, other, strict=True)]
            size = math.hypot(*map(abs, left))
            if size > least * math.hypot(*map(abs, whole)):
                across.append([x / size for x in left])
                contained.discard(k)
    return min(contained, default=None)


def read_model(file: Path, links: int | None = None) -> Model:
    """What the model file defines; `links` is 1 where it has none. Raises GenerationError."""
    if links is not None and not 1 <= links <= MAX_LINKS:
        raise GenerationError(f"{file}: links: expected 1 to {MAX_LINKS}, got {links}")
    define = _define_of(file)
    name = file.stem if links is None else f"{file.stem}_{links}"
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        raise GenerationError(
            f"{file}: expected a file name of letters, digits and underscores, ending in .py"
        )
    model = Model(name, links or 1, str(file))
    try:
        define(model, links or 1)
    except GenerationError:
        raise
    except (Exception, SystemExit) as error:
        raise GenerationError(_said_by(error, file)) from error
    model.system  # noqa: B018  the checks of the whole
    return model


def _define_of(file: Path) -> Callable[[Model, int], None]:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "no text in UTF-8"
        raise GenerationError(f"{file}: expected a model file, got: {reason}") from error
    names: dict[str, object] = {"__name__": file.stem, "__file__": str(file)}
    try:
        exec(compile(text, str(file), "exec"), names)
    except SyntaxError as error:
        raise GenerationError(f"{file}:{error.lineno}: {error.msg}") from error
    except (Exception, SystemExit) as error:
        raise GenerationError(_said_by(error, file)) from error
    define = names.get("define")
    if not callable(define):
        raise GenerationError(f"{file}: expected a function define(model, links), got none")
    return define


def _said_by(error: Exception | SystemExit, file: Path) -> str:
    """An exception of the model file, with the line of the file that it came through last."""
    steps = [
        (frame, line)
        for frame, line in traceback.walk_tb(error.__traceback__)
        if frame.f_code.co_filename == str(file)
    ]
    where = f"{file}:{steps[-1][1]}" if steps else str(file)
    if isinstance(error, SystemExit):
        return f"{where}: expected a model that lets Python go on, got one that calls exit"
    text = " ".join(str(error).split())
    near = _near(error, {**steps[-1][0].f_globals, **steps[-1][0].f_locals}) if steps else ""
    return f"{where}: {type(error).__name__}{': ' + text if text else ''}{near}"


def _near(error: Exception, names: dict[str, object]) -> str:
    """What may have been meant by a name that nobody knows."""
    name = getattr(error, "name", None)
    if isinstance(error, NameError):
        if name is not None and hasattr(sympy, name):
            return f"; SymPy has it: from sympy import {name}"
        known = [*names, *dir(builtins)]
    elif isinstance(error, TypeError) and re.search("convert expression to float|loop of ufunc", str(error)):
        return "; take SymPy's: from sympy import cos, sin"
    elif isinstance(error, AttributeError):
        known = [one for one in dir(error.obj) if not one.startswith("_")]
    else:
        return ""
    found = get_close_matches(name, known, 3) if name is not None else []
    return f"; did you mean {' or '.join(found)}?" if found else ""
