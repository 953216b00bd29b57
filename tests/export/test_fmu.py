"""Exported FMUs: their functions as an importer calls them; by FMPy, where it is there, validated and simulated."""

import ctypes
import json
import math
import os
import re
import shutil
import subprocess
import zipfile
from importlib.util import find_spec
from xml.etree import ElementTree

import pytest
from conftest import BUMPER

OK, ERROR = 0, 3
LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)
SCENARIO = """
[system]
model = "cart_chain"
links = 2
[[system.drive]]
input = "push"
constant = 0.5
[start]
theta = [2.0, 1.0]
[run]
duration = 2.0
tolerance = 1e-12
"""


def unpacked(pendula, place, *words):
    """The folder with an FMU of these words, unpacked, whose name is system."""
    ended = pendula("export", *words, "--as", "fmu", "--name", "system", "-o", place)
    assert (ended.returncode, ended.stdout) == (0, f"{place}/system.fmu\n"), ended.stderr
    assert ended.stderr == ""
    with zipfile.ZipFile(place / "system.fmu") as archive:
        archive.extractall(place)
    return place


def test_it_and_its_file_may_be_named(pendula, tmp_path):
    """Functions of pendula.h begin with that name, too."""
    words = "planar:1", "--as", "fmu", "--name", "pendula"
    ended = pendula("export", *words, "-o", tmp_path / "new/slide.fmu")
    assert (ended.returncode, ended.stdout) == (0, f"{tmp_path}/new/slide.fmu\n"), ended.stderr
    with zipfile.ZipFile(tmp_path / "new/slide.fmu") as archive:
        assert b'modelName="pendula"' in archive.read("modelDescription.xml")


@pytest.fixture(scope="module")
def folder(pendula, tmp_path_factory):
    """A folder with the FMU of a cart with two links, unpacked."""
    return unpacked(pendula, tmp_path_factory.mktemp("fmu"), "cart_chain", "--links", 2)


