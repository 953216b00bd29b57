"""Maps of ensembles: a kept number of every member, over two axes as colours, over one as a curve."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import LogLocator

from .errors import PlotError, require_end_of_reading, told_of
from .figure import GREEK, style, symbol
from .run import keys_of, unit_of

WIDE_RANGE = 100  # times that differ by more are on a logarithmic scale
FEW_DECADES = 1e4  # on which 1, 2, 5, … are numbered, not powers of ten alone
SIDE = 5.2  # inches, of the longer side of a map
DOTS = 200  # an inch, as pictures are written
DURATION = 10.0  # s, of a run whose scenario does not say
NEVER, FAILED = "#e8e8e8", "#b00020"


@dataclass(frozen=True)
class Ensemble:
    """The numbers of an ensemble's file that a map shows."""

    name: str
    key: str
    values: np.ndarray  # in the shape of the axes
    unit: str
    status: np.ndarray
    axes: list[tuple[str, str, np.ndarray]]  # name, unit, values; the first one slowest
    contour: np.ndarray | None
    complete: bool
    duration: str  # of a member's run, as a legend says it

    def lost(self) -> np.ndarray:
        """Members that were not moved, or failed."""
        return ~np.isin(self.status, (0, 1))


def reject(path: Path | str, expected: str, got: str) -> PlotError:
    return PlotError(f"{path}: expected {expected}, got {got}")


def read(path: Path, key: str, contour: str = "") -> Ensemble:
    """Reads a key of an ensemble's file, and the one that a contour is of. Raises PlotError."""
    import h5py

    with told_of(path, "a file of pendula ensemble"):
        require_end_of_reading(path)
        with h5py.File(path, "r") as file:
            if str(file.attrs.get("kind", "")) != "ensemble":
                raise reject(path, "a file of pendula ensemble", "another HDF5 file")
            status = file["status"]
            kept = {
                name: file[name]
                for name in sorted(file)
                if file[name].shape == status.shape and not file[name].is_scale
            }
            key, contour = (called(path, kept, name) if name else "" for name in (key, contour))
            axes = [scale_of(kept[key].dims[k][0]) for k in range(status.ndim)]
            unit = unit_of(kept[key].attrs)
            return Ensemble(
                str(path),
                key,
                counted(kept[key][...]),
                unit,
                status[...],
                axes,
                kept[contour][...] if contour else None,
                bool(file.attrs["complete"]),
                duration_of(file.attrs, [name for name, _, _ in axes], unit),
            )


def duration_of(attributes: Mapping, axes: list[str], unit: str) -> str:
    """How long members are moved, by the attributes of a file; `unit` is of the number that is shown."""
    if "run.duration" in axes:
        return "its duration"
    keys = keys_of(tomllib.loads(str(attributes["scenario"])), json.loads(attributes["set"]))
    time = unit if unit not in ("", "1") else "s"
    return f"{float(keys.get('run.duration') or DURATION):g} {time}"


def called(path: Path | str, kept: Mapping[str, Any], name: str) -> str:
    """The data set of that name; or of what the scenario calls it, `event:flip` of event_flip, `final:theta_1` of
    theta_1. Raises PlotError."""
    name = name.removeprefix("final:").removeprefix("points:")
    if name in kept:
        return name
    typed = {str(data.attrs.get("long_name", "")): word for word, data in kept.items()}
    if name in typed:
        return typed[name]
    raise reject(path, f"one of {', '.join(kept)}", f'"{name}"')


def scale_of(scale: Any) -> tuple[str, str, np.ndarray]:
    """Key of the scenario, unit and values of an axis; in files of old the key is the name."""
    key = str(scale.attrs.get("long_name", scale.name[1:]))
    return key, unit_of(scale.attrs), scale[:]


def counted(values: np.ndarray) -> np.ndarray:
    """Doubles; a count that is not there is −1 in the file."""
    return values if values.dtype.kind == "f" else np.where(values < 0, np.nan, values.astype(float))


def named(name: str, unit: str) -> str:
    """An axis or a colour bar: coordinates as symbols, start.theta[2] as θ₂ [rad], the rest in words."""
    stem = name.removeprefix("start.").removeprefix("chain.")
    coordinate = stem.replace("[", "_").rstrip("]")
    is_symbol = ":" not in stem and coordinate.split("_")[0] in GREEK
    text = symbol(coordinate) if is_symbol else stem.replace("_", " ").replace(":", " ")
    return f"{text} [{unit}]" if unit and unit != "1" else text


@dataclass(frozen=True)
class MapChoice:
    """How a map is drawn."""

    scale: str = ""  # "log" or "linear"; else log where a positive number spans a wide range
    level: float | None = None  # of the contour


def is_log(values: np.ndarray, scale: str) -> bool:
    if scale:
        return scale == "log"
    found = values[np.isfinite(values)]
    return found.size > 0 and found.min() > 0 and found.max() > WIDE_RANGE * found.min()


def colours(ensemble: Ensemble, values: np.ndarray, choice: MapChoice) -> tuple[str, Normalize]:
    """A cyclic map for angles, else one of even brightness."""
    if ensemble.unit == "rad":
        return "twilight_shifted", Normalize(-np.pi, np.pi)
    found = values[np.isfinite(values)]
    if is_log(values, choice.scale):
        positive = found[found > 0]
        if positive.size == 0:
            raise PlotError(f"{ensemble.name}: expected positive numbers for a logarithmic scale, got none")
        return "viridis", LogNorm(positive.min(), positive.max())
    return "viridis", Normalize(found.min(), found.max())


