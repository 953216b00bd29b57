"""Chains as the tests look at them: inertias written out as M_max(i,j) l_i l_j, M_i left as symbols."""

from functools import cache

from sympy import Expr, Matrix

from pendula_codegen.blocks import Blocks, collect_blocks
from pendula_codegen.chain import Chain
from pendula_codegen.links import LINKS
from pendula_codegen.mechanics import euler_lagrange


@cache
def chain(space: str, links: int) -> Chain:
    return Chain(LINKS[space], links)


def written_out(chain: Chain, expression: Expr | Matrix) -> Expr | Matrix:
    inertias = {s: value for s, value in chain.definitions.items() if s.name.startswith("inertia")}
    return expression.xreplace(inertias)


def in_masses(chain: Chain, expression: Expr) -> Expr:
    """Everything in the model's own parameters m_i, l_i, g."""
    tails = {s: value for s, value in chain.definitions.items() if s.name.startswith("M_")}
    return written_out(chain, expression).xreplace(tails)


@cache
def equations(space: str, links: int) -> list[Expr]:
    """The generator's Euler–Lagrange equations without loads."""
    c = chain(space, links)
    return [written_out(c, e) for e in euler_lagrange(c.system, c.accelerations)]


@cache
def blocks(space: str, links: int) -> Blocks:
    return collect_blocks(chain(space, links))
