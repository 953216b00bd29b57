"""Models with constraints: order, what holds at rounding, energy, starts, and truths that no solver of ours gave."""

import json
import math
import random
import statistics

import pytest

# Uprights and couplers of N four-bars side by side, slender rods of 1 m and 1 kg; one freedom (IFToMM A02).
FOUR_BARS = """
from sympy import cos, sin


def define(model, links):
    g = model.parameter("g", "m/s^2", default=9.81)
    L, tips = 0, []
    for k in range(links + 1):
        phi = model.coordinate(f"phi_{k}", "rad")
        L += model.rate(phi) ** 2 / 6 - g * cos(phi) / 2
        tips.append((k + sin(phi), cos(phi)))
    model.point("tip", tips[0])
    for k in range(1, links + 1):
        psi = model.coordinate(f"psi_{k}", "rad")
        (ax, ay), (bx, by) = tips[k - 1], tips[k]
        mx, my = ax + cos(psi) / 2, ay + sin(psi) / 2
        L += (model.rate(mx) ** 2 + model.rate(my) ** 2) / 2 + model.rate(psi) ** 2 / 24 - g * my
        model.constraint(f"x_{k}", ax + cos(psi) - bx, "m")
        model.constraint(f"y_{k}", ay + sin(psi) - by, "m")
    model.lagrangian = L
"""
FOUR_BARS_START = """
phi_0 = 0
phi_dot_0 = 1
assemble = ["phi_1", "phi_2", "psi_1", "psi_2", "phi_dot_1", "phi_dot_2", "psi_dot_1", "psi_dot_2"]
"""
# Of three bars in angles.
ANGLES = """
from sympy import cos, sin


def define(model, links):
    g, x, y, L = model.parameter("g", "m/s^2", default=9.81), 0, 0, 0
    for k, (length, mass, share) in enumerate([(1.0, 1.0, 1), (1.5, 2.0, 1), (1.2, 0.3, 0.5)], start=1):
        angle = model.coordinate(f"theta_{k}", "rad")
        bob = x + share * length * sin(angle), y - share * length * cos(angle)
        L += mass * (model.rate(bob[0]) ** 2 + model.rate(bob[1]) ** 2) / 2 - mass * g * bob[1]
        x, y = x + length * sin(angle), y - length * cos(angle)
    model.lagrangian = L
    model.constraint("loop_x", x - 1.6, "m")
    model.constraint("loop_y", y, "m")
"""
ANGLES_START = """
theta_1 = 1.1
theta_2 = 1.9
theta_3 = 2.9
assemble = ["theta_2", "theta_3"]
"""
# The same kind, of bobs in Cartesian coordinates.
BOBS = """
def define(model, links):
    g, d = model.parameter("g", "m/s^2", default=9.81), 1.6
    (a, b), (p, q) = ([model.coordinate(f"{axis}_{k}", "m") for axis in "xy"] for k in (1, 2))
    kinetic = model.rate(a) ** 2 / 2 + model.rate(b) ** 2 / 2 + model.rate(p) ** 2 + model.rate(q) ** 2
    model.lagrangian = kinetic - g * (b + 2 * q)
    model.constraint("crank", (a**2 + b**2 - 1) / 2, "m^2")
    model.constraint("coupler", ((p - a) ** 2 + (q - b) ** 2 - 1.5**2) / 2, "m^2")
    model.constraint("rocker", ((d - p) ** 2 + q**2 - 1.2**2) / 2, "m^2")
"""
BOBS_START = """
x_1 = 0.89
y_1 = -0.45
x_2 = 2.2
y_2 = -1.0
assemble = ["x_1", "y_1", "x_2", "y_2"]
"""
SLIDER = """
from sympy import cos, sin


def define(model, links):
    a, b, s = model.coordinate("crank", "rad"), model.coordinate("rod", "rad"), model.coordinate("s", "m")
    l, r = model.parameter("l", "m", default=2.0), model.parameter("r", "m", default=0.5)
    va, vb, vs = map(model.rate, (a, b, s))
    px, py = r * cos(a) + l / 2 * cos(b), r * sin(a) - l / 2 * sin(b)
    model.lagrangian = 0.3 * va**2 / 2 + (model.rate(px) ** 2 + model.rate(py) ** 2) / 2 + l**2 / 24 * vb**2
    model.lagrangian += 0.5 * vs**2 - 9.81 * (py + sin(a) / 2)
    model.constraint("across", r * sin(a) - l * sin(b), "m")
    model.constraint("along", r * cos(a) + l * cos(b) - s, "m")
"""
SLIDER_START = """
crank = 0.4
crank_dot = 5.0
rod = 0.1
s = 2.4
assemble = ["rod", "s", "rod_dot", "s_dot"]
"""
ROD = """
def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    model.lagrangian = (model.rate(x) ** 2 + model.rate(y) ** 2) - 2 * 9.81 * y
    model.constraint("rod", (x**2 + y**2 - 0.64) / 2, "m^2")
"""
# Two masses on a moving axle between springs, from the Test Set for IVP Solvers.
CAR_AXIS = """
from sympy import sin, sqrt


def define(model, links):
    xl, yl, xr, yr = (model.coordinate(name, "m") for name in ("x_l", "y_l", "x_r", "y_r"))
    yb = sin(10 * model.time) / 10
    xb = sqrt(1 - yb**2)
    L = 5e-4 * sum(model.rate(c) ** 2 for c in (xl, yl, xr, yr)) / 2 - 5e-4 * (yl + yr)
    L -= (sqrt(xl**2 + yl**2) - 0.5) ** 2 / 2 + (sqrt((xr - xb) ** 2 + (yr - yb) ** 2) - 0.5) ** 2 / 2
    model.lagrangian = L
    model.constraint("right_angle", xl * xb + yl * yb, "m^2")
    model.constraint("axle", (xl - xr) ** 2 + (yl - yr) ** 2 - 1, "m^2")
"""
CAR_AXIS_START = """
x_l = 0
y_l = 0.5
x_r = 1
y_r = 0.5
x_l_dot = -0.5
y_l_dot = 0
x_r_dot = -0.5
y_r_dot = 0
"""
# Two cranks of 1 m, 2 m apart, with a coupler that a third crank holds in the middle.
PARALLEL = """
def define(model, links):
    (a, b), (c, d) = ([model.coordinate(name, "m") for name in pair] for pair in ("ab", "cd"))
    rates = [model.rate(each) for each in (a, b, c, d)]
    model.lagrangian = sum(rate**2 for rate in rates) / 2 - 9.81 * (b + d)
    model.constraint("first", a**2 + b**2 - 1, "m^2")
    model.constraint("second", (c - 2) ** 2 + d**2 - 1, "m^2")
    model.constraint("coupler", (c - a) ** 2 + (d - b) ** 2 - 4, "m^2")
    model.constraint("third", ((a + c) / 2 - 1) ** 2 + ((b + d) / 2) ** 2 - 1, "m^2")
"""
PARALLEL_START = "".join(
    f"{name} = {value}\n"
    for name, value in zip("abcd", (math.sin(1), -math.cos(1), 2 + math.sin(1), -math.cos(1)), strict=True)
)
# Two bobs in space between two hooks, by three bars.
SPACE = """
def define(model, links):
    g = model.parameter("g", "m/s^2", default=9.81)
    a, b = ([model.coordinate(f"{axis}_{k}", "m") for axis in "xyz"] for k in (1, 2))
    squared = [sum(model.rate(each) ** 2 for each in bob) for bob in (a, b)]
    model.lagrangian = squared[0] / 2 + squared[1] - g * (a[2] + 2 * b[2])
    hook = (1.6, 0.4, 0.3)
    model.constraint("first", (sum(x**2 for x in a) - 1) / 2, "m^2")
    model.constraint("middle", (sum((x - y) ** 2 for x, y in zip(a, b)) - 1.5**2) / 2, "m^2")
    model.constraint("last", (sum((x - y) ** 2 for x, y in zip(b, hook)) - 1.2**2) / 2, "m^2")
"""
SPACE_START = """
x_1 = 0.8
y_1 = 0.3
z_1 = -0.5
x_2 = 2.0
y_2 = 0.6
z_2 = -0.9
y_dot_1 = 0.7
z_dot_2 = 0.4
assemble = ["x_1", "y_1", "z_1", "x_2", "y_2", "z_2", "x_dot_1", "z_dot_1", "x_dot_2", "y_dot_2"]
"""
LINKAGES = {
    "angles": (ANGLES, ANGLES_START),
    "bobs": (BOBS, BOBS_START),
    "slider": (SLIDER, SLIDER_START),
    "space": (SPACE, SPACE_START),
}


