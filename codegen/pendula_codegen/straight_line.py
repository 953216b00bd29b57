"""From polynomials to a short straight-line program: factoring, common subexpressions, operation counts.

Two stages, both greedy and deterministic:
1. every polynomial is factored by a multivariate Horner scheme (the atom in most terms is pulled out first),
   which finds by itself, for example, the acceleration components of one link in the equations of the others;
2. over all outputs together, the pair of factors (then of summands) that occurs most often becomes a
   temporary, until no pair occurs twice.
"""

from __future__ import annotations

import heapq
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import chain

from pendula_codegen.polynomial import Monomial, Number, Polynomial, content, in_range, is_exact, quotient

Term = tuple[Number, int]  # coefficient, node
ZERO: Term = (0, -1)
UNIT = -2  # stands for the number 1 as a node


@dataclass
class Graph:
    """Expressions with shared parts. Node numbers below `atoms` are atoms; the others are products or sums.

    A product is a tuple of nodes with multiplicity, a sum a tuple of (coefficient, node); neither has a
    number as a factor, so that ±x and 2x share x. `definitions` gives what a named atom stands for.
    """

    atoms: int
    products: dict[int, tuple[int, ...]] = field(default_factory=dict)
    sums: dict[int, tuple[Term, ...]] = field(default_factory=dict)
    definitions: dict[int, Term] = field(default_factory=dict)
    factored: dict[tuple, Term] = field(default_factory=dict)
    _known: dict[tuple, int] = field(default_factory=dict)
    _next: int = -1

    def _node(self, table: dict, value: tuple) -> int:
        key = (table is self.sums, value)
        if key not in self._known:
            self._next = max(self._next + 1, self.atoms)
            self._known[key] = self._next
            table[self._next] = value
        return self._known[key]

    def product(self, terms: Iterable[Term]) -> Term:
        """The product of terms, nested products flattened."""
        coefficient: Number = 1
        factors: list[int] = []
        for scale, node in terms:
            coefficient *= scale
            if node != UNIT:
                factors += self.products.get(node, (node,))
        if not coefficient:
            return ZERO
        if len(factors) < 2:
            return coefficient, factors[0] if factors else UNIT
        return coefficient, self._node(self.products, tuple(sorted(factors)))

    def sum(self, terms: Iterable[Term]) -> Term:
        """The sum of terms, nested sums flattened; scaled so that the first coefficient is positive."""
        collected: dict[int, Number] = {}
        for scale, node in terms:
            for coefficient, part in self.sums.get(node, ((1, node),)):
                collected[part] = collected.get(part, 0) + scale * coefficient
        parts = sorted((node, value) for node, value in collected.items() if value)
        if not parts:
            return ZERO
        shared = content([value for _, value in parts])
        if parts[0][1] < 0:
            shared = -shared
        if len(parts) == 1:
            return parts[0][1], parts[0][0]
        return shared, self._node(self.sums, tuple((quotient(value, shared), node) for node, value in parts))

    def children(self, node: int) -> list[int]:
        """The nodes that `node` reads, with multiplicity."""
        if node in self.products:
            return list(self.products[node])
        if node in self.sums:
            return [part for _, part in self.sums[node]]
        if node in self.definitions:
            return [self.definitions[node][1]]
        return []

    def order(self, outputs: Iterable[int]) -> list[int]:
        """All nodes that the outputs need, each after those it reads."""
        done: dict[int, None] = {}
        for output in outputs:
            stack = [(output, False)]
            while stack:
                node, ready = stack.pop()
                if node in done or node < 0:
                    continue
                if ready:
                    done[node] = None
                else:
                    stack.append((node, True))
                    stack += [(child, False) for child in reversed(self.children(node))]
        return list(done)

    def operations(self, outputs: Iterable[Term], needed: Iterable[int]) -> int:
        """Additions, subtractions and multiplications; `needed`: the nodes that order() gives."""
        count = sum(_scaling(coefficient) for coefficient, node in outputs if node != UNIT)
        for node in needed:
            if node in self.products:
                count += len(self.products[node]) - 1
            elif node in self.sums:
                terms = self.sums[node]
                count += len(terms) - 1 + sum(_scaling(c) for c, part in terms if part != UNIT)
            elif node in self.definitions:
                count += _scaling(self.definitions[node][0])
        return count


def _scaling(coefficient: Number) -> int:
    return 0 if abs(coefficient) in (0, 1) else 1


def factor(graph: Graph, polynomial: Polynomial, counts: dict[int, int] | None = None) -> Term:
    """Multivariate Horner form of `polynomial`, built in `graph`; each polynomial is factored once.

    counts   in how many of its monomials each atom is, where the caller knows
    """
    key = tuple(polynomial.items())
    if key not in graph.factored:
        graph.factored[key] = _factor(graph, polynomial, counts or _occurrences(polynomial))
    return graph.factored[key]


def _factor(graph: Graph, polynomial: Polynomial, counts: dict[int, int]) -> Term:
    if not polynomial:
        return ZERO
    outside: list[Term] = []
    common = [atom for atom, count in counts.items() if count == len(polynomial)]
    counts = dict(counts)
    while common:
        outside += [(1, atom) for atom in common]
        polynomial = {_without(monomial, common): value for monomial, value in polynomial.items()}
        for atom in common:
            counts[atom] = sum(1 for monomial in polynomial if atom in monomial)
        common = [atom for atom in common if counts[atom] == len(polynomial)]
    return graph.product([*outside, _factor_sum(graph, polynomial, counts)])


