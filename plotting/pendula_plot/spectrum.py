"""Lyapunov exponents as they converge: averages from the start to each time, over the time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .figure import MOST_CURVES, Choice, curves, label, legend, style
from .run import PlotError, Run, numbers, read_lines


@dataclass(frozen=True)
class Spectrum:
    """Exponents lambda_1, lambda_2, … in descending order, a row a time."""

    rows: Run

    @property
    def name(self) -> str:
        return self.rows.name

    @property
    def exponents(self) -> list[str]:
        return list(self.rows.columns)[1:]

    def between(self, start: float, end: float) -> Spectrum:
        """The rows from one time to another."""
        return Spectrum(self.rows.between(start, end))


def is_header(names: list[str]) -> bool:
    return len(names) > 1 and names == ["t", *(f"lambda_{k}" for k in range(1, len(names)))]


def read(path: Path) -> Spectrum:
    """Reads what `pendula lyapunov -o` writes. Raises PlotError."""
    header, lines = read_lines(path)
    if not lines:
        raise PlotError(f"{path}: expected rows, got none")
    return Spectrum(Run(str(path), numbers(path, header, lines), dict.fromkeys(header[1:], "1/s")))


def chosen(spectra: list[Spectrum], choice: Choice) -> list[str]:
    """Exponents to show: those asked for, else all that every file has."""
    for spectrum in spectra:
        for name in choice.coordinates:
            if name not in spectrum.exponents:
                there = f"lambda_1 to {spectrum.exponents[-1]}"
                raise PlotError(f"{spectrum.name}: expected an exponent, {there}, got {name}")
    return list(choice.coordinates) or min((spectrum.exponents for spectrum in spectra), key=len)


def draw(axes: Axes, spectra: list[Spectrum], names: list[str]) -> None:
    """A colour an exponent, or a file where there are several; of many exponents, one from a scale."""
    runs = [spectrum.rows for spectrum in spectra]
    scale = mpl.cm.ScalarMappable(mpl.colors.Normalize(1, len(names)), "viridis")
    many = len(runs) == 1 and len(names) > MOST_CURVES
    for k, (run, name, colour, text) in enumerate(curves(runs, names)):
        if len(runs) > 1:
            text = run.name if name == names[0] else None
        axes.plot(
            run.time,
            run.columns[name],
            color=scale.to_rgba(k + 1) if many else colour,
            label=None if many else text,
        )
    axes.axhline(0, color="#888888", linestyle=":")
    if all(np.min(run.time) > 0 for run in runs):
        axes.set_xscale("log")
    axes.set_xlabel(label(runs[0], "t"))
    axes.set_ylabel(label(runs[0], names[0]) if len(names) == 1 else "exponents [1/s]")
    if many:
        axes.figure.colorbar(scale, ax=axes, label="exponent")
    legend(axes)


def figure(spectra: list[Spectrum], choice: Choice) -> Figure:
    names = chosen(spectra, choice)
    with style():
        drawn = Figure(figsize=(5.4, 3.8), layout="constrained")
        draw(drawn.add_subplot(), spectra, names)
    return drawn
