"""A leg of Jansen's strandbeest: the crank turns, and the foot walks.

The lengths are those that Theo Jansen published (The Great Pretender, 010 Publishers, Rotterdam 2007). They have no
unit: `size` says how long 1 is.
"""

from sympy import Rational

BARS = (
    "origin crank 15.0, crank top 50.0, crank bottom 61.9, support top 41.5, support bottom 39.3, support back 40.1, "
    "top back 55.8, back knee 39.4, bottom knee 36.7, bottom foot 49.0, knee foot 65.7"
)


def define(model, links):
    size = model.parameter("size", "m", default=0.01, positive=True)
    m = model.parameter("mass", "kg", default=0.1, positive=True)  # of each joint
    flywheel = model.parameter("flywheel", "kg m^2", default=0.1, positive=True)  # of the crank
    friction = model.parameter("friction", "N m s", default=0.0)  # of the crank
    g = model.parameter("gravity", "m/s^2", default=9.81)
    torque = model.input("torque", "N m")  # on the crank

    place = {"origin": (0, 0), "support": (-38 * size, Rational(-78, 10) * size)}
    model.point("support", place["support"], kind="pivot")
    model.lagrangian = 0
    for joint in ("crank", "top", "bottom", "back", "knee", "foot"):
        x, y = place[joint] = model.coordinate(f"x_{joint}", "m"), model.coordinate(f"y_{joint}", "m")
        model.lagrangian += m * (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - m * g * y
        model.point(joint, place[joint])
    for a, b, number in map(str.split, BARS.split(", ")):
        (ax, ay), (bx, by), length = place[a], place[b], Rational(number) * size
        model.constraint(f"{a}_{b}", ((ax - bx) ** 2 + (ay - by) ** 2 - length**2) / 2, "m^2")
        model.rod(a, b)
    # What acts on the crank, by its pin.
    (x, y), squared = place["crank"], (15 * size) ** 2
    turning = (model.rate(x) ** 2 + model.rate(y) ** 2) / squared
    model.lagrangian += flywheel * turning / 2
    model.dissipation = friction * turning / 2
    model.force(x, -torque * y / squared)
    model.force(y, torque * x / squared)
