"""The programs that the campaign's own tests run."""

import os
from pathlib import Path

import pytest
import reference


@pytest.fixture
def compiled() -> reference.Reference:
    """The compiled reference."""
    path = os.environ.get("CHAIN_REFERENCE")
    assert path, "CHAIN_REFERENCE must name the compiled reference"
    return reference.Reference(Path(path))


@pytest.fixture
def program() -> Path:
    """The program that the campaign judges."""
    path = os.environ.get("PENDULA_PROGRAM")
    assert path, "PENDULA_PROGRAM must name the program to test"
    return Path(path)
