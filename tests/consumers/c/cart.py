def define(model, links):
    x = model.coordinate("x", "m")
    m = model.parameter("mass", "kg", default=1.0, positive=True)
    model.force(x, model.input("push", "N"))
    model.lagrangian = m * model.rate(x) ** 2 / 2
