"""A bob on a spring in space: Cartesian coordinates from the pivot, z up."""

from sympy import Rational, sqrt


def define(model, links):
    x, y, z = (model.coordinate(name, "m") for name in "xyz")
    m = model.parameter("mass", "kg", default=1.0, positive=True)
    k = model.parameter("stiffness", "N/m", default=33.0, positive=True)
    rest = model.parameter("rest_length", "m", default=0.1)
    g = model.parameter("gravity", "m/s^2", default=9.81)
    friction = model.parameter("friction", "N s/m", default=0.0)
    speed_squared = model.rate(x) ** 2 + model.rate(y) ** 2 + model.rate(z) ** 2
    stretch = sqrt(x**2 + y**2 + z**2) - rest
    model.lagrangian = m * speed_squared / 2 - k * stretch**2 / 2 - m * g * z
    model.dissipation = Rational(1, 2) * friction * speed_squared
    model.spring("origin", model.point("bob", (x, y, z)))
