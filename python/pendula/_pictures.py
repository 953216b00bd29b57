"""Pictures of runs: lines, animations, pages in notebooks."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core
from ._core import InputError
from ._runs import missing, number, places

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray


POINTS = 2000  # points of a curve: as many as a picture can show


def module_of_pictures(name: str) -> Any:
    """A module of the package that also draws for `pendula plot` and `pendula map`."""
    if "pendula_plot" not in sys.modules:
        folder = Path(_core.plotting_folder(places()[0])) / "pendula_plot"
        found = importlib.util.spec_from_file_location("pendula_plot", folder / "__init__.py")
        assert found is not None and found.loader is not None
        package = importlib.util.module_from_spec(found)
        sys.modules["pendula_plot"] = package
        found.loader.exec_module(package)
    return importlib.import_module(f"pendula_plot.{name}")


def _new_figure() -> Figure:
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise missing("pictures", error) from None
    return plt.figure()


def plot(
    columns: dict[str, NDArray[np.float64]],
    units: dict[str, str],
    names: list[str],
    axes: Axes | None,
    label: str | None,
) -> Axes:
    """Draws columns over time, a panel for each unit, in the style of `pendula plot`. Raises InputError."""
    try:
        import matplotlib.pyplot as plt

        drawing, run = module_of_pictures("figure"), module_of_pictures("run")
    except ImportError as error:
        raise missing("pictures", error) from None
    shown = module_of_pictures("motion").finer(run.Run("", columns, units))
    choice = drawing.Choice()
    parts = drawing.groups(shown, names or drawing.chosen([shown], choice), choice)
    if axes is not None and len(parts) > 1:
        told = "; ".join(", ".join(part) for part in parts)
        raise InputError(f"axes: expected columns that share an axis, got {told}")
    with drawing.style():
        if axes is None:
            height = max(4.8, 2.6 * len(parts))
            figure = plt.figure(figsize=(6.4, height), layout="constrained")
            panels: list[Axes] = list(figure.subplots(len(parts), sharex=True, squeeze=False)[:, 0])
        else:
            panels = [axes]
        for panel, part in zip(panels, parts, strict=True):
            for name in part:
                symbol = drawing.symbol(name)
                told = symbol if label is None else label if len(part) == 1 else f"{label}, {symbol}"
                colour = drawing.COLOURS[len(panel.lines) % len(drawing.COLOURS)]
                panel.plot(shown.time, shown.columns[name], color=colour, label=told)
            panel.set_ylabel(drawing.axis_label(shown, part))
            drawing.legend(panel)
        panels[-1].set_xlabel(drawing.label(shown, "t"))
    return panels[0]


def frames(t: NDArray[np.float64], seconds: float | None, fps: float) -> NDArray[np.float64]:
    """Times of the frames of a film. Raises InputError."""
    if t.size == 0:
        raise InputError("animate: expected a solution with rows, got none")
    span = float(t[-1] - t[0])
    shown, rate = span if seconds is None else number("seconds", seconds), number("fps", fps)
    if shown < 0 or rate <= 0:
        raise InputError(f"animate: expected seconds >= 0 and fps > 0, got {shown} and {rate}")
    return np.linspace(t[0], t[-1], max(2, round(shown * rate) + 1)) if span > 0 else t[:1]


def iframe(page: str) -> str:
    """A page embedded in another one, sandboxed from it."""
    return (
        f'<iframe srcdoc="{escape(page)}" sandbox="allow-scripts" title="pendula" '
        'style="width: 100%; height: 640px; border: 0"></iframe>'
    )


def animation(
    times: NDArray[np.float64],
    rows: NDArray[np.float64],
    points: list[list[int]],
    units: list[str],
    interval: float,
) -> FuncAnimation:
    """An animation of points. ``points`` has the columns of the components of each; lines join them from the origin."""
    dimension = max((len(point) for point in points), default=0)
    if dimension == 0:
        raise InputError("animate: expected a system with points, got one without")
    places = np.zeros((len(rows), len(points) + 1, max(dimension, 2)))
    for k, point in enumerate(points):
        places[:, k + 1, : len(point)] = rows[:, point]
    figure = _new_figure()
    from matplotlib.animation import FuncAnimation

    axes: Any = figure.add_subplot(projection="3d" if dimension == 3 else None)  # of two classes
    for axis, name in zip("xyz", range(places.shape[2]), strict=False):
        low, high = places[:, :, name].min(), places[:, :, name].max()
        middle, half = (low + high) / 2, max(float(np.ptp(places, axis=(0, 1)).max()) / 2, 1e-9) * 1.05
        getattr(axes, f"set_{axis}lim")(middle - half, middle + half)
        getattr(axes, f"set_{axis}label")(f"{axis} [{units[points[0][0]]}]")
    axes.set_aspect("equal") if dimension < 3 else axes.set_box_aspect((1, 1, 1))
    (drawn,) = axes.plot(*places[0].T, marker="o")

    def show(frame: int) -> list[Any]:
        drawn.set_data(*places[frame].T[:2])
        if dimension == 3:
            drawn.set_3d_properties(places[frame, :, 2])
        axes.set_title(f"t = {times[frame]:.2f} {units[0]}")
        return [drawn]

    return FuncAnimation(figure, show, frames=len(rows), interval=interval)
