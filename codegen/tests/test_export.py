"""Systems exported as C99: no warnings by any compiler, and every function and derivative as models say."""

import ctypes
import math
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from mpmath import mp, mpf

from pendula_codegen.chain import Chain
from pendula_codegen.chain_kernel import ChainKernel
from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.errors import GenerationError
from pendula_codegen.export import ExportedFunctions, Request, Values, render_export
from pendula_codegen.feedback import sampled_laws_of_chain
from pendula_codegen.links import find_link
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.written import DIGITS
from test_c_kernels import EVERYTHING, MANY, NAMES, PIECES, Truth, drawn, truth_of
from test_model_kernels import read

COMPILERS = [name for name in ("gcc", "clang", "tcc") if shutil.which(name)]
FLAGS = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wdouble-promotion", "-Werror")
# What a program without a system around it has to have: the mathematical library, and what compilers may call anyhow.
ALLOWED = re.compile(r"(sin|cos|tan|a?(sin|cos|tan)h?|sqrt|cbrt|exp|log|pow|fabs)f?|mem(set|cpy|move)")
# The entry point of the kernel's truth that an exported function is, and what that calls what it gives.
TRUTHS = {
    "mass_matrix": ("mass_matrix", {"M": "M"}),
    "momentum": ("momentum_from_velocity", {"p": "p"}),
    "rates": ("velocity_from_momentum", {"v": "v"}),
    "momentum_form": ("momentum_form", {"p": "p", "f": "f"}),
    "acceleration": ("acceleration", {"a": "a"}),
    "residual": ("residual", {"E": "E"}),
    "energy": ("energies", {"kinetic": "kinetic", "energy": "total"}),
    "points": ("positions", {"r": "r"}),
    "point_rates": ("velocities", {"r_dot": "r_dot"}),
}


def chain(space: str, links: int) -> ChainKernel:
    return ChainKernel(Chain(find_link(space), links))


def write(kernel: SystemKernel, folder: Path, **request) -> Path:
    for name, text in render_export(kernel, Request("system", **request), "").items():
        (folder / name).write_text(text, encoding="utf-8")
    return folder / "system.c"


class Loaded:
    """An exported system, compiled. Numbers go in and come out by arrays."""

    def __init__(self, kernel: SystemKernel, folder: Path):
        self.functions = ExportedFunctions(kernel)
        source, shared = write(kernel, folder), folder / "system.so"
        command = ["gcc", *FLAGS, "-O1", "-fPIC", "-shared", str(source), "-o", str(shared), "-lm"]
        subprocess.run(command, check=True)
        self._library = ctypes.CDLL(str(shared))

    def call(self, function, given: dict[str, list[float]]) -> dict[str, list[float]]:
        def numbers(values: list[float]):
            return (ctypes.c_double * max(1, len(values)))(*values)

        found = {array.name: numbers([0.0] * array.count) for array in function.gives}
        getattr(self._library, f"system_{function.name}")(
            numbers(given["parameters"]),
            ctypes.c_double(given["times"][0]),
            numbers(given["inputs"]),
            *(numbers(given[array]) for array in function.takes),
            *found.values(),
        )
        return {array.name: found[array.name][: array.count] for array in function.gives}


def true_array(truth: Truth, function: str, array: str, at: dict[str, list]) -> list:
    """What an array has that a function gives: values, or derivatives by differences of which 20 digits stay."""
    entry, called = TRUTHS[re.split("_with_jacobians|_D_", function)[0]]
    value, _, by = array.partition("_D_")
    if not by:
        return [*truth.of(entry, at)[called[value]]]
    by = "times" if by == "t" else by
    step, columns = mpf(10) ** -15, []
    for column in range(len(at[by])):
        there = [
            {**at, by: [x + sign * step * (k == column) for k, x in enumerate(at[by])]} for sign in (1, -1)
        ]
        up, down = (truth.of(entry, at)[called[value]] for at in there)
        columns.append([(x - y) / (2 * step) for x, y in zip(up, down, strict=True)])
    return [entry for row in zip(*columns, strict=True) for entry in row]


def error(loaded: Loaded, truth: Truth, seed: int, wanted: re.Pattern = re.compile("")) -> float:
    """The largest of all functions, relative to the largest number that an array has, or 1."""
    given = {array: [row[0] for row in rows] for array, rows in drawn(truth, 1, seed).items()}
    worst, count = 0.0, 0
    for function in loaded.functions.all():
        if not wanted.match(function.name):
            continue
        found = loaded.call(function, given)
        for array in function.gives:
            with mp.workdps(DIGITS):
                at = {name: [mpf(x) for x in values] for name, values in given.items()}
                true = true_array(truth, function.name, array.name, at)
            assert len(true) == array.count, (function.name, array)
            size = max(1.0, *(abs(float(x)) for x in true))
            errors = [abs(float(x - y)) / size for x, y in zip(found[array.name], true, strict=True)]
            worst, count = max(worst, *errors), count + len(errors)
    assert count >= 36
    return worst


