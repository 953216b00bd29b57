"""The derived mechanics against formulas typed by hand and against definitions."""

import pytest
from sympy import Matrix, Rational, Symbol, expand, zeros

import paper
from chains import blocks, chain, equations, in_masses, written_out
from paper import normal_form
from pendula_codegen.blocks import recompose
from pendula_codegen.mechanics import euler_lagrange, gradient, momenta

LINKS = [1, 2, 3]
CHAINS = [(space, n) for space in ("planar", "spatial") for n in LINKS]


def assert_zero(expressions) -> None:
    leftovers = [normal_form(expression) for expression in expressions]
    assert leftovers == [0] * len(leftovers)


def difference(left, right) -> list:
    return [a - b for a, b in zip(left, right, strict=True)]


@pytest.mark.parametrize("n", LINKS)
def test_planar_equations_are_the_papers(n):
    assert_zero(difference(equations("planar", n), paper.equations_13(n)))
    assert_zero(difference(equations("planar", n), paper.equations_15(n, paper.block_S_20(n))))


def test_three_planar_links_are_the_papers_example():
    assert_zero(difference(equations("planar", 3), paper.equations_14()))


def test_two_planar_links_without_dimensions_are_the_papers():
    assert_zero(difference(paper.equations_41(equations("planar", 2)), paper.equations_41_typed()))


@pytest.mark.parametrize("n", LINKS)
def test_spatial_equations_are_the_papers_with_corrected_coriolis_terms(n):
    true = paper.equations_27(n, paper.block_C1(n), paper.block_C2(n))
    assert_zero(difference(equations("spatial", n), true))


@pytest.mark.parametrize("n", LINKS)
def test_planar_blocks(n):
    c, b = chain("planar", n), blocks("planar", n)
    assert_zero(written_out(c, b.mass[0][0]) - paper.block_C_19(n))
    assert_zero(written_out(c, b.square[0][0]) - paper.block_S_20(n))
    assert_zero(written_out(c, b.rest[0]) - paper.block_h_18(n))
    assert b.cross == []


@pytest.mark.parametrize("n", LINKS)
def test_spatial_blocks(n):
    c, b, truth = chain("spatial", n), blocks("spatial", n), paper.blocks_28_34(n)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
        assert_zero(written_out(c, b.mass[i][j]) - truth[f"A{i + 1}{j + 1}"])
        assert_zero(written_out(c, b.square[i][j]) - truth[f"B{i + 1}{j + 1}"])
    assert_zero(written_out(c, b.cross[0]) - paper.block_C1(n))
    assert_zero(written_out(c, b.cross[1]) - paper.block_C2(n))
    assert_zero(written_out(c, b.rest[0]) - paper.block_g_37(n))
    assert b.rest[1] == zeros(n, 1)


@pytest.mark.parametrize(("space", "n"), CHAINS)
def test_blocks_make_up_the_equations(space, n):
    c = chain(space, n)
    derived = euler_lagrange(c.system, c.accelerations)
    loaded = [equation - force for equation, force in zip(derived, c.forces, strict=True)]
    assert_zero(difference(loaded, recompose(c, blocks(space, n))))


@pytest.mark.parametrize(("space", "n"), CHAINS)
def test_kinetic_energy_is_that_of_the_bobs(space, n):
    c = chain(space, n)
    bobs = sum(
        Rational(1, 2) * c.mass(i) * rate.dot(rate) for i, rate in zip(c.numbers, c.rates, strict=True)
    )
    assert_zero([in_masses(c, c.kinetic_energy) - bobs])


@pytest.mark.parametrize(("space", "n"), CHAINS)
def test_bob_velocities_in_steps_are_the_derivatives_of_the_positions(space, n):
    c = chain(space, n)
    for position, rate, symbols in zip(c.positions, c.rates, c.rate_symbols, strict=True):
        stepwise = symbols
        for _ in c.numbers:
            stepwise = stepwise.xreplace(c.rate_definitions)
        derivative = sum((position.diff(q) * v for q, v in motion(c)), start=position * 0)
        assert_zero(derivative - rate)
        assert_zero(derivative - stepwise)


def motion(c):
    return list(zip(c.coordinates, c.velocities, strict=True))


@pytest.mark.parametrize("n", LINKS)
def test_planar_energies_are_the_papers(n):
    c = chain("planar", n)
    assert_zero([written_out(c, c.kinetic_energy) - paper.kinetic_energy_8(n)])
    assert_zero([c.potential_energy - paper.potential_energy_9(n)])


@pytest.mark.parametrize(("space", "n"), CHAINS)
def test_potential_energy_is_that_of_the_bobs(space, n):
    c = chain(space, n)
    up = c.model.up
    bobs = sum(c.mass(i) * Symbol("g") * r.dot(up) for i, r in zip(c.numbers, c.positions, strict=True))
    assert_zero([in_masses(c, c.potential_energy) - bobs])


@pytest.mark.parametrize(("space", "n"), CHAINS)
def test_momenta_are_mass_matrix_times_velocities(space, n):
    c, b = chain(space, n), blocks(space, n)
    kinds = range(c.model.dof)
    mass = Matrix.vstack(*(Matrix.hstack(*(b.mass[i][j] for j in kinds)) for i in kinds))
    assert_zero(Matrix(momenta(c.system)) - mass * Matrix(c.velocities))
    assert_zero(mass - mass.T)


@pytest.mark.parametrize(("space", "n"), CHAINS)
def test_hamiltonian_is_the_legendre_transform(space, n):
    c = chain(space, n)
    p_v = sum(p * v for p, v in zip(momenta(c.system), c.velocities, strict=True))
    assert_zero([p_v - c.system.lagrangian - (c.kinetic_energy + c.potential_energy)])


@pytest.mark.parametrize(("space", "n"), CHAINS)
def test_loads_do_the_work_that_they_should(space, n):
    """Q·v = Σ τ_i·(û_i × dû_i/dt) − λ_i |dû_i/dt|²: the torque's power less what damping takes."""
    c = chain(space, n)
    power = sum(force * v for force, v in zip(c.forces, c.velocities, strict=True))
    steps = [r - before for r, before in zip(c.positions, [c.positions[0] * 0, *c.positions], strict=False)]
    directions = [expand(step / c.length(i)) for i, step in zip(c.numbers, steps, strict=True)]
    for i, u in zip(c.numbers, directions, strict=True):
        rate = sum((u.diff(q) * v for q, v in motion(c)), start=u * 0)
        turning = in_space(u).cross(in_space(rate))
        power -= Matrix(axis(c.torque(i))).dot(turning) - c.damping(i) * rate.dot(rate)
    assert_zero([power])


def in_space(vector: Matrix) -> Matrix:
    return vector if vector.rows == 3 else Matrix([*vector, 0])


def axis(torque) -> list:
    """A planar torque turns about the axis out of the plane."""
    return list(torque) if len(torque) == 3 else [0, 0, *torque]


@pytest.mark.parametrize("n", LINKS)
def test_planar_loads_are_the_papers(n):
    c = chain("planar", n)
    paper_23 = [
        Symbol(f"sigma_{i}") - Symbol(f"lambda_{i}") * Symbol(f"theta_dot_{i}") for i in range(1, n + 1)
    ]
    assert_zero(difference(c.forces, paper_23))


@pytest.mark.parametrize(("space", "n"), CHAINS)
def test_sparse_gradient_is_sympys_derivative(space, n):
    c = chain(space, n)
    L, symbols = c.system.lagrangian, [*c.coordinates, *c.velocities]
    assert_zero(difference(gradient(L, symbols), [L.diff(symbol) for symbol in symbols]))
