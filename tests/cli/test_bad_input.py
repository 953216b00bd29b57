"""Wrong input: exit status 2, one message that names the place, and nothing computed or written.

Every kind is tested on the parser itself (scenario_test.cpp); here they are as users meet them.
"""

import os
import subprocess
import sys

import pytest
from conftest import settings

# What the file says, what it says instead, where that is wrong, what is expected there, and what is got.
INPUTS = [
    (
        "masses  = [1.0, 1.0]",
        "mases = [1.0, 1.0]",
        "3: chain.mases",
        "one of space, links, masses, lengths, gravity, damping, torque, units, end, drive, feedback, signal",
        'the unknown key "mases" (did you mean masses?)',
    ),
    ("masses  = [1.0, 1.0]", "", "1: chain.masses", "the masses of the bobs", "no such key"),
    ("[1.0, 1.0]", "[1.0, 0.0]", "3: chain.masses[2]", "a finite number > 0", "0.0"),
    ("[1.0, 1.0]", "[1.0, nan]", "3: chain.masses[2]", "a finite number > 0", "nan"),
    (
        "lengths = 1.0",
        "lengths = [1.0, 1.0, 1.0]",
        "4: chain.lengths",
        "a finite number > 0 for all links, or an array of 2 (the links that chain.masses tells)",
        "[1.0, 1.0, 1.0]",
    ),
    ("lengths = 1.0", "lengths = -1", "4: chain.lengths", "a finite number > 0", "-1"),
    (
        "gravity = 9.81",
        'gravity = "strong"',
        "5: chain.gravity",
        "a finite number or a string in m/s^2 (an acceleration)",
        '"strong"',
    ),
    ("gravity = 9.81", "gravity = inf", "5: chain.gravity", "a finite number", "inf"),
    ("gravity = 9.81", "damping = -1.0", "5: chain.damping", "a finite number >= 0", "-1.0"),
    ('"planar"', '"plane"', "2: chain.space", '"planar" or "spatial"', '"plane" (did you mean planar?)'),
    ("gravity = 9.81", "links = 10000000", "5: chain.links", "an integer from 1 to 1000000", "10000000"),
    ("theta =", "phi = 1\ntheta =", "8: start.phi", "no such key in a planar scenario", "1"),
    ("step     = 5e-3", "step = 0.0", "11: run.step", "a finite number > 0", "0.0"),
    ("step     = 5e-3", "stages = 9", "11: run.stages", "an integer from 1 to 8", "9"),
    ("step     = 5e-3", "stages = 2.0", "11: run.stages", "an integer from 1 to 8", "2.0"),
    ("duration = 1.0", "duration = -1.0", "12: run.duration", "a finite number >= 0", "-1.0"),
    (
        "duration = 1.0",
        "[output]\nevery = 0",
        "13: output.every",
        "an integer from 1 to 9223372036854775807",
        "0",
    ),
    (
        "duration = 1.0",
        "[[chain.drive]]\nlink = 3\namplitude = 1\nfrequency = 1",
        "13: chain.drive[1].link",
        "an integer from 1 to 2",
        "3",
    ),
]


@pytest.mark.parametrize(("there", "instead", "place", "expected", "got"), INPUTS)
def test_wrong_values_are_told(pendula, double, tmp_path, there, instead, place, expected, got):
    text = double.read_text()
    assert there in text
    double.write_text(text.replace(there, instead))
    run = pendula("simulate", "double.toml", "-o", "out.csv", "--json")
    assert run.err == f"pendula: double.toml:{place}: expected {expected}, got {got}\n"
    assert (run.status, run.out) == (2, "")
    assert not (tmp_path / "out.csv").exists()


def test_text_that_is_no_toml_is_told_with_its_line(pendula, double):
    double.write_text(double.read_text().replace("gravity = 9.81", "gravity 9.81"))
    run = pendula("simulate", "double.toml")
    assert run.status == 2
    assert run.err.startswith("pendula: double.toml:5: expected valid TOML, got: ")


@pytest.mark.parametrize(
    ("override", "expected", "got"),
    [
        ("run.step=-1", "run.step: expected a finite number > 0", "-1"),
        (
            "run.stpe=1",
            "run.stpe: expected one of method, stages, form, solver, iteration, step, tolerance, accuracy, "
            "duration, estimate",
            'the unknown key "stpe" (did you mean step?)',
        ),
        (
            "run.method=euler",
            'run.method: expected "gauss" or "radau" or "rk4" or "dopri5" or "fehlberg78" or "taylor" or "auto"',
            '"euler"',
        ),
        (
            "step=1",
            "step: expected one of chain, system, start, run, output, event, ensemble",
            'the unknown key "step" (did you mean run.step?)',
        ),
        ("run.step", "expected KEY=VALUE such as run.step=1e-4", '"run.step"'),
        ("run.step=[1", "expected a TOML value after '='", '"[1"'),
    ],
)
def test_wrong_overrides_are_told(pendula, double, override, expected, got):
    run = pendula("simulate", double, "--set", override)
    assert run.err == f"pendula: --set {override}: {expected}, got {got}\n"
    assert (run.status, run.out) == (2, "")