def _factor_sum(graph: Graph, polynomial: Polynomial, counts: dict[int, int]) -> Term:
    """A polynomial without common atoms, as a sum of products; uses up `counts`."""
    terms: list[Term] = []
    rest = polynomial
    while rest:
        best = _most_frequent(counts)
        if best is None:
            terms += [
                graph.product([(value, UNIT), *((1, atom) for atom in monomial)])
                for monomial, value in rest.items()
            ]
            break
        group: Polynomial = {}
        others: Polynomial = {}
        for monomial, value in rest.items():
            (group if best in monomial else others)[monomial] = value
        held = _occurrences(group)
        terms.append(factor(graph, group, held))
        for atom, count in held.items():
            counts[atom] -= count
        rest = others
    return graph.sum(terms)


def _most_frequent(counts: dict[int, int]) -> int | None:
    """The atom in most monomials, the first one on a tie; None where no atom is in two."""
    best, most = None, 1
    for atom, count in counts.items():
        if count > most or (count == most > 1 and atom < best):
            best, most = atom, count
    return best


def _occurrences(polynomial: Polynomial) -> dict[int, int]:
    """In how many monomials each atom is."""
    return Counter(chain.from_iterable(map(set, polynomial)))


def _without(monomial: Monomial, removed: list[int]) -> Monomial:
    """`monomial` divided once by each of `removed`."""
    remaining = list(monomial)
    for atom in removed:
        remaining.remove(atom)
    return tuple(remaining)


class _PairExtraction(ABC):
    """Replaces the pair of entries that most rows share by one new entry, until no pair is in two rows.

    Rows are what `entries` returns for a node; subclasses say what a pair is and how it is replaced.
    """

    def __init__(self, graph: Graph, rows: Iterable[int]):
        self.graph = graph
        self.users: dict[tuple, set[int]] = {}
        self.heap: list[tuple] = []
        for row in rows:
            self._register(row, self.pairs(row))
        for pair, users in self.users.items():
            heapq.heappush(self.heap, (-len(users), pair))

    def run(self) -> None:
        while self.heap:
            count, pair = heapq.heappop(self.heap)
            users = self.users.get(pair, set())
            if len(users) < 2:
                continue
            if len(users) != -count:
                heapq.heappush(self.heap, (-len(users), pair))
                continue
            self._extract(pair, sorted(users))

    def _extract(self, pair: tuple, users: list[int]) -> None:
        new = self.make(pair)
        for row in users:
            if row == new:
                continue
            before = self.pairs(row)
            self.replace(row, pair, new)
            after = self.pairs(row)
            for gone in before - after:
                self.users[gone].discard(row)
            for fresh in sorted(self._register(row, after - before)):
                heapq.heappush(self.heap, (-len(self.users[fresh]), fresh))
        self.users[pair] = {new} if pair in self.pairs(new) else set()

    def _register(self, row: int, pairs: Iterable[tuple]) -> list[tuple]:
        added = list(pairs)
        for pair in added:
            self.users.setdefault(pair, set()).add(row)
        return added

    @abstractmethod
    def pairs(self, row: int) -> set[tuple]:
        """The pairs that could be taken out of a row."""

    @abstractmethod
    def make(self, pair: tuple) -> int:
        """A new node that is the pair."""

    @abstractmethod
    def replace(self, row: int, pair: tuple, new: int) -> None:
        """Puts the new node into a row, for the pair."""


def _ratio(numerator: Number, denominator: Number) -> Number:
    return numerator * denominator if denominator in (1, -1) else quotient(numerator, denominator)


class _ProductPairs(_PairExtraction):
    def pairs(self, row: int) -> set[tuple]:
        factors = self.graph.products[row]
        return {(a, b) for i, a in enumerate(factors) for b in factors[i + 1 :]}

    def make(self, pair: tuple) -> int:
        return self.graph._node(self.graph.products, pair)

    def replace(self, row: int, pair: tuple, new: int) -> None:
        remaining = list(self.graph.products[row])
        for node in pair:
            remaining.remove(node)
        self.graph.products[row] = tuple(sorted([*remaining, new]))


class _SumPairs(_PairExtraction):
    def pairs(self, row: int) -> set[tuple]:
        terms = self.graph.sums[row]
        found = {(a, b, _ratio(y, x)) for i, (x, a) in enumerate(terms) for y, b in terms[i + 1 :]}
        return {pair for pair in found if in_range(pair[2])}

    def make(self, pair: tuple) -> int:
        a, b, ratio = pair
        # x − 0.1 has digits near x = 0.1 that 1 − x/0.1 has not.
        turned = not is_exact(ratio) and (a == UNIT or is_exact(quotient(1, ratio)))
        terms = ((quotient(1, ratio), a), (1, b)) if turned else ((1, a), (ratio, b))
        return self.graph._node(self.graph.sums, terms)

    def replace(self, row: int, pair: tuple, new: int) -> None:
        a, b, _ = pair
        terms = self.graph.sums[row]
        own = next(value for value, node in terms if node == a)
        scale = _ratio(own, self.graph.sums[new][0][0])
        remaining = [term for term in terms if term[1] not in (a, b)]
        self.graph.sums[row] = tuple(sorted([*remaining, (scale, new)], key=lambda term: term[1]))


def share(graph: Graph, outputs: Iterable[Term]) -> None:
    """Introduces the temporaries that save operations over all `outputs` together."""
    roots = [node for _, node in outputs]
    _ProductPairs(graph, [node for node in graph.order(roots) if node in graph.products]).run()
    _SumPairs(graph, [node for node in graph.order(roots) if node in graph.sums]).run()
