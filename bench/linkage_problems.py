"""The linkages of linkage_races.py: bars, starts, and where they end, by a quadrature.

A four-bar whose crank turns over and over, and IFToMM's benchmark A02 with two four-bars, which passes positions where
its bars could turn either way.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpmath import cos, findroot, linspace, mp, mpf, pi, quad, sin, sqrt

GRAVITY, DURATION = 9.81, 10.0  # m/s^2, s
mp.dps = 40


@dataclass
class Bar:
    """A uniform bar from joint to joint. Joints that move have numbers from 0, others from -1 downward."""

    a: int
    b: int
    mass: float
    length: float


@dataclass
class Problem:
    """A linkage of one freedom, and its start."""

    name: str
    moving: int
    fixed: list[tuple[float, float]]  # joints -1, -2 and so on
    bars: list[Bar]  # each hangs by its a on the ground or on a bar before it
    places: Callable  # angle -> the joints that move, in 40 digits
    angle: float
    rate: float
    watched: int  # the joint whose error counts
    point: str  # its name in pendula
    scenario: str
    truth: np.ndarray | None = None

    def place(self, joint: int) -> np.ndarray:
        """At the start."""
        return np.array(self.places(mpf(self.angle))[joint] if joint >= 0 else self.fixed[-1 - joint], float)

    def speed(self, joint: int) -> np.ndarray:
        """At the start."""
        if joint < 0:
            return np.zeros(2)
        return self.rate * np.array(slopes(self, mpf(self.angle))[joint], float)

    def turning(self, number: int) -> float:
        """The rate of a bar's angle at the start; of the ground, which is bar -1, too."""
        if number < 0:
            return 0.0
        bar = self.bars[number]
        (x, y), (u, v) = self.in_frame(number, bar.b), self.speed(bar.b) - self.speed(bar.a)
        return float(x * v - y * u) / bar.length**2

    def in_frame(self, number: int, joint: int) -> np.ndarray:
        """A joint at the start from the a of a bar, or from the origin of the ground."""
        return self.place(joint) - (self.place(self.bars[number].a) if number >= 0 else 0)

    def tree(self) -> list[tuple[int, Bar, int, int | None]]:
        """Bars with their numbers, each with what it hangs on and with the bar on which its b closes a loop, if any."""
        holders, tree = dict.fromkeys(range(-len(self.fixed), 0), -1), []
        for k, bar in enumerate(self.bars):
            tree.append((k, bar, holders[bar.a], holders.get(bar.b)))
            holders.setdefault(bar.b, k)
        return tree

    def holder(self) -> int:
        """The first bar that ends at the joint that is watched."""
        return next(k for k, bar in enumerate(self.bars) if bar.b == self.watched)


def slopes(problem: Problem, angle: mpf) -> list[tuple]:
    """How places change with the angle, by differences in 40 digits."""
    apart = mpf(10) ** -13
    pairs = zip(problem.places(angle + apart), problem.places(angle - apart), strict=True)
    return [tuple((x - y) / (2 * apart) for x, y in zip(*pair, strict=True)) for pair in pairs]


def find_truth(problem: Problem) -> np.ndarray:
    """From one angle alone and energy: t = ∫ dφ / φ̇(φ), as its bars turn over and over; no solver of equations."""

    def inertia_and_height(angle: mpf) -> tuple:
        at, along = problem.places(angle), slopes(problem, angle)
        at, along = at + problem.fixed[::-1], along + [(0, 0)] * len(problem.fixed)
        inertia = height = mpf(0)
        for bar in problem.bars:
            u, v = along[bar.a], along[bar.b]
            inertia += mpf(bar.mass) / 3 * sum(x * x + x * y + y * y for x, y in zip(u, v, strict=True))
            height += mpf(bar.mass) * (at[bar.a][1] + at[bar.b][1]) / 2
        return inertia, height

    first = mpf(problem.angle)
    inertia, height = inertia_and_height(first)
    energy = inertia * mpf(problem.rate) ** 2 / 2 + mpf(GRAVITY) * height

    def pace(angle: mpf) -> mpf:
        inertia, height = inertia_and_height(angle)
        return 1 / sqrt(2 * (energy - mpf(GRAVITY) * height) / inertia)

    many = 200  # of a periodic function: to 25 digits
    turn = 2 * pi / many * sum(pace(first + 2 * pi * k / many) for k in range(many))
    left = DURATION % turn
    with mp.workdps(20):
        end = findroot(
            lambda x: quad(pace, linspace(first, x, 5)) - left, first + 2 * pi * left / turn, tol=1e-34
        )
    return np.array(problem.places(end)[problem.watched], float)


