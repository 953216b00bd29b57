"""A bead that turns past a hill whose first 39 derivatives vanish at the top of the circle."""

from sympy import cos


def define(model, links):
    theta = model.coordinate("theta", "rad")
    model.lagrangian = model.rate(theta) ** 2 / 2 - 0.2 * (0.5 + cos(theta) / 2) ** 20
