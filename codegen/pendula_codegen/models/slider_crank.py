"""A slider crank: a rod from the pin of a crank to a slider, which runs along x through the axis of the crank."""

from sympy import Rational, cos, sin


def define(model, links):
    crank = model.coordinate("crank", "rad")  # from x
    rod = model.coordinate("rod", "rad")  # from x, too
    s = model.coordinate("s", "m")  # of the slider
    r = model.parameter("crank_length", "m", default=0.3, positive=True)
    length = model.parameter("rod_length", "m", default=0.9, positive=True)
    inertia = model.parameter("crank_inertia", "kg m^2", default=0.05, positive=True)  # with its flywheel
    m = model.parameter("rod_mass", "kg", default=0.5, positive=True)  # of the rod, which is uniform
    slider = model.parameter("slider_mass", "kg", default=1.0, positive=True)
    friction = model.parameter("friction", "N s/m", default=0.0)  # of the slider
    g = model.parameter("gravity", "m/s^2", default=9.81)
    torque, push = model.input("torque", "N m"), model.input("push", "N")

    pin = (r * cos(crank), r * sin(crank))
    middle = (pin[0] + length * cos(rod) / 2, pin[1] + length * sin(rod) / 2)
    speed_squared = model.rate(middle[0]) ** 2 + model.rate(middle[1]) ** 2
    turning = length**2 / 12 * model.rate(rod) ** 2
    kinetic = inertia * model.rate(crank) ** 2 + m * (speed_squared + turning) + slider * model.rate(s) ** 2
    model.lagrangian = Rational(1, 2) * kinetic - m * g * middle[1]
    model.dissipation = Rational(1, 2) * friction * model.rate(s) ** 2
    model.force(crank, torque)
    model.force(s, push)
    model.constraint("along", pin[0] + length * cos(rod) - s, "m")
    model.constraint("across", pin[1] + length * sin(rod), "m")
    model.point("pin", pin)
    model.rod("pin", model.point("slider", (s, 0), kind="cart"))