@pytest.fixture
def scenario(tmp_path):
    """scenario(model, start, more of [system]) -> its file."""

    def write(model, start, more=""):
        (tmp_path / "linkage.py").write_text(model)
        file = tmp_path / "linkage.toml"
        file.write_text(
            f'[system]\nmodel = "linkage.py"\n{more}\n[start]\n{start}\n[run]\nduration = 2.0\nstep = 0.01\n'
        )
        return file

    return write


@pytest.fixture
def pendulum(simulate, tmp_path):
    """The angle of a pendulum of 2 kg after 2 s, by the chain solver."""

    def run(length, theta, damping=0.0) -> float:
        file = tmp_path / "pendulum.toml"
        file.write_text(
            f'[chain]\nspace = "planar"\nmasses = [2.0]\nlengths = [{length}]\ndamping = [{damping}]\n'
            f"[start]\ntheta = [{theta}]\n[run]\nduration = 2.0\naccuracy = 1e-11\n"
        )
        return simulate(file)["final"]["q"]["theta_1"]

    return run


def last(summary) -> list[float]:
    return [*summary["final"]["q"].values(), *summary["final"]["v"].values()]


def off(summary, truth) -> float:
    return max(abs(x - y) for x, y in zip(last(summary), truth, strict=True))


@pytest.mark.parametrize("name", LINKAGES)
def test_order_is_twice_the_number_of_stages(name, scenario, simulate):
    file = scenario(*LINKAGES[name])
    pace = 2 if name == "slider" else 1  # its crank turns as fast
    truth = last(simulate(file, run__stages=6, run__step=1 / 512))
    for stages, steps in ((1, (32, 64, 128)), (2, (32, 64, 128)), (3, (16, 32, 64)), (4, (16, 24, 32))):
        runs = [simulate(file, run__stages=stages, run__step=1 / (pace * n)) for n in steps]
        errors = [off(run, truth) for run in runs]
        order = math.log(errors[-2] / errors[-1]) / math.log(steps[-1] / steps[-2])
        assert abs(order - 2 * stages) < 0.5, (stages, errors)
        for run in runs:
            assert max(run["constraint_error"].values()) < 1e-13, (stages, run["constraint_error"])  # 1.4e-15


