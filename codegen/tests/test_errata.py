"""Each line of the paper that is wrong: the printed formula fails, the true one holds.

docs/explanation/errata.md shows ERRATA; a test keeps the two the same.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass

import pytest
from sympy import Expr, Symbol, cos, sin, symbols

import paper
from chains import blocks, chain, equations, written_out
from conftest import REPOSITORY
from paper import normal_form
from pendula_codegen.mechanics import gradient


@dataclass(frozen=True)
class Erratum:
    """One line; `residual(printed)` gives expressions that are all zero for a right formula."""

    name: str
    where: str
    printed: str
    true: str
    residual: Callable[[bool], list[Expr]]


def force_of_lagrangian(printed: bool) -> list[Expr]:
    c = chain("planar", 3)
    derived = [-written_out(c, slope) for slope in gradient(c.system.lagrangian, c.coordinates)]
    return difference(derived, paper.minus_L_theta_12(3, printed))


def block_S(printed: bool) -> list[Expr]:
    S = paper.block_S_20_printed(3) if printed else paper.block_S_20(3)
    return difference(paper.equations_13(3), paper.equations_15(3, S)) + list(generated_S() - S)


def block_S_written_out(printed: bool) -> list[Expr]:
    S = paper.block_S_21_printed(3) if printed else paper.block_S_20(3)
    return list(generated_S() - S)


def generated_S():
    return written_out(chain("planar", 3), blocks("planar", 3).square[0][0])


def coriolis_blocks(printed: bool) -> list[Expr]:
    C1, C2 = paper.block_C1_35_printed(2), paper.block_C2_36_printed(2)
    factor = 1 if printed else 2
    return difference(equations("spatial", 2), paper.equations_27(2, factor * C1, factor * C2))


def one_link_coriolis(printed: bool) -> list[Expr]:
    return difference(equations("spatial", 1), paper.equations_39(1 if printed else 2))


def one_link_accelerations(printed: bool) -> list[Expr]:
    accelerations = paper.accelerations_40(1 if printed else -2)
    return [equation.subs(accelerations) for equation in equations("spatial", 1)]


def dimensionless_gravity(printed: bool) -> list[Expr]:
    """Row 1 of the two-link equations over M_1 l_1², against row 1 of (41) with g replaced as stated."""
    t1, t2, v2, a1, a2, g, l1, l2, m1, m2 = symbols(
        "theta_1 theta_2 theta_dot_2 theta_ddot_1 theta_ddot_2 g l_1 l_2 m_1 m_2"
    )
    m, length = m2 / (m1 + m2), l2 / l1
    gravity = g / l1 / (m1 + m2) if printed else g / l1
    stated = a1 + m * length * (cos(t2 - t1) * a2 - sin(t2 - t1) * v2**2) + gravity * sin(t1)
    M1, M2 = m1 + m2, m2
    derived = equations("planar", 2)[0].subs({Symbol("M_1"): M1, Symbol("M_2"): M2})
    return [(derived - M1 * l1**2 * stated).together().as_numer_denom()[0]]


def two_link_accelerations(printed: bool) -> list[Expr]:
    """The equations with M_1 = l_1 = 1, M_2 = m, l_2 = l and the accelerations of (42), times 1 − m cos²."""
    t1, t2 = symbols("theta_1 theta_2")
    denominator = 1 - paper.m * cos(t2 - t1) ** 2
    numerators = paper.numerators_42(printed)
    still = [row.subs(dict.fromkeys(numerators, 0)) for row in paper.equations_41(equations("planar", 2))]
    moving = difference(paper.equations_41(equations("planar", 2)), still)
    return [
        rest * denominator + slope.expand().subs(numerators)
        for rest, slope in zip(still, moving, strict=True)
    ]


def difference(left, right) -> list[Expr]:
    return [a - b for a, b in zip(left, right, strict=True)]


ERRATA = [
    Erratum(
        "force-of-lagrangian",
        "(11), (12)",
        "second sum of −∂L/∂θ_d: M_i l_d l_i θ̇_i cos(θ_d−θ_i)",
        "M_i l_d l_i θ̇_d θ̇_i sin(θ_d−θ_i)",
        force_of_lagrangian,
    ),
    Erratum(
        "block-S",
        "(20)",
        "S_ij = +M_i l_i l_j sin(θ_i−θ_j) for i ≥ j",
        "S_ij = M_max(i,j) l_i l_j sin(θ_j−θ_i) for all i, j",
        block_S,
    ),
    Erratum(
        "block-S-written-out",
        "(21)",
        "cos in rows 2 and 3 of S",
        "sin, as in the line above",
        block_S_written_out,
    ),
    Erratum(
        "coriolis-blocks",
        "(35), (36)",
        "C1, C2 without a factor",
        "2 l_i l_j M_max(i,j) … in both",
        coriolis_blocks,
    ),
    Erratum(
        "one-link-coriolis",
        "(39)",
        "l_1² M_1 θ̇φ̇ sin θ cos θ",
        "2 l_1² M_1 θ̇φ̇ sin θ cos θ",
        one_link_coriolis,
    ),
    Erratum(
        "one-link-accelerations",
        "(40)",
        "φ̈ = +θ̇φ̇ cot θ",
        "φ̈ = −2 θ̇φ̇ cot θ",
        one_link_accelerations,
    ),
    Erratum(
        "dimensionless-gravity",
        "§3.3.1",
        "g → g/l_1/(m_1+m_2)",
        "g → g/l_1",
        dimensionless_gravity,
    ),
    Erratum(
        "two-link-accelerations",
        "(42), (44)",
        "θ̈_2: … − g sin θ_1 (first gravity term)",
        "θ̈_2: … − g sin θ_2",
        two_link_accelerations,
    ),
]


@pytest.mark.parametrize("erratum", ERRATA, ids=lambda erratum: erratum.name)
def test_printed_formula_fails_and_true_one_holds(erratum):
    def leftovers(printed: bool) -> list[Expr]:
        return [part for part in map(normal_form, erratum.residual(printed)) if part != 0]

    assert leftovers(printed=False) == []
    assert leftovers(printed=True) != []


def test_document_shows_every_erratum_and_no_other():
    text = (REPOSITORY / "docs/explanation/errata.md").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if re.match(r"\| \(|\| §", line)]
    link = "[{0}](../../codegen/tests/test_errata.py)"
    assert rows == [f"| {e.where} | {e.printed} | {e.true} | {link.format(e.name)} |" for e in ERRATA]
