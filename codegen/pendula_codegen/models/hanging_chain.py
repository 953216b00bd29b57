"""A chain of equal uniform rods between two hooks, as high as each other: as many as links says, 8 where it says 1."""

from sympy import Rational, cos, sin


def define(model, links):
    rods = links if links > 1 else 8
    theta = [model.coordinate(f"theta_{i + 1}", "rad") for i in range(rods)]  # from hanging down
    m = model.parameter("mass", "kg", default=0.8, positive=True) / rods  # of the whole chain
    length = model.parameter("length", "m", default=2.0, positive=True) / rods  # of the whole chain
    span = model.parameter("span", "m", default=1.2)  # from hook to hook
    damping = model.parameter("damping", "N m s", default=0.0)  # in the joints
    g = model.parameter("gravity", "m/s^2", default=9.81)

    model.point("hook", (span, 0), kind="pivot")
    joint, kinetic, potential, dissipated = (0, 0), 0, 0, 0
    for i in range(rods):
        along = (sin(theta[i]), -cos(theta[i]))
        middle = tuple(a + length * u / 2 for a, u in zip(joint, along, strict=True))
        joint = tuple(a + length * u for a, u in zip(joint, along, strict=True))
        theta_dot = model.rate(theta[i])
        kinetic += m * (model.rate(middle[0]) ** 2 + model.rate(middle[1]) ** 2)
        kinetic += m * length**2 / 12 * theta_dot**2
        potential += m * g * middle[1]
        if i > 0:
            dissipated += damping * (theta_dot - model.rate(theta[i - 1])) ** 2
        if i < rods - 1:
            model.point(f"joint_{i + 1}", joint)
    model.lagrangian = Rational(1, 2) * kinetic - potential
    model.dissipation = Rational(1, 2) * dissipated
    model.constraint("end_x", joint[0] - span, "m")
    model.constraint("end_y", joint[1], "m")
    model.rod("origin", "joint_1")
    model.rod(f"joint_{rods - 1}", "hook")