# Steps a second of each number of stages: from there on errors shrink to rounding.
MANY_STAGES = {5: (8, 12, 16, 20, 24), 6: (6, 8, 10, 12, 16), 7: (5, 6, 8, 10, 12), 8: (4, 5, 6, 8, 10)}


@pytest.mark.parametrize("name", LINKAGES)
def test_orders_of_many_stages(name, scenario, simulate):
    """Errors change their signs, so that orders are those of a line through five of them."""
    file = scenario(*LINKAGES[name])
    pace = {"slider": 2, "space": 0.7}.get(name, 1)
    truth = last(simulate(file, run__stages=8, run__step=1 / 256, run__iteration="newton"))
    for stages, steps in MANY_STAGES.items():
        runs = [
            simulate(file, run__stages=stages, run__step=1 / (pace * n), run__iteration="newton")
            for n in steps
        ]
        errors = [math.log(off(run, truth)) for run in runs]
        order = -statistics.linear_regression([math.log(n) for n in steps], errors).slope
        assert order > 2 * stages - 1, (stages, order)  # measured from 2 s - 0.6 to 2 s + 6.4
        for run in runs:
            assert max(run["constraint_error"].values()) < 1e-13, (stages, run["constraint_error"])  # 1.4e-15


def test_energy_does_not_drift(scenario, rows):
    file = scenario(ANGLES, ANGLES_START)
    energy = rows(file, run__stages=3, run__step=0.02, run__duration=200)["energy"]
    first, end = (max(abs(h - energy[0]) for h in part) for part in (energy[:1000], energy[-1000:]))
    assert 0 < end < 1.2 * first, (first, end)


