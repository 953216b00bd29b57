"""A program that is installed: it finds a Python of its own, or names the command that makes one."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import DOUBLE, Result, program

ROOT = Path(__file__).parents[2]


@pytest.fixture
def installed(tmp_path):
    """Calls bin/pendula of a prefix that has what an install has, where `python3` has no packages."""
    prefix = tmp_path / "prefix"
    shared = prefix / "share/pendula"
    for folder in (prefix / "bin", tmp_path / "path", shared):
        folder.mkdir(parents=True)
    shutil.copy(program(), prefix / "bin/pendula")
    shutil.copy(ROOT / "cmake/installed_setup", shared / "setup")
    for package in ("codegen", "plotting"):
        shutil.copytree(ROOT / package, shared / package, ignore=shutil.ignore_patterns("tests", "*cache*"))
    script(tmp_path / "path/python3", f'exec {sys.executable} -S "$@"')
    variables = {name: value for name, value in os.environ.items() if name != "PENDULA_PYTHON"}

    def call(*arguments: str) -> Result:
        done = subprocess.run(
            [prefix / "bin/pendula", *arguments],
            cwd=tmp_path,
            env=variables | {"PATH": f"{tmp_path / 'path'}:{os.environ['PATH']}"},
            capture_output=True,
            text=True,
            check=False,
        )
        return Result(done.returncode, done.stdout, done.stderr)

    (tmp_path / "double.toml").write_text(DOUBLE)
    assert call("simulate", "double.toml", "-o", "run.h5").status == 0
    return call


def script(file: Path, line: str) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"#!/bin/sh\n{line}\n")
    file.chmod(0o755)


COMMANDS = [("plot", "run.h5", "-o", "run.svg"), ("describe", "furuta"), ("models",)]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_without_packages_it_names_the_command_that_installs_them(installed, tmp_path, command):
    run = installed(*command)
    assert (run.status, run.out) == (2, "")
    assert f", which {tmp_path}/prefix/share/pendula/setup installs; " in run.err
    assert len(run.err.splitlines()) == 1


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_it_runs_the_python_that_this_command_makes(installed, tmp_path, command):
    script(tmp_path / "prefix/share/pendula/venv/bin/python", f'exec {sys.executable} "$@"')
    run = installed(*command)
    assert (run.status, run.err) == (0, "")


def test_the_command_is_a_script(tmp_path):
    setup = ROOT / "cmake/installed_setup"
    assert os.access(setup, os.X_OK)
    subprocess.run(["bash", "-n", setup], check=True)
