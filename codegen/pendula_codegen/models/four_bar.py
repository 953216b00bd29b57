"""A four-bar linkage: three uniform bars in a row between two supports, and the ground, which is the fourth."""

from sympy import Rational, cos, sin


def define(model, links):
    g = model.parameter("gravity", "m/s^2", default=9.81)
    ground = model.parameter("ground", "m", default=1.0, positive=True)  # from support to support
    damping = model.parameter("damping", "N m s", default=0.0)  # of the crank
    torque = model.input("torque", "N m")  # on the crank

    model.point("support", (ground, 0), kind="pivot")
    x = y = model.lagrangian = 0
    for k, (bar, usual) in enumerate([("crank", 0.4), ("coupler", 1.1), ("rocker", 0.8)], start=1):
        theta = model.coordinate(f"theta_{k}", "rad")  # from hanging down
        length = model.parameter(bar, "m", default=usual, positive=True)
        mass = model.parameter(f"{bar}_mass", "kg", default=usual, positive=True)
        middle = (x + length * sin(theta) / 2, y - length * cos(theta) / 2)
        x, y = x + length * sin(theta), y - length * cos(theta)
        speed_squared = model.rate(middle[0]) ** 2 + model.rate(middle[1]) ** 2
        turning = length**2 / 12 * model.rate(theta) ** 2
        model.lagrangian += mass * (speed_squared + turning) / 2 - mass * g * middle[1]
        if k == 1:
            model.dissipation = Rational(1, 2) * damping * model.rate(theta) ** 2
            model.force(theta, torque)
        if k < 3:
            model.point(f"joint_{k}", (x, y))
    model.rod("origin", "joint_1")
    model.rod("joint_2", "support")
    model.constraint("loop_x", x - ground, "m")
    model.constraint("loop_y", y, "m")