def test_a_rod_as_constraint_is_a_pendulum(scenario, simulate, pendulum):
    found = simulate(scenario(ROD, "x = 0.8\ny = 0"), run__stages=6)["final"]["q"]
    angle = pendulum(0.8, math.pi / 2)
    assert abs(found["x"] - 0.8 * math.sin(angle)) < 1e-11
    assert abs(found["y"] + 0.8 * math.cos(angle)) < 1e-11


@pytest.mark.parametrize("name", LINKAGES)
def test_newton_takes_the_same_steps(name, scenario, simulate):
    file = scenario(*LINKAGES[name])
    found = [simulate(file, run__stages=3, run__iteration=by) for by in ("fixed-point", "newton")]
    assert off(found[0], last(found[1])) < 1e-11  # measured
    assert max(found[1]["constraint_error"].values()) < 1e-14
    assert found[1]["newton_iterations"] < 3.5 * found[1]["steps"]  # quadratic


@pytest.mark.parametrize("damping", [1.0, 1e3, 1e6])
def test_damping_faster_than_a_step(damping, scenario, simulate, pendulum):
    friction = f"    model.dissipation = {damping} * (model.rate(x)**2 + model.rate(y)**2) / 2 / 0.64\n"
    file = scenario(ROD + friction, "x = 0.8\ny = 0")
    found = simulate(file, run__step="", run__accuracy=1e-9)["final"]["q"]
    assert abs(math.atan2(found["x"], -found["y"]) - pendulum(0.8, math.pi / 2, damping)) < 1e-9


WALL = """
from sympy import Piecewise, cos, sin
def define(model, links):
    x, y = PLACE
    model.lagrangian = SPEED_SQUARED / 2 - 9.81 * y - Piecewise((200 * (x - 0.3)**2, x > 0.3), (0, True))
"""
BY_ROD = """    model.constraint("rod", (x**2 + y**2 - 1) / 2, "m^2")
"""


@pytest.mark.parametrize("settings", [{"run__accuracy": 1e-10, "run__step": ""}, {"run__stages": 8}])
def test_pieces_meet_between_steps(settings, scenario, simulate):
    """A bob on a rod runs into a soft wall, as the pendulum by its angle does."""
    by_rod = WALL.replace("PLACE", 'model.coordinate("x", "m"), model.coordinate("y", "m")')
    by_rod = by_rod.replace("SPEED_SQUARED", "(model.rate(x)**2 + model.rate(y)**2)") + BY_ROD
    rod = simulate(scenario(by_rod, "x = -0.8\ny = -0.6"), run__duration=10, **settings)
    by_angle = WALL.replace(
        "x, y = PLACE", 'theta = model.coordinate("theta", "rad")\n    x, y = sin(theta), -cos(theta)'
    )
    by_angle = by_angle.replace("SPEED_SQUARED", "model.rate(theta)**2")
    angle = simulate(scenario(by_angle, "theta = -0.9272952180016122"), run__duration=10, **settings)
    assert max(rod["constraint_error"].values()) < 1e-14
    place, theta = rod["final"]["q"], angle["final"]["q"]["theta"]
    # Measured off by 2.4e-12 by accuracy, 7.8e-16 by steps.
    assert max(abs(place["x"] - math.sin(theta)), abs(place["y"] + math.cos(theta))) < 1e-9


