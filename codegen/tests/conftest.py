"""Shared by all tests: the headers that the repository keeps, generated once."""

from pathlib import Path

import pytest

from pendula_codegen.__main__ import committed_headers

REPOSITORY = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def fresh_headers() -> dict[str, str]:
    """File name -> text of everything under generated/, made afresh."""
    return committed_headers()
