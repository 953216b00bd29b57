"""The attack itself: its references against what is known without them, and whether it finds a program that lies."""

import math
import os
import stat
import sys
from pathlib import Path

import aimed
import crossings
import drawing
import judging
import linkages
import model_equations
import numpy as np
import pytest
import truth

PULSE = """
from sympy import exp

def define(model, links):
    x = model.coordinate("x", "m")
    w = model.parameter("w", "s", default=1e-4)
    u = model.input("u", "N")
    model.lagrangian = model.rate(x) ** 2 / 2 + x * exp(-(((model.time - 0.5) / w) ** 2)) / w
    model.force(x, u)
"""


@pytest.fixture
def room(tmp_path) -> truth.Room:
    references = []
    for name in ("CHAIN_REFERENCE", "MODEL_REFERENCE", "LINKAGE_REFERENCE"):
        assert os.environ.get(name), f"{name} must name the compiled reference"
        references.append(Path(os.environ[name]))
    return truth.Room(*references, tmp_path / "truths")


@pytest.fixture(autouse=True)
def kept(room) -> None:
    room.kept.mkdir()


def test_the_same_numbers_draw_the_same_cases():
    for kind in drawing.KINDS:
        for number in (0, 7, drawing.FIRST[kind] + 5):
            assert drawing.draw(kind, 3, number) == drawing.draw(kind, 3, number)
        assert drawing.draw(kind, 3, 1).tables != drawing.draw(kind, 4, 1).tables


# --- references


@pytest.mark.parametrize("width", [1e-1, 1e-3, 1e-6])
def test_a_pulse_gives_its_impulse(room, width):
    """√π in all, whatever its width; a drive sin(3 t) adds (3 t − sin 3 t)/9 to x."""
    system = {"model": "model.py", "parameters": {"w": width}}
    system["drive"] = [{"input": "u", "amplitude": 1.0, "frequency": 3.0}]
    tables = {"system": system, "start": {"x": 0.3}, "run": {"duration": 2.0}}
    subject = truth.ModelSubject(room, tables, PULSE, [("t - 0.5", width)])
    rows = truth.rows_at(subject, [0.1, 2.0], 2.0)
    driven = 1 / 3 - math.cos(6) / 3
    assert rows.columns["x_dot"][1] - driven == pytest.approx(math.sqrt(math.pi), rel=1e-10)  # measured 5e-12
    whole = 0.3 + math.sqrt(math.pi) * 1.5 + (6 - math.sin(6)) / 9
    assert rows.columns["x"][1] == pytest.approx(whole, rel=1e-10)  # measured 4e-12
    assert rows.uncertainty.max() < 1e-10  # measured 5e-12: the time is rounded, too


def test_a_switch_late_in_a_run_is_thrown(room):
    """A push of -1, from 1.9 s on of 1: what SymPy takes out of exp((t - 1.9)/w) is e^-7600."""
    text = """
from sympy import exp

def define(model, links):
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x)**2 / 2
    model.force(x, 1 - 2 / (1 + exp(2 / 0.0005 * (model.time - 1.9))))
"""
    tables = {"system": {"model": "model.py"}, "start": {}, "run": {"duration": 4.0}}
    rows = truth.rows_at(truth.ModelSubject(room, tables, text, [("t - 1.9", 5e-4)]), [1.9, 4.0], 4.0)
    halfway = -1.9 + 5e-4 * math.log(2)
    assert rows.columns["x_dot"].astype(float) == pytest.approx([halfway, 0.2], abs=1e-14)  # measured 2e-17


def test_friction_that_sticks_is_for_the_implicit_reference(room):
    """v/√(v² + ε) with ε = 1e-12, held by 0.3 against a push of 0.1: it creeps at √ε/√8."""
    text = """
from sympy import sqrt

def define(model, links):
    x = model.coordinate("x", "m")
    v = model.rate(x)
    model.lagrangian = v**2 / 2
    model.force(x, 0.1 - 0.3 * v / sqrt(v**2 + 1e-12))
"""
    tables = {"system": {"model": "model.py"}, "start": {"x_dot": 1.0}, "run": {"duration": 20.0}}
    subject = truth.ModelSubject(room, tables, text, [("x_dot", 1e-6)])
    subject.methods = subject.methods[1:]  # the explicit one would be tried first, for seconds
    rows = truth.rows_at(subject, [20.0], 20.0)
    assert float(rows.columns["x_dot"][0]) == pytest.approx(1e-6 / math.sqrt(8), rel=1e-6)  # measured 1e-9
    assert float(rows.columns["x"][0]) == pytest.approx(2.5, abs=1e-4)  # v²/2/0.2, and what it creeps


