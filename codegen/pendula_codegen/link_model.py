"""What a link model is: the vocabulary in which the files under links/ are written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from sympy import Expr, Matrix, Symbol


@dataclass(frozen=True, eq=False)  # a model is what it is by identity, so that results can be kept for it
class LinkModel:
    """One link of a chain: its coordinates, parameters, direction and loads, and nothing derived from them.

    coordinates         angles of one link (dof symbols), absolute, rad
    direction           unit vector along the rod as a function of the coordinates, (dimension x 1)
    angles              the inverse of direction: unit vector -> coordinates, each an atan2
    up                  unit vector against gravity, (dimension x 1)
    mass, length, damping   parameters of one link: kg, m, N m s
    gravity             parameter of the chain: m/s²
    torque              components of the torque on one link, N m
    generalized_torque  (û, ∂û/∂q_a) -> the torque's generalised force along q_a, N m
    dissipation         û̇ -> Rayleigh's dissipation function of one link, W
    """

    name: str
    coordinates: tuple[Symbol, ...]
    direction: Matrix
    angles: Callable[[Matrix], tuple[Expr, ...]]
    up: Matrix
    mass: Symbol
    length: Symbol
    gravity: Symbol
    damping: Symbol
    torque: tuple[Symbol, ...]
    generalized_torque: Callable[[Matrix, Matrix], Expr]
    dissipation: Callable[[Matrix], Expr]

    @property
    def dof(self) -> int:
        return len(self.coordinates)

    @property
    def dimension(self) -> int:
        return self.direction.rows
