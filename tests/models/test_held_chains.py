"""Chains whose last bob is held, against methods that share nothing with the chain solver, and truths."""

import json
import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

G = 9.81
MASSES, LENGTHS = (0.4, 0.3, 0.7, 0.2, 0.5), (0.5, 0.6, 0.4, 0.55, 0.45)
ENDS = {"planar": (1.6, -0.1), "spatial": (1.5, 0.35, 0.0)}
STARTS = {
    "planar": "theta = [0.3, 0.9, 1.6, 2.1, 2.4]\ntheta_dot = [0.4, 0.0, -0.3, 0.0, 0.0]",
    "spatial": "theta = [0.4, 0.9, 1.5, 2.0, 2.3]\nphi = [0.5, -0.2, 0.4, 0.1, 0.6]\nphi_dot = [0, 0.6, 0, 0, 0]",
}
MOVES = "amplitude = [0.05, 0.08]\nfrequency = [6.0, 4.0]\nphase = [0.3, 0.0]"

MODEL = """\
from sympy import cos, sin

MASSES, LENGTHS, END = {masses}, {lengths}, {end}

def define(model, links):
    theta = [model.coordinate(f"theta_{{i + 1}}", "rad") for i in range(len(MASSES))]
    g = model.parameter("gravity", "m/s^2", default=9.81)
    x, y, energy = 0, 0, 0
    for m, l, angle in zip(MASSES, LENGTHS, theta):
        x, y = x + l * sin(angle), y - l * cos(angle)
        energy += m * (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - m * g * y
    model.lagrangian = energy
    model.constraint("end_x", x - END[0], "m")
    model.constraint("end_y", y - END[1], "m")
"""


@pytest.fixture
def chain(tmp_path):
    """chain(…) -> a scenario of a chain whose last bob is held."""

    def write(space="planar", end=None, start=None, masses=MASSES, lengths=LENGTHS, held=None, **run):
        end = ENDS[space] if end is None else end
        file = tmp_path / "chain.toml"
        lines = [f'[chain]\nspace = "{space}"\nmasses = {list(masses)}\nlengths = {list(lengths)}']
        lines.append(f"[chain.end]\n{held if held else f'at = {list(end)}'}")
        lines.append(f"[start]\n{STARTS[space] if start is None else start}")
        lines.append("[run]\n" + "\n".join(f"{key} = {value}" for key, value in run.items()))
        file.write_text("\n".join(lines) + "\n")
        return file

    return write


def places(rows, k, space="planar"):
    """Bobs and their velocities in a row, (links, axes)."""
    at = {name: column[k] for name, column in rows.items()}
    r, v, place, speed = [], [], np.zeros(3), np.zeros(3)
    for i in range(1, len(MASSES) + 1):
        theta, rate, length = at[f"theta_{i}"], at[f"theta_dot_{i}"], LENGTHS[i - 1]
        phi = at.get(f"phi_{i}", 0.0)
        turning = at.get(f"phi_dot_{i}", 0.0)
        out, out_rate = math.sin(theta), math.cos(theta) * rate
        u = np.array([out * math.cos(phi), out * math.sin(phi), -math.cos(theta)])
        u_dot = np.array(
            [
                out_rate * math.cos(phi) - out * math.sin(phi) * turning,
                out_rate * math.sin(phi) + out * math.cos(phi) * turning,
                out * rate,
            ]
        )
        place, speed = place + length * u, speed + length * u_dot
        r.append(place)
        v.append(speed)
    axes = [0, 2] if space == "planar" else [0, 1, 2]
    return np.array(r)[:, axes], np.array(v)[:, axes]


def accelerated(r, v, wanted):
    """Accelerations of bobs, and the force on the last one: M a - G' lambda = f, with the constraints' second rates."""
    n, axes = r.shape
    slopes, right = np.zeros((n + axes, n * axes)), np.zeros(n + axes)
    for i in range(n):
        rod, rate = (r[i], v[i]) if i == 0 else (r[i] - r[i - 1], v[i] - v[i - 1])
        slopes[i, i * axes : (i + 1) * axes] = rod
        if i > 0:
            slopes[i, (i - 1) * axes : i * axes] = -rod
        right[i] = -rate @ rate
    slopes[n:, (n - 1) * axes :] = np.eye(axes)
    right[n:] = wanted
    inverse = np.repeat(1 / np.array(MASSES), axes)
    fall = np.zeros((n, axes))
    fall[:, -1] = -G
    forces = np.linalg.solve((slopes * inverse) @ slopes.T, right - slopes @ fall.ravel())
    return (fall.ravel() + inverse * (slopes.T @ forces)).reshape(n, axes), forces[n:]


