"""Pictures of runs: lines, animations, pages in notebooks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._core import InputError
from ._runs import missing, number

if TYPE_CHECKING:
    from matplotlib.animation import FuncAnimation
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray


def _new_figure() -> Figure:
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise missing("pictures", error) from None
    return plt.figure()


def plot(
    rows: NDArray[np.float64], columns: list[int], names: list[str], units: list[str], axes: Axes | None
) -> Axes:
    """Columns of rows over the first one."""
    if axes is None:
        axes = _new_figure().add_subplot()
    for column in columns:
        axes.plot(rows[:, 0], rows[:, column], label=f"{names[column]} [{units[column]}]")
    axes.set_xlabel(f"t [{units[0]}]")
    axes.legend()
    return axes


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
    """A page as a part of another one, which it cannot reach."""
    from html import escape

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
    """``points`` are the columns of the components of each; they are joined in order, from the origin on."""
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
