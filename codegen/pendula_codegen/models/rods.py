"""A planar chain of rigid links, each with its mass, centre of mass and moment of inertia: a compound pendulum."""

from sympy import Rational, cos, sin


def define(model, links):
    theta = [model.coordinate(f"theta_{i + 1}", "rad") for i in range(links)]  # from hanging down
    m = model.parameter("masses", "kg", default=1.0, positive=True, per_link=True)
    length = model.parameter("lengths", "m", default=1.0, positive=True, per_link=True)  # joint to joint
    # What follows is that of a uniform rod of 1 kg and 1 m.
    center = model.parameter("centers", "m", default=0.5, per_link=True)  # joint to centre of mass
    inertia = model.parameter(
        "inertias", "kg m^2", default=1 / 12, positive=True, per_link=True
    )  # about that
    damping = model.parameter("damping", "N m s", default=0.0, per_link=True)
    g = model.parameter("gravity", "m/s^2", default=9.81)

    joint = (0, 0)
    kinetic, potential, dissipated = 0, 0, 0
    for i in range(links):
        along = (sin(theta[i]), -cos(theta[i]))
        middle = tuple(a + center[i] * u for a, u in zip(joint, along, strict=True))
        joint = tuple(a + length[i] * u for a, u in zip(joint, along, strict=True))
        theta_dot = model.rate(theta[i])
        kinetic += m[i] * (model.rate(middle[0]) ** 2 + model.rate(middle[1]) ** 2) / 2
        kinetic += inertia[i] * theta_dot**2 / 2
        potential += m[i] * g * middle[1]
        dissipated += damping[i] * theta_dot**2
        model.point(f"end_{i + 1}", joint)
    model.lagrangian = kinetic - potential
    model.dissipation = Rational(1, 2) * dissipated
