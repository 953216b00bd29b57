"""A thin disc that rolls on the floor without sliding, and leans."""

from sympy import cos, sin


def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")  # of its centre
    phi = model.coordinate("phi", "rad")  # where it is heading
    theta = model.coordinate("theta", "rad")  # between it and the floor
    psi = model.coordinate("psi", "rad")  # turn about its axis
    m = model.parameter("mass", "kg", default=1.0, positive=True)
    r = model.parameter("radius", "m", default=0.3, positive=True)
    g = model.parameter("gravity", "m/s^2", default=9.81)

    height = r * sin(theta)
    turning, leaning = model.rate(phi) * sin(theta), model.rate(theta)
    spin = model.rate(psi) + model.rate(phi) * cos(theta)  # about its axis, which leans
    kinetic = m * (model.rate(x) ** 2 + model.rate(y) ** 2 + model.rate(height) ** 2) / 2
    kinetic += m * r**2 / 4 * (leaning**2 + turning**2 + 2 * spin**2) / 2
    model.lagrangian = kinetic - m * g * height

    # The point that touches the floor is at rest.
    aside = r * sin(theta) * leaning
    model.constraint("rolls_x", model.rate(x) - aside * sin(phi) + r * spin * cos(phi), "m/s")
    model.constraint("rolls_y", model.rate(y) + aside * cos(phi) + r * spin * sin(phi), "m/s")

    side, up = (-cos(theta) * sin(phi), cos(theta) * cos(phi)), sin(theta)
    touch = model.point("touch", (x - r * side[0], y - r * side[1], 0))
    centre = model.point("centre", (x, y, height))
    top = model.point("top", (x + r * side[0], y + r * side[1], r * up + height))
    model.rod(touch, centre)
    model.rod(centre, top)
