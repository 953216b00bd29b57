"""Constraints of rates: order, energy, starts, and truths that no solver of ours gave."""

import json
import math

import pytest

# On a blade that does not slide sideways, the mass at a distance `a` before it (Chaplygin); on a slope, and where the
# ice moves under it, too.
SLEIGH = """
from sympy import cos, sin


def define(model, links):
    x, y, phi = (model.coordinate(*each) for each in (("x", "m"), ("y", "m"), ("phi", "rad")))
    m, J = model.parameter("m", "kg", default=1.3), model.parameter("J", "kg m^2", default=0.2)
    a, g = model.parameter("a", "m", default=0.4), model.parameter("g", "m/s^2", default=0.0)
    fast = model.parameter("fast", "m/s", default=0.0)
    mass = x + a * cos(phi), y + a * sin(phi)
    model.lagrangian = m * (model.rate(mass[0]) ** 2 + model.rate(mass[1]) ** 2) / 2 + J * model.rate(phi) ** 2 / 2
    model.lagrangian += m * g * mass[0]
    sideways = model.rate(y) * cos(phi) - model.rate(x) * sin(phi)
    MOVING
"""
ICE = 'model.constraint("blade", sideways + fast * sin(model.time + x), "m/s")'
MOVING = SLEIGH.replace("MOVING", ICE)
SLEIGH = SLEIGH.replace("MOVING", 'model.constraint("blade", sideways, "m/s")')
SLEIGH_START = f"phi = 0.7\nx_dot = {math.cos(0.7)}\ny_dot = {math.sin(0.7)}\nphi_dot = 1.2"
# A disc that rolls upright, on a slope along x.
UPRIGHT = """
from sympy import cos, sin


def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    phi, theta = model.coordinate("phi", "rad"), model.coordinate("theta", "rad")
    m, r, g = 2.0, 0.5, model.parameter("g", "m/s^2", default=1.7)
    kinetic = m * (model.rate(x) ** 2 + model.rate(y) ** 2) + 0.3 * model.rate(theta) ** 2 + 0.1 * model.rate(phi) ** 2
    model.lagrangian = kinetic / 2 + m * g * x
    model.constraint("rolls_x", model.rate(x) - r * cos(phi) * model.rate(theta), "m/s")
    model.constraint("rolls_y", model.rate(y) - r * sin(phi) * model.rate(theta), "m/s")
"""
# A thin disc that rolls and leans: heading phi, inclination of its plane theta, turn about its axis psi.
DISC = """
from sympy import cos, sin


def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    phi, theta, psi = (model.coordinate(name, "rad") for name in ("phi", "theta", "psi"))
    m, r, g = 1.5, 0.3, 9.81
    turn, lean, spin = model.rate(phi), model.rate(theta), model.rate(psi) + model.rate(phi) * cos(theta)
    L = m * (model.rate(x) ** 2 + model.rate(y) ** 2 + model.rate(r * sin(theta)) ** 2) / 2
    L += m * r**2 / 8 * (lean**2 + turn**2 * sin(theta) ** 2) + m * r**2 / 4 * spin**2
    model.lagrangian = L - m * g * r * sin(theta)
    out = r * lean * sin(theta)
    model.constraint("rolls_x", model.rate(x) - out * sin(phi) + r * spin * cos(phi), "m/s")
    model.constraint("rolls_y", model.rate(y) + out * cos(phi) + r * spin * sin(phi), "m/s")
"""
DISC_START = "theta = 1.2\nphi_dot = 1.1\npsi_dot = 8.0\ntheta_dot = 0.3"
# A ball on a table that turns.
BALL = """
from sympy import cos, sin


def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    phi, theta, psi = (model.coordinate(name, "rad") for name in ("phi", "theta", "psi"))
    m, r, table = 0.7, 0.2, model.parameter("table", "rad/s", default=2.0)
    u, v, w = map(model.rate, (phi, theta, psi))
    J = 0.4 * m * r**2
    spins = v**2 + u**2 + w**2 + 2 * u * w * cos(theta)
    model.lagrangian = m * (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 + J * spins / 2
    along_x, along_y = v * cos(phi) + w * sin(theta) * sin(phi), v * sin(phi) - w * sin(theta) * cos(phi)
    model.constraint("rolls_x", model.rate(x) - r * along_y + table * y, "m/s")
    model.constraint("rolls_y", model.rate(y) + r * along_x - table * x, "m/s")
"""
BALL_START = "x = 0.4\ny = 0.1\ntheta = 1.5\nx_dot = 0.05\ny_dot = 0.2\nphi_dot = 0.3"
# A pendulum on an axle; WHEEL says how it rolls.
CART = """
from sympy import cos, sin


def define(model, links):
    x, theta, phi = (model.coordinate(*each) for each in (("x", "m"), ("theta", "rad"), ("phi", "rad")))
    bob = x + 0.7 * sin(phi), -0.7 * cos(phi)
    L = 2 * model.rate(x) ** 2 / 2 + 0.1 * model.rate(theta) ** 2 / 2
    L += (model.rate(bob[0]) ** 2 + model.rate(bob[1]) ** 2) / 2 - 9.81 * bob[1]
    model.lagrangian = L
    WHEEL
"""
BY_RATES = 'model.constraint("rolls", model.rate(x) - 0.3 * model.rate(theta), "m/s")'
BY_PLACES = 'model.constraint("rolls", x - 0.3 * theta, "m")'
CART_START = "phi = 1.3\nx_dot = 0.6\ntheta_dot = 2.0\n"
MODELS = {
    "sleigh": (SLEIGH, SLEIGH_START, ""),
    "moving": (MOVING, "phi = 0.7\nphi_dot = 1.2", "parameters = { g = 2.0, fast = 0.3 }"),
    "upright": (UPRIGHT, "phi_dot = 0.8\ntheta_dot = 1.5", ""),
    "disc": (DISC, DISC_START, ""),
    "ball": (BALL, BALL_START, ""),
}
# By which of coarse steps orders are seen, and those of four stages.
PACE = {"sleigh": (1, 1), "moving": (1, 1), "upright": (0.25, 0.25), "disc": (4, 6), "ball": (3, 6)}


