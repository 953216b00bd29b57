"""A model that is wrong is refused with a message that names the culprit."""

from dataclasses import replace

import pytest
from sympy import Matrix, Rational, Symbol, cos, simplify, sin

from pendula_codegen.blocks import collect_blocks
from pendula_codegen.chain import Chain
from pendula_codegen.errors import GenerationError
from pendula_codegen.links import LINKS, find_link

PLANAR, SPATIAL = LINKS["planar"], LINKS["spatial"]


@pytest.mark.parametrize("model", LINKS.values(), ids=LINKS)
def test_direction_is_a_unit_vector(model):
    assert simplify(model.direction.dot(model.direction)) == 1


@pytest.mark.parametrize("model", LINKS.values(), ids=LINKS)
def test_angles_are_the_inverse_of_the_direction(model):
    at = dict(zip(model.coordinates, (Rational(13, 10), Rational(-21, 10)), strict=False))
    angles = Matrix(model.angles(model.direction.subs(at)))
    assert (angles - Matrix(list(at.values()))).evalf(30).norm() < 1e-28  # measured 0


def test_undeclared_symbol_in_the_direction():
    theta = PLANAR.coordinates[0]
    bent = replace(PLANAR, direction=Matrix([sin(theta + Symbol("bend")), -cos(theta + Symbol("bend"))]))
    with pytest.raises(GenerationError, match=r"holds the symbol 'bend', which the model does not declare$"):
        Chain(bent, 2)


def test_undeclared_symbol_in_the_dissipation():
    windy = replace(PLANAR, dissipation=lambda rate: Symbol("wind") * rate.dot(rate))
    with pytest.raises(GenerationError, match=r"a load of model 'planar' holds the symbol 'wind'"):
        assert Chain(windy, 1).system


def test_unknown_model():
    with pytest.raises(GenerationError, match=r"^unknown model 'cubic': expected one of planar, spatial$"):
        find_link("cubic")


@pytest.mark.parametrize("links", [0, -3])
def test_chain_without_links(links):
    with pytest.raises(GenerationError, match=rf"^a chain has at least one link: got --links {links}$"):
        Chain(PLANAR, links)


def test_term_that_belongs_to_no_block():
    """An inertia that depends on a rate: the paper's equations have no block for that."""

    class RateDependent(Chain):
        @property
        def kinetic_energy(self):
            return super().kinetic_energy + self.coordinates[0] * self.velocities[0] ** 3

    message = (
        r"^equation 1 of model 'planar' has a term in theta_ddot_1\*theta_dot_1 that belongs to no block$"
    )
    with pytest.raises(GenerationError, match=message):
        collect_blocks(RateDependent(PLANAR, 1))