class Fmu:
    """An instance for co-simulation, or for model exchange; `said` is what it complains of."""

    def __init__(self, folder, token: str | None = None, tells_events: bool = False):
        description = ElementTree.parse(folder / "modelDescription.xml").getroot()
        [binary] = (folder / "binaries").glob("*/system.*")
        self.library = ctypes.CDLL(str(binary))
        self.said: list[str] = []
        self._log = LOG(lambda _, status, category, message: self.said.append(message.decode()))
        self.places = {
            v.get("name"): int(v.get("valueReference")) for v in description.find("ModelVariables")
        }
        self.states = [v.get("derivative") for v in description.find("ModelVariables") if v.get("derivative")]
        instantiate = self.library.fmi3InstantiateCoSimulation
        instantiate.restype = ctypes.c_void_p
        given = (token or description.get("instantiationToken")).encode()
        nothing = [None, ctypes.c_bool(False), ctypes.c_bool(False)]
        nothing += [ctypes.c_bool(tells_events)] * 2  # it has an event mode, and steps may return early
        self.instance = ctypes.c_void_p(
            instantiate(b"one", given, *nothing, None, ctypes.c_size_t(0), None, self._log, None)
        )

    def _arrays(self, names, values):
        places = (ctypes.c_uint32 * len(names))(*[self.places[name] for name in names])
        return places, ctypes.c_size_t(len(names)), values, ctypes.c_size_t(len(values))

    def set(self, **values: float) -> int:
        given = (ctypes.c_double * len(values))(*values.values())
        return self.library.fmi3SetFloat64(self.instance, *self._arrays([*values], given))

    def get(self, *names: str) -> list[float]:
        found = (ctypes.c_double * len(names))()
        assert self.library.fmi3GetFloat64(self.instance, *self._arrays(names, found)) == OK
        return [*found]

    def step(self, time: float, duration: float) -> int:
        told = [ctypes.byref(ctypes.c_bool()) for _ in range(3)]
        last = ctypes.c_double()
        arguments = ctypes.c_double(time), ctypes.c_double(duration), ctypes.c_bool(True), *told
        return self.library.fmi3DoStep(self.instance, *arguments, ctypes.byref(last))

    def step_to_event(self, time: float, duration: float) -> tuple[bool, float]:
        """Whether there was an event, and the time that was reached."""
        event, terminate, early = (ctypes.c_bool() for _ in range(3))
        last = ctypes.c_double()
        arguments = ctypes.c_double(time), ctypes.c_double(duration), ctypes.c_bool(True)
        told = map(ctypes.byref, (event, terminate, early, last))
        assert self.library.fmi3DoStep(self.instance, *arguments, *told) == OK, self.said
        assert early.value == (last.value < time + duration) and event.value >= early.value
        return event.value, last.value

    def saved(self) -> bytes:
        """The state of the FMU, serialised."""
        kept, size = ctypes.c_void_p(), ctypes.c_size_t()
        assert self.library.fmi3GetFMUState(self.instance, ctypes.byref(kept)) == OK
        assert self.library.fmi3SerializedFMUStateSize(self.instance, kept, ctypes.byref(size)) == OK
        into = (ctypes.c_uint8 * size.value)()
        assert self.library.fmi3SerializeFMUState(self.instance, kept, into, size) == OK
        assert self.library.fmi3FreeFMUState(self.instance, ctypes.byref(kept)) == OK and not kept
        return bytes(into)

    def restore(self, saved: bytes) -> None:
        kept, given = ctypes.c_void_p(), (ctypes.c_uint8 * len(saved))(*saved)
        size = ctypes.c_size_t(len(saved))
        assert self.library.fmi3DeserializeFMUState(self.instance, given, size, ctypes.byref(kept)) == OK
        assert self.library.fmi3SetFMUState(self.instance, kept) == OK
        self.library.fmi3FreeFMUState(self.instance, ctypes.byref(kept))

    def update(self) -> bool:
        """Event mode: whether the motion has to end here."""
        told = [ctypes.c_bool() for _ in range(5)]
        places = [ctypes.byref(one) for one in told]
        arguments = *places, ctypes.byref(ctypes.c_double())
        assert self.library.fmi3UpdateDiscreteStates(self.instance, *arguments) == OK
        return told[1].value

    def move_to(self, time: float, states: list[float]) -> None:
        given = (ctypes.c_double * len(states))(*states)
        assert self.library.fmi3SetTime(self.instance, ctypes.c_double(time)) == OK
        assert self.library.fmi3SetContinuousStates(self.instance, given, ctypes.c_size_t(len(states))) == OK

    def numbers(self, what: str, count: int) -> list[float]:
        """What fmi3Get... gives."""
        found = (ctypes.c_double * count)()
        assert getattr(self.library, f"fmi3Get{what}")(self.instance, found, ctypes.c_size_t(count)) == OK
        return [*found]

    def stepped(self, t: float, x: list[float], h: float) -> list[float]:
        """The states a step of an importer later, by the classical method of Runge and Kutta."""

        def field(t: float, x: list[float]) -> list[float]:
            self.move_to(t, x)
            return self.numbers("ContinuousStateDerivatives", len(x))

        k = [field(t, x)]
        for part in (h / 2, h / 2, h):
            k.append(field(t + part, [a + part * b for a, b in zip(x, k[-1], strict=True)]))
        return [a + h / 6 * (p + 2 * q + 2 * r + s) for a, p, q, r, s in zip(x, *k, strict=True)]

    def slopes(self, unknowns: list[str], known: str) -> tuple[list[float], list[float]]:
        """Derivatives by one number: as they are told, and from differences of fourth order."""
        seed, found = (ctypes.c_double * 1)(1.0), (ctypes.c_double * len(unknowns))()
        rows, row_count, _, _ = self._arrays(unknowns, found)
        columns, column_count, _, _ = self._arrays([known], seed)
        sizes = ctypes.c_size_t(1), found, ctypes.c_size_t(len(unknowns))
        derivative = self.library.fmi3GetDirectionalDerivative
        assert derivative(self.instance, rows, row_count, columns, column_count, seed, *sizes) == OK
        [here], step, slope = self.get(known), 1e-3, [0.0] * len(unknowns)
        for away, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)):
            self.set(**{known: here + away * step})
            slope = [s + weight / step * value for s, value in zip(slope, self.get(*unknowns), strict=True)]
        self.set(**{known: here})
        return [*found], slope

    def run(self, begin: float, count: int, h: float) -> None:
        for k in range(count):
            assert self.step(begin + k * h, h) == OK, self.said


