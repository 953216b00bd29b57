"""A four-bar linkage from the origin to (d, 0), with a bob at each joint and one in the middle of the last bar."""

from sympy import cos, sin


def define(model, links):
    g, d = model.parameter("g", "m/s^2", default=9.81), model.parameter("d", "m", default=1.6)
    x = y = model.lagrangian = 0
    for k, (length, mass, share) in enumerate([(1.0, 1.0, 1), (1.5, 2.0, 1), (1.2, 0.3, 0.5)], start=1):
        angle = model.coordinate(f"theta_{k}", "rad")
        bob = x + share * length * sin(angle), y - share * length * cos(angle)
        model.lagrangian += mass * (model.rate(bob[0]) ** 2 + model.rate(bob[1]) ** 2) / 2 - mass * g * bob[1]
        model.point(f"bob_{k}", bob)
        x, y = x + length * sin(angle), y - length * cos(angle)
    model.point("support", (d, 0), kind="pivot")
    model.constraint("loop_x", x - d, "m")
    model.constraint("loop_y", y, "m")
