"""The atoms in which a kernel function is written: arguments, sines and cosines, named intermediates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from sympy import Add, Expr, Integer, Symbol, cos, sin

from pendula_codegen.errors import GenerationError
from pendula_codegen.places import Place
from pendula_codegen.polynomial import Call, Expander, Polynomial, constant, ordered, quotient


@dataclass(frozen=True)
class Leaf:
    """A value that a function reads, and where it stands.

    kind   parameter, input, q, v, a or p: see ORDERS
    """

    symbol: Symbol
    place: Place
    kind: str


@dataclass(frozen=True)
class Angle:
    """A coordinate whose sine and cosine are computed once each.

    place   where the angle stands, or
    given   where its sine and cosine do, computed already
    """

    symbol: Symbol
    place: Place | None = None
    given: tuple[Place, Place] | None = None


@dataclass(frozen=True)
class Atom:
    """One atom: read from a place, or a function of what stands there, or computed from a definition or an argument.

    kind         see ORDERS
    function     what is computed of the place, or of the argument
    definition   what the atom stands for
    argument     of the function, in other atoms
    difference   a function, and two angles of whose difference the atom is that function
    """

    name: str
    kind: str
    place: Place | None = None
    function: Call = ""
    definition: Expr | None = None
    argument: Polynomial | None = None
    difference: tuple[str, Symbol, Symbol] | None = None
    position: int = 0  # among all atoms, as the arguments have them

    @property
    def is_call(self) -> bool:
        """Whether computing it takes a sine, a root or the like."""
        return bool(self.function) or self.kind == "trig"


@dataclass(frozen=True)
class Form:
    """What a program's atoms are; the generator tries several forms and keeps the one with fewest operations.

    pair_angles   sines and cosines of differences of two angles are atoms (else expanded in the angles)
    expanded      symbols that are replaced by what they are defined as
    """

    pair_angles: bool
    expanded: frozenset[Symbol]


@dataclass(frozen=True)
class Order:
    """Which atom is pulled out first when several are in equally many terms."""

    kinds: tuple[str, ...]
    last_link_first: bool = False


# What an equation gains from an order depends on its structure; these won somewhere when more were tried on
# planar 2–8 and spatial 2–5. The first is tried with every form, the others with the best form of the first.
ORDERS = (
    Order(("definition", "parameter", "input", "v", "a", "p", "trig", "pair")),
    Order(("definition", "parameter", "input", "v", "a", "p", "trig", "pair"), last_link_first=True),
    Order(("pair", "trig", "v", "a", "p", "definition", "parameter", "input")),
    Order(("trig", "pair", "v", "a", "p", "parameter", "definition", "input"), last_link_first=True),
)


# Of how many angles a sine is expanded in theirs; of more, terms that cancel would cost its digits.
MOST_ANGLES = 4


class Vocabulary:
    """All atoms that one program may be written in."""

    def __init__(
        self,
        leaves: Sequence[Leaf],
        angles: Sequence[Angle],
        definitions: dict[Symbol, Expr],
        form: Form,
        keep_sums: bool = False,
    ):
        self.atoms: list[Atom] = []
        self._form = form
        self._definitions = definitions
        self._angles = {angle.symbol: k for k, angle in enumerate(angles)}
        self._numbers: dict[Expr, int] = {}
        self._pairs: dict[tuple[type, Symbol, Symbol], int] = {}
        self._calls: dict[tuple, int] = {}
        self._expander = Expander(self._atom, self._call, keep_sums)
        for symbol, definition in definitions.items():
            if symbol not in form.expanded:
                self._add(symbol, Atom(symbol.name, "definition", definition=definition))
        for leaf in leaves:
            self._add(leaf.symbol, Atom(leaf.symbol.name, leaf.kind, leaf.place))
        for angle in angles:
            self._add_angle(angle)
        if form.pair_angles:
            self._add_pairs(list(self._angles))

    def _add(self, expression: Expr, atom: Atom) -> int:
        self._numbers[expression] = len(self.atoms)
        self.atoms.append(replace(atom, position=len(self.atoms)))
        return self._numbers[expression]

    def _add_angle(self, angle: Angle) -> None:
        for k, function in enumerate((sin, cos)):
            name = f"{function.__name__}_{angle.symbol.name}"
            if angle.given:
                self._add(function(angle.symbol), Atom(name, "trig", angle.given[k]))
            else:
                self._add(function(angle.symbol), Atom(name, "trig", angle.place, function.__name__))

    def _add_pairs(self, angles: list[Symbol]) -> None:
        """Atoms for sin and cos of the difference of two angles: cos_theta_1_2."""
        for k, first in enumerate(angles):
            for second in angles[k + 1 :]:
                for function in (sin, cos):
                    name = f"{function.__name__}_{_both(first.name, second.name)}"
                    definition = _of_sum(function, [(1, first), (-1, second)])
                    of = (function.__name__, first, second)
                    atom = Atom(name, "pair", definition=definition, difference=of)
                    number = self._add(Symbol(name), atom)
                    self._pairs[(function, first, second)] = number

    def polynomial(self, expression: Expr) -> Polynomial:
        """`expression` in these atoms; raises GenerationError where it holds something else."""
        return ordered(self._expander.expand(expression))

    def definitions(self, polynomials: Iterable[Polynomial]) -> dict[int, Polynomial]:
        """The definitions of the atoms that the polynomials hold, also through other definitions."""
        found: dict[int, Polynomial] = {}
        waiting = list(polynomials)
        while waiting:
            for atom in sorted({atom for monomial in waiting.pop() for atom in monomial}):
                held = self._held_by(self.atoms[atom])
                if held is not None and atom not in found:
                    found[atom] = held
                    waiting.append(held)
        return found

    def _held_by(self, atom: Atom) -> Polynomial | None:
        return self.polynomial(atom.definition) if atom.definition is not None else atom.argument

    def ranking(self, order: Order) -> list[int]:
        """All atoms, in the order in which they are factored out."""
        sign = -1 if order.last_link_first else 1
        kinds = {kind: k for k, kind in enumerate(order.kinds)}
        return sorted(
            range(len(self.atoms)), key=lambda a: (kinds.get(self.atoms[a].kind, len(kinds)), sign * a)
        )

    def _atom(self, expression: Expr) -> Polynomial:
        if expression in self._form.expanded:
            return self.polynomial(self._definitions[expression])
        if expression in self._numbers:
            return {(self._numbers[expression],): 1}
        if isinstance(expression, Symbol):
            raise GenerationError(f"a kernel holds the symbol '{expression}', which is not an argument")
        return self._trig(type(expression), expression.args[0])

    def _trig(self, function: type, angle: Expr) -> Polynomial:
        """sin or cos, of an integer combination of angles by those of the angles."""
        parts = [term.as_coeff_Mul() for term in Add.make_args(angle)]
        if any(symbol not in self._angles or not isinstance(c, Integer) for c, symbol in parts) or (
            sum(abs(c) for c, _ in parts) > MOST_ANGLES
        ):
            return self._call(function.__name__, self.polynomial(angle))
        parts.sort(key=lambda part: self._angles[part[1]])
        terms = [(int(c), symbol) for c, symbol in parts]
        if [abs(c) for c, _ in terms] == [1, 1] and terms[0][0] == -terms[1][0]:
            number = self._pairs.get((function, terms[0][1], terms[1][1]))
            if number is not None:
                return {(number,): terms[0][0] if function is sin else 1}
        return self.polynomial(_of_sum(function, terms))

    def _call(self, function: Call, argument: Polynomial) -> Polynomial:
        """A function of a polynomial, as an atom; equal ones are one atom."""
        number = constant(argument)
        if number is not None and function == "inverse" and number:
            return {(): quotient(1, number)}
        key = (function, tuple(ordered(argument).items()))
        if key not in self._calls:
            word = (function if isinstance(function, str) else function[0]) or "sum"
            name = f"{word}_{sum(1 for known, _ in self._calls if known == function) + 1}"
            self._calls[key] = len(self.atoms)
            self.atoms.append(
                Atom(name, "call", function=function, argument=ordered(argument), position=len(self.atoms))
            )
        return {(self._calls[key],): 1}


def _both(first: str, second: str) -> str:
    """theta_1 and theta_2 as theta_1_2; names of no such pattern side by side."""
    kind, _, i = first.rpartition("_")
    other, _, j = second.rpartition("_")
    return f"{kind}_{i}_{j}" if kind and kind == other else f"{first}_{second}"


def _of_sum(function: type, terms: list[tuple[int, Symbol]]) -> Expr:
    """sin or cos of Σ count·angle by angle addition, one angle at a time."""
    sine, cosine = Integer(0), Integer(1)
    for count, angle in terms:
        for _ in range(abs(count)):
            s, c = (sin(angle) if count > 0 else -sin(angle)), cos(angle)
            sine, cosine = sine * c + cosine * s, cosine * c - sine * s
    return sine if function is sin else cosine