STATES = ("x", "theta_1", "theta_2", "x_dot", "theta_dot_1", "theta_dot_2")


def simulated(pendula, place, text: str, *overrides: str) -> dict[str, float]:
    """Coordinates and rates where a scenario ends, by the command line."""
    (place / "scenario.toml").write_text(text)
    words = [word for override in overrides for word in ("--set", override)]
    ended = pendula("simulate", "scenario.toml", "--json", *words, cwd=place)
    assert ended.returncode == 0, ended.stderr
    final = json.loads(ended.stdout)["final"]
    rates = {re.sub(r"^([a-z]+\d*)", r"\1_dot", name): value for name, value in final["v"].items()}
    return final["q"] | rates


def distance(fmu: Fmu, theirs: dict[str, float]) -> float:
    return max(abs(x - y) for x, y in zip(fmu.get(*theirs), theirs.values(), strict=True))


@pytest.mark.parametrize("h", [1e-3, 0.5])
def test_co_simulation_takes_the_steps_of_the_command_line(h, folder, pendula, tmp_path):
    fmu = Fmu(folder)
    fmu.set(**{"pendula.tolerance": 1e-12, "theta_1": 2.0, "theta_2": 1.0, "push": 0.5})
    fmu.run(0.0, round(2.0 / h), h)
    assert distance(fmu, simulated(pendula, tmp_path, SCENARIO)) < 1e-10  # measured 3.5e-12


def test_a_scenario_says_tolerance_start_and_inputs(pendula, tmp_path):
    (tmp_path / "cart.toml").write_text(SCENARIO)
    fmu = Fmu(unpacked(pendula, tmp_path, tmp_path / "cart.toml"))
    assert fmu.get("pendula.tolerance", "theta_1", "push") == [1e-12, 2.0, 0.5]
    fmu.run(0.0, 200, 0.01)
    assert distance(fmu, simulated(pendula, tmp_path, SCENARIO)) < 1e-10  # measured 3.5e-12


def test_the_tighter_tolerance_counts(folder):
    def ends(of_importer: float | None) -> tuple[float, float]:
        fmu = Fmu(folder)
        known = of_importer is not None
        given = ctypes.c_bool(known), ctypes.c_double(of_importer if known else 0.0), ctypes.c_double(0.0)
        nothing = ctypes.c_bool(False), ctypes.c_double(0.0)
        assert fmu.library.fmi3EnterInitializationMode(fmu.instance, *given, *nothing) == OK
        fmu.set(theta_1=2.0, theta_2=1.0)
        fmu.run(0, 1, 2.0)
        return fmu.get("pendula.tolerance", "theta_2")

    own, tight, loose = ends(None), ends(1e-11), ends(1e-3)
    assert own[0] == loose[0] and own[1] == loose[1]
    assert tight[0] == 1e-11 and tight[1] != own[1]


def test_an_input_that_changes_takes_the_step_back(folder, pendula, tmp_path):
    """Against runs of the command line, each of which begins where the one before ended."""
    fmu = Fmu(folder)
    fmu.set(**{"pendula.tolerance": 1e-12, "theta_1": 2.0, "theta_2": 1.0})
    start = {"theta_1": 2.0, "theta_2": 1.0}
    for k, (push, mass) in enumerate([(0.5, 1.0), (-2.0, 1.0), (1.5, 1.25)]):
        fmu.set(push=push, masses_2=mass)
        fmu.run(0.3 * k, 30, 0.01)
        q = {name: start.get(name, 0.0) for name in STATES}
        numbers = [
            "run.duration=0.3",
            f"system.drive=[{{ input = 'push', constant = {push} }}]",
            f"system.parameters={{ masses = [1.0, {mass}] }}",
            f"start.x={q['x']!r}",
            f"start.theta=[{q['theta_1']!r}, {q['theta_2']!r}]",
            f"start.x_dot={q['x_dot']!r}",
            f"start.theta_dot=[{q['theta_dot_1']!r}, {q['theta_dot_2']!r}]",
        ]
        start = simulated(pendula, tmp_path, SCENARIO, *numbers)
        assert distance(fmu, start) < 1e-11  # measured 1.4e-13


