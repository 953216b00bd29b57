"""The embedded chain, proved: in the angles it is the generator's mechanics, and its integrals are integrals.

All identities leave exact zeros: for every value of the multipliers τ, or for those that solve their system.
Two facts need no SymPy: the derivatives of a minimum over τ are those at fixed τ (so `energy` gives the field
of H), and a system has one solution where its quadratic form is a sum of squares, zero only for τ = 0.
"""

import pytest
from sympy import Add, Matrix, expand

from chains import chain, in_masses
from embedded import EmbeddedChain, at, named, vectors
from paper import normal_form
from pendula_codegen.chain import on_link
from pendula_codegen.mechanics import euler_lagrange, gradient, momenta

CHAINS = pytest.mark.parametrize(
    ("space", "n"), [(space, n) for space in ("planar", "spatial") for n in (1, 2, 3)]
)


def assert_zero(expressions) -> None:
    leftovers = [expand(expression) for part in expressions for expression in Matrix([part])]
    assert leftovers == [0] * len(leftovers)


def assert_zero_in_angles(expressions) -> None:
    leftovers = [normal_form(expression) for expression in expressions]
    assert leftovers == [0] * len(leftovers)


class Anywhere:
    """x, y, τ as symbols: on the sphere or off it."""

    def __init__(self, space: str, n: int) -> None:
        """A chain of n links."""
        self.equations = EmbeddedChain(chain(space, n))
        dimension = self.equations.chain.model.dimension
        self.x, self.y = vectors("x", n, dimension), vectors("y", n, dimension)
        self.tau = named("tau", n)
        self.x_dot = self.equations.direction_rates(self.x, self.y, self.tau)
        self.y_dot = self.equations.momentum_rates(self.x, self.x_dot, self.tau)


@CHAINS
def test_field_is_that_of_the_energy(space, n):
    """ẋ = ∂H/∂p, ẏ = −∂H/∂x / l with p = l y, everywhere: the field is canonical, and H its integral."""
    c = Anywhere(space, n)
    energy = c.equations.energy(c.x, c.y, c.tau)
    for i in c.equations.links:
        length = c.equations.length(i)
        assert_zero([Matrix([energy.diff(s) for s in c.y[i]]) - length * c.x_dot[i]])
        assert_zero([Matrix([energy.diff(s) for s in c.x[i]]) + length * c.y_dot[i]])


@CHAINS
def test_multipliers_are_where_the_energy_is_least(space, n):
    c = Anywhere(space, n)
    energy = c.equations.energy(c.x, c.y, c.tau)
    rows = c.equations.multiplier_residuals(c.x, c.y, c.tau)
    assert_zero([energy.diff(tau) - row for tau, row in zip(c.tau, rows, strict=True)])


@CHAINS
def test_multipliers_exist_once(space, n):
    """τᵀ A τ = Σ |τ_i x_i − τ_(i+1) x_(i+1)|²/m_i: zero for τ = 0 only, link by link from the last."""
    c = Anywhere(space, n)
    nothing = [y * 0 for y in c.y]
    rows = c.equations.multiplier_residuals(c.x, nothing, c.tau)
    pulls = [tau * x for tau, x in zip(c.tau, c.x, strict=True)]
    ends = [pulls[i] - at(pulls, i + 1) for i in c.equations.links]
    squares = [end.dot(end) / c.equations.mass(i) for i, end in enumerate(ends)]
    assert_zero([Add(*(tau * row for tau, row in zip(c.tau, rows, strict=True))) - Add(*squares)])


@CHAINS
def test_lengths_are_integrals(space, n):
    """l_i x_i·ẋ_i is what the multipliers make zero, on the sphere and off it: |x_i|² is constant."""
    c = Anywhere(space, n)
    rows = c.equations.multiplier_residuals(c.x, c.y, c.tau)
    assert_zero([c.equations.length(i) * c.x[i].dot(c.x_dot[i]) - row for i, row in enumerate(rows)])


@CHAINS
def test_momenta_along_the_rods_change_nothing(space, n):
    """With y + λ x and τ − λ for y and τ: the same system, the same ẋ, and ẏ + λ ẋ, for constant λ."""
    c = Anywhere(space, n)
    shift = named("shift", n)
    y = [a + s * x for a, s, x in zip(c.y, shift, c.x, strict=True)]
    tau = [t - s for t, s in zip(c.tau, shift, strict=True)]
    same = zip(
        c.equations.multiplier_residuals(c.x, y, tau),
        c.equations.multiplier_residuals(c.x, c.y, c.tau),
        strict=True,
    )
    assert_zero([a - b for a, b in same])
    x_dot = c.equations.direction_rates(c.x, y, tau)
    assert_zero([a - b for a, b in zip(x_dot, c.x_dot, strict=True)])
    y_dot = c.equations.momentum_rates(c.x, x_dot, tau)
    assert_zero([y_dot[i] - c.y_dot[i] - shift[i] * x_dot[i] for i in c.equations.links])