@pytest.mark.parametrize(
    ("family", "text", "start", "parameters"),
    [
        ("strong_damping", aimed.SPRING, {"x": 1.0, "x_dot": 0.5}, {"c": 1.3}),
        ("strong_damping", aimed.SPRING, {"x": 1.0, "x_dot": 0.5}, {"c": 5.0}),
        ("late_damping", aimed.BUFFER, {"x": 0.3, "x_dot": 0.5}, {"c": 5.0}),
        ("stiff_wall", aimed.WALL, {"x": 0.3}, {"k": 100.0}),
        ("piled_switches", aimed.DETENT, {"x": 0.3}, {"a": 1.0, "c": 0.5}),
    ],
)
def test_motions_in_closed_form_are_those_of_the_models(room, family, text, start, parameters):
    tables = {
        "system": {"model": "model.py", "parameters": parameters},
        "start": start,
        "run": {"duration": 2.0},
    }
    closed, moved = (
        truth.rows_at(subject, [0.1, 1.0, 2.0], 2.0)
        for subject in (
            truth.PieceSubject(room, tables, text, family),
            truth.ModelSubject(room, tables, text, [("x", 1e-15)]),
        )
    )
    assert np.abs(closed.numbers - moved.numbers).max() < 1e-14  # measured 9e-17


def test_a_hill_is_met_from_where_its_derivatives_vanish_and_a_root_is_passed(room):
    """The hill by quadrature of 1/v. A quarter of the root's period is √(3/4) ∫ dx/√(1 − x^(3/2)), a Beta function."""
    hill = aimed.POWERS.format(unit="rad", potential="a * ((1 + cos(x)) / 2) ** 20", force="0")
    tables = {
        "system": {"model": "model.py", "parameters": {"a": 0.2}},
        "start": {"x": math.pi, "x_dot": 1.0},
        "run": {"duration": 6.0},
    }
    rows = truth.rows_at(truth.ModelSubject(room, tables, hill, [("sin(x/2)", 0.1)]), [6.0], 6.0)
    assert float(rows.columns["x"][0]) == pytest.approx(8.937268514984021, abs=1e-13)  # measured 0

    root = aimed.POWERS.format(unit="m", potential="0", force="-a * sign(x) * sqrt(Abs(x))")
    quarter = math.sqrt(3) / 3 * math.gamma(2 / 3) * math.gamma(1 / 2) / math.gamma(7 / 6)
    tables = {"system": {"model": "model.py"}, "start": {"x": 1.0}, "run": {"duration": 2 * quarter}}
    subject = truth.ModelSubject(room, tables, root, [("x", 1e-3)])
    rows = truth.rows_at(subject, [quarter, 2 * quarter], 2 * quarter)
    assert rows.columns["x"].astype(float) == pytest.approx([0, -1], abs=1e-13)  # measured 1e-15


def test_the_equations_are_those_of_the_chain(room):
    """Rigid rods of the model `rods`, their masses at their ends, against a chain: Lagrange against tensions."""
    start = {"theta_1": 1.0, "theta_2": -2.0}
    ends = {"masses": 1.5, "lengths": 0.7, "centers": 0.7, "inertias": 1e-300, "damping": 0.1}
    run = {"duration": 2.0}
    text = (drawing.BROUGHT / "rods.py").read_text()
    model = truth.ModelSubject(
        room,
        {"system": {"model": "rods", "links": 2, "parameters": ends}, "start": start, "run": run},
        text,
        [],
    )
    chain = truth.ChainSubject(
        room,
        {
            "chain": {"space": "planar", "links": 2, "masses": 1.5, "lengths": 0.7, "damping": 0.1},
            "start": {"theta": [1.0, -2.0]},
            "run": run,
        },
    )
    ours, theirs = (truth.rows_at(subject, [1.0, 2.0], 2.0).columns for subject in (model, chain))
    for name in ("theta_1", "theta_2"):
        assert np.abs(ours[name] - theirs[name]).max() < 1e-12  # measured 3e-16


def test_a_linkage_without_loops_is_the_chain(room):
    """Bars and multipliers in Cartesian coordinates against tensions along rods."""
    angles, rates, masses, lengths = (1.0, -2.0), (0.5, 0.2), (1.5, 0.7), (0.7, 1.1)
    chain = truth.ChainSubject(
        room,
        {
            "chain": {"space": "planar", "links": 2, "masses": list(masses), "lengths": list(lengths)},
            "start": {"theta": list(angles), "theta_dot": list(rates)},
            "run": {"duration": 2.0},
        },
    )
    at, speed, places, velocities = np.zeros(2), np.zeros(2), [], []
    for length, angle, rate in zip(lengths, angles, rates, strict=True):
        at = at + np.array([length * math.sin(angle), -length * math.cos(angle)])
        speed = speed + length * rate * np.array([math.cos(angle), math.sin(angle)])
        places.append(at.tolist())
        velocities.append(speed.tolist())
    bars = [(2, 0, lengths[0] ** 2), (0, 1, lengths[1] ** 2)]
    hook = linkages.fixed(0.0, 0.0)
    linkage = linkages.Linkage(2, list(masses), 0.0, 9.81, [hook], bars, [], places, velocities)
    ours, theirs = (
        truth.rows_at(subject, [1.0, 2.0], 2.0).columns
        for subject in (linkages.LinkageSubject(room, linkage), chain)
    )
    for name in ("x_1", "y_1", "x_2", "y_2"):
        assert np.abs(ours[name] - theirs[name]).max() < 1e-13, name  # measured WW


