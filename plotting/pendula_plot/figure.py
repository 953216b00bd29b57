"""Plots of runs as a numerical analyst wants them: coordinates, phase portraits, energy errors, traces, steps."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from . import motion
from .run import PlotError, Run

# Okabe and Ito's colours, told apart by the colour-blind; black first.
COLOURS = ["#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00"]
GREEK = {"theta": "θ", "phi": "φ", "alpha": "α", "beta": "β", "psi": "ψ", "lambda": "λ"}
MOST_CURVES = 7
ROUNDING = 2.0**-53
WIDE_RANGE = 100  # steps that differ by more are on a logarithmic scale


@dataclass(frozen=True)
class Choice:
    """What to show of the runs."""

    panels: tuple[str, ...] = ()  # of trajectories, names of PANELS; none: what there is
    coordinates: tuple[str, ...] = ()  # by name; none: a few
    wrapped: bool = False
    phase: tuple[str, ...] = ()  # the two columns of phase portraits; none: a coordinate and its rate
    event: str = ""  # of sections: the only one to show; none: all


def symbol(name: str) -> str:
    """A name as it is printed: theta_dot_1 and theta_1_dot become θ̇₁."""
    parts = name.split("_")
    is_rate = "dot" in parts
    base, *rest = [part for part in parts if part != "dot"]
    index = "".join(rest)
    head = GREEK.get(base, base)
    if is_rate:
        head = rf"\dot{{{head}}}" if len(head) == 1 else rf"\dot{{\mathrm{{{head}}}}}"
    elif len(head) > 1:
        head = rf"\mathrm{{{head}}}"
    return f"${head}_{{{index}}}$" if index else f"${head}$"


def label(run: Run, column: str) -> str:
    unit = run.unit(column)
    return f"{symbol(column)} [{unit}]" if unit else symbol(column)


def is_angle(run: Run, column: str) -> bool:
    return run.unit(column) == "rad"


def within_turn(run: Run, column: str) -> np.ndarray:
    """A column, angles from −π to π."""
    values = run.columns[column]
    return np.mod(values + np.pi, 2 * np.pi) - np.pi if is_angle(run, column) else values


def shown(run: Run, column: str, choice: Choice) -> np.ndarray:
    """A column; a wrapped angle is cut where it jumps."""
    values = run.columns[column]
    if not (choice.wrapped and is_angle(run, column)):
        return values
    wrapped = within_turn(run, column)
    jumps = np.flatnonzero(np.abs(np.diff(wrapped)) > np.pi) + 1
    wrapped[jumps] = np.nan
    return wrapped


def chosen(runs: list[Run], choice: Choice) -> list[str]:
    """Columns to show: those asked for, else as many coordinates of the first run as are told apart."""
    there = [coordinate.name for coordinate in runs[0].coordinates]
    for name in choice.coordinates:
        for run in runs:
            if name not in run.columns:
                expected = f"a coordinate, one of {', '.join(there)}, or another column"
                raise PlotError(f"{run.name}: expected {expected}, got {name}")
    if choice.coordinates:
        return list(choice.coordinates)
    if len(runs) > 1:
        return there[-1:]
    return there if len(there) <= MOST_CURVES else [*there[: MOST_CURVES - 1], there[-1]]


def legend(axes: Axes, title: str | None = None) -> None:
    if len(axes.get_legend_handles_labels()[0]) > 1:
        axes.legend(loc="best", fontsize="small", title=title)


def curves(runs: list[Run], names: list[str]) -> list[tuple[Run, str, str, str]]:
    """Run, column, colour and name of each curve: runs by colour where there are several."""
    if len(runs) == 1:
        return [(runs[0], name, COLOURS[k % len(COLOURS)], symbol(name)) for k, name in enumerate(names)]
    several = len(names) > 1
    return [
        (run, name, COLOURS[k % len(COLOURS)], run.name + (f", {symbol(name)}" if several else ""))
        for k, run in enumerate(runs)
        for name in names
    ]


def base_of(column: str) -> str:
    """What columns of all links have in common: theta of theta_1, theta_dot of theta_dot_1."""
    base, _, link = column.rpartition("_")
    return base if link.isdigit() else column


def groups(run: Run, names: list[str], choice: Choice) -> list[list[str]]:
    """Columns that share an axis: those of one unit. What turns round and round, as phi does, has one of its own, and
    so has what has no unit."""
    found: dict[str, list[str]] = {}
    for name in names:
        turns = base_of(name) == "phi" and not choice.wrapped
        found.setdefault(base_of(name) if turns else run.unit(name) or base_of(name), []).append(name)
    return list(found.values())


def axis_label(run: Run, names: list[str]) -> str:
    """Of an axis for several columns: what they are, if that is one thing, and their unit."""
    if len(names) == 1:
        return label(run, names[0])
    unit, bases = run.unit(names[0]), dict.fromkeys(map(base_of, names))
    what = ", ".join(map(symbol, bases)) if len(bases) <= 3 else ""
    return f"{what} [{unit}]".strip() if unit else what


def draw_series(axes: Axes, runs: list[Run], choice: Choice, names: list[str]) -> None:
    """Columns that share an axis, over time."""
    for run, name, colour, text in curves(runs, names):
        axes.plot(run.time, shown(run, name, choice), color=colour, label=text)
    axes.set_xlabel(label(runs[0], "t"))
    axes.set_ylabel(axis_label(runs[0], names))
    there = len(runs[0].coordinates)
    some = len(runs) == 1 and there > MOST_CURVES and not choice.coordinates
    legend(axes, f"{MOST_CURVES} of {there}" if some else None)


def phase_of(runs: list[Run], choice: Choice) -> tuple[str, str]:
    """The columns of a phase portrait."""
    if choice.phase:
        if len(choice.phase) != 2:
            got = ", ".join(choice.phase)
            raise PlotError(f"--phase: expected two columns, as in theta_1,theta_dot_1, got {got}")
        chosen(runs, replace(choice, coordinates=choice.phase))
        return choice.phase[0], choice.phase[1]
    rates = {coordinate.name: coordinate.rate for coordinate in runs[0].coordinates}
    name = ([name for name in choice.coordinates if name in rates] or list(rates))[-1]
    return name, rates[name]


def draw_phase(axes: Axes, runs: list[Run], choice: Choice) -> None:
    across, up = phase_of(runs, choice)
    for run, column, colour, text in curves(runs, [across]):
        axes.plot(shown(run, column, choice), shown(run, up, choice), color=colour, label=text, linewidth=0.7)
    axes.set_xlabel(label(runs[0], across))
    axes.set_ylabel(label(runs[0], up))
    if len(runs) > 1:
        legend(axes)


def draw_energy(axes: Axes, runs: list[Run], choice: Choice) -> None:
    """The energy where loads act, which change it; else how far it is off."""
    if any(run.loaded for run in runs):
        draw_series(axes, runs, choice, ["energy"])
    else:
        draw_energy_error(axes, runs)


def draw_energy_error(axes: Axes, runs: list[Run]) -> None:
    """|E − E₀| against what rounding alone would give: a last bit of the largest energy a row, added up by chance."""
    for k, run in enumerate(runs):
        energy = run.columns["energy"]
        error = np.abs(energy - energy[0])
        size = max(np.max(np.abs(energy)), np.ptp(energy), np.max(kinetic_size(run)))
        rows = np.arange(1, len(energy))
        colour = COLOURS[k % len(COLOURS)]
        axes.plot(run.time[1:], np.where(error[1:] > 0, error[1:], np.nan), color=colour, label=run.name)
        if k == 0 and len(rows):
            axes.plot(
                run.time[1:],
                ROUNDING * size * np.sqrt(rows),
                color="#888888",
                linestyle=":",
                label="rounding",
            )
    axes.set_yscale("log")
    axes.set_xlabel(label(runs[0], "t"))
    axes.set_ylabel(f"$|E - E_0|$ [{runs[0].unit('energy')}]")
    axes.legend(loc="best", fontsize="small")


def kinetic_size(run: Run) -> np.ndarray:
    """What kinetic and potential energies amount to where the total is near zero: half of m v² of the last point, with
    the mass 1 where it is not known."""
    if not run.points or len(run.time) < 2:
        return np.zeros(1)
    masses = run.masses
    steps = np.diff(run.positions()[:, -1], axis=0) / np.diff(run.time)[:, None]
    return 0.5 * (1 if masses is None else masses[-1]) * np.sum(steps**2, axis=1)


def draw_trace(axes: Axes, runs: list[Run], choice: Choice) -> None:
    space = runs[0].dimension == 3
    for k, run in enumerate(runs):
        places = run.positions()
        path = places[:, -1]
        axes.plot(*path.T, color=COLOURS[(k + 1) % len(COLOURS)], linewidth=0.7, label=run.name)
        if run.is_chain:
            chain = np.vstack([np.zeros(run.dimension), places[-1]])
            axes.plot(*chain.T, color=COLOURS[0], marker="o", markersize=3, linewidth=1)
    columns = runs[0].points[-1].columns
    axes.set_xlabel(label(runs[0], columns[0]))
    axes.set_ylabel(label(runs[0], columns[1]))
    if space:
        axes.set_zlabel(label(runs[0], columns[2]))
    axes.set_aspect("equal", **({} if space else {"adjustable": "datalim"}))
    if len(runs) > 1:
        legend(axes)


def draw_steps(axes: Axes, runs: list[Run], choice: Choice) -> None:
    """How far apart rows are, which is how long steps were where each has its row."""
    for k, run in enumerate(runs):
        axes.stairs(
            np.diff(run.time), run.time, baseline=None, color=COLOURS[k % len(COLOURS)], label=run.name
        )
    steps = np.concatenate([np.diff(run.time) for run in runs])
    if np.max(steps) > WIDE_RANGE * np.min(steps):
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0)
    axes.set_xlabel(label(runs[0], "t"))
    axes.set_ylabel(f"$t_{{k+1}} - t_k$ [{runs[0].unit('t')}]")
    if len(runs) > 1:
        legend(axes)


PANELS: dict[str, Callable[..., None]] = {
    "series": draw_series,
    "phase": draw_phase,
    "energy": draw_energy,
    "trace": draw_trace,
    "steps": draw_steps,
}
OF_MOTION = ("series", "phase", "trace")  # they show what is between rows, too


def possible(run: Run, panel: str) -> bool:
    has = {"trace": run.dimension >= 2, "energy": "energy" in run.columns, "steps": True}
    return has.get(panel, bool(run.coordinates))


def steps_differ(run: Run) -> bool:
    """Whether a row is a step, as far as is known, and steps are not all alike; the last one may be cut short."""
    steps = np.diff(run.time)[:-1]
    return run.steps_a_row == 1 and len(steps) > 1 and bool(np.ptp(steps) > 1e-6 * np.max(steps))


def panels_of(runs: list[Run], choice: Choice) -> list[str]:
    """Panels to draw: those asked for; else all, steps only where they say something."""
    wanted = choice.panels or [name for name in PANELS if name != "steps" or all(map(steps_differ, runs))]
    if "steps" in wanted:
        for run in runs:
            check_steps(run)
    return [panel for panel in wanted if all(possible(run, panel) for run in runs)]


def check_steps(run: Run) -> None:
    """A run file tells what its rows are; of a CSV file, whoever asks for steps knows."""
    if run.steps_a_row not in (None, 1):
        every = f"every {run.steps_a_row} steps" if run.steps_a_row else "at times"
        raise PlotError(
            f"{run.name}: expected a row a step (output.every = 1) to show steps, got rows {every}"
        )
    if len(run.time) < 2:
        raise PlotError(f"{run.name}: expected two rows or more to show steps, got one")


def style() -> AbstractContextManager:
    """Of all figures: to be in force while they are drawn."""
    return mpl.rc_context({"font.size": 9, "axes.grid": True, "grid.alpha": 0.3, "lines.linewidth": 1.0})


def figure(runs: list[Run], choice: Choice) -> Figure:
    """All panels in one figure, two to a row."""
    panels = panels_of(runs, choice)
    if not panels:
        raise PlotError(f"{runs[0].name}: expected columns to draw, got {', '.join(runs[0].columns)}")
    fine = [motion.finer(run) for run in runs]
    drawings: list[tuple[str, list]] = []
    for panel in panels:
        parts = groups(runs[0], chosen(runs, choice), choice) if panel == "series" else [None]
        drawings += [(panel, [part] if part else []) for part in parts]
    width = min(len(drawings), 2)
    height = (len(drawings) + 1) // 2
    with style():
        drawn = Figure(figsize=(4.2 * width, 3.2 * height), layout="constrained")
        for k, (panel, part) in enumerate(drawings):
            space = panel == "trace" and runs[0].dimension == 3
            axes = drawn.add_subplot(height, width, k + 1, **({"projection": "3d"} if space else {}))
            PANELS[panel](axes, fine if panel in OF_MOTION else runs, choice, *part)
    return drawn


def write(drawn: Figure, path: Path) -> None:
    """Writes a figure in the format that its name ends in; the same run gives the same file."""
    formats = ("svg", "png", "pdf")
    if path.suffix[1:].lower() not in formats:
        raise PlotError(f"{path}: expected a name that ends in .svg, .png or .pdf")
    unchanging = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}
    try:
        with mpl.rc_context({"svg.hashsalt": "pendula"}):
            drawn.savefig(path, dpi=200, metadata=unchanging.get(path.suffix[1:].lower()))
    except OSError as error:
        raise PlotError(
            f"{path}: expected a file that can be written, got: {error.strerror or error}"
        ) from None
