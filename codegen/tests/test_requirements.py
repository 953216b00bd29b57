"""cmake/check_requirements.py: which Pythons will do, and what is said of those that will not."""

import re
import subprocess
import sys
import tomllib

import jinja2
import pytest
import sympy

from conftest import REPOSITORY

CHECK = REPOSITORY / "cmake/check_requirements.py"


def check(file) -> tuple[int, str]:
    """Exit status and what was said, of this Python held against a file of requirements."""
    done = subprocess.run(
        [sys.executable, str(CHECK), str(file)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    return done.returncode, done.stdout


@pytest.mark.parametrize("file", ["codegen/requirements.txt", "codegen/requirements-dev.txt"])
def test_this_python_will_do(file):
    assert check(REPOSITORY / file) == (0, "")


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("jinja2>=3.1", ""),
        ("jinja2 >= 3.1.0  # newer ones too", ""),
        (f"jinja2>={jinja2.__version__}", ""),
        (f"jinja2=={jinja2.__version__}", ""),
        (f"jinja2>={jinja2.__version__}.1", "jinja2 is {jinja2}, not {jinja2}.1 or newer"),
        ("jinja2>=10", "jinja2 is {jinja2}, not 10 or newer"),
        ("sympy==1.9", "sympy is {sympy}, not 1.9"),
        ("no-such-package>=2", "no-such-package 2 or newer is missing"),
        ("no-such-package==2", "no-such-package 2 is missing"),
        ("sympy==1.9\njinja2>=10", "sympy is {sympy}, not 1.9, jinja2 is {jinja2}, not 10 or newer"),
    ],
)
def test_complaints_name_what_is_there_and_what_is_needed(line, complaint, tmp_path):
    (tmp_path / "needed.txt").write_text(f"# needed\n{line}\n")
    (tmp_path / "all.txt").write_text("-r needed.txt\n")
    complaint = complaint.format(jinja2=jinja2.__version__, sympy=sympy.__version__)
    assert check(tmp_path / "all.txt") == (1 if complaint else 0, complaint)


@pytest.mark.parametrize("line", ["jinja2", "jinja2~=3.1", "jinja2>=3.1,<4", "--index-url x", "jinja2=="])
def test_a_line_that_is_not_understood_is_said(line, tmp_path):
    file = tmp_path / "needed.txt"
    file.write_text(f"sympy==1.14.0\n{line}\n")
    expected = f'{file}:2: expected "name==version" or "name>=version", got "{line}"\n'
    assert check(file) == (2, expected)


def lines(file: str) -> set[str]:
    """The requirements of a file, without its comments and inclusions."""
    return set(re.findall(r"^[\w-]+[=>]=\S+$", (REPOSITORY / file).read_text(), re.MULTILINE))


def test_the_package_asks_for_what_the_generator_needs():
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
    asked = set(project["dependencies"])
    assert lines("codegen/requirements.txt") <= asked
    assert not [one for one in asked if "==" in one]  # of whatever environment it enters


@pytest.mark.parametrize(
    "file",
    [
        "codegen/requirements.txt",
        "codegen/requirements-dev.txt",
        "bench/requirements.txt",
        "docs/requirements.txt",
    ],
)
def test_setup_installs_known_versions_of_all_that_is_needed(file):
    installed, needed = lines("scripts/constraints.txt"), lines(file)
    assert needed
    assert {line for line in needed if "==" in line} <= installed
    names = {line.partition("==")[0] for line in installed}
    assert {line.partition(">=")[0] for line in needed if ">=" in line} <= names
