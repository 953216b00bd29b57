from sympy import sign


def define(model, links):
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x) ** 2 / 2
    model.force(x, sign(x))  # away from where it starts, on both sides