@pytest.fixture
def scenario(tmp_path):
    """scenario(model, start, parameters) -> its file."""

    def write(model, start, more=""):
        (tmp_path / "rolling.py").write_text(model)
        file = tmp_path / "rolling.toml"
        file.write_text(
            f'[system]\nmodel = "rolling.py"\n{more}\n[start]\n{start}\n[run]\nduration = 2.0\nstep = 0.01\n'
        )
        return file

    return write


def last(summary) -> list[float]:
    return [*summary["final"]["q"].values(), *summary["final"]["v"].values()]


def off(summary, truth) -> float:
    return max(abs(x - y) for x, y in zip(last(summary), truth, strict=True))


@pytest.mark.parametrize("name", MODELS)
def test_order_is_twice_the_number_of_stages(name, scenario, simulate):
    file = scenario(*MODELS[name])
    truth = last(simulate(file, run__stages=6, run__step=1 / 256))
    for stages, steps in ((1, (64, 128)), (2, (32, 64)), (3, (16, 32)), (4, (8, 12))):
        runs = [
            simulate(file, run__stages=stages, run__step=1 / (PACE[name][stages == 4] * n)) for n in steps
        ]
        errors = [off(run, truth) for run in runs]
        order = math.log(errors[0] / errors[1]) / math.log(steps[1] / steps[0])
        assert abs(order - 2 * stages) < 0.2, (stages, errors)  # measured 0.064
        for run in runs:
            assert run["constraint_error"]["position"] == 0
            assert run["constraint_error"]["rate"] < 1e-13, stages  # measured 1.7e-15


@pytest.mark.parametrize("name", MODELS)
def test_newton_takes_the_same_steps(name, scenario, simulate):
    file = scenario(*MODELS[name])
    found = [simulate(file, run__stages=3, run__iteration=by) for by in ("fixed-point", "newton")]
    assert off(found[0], last(found[1])) < 1e-12  # measured 6e-15
    assert found[1]["newton_iterations"] < 3.5 * found[1]["steps"]  # quadratic


def test_the_sleigh_turns_until_it_goes_straight(scenario, simulate):
    """u = V tanh(k (t - s)), turning Ω / cosh(k (t - s)), V² = 2E/m, Ω² = 2E/(J + m a²), k = m a V/(J + m a²)."""
    m, a, J, u, turning = 1.3, 0.4, 0.2, 1.0, 1.2
    inertia = J + m * a * a
    E = m * u**2 / 2 + inertia * turning**2 / 2
    V, W = math.sqrt(2 * E / m), math.sqrt(2 * E / inertia)
    k = m * a * V / inertia
    since = math.atanh(u / V) / k
    found = simulate(scenario(SLEIGH, SLEIGH_START), run__stages=6)["final"]
    end = k * (2 + since)

    def turned(at):
        return 2 * math.atan(math.tanh(at / 2)) * W / k

    phi = found["q"]["phi"]
    along = found["v"]["x"] * math.cos(phi) + found["v"]["y"] * math.sin(phi)
    errors = (
        along - V * math.tanh(end),
        found["v"]["phi"] - W / math.cosh(end),
        phi - 0.7 - turned(end) + turned(k * since),
    )
    assert max(map(abs, errors)) < 1e-13  # measured 1.4e-17


