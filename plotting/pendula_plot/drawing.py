"""What a file is, by its header, and the figure of files of that kind."""

from __future__ import annotations

from pathlib import Path

from matplotlib.figure import Figure

from . import figure, section, spectrum
from .errors import PlotError, told_of
from .figure import Choice
from .run import Run, read_run
from .section import Section
from .spectrum import Spectrum

Drawable = Run | Section | Spectrum
NAMES = {Run: "a trajectory", Section: "events", Spectrum: "Lyapunov exponents"}
FIGURES = {Run: figure.figure, Section: section.figure, Spectrum: spectrum.figure}


def read(path: Path) -> Drawable:
    """Reads a trajectory, events or Lyapunov exponents. Raises PlotError."""
    with told_of(path, "a trajectory"):
        header = first_line(path).split(",")
        if section.is_header(header):
            return section.read(path)
        if spectrum.is_header(header):
            return spectrum.read(path)
        return read_run(path)


def first_line(path: Path) -> str:
    """Of a text; of anything else, and of what cannot be read, something that is no header."""
    try:
        with path.open(encoding="utf-8", errors="replace") as stream:
            return stream.readline(1_000_000).rstrip("\n")
    except OSError:
        return ""


def draw(files: list[Drawable], choice: Choice) -> Figure:
    """The figure of files, which are all of the kind that the first one is."""
    kind = type(files[0])
    for file in files:
        if type(file) is not kind:
            expected = f"{NAMES[kind]}, as {files[0].name} is"
            raise PlotError(f"{file.name}: expected {expected}, got {NAMES[type(file)]}")
    return FIGURES[kind](files, choice)
