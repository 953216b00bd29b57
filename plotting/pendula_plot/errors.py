"""Errors that people are told of; among them what damaged files do to those who read them."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PROBE_SECONDS = 1.0  # of processor time; a file of 20 quantities takes 0.01


class PlotError(Exception):
    """A message for people: what was expected, and what there is."""


@contextmanager
def told_of(path: Path, expected: str) -> Iterator[None]:
    """Whatever is raised while a file is read is told as a PlotError: it has no bounds where files are damaged."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise PlotError(f"{path}: expected {expected}, got neither a file nor a link to one")
    try:
        yield
    except PlotError:
        raise
    except OSError as error:
        # Of what HDF5 says the first words are for people.
        why = os.strerror(error.errno) if error.errno else error
        raise PlotError(f"{path}: expected {expected} that can be read, got: {why}") from None
    except Exception as error:
        raise PlotError(f"{path}: expected {expected}, got one that is damaged: {one_line(error)}") from None


@contextmanager
def told_of_numbers(name: str) -> Iterator[None]:
    """Numbers that no picture can show, such as 1e308, are told as a PlotError."""
    try:
        yield
    except (ArithmeticError, ValueError) as error:
        raise PlotError(f"{name}: expected numbers that can be drawn, got: {one_line(error)}") from None


def one_line(error: Exception) -> str:
    return " ".join(f"{type(error).__name__}: {error}".split())


def require_end_of_reading(path: Path) -> None:
    """Raises PlotError where HDF5 does not come to the end of the texts of a file: in what is damaged it goes in
    circles, or dies. It is tried in a copy of this process."""
    if not comes_to_an_end(lambda: read_texts(path)):
        raise PlotError(f"{path}: expected an HDF5 file, got one that is damaged")


def read_texts(path: Path) -> None:
    import h5py

    def look_at(_: str, item: h5py.Group | h5py.Dataset) -> None:
        for name in item.attrs:
            item.attrs[name]
        if isinstance(item, h5py.Dataset) and item.dtype.kind == "O":
            item[()]

    with h5py.File(path, "r") as file:
        look_at("", file)
        file.visititems(look_at)


def comes_to_an_end(action: Callable[[], object]) -> bool:
    """Whether it does in a copy of this process, however it ends, within PROBE_SECONDS."""
    child = os.fork()
    if child == 0:
        with suppress(BaseException):  # whoever does it next will be told
            signal.setitimer(signal.ITIMER_PROF, PROBE_SECONDS)
            action()
        os._exit(0)
    _, status = os.waitpid(child, 0)
    return status == 0