@pytest.mark.parametrize("iteration", ["fixed-point", "newton"])
def test_a_constraint_that_follows_from_others(iteration, scenario, pendula, pendulum):
    """A parallelogram with a third crank is a pendulum; the three forces are not unique, and that is said."""
    file = scenario(PARALLEL, PARALLEL_START)
    ended = pendula("simulate", file, "--json", "--set=run.stages=6", f"--set=run.iteration={iteration}")
    assert (ended.returncode, "1 of the 4 constraints follow" in ended.stderr) == (0, True)
    run = json.loads(ended.stdout)
    assert run["degrees_of_freedom"] == 1
    assert max(run["constraint_error"].values()) < 1e-13
    q = run["final"]["q"]
    assert abs(math.atan2(q["a"], -q["b"]) - pendulum(1.0, 1.0)) < 1e-11


def test_four_bars_pass_their_singular_positions(scenario, simulate):
    """Where all bars are level, the couplers could turn either way."""
    file = scenario(FOUR_BARS, FOUR_BARS_START, "links = 2")
    run = simulate(file, run__stages=4, run__step=0.01, run__duration=10)
    x, y = run["final"]["points"]["tip"]
    assert max(abs(x - 0.328458111540815379), abs(y - 0.944518538178600962)) < 1e-9
    assert run["degrees_of_freedom"] == 1


def test_constraints_may_move(scenario, simulate):
    file = scenario(CAR_AXIS, CAR_AXIS_START)
    found = simulate(file, run__stages=4, run__step=0.005, run__duration=3)["final"]
    q, v = found["q"], found["v"]
    assert abs(q["x_l"] - 0.0493455784275) < 1e-9
    assert abs(q["x_r"] - 1.0417425248854) < 1e-9
    assert abs(v["y_r"] - 0.770341043780) < 1e-8


def test_a_car_axis_by_accuracy(scenario, simulate):
    found = simulate(scenario(CAR_AXIS, CAR_AXIS_START), run__accuracy=1e-10, run__step="", run__duration=3)
    truth = {"x_l": 0.0493455784275, "y_l": 0.4969894602300, "x_r": 1.0417425248854, "y_r": 0.3739110272654}
    off = max(abs(found["final"]["q"][name] - value) for name, value in truth.items())
    assert off < 1e-10, off  # measured 2.8e-14: every printed digit is right


def test_forces_are_columns(scenario, rows):
    """The pull in the rod of a pendulum: λ r = m (v²/r + g cos θ), and the constraint's slope is r."""
    found = rows(scenario(ROD, "x = 0.8\ny = 0"))
    for x, y, u, w, force in zip(*(found[n] for n in ("x", "y", "x_dot", "y_dot", "force_rod")), strict=True):
        assert abs(-force - 2 * (u * u + w * w - 9.81 * y) / 0.64) < 1e-11
        assert abs(x * x + y * y - 0.64) < 1e-14


CART = """
def define(model, links):
    s, x, y = (model.coordinate(name, "m") for name in "sxy")
    model.lagrangian = model.rate(s) ** 2 + (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - 9.81 * y
    model.force(s, model.input("push", "N"))
    model.constraint("rod", (x - s) ** 2 + y**2 - 0.25, "m^2")
"""
PUSHES = {
    "drive": "constant = 10",
    "signal": "times = [0.0, 1.0]\nvalues = [8.0, 12.0]",
    "feedback": 'value = "10 + t - t"\nsample = 0.02',
}