def reference(r, v, duration, wanted):
    """Bobs, velocities and the force at the end, by an explicit method."""

    def field(t, y):
        at, speed = y.reshape(2, *r.shape)
        return np.concatenate([speed.ravel(), accelerated(at, speed, wanted(t))[0].ravel()])

    start = np.concatenate([r.ravel(), v.ravel()])
    found = solve_ivp(field, (0, duration), start, method="DOP853", rtol=1e-13, atol=1e-14)
    at, speed = found.y[:, -1].reshape(2, *r.shape)
    return at, speed, accelerated(at, speed, wanted(duration))[1]


@pytest.mark.parametrize(
    ("space", "moves"), [("planar", ""), ("spatial", ""), ("planar", MOVES)], ids=["plane", "space", "moving"]
)
def test_the_motion_is_that_of_cartesian_equations(space, moves, chain, rows):
    held = f"at = {list(ENDS[space])}\n{moves}"
    found = rows(chain(space, held=held, step=0.005, stages=5, duration=3.0))

    def wanted(t):
        if not moves:
            return np.zeros(len(ENDS[space]))
        return np.array([-0.05 * 36 * math.sin(6 * t + 0.3), -0.08 * 16 * math.sin(4 * t)])

    r, v, force = reference(*places(found, 0, space), 3.0, wanted)
    r_found, v_found = places(found, -1, space)
    assert np.abs(r - r_found).max() < 1e-12  # measured 3.6e-14
    assert np.abs(v - v_found).max() < 1e-11  # measured 2.5e-13
    of_hook = [found[f"force_end_{axis}"][-1] for axis in ("xy" if space == "planar" else "xyz")]
    assert np.abs(force - of_hook).max() < 1e-10  # measured 2.3e-12


@pytest.mark.parametrize("links", [3, 5])
def test_a_generated_model_moves_alike(links, chain, rows, tmp_path):
    """Three links between two hooks are a four-bar. The model is in angles, with constraints."""
    masses, lengths, end = MASSES[:links], LENGTHS[:links], (0.9, 0.1) if links == 3 else ENDS["planar"]
    angles = "theta = [0.2, 1.6, 2.5]" if links == 3 else STARTS["planar"].splitlines()[0]
    run = {"step": 0.005, "stages": 5, "duration": 2.0}
    found = rows(chain(end=end, start=angles, masses=masses, lengths=lengths, **run))
    (tmp_path / "model.py").write_text(MODEL.format(masses=masses, lengths=lengths, end=end))
    start = "\n".join(f"theta_{i} = {found[f'theta_{i}'][0]!r}" for i in range(1, links + 1))
    scenario = tmp_path / "model.toml"
    settings = "\n".join(f"{key} = {value}" for key, value in run.items())
    scenario.write_text(f'[system]\nmodel = "model.py"\n[start]\n{start}\n[run]\n{settings}\n')
    model = rows(scenario)
    for i in range(1, links + 1):
        assert abs(found[f"theta_{i}"][-1] - model[f"theta_{i}"][-1]) < 1e-12  # measured 3.6e-15
    for axis in "xy":
        assert (
            abs(found[f"force_end_{axis}"][-1] - model[f"force_end_{axis}"][-1]) < 1e-11
        )  # measured 2.8e-14


