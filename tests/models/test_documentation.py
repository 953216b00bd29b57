"""docs/reference/model-file.md from its first block to its last."""

import json
import re
import subprocess

import pytest
from conftest import ROOT

PAGE = (ROOT / "docs/reference/model-file.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def folder(tmp_path):
    sprung, lame, rope, load, bars, disc = blocks("python")
    (tmp_path / "sprung.py").write_text(sprung)
    (tmp_path / "lame.py").write_text(lame)
    (tmp_path / "rope.py").write_text(rope)
    (tmp_path / "load.py").write_text(load)
    (tmp_path / "bars.py").write_text(bars)
    (tmp_path / "disc.py").write_text(disc)
    (tmp_path / "sprung.toml").write_text(blocks("toml")[0])
    return tmp_path


def test_the_commands_do_what_the_page_says(folder, pendula):
    commands = re.findall(r"```\n\$ pendula (.*?)\n(.*?)```", PAGE, re.DOTALL)
    assert len(commands) == 4
    for command, output in commands:
        ended = pendula(*command.split(), cwd=folder)
        assert ended.returncode == (2 if "lame" in command else 0), ended.stderr
        assert ended.stdout.endswith(output) or ended.stderr.endswith(output)
    assert pendula("check", "start.py", cwd=folder).returncode == 0


def test_a_rope_that_is_pulled(folder, pendula):
    (folder / "rope.toml").write_text(
        f'[system]\nmodel = "rope.py"\n{blocks("toml")[1]}\n[start]\ntheta = 0.5\n[run]\nduration = 4.0\n'
    )
    ended = pendula("simulate", "rope.toml", "--json", cwd=folder)
    assert ended.returncode == 0, ended.stderr
    x, y = json.loads(ended.stdout)["final"]["points"]["bob"]
    assert abs(x**2 + y**2 - 0.8**2) < 1e-12  # measured 1.1e-16


def test_a_model_of_several_pieces(folder, pendula):
    told = json.loads(pendula("describe", "load.py", "--json", cwd=folder).stdout)
    assert [switch["value"] for switch in told["switches"]] == ["y", "2*y - 1", "y_dot"]
    (folder / "load.toml").write_text(
        '[system]\nmodel = "load.py"\n[start]\ny = 2.0\n[run]\nduration = 5.0\n'
    )
    ended = pendula("simulate", "load.toml", "--json", cwd=folder)
    assert ended.returncode == 0, ended.stderr
    assert json.loads(ended.stdout)["energy_error_max"] < 1


def test_a_linkage(folder, pendula):
    start = 'theta_1 = 1.1\nassemble = ["theta_2", "theta_3"]\ntheta_2 = 1.9\ntheta_3 = 2.9\n'
    (folder / "bars.toml").write_text(f'[system]\nmodel = "bars.py"\n[start]\n{start}[run]\nduration = 2.0\n')
    ended = pendula("simulate", "bars.toml", "--json", cwd=folder)
    assert ended.returncode == 0, ended.stderr
    run = json.loads(ended.stdout)
    assert run["degrees_of_freedom"] == 1
    assert max(run["constraint_error"].values()) < 1e-13  # measured 3.2e-14


def test_a_disc_that_rolls(folder, pendula):
    (folder / "disc.toml").write_text(
        '[system]\nmodel = "disc.py"\n[start]\nphi_dot = 0.5\ntheta_dot = 2.0\n[run]\nduration = 5.0\n'
    )
    ended = pendula("simulate", "disc.toml", "--json", cwd=folder)
    assert ended.returncode == 0, ended.stderr
    run = json.loads(ended.stdout)
    x, y = run["final"]["q"]["x"], run["final"]["q"]["y"]
    assert abs(x**2 + (y - 2.0) ** 2 - 4.0) < 1e-8  # a circle, its radius 0.5 * 2.0 / 0.5
    assert run["degrees_of_freedom"] == 2


def test_the_program_compiles_and_ends_where_the_scenario_does(folder, pendula, environment):
    """Against an undriven run of the scenario."""
    program = blocks("cpp")[0]
    source = folder / "main.cpp"
    source.write_text(program)
    kept = environment.get("PENDULA_CONSUMER_FLAGS")
    if kept is None:
        pytest.fail("PENDULA_CONSUMER_FLAGS: expected the flags that compile and link a program with pendula")
    generator = environment["PENDULA_PYTHON"]
    made = [generator, "-m", "pendula_codegen", "model", "--model", "sprung.py", "--links", "2"]
    header = folder / "pendula" / "kernels" / "sprung_2.hpp"
    subprocess.run(
        [*made, "--alias", "Sprung2", "--output", header],
        cwd=folder,
        check=True,
        env={**environment, "PYTHONPATH": str(ROOT / "codegen")},
    )
    compiler, *flags = kept.split()
    subprocess.run(
        [compiler, "-std=c++20", "-O1", f"-I{folder}", source, *flags, "-o", folder / "sway"], check=True
    )
    ran = subprocess.run([folder / "sway"], capture_output=True, text=True, check=True)
    ours = [float(x) for x in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", ran.stdout)]
    overrides = ["--set=system.drive=[]", "--set=start.theta=[0.35, 0.0]", "--set=run.duration=10.0"]
    ended = pendula("simulate", "sprung.toml", "--json", *overrides, cwd=folder)
    theirs = [float(x) for x in re.findall(r'"theta_\d":(-?[\d.e-]+)', ended.stdout)[:2]]
    assert ours == pytest.approx(theirs, abs=1e-5)  # six digits are printed