# Chains as one would write them down, in the order in which a chain has its numbers.
CHAIN = """
from sympy import Matrix, cos, sin


def define(model, links):
    theta = [model.coordinate(f"theta_{i + 1}", "rad") for i in range(links)]
    phi = [model.coordinate(f"phi_{i + 1}", "rad") for i in range(links)] if SPATIAL else [0] * links
    m = model.parameter("masses", "kg", positive=True, per_link=True)
    length = model.parameter("lengths", "m", positive=True, per_link=True)
    damping = model.parameter("damping", "N m s", default=0.0, per_link=True)
    g = model.parameter("gravity", "m/s^2", default=9.81)
    axes = "xyz" if SPATIAL else " "
    torques = [[model.input(f"torque_{i + 1}_{x}".strip("_ "), "N m") for x in axes] for i in range(links)]
    place, energy, dissipated = Matrix([0, 0, 0]), 0, 0
    for i in range(links):
        rod = Matrix([sin(theta[i]) * cos(phi[i]), sin(theta[i]) * sin(phi[i]), -cos(theta[i])])
        place = place + length[i] * rod
        energy += m[i] * sum(model.rate(x) ** 2 for x in place if x != 0) / 2 - m[i] * g * place[2]
        dissipated += damping[i] * sum(model.rate(x) ** 2 for x in rod if x != 0) / 2
        torque = Matrix(torques[i]) if SPATIAL else Matrix([0, -torques[i][0], 0])
        for q in [theta[i], phi[i]] if SPATIAL else [theta[i]]:
            model.force(q, torque.dot(rod.cross(rod.diff(q))))
        model.point(f"bob_{i + 1}", tuple(place) if SPATIAL else (place[0], place[2]))
    model.lagrangian, model.dissipation = energy, dissipated
"""


def test_functions_and_derivatives_are_the_models(tmp_path):
    model = read("cart_chain", 2)
    assert error(Loaded(ModelKernel(model), tmp_path), truth_of(model), 1) < 1e-14  # measured 6.4e-16


def test_every_function_that_models_may_hold(own, tmp_path):
    model = own(EVERYTHING, "everything")
    assert error(Loaded(ModelKernel(model), tmp_path), truth_of(model), 2) < 1e-14  # measured 2.3e-16


def test_linear_systems_too_large_to_be_written_out(own, tmp_path):
    model = own(MANY, "many", 12)
    wanted = re.compile("(rates|acceleration)$|acceleration_D_parameters")
    assert error(Loaded(ModelKernel(model), tmp_path), truth_of(model), 3, wanted) < 1e-14  # measured 1.4e-16


@pytest.mark.parametrize(("space", "links"), [("planar", 2), ("spatial", 2)])
def test_chains_are_what_a_model_file_says(space, links, own, tmp_path):
    """Two derivations, of the paper's chain and of a Lagrangian as a user writes it."""
    model = own(f"SPATIAL = {space == 'spatial'}\n{CHAIN}", "written", links)
    assert error(Loaded(chain(space, links), tmp_path), truth_of(model), 4) < 1e-14  # measured 1.3e-15


# Derivatives by the input hold the coordinate as long as they are not written out.
CANCELS = """
def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    model.lagrangian = model.rate(x) ** 2 * (1 + y**2) / 2 + model.rate(y) ** 2 / 2
    model.force(y, model.input("push", "N"))
"""


@pytest.fixture(scope="module", params=["double", "float"])
def sources(request, own, tmp_path_factory) -> tuple[str, list[Path]]:
    """The type of numbers, and systems of all kinds in it."""
    folder = tmp_path_factory.mktemp("sources")
    kernels = [
        chain("spatial", 1),
        ModelKernel(own(EVERYTHING, "everything")),
        ModelKernel(own(MANY, "many", 11)),
        ModelKernel(own(NAMES, "double")),
        ModelKernel(own(CANCELS, "cancels")),
        ModelKernel(own(PIECES, "pieces")),
    ]
    found = []
    for k, kernel in enumerate(kernels):
        (folder / str(k)).mkdir()
        found.append(write(kernel, folder / str(k), number=request.param, stages=3))
    return request.param, found


@pytest.mark.parametrize("compiler", COMPILERS)
def test_compilers_say_nothing_and_nothing_is_needed_but_libm(compiler, sources):
    number, files = sources
    for source in files:
        made = source.with_suffix(".o")
        command = [compiler, *FLAGS, "-O1", "-ffreestanding", "-c", str(source), "-o", str(made)]
        ended = subprocess.run(command, capture_output=True, text=True)
        assert ended.returncode == 0 and ended.stderr == "", ended.stderr
        listed = subprocess.run(["nm", "-u", str(made)], capture_output=True, text=True, check=True)
        needed = {line.split()[-1] for line in listed.stdout.splitlines()}
        assert needed and not [name for name in needed if not ALLOWED.fullmatch(name)]
        if number == "float":
            assert not [name for name in needed if not name.endswith("f") and not name.startswith("mem")]


class Work(ctypes.Structure):
    """The beginning of a step's work memory."""

    _fields_ = [
        ("iterations", ctypes.c_int),
        ("correction", ctypes.c_double),
        ("more", ctypes.c_double * 1000),
    ]