def test_a_dense_motion_is_the_motion(room):
    tables = {
        "chain": {"space": "planar", "masses": [1.0, 1.0], "lengths": 1.0},
        "start": {"theta": [2.0, 3.0]},
        "run": {"duration": 3.0},
    }
    subject = truth.ChainSubject(room, tables)
    motion, ends = truth.dense(subject, 3.0)
    times = [0.123, 1.7, 2.999]
    rows = truth.rows_at(subject, times, 3.0)
    between = subject.compared(subject.columns(motion.at(np.array(times))), rows.sizes)
    assert np.abs(between - rows.numbers).max() < 1e-14  # measured 2e-17
    assert motion.unresolved < 1e-13
    assert ends.uncertainty.max() < 1e-12


# --- crossings


EVEN = np.linspace(0, 10, 1000, dtype=truth.Real)


def found(g, direction="both", events=(), doubt=1e-9, until=10.0, grid=EVEN):
    gaps = crossings.gaps(g, lambda t: np.full(len(t), doubt), grid)
    return [fault.text for fault in crossings.compare(gaps, list(events), direction, until)]


def near_pair(t):
    """Crosses 0.5 twice, 2e-4 apart and 1e-8 deep."""
    return (t - 0.5) ** 2 - 1e-8


def test_a_pair_deeper_than_the_doubt_must_be_found():
    pair = [(0.4999, "down"), (0.5001, "up")]
    assert found(near_pair, events=pair) == []
    assert any("missed: down" in w for w in found(near_pair))
    assert any("missed: up" in w for w in found(near_pair, events=pair[:1]))
    assert found(near_pair, "up", [pair[1]]) == []
    assert any("another direction" in w for w in found(near_pair, "up", pair))


def test_a_pair_is_seen_wherever_the_grid_lies():
    """Half way between two times, each of which has another one close by."""
    twice = np.sort(np.concatenate([EVEN, EVEN + 1e-7]))
    middle = (twice[201] + twice[202]) / 2

    def g(t):
        return 1e-8 - (t - middle) ** 2

    pair = [(float(middle) - 1e-4, "up"), (float(middle) + 1e-4, "down")]
    assert found(g, events=pair, grid=twice) == []
    assert any("missed: up" in w for w in found(g, grid=twice))


def test_a_pair_less_deep_may_be_missed_but_not_halved():
    assert found(near_pair, doubt=1e-7) == []
    assert found(near_pair, events=[(0.4999, "down"), (0.5001, "up")], doubt=1e-7) == []
    assert any("half a pair" in w for w in found(near_pair, events=[(0.4999, "down")], doubt=1e-7))


def test_crossings_that_are_none_late_or_twice_are_told():
    def g(t):
        return np.sin(t)

    there = [(math.pi, "down"), (2 * math.pi, "up"), (3 * math.pi, "down")]
    assert found(g, events=there) == []
    assert found(g, events=there[:2], until=8.0) == []
    assert any("false" in w for w in found(g, events=[*there, (5.0, "up")]))
    assert any("false" in w for w in found(g, events=[(math.pi + 1e-6, "down"), *there[1:]]))
    assert any("0 up and 2 down" in w for w in found(g, events=[there[0], *there]))


def test_a_jump_is_a_crossing():
    def g(t):
        return np.fmod(t, truth.Real(4)) - 1

    jumps = [(1.0, "up"), (4.0, "down"), (5.0, "up"), (8.0, "down"), (9.0, "up")]
    assert found(g, events=jumps) == []
    assert any("missed: down" in w for w in found(g, events=jumps[:1] + jumps[2:]))


# --- verdicts


CASE = drawing.Case(
    "events",
    0,
    0,
    "here",
    {
        "chain": {"space": "planar", "masses": [1.0], "lengths": 1.0},
        "start": {"theta": [1.0]},
        "run": {"duration": 3.0, "stages": 8, "step": 0.01},  # right by far
        "output": {"times": [0.5, 1.5, 2.5]},
        "event": [{"name": "e1", "when": "theta_1 - {0}"}],
    },
    levels=[[drawing.Level("theta_1", "turn", 0.0, -1e-6)]],
)


