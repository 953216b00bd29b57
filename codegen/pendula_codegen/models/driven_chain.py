"""A planar chain whose pivot is shaken: x(t) and y(t) are sines of amplitudes, frequency and phases of one's own."""

from sympy import Rational, cos, pi, sin


def define(model, links):
    theta = [model.coordinate(f"theta_{i + 1}", "rad") for i in range(links)]  # from hanging down
    m = model.parameter("masses", "kg", default=1.0, positive=True, per_link=True)
    length = model.parameter("lengths", "m", default=1.0, positive=True, per_link=True)
    damping = model.parameter("damping", "N m s", default=0.0, per_link=True)
    x_amplitude = model.parameter("x_amplitude", "m", default=0.0)
    y_amplitude = model.parameter("y_amplitude", "m", default=0.0)
    frequency = model.parameter("frequency", "rad/s", default=0.0)
    x_phase = model.parameter("x_phase", "rad", default=0.0)
    y_phase = model.parameter("y_phase", "rad", default=float(pi / 2))  # so that it starts at rest
    g = model.parameter("gravity", "m/s^2", default=9.81)

    t = model.time
    position = (x_amplitude * sin(frequency * t + x_phase), y_amplitude * sin(frequency * t + y_phase))
    model.point("pivot", position, kind="pivot")
    kinetic, potential, dissipated = 0, 0, 0
    for i in range(links):
        position = (position[0] + length[i] * sin(theta[i]), position[1] - length[i] * cos(theta[i]))
        kinetic += m[i] * (model.rate(position[0]) ** 2 + model.rate(position[1]) ** 2) / 2
        potential += m[i] * g * position[1]
        dissipated += damping[i] * model.rate(theta[i]) ** 2
        model.point(f"bob_{i + 1}", position)
    model.lagrangian = kinetic - potential
    model.dissipation = Rational(1, 2) * dissipated
