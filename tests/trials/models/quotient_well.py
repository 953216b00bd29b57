"""A mass on a spring that flies over a well with steep sides, too far away to be felt."""


def define(model, links):
    x = model.coordinate("x", "m")
    narrow = model.parameter("narrow", "1/m", default=20.0)
    model.lagrangian = model.rate(x) ** 2 / 2 - x**2 / 2 + 0.5 / (1 + (narrow * x) ** 20)
