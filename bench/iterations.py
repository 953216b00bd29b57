"""Counts the iterations that three ways to solve the stage equations need, on planar chains.

usage: python bench/iterations.py FILE.json

Exact Newton on all stages, fixed point, and a simplified Newton, whose one Jacobian, of the start of the
step, lets the eigenvalues of A decouple the stages: s/2 complex systems of the size of one stage (Hairer,
Wanner, Solving Ordinary Differential Equations II, IV.8). What counts is how corrections shrink, so this is
NumPy and dense.
"""

import itertools
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

Vector = np.ndarray
GRAVITY = 9.81
SMALL = 1e-13  # of the largest unknown; rounding of these dense solves begins below
LIMIT = 60
CHAINS = (2, 10)
STAGES = (2, 4, 8)
TURNS = (0.05, 0.2, 0.5, 1.0)  # h times the fastest swing's angular frequency at rest


class Chain:
    """n equal links of 1 kg, one metre together; y = (θ, p)."""

    def __init__(self, links: int) -> None:
        """Masses below each pair of links."""
        self.links = links
        below = np.arange(links, 0, -1.0)
        self.length = 1 / links
        self.inertia = np.minimum.outer(below, below) * self.length**2
        self.weight = below * GRAVITY * self.length

    def fastest(self) -> float:
        """Angular frequency of the fastest small swing, 1/s."""
        squares = np.linalg.eigvals(np.linalg.solve(self.inertia, np.diag(self.weight)))
        return float(np.sqrt(squares.real.max()))

    def slope(self, y: Vector) -> Vector:
        """Hamilton's equations, y' of one y (2n); complex y too."""
        theta, p = y[: self.links], y[self.links :]
        turned = np.subtract.outer(theta, theta)
        v = np.linalg.solve(self.inertia * np.cos(turned), p)
        force = -v * ((self.inertia * np.sin(turned)) @ v) - self.weight * np.sin(theta)
        return np.concatenate([v, force])

    def jacobian(self, y: Vector) -> Vector:
        """∂y'/∂y (2n x 2n), by complex steps."""
        columns = [self.slope(y + 1e-30j * unit).imag / 1e-30 for unit in np.eye(2 * self.links)]
        return np.array(columns).T


class Gauss:
    """Nodes, weights and matrix of the s-stage method, and its eigenvectors."""

    def __init__(self, stages: int) -> None:
        """From the Legendre polynomials."""
        nodes, weights = np.polynomial.legendre.leggauss(stages)
        self.stages, self.c, self.b = stages, (nodes + 1) / 2, weights / 2
        powers = np.arange(1, stages + 1)
        vandermonde = self.c[:, None] ** (powers - 1)
        self.a = (self.c[:, None] ** powers / powers) @ np.linalg.inv(vandermonde)
        self.extrapolation = (self.c[:, None] + 1) ** (powers - 1) @ np.linalg.inv(vandermonde)
        self.eigenvalues, self.vectors = np.linalg.eig(self.a)
        self.inverse_vectors = np.linalg.inv(self.vectors)


Corrector = Callable[[Chain, Gauss, float, Vector, Vector], Vector]


def residual(chain: Chain, gauss: Gauss, h: float, y: Vector, slopes: Vector) -> Vector:
    """F(y + h A Y') − Y' for stage slopes Y' (s x 2n)."""
    return np.array([chain.slope(stage) for stage in y + h * gauss.a @ slopes]) - slopes


def fixed_point(chain: Chain, gauss: Gauss, h: float, y: Vector, slopes: Vector) -> Vector:
    """Correction of the stage slopes by one substitution."""
    return residual(chain, gauss, h, y, slopes)


def newton(chain: Chain, gauss: Gauss, h: float, y: Vector, slopes: Vector) -> Vector:
    """By a Jacobian at every stage."""
    size = slopes.size
    system = np.eye(size).reshape(*slopes.shape, *slopes.shape)
    for i, stage in enumerate(y + h * gauss.a @ slopes):
        system[i] -= h * np.einsum("j,kl->kjl", gauss.a[i], chain.jacobian(stage))
    right = residual(chain, gauss, h, y, slopes).ravel()
    return np.linalg.solve(system.reshape(size, size), right).reshape(slopes.shape)


def simplified_newton(chain: Chain, gauss: Gauss, h: float, y: Vector, slopes: Vector) -> Vector:
    """By the Jacobian at the start of the step, one complex system for every eigenvalue of A."""
    jacobian = chain.jacobian(y)
    right = gauss.inverse_vectors @ residual(chain, gauss, h, y, slopes)
    unit = np.eye(y.size)
    solved = [
        np.linalg.solve(unit - h * value * jacobian, row)
        for value, row in zip(gauss.eigenvalues, right, strict=True)
    ]
    return (gauss.vectors @ np.array(solved)).real


METHODS: dict[str, Corrector] = {
    "newton": newton,
    "simplified newton": simplified_newton,
    "fixed-point": fixed_point,
}


def solve(
    correct: Corrector, chain: Chain, gauss: Gauss, h: float, y: Vector, slopes: Vector
) -> tuple[Vector, int] | None:
    """Stage slopes and the iterations they took; None where corrections do not become small."""
    for iteration in range(LIMIT):
        change = correct(chain, gauss, h, y, slopes)
        slopes = slopes + change
        if np.abs(change).max() <= SMALL * np.abs(slopes).max():
            return slopes, iteration + 1
        if not np.all(np.isfinite(slopes)):
            break
    return None


def iterations(correct: Corrector, chain: Chain, gauss: Gauss, h: float, steps: int) -> float | None:
    """Iterations a step of a fall from θ = π/2, predictor extrapolated; None where one does not converge."""
    y = np.concatenate([np.full(chain.links, np.pi / 2), np.zeros(chain.links)])
    slopes = np.tile(chain.slope(y), (gauss.stages, 1))
    total = 0
    for _ in range(steps):
        solved = solve(correct, chain, gauss, h, y, slopes)
        if solved is None:
            return None
        slopes, count = solved
        total += count
        y = y + h * gauss.b @ slopes
        slopes = gauss.extrapolation @ slopes
    return total / steps


def runs() -> Iterator[dict]:
    """Every method on every chain, stage count and step size."""
    for links, stages, turn in itertools.product(CHAINS, STAGES, TURNS):
        chain, gauss = Chain(links), Gauss(stages)
        h = turn / chain.fastest()
        with np.errstate(over="ignore", invalid="ignore"):  # of what does not converge
            counts = {name: iterations(correct, chain, gauss, h, 40) for name, correct in METHODS.items()}
        yield {"links": links, "stages": stages, "turn": turn, "step": h, "iterations": counts}


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(json.dumps(list(runs()), indent=1) + "\n", encoding="utf-8")
