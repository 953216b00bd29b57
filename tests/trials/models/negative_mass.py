def define(model, links):
    x = model.coordinate("x", "m")
    model.lagrangian = -(model.rate(x) ** 2) / 2 - x**2 / 2
