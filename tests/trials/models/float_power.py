"""Drag that grows with a power of the speed, written as a decimal."""

from sympy import Abs, sign


def define(model, links):
    x = model.coordinate("x", "m")
    v = model.rate(x)
    model.lagrangian = v**2 / 2 - x**2 / 2
    model.force(x, -0.2 * sign(v) * Abs(v) ** 1.7)
