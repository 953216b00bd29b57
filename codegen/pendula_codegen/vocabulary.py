"""The atoms in which a kernel function is written: arguments, sines and cosines, named intermediates."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from sympy import Add, Expr, Integer, Symbol, cos, sin

from pendula_codegen.errors import GenerationError
from pendula_codegen.polynomial import Expander, Polynomial, ordered


@dataclass(frozen=True)
class Leaf:
    """A value that a function reads, the C++ that fetches it, and the argument it comes from."""

    symbol: Symbol
    code: str
    source: str


@dataclass(frozen=True)
class Angle:
    """A coordinate, of which only sine and cosine are read, once each; `sine`, `cosine` are C++."""

    symbol: Symbol
    sine: str
    cosine: str
    source: str


@dataclass(frozen=True)
class Atom:
    """One atom: fetched by `code`, or computed from its `definition`. `kind`: see ORDERS."""

    name: str
    kind: str
    code: str = ""
    source: str = ""
    definition: Expr | None = None
    position: int = 0  # among all atoms, as the arguments have them

    @property
    def is_trig(self) -> bool:
        return self.kind == "trig"

    @property
    def is_computed(self) -> bool:
        """Whether fetching it calls a function, so that it is a value and no reference."""
        return "(" in self.code and self.is_trig


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
    Order(("definition", "chain", "torque", "v", "a", "p", "trig", "pair")),
    Order(("definition", "chain", "torque", "v", "a", "p", "trig", "pair"), last_link_first=True),
    Order(("pair", "trig", "v", "a", "p", "definition", "chain", "torque")),
    Order(("trig", "pair", "v", "a", "p", "chain", "definition", "torque"), last_link_first=True),
)


class Vocabulary:
    """All atoms that one program may be written in."""

    def __init__(
        self, leaves: Sequence[Leaf], angles: Sequence[Angle], definitions: dict[Symbol, Expr], form: Form
    ):
        self.atoms: list[Atom] = []
        self._form = form
        self._definitions = definitions
        self._angles = {angle.symbol: k for k, angle in enumerate(angles)}
        self._numbers: dict[Expr, int] = {}
        self._pairs: dict[tuple[type, Symbol, Symbol], int] = {}
        self._expander = Expander(self._atom)
        for symbol, definition in definitions.items():
            if symbol not in form.expanded:
                self._add(symbol, Atom(symbol.name, "definition", definition=definition))
        for leaf in leaves:
            self._add(leaf.symbol, Atom(leaf.symbol.name, leaf.source, leaf.code, leaf.source))
        for angle in angles:
            for function, code in ((sin, angle.sine), (cos, angle.cosine)):
                name = f"{function.__name__}_{angle.symbol.name}"
                self._add(function(angle.symbol), Atom(name, "trig", code, angle.source))
        if form.pair_angles:
            self._add_pairs(list(self._angles))

    def _add(self, expression: Expr, atom: Atom) -> int:
        self._numbers[expression] = len(self.atoms)
        self.atoms.append(replace(atom, position=len(self.atoms)))
        return self._numbers[expression]

    def _add_pairs(self, angles: list[Symbol]) -> None:
        """Atoms for sin and cos of the difference of two angles of the same kind: cos_theta_1_2."""
        for k, first in enumerate(angles):
            for second in angles[k + 1 :]:
                kind, i = first.name.rsplit("_", 1)
                other, j = second.name.rsplit("_", 1)
                for function in (sin, cos) if kind == other else ():
                    name = f"{function.__name__}_{kind}_{i}_{j}"
                    definition = _of_sum(function, [(1, first), (-1, second)])
                    number = self._add(Symbol(name), Atom(name, "pair", definition=definition))
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
                definition = self.atoms[atom].definition
                if definition is not None and atom not in found:
                    found[atom] = self.polynomial(definition)
                    waiting.append(found[atom])
        return found

    def ranking(self, order: Order) -> list[int]:
        """All atoms, those to be pulled out first in front."""
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
        """sin or cos of an integer combination of angles."""
        parts = [term.as_coeff_Mul() for term in Add.make_args(angle)]
        if any(symbol not in self._angles or not isinstance(c, Integer) for c, symbol in parts):
            raise GenerationError(f"a kernel cannot evaluate {function(angle)}")
        parts.sort(key=lambda part: self._angles[part[1]])
        terms = [(int(c), symbol) for c, symbol in parts]
        if [abs(c) for c, _ in terms] == [1, 1] and terms[0][0] == -terms[1][0]:
            number = self._pairs.get((function, terms[0][1], terms[1][1]))
            if number is not None:
                return {(number,): terms[0][0] if function is sin else 1}
        return self.polynomial(_of_sum(function, terms))


def _of_sum(function: type, terms: list[tuple[int, Symbol]]) -> Expr:
    """sin or cos of Σ count·angle by angle addition, one angle at a time."""
    sine, cosine = Integer(0), Integer(1)
    for count, angle in terms:
        for _ in range(abs(count)):
            s, c = (sin(angle) if count > 0 else -sin(angle)), cos(angle)
            sine, cosine = sine * c + cosine * s, cosine * c - sine * s
    return sine if function is sin else cosine