@pytest.mark.parametrize("by", PUSHES)
def test_forces_know_inputs(by, scenario, rows):
    """Of a pendulum on a cart that is pushed: λ from d²g/dt² = 0, by hand."""
    push = f'[[system.{by}]]\ninput = "push"\n{PUSHES[by]}\n'
    found = rows(scenario(CART, "x = 0.3\ny = -0.4", push))
    for time, s, x, y, v, u, w, force in zip(
        *(found[n] for n in ("t", "s", "x", "y", "s_dot", "x_dot", "y_dot", "force_rod")), strict=True
    ):
        pushed = 8 + 4 * time if by == "signal" and time < 1 else 12 if by == "signal" else 10
        d = x - s
        turning = (u - v) ** 2 + w**2
        gives = 4 * (d**2 * (1 + 1 / 2) + y**2)  # of masses 2 (cart) and 1
        assert abs(force * gives / 2 + turning - 9.81 * y - d * pushed / 2) < 1e-9
        assert abs(d * d + y * y - 0.25) < 1e-13


@pytest.mark.parametrize("name", LINKAGES)
def test_rows_just_after_a_step(name, scenario, rows):
    """Rounding of constraints is all that is left to correct there."""
    after = [0.0, *(10.0**k for k in range(-15, -6))]
    file = scenario(*LINKAGES[name], more="")
    found = rows(file, run__stages=4, run__duration=1, output__times=[0.5 + h for h in after])
    rates = [column for key, column in found.items() if "_dot" in key]
    assert rates
    for column in rates:
        # By accelerations, measured up to 6.3 in these units; where iterations do not end, by 1e-6.
        assert all(abs(x - column[0]) <= 20 * h + 1e-13 for h, x in zip(after, column, strict=True))


@pytest.mark.parametrize("seed", range(24))
def test_wild_guesses_find_the_nearest_way_to_close(seed, scenario, simulate):
    """Two circles about the joint of the first bar and the support meet twice."""
    dice = random.Random(seed)
    first = dice.uniform(-3, 3)
    guess = [dice.uniform(-6, 6) for _ in range(2)]
    joint, support = complex(math.sin(first), -math.cos(first)), 1.6
    across, r, s = support - joint, 1.5, 1.2
    along = (abs(across) ** 2 + r**2 - s**2) / (2 * abs(across))
    ways = []
    for side in (1j, -1j):
        knee = joint + across / abs(across) * (along + side * math.sqrt(r**2 - along**2))
        angles = [math.atan2(bar.real, -bar.imag) for bar in (knee - joint, support - knee)]
        ways.append([a + math.tau * round((g - a) / math.tau) for a, g in zip(angles, guess, strict=True)])
    start = (
        f'theta_1 = {first}\ntheta_2 = {guess[0]}\ntheta_3 = {guess[1]}\nassemble = ["theta_2", "theta_3"]'
    )
    run = simulate(scenario(ANGLES, start), run__duration=0.01)
    nearest = min(ways, key=lambda way: math.dist(way, guess))
    assert math.dist(run["assembled"].values(), nearest) < 1e-13  # measured 9.9e-15
    assert list(run["guesses"].values()) == guess


STARTS = {
    'theta_1 = 1.1\ntheta_2 = 1.9\ntheta_3 = 2.9\nassemble = ["theta_3"]': "left over",
    "theta_1 = 1.1\ntheta_2 = 1.2\ntheta_3 = 3.7\ntheta_dot_1 = 1": "left over",
    'theta_1 = 1.1\nassemble = ["theta_4"]': "expected a coordinate or a rate of the model",
}


@pytest.mark.parametrize(("start", "told"), STARTS.items())
def test_starts_that_cannot_be_put_together(start, told, scenario, pendula):
    ended = pendula("simulate", scenario(ANGLES, start))
    assert ended.returncode == 2
    assert told in ended.stderr


REFUSED = {
    "run.method": ("rk4", "method: expected gauss, got rk4, for a system with constraints"),
    "run.form": ("velocity", "form: expected momentum, got velocity, for a system with constraints"),
}


@pytest.mark.parametrize("key", REFUSED)
def test_what_cannot_keep_constraints(key, scenario, pendula):
    value, told = REFUSED[key]
    ended = pendula("simulate", scenario(ANGLES, ANGLES_START), f"--set={key}={value}")
    assert ended.returncode == 2
    assert told in ended.stderr
