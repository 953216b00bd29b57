"""Exported FMUs: their functions as an importer calls them; by FMPy, where it is there, validated and simulated."""

import ctypes
import json
import subprocess
import zipfile
from importlib.util import find_spec
from xml.etree import ElementTree

import pytest
from conftest import COMPILER, FLAGS, consumer, numbers

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
accuracy = 1e-12
"""


@pytest.fixture(scope="module")
def folder(pendula, tmp_path_factory):
    """A folder with the FMU of a cart with two links, unpacked."""
    place = tmp_path_factory.mktemp("fmu")
    ended = pendula(
        "export", "cart_chain", "--links", 2, "--as", "fmu", "--name", "system", "--stages", 4, "-o", place
    )
    assert (ended.returncode, ended.stdout) == (0, f"{place}/system.fmu\n"), ended.stderr
    with zipfile.ZipFile(place / "system.fmu") as archive:
        archive.extractall(place)
    return place


class Fmu:
    """An instance for co-simulation, or for model exchange; `said` is what it complains of."""

    def __init__(self, folder, token: str | None = None):
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
        nothing = [
            None,
            ctypes.c_bool(False),
            ctypes.c_bool(False),
            ctypes.c_bool(False),
            ctypes.c_bool(False),
        ]
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


STATES = ("x", "theta_1", "theta_2", "x_dot", "theta_dot_1", "theta_dot_2")


def test_steps_are_those_of_the_exported_c(folder, export, tmp_path):
    exported = export(tmp_path, "cart_chain", "--links", "2", "--stages", "4")
    fmu = Fmu(folder)
    assert fmu.set(**{"pendula.internal_step": 1.0, "masses_1": 1.0 + 1e-3}) == OK
    assert fmu.step(0.0, 0.01) == OK and fmu.step(0.01, 0.01) == OK
    ours = numbers(consumer(exported), 2, 0.01, "parameters", 0, 1e-3)
    assert fmu.get(*STATES) == pytest.approx(ours["state"], abs=1e-15)  # measured 0
    assert fmu.get("energy") == pytest.approx(ours["energy"], abs=1e-14)


def test_a_saved_state_goes_on_to_the_bit(folder):
    fmu, kept = Fmu(folder), ctypes.c_void_p()
    fmu.set(theta_1=2.0, theta_dot_2=1.0)
    fmu.step(0.0, 0.5)
    assert fmu.library.fmi3GetFMUState(fmu.instance, ctypes.byref(kept)) == OK
    fmu.step(0.5, 0.5)
    there = fmu.get(*STATES)
    assert fmu.library.fmi3SetFMUState(fmu.instance, kept) == OK
    fmu.step(0.5, 0.5)
    assert fmu.get(*STATES) == there
    assert fmu.library.fmi3FreeFMUState(fmu.instance, ctypes.byref(kept)) == OK and not kept


@pytest.mark.parametrize("known", ["theta_2", "theta_dot_1", "push", "lengths_2", "cart_mass"])
def test_directional_derivatives_are_slopes(known, folder):
    fmu = Fmu(folder)
    fmu.set(theta_1=1.0, theta_2=0.3, x_dot=0.4, theta_dot_1=0.8, theta_dot_2=-0.6, push=0.7, lengths_2=0.9)
    unknowns = ["der(x)", "der(theta_dot_2)", "der(x_dot)", "bob_2_x", "energy"]
    seed, found = (ctypes.c_double * 1)(1.0), (ctypes.c_double * len(unknowns))()
    rows, row_count, _, _ = fmu._arrays(unknowns, found)
    columns, column_count, _, _ = fmu._arrays([known], seed)
    sizes = ctypes.c_size_t(1), found, ctypes.c_size_t(len(unknowns))
    derivative = fmu.library.fmi3GetDirectionalDerivative
    assert derivative(fmu.instance, rows, row_count, columns, column_count, seed, *sizes) == OK
    [here], step, slope = fmu.get(known), 1e-3, [0.0] * len(unknowns)
    for away, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)):
        fmu.set(**{known: here + away * step})
        slope = [s + weight / step * value for s, value in zip(slope, fmu.get(*unknowns), strict=True)]
    assert [*found] == pytest.approx(slope, rel=1e-8, abs=1e-8)


def test_what_is_wrong_is_told(folder):
    fmu = Fmu(folder)
    assert fmu.set(energy=1.0) == ERROR and "cannot be set" in fmu.said[-1]
    assert fmu.set(**{"pendula.internal_step": 0.0}) == ERROR and "expected a number > 0" in fmu.said[-1]
    fmu.set(masses_1=float("nan"))
    assert fmu.step(0.0, 0.01) == ERROR and "could not be solved" in fmu.said[-1]
    stranger = Fmu(folder, token="{0}")
    assert not stranger.instance and "not that of this FMU" in stranger.said[-1]


def test_its_sources_compile_without_a_warning(folder):
    sources = sorted((folder / "sources").glob("*.c"))
    assert [source.name for source in sources] == ["system.c", "system_fmu.c"]
    command = [COMPILER, *FLAGS, "-O1", "-fPIC", "-shared", *sources, "-o", folder / "again.so", "-lm"]
    subprocess.run(command, check=True)


needs_fmpy = pytest.mark.skipif(find_spec("fmpy") is None, reason="FMPy is not installed")


@needs_fmpy
def test_fmpy_finds_nothing_wrong_where_it_is_installed(folder):
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(folder / "system.fmu")) == []


@needs_fmpy
@pytest.mark.parametrize(
    ("kind", "options", "bound"),
    [
        ("CoSimulation", {"output_interval": 1e-3}, 1e-10),  # measured 4.6e-12
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
    start = {"theta_1": 2.0, "theta_2": 1.0, "push": 0.5}
    wanted = [*STATES, "bob_2_x", "bob_2_y"]
    rows = fmpy.simulate_fmu(
        str(folder / "system.fmu"), fmi_type=kind, start_values=start, stop_time=2.0, output=wanted, **options
    )
    theirs = [*final["q"].values(), *final["v"].values(), *final["points"]["bob_2"]]
    assert [rows[name][-1] for name in wanted] == pytest.approx(theirs, rel=bound, abs=bound)