def cycloid(slope, turning, time) -> tuple[float, float]:
    """Where what cannot slide sideways gets from rest, heading down the slope and turning."""
    angle = turning * time
    return slope / (2 * turning**2) * math.sin(angle) ** 2, slope / (2 * turning**2) * (
        angle - math.sin(2 * angle) / 2
    )


def test_a_skate_on_a_slope_does_not_get_down(scenario, rows):
    found = rows(
        scenario(SLEIGH, "phi_dot = 1.5", "parameters = { a = 0.0, g = 2.5 }"),
        run__stages=6,
        run__duration=20,
        run__step=0.02,
    )
    errors = [
        max(abs(x - X), abs(y - Y))
        for t, x, y in zip(found["t"], found["x"], found["y"], strict=True)
        for X, Y in [cycloid(2.5, 1.5, t)]
    ]
    assert max(errors) < 1e-12  # measured 7.1e-15, of coordinates up to 5.6


def test_a_disc_rolls_upright_on_a_slope(scenario, simulate):
    """As a skate, by a slope that turning about its axis makes less steep."""
    found = simulate(scenario(UPRIGHT, "phi_dot = 0.8"), run__stages=6)["final"]["q"]
    x, y = cycloid(1.7 * 2.0 / (2.0 + 0.3 / 0.5**2), 0.8, 2.0)
    assert max(abs(found["x"] - x), abs(found["y"] - y)) < 1e-13  # measured 1.1e-16


@pytest.mark.parametrize("theta", [1.2, 0.5])
def test_a_leaning_disc_rolls_in_a_circle(theta, scenario, rows):
    """(C + m r²) Ω P sin θ - A P² sin θ cos θ + m g r cos θ = 0, P its heading's rate and Ω that about its axis."""
    m, r, g, turning = 1.5, 0.3, 9.81, 2.0
    A, C = m * r**2 / 4, m * r**2 / 2
    spin = (A * turning**2 * math.sin(theta) * math.cos(theta) - m * g * r * math.cos(theta)) / (
        (C + m * r**2) * turning * math.sin(theta)
    )
    start = (
        f"theta = {theta}\ntheta_dot = 0\nphi_dot = {turning}\npsi_dot = {spin - turning * math.cos(theta)}"
    )
    found = rows(scenario(DISC, start), run__stages=6)
    radius = r * spin / turning
    worst = 0
    for t, x, y, lean, phi in zip(*(found[name] for name in ("t", "x", "y", "theta", "phi")), strict=True):
        around = -radius * math.sin(turning * t), -radius * (1 - math.cos(turning * t))
        worst = max(worst, abs(lean - theta), abs(phi - turning * t), math.dist((x, y), around))
    assert worst < 1e-12  # measured 1.1e-14


def test_a_ball_on_a_turning_table_goes_in_a_circle(scenario, simulate):
    """Its velocity turns by 2/7 of the table's rate, wherever it is."""
    run = simulate(scenario(BALL, BALL_START), run__stages=6)
    angle = 2 / 7 * 2.0 * 2.0
    u, v = 0.05, 0.2
    expected = u * math.cos(angle) - v * math.sin(angle), u * math.sin(angle) + v * math.cos(angle)
    got = run["final"]["v"]["x"], run["final"]["v"]["y"]
    assert math.dist(got, expected) < 1e-13  # measured 3.1e-16


def test_one_that_is_a_rate_is_that_of_positions(scenario, rows):
    found = [
        rows(scenario(CART.replace("WHEEL", wheel), CART_START), run__stages=3, run__duration=10)
        for wheel in (BY_RATES, BY_PLACES)
    ]
    worst = {
        name: max(abs(a - b) for a, b in zip(found[0][name], found[1][name], strict=True))
        for name in ("x", "theta", "phi", "x_dot", "phi_dot", "force_rolls")
    }
    assert max(worst.values()) < 1e-13  # measured 4.5e-15


def test_one_that_depends_on_time(scenario, simulate):
    """The cart is moved as cos 3t by a constraint of rates, as sin(3t)/3 by one of positions."""
    runs = [
        simulate(
            scenario(CART.replace("WHEEL", wheel), "phi = 1.3\nx_dot = 1.0\ntheta_dot = 0.0\n"), run__stages=6
        )
        for wheel in (
            'model.constraint("moved", model.rate(x) - cos(3 * model.time), "m/s")',
            'model.constraint("moved", x - sin(3 * model.time) / 3, "m")',
        )
    ]
    assert off(runs[0], last(runs[1])) < 1e-13  # measured 4.4e-16


