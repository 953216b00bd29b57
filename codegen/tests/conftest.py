"""Shared by all tests: the headers that the repository keeps, generated once."""

from pathlib import Path

import pytest

from pendula_codegen.__main__ import committed_headers
from pendula_codegen.render import Header

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def fresh() -> dict[str, Header]:
    """File name -> everything under generated/, made afresh."""
    return committed_headers()


@pytest.fixture(scope="session")
def fresh_headers(fresh) -> dict[str, str]:
    """File name -> its text."""
    return {name: header.text for name, header in fresh.items()}