@pytest.mark.parametrize("changes", [False, True])
def test_a_saved_state_goes_on_to_the_bit(changes, folder):
    """In another instance, too; and where an input was changed just before."""
    fmu, other = Fmu(folder), Fmu(folder)
    fmu.set(theta_1=2.0, theta_dot_2=1.0)
    fmu.run(0.0, 50, 0.01)
    if changes:
        fmu.set(push=1.0)
        fmu.run(0.5, 1, 0.01)
        fmu.set(push=2.0, masses_1=1.5)
    begin = 0.51 if changes else 0.5
    saved = fmu.saved()
    fmu.run(begin, 50, 0.01)
    there = fmu.get(*STATES)
    for one in (fmu, other):
        one.restore(saved)
        one.run(begin, 50, 0.01)
        assert one.get(*STATES) == there


def test_a_state_that_was_saved_before_the_first_step_is_one_too(folder):
    fmu = Fmu(folder)
    fmu.set(theta_1=2.0)
    saved = fmu.saved()
    fmu.run(0.0, 10, 0.01)
    there = fmu.get(*STATES)
    fmu.restore(saved)
    assert fmu.get("theta_1") == [2.0]
    fmu.run(0.0, 10, 0.01)
    assert fmu.get(*STATES) == there


LINKS = 40
LONG = f"""
[chain]
space = "planar"
masses = {[1.0 / LINKS] * LINKS}
lengths = {[1.0 / LINKS] * LINKS}
[start]
theta = {[1.0] * LINKS}
[run]
duration = 0.5
tolerance = 1e-12
"""
DRIVEN = """
[chain]
space = "spatial"
masses = [1.0, 0.5]
lengths = [1.0, 0.7]
damping = [0.1, 0.0]
torque = [[0.0, 0.1, 0.2], [0.0, 0.0, 0.3]]
[[chain.drive]]
link = 2
amplitude = [0.5, 1.0, 0.25]
frequency = 3.0
phase = 0.4
[start]
theta = [1.0, 2.0]
phi = [0.3, 0.1]
[run]
duration = 2.0
tolerance = 1e-12
"""


@pytest.mark.parametrize(
    ("text", "bound"),
    [(LONG, 1e-11), (DRIVEN, 1e-11)],  # measured 1.0e-13 and 2.2e-13
    ids=["40 links", "drives"],
)
def test_long_and_driven_chains(text, bound, pendula, tmp_path):
    """Equations of many links are not written out: there are no directional derivatives."""
    (tmp_path / "chain.toml").write_text(text)
    place = unpacked(pendula, tmp_path, tmp_path / "chain.toml")
    description = ElementTree.parse(place / "modelDescription.xml").getroot()
    written = text is DRIVEN
    for kind in ("CoSimulation", "ModelExchange"):
        assert (description.find(kind).get("providesDirectionalDerivatives") == "true") == written
    fmu = Fmu(place)
    duration = 0.5 if text is LONG else 2.0
    fmu.run(0.0, round(duration / 0.01), 0.01)
    theirs = simulated(pendula, tmp_path, text)
    assert distance(fmu, theirs) < bound
    saved = fmu.saved()
    fmu.run(duration, 5, 0.01)
    there = fmu.get(*theirs, "energy", "bob_2_x")
    fmu.restore(saved)
    fmu.run(duration, 5, 0.01)
    assert fmu.get(*theirs, "energy", "bob_2_x") == there
    moved, exchanged = Fmu(place), Fmu(place)
    moved.run(0.0, 1, duration / 10)
    t, x = 0.0, exchanged.numbers("ContinuousStates", len(theirs))
    while t < duration / 10 - 1e-9:
        t, x = t + 1e-4, exchanged.stepped(t, x, 1e-4)
    assert (
        max(abs(a - b) for a, b in zip(x, moved.get(*theirs), strict=True)) < 1e-7
    )  # measured 3.0e-9 and 1.8e-15


BUMPED = """
[system]
model = "bumper.py"
drive = [{ input = "push", constant = 1.5 }]
[start]
x_dot = 1.0
theta = 0.4
[run]
duration = 2.0
tolerance = 1e-12
"""


@pytest.fixture(scope="module")
def bumper(pendula, tmp_path_factory):
    """A folder with the FMU of a cart that rubs and runs against a bumper."""
    place = tmp_path_factory.mktemp("bumper")
    (place / "bumper.py").write_text(BUMPER)
    (place / "bumper.toml").write_text(BUMPED)
    return unpacked(pendula, place, place / "bumper.toml")