@CHAINS
def test_gravity_alone_changes_the_angular_momentum(space, n):
    """d/dt Σ l_i x_i × y_i = −Σ M_i l_i x_i × g up: nothing about the vertical."""
    c = Anywhere(space, n)
    e = c.equations

    def cross(a: Matrix, b: Matrix) -> Matrix:
        return Matrix([a[0] * b[1] - a[1] * b[0]]) if a.rows == 2 else a.cross(b)

    change = [
        e.length(i)
        * (cross(c.x_dot[i], c.y[i]) + cross(c.x[i], c.y_dot[i]) + e.mass_below(i) * cross(c.x[i], e.weight))
        for i in e.links
    ]
    assert_zero([sum(change[1:], start=change[0])])


@CHAINS
def test_rods_and_velocities_are_the_same_field(space, n):
    """(ξ, z, τ/l) moves as (x, y, τ) does, loads included, and y is found again from z."""
    c = Anywhere(space, n)
    e = c.equations
    xi, z = e.rods(c.x), e.velocities(c.y)
    tau = [c.tau[i] / e.length(i) for i in e.links]
    xi_dot = e.rod_rates(xi, z, tau)
    assert_zero([xi_dot[i] - e.length(i) * c.x_dot[i] for i in e.links])
    loads = vectors("load", n, e.chain.model.dimension)
    z_dot = e.velocities([c.y_dot[i] + loads[i] for i in e.links])
    assert_zero([a - b for a, b in zip(e.velocity_rates(xi_dot, tau, loads), z_dot, strict=True)])
    rows = zip(e.rod_multiplier_residuals(xi, z, tau), e.multiplier_residuals(c.x, c.y, c.tau), strict=True)
    assert_zero([row - e.length(i) * other for i, (row, other) in enumerate(rows)])
    assert_zero([a - b for a, b in zip(e.momenta(z), c.y, strict=True)])
    assert_zero([a - b for a, b in zip(e.velocities(e.momenta(c.y)), c.y, strict=True)])


class OnTheSphere:
    """x and the momenta of a motion in angles, with any λ_i x_i added to them; then τ = −λ."""

    def __init__(self, space: str, n: int) -> None:
        """A chain of n links."""
        self.chain = chain(space, n)
        self.equations = e = EmbeddedChain(self.chain)
        self.moving = list(zip(self.chain.coordinates, self.chain.velocities, strict=True))
        ends = [self.chain.positions[0] * 0, *self.chain.positions]
        self.x = [((ends[i + 1] - ends[i]) / e.length(i)).applyfunc(expand) for i in e.links]
        self.x_dot = [self.rate(x) for x in self.x]
        pushes = [e.mass(i) * w for i, w in enumerate(self.chain.rates)]
        below = [sum(pushes[i + 1 :], start=pushes[i]) for i in e.links]
        self.shift = named("shift", n)
        self.y = [below[i] + self.shift[i] * self.x[i] for i in e.links]
        self.tau = [-s for s in self.shift]

    def rate(self, vector: Matrix) -> Matrix:
        """d/dt of what depends on the coordinates alone."""
        return sum((vector.diff(q) * v for q, v in self.moving), start=vector * 0)

    def tangents(self):
        """(i, ∂û_i/∂q_a) for each coordinate, in their order."""
        for q in self.chain.model.coordinates:
            for i in self.equations.links:
                yield i, self.x[i].diff(on_link(q, i + 1))


@CHAINS
def test_multipliers_on_the_sphere(space, n):
    c = OnTheSphere(space, n)
    assert_zero_in_angles(c.equations.multiplier_residuals(c.x, c.y, c.tau))
    rates = c.equations.direction_rates(c.x, c.y, c.tau)
    assert_zero_in_angles(entry for i in c.equations.links for entry in rates[i] - c.x_dot[i])


@CHAINS
def test_field_in_the_angles_is_euler_lagrange(space, n):
    """p_a = l û_a·y are the momenta of L, and d/dt p_a by the field is Euler and Lagrange, loads included."""
    c = OnTheSphere(space, n)
    e = c.equations
    y_dot = e.momentum_rates(c.x, c.x_dot, c.tau)
    y_dot = [y_dot[i] + e.load_on(i, c.x[i], c.x_dot[i]) for i in e.links]
    embedded = [
        (e.length(i) * u.dot(c.y[i]), e.length(i) * (c.rate(u).dot(c.y[i]) + u.dot(y_dot[i])))
        for i, u in c.tangents()
    ]
    derived = [in_masses(c.chain, p) for p in momenta(c.chain.system)]
    assert_zero_in_angles(p - truth for (p, _), truth in zip(embedded, derived, strict=True))
    equations = [
        in_masses(c.chain, left - force)
        for left, force in zip(
            euler_lagrange(c.chain.system, c.chain.accelerations), c.chain.forces, strict=True
        )
    ]
    symbols = [*c.moving, *zip(c.chain.velocities, c.chain.accelerations, strict=True)]
    for (_, rate), p, equation in zip(embedded, derived, equations, strict=True):
        total = Add(
            *(slope * v for slope, (_, v) in zip(gradient(p, [s for s, _ in symbols]), symbols, strict=True))
        )
        assert_zero_in_angles([total - rate - equation])
