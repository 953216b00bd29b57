"""A swinging Atwood machine: a bob swings on a thread that runs over two pulleys to a counterweight."""

from sympy import Rational, cos, sin


def define(model, links):
    r = model.coordinate("r", "m")  # length of thread on the bob's side
    theta = model.coordinate("theta", "rad")  # of the bob from the downward vertical
    mu = model.parameter("mu", "1", default=3.0, positive=True)  # counterweight over bob
    m = model.parameter("mass", "kg", default=1.0, positive=True)  # of the bob
    g = model.parameter("gravity", "m/s^2", default=9.81)
    bob = (r * sin(theta), -r * cos(theta))
    r_dot, theta_dot = model.rate(r), model.rate(theta)
    kinetic = m * ((1 + mu) * r_dot**2 + r**2 * theta_dot**2) / 2
    model.lagrangian = kinetic - m * g * r * (mu - cos(theta))
    # For pictures: two metres of thread from the bob to the counterweight, besides what lies between the pulleys.
    model.point("floor", (Rational(-1, 2), Rational(-9, 4)), kind="floor")
    model.point("counterweight", (-1, r - 2), kind="weight")
    model.pulleys("counterweight", "origin")
    model.thread("origin", model.point("bob", bob))