def wrapped(program: Path, folder: Path, change: str) -> Path:
    """A program that does what pendula does, and then changes what it told: Python over `rows`, `events`, both lists of
    lines, and `summary`."""
    file = folder / "liar"
    file.write_text(
        f"""#!{sys.executable}
import json, subprocess, sys
done = subprocess.run([{str(program)!r}, *sys.argv[1:]], capture_output=True, text=True)
summary = json.loads(done.stdout)
rows, events = (open(name).read().splitlines() for name in ("rows.csv", "events.csv"))
{change}
for name, lines in (("rows.csv", rows), ("events.csv", events)):
    open(name, "w").write("\\n".join(lines) + "\\n")
print(json.dumps(summary))
"""
    )
    file.chmod(file.stat().st_mode | stat.S_IXUSR)
    return file


LIES = {
    "nothing": ("", "right"),
    "a row": ('rows[2] = rows[2].replace("-0.", "-0.0", 1)', "SILENT"),
    "an event": ("events.pop(); summary['events'][0]['count'] -= 1", "SILENT"),
    "a count": ("summary['events'][0]['count'] -= 1", "SILENT"),
    "the end": ("summary['final']['theta'][0] += 6.283185307179586", "SILENT"),
    "an energy": ("rows[1] = rows[1].rsplit(',', 1)[0] + ',1.0'", "SILENT"),
    "no number": ('rows[1] = rows[1].split(",")[0] + ",nan" * rows[1].count(",")', "SILENT"),
    "a row, and says so": (
        'rows[2] = rows[2].replace("-0.", "-0.0", 1); summary["warnings"] = ["no"]',
        "said",
    ),
    "a row, and says so of later ones": (
        'rows[2] = rows[2].replace("-0.", "-0.0", 1); summary |= {"warnings": ["no"], "trusted_until": 2.0}',
        "SILENT",
    ),
    "a doubt": ('summary["warnings"] = ["no"]', "false doubt"),
    "what no doubt is": ('summary["warnings"] = ["run.stages: has no effect"]', "right"),
}


@pytest.mark.parametrize("lie", LIES)
def test_lies_are_found(room, program, tmp_path, lie):
    change, kind = LIES[lie]
    liar = wrapped(program, tmp_path, change)
    verdict = judging.judge(CASE, room, judging.Program(liar, tmp_path / "run"))
    assert verdict.kind == kind, verdict


# Of an ensemble, as Python over `end`, an angle of each member, and `trusted`.
LIES_OF_MEMBERS = {
    "nothing": ("", "right"),
    "an end": ("end[0] += 0.1", "SILENT"),
    "an end, and says so": ("end[0] += 0.1; trusted[0] = 0", "said"),
    "an end, and says so of another member": ("end[0] += 0.1; trusted[1] = 0", "SILENT"),
    "a doubt": ("trusted[1] = 0", "false doubt"),
}


@pytest.mark.parametrize("lie", LIES_OF_MEMBERS)
def test_lies_of_members_are_found(room, program, tmp_path, lie):
    change, kind = LIES_OF_MEMBERS[lie]
    liar = tmp_path / "liar"
    liar.write_text(
        f"""#!{sys.executable}
import h5py, subprocess, sys
done = subprocess.run([{str(program)!r}, *sys.argv[1:]], capture_output=True, text=True)
with h5py.File("out.h5", "r+") as file:
    end, trusted = file["theta_1"][...].ravel(), file["trusted"][...].ravel()
    {change or "pass"}
    file["theta_1"][...] = end.reshape(file["theta_1"].shape)
    file["trusted"][...] = trusted.reshape(file["trusted"].shape)
print(done.stdout)
"""
    )
    liar.chmod(liar.stat().st_mode | stat.S_IXUSR)
    case = drawing.draw("ensembles", 1, 4)
    verdict = judging.judge(case, room, judging.Program(liar, tmp_path / "run"))
    assert verdict.kind == kind, verdict


def test_a_program_that_ends_in_a_traceback_is_told(room, tmp_path):
    broken = tmp_path / "broken"
    broken.write_text("#!/bin/sh\nexit 3\n")
    broken.chmod(0o755)
    assert judging.judge(CASE, room, judging.Program(broken, tmp_path / "run")).kind == "crash"


def test_a_model_says_its_columns():
    model = model_equations.Model(PULSE)
    assert model.names == ["x", "x_dot"]
    rows = np.array([[2.0, 3.0, 0.5]], dtype=truth.Real)
    columns = model.columns(rows, [0.1])
    assert columns["energy"][0] == pytest.approx(4.5 - 2 / 0.1)