def test_a_file_that_is_not_there(pendula):
    run = pendula("simulate", "nothing.toml")
    assert run.status == 2
    assert run.err == (
        "pendula: nothing.toml: expected a scenario file that can be read, got: No such file or directory\n"
    )


def test_a_folder_is_no_scenario(pendula, tmp_path):
    run = pendula("simulate", tmp_path)
    assert run.status == 2
    assert run.err.endswith("expected a scenario file that can be read, got: a folder\n")


@pytest.mark.skipif(sys.platform != "linux", reason="needs a device that never ends")
def test_a_scenario_without_end_is_refused(pendula):
    run = pendula("simulate", "/dev/zero")
    assert run.status == 2
    reason = "expected a scenario file that can be read, got: more than 256 MiB"
    assert run.err == f"pendula: /dev/zero: {reason}\n"


def test_a_scenario_that_is_too_long_is_not_read(pendula, tmp_path):
    (tmp_path / "long.toml").touch()
    os.truncate(tmp_path / "long.toml", 10**10)
    run = pendula("simulate", "long.toml")
    reason = "expected a scenario file that can be read, got: more than 256 MiB"
    assert (run.status, run.err) == (2, f"pendula: long.toml: {reason}\n")


def test_a_scenario_may_be_a_pipe_that_somebody_writes_to(pendula, double, tmp_path):
    os.mkfifo(tmp_path / "pipe.toml")
    run = pendula("simulate", "pipe.toml")
    reason = "expected a scenario file that can be read, got: a pipe that nobody writes to"
    assert (run.status, run.err) == (2, f"pendula: pipe.toml: {reason}\n")
    with subprocess.Popen(["sh", "-c", "sleep 0.3; exec cat double.toml > pipe.toml"], cwd=tmp_path):
        assert pendula("simulate", "pipe.toml").status == 0


def test_an_output_that_cannot_be_opened(pendula, double):
    run = pendula("simulate", double, "-o", "no/such/folder/out.csv")
    assert (run.status, run.out) == (2, "")
    reason = "expected a file that can be written, got: no/such/folder/ does not exist"
    assert run.err == f"pendula: no/such/folder/out.csv: {reason}\n"
    run = pendula("simulate", double, "-o", "out/run.csv")
    assert run.err == "pendula: out/run.csv: expected a file that can be written, got: out/ does not exist\n"
    run = pendula("simulate", double, "-o", ".")
    assert run.err == "pendula: .: expected a file that can be written, got: Is a directory\n"


def test_the_scenario_is_not_overwritten(pendula, double):
    text = double.read_text()
    run = pendula("simulate", double, "-o", "double.toml")
    assert run.status == 2
    assert run.err == "pendula: double.toml: expected a file for the trajectory, got the scenario itself\n"
    assert double.read_text() == text


def test_a_chain_without_a_kernel_names_what_to_configure(pendula, double, tmp_path):
    given = settings("chain.masses=1", "chain.links=97", "run.solver=dense")
    run = pendula("simulate", "double.toml", "-o", "out.csv", *given)
    assert run.status == 2
    reason = "no kernel for a planar chain of 97 links"
    assert run.err.startswith(f"pendula: --set chain.links=97: chain.links: {reason}")
    assert '-DPENDULA_KERNELS="planar:97"' in run.err
    assert not (tmp_path / "out.csv").exists()


def test_an_option_that_the_runtime_turns_away_is_told_at_its_place(pendula, double):
    run = pendula("simulate", double, *settings("run.form=velocity", "run.iteration=fixed-point"))
    assert run.status == 2
    assert run.err.startswith("pendula: --set run.iteration=fixed-point: run.iteration: ")


@pytest.mark.parametrize(
    ("arguments", "command", "message"),
    [
        (
            [],
            "",
            "expected a command: simulate, ensemble, lyapunov, linearize, plot, map, gallery, lab, models, describe, "
            "new-model, check, build, kernels, export, help, completion",
        ),
        (["simlate"], "", "unknown command simlate (did you mean simulate?)"),
        (["--versoin"], "", "unknown option --versoin (did you mean --version?)"),
        (["simulate"], " simulate", "SCENARIO is required"),
        (["simulate", ""], " simulate", "SCENARIO: expected the name of a file, got an empty text"),
        (["simulate", "a.toml", "--jsno"], " simulate", "unknown option --jsno (did you mean --json?)"),
        (["simulate", "a", "--otput=b"], " simulate", "unknown option --otput=b (did you mean --output?)"),
        (["simulate", "a.toml", "b.toml"], " simulate", "unknown argument b.toml"),
        (["check", "--space", "flat"], " check", "--space: flat not in {planar,spatial}"),
        *(
            (
                ["check", "--links", links],
                " check",
                f"--links: expected a whole number of links, 1 or more, got {links}",
            )
            for links in ("-1", "0", "1.5", "two", "99999999999")
        ),
        (["kernels", "--all"], " kernels", "unknown option --all"),
    ],
)
def test_wrong_command_lines_are_told(pendula, arguments, command, message):
    run = pendula(*arguments)
    assert run.err == f"pendula{command}: {message}\nTry 'pendula{command} --help'.\n"
    assert (run.status, run.out) == (2, "")
