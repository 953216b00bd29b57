"""Examples of docstrings do what they say."""

import doctest
import re
from pathlib import Path

import pendula
import pendula._ensemble
import pendula._runs
import pendula._simulation
import pendula._systems
import pytest


@pytest.mark.parametrize(
    "module",
    [pendula, pendula._ensemble, pendula._runs, pendula._systems, pendula._simulation],
    ids=lambda m: m.__name__,
)
def test_examples_of_docstrings(module):
    assert doctest.testmod(module).failed == 0


def test_the_readme_shows_what_happens():
    readme = (Path(__file__).parents[2] / "README.md").read_text()
    [session] = re.findall(r"^```pycon\n(.*?)^```$", readme, re.DOTALL | re.MULTILINE)
    examples = doctest.DocTestParser().get_doctest(session, {}, "README.md", "README.md", 0)
    assert doctest.DocTestRunner().run(examples).failed == 0


def test_everything_public_is_documented():
    for name in pendula.__all__:
        assert name.startswith("__") or getattr(pendula, name).__doc__, name