PARALLEL = """
def define(model, links):
    (a, b), (c, d) = ([model.coordinate(name, "m") for name in pair] for pair in ("ab", "cd"))
    rates = [model.rate(each) for each in (a, b, c, d)]
    model.lagrangian = sum(rate**2 for rate in rates) / 2 - 9.81 * (b + d)
    model.constraint("first", a**2 + b**2 - 1, "m^2")
    model.constraint("second", (c - 2) ** 2 + d**2 - 1, "m^2")
    model.constraint("coupler", (c - a) ** 2 + (d - b) ** 2 - 4, "m^2")
    model.constraint("third", model.rate((a + c - 2) ** 2 + (b + d) ** 2), "m^2/s")
"""
PARALLEL_START = "".join(
    f"{name} = {value}\n"
    for name, value in zip("abcd", (math.sin(1), -math.cos(1), 2 + math.sin(1), -math.cos(1)), strict=True)
)


@pytest.mark.parametrize("iteration", ["fixed-point", "newton"])
def test_one_that_follows_from_positions(iteration, scenario, pendula, simulate, tmp_path):
    """Three cranks of a coupler move as a pendulum; what holds the third one is told by its rate."""
    ended = pendula(
        "simulate",
        scenario(PARALLEL, PARALLEL_START),
        "--json",
        "--set=run.stages=6",
        f"--set=run.iteration={iteration}",
    )
    assert (ended.returncode, "1 of the 4 constraints follow" in ended.stderr) == (0, True)
    run = json.loads(ended.stdout)
    assert run["degrees_of_freedom"] == 1
    file = tmp_path / "pendulum.toml"
    file.write_text(
        '[chain]\nspace = "planar"\nmasses = [2.0]\nlengths = [1.0]\n'
        "[start]\ntheta = [1.0]\n[run]\nduration = 2.0\naccuracy = 1e-11\n"
    )
    angle = simulate(file)["final"]["q"]["theta_1"]
    assert max(run["constraint_error"].values()) < 1e-13  # measured 2.8e-14
    assert (
        abs(math.atan2(run["final"]["q"]["a"], -run["final"]["q"]["b"]) - angle) < 1e-11
    )  # measured 2.6e-13, of the chain


def test_energy_does_not_drift(scenario, rows):
    """The method is not symplectic; of motions that come back it is as if it were."""
    file = scenario(DISC, DISC_START)
    energy = rows(file, run__stages=3, run__step=0.02, run__duration=200)["energy"]
    first, end = (max(abs(h - energy[0]) for h in part) for part in (energy[:1000], energy[-1000:]))
    assert 0 < end < 1.2 * first, (first, end)  # measured 1.00


@pytest.mark.parametrize("damping", [1.0, 1e3, 1e6])
def test_damping_faster_than_a_step(damping, scenario, simulate):
    """Rolling and sliding friction on a wheel: x'' (m + J/r²) = -(c + c/r²) x'."""
    wheel = f"{BY_RATES}\n    model.dissipation = {damping} * (model.rate(x)**2 + model.rate(theta) ** 2) / 2"
    model = CART.replace("WHEEL", wheel).replace("bob = x + 0.7 * sin(phi), -0.7 * cos(phi)", "bob = phi, 0")
    found = simulate(scenario(model, "x_dot = 0.6\ntheta_dot = 2.0"), run__step="", run__accuracy=1e-9)[
        "final"
    ]
    rate = damping * (1 + 1 / 0.09) / (2 + 0.1 / 0.09)
    assert abs(found["q"]["x"] - 0.6 / rate * (1 - math.exp(-2 * rate))) < 1e-9  # measured 7.2e-14


def test_steps_of_its_own_choice(scenario, simulate):
    file = scenario(DISC, DISC_START)
    truth = last(simulate(file, run__stages=6, run__step=1 / 256))
    for key in ("run__tolerance", "run__accuracy"):
        run = simulate(file, run__step="", **{key: 1e-9})
        assert off(run, truth) < 1e-7  # measured 1.6e-9
        assert run["method"] == "gauss"


