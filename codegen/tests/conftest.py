"""Shared by all tests: what takes long to derive or to compile is made once."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from loaded import LoadedKernel
from pendula_codegen.__main__ import committed_headers
from pendula_codegen.model import Model, read_model
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


@pytest.fixture(scope="session")
def own(tmp_path_factory) -> Callable[..., Model]:
    """own(text, name, links=None) -> the model that a file with this text defines."""

    @cache
    def read(text: str, name: str, links: int | None = None) -> Model:
        file = tmp_path_factory.mktemp(name) / f"{name}.py"
        file.write_text(text)
        return read_model(file, links)

    return read


@pytest.fixture(scope="session")
def kernel_of(tmp_path_factory) -> Callable[..., LoadedKernel]:
    """kernel_of(model, compiler, march) -> its kernel, compiled."""
    return cache(lambda model, *by: LoadedKernel(model, tmp_path_factory.mktemp("kernel"), *by))