@pytest.mark.parametrize("space", ["planar", "spatial"])
@pytest.mark.parametrize("stages", [1, 2, 3, 4])
def test_orders_are_twice_the_number_of_stages(space, stages, chain, rows):
    def end(count, stages):
        return places(rows(chain(space, step=1 / count, stages=stages, duration=1.0)), -1, space)[0]

    truth = end(400, 6)
    counts = {1: (100, 200, 400), 2: (50, 100, 200), 3: (40, 60, 80), 4: (30, 40, 50)}[stages]
    errors = [np.abs(end(count, stages) - truth).max() for count in counts]
    order = math.log(errors[0] / errors[-1]) / math.log(counts[-1] / counts[0])
    assert abs(order - 2 * stages) < 0.3, errors  # measured 0.06


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_neither_energy_nor_the_end_drifts(space, chain, rows, simulate):
    file = chain(space, step=0.02, stages=2, duration=400.0)
    summary = simulate(file)
    assert max(summary["constraint_error"].values()) < 1e-15  # measured 2.1e-17
    assert summary["degrees_of_freedom"] == (3 if space == "planar" else 7)
    energy = rows(file)["energy"]
    first, last = (
        max(abs(h - energy[0]) for h in part)
        for part in (energy[: len(energy) // 10], energy[-len(energy) // 10 :])
    )
    assert last < 3 * first, (first, last)  # both 1e-5


def test_energy_changes_by_what_the_force_of_the_hook_does(chain, rows):
    """The work of the force in rows, by Simpson's rule."""
    held = f"at = {list(ENDS['planar'])}\n{MOVES}"
    found = rows(chain(held=held, step=0.005, stages=4, duration=3.0))
    times = np.array(found["t"])
    power = np.array(found["force_end_x"]) * 0.05 * 6 * np.cos(6 * times + 0.3)
    power += np.array(found["force_end_y"]) * 0.08 * 4 * np.cos(4 * times)
    work = 0.005 / 3 * (power[0] + 4 * power[1::2].sum() + 2 * power[2:-1:2].sum() + power[-1])
    assert abs(work) > 0.1
    assert abs(found["energy"][-1] - found["energy"][0] - work) < 1e-6  # measured 1.3e-8, of Simpson's rule


def test_steps_miss_no_work_of_the_hook(chain, pendula):
    """A step whose energy did not fit with that work would not be taken for the motion."""
    held = f"at = {list(ENDS['planar'])}\n{MOVES}"
    ended = pendula("simulate", chain(held=held, step=0.02, stages=4, duration=3.0))
    assert ended.returncode == 0, ended.stderr
    assert "rejected steps     0" in ended.stdout


def test_a_hanging_chain_is_in_equilibrium(chain, rows):
    found = rows(chain(start='shape = "hanging"', step=0.01, stages=3, duration=1.0))
    for i in range(1, 6):
        assert max(abs(a - found[f"theta_{i}"][0]) for a in found[f"theta_{i}"]) < 1e-13  # measured 4.4e-16
    force = np.array([found["force_end_x"][0], found["force_end_y"][0]])
    for i in range(5, 0, -1):  # rods lie along the tension that they bear
        force[1] -= G * MASSES[i - 1]
        u = np.array([math.sin(found[f"theta_{i}"][0]), -math.cos(found[f"theta_{i}"][0])])
        assert abs(force[0] * u[1] - force[1] * u[0]) < 1e-11 * np.linalg.norm(force)  # measured 1.3e-15
        assert force @ u > 0


@pytest.mark.parametrize("nudge", [0.0, 1e-10])
def test_a_long_chain_at_rest_takes_few_iterations(nudge, chain, simulate):
    """Weight and tension balance: what is left of their rounding must not look like a motion to be found."""
    n = 1000
    held = f"at = [1.2, 0.0]\namplitude = [0.0, {nudge}]\nfrequency = [0.0, 20.0]"
    file = chain(
        held=held,
        start='shape = "hanging"',
        masses=[1 / n] * n,
        lengths=[2 / n] * n,
        step=1e-4,
        duration=0.02,
    )
    run = simulate(file)
    assert run["rejected_steps"] == 0
    assert run["newton_iterations"] < 8 * run["steps"]  # measured 4.1; without a bound on rounding 1,200
    # Lengths are restored each 16 steps. That must not leave a gap, which a short step would have to close.
    fine = simulate(file, run__step="", run__tolerance=1e-15, run__duration=0.005)
    assert fine["steps"] > 16
    assert fine["energy_error_max"] < 1e-10  # measured 5e-12, which the hook brings


def test_a_ring_hangs_by_its_first_bob(chain, rows, simulate):
    lengths, masses = (0.5,) * 6, (0.2,) * 6
    start = f"theta = {[math.pi / 6 * (2 * i + 0.6) for i in range(6)]}"
    file = chain(held="ring = true", start=start, masses=masses, lengths=lengths, accuracy=1e-9, duration=5.0)
    run = simulate(file)
    assert run["energy_error_max"] < 1e-9  # measured 3e-16
    assert run["degrees_of_freedom"] == 4
    found = rows(file)
    assert (
        max(math.hypot(x, y) for x, y in zip(found["x_6"], found["y_6"], strict=True)) < 1e-13
    )  # measured 7e-16


@pytest.mark.parametrize("accuracy", [1e-6, 1e-9, 1e-11])
def test_rows_are_as_accurate_as_asked(accuracy, chain, rows):
    times = "[output]\ninterval = 0.5"
    fine = chain(step=0.002, stages=6, duration=5.0)
    fine.write_text(fine.read_text() + times)
    truth = rows(fine)
    asked = chain(accuracy=accuracy, duration=5.0)
    asked.write_text(asked.read_text() + times)
    found = rows(asked)
    for i in range(1, 6):
        for a, b in zip(found[f"theta_{i}"], truth[f"theta_{i}"], strict=True):
            assert abs(a - b) < accuracy


def test_events_and_dense_output(chain, pendula, tmp_path):
    """The fourth bob comes through its lowest place: its vertical velocity is zero there."""
    file = chain(accuracy=1e-10, duration=4.0)
    file.write_text(file.read_text() + '[[event]]\nname = "low"\nwhen = "x_2 - 0.62"\n')
    found = tmp_path / "events.csv"
    ended = pendula("simulate", file, "--quiet", "--events", found)
    assert ended.returncode == 0, ended.stderr
    header, *lines = found.read_text().splitlines()
    at = header.split(",").index("x_2")
    assert lines
    assert max(abs(float(line.split(",")[at]) - 0.62) for line in lines) < 1e-12  # measured 1e-16


@pytest.mark.parametrize("moves", ["", MOVES], ids=["resting", "moving"])
def test_a_resumed_run_is_the_same_to_the_bit(moves, chain, pendula, tmp_path):
    file = chain(held=f"at = {list(ENDS['planar'])}\n{moves}", step=0.01, stages=3, duration=2.0)
    whole = pendula("simulate", file, "--set=run.duration=3.0", "--set=output.every=100", "--json")
    first = pendula("simulate", file, "--set=output.every=100", "-o", tmp_path / "run.h5", "--quiet")
    assert first.returncode == 0, first.stderr
    rest = pendula("simulate", "--resume", tmp_path / "run.h5", "--set=run.duration=3.0", "--json")
    assert json.loads(rest.stdout)["final"] == json.loads(whole.stdout)["final"]


def test_steps_too_long_for_a_fixed_point_become_shorter(chain, simulate):
    """Forty links, whose fastest mode goes round in a few steps."""
    many = {"masses": (0.02,) * 40, "lengths": (0.05,) * 40, "end": (1.4, 0.3)}
    start = 'shape = "hanging"\ntheta_dot = 1.0'
    run = simulate(chain(start=start, step=0.03, stages=4, duration=1.0, **many))
    assert run["rejected_steps"] > 0
    assert run["energy_error_max"] < 1e-6  # measured 3.8e-7
    assert max(run["constraint_error"].values()) < 1e-14  # measured 1e-16


WRONG = {
    "short": ({"end": (2.6, 0.0)}, "within 2.5 of the pivot"),
    "straight": ({"end": (2.5, 0.0), "start": f"theta = {math.pi / 2}"}, "stretched straight"),
    "far": ({"end": (-1.5, 1.0)}, "angles that nearly close"),
    "one": (
        {"masses": (1.0,), "lengths": (1.0,), "end": (1.0, 0.0), "start": f"theta = {math.pi / 2}"},
        "two links",
    ),
    "long": (
        {"masses": (1.0,) * 3, "lengths": (2.0, 0.3, 0.3), "end": (0.5, 0.0), "start": "theta = 1.0"},
        "longer than all others",
    ),
    "both": ({"held": "at = [1.0, 0.0]\nring = true"}, "nothing beside ring"),
    "neither": ({"held": "ring = false"}, "chain.end.at"),
    "axes": ({"end": (1.0, 0.0, 0.0)}, "2 numbers"),
    "hangs on a line": ({"end": (0.0, -1.0), "start": 'shape = "hanging"'}, "a point beside the vertical"),
    "hangs by angles": ({"start": 'shape = "hanging"\ntheta = 1.0'}, "no angles beside"),
    "radau": ({"method": '"radau"', "step": 0.01}, "gauss"),
    "rk4": ({"method": '"rk4"', "step": 0.01}, "gauss"),
    "taylor": ({"method": '"taylor"'}, "gauss"),
    "dense": ({"solver": '"dense"', "step": 0.01}, "chain or auto"),
    "newton": ({"iteration": '"newton"', "step": 0.01}, "fixed-point"),
    "velocity": ({"form": '"velocity"', "step": 0.01}, "momentum"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_what_cannot_be_is_said(wrong, chain, pendula):
    given, said = WRONG[wrong]
    ended = pendula("simulate", chain(**{"duration": 0.1, **given}))
    assert ended.returncode == 2, ended.stdout
    assert said in ended.stderr, ended.stderr


@pytest.mark.parametrize("command", ["linearize", "lyapunov", "export"])
def test_commands_that_refuse(command, chain, pendula):
    ended = pendula(
        command, chain(duration=1.0), *(["--as", "c", "-o", "out"] if command == "export" else [])
    )
    assert ended.returncode != 0
    assert "chain.end: expected a chain that hangs free" in ended.stderr, ended.stderr


def test_steps_too_long_are_said(chain, pendula):
    ended = pendula("simulate", chain(step=0.5, duration=5.0))
    assert ended.returncode == 1 or "warning" in ended.stderr, ended.stderr


def test_a_hook_that_leaves_is_not_followed(chain, pendula):
    """It goes farther than the chain is long."""
    held = f"at = {list(ENDS['planar'])}\namplitude = [2.0, 0.0]\nfrequency = [1.0, 0.0]"
    for run in ({"step": 0.01}, {"accuracy": 1e-6}):
        ended = pendula("simulate", chain(held=held, duration=5.0, **run))
        assert ended.returncode == 1, ended.stdout