def test_steps_end_where_pieces_of_a_model_meet(bumper, pendula):
    fmu = Fmu(bumper)
    assert not [name for name in fmu.places if name.startswith(("above", "below"))]
    assert fmu.get("push", "x_dot", "theta", "stiffness") == [1.5, 1.0, 0.4, 500.0]
    begin = fmu.get("energy", "bob_x", "cart_x")
    assert begin == pytest.approx([1.0 - 9.81 * math.cos(0.4), math.sin(0.4), 0.0], abs=1e-15)
    farthest = 0.0
    for k in range(2000):
        fmu.run(0.001 * k, 1, 0.001)
        farthest = max(farthest, *fmu.get("cart_x"))
    assert farthest > 0.21  # it met the bumper
    assert distance(fmu, simulated(pendula, bumper, BUMPED)) < 1e-12  # measured 2.7e-15
    saved = fmu.saved()
    fmu.run(2.0, 100, 0.01)
    there = fmu.get("x", "theta", "x_dot", "theta_dot")
    fmu.restore(saved)
    fmu.run(2.0, 100, 0.01)
    assert fmu.get("x", "theta", "x_dot", "theta_dot") == there


def test_steps_return_early_where_pieces_change(bumper, pendula):
    fmu, t, times = Fmu(bumper, tells_events=True), 0.0, []
    while t < 2.0:
        event, t = fmu.step_to_event(t, min(0.1, 2.0 - t))
        if event:
            times.append(t)
            assert min(abs(fmu.get("x")[0] - 0.2), abs(fmu.get("x_dot")[0])) < 1e-13  # measured 5.6e-17
            assert not fmu.update()
            saved = fmu.saved()
            again = fmu.step_to_event(t, 0.01), fmu.get("x", "theta_dot")
            fmu.restore(saved)
            assert (fmu.step_to_event(t, 0.01), fmu.get("x", "theta_dot")) == again
            t = again[0][1]
    assert len(times) == 6
    assert distance(fmu, simulated(pendula, bumper, BUMPED)) < 1e-12  # measured 2.7e-15
    alone = Fmu(bumper)
    assert [alone.step_to_event(k / 10, 0.1) for k in range(20)] == [(False, k / 10 + 0.1) for k in range(20)]
    held = Fmu(bumper, tells_events=True)
    held.set(push=0.1, x_dot=0.3, theta=0.01)
    event, t = False, 0.0
    while not (event and held.update()):
        event, t = held.step_to_event(t, 1.0)
    assert abs(held.get("x_dot")[0]) < 1e-13  # measured 2.4e-16
    assert "the motion is held" in held.said[-1]


def test_a_motion_that_friction_holds_ends(bumper):
    """As the program does; in co-simulation and in model exchange."""
    stepped, exchanged = Fmu(bumper), Fmu(bumper)
    for fmu in (stepped, exchanged):
        fmu.set(push=0.1, x_dot=0.0, theta=0.0)
    assert stepped.step(0.0, 0.01) == ERROR and "the motion is held where x_dot = 0" in stepped.said[-1]
    assert exchanged.update() and "the motion is held" in exchanged.said[-1]
    exchanged.set(push=0.3)
    assert not exchanged.update()


def test_an_importer_finds_events_by_their_indicators(bumper, pendula):
    """One of model exchange: Runge-Kutta steps, which bisection ends where an indicator changes its sign."""
    fmu = Fmu(bumper)
    count = ctypes.c_size_t()
    assert fmu.library.fmi3GetNumberOfEventIndicators(fmu.instance, ctypes.byref(count)) == OK
    assert count.value == 2

    def sides(t: float, x: list[float]) -> list[bool]:
        fmu.move_to(t, x)
        found = fmu.numbers("EventIndicators", 2)
        assert 0.0 not in found
        return [one > 0 for one in found]

    assert not fmu.update()
    fmu.library.fmi3EnterContinuousTimeMode(fmu.instance)
    t, x, events = 0.0, fmu.numbers("ContinuousStates", 4), 0
    while t < 2.0:
        h = min(1e-3, 2.0 - t)
        now, end = sides(t, x), fmu.stepped(t, x, h)
        if sides(t + h, end) != now:
            low, high = 0.0, h
            while high - low > 1e-15:
                h = (low + high) / 2
                low, high = (low, h) if sides(t + h, fmu.stepped(t, x, h)) != now else (h, high)
            h, events = high, events + 1
            end = fmu.stepped(t, x, h)
            fmu.move_to(t + h, end)
            fmu.library.fmi3EnterEventMode(fmu.instance)
            assert not fmu.update()
            fmu.library.fmi3EnterContinuousTimeMode(fmu.instance)
            assert sides(t + h, end) != now
        t, x = t + h, end
    fmu.move_to(t, x)
    assert events == 6
    assert distance(fmu, simulated(pendula, bumper, BUMPED)) < 1e-8  # measured 1.1e-9