def four_bar_places(angle: mpf) -> list[tuple]:
    """The crank's angle is from hanging down. The rocker's joint is where two circles meet, on the right."""
    crank, coupler, rocker = mpf(0.4), mpf(1.1), mpf(0.8)
    x, y = crank * sin(angle), -crank * cos(angle)
    apart = sqrt((1 - x) ** 2 + y**2)
    along = (apart**2 + coupler**2 - rocker**2) / (2 * apart)
    across = sqrt(coupler**2 - along**2)
    u, v = (1 - x) / apart, -y / apart
    return [(x, y), (x + u * along + v * across, y + v * along - u * across)]


FOUR_BAR = Problem(
    name="four-bar",
    moving=2,
    fixed=[(0, 0), (1, 0)],
    bars=[Bar(-1, 0, 0.4, 0.4), Bar(-2, 1, 0.8, 0.8), Bar(0, 1, 1.1, 1.1)],
    places=four_bar_places,
    angle=math.pi / 2,
    rate=9.0,
    watched=1,
    point="joint_2",
    scenario="""[system]
model = "four_bar"
[start]
theta_1 = "90 deg"
theta_dot_1 = 9.0
assemble = ["theta_2", "theta_3", "theta_dot_2", "theta_dot_3"]
theta_2 = "45 deg"
theta_3 = "-165 deg"
""",
)
A02_MODEL = """
from sympy import cos, sin
def define(model, links):
    L, tips = 0, []
    for k in range(links + 1):
        phi = model.coordinate(f"phi_{k}", "rad")
        L += model.rate(phi) ** 2 / 6 - 9.81 * cos(phi) / 2
        tips.append((k + sin(phi), cos(phi)))
    model.point("tip", tips[0])
    for k in range(1, links + 1):
        psi = model.coordinate(f"psi_{k}", "rad")
        (ax, ay), (bx, by) = tips[k - 1], tips[k]
        mx, my = ax + cos(psi) / 2, ay + sin(psi) / 2
        L += (model.rate(mx) ** 2 + model.rate(my) ** 2) / 2 + model.rate(psi) ** 2 / 24 - 9.81 * my
        model.constraint(f"x_{k}", ax + cos(psi) - bx, "m")
        model.constraint(f"y_{k}", ay + sin(psi) - by, "m")
    model.lagrangian = L
"""
A02 = Problem(
    name="A02",
    moving=3,
    fixed=[(0, 0), (1, 0), (2, 0)],
    bars=[Bar(-1, 0, 1, 1), Bar(0, 1, 1, 1), Bar(-2, 1, 1, 1), Bar(1, 2, 1, 1), Bar(-3, 2, 1, 1)],
    places=lambda angle: [(k + sin(angle), cos(angle)) for k in range(3)],
    angle=0.0,
    rate=1.0,
    watched=0,
    point="tip",
    scenario="""[system]
model = "a02.py"
links = 2
[start]
phi_dot_0 = 1
assemble = ["phi_1", "phi_2", "psi_1", "psi_2", "phi_dot_1", "phi_dot_2", "psi_dot_1", "psi_dot_2"]
""",
)
A02_PUBLISHED = (0.328458111540815379, 0.944518538178600962)

JOINTS_MODEL = """
def define(model, links):
    fixed, bars, g = {fixed}, {bars}, model.parameter("g", "m/s^2", default={gravity})
    joints = [[model.coordinate(f"{{axis}}_{{k}}", "m") for axis in "xy"] for k in range({moving})]
    model.point("watched", joints[{watched}])
    model.lagrangian = 0
    for k, (a, b, mass, length) in enumerate(bars):
        p, q = (joints[j] if j >= 0 else fixed[-1 - j] for j in (a, b))
        for x, y in zip(p, q):
            u, v = (model.rate(each) if each not in (0, 1, 2) else 0 for each in (x, y))
            model.lagrangian += mass * (u**2 + u * v + v**2) / 6
        model.lagrangian -= mass * g * (p[1] + q[1]) / 2
        model.constraint(f"bar_{{k}}", ((p[0] - q[0]) ** 2 + (p[1] - q[1]) ** 2 - length**2) / 2, "m^2")
"""


def in_joints(problem: Problem) -> tuple[str, str]:
    """A model in the coordinates of linkage_peers.cpp, the places of joints, and its scenario but for the run."""
    bars = [(bar.a, bar.b, bar.mass, bar.length) for bar in problem.bars]
    model = JOINTS_MODEL.format(
        fixed=problem.fixed, bars=bars, moving=problem.moving, watched=problem.watched, gravity=GRAVITY
    )
    start = [
        f"{axis}_{k} = {float(place)!r}\n{axis}_dot_{k} = {float(speed)!r}\n"
        for k in range(problem.moving)
        for axis, place, speed in zip("xy", problem.place(k), problem.speed(k), strict=True)
    ]
    return model, f'[system]\nmodel = "joints_{problem.moving}.py"\n[start]\n{"".join(start)}'
