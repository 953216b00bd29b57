"""The campaign itself: it tells a right program from one that lies, and says what it drew."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import random_chains
import reference

SCRIPT = Path(random_chains.__file__)


@pytest.fixture
def campaign(compiled, tmp_path):
    def run(program: Path, count: int = 4) -> subprocess.CompletedProcess:
        words = [
            "--count",
            count,
            "--program",
            program,
            "--reference",
            compiled.program,
            "--folder",
            tmp_path,
        ]
        command = [sys.executable, "-B", SCRIPT, *map(str, words)]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    return run


def counted(out: str, options: str) -> list[int]:
    """Runs of each class, as the table has them."""
    (line,) = [line for line in out.splitlines() if line.startswith(options)]
    return [int(word) for word in line.removeprefix(options).replace("%", "").split()[::2]]


def pretender(file: Path, answer: str) -> Path:
    """A program that always answers the same."""
    file.write_text(f"#!/bin/sh\n{answer}\n")
    file.chmod(0o755)
    return file


def standing(warnings: list[str]) -> str:
    """Shell that prints a summary in which every bob of the scenario is still at the pivot."""
    code = (
        "import json, sys, tomllib; c = tomllib.load(open(sys.argv[1], 'rb'))['chain'];"
        "rest = [[0.0] * (3 if c['space'] == 'spatial' else 2)] * c['links'];"
        f"print(json.dumps({{'warnings': {warnings}, 'final': {{'bobs': rest, 'velocities': rest}}}}))"
    )
    return f'{sys.executable} -c "{code}" "$2"'


def test_a_program_that_lies_is_found(campaign, tmp_path):
    run = campaign(pretender(tmp_path / "liar", standing([])))
    assert run.returncode == 1, run.stderr
    for options in random_chains.OPTIONS:
        assert counted(run.stdout, options)[:4] == [0, 0, 0, 0]
        assert counted(run.stdout, options)[4] > 0
    assert any((tmp_path / "silent").iterdir())


def test_a_program_that_warns_is_not_silent(campaign, tmp_path):
    run = campaign(pretender(tmp_path / "warner", standing(["too coarse"])))
    assert run.returncode == 0, run.stderr
    assert all(counted(run.stdout, options)[2] > 0 for options in random_chains.OPTIONS)


def test_a_program_that_refuses_is_not_silent(campaign, tmp_path):
    run = campaign(pretender(tmp_path / "refuser", "echo no >&2; exit 1"))
    assert run.returncode == 0, run.stderr
    assert all(counted(run.stdout, options)[3] > 0 for options in random_chains.OPTIONS)


@pytest.mark.parametrize(
    "end", ["kill -SEGV $$", standing([]).replace("[0.0]", "[None]")], ids=["crash", "null"]
)
def test_a_program_that_gives_no_number_is_found(campaign, tmp_path, end):
    run = campaign(pretender(tmp_path / "broken", end), count=1)
    assert run.returncode == 1, run.stderr
    assert all(counted(run.stdout, options) == [0, 0, 0, 0, 1] for options in random_chains.OPTIONS)


def test_a_program_that_is_not_there_is_told(campaign, tmp_path):
    run = campaign(tmp_path / "nowhere")
    assert run.returncode == 2
    assert "nowhere is no program" in run.stderr


def test_the_same_seed_draws_the_same_chains():
    assert random_chains.draw(3, 5).scenario == random_chains.draw(3, 5).scenario
    assert random_chains.draw(3, 5).scenario != random_chains.draw(4, 5).scenario


def test_the_program_reads_what_the_campaign_draws(program, tmp_path):
    """Every kind of chain, moved no time at all: the start is where the reference has it."""
    for number in range(40):
        case = random_chains.draw(2, number)
        case.scenario["run"] = {"duration": 0.0}
        file = tmp_path / "start.toml"
        file.write_text(random_chains.toml(case.scenario))
        run = subprocess.run(
            [program, "simulate", file, "--json"], capture_output=True, text=True, check=False, env=os.environ
        )
        assert run.returncode == 0, run.stderr
        final = json.loads(run.stdout)["final"]
        start = reference.read(case.scenario).start
        assert final["theta"] == [row[0] for row in start]