def test_starts(scenario, simulate, pendula):
    """Rates that are not given are those of least kinetic energy; positions are kept."""
    file = scenario(UPRIGHT, "x = 3.0\nphi = 0.4\ntheta_dot = 2.0")
    run = simulate(file, run__duration=0.01)
    assert set(run["assembled"]) == {"x_dot", "y_dot", "phi_dot"}
    assert abs(run["assembled"]["x_dot"] - math.cos(0.4)) < 1e-15  # measured 0
    assert run["degrees_of_freedom"] == 2
    ended = pendula("simulate", scenario(UPRIGHT, "x_dot = 1.0\ntheta_dot = 3.0"))
    assert ended.returncode == 2
    assert (
        "expected coordinates and rates that keep the constraints, got -0.5 m/s in the rolls_x"
        in ended.stderr
    )


def test_forces_are_columns(scenario, rows, pendula):
    """Of a wheel that a slope pulls: its rim is held back by m g - m x''."""
    file = scenario(UPRIGHT, "phi = 0.0\nphi_dot = 0.0")
    found = rows(file)
    expected = 2.0 * 1.7 * (2.0 / (2.0 + 0.3 / 0.25) - 1)
    assert max(abs(force - expected) for force in found["force_rolls_x"]) < 1e-12  # measured 2.2e-16


SKATE = """
from sympy import cos, sin


def define(model, links):
    x, y, phi = (model.coordinate(*each) for each in (("x", "m"), ("y", "m"), ("phi", "rad")))
    model.lagrangian = (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 + model.rate(phi) ** 2 / 10 + 2.5 * x
    model.force(x, model.input("push", "N"))
    model.constraint("blade", model.rate(y) * cos(phi) - model.rate(x) * sin(phi), "m/s")
"""


def test_events(scenario, pendula, tmp_path):
    """A skate on a slope is highest or lowest where it has turned by quarters."""
    file = scenario(SKATE, "phi_dot = 1.5")
    file.write_text(file.read_text() + '[[event]]\nname = "turns"\nwhen = "x_dot"\n')
    events = tmp_path / "events.csv"
    options = ("--set=run.duration=20.0", "--set=run.step=", "--set=run.accuracy=1e-11", f"--events={events}")
    ended = pendula("simulate", file, "--quiet", *options)
    assert ended.returncode == 0, ended.stderr
    times = [float(line.split(",")[1]) for line in events.read_text().splitlines()[1:]]
    assert len(times) == 19
    assert max(abs(t - k * math.pi / 3) for k, t in enumerate(times, start=1)) < 1e-9  # measured 4e-15


def test_a_run_goes_on_as_if_it_had_not_ended(scenario, pendula, tmp_path):
    file, run = scenario(DISC, DISC_START), tmp_path / "run.h5"
    whole = json.loads(pendula("simulate", file, "--json", "--set=run.duration=3.0").stdout)["final"]
    ended = pendula("simulate", file, "--quiet", "-o", run)
    assert ended.returncode == 0, ended.stderr
    ended = pendula("simulate", "--resume", run, "--json", "--set=run.duration=3.0")
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout)["final"] == whole


@pytest.mark.parametrize("by", ["compiler", "interpreter"])
def test_feedback(by, scenario, pendula):
    """What holds a skate on a slope lets it go in a circle."""
    push = '[[system.feedback]]\ninput = "push"\nvalue = "-2.5 + t - t"\nsample = 0.02\n'
    file = scenario(SKATE, "x_dot = 0.6\nphi_dot = 1.5", push)
    ended = pendula("simulate", file, "--json", "--set=run.stages=6", PENDULA_KERNELS_BY=by)
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)["final"]["q"]
    circle = 0.4 * math.sin(3.0), 0.4 * (1 - math.cos(3.0))
    assert math.dist((found["x"], found["y"]), circle) < 1e-12  # measured 3e-16


REFUSED = {
    "run.method": ("rk4", "method: expected gauss, got rk4, for a system with constraints"),
    "run.form": ("velocity", "form: expected momentum, got velocity, for a system with constraints"),
}


@pytest.mark.parametrize("key", REFUSED)
def test_what_cannot_keep_constraints(key, scenario, pendula):
    value, told = REFUSED[key]
    ended = pendula("simulate", scenario(UPRIGHT, ""), f"--set={key}={value}")
    assert ended.returncode == 2
    assert told in ended.stderr


def test_exports_do_not_know_them(scenario, pendula, tmp_path):
    file = scenario(UPRIGHT, "theta_dot = 1.0\nphi_dot = 1.0")
    ended = pendula("export", file, "--as", "c", "-o", tmp_path / "out")
    assert ended.returncode == 2
    assert "constraints of rates, got one with rolls_x, rolls_y" in ended.stderr
