"""A mass that flies against a wall so slim that nothing is felt of it from afar."""


def define(model, links):
    x = model.coordinate("x", "m")
    narrow = model.parameter("narrow", "1/m", default=1e4)
    model.lagrangian = model.rate(x) ** 2 / 2 - 5 / (1 + (narrow * x) ** 2)
