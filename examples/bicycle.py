"""The bicycle of Meijaard, Papadopoulos, Ruina and Schwab (Proc. R. Soc. A 463, 2007, 1955): two frames, each with a thin
wheel that rolls on the floor, meet at the steer axis. Nobody holds the bars."""

from itertools import pairwise
from math import pi

from sympy import Matrix, cos, rot_axis1, rot_axis2, rot_axis3, sin


def define(model, links):
    wheelbase = model.parameter("wheelbase", "m", default=1.02)
    trail = model.parameter("trail", "m", default=0.08)
    tilt = model.parameter("tilt", "rad", default=pi / 10)  # of the steer axis, back from upright
    g = model.parameter("gravity", "m/s^2", default=9.81)
    rate = model.rate

    class Frame:
        """A body from the hub of its wheel on: mass, its centre before and above the hub, moments of inertia about that
        (xx, yy, zz, xz); radius, mass and moments (of a diameter, of the axle) of the wheel."""

        def __init__(self, name, m, centre, J, r, m_wheel, J_wheel):
            # Turned by yaw about z, which is up, by lean about the way ahead, and by pitch about the axle.
            lean, yaw, pitch, turn = (
                model.coordinate(f"{name}_{a}", "rad") for a in ("lean", "yaw", "pitch", "turn")
            )
            x, y, z = (model.coordinate(f"{name}_{axis}", "m") for axis in "xyz")
            self.hub, self.axes = Matrix([x, y, z]), (rot_axis2(pitch) * rot_axis1(lean) * rot_axis3(yaw)).T
            # How fast it turns, besides lean: about the spoke from below, and about the axle.
            up, aside = rate(yaw) * cos(lean), rate(yaw) * sin(lean) + rate(pitch)
            spins = Matrix(
                [rate(lean) * cos(pitch) - up * sin(pitch), aside, rate(lean) * sin(pitch) + up * cos(pitch)]
            )
            self.kinetic = (spins.T * Matrix([[J[0], 0, J[3]], [0, J[1], 0], [J[3], 0, J[2]]]) * spins)[0] / 2
            self.kinetic += (
                J_wheel[0] * (rate(lean) ** 2 + up**2) / 2 + J_wheel[1] * (aside + rate(turn)) ** 2 / 2
            )
            self.potential = 0
            for mass, place in ((m, self.place(*centre)), (m_wheel, self.hub)):
                self.kinetic += mass * sum(rate(each) ** 2 for each in place) / 2
                self.potential += mass * g * place[2]
            model.constraint(f"{name}_stands", z - r * cos(lean), "m")
            forward = rate(x) * cos(yaw) + rate(y) * sin(yaw) - r * (aside + rate(turn))
            left = rate(y) * cos(yaw) - rate(x) * sin(yaw) + r * rate(lean) * cos(lean)
            model.constraint(f"{name}_rolls", forward, "m/s")
            model.constraint(f"{name}_keeps", left, "m/s")

            self.radius, self.upright = r, (rot_axis1(lean) * rot_axis3(yaw)).T

        def place(self, along, up):
            return self.hub + self.axes * Matrix([along, 0, up])

        def touch(self):
            return self.hub - self.upright * Matrix([0, 0, self.radius])

    rear = Frame("rear", 85.0, (0.3, 0.6), (9.2, 11.0, 2.8, -2.4), 0.3, 2.0, (0.0603, 0.12))
    front = Frame("front", 4.0, (-0.12, 0.35), (0.05892, 0.06, 0.00708, 0.00756), 0.35, 3.0, (0.1405, 0.28))
    model.lagrangian = rear.kinetic - rear.potential + front.kinetic - front.potential

    gap = rear.place(wheelbase + trail, -rear.radius) - front.place(trail, -front.radius)
    for axis, apart in zip("xyz", gap, strict=True):
        model.constraint(f"steer_{axis}", apart, "m")
    steer = rear.axes * Matrix([-sin(tilt), 0, cos(tilt)])
    model.constraint("steer_left", (front.axes[:, 1].T * steer)[0], "1")
    model.constraint("steer_ahead", ((front.axes * Matrix([cos(tilt), 0, sin(tilt)])).T * steer)[0], "1")

    places = [
        rear.touch(),
        rear.hub,
        rear.place(0.3, 0.6),
        front.place(-0.12, 0.35),
        front.hub,
        front.touch(),
    ]
    names = ("touch_rear", "hub_rear", "saddle", "bars", "hub_front", "touch_front")
    points = [model.point(name, tuple(place)) for name, place in zip(names, places, strict=True)]
    for a, b in pairwise(points):
        model.rod(a, b)
