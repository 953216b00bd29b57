"""Two bobs on massless rods, as a model of one's own: the problem D of problems.hpp."""

from sympy import cos, sin


def define(model, links):
    theta = [model.coordinate(f"theta_{k}", "rad") for k in (1, 2)]
    m, length = model.parameter("mass", "kg", default=1.0), model.parameter("length", "m", default=1.0)
    g = model.parameter("gravity", "m/s^2", default=9.81)
    x, y = 0, 0
    model.lagrangian = 0
    for angle in theta:
        x, y = x + length * sin(angle), y - length * cos(angle)
        model.lagrangian += m * (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - m * g * y
