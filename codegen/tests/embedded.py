"""The embedded chain, typed by hand: a chain without angles, which test_embedded_chain.py proves.

Unknowns are rod directions x_i and momenta y_i in the Cartesian space of a bob, for any x_i ≠ 0; multipliers
τ_i keep each x_i at its length. To compute with are the rods ξ_i = l_i x_i and velocities z_i instead, a
constant linear change of variables. Lists run from 0, link 1 first; what lies above link 1 and below link n
is 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from sympy import Add, Expr, Integer, Matrix, Rational, Symbol

from pendula_codegen.chain import Chain


def named(stem: str, links: int) -> list[Symbol]:
    return [Symbol(f"{stem}_{i}") for i in range(1, links + 1)]


def vectors(stem: str, links: int, dimension: int) -> list[Matrix]:
    """One Cartesian vector of symbols a link."""
    return [Matrix([Symbol(f"{stem}_{axis}_{i}") for axis in "xyz"[:dimension]]) for i in range(1, links + 1)]


def at(values: Sequence[Matrix], i: int) -> Matrix:
    return values[i] if 0 <= i < len(values) else values[0] * 0


@dataclass(frozen=True)
class EmbeddedChain:
    """The equations of a chain, whose masses, lengths, gravity and loads carry the generator's names."""

    chain: Chain

    @property
    def links(self) -> range:
        return range(self.chain.links)

    def mass(self, i: int) -> Symbol:
        return self.chain.mass(i + 1)

    def length(self, i: int) -> Symbol:
        return self.chain.length(i + 1)

    def mass_below(self, i: int) -> Expr:
        return Add(*(self.mass(k) for k in self.links[i:]))

    @property
    def weight(self) -> Matrix:
        """g up."""
        return self.chain.model.gravity * self.chain.model.up

    def differences(self, values: Sequence[Matrix]) -> list[Matrix]:
        """(v_i − v_(i+1))/m_i − (v_(i−1) − v_i)/m_(i−1), 1/m_0 = 0: what forces v do to a rod."""
        ends = [(values[i] - at(values, i + 1)) / self.mass(i) for i in self.links]
        return [ends[i] - at(ends, i - 1) for i in self.links]

    # --- in (x, y)

    def momenta_below(self, x: Sequence[Matrix], y: Sequence[Matrix], tau: Sequence[Expr]) -> list[Matrix]:
        """G_i = y_i + τ_i x_i."""
        return [y[i] + tau[i] * x[i] for i in self.links]

    def energy(self, x: Sequence[Matrix], y: Sequence[Matrix], tau: Sequence[Expr]) -> Expr:
        """½ Σ |G_i − G_(i+1)|²/m_i + Σ M_i g l_i x_i·up; its minimum over τ is H(x, l y)."""
        below = self.momenta_below(x, y, tau)
        pushes = [below[i] - at(below, i + 1) for i in self.links]
        kinetic = [Rational(1, 2) * pushes[i].dot(pushes[i]) / self.mass(i) for i in self.links]
        heights = [self.mass_below(i) * self.length(i) * x[i].dot(self.weight) for i in self.links]
        return Add(*kinetic, *heights)

    def multiplier_residuals(
        self, x: Sequence[Matrix], y: Sequence[Matrix], tau: Sequence[Expr]
    ) -> list[Expr]:
        """Left less right sides of the tridiagonal system for τ."""

        def row(i: int) -> Expr:
            own = 1 / self.mass(i) + (1 / self.mass(i - 1) if i > 0 else 0)
            residual = own * (x[i].dot(x[i]) * tau[i] + x[i].dot(y[i]))
            if i + 1 in self.links:
                residual -= (x[i].dot(x[i + 1]) * tau[i + 1] + x[i].dot(y[i + 1])) / self.mass(i)
            if i > 0:
                residual -= (x[i].dot(x[i - 1]) * tau[i - 1] + x[i].dot(y[i - 1])) / self.mass(i - 1)
            return residual

        return [row(i) for i in self.links]

    def direction_rates(self, x: Sequence[Matrix], y: Sequence[Matrix], tau: Sequence[Expr]) -> list[Matrix]:
        """ẋ_i = (w_i − w_(i−1))/l_i with m_i w_i = G_i − G_(i+1)."""
        rods = self.differences(self.momenta_below(x, y, tau))
        return [rods[i] / self.length(i) for i in self.links]

    def momentum_rates(
        self, x: Sequence[Matrix], x_dot: Sequence[Matrix], tau: Sequence[Expr]
    ) -> list[Matrix]:
        """ẏ_i = −τ_i ẋ_i − M_i g up, without loads."""
        return [-tau[i] * x_dot[i] - self.mass_below(i) * self.weight for i in self.links]

    def load_on(self, i: int, x: Matrix, x_dot: Matrix) -> Matrix:
        """What a torque and damping add to ẏ_i: (σ × x − λ ẋ)/l."""
        torque = self.chain.torque(i + 1)
        across = Matrix(torque).cross(x) if len(torque) == 3 else torque[0] * Matrix([-x[1], x[0]])
        return (across - self.chain.damping(i + 1) * x_dot) / self.length(i)

    # --- in (ξ, z)

    def rods(self, x: Sequence[Matrix]) -> list[Matrix]:
        return [self.length(i) * x[i] for i in self.links]

    def velocities(self, y: Sequence[Matrix]) -> list[Matrix]:
        """z of y: what ξ̇ would be without multipliers."""
        return self.differences(y)

    def momenta(self, z: Sequence[Matrix]) -> list[Matrix]:
        """y of z: y_i = Σ_(k≥i) m_k Σ_(j≤k) z_j."""
        bobs = [sum(z[: k + 1], start=z[0] * 0) for k in self.links]
        return [sum((self.mass(k) * bobs[k] for k in self.links[i:]), start=z[0] * 0) for i in self.links]

    def rod_rates(self, xi: Sequence[Matrix], z: Sequence[Matrix], tau: Sequence[Expr]) -> list[Matrix]:
        """ξ̇_i = z_i + e_i − e_(i−1), e_i = (τ_i ξ_i − τ_(i+1) ξ_(i+1))/m_i."""
        pulls = self.differences([tau[i] * xi[i] for i in self.links])
        return [z[i] + pulls[i] for i in self.links]

    def velocity_rates(
        self, xi_dot: Sequence[Matrix], tau: Sequence[Expr], loads: Sequence[Matrix]
    ) -> list[Matrix]:
        """ż_i = d_i − d_(i−1) − δ_i1 g up, m_i d_i = F_i − τ_i ξ̇_i − F_(i+1) + τ_(i+1) ξ̇_(i+1), F loads."""
        pulls = self.differences([loads[i] - tau[i] * xi_dot[i] for i in self.links])
        return [pulls[i] - (self.weight if i == 0 else self.weight * 0) for i in self.links]

    def rod_multiplier_residuals(
        self, xi: Sequence[Matrix], z: Sequence[Matrix], tau: Sequence[Expr]
    ) -> list[Expr]:
        """Left less right sides of the tridiagonal system for τ, three dot products a link."""

        def row(i: int) -> Expr:
            above = 1 / self.mass(i - 1) if i > 0 else Integer(0)
            residual = (1 / self.mass(i) + above) * xi[i].dot(xi[i]) * tau[i] + xi[i].dot(z[i])
            if i + 1 in self.links:
                residual -= xi[i].dot(xi[i + 1]) * tau[i + 1] / self.mass(i)
            if i > 0:
                residual -= xi[i].dot(xi[i - 1]) * tau[i - 1] * above
            return residual

        return [row(i) for i in self.links]