def test_a_step_says_how_it_ended_and_fails_without_a_trace(tmp_path):
    source, shared = write(chain("planar", 2), tmp_path), tmp_path / "system.so"
    subprocess.run(["gcc", *FLAGS, "-O1", "-fPIC", "-shared", source, "-o", shared, "-lm"], check=True)
    library = ctypes.CDLL(str(shared))
    parameters, inputs = (ctypes.c_double * 7)(), (ctypes.c_double * 2)(0.1, 0.2)
    library.system_default_parameters(parameters)
    assert [*parameters] == [1, 1, 1, 1, 0, 0, 9.81]

    def step(start, h, iterations, tolerance):
        state, work = (ctypes.c_double * 4)(*start), Work()
        conditions = parameters, ctypes.c_double(0), ctypes.c_double(h), inputs
        status = library.system_step(
            *conditions, iterations, ctypes.c_double(tolerance), state, state, ctypes.byref(work)
        )
        return status, [*state], work

    start = [1.0, 2.0, 3.0, -4.0]
    status, there, work = step(start, 0.02, 20, 1e-14)
    assert status == 0 and there != start and work.correction < 1e-6
    needed = work.iterations
    assert step(start, 0.02, needed - 1, 1e-14)[:2] == (1, start)  # not converged
    assert step(start, 0.02, 0, 1e-14)[:2] == (1, start)
    for count in (1, needed, 9):  # of a loop that must not take longer
        status, found, work = step(start, 0.02, count, 0.0)
        assert status == 0 and work.iterations == count
        error = max(abs(x - y) for x, y in zip(found, there, strict=True))
        assert error < (1e-15 if count >= needed else 1e-7)  # measured 0, 9.4e-9
    assert step([1.0, 2.0, math.inf, 0.0], 0.02, 20, 1e-14)[:2] == (2, [1.0, 2.0, math.inf, 0.0])
    at_rest = [0.0, 0.0, 0.0, 0.0]
    inputs[0] = inputs[1] = 0.0
    assert step(at_rest, 0.02, 20, 1e-14)[:2] == (0, at_rest)
    assert step(start, 0.0, 20, 1e-14)[:2] == (0, start)
    upright = [math.pi, math.pi, 0.0, 0.0]  # where sines are rounding
    status, found, work = step(upright, 0.02, 20, 1e-14)
    assert (
        status == 0 and max(abs(x - y) for x, y in zip(found, upright, strict=True)) < 1e-15
    )  # measured 2.4e-17


def test_a_compiler_of_cpp_takes_the_header(tmp_path):
    write(chain("planar", 1), tmp_path)
    (tmp_path / "main.cpp").write_text('#include "system.h"\nint main() { return system_done; }\n')
    command = ["g++", "-Wall", "-Wextra", "-Werror", "-pedantic", "-fsyntax-only", str(tmp_path / "main.cpp")]
    subprocess.run(command, check=True)


def test_laws_of_chains_keep_the_digits_of_differences(tmp_path):
    kernel = chain("planar", 2)
    laws = sampled_laws_of_chain(kernel.chain, ["inf=torque_2=theta_1 3 - 9 ^ t theta_dot_2 * *"])
    assert [law.input for law in laws] == ["torque_2"]
    source, shared = write(kernel, tmp_path, laws=laws), tmp_path / "system.so"
    subprocess.run(["gcc", *FLAGS, "-O1", "-fPIC", "-shared", source, "-o", shared, "-lm"], check=True)
    numbers, found = ctypes.c_double * 7, ctypes.c_double(0.0)
    q, v = numbers(3.01, 1.0), numbers(0.0, 2.0)
    control = ctypes.CDLL(str(shared)).system_laws
    control(numbers(), ctypes.c_double(5.0), numbers(), q, v, ctypes.byref(found))
    # Measured 0. Multiplied out, the power is 1e-12 of rounding in place of 1e-18.
    assert math.isclose(found.value, (3.01 - 3) ** 9 * 10, rel_tol=1e-14)


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"name": "2nd"}, "name: expected a name of letters, digits and underscores, got '2nd'"),
        ({"name": "double"}, "got 'double'"),
        ({"number": "half"}, "number: expected double or float, got 'half'"),
        ({"stages": 9}, "stages: expected 1 to 8, got 9"),
        ({"values": Values(parameters=[1.0])}, "parameters: expected 4 numbers, got 1"),
        ({"values": Values(inputs=[float("nan")])}, "inputs: expected finite numbers"),
        ({"values": Values(q=[0.0], v=[0.0, 1.0])}, "state: expected 2 numbers, got 3"),
    ],
)
def test_what_is_wrong_is_told(request_, words):
    with pytest.raises(GenerationError, match=re.escape(words)):
        render_export(chain("planar", 1), Request(**{"name": "system", **request_}), "")


def test_what_cannot_be_exported_is_told(own):
    with pytest.raises(GenerationError, match="expected at most 16 coordinates, got 17"):
        render_export(chain("planar", 17), Request("too_long"), "")
    with pytest.raises(GenerationError, match="casadi: expected a smooth model"):
        render_export(ModelKernel(own(PIECES, "pieces")), Request("pieces", "casadi"), "")
