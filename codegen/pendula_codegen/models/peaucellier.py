"""The linkage of Peaucellier and Lipkin: turning becomes a straight line.

Two arms from the origin, a rhombus at their ends, and a crank that holds its near corner. Where the crank is as long as
its support is deep, the far corner runs along y = -(arm^2 - side^2) / (2 crank); otherwise along a circle.
"""

from sympy import Rational


def define(model, links):
    arm = model.parameter("arm", "m", default=1.0, positive=True)
    side = model.parameter("side", "m", default=0.4, positive=True)  # of the rhombus
    crank = model.parameter("crank", "m", default=0.42, positive=True)
    depth = model.parameter("depth", "m", default=0.42, positive=True)  # of its support, below the origin
    m = model.parameter("mass", "kg", default=1.0, positive=True)  # of each joint
    g = model.parameter("gravity", "m/s^2", default=9.81)
    friction = model.parameter("friction", "N s/m", default=0.0)  # of the tracer
    push = model.input("push", "N")  # at the tracer, along x

    place = {"origin": (0, 0), "support": (0, -depth)}
    model.point("support", place["support"], kind="pivot")
    for joint in ("left", "right", "near", "tracer"):
        place[joint] = model.coordinate(f"x_{joint}", "m"), model.coordinate(f"y_{joint}", "m")
        model.point(joint, place[joint])
    rates = {joint: [model.rate(c) for c in place[joint]] for joint in ("left", "right", "near", "tracer")}
    kinetic = m * sum(u**2 + v**2 for u, v in rates.values()) / 2
    model.lagrangian = kinetic - m * g * sum(place[joint][1] for joint in rates)
    model.dissipation = Rational(1, 2) * friction * rates["tracer"][0] ** 2
    model.force(place["tracer"][0], push)
    bars = [("origin", "left", arm), ("origin", "right", arm), ("support", "near", crank)]
    bars += [(a, b, side) for a in ("near", "tracer") for b in ("left", "right")]
    for a, b, length in bars:
        (ax, ay), (bx, by) = place[a], place[b]
        model.constraint(f"{a}_{b}", ((ax - bx) ** 2 + (ay - by) ** 2 - length**2) / 2, "m^2")
        model.rod(a, b)