@pytest.mark.parametrize("known", ["theta", "x_dot", "push", "stiffness"])
def test_directional_derivatives_are_those_of_the_piece(known, bumper):
    fmu = Fmu(bumper)
    fmu.set(x=0.25, theta=0.7, x_dot=-0.4, theta_dot=0.8)
    unknowns = [
        "der(x)",
        "der(theta_dot)",
        "der(x_dot)",
        "bob_x",
        "energy",
        "pendula.switch_1",
        "pendula.switch_2",
    ]
    exact, slope = fmu.slopes(unknowns, known)
    assert exact == pytest.approx(slope, rel=1e-8, abs=1e-8)  # measured 4.8e-12
    if known == "stiffness":
        assert any(exact)
        fmu.set(x=0.15)  # before the bumper
        assert not any(fmu.slopes(unknowns, known)[0])


MASSES = 18
ROW = f"""
def define(model, links):
    x = [model.coordinate(f"x{{k}}", "m") for k in range({MASSES})]
    k = model.parameter("k", "N/m")
    stretch = [a - b for a, b in zip([*x, 0], [0, *x])]
    model.lagrangian = sum(model.rate(one) ** 2 for one in x) / 2 - k * sum(s**2 for s in stretch) / 2
    model.point("last", (x[-1], 0))
"""


def test_a_model_may_have_more_coordinates_than_its_equations_are_written_out_for(pendula, tmp_path):
    """Masses in a row between walls, in the slowest of their modes, which is a sine."""
    (tmp_path / "row.py").write_text(ROW)
    place = unpacked(pendula, tmp_path, tmp_path / "row.py")
    fmu = Fmu(place)
    assert math.isnan(fmu.get("k")[0])  # it has no default
    fmu.set(k=40.0)
    angle = math.pi / (MASSES + 1)
    mode = {f"x{k}": math.sin((k + 1) * angle) for k in range(MASSES)}
    fmu.set(**mode, **{"pendula.tolerance": 1e-12})
    fmu.run(0.0, 200, 0.01)
    swing = math.cos(2 * math.sqrt(40.0) * math.sin(angle / 2) * 2.0)
    assert distance(fmu, {name: swing * x for name, x in mode.items()}) < 1e-12  # measured 1.1e-15
    assert fmu.get("last_x") == fmu.get(f"x{MASSES - 1}")
    forces = fmu.numbers("ContinuousStateDerivatives", 2 * MASSES)[MASSES:]
    slowest = 4 * 40.0 * math.sin(angle / 2) ** 2
    assert forces == pytest.approx([-slowest * swing * x for x in mode.values()], abs=1e-11)


def test_with_pieces_a_large_model_is_for_co_simulation_alone(pendula, tmp_path):
    rubbing = ROW + "    model.force(x[0], -0.5 * sign(model.rate(x[0])))\n"
    (tmp_path / "row.py").write_text("from sympy import sign\n" + rubbing)
    text = """
[system]
model = "row.py"
parameters = { k = 40.0 }
[start]
x0 = 0.4
[run]
duration = 0.5
tolerance = 1e-12
"""
    (tmp_path / "row.toml").write_text(text)
    place = unpacked(pendula, tmp_path, tmp_path / "row.toml")
    description = ElementTree.parse(place / "modelDescription.xml").getroot()
    assert description.find("ModelExchange") is None
    fmu = Fmu(place)
    assert not fmu.library.fmi3InstantiateModelExchange(*[None] * 7)
    fmu.run(0.0, 50, 0.01)
    assert distance(fmu, simulated(pendula, tmp_path, text)) < 1e-12  # measured 4.4e-16


