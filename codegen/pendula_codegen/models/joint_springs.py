"""A planar chain with torsion springs and dampers in its joints, between each link and the one before."""

from sympy import Rational, cos, sin


def define(model, links):
    theta = [model.coordinate(f"theta_{i + 1}", "rad") for i in range(links)]  # from hanging down
    m = model.parameter("masses", "kg", default=1.0, positive=True, per_link=True)
    length = model.parameter("lengths", "m", default=1.0, positive=True, per_link=True)
    stiffness = model.parameter("stiffness", "N m", default=1.0, per_link=True)
    damping = model.parameter("damping", "N m s", default=0.0, per_link=True)
    rest = model.parameter("rest_angles", "rad", default=0.0, per_link=True)  # relative to the link before
    g = model.parameter("gravity", "m/s^2", default=9.81)

    position, before, before_dot = (0, 0), 0, 0
    kinetic, potential, dissipated = 0, 0, 0
    for i in range(links):
        position = (position[0] + length[i] * sin(theta[i]), position[1] - length[i] * cos(theta[i]))
        theta_dot = model.rate(theta[i])
        kinetic += m[i] * (model.rate(position[0]) ** 2 + model.rate(position[1]) ** 2) / 2
        potential += m[i] * g * position[1]
        potential += stiffness[i] * (theta[i] - before - rest[i]) ** 2 / 2
        dissipated += damping[i] * (theta_dot - before_dot) ** 2
        before, before_dot = theta[i], theta_dot
        model.point(f"bob_{i + 1}", position)
    model.lagrangian = kinetic - potential
    model.dissipation = Rational(1, 2) * dissipated
