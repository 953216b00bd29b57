"""The matrices of the paper's equations of motion, collected from the Euler–Lagrange equations themselves.

Every kind of coordinate (θ, φ) has its row of blocks:
    equation_a = Σ_b mass[a][b] q̈_b − Σ_b square[a][b] q̇_b² + cross[a] [q̇_1 q̇_2] + rest[a].
"""

from __future__ import annotations

from dataclasses import dataclass

from sympy import Add, Expr, Integer, Matrix, Mul, Symbol, expand, zeros

from pendula_codegen.chain import Chain
from pendula_codegen.errors import GenerationError
from pendula_codegen.mechanics import euler_lagrange


@dataclass(frozen=True)
class Blocks:
    """Blocks by kind of coordinate; each Matrix is (links x links), each rest (links x 1)."""

    mass: list[list[Matrix]]
    square: list[list[Matrix]]
    cross: list[Matrix]
    rest: list[Matrix]


def collect_blocks(chain: Chain) -> Blocks:
    """Sorts the terms of the chain's Euler–Lagrange equations into blocks; GenerationError on a leftover."""
    n, dof = chain.links, chain.model.dof
    blocks = Blocks(
        mass=[[zeros(n, n) for _ in range(dof)] for _ in range(dof)],
        square=[[zeros(n, n) for _ in range(dof)] for _ in range(dof)],
        cross=[zeros(n, n) for _ in range(dof if dof > 1 else 0)],
        rest=[zeros(n, 1) for _ in range(dof)],
    )
    for row, equation in enumerate(euler_lagrange(chain.system, chain.accelerations)):
        _sort_terms(chain, expand(equation), row, blocks)
    return blocks


def _sort_terms(chain: Chain, equation: Expr, row: int, blocks: Blocks) -> None:
    """Puts each term of one expanded equation where its motion symbols (velocities, accelerations) say."""
    n = chain.links
    kind, i = divmod(row, n)
    places = _places(chain)
    coefficients = _by_motion(chain, equation)
    for moving in sorted(coefficients, key=str):
        if moving not in places:
            raise GenerationError(
                f"equation {row + 1} of model '{chain.model.name}' has a term in "
                f"{'*'.join(s.name for s in moving)} that belongs to no block"
            )
        what, b, j = places[moving]
        if what == "rest":
            blocks.rest[kind][i, 0] = coefficients[moving]
        elif what == "cross":
            blocks.cross[kind][i, j] = coefficients[moving]
        elif what == "square":
            blocks.square[kind][b][i, j] = -coefficients[moving]
        else:
            blocks.mass[kind][b][i, j] = coefficients[moving]


def _by_motion(chain: Chain, equation: Expr) -> dict[tuple[Symbol, ...], Expr]:
    """Coefficients of the products of motion symbols in an expanded equation, without those that cancel."""
    collected: dict[tuple[Symbol, ...], list[Expr]] = {}
    motion = {*chain.velocities, *chain.accelerations}
    for term in Add.make_args(equation):
        moving, coefficient = _split(term, motion)
        collected.setdefault(moving, []).append(coefficient)
    totals = {moving: Add(*coefficients) for moving, coefficients in collected.items()}
    return {moving: total for moving, total in totals.items() if total != 0}


def _split(term: Expr, motion: set[Symbol]) -> tuple[tuple[Symbol, ...], Expr]:
    """The motion symbols of a monomial (with multiplicity, by name) and the rest of it."""
    moving: list[Symbol] = []
    others: list[Expr] = []
    for factor in Mul.make_args(term):
        base, power = factor.as_base_exp()
        if base in motion:
            moving += [base] * int(power)
        else:
            others.append(factor)
    return tuple(sorted(moving, key=lambda symbol: symbol.name)), Mul(*others) if others else Integer(1)


def _places(chain: Chain) -> dict[tuple[Symbol, ...], tuple[str, int, int]]:
    """Which product of motion symbols belongs to which block and column."""
    places: dict[tuple[Symbol, ...], tuple[str, int, int]] = {(): ("rest", 0, 0)}
    for k, (v, a) in enumerate(zip(chain.velocities, chain.accelerations, strict=True)):
        b, j = divmod(k, chain.links)
        places[(a,)] = ("mass", b, j)
        places[(v, v)] = ("square", b, j)
    if chain.model.dof == 2:
        for j in range(chain.links):
            pair = (chain.velocities[j], chain.velocities[chain.links + j])
            places[tuple(sorted(pair, key=lambda symbol: symbol.name))] = ("cross", 0, j)
    return places


def recompose(chain: Chain, blocks: Blocks) -> list[Expr]:
    """The equations put together again from their blocks, loads subtracted: E = 0 (paper eq. 15, 27)."""
    n, dof = chain.links, chain.model.dof
    kinds = range(dof)
    v = [Matrix(chain.velocities[b * n : (b + 1) * n]) for b in kinds]
    a = [Matrix(chain.accelerations[b * n : (b + 1) * n]) for b in kinds]
    equations: list[Expr] = []
    for kind in kinds:
        total = blocks.rest[kind]
        for b in kinds:
            total = total + blocks.mass[kind][b] * a[b]
            total = total - blocks.square[kind][b] * v[b].applyfunc(lambda rate: rate**2)
        if blocks.cross:
            total = total + blocks.cross[kind] * v[0].multiply_elementwise(v[1])
        equations += list(total)
    return [equation - force for equation, force in zip(equations, chain.forces, strict=True)]