def test_what_cannot_be_exported_is_told(pendula, environment, tmp_path):
    ended = pendula("export", "planar:2", "--as", "fmu", "--stages", 4, "-o", tmp_path)
    assert ended.returncode == 2 and "--stages: expected --as c or casadi, got fmu" in ended.stderr
    program = os.environ["PENDULA_PROGRAM"]
    beside = os.path.join(os.path.dirname(program), "pendula.toolchain")
    with open(beside) as file:
        lines = file.read().splitlines()
    (tmp_path / "bin").mkdir()
    shutil.copy2(program, tmp_path / "bin/pendula")
    for library, said in (
        ("/no/libpendula.a", "got no /no/libpendula.a"),
        ("", "none with this program"),
    ):
        (tmp_path / "bin/pendula.toolchain").write_text("\n".join([*lines[:4], library, "/no"]) + "\n")
        command = [tmp_path / "bin/pendula", "export", "planar:2", "--as", "fmu", "-o", tmp_path]
        ended = subprocess.run(command, capture_output=True, text=True, env=environment)
        assert ended.returncode == 2 and "expected pendula's static library" in ended.stderr
        assert said in ended.stderr


@pytest.mark.parametrize("known", ["theta_2", "theta_dot_1", "push", "lengths_2", "cart_mass"])
def test_directional_derivatives_are_slopes(known, folder):
    fmu = Fmu(folder)
    fmu.set(theta_1=1.0, theta_2=0.3, x_dot=0.4, theta_dot_1=0.8, theta_dot_2=-0.6, push=0.7, lengths_2=0.9)
    unknowns = ["der(x)", "der(theta_dot_2)", "der(x_dot)", "bob_2_x", "energy"]
    exact, slope = fmu.slopes(unknowns, known)
    assert exact == pytest.approx(slope, rel=1e-8, abs=1e-8)  # measured 4.8e-12


def test_what_is_wrong_is_told(folder):
    fmu = Fmu(folder)
    assert fmu.set(energy=1.0) == ERROR and "cannot be set" in fmu.said[-1]
    assert fmu.set(**{"pendula.tolerance": 0.0}) == ERROR
    assert fmu.said[-1] == "pendula.tolerance: expected a number > 0"
    fmu.set(masses_1=float("nan"))
    assert math.isnan(fmu.get("masses_1")[0])
    assert fmu.step(0.0, 0.01) == ERROR and "mass matrix is singular" in fmu.said[-1]
    fmu.set(masses_1=1.0)
    assert fmu.step(0.0, 0.01) == OK
    stranger = Fmu(folder, token="{0}")
    assert not stranger.instance and "not that of this FMU" in stranger.said[-1]


def test_of_its_binary_the_functions_of_fmi_alone_are_seen(folder):
    [binary] = (folder / "binaries").glob("*/system.*")
    listed = subprocess.run(
        ["nm", "-D", "--defined-only", binary], capture_output=True, text=True, check=True
    )
    names = [line.split()[-1] for line in listed.stdout.splitlines()]
    assert len(names) > 60 and not [name for name in names if not name.startswith("fmi3")]


needs_fmpy = pytest.mark.skipif(find_spec("fmpy") is None, reason="FMPy is not installed")


@needs_fmpy
def test_fmpy_finds_nothing_wrong_where_it_is_installed(folder, bumper):
    from fmpy.validation import validate_fmu

    for place in (folder, bumper):
        assert validate_fmu(str(place / "system.fmu")) == []


@needs_fmpy
def test_fmpy_finds_events_where_it_is_installed(bumper, pendula):
    import fmpy

    file, wanted = str(bumper / "system.fmu"), simulated(pendula, bumper, BUMPED)
    by_cvode = {"fmi_type": "ModelExchange", "relative_tolerance": 1e-12}
    early = {"fmi_type": "CoSimulation", "early_return_allowed": True, "use_event_mode": True}
    for options, bound in ((by_cvode, 1e-8), (early, 1e-11)):  # measured 1.9e-10, 4.4e-12
        rows = fmpy.simulate_fmu(file, stop_time=2.0, output=[*wanted], output_interval=0.1, **options)
        assert [rows[name][-1] for name in wanted] == pytest.approx([*wanted.values()], abs=bound)
        assert len(rows) == 21 + 2 * 6


