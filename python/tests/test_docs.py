"""Examples of docstrings do what they say."""

import doctest
import os
import re
import subprocess
import sys
from pathlib import Path

import pendula
import pendula._derivatives
import pendula._ensemble
import pendula._map
import pendula._models
import pendula._simulation
import pendula._solution
import pendula._systems
import pendula.jax
import pytest


@pytest.mark.parametrize(
    "module",
    [
        pendula,
        pendula._derivatives,
        pendula._ensemble,
        pendula._map,
        pendula._models,
        pendula._solution,
        pendula._simulation,
        pendula._systems,
        pendula.jax,
    ],
    ids=lambda m: m.__name__,
)
def test_examples_of_docstrings(module):
    assert doctest.testmod(module).failed == 0


@pytest.mark.parametrize("name", ["README.md", "docs/index.md", "docs/reference/ensembles.md"])
def test_the_pages_show_what_happens(name):
    page = (Path(__file__).parents[2] / name).read_text()
    [session] = re.findall(r"^```pycon\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    examples = doctest.DocTestParser().get_doctest(session, {}, name, name, 0)
    assert doctest.DocTestRunner().run(examples).failed == 0


def test_the_page_about_python_is_a_script(tmp_path):
    page = (Path(__file__).parents[2] / "docs/how-to/python.md").read_text()
    script = tmp_path / "page.py"
    script.write_text("\n".join(re.findall(r"^```python\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)))
    found = {**os.environ, "PYTHONPATH": str(Path(pendula.__file__).parents[1])}
    done = subprocess.run(
        [sys.executable, script], cwd=tmp_path, env=found, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0 and "Warning" not in done.stderr, done.stderr


def test_everything_public_is_documented():
    for name in pendula.__all__:
        assert name.startswith("__") or getattr(pendula, name).__doc__, name
