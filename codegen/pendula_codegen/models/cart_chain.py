"""A planar chain on a cart: the cart runs along x, a force pushes it."""

from sympy import Rational, cos, sin


def define(model, links):
    x = model.coordinate("x", "m")  # of the cart
    theta = [model.coordinate(f"theta_{i + 1}", "rad") for i in range(links)]  # from hanging down
    m = model.parameter("masses", "kg", default=1.0, positive=True, per_link=True)
    length = model.parameter("lengths", "m", default=1.0, positive=True, per_link=True)
    damping = model.parameter("damping", "N m s", default=0.0, per_link=True)
    cart = model.parameter("cart_mass", "kg", default=1.0, positive=True)
    friction = model.parameter("cart_friction", "N s/m", default=0.0)
    g = model.parameter("gravity", "m/s^2", default=9.81)
    push = model.input("push", "N")

    position = (x, 0)
    model.point("cart", position, kind="cart")
    kinetic, potential = cart * model.rate(x) ** 2 / 2, 0
    dissipated = friction * model.rate(x) ** 2
    for i in range(links):
        position = (position[0] + length[i] * sin(theta[i]), position[1] - length[i] * cos(theta[i]))
        kinetic += m[i] * (model.rate(position[0]) ** 2 + model.rate(position[1]) ** 2) / 2
        potential += m[i] * g * position[1]
        dissipated += damping[i] * model.rate(theta[i]) ** 2
        model.point(f"bob_{i + 1}", position)
    model.lagrangian = kinetic - potential
    model.dissipation = Rational(1, 2) * dissipated
    model.force(x, push)