@needs_fmpy
@pytest.mark.parametrize(
    ("kind", "options", "bound"),
    [
        ("CoSimulation", {"output_interval": 1e-3}, 1e-10),  # measured 3.5e-12
        (
            "ModelExchange",
            {"output_interval": 1e-2, "relative_tolerance": 1e-10},
            1e-5,
        ),  # measured 1.2e-7, by CVODE
    ],
)
def test_fmpy_simulates_what_the_program_does_where_it_is_installed(
    kind, options, bound, folder, pendula, tmp_path
):
    import fmpy

    (tmp_path / "cart.toml").write_text(SCENARIO)
    ended = pendula("simulate", "cart.toml", "--json", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr
    final = json.loads(ended.stdout)["final"]
    start = {"theta_1": 2.0, "theta_2": 1.0, "push": 0.5, "pendula.tolerance": 1e-12}
    wanted = [*STATES, "bob_2_x", "bob_2_y"]
    rows = fmpy.simulate_fmu(
        str(folder / "system.fmu"), fmi_type=kind, start_values=start, stop_time=2.0, output=wanted, **options
    )
    theirs = [*final["q"].values(), *final["v"].values(), *final["points"]["bob_2"]]
    assert [rows[name][-1] for name in wanted] == pytest.approx(theirs, rel=bound, abs=bound)


LINKAGE = """
[system]
model = "four_bar"
[[system.drive]]
input = "torque"
constant = 0.3
[start]
theta_1 = 1.5
theta_dot_1 = 9.0
theta_2 = 1.0
theta_3 = -2.6
assemble = ["theta_2", "theta_3", "theta_dot_2", "theta_dot_3"]
[run]
duration = 2.0
tolerance = 1e-12
"""


def test_a_linkage_keeps_its_constraints_by_co_simulation_alone(pendula, tmp_path):
    (tmp_path / "linkage.toml").write_text(LINKAGE)
    place = unpacked(pendula, tmp_path, tmp_path / "linkage.toml")
    assert ElementTree.parse(place / "modelDescription.xml").getroot().find("ModelExchange") is None
    fmu = Fmu(place)
    fmu.run(0.0, 200, 0.01)
    theirs = simulated(pendula, tmp_path, LINKAGE)
    assert distance(fmu, theirs) < 1e-10  # measured 2.2e-13
    ended = pendula("simulate", tmp_path / "linkage.toml", "-o", tmp_path / "rows.csv")
    assert ended.returncode == 0
    head, *_, row = (tmp_path / "rows.csv").read_text().splitlines()
    forces = {n: float(x) for n, x in zip(head.split(","), row.split(","), strict=True) if "force" in n}
    assert [*forces] == ["force_loop_x", "force_loop_y"]
    assert fmu.get(*forces) == pytest.approx([*forces.values()], rel=1e-10)  # measured 5e-14
    # Another length of the crank: the others close around it, as they do from a start.
    fmu.set(crank=0.35)
    fmu.run(2.0, 1, 0.01)
    angles, lengths = fmu.get("theta_1", "theta_2", "theta_3"), (0.35, 1.1, 0.8)
    ends = [
        sum(length * of(angle) for length, angle in zip(lengths, angles, strict=True))
        for of in (math.sin, math.cos)
    ]
    assert ends == pytest.approx([1, 0], abs=1e-12)  # measured 4e-16


def test_a_linkage_closes_before_its_first_step_or_that_is_told(pendula, tmp_path):
    fmu = Fmu(unpacked(pendula, tmp_path, "four_bar"))
    angles = "theta_1", "theta_2", "theta_3"
    fmu.set(theta_1=1.0, theta_2=1.0, theta_3=-2.8)
    assert fmu.library.fmi3ExitInitializationMode(fmu.instance) == OK
    closed = fmu.get(*angles)
    assert closed == pytest.approx([1.0, 1.0, -2.8], abs=0.2)
    across = sum(x * math.sin(angle) for x, angle in zip((0.4, 1.1, 0.8), closed, strict=True))
    assert across == pytest.approx(1, abs=1e-14)  # measured 0
    fmu.set(ground=5.0)
    assert fmu.step(0.0, 0.01) == ERROR
    assert fmu.said and "loop_x" in fmu.said[-1]
    assert fmu.get(*angles) == closed