def ends(values: np.ndarray) -> tuple[float, float]:
    """Of an axis whose members are the middles of cells, all as wide."""
    half = (values[-1] - values[0]) / (len(values) - 1) / 2 if len(values) > 1 else 0.5
    return values[0] - half, values[-1] + half


def edges(values: np.ndarray) -> np.ndarray:
    """Of the cells of an axis that ascends, half way between the members."""
    first, last = ends(values[:2])[0], ends(values[-2:])[1]
    return np.concatenate([[first], (values[1:] + values[:-1]) / 2, [last]])


def is_even(values: np.ndarray) -> bool:
    steps = np.diff(values)
    return steps.size < 2 or bool(np.ptp(steps) <= 1e-6 * np.abs(steps).max())


def ascending(ensemble: Ensemble) -> Ensemble:
    """The same with axes in order, where they are not even. Raises PlotError where a value is there twice."""
    for k, (name, unit, values) in enumerate(ensemble.axes):
        if is_even(values) and (len(values) < 2 or values[0] != values[1]):
            continue
        order = np.argsort(values)
        if np.any(np.diff(values[order]) == 0):
            raise PlotError(f"{ensemble.name}: expected different values of {name}, got one twice")
        axes = list(ensemble.axes)
        axes[k] = name, unit, values[order]
        ensemble = replace(
            ensemble,
            axes=axes,
            values=ensemble.values.take(order, k),
            status=ensemble.status.take(order, k),
            contour=None if ensemble.contour is None else ensemble.contour.take(order, k),
        )
    return ensemble


def draw_map(drawn: Figure, axes: Axes, ensemble: Ensemble, choice: MapChoice) -> None:
    """Two axes: the first one of the scenario to the right, the second upwards."""
    ensemble = ascending(ensemble)
    values = shown(ensemble)
    if not np.isfinite(values).any():
        raise PlotError(f"{ensemble.name}: expected numbers of {ensemble.key}, got none")
    cmap, norm = colours(ensemble, values, choice)
    failed, kinds = ensemble.lost().T.astype(int), ListedColormap([NEVER, FAILED])
    numbers, colour = np.ma.masked_invalid(values.T), {"cmap": cmap, "norm": norm}
    across, upwards = (axis[2] for axis in ensemble.axes)
    if is_even(across) and is_even(upwards):
        extent = (*ends(across), *ends(upwards))
        place = {"origin": "lower", "extent": extent, "aspect": "auto", "interpolation": "nearest"}
        axes.imshow(kinds(failed), **place)
        image = axes.imshow(numbers, **colour, **place)
    else:
        axes.pcolormesh(edges(across), edges(upwards), failed, cmap=kinds, vmin=0, vmax=1)
        image = axes.pcolormesh(edges(across), edges(upwards), numbers, **colour)
    few_decades = isinstance(norm, LogNorm) and norm.vmax < FEW_DECADES * norm.vmin
    ticks = {"ticks": LogLocator(subs=(1, 2, 5)), "format": "%g"} if few_decades else {}
    drawn.colorbar(image, ax=axes, label=named(ensemble.key, ensemble.unit), **ticks)
    if choice.level is not None:
        axes.contour(across, upwards, ensemble.contour.T, levels=[choice.level], colors="k", linewidths=0.8)
    axes.grid(visible=False)
    axes.set_xlabel(named(*ensemble.axes[0][:2]))
    axes.set_ylabel(named(*ensemble.axes[1][:2]))
    legend(axes, ensemble, values)


def shown(ensemble: Ensemble) -> np.ndarray:
    """Angles within a turn; nothing of members that failed."""
    values = np.where(ensemble.lost(), np.nan, ensemble.values)
    return np.mod(values + np.pi, 2 * np.pi) - np.pi if ensemble.unit == "rad" else values


def legend(axes: Axes, ensemble: Ensemble, values: np.ndarray) -> None:
    """What has no colour of the bar."""
    lost = ensemble.lost()
    patches = []
    if (np.isnan(values) & ~lost).any():
        patches.append(Patch(color=NEVER, label=f"not within {ensemble.duration}"))
    if lost.any():
        text = "failed" if ensemble.complete else "failed, or not run yet"
        patches.append(Patch(color=FAILED, label=text))
    if patches:
        axes.legend(handles=patches, loc="upper left", bbox_to_anchor=(0, -0.1), ncols=2, frameon=False)


def draw_curve(axes: Axes, ensemble: Ensemble, choice: MapChoice) -> None:
    """One axis."""
    name, unit, values = ensemble.axes[0]
    numbers = np.where(ensemble.lost(), np.nan, ensemble.values)
    axes.plot(values, numbers, ".", markersize=2)
    if is_log(numbers, choice.scale):
        axes.set_yscale("log")
    axes.set_xlabel(named(name, unit))
    axes.set_ylabel(named(ensemble.key, ensemble.unit))


def figure(ensemble: Ensemble, choice: MapChoice) -> Figure:
    """A cell of a map is one dot of a picture at least."""
    if len(ensemble.axes) > 2:
        names = ", ".join(name for name, _, _ in ensemble.axes)
        raise PlotError(f"{ensemble.name}: expected one axis or two, got {names}")
    with style():
        if len(ensemble.axes) == 1:
            drawn = Figure(figsize=(SIDE, 0.7 * SIDE), layout="constrained")
            draw_curve(drawn.add_subplot(), ensemble, choice)
            return drawn
        side = max(SIDE, 1.25 * max(ensemble.values.shape) / DOTS)
        drawn = Figure(figsize=(1.15 * side, side), layout="constrained")
        draw_map(drawn, drawn.add_subplot(), ensemble, choice)
    return drawn
