"""Draws the work-precision, scaling and drift pictures from the kept figures.

usage: python bench/draw.py FIGURES_FOLDER IMAGES_FOLDER

Everything is drawn in middle tones on a transparent ground, to be read on light and on dark pages alike.
"""

import itertools
import json
import math
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

BENCH = Path(__file__).parent
INK = "#7d8590"
STYLE = {
    "svg.hashsalt": "pendula",
    "font.size": 10,
    "text.color": INK,
    "axes.labelcolor": INK,
    "axes.edgecolor": INK,
    "axes.titlesize": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "grid.color": INK,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}
BESIDE = "our O(n) dynamics"
LEAP = 5  # decades
PEERS = {
    "GSL rk8pd": "#e5484d",
    "odeint fehlberg78": "#d98324",
    "CVODE Adams": "#b08800",
    "MuJoCo RK4": "#a371f7",
    "GSL rk4imp": "#db61a2",
    "heyoka": "#8b5e3c",
}
OURS = {
    "pendula s = 8 fixed point": "#1f9d55",
    "pendula s = 6 fixed point": "#1c9e9e",
    "pendula s = 4 Newton": "#3b82f6",
    "pendula s = 2 Newton": "#7c9cf5",
    "pendula s = 8 dense kernel": "#64a36f",
}
TITLES = {
    "D": "Double pendulum, T = 10 s",
    "P10": "Ten links, T = 1 s",
    "P100": "A hundred links, T = 1 s",
}


def appearance(name: str) -> dict:
    """Colour and line of a contestant: ours bold; dashed what runs on our dynamics."""
    if name in OURS:
        return {"color": OURS[name], "linewidth": 2.2, "zorder": 3}
    color = PEERS.get(name.partition(",")[0], INK)
    return {"color": color, "linewidth": 1.2, "linestyle": "--" if BESIDE in name else "-"}


def broken(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The same with gaps where the error leaps: a run that ended elsewhere is a point of its own."""
    shown = points[:1]
    for before, point in itertools.pairwise(points):
        if abs(math.log10(point[0] / before[0])) > LEAP:
            shown.append((math.nan, math.nan))
        shown.append(point)
    return shown


def draw_race(axes: Axes, title: str, race: dict) -> None:
    """Time against error of every contestant, one point a setting."""
    for name, contestant in race["trials"].items():
        if name not in OURS and name.partition(",")[0] not in PEERS:
            continue
        runs = contestant["runs"]
        points = [(run["error"], run["milliseconds"]) for run in runs if run["error"] and run["error"] < 0.1]
        if points:
            errors, times = zip(*broken(points), strict=True)
            axes.loglog(errors, times, marker="o", markersize=2.5, label=name, **appearance(name))
    limit = 10 * race["floor"]
    axes.axvline(limit, color=INK, linestyle=":", linewidth=1)
    axes.annotate(
        "10 floors",
        (limit, 1),
        (3, -3),
        xycoords=("data", "axes fraction"),
        textcoords="offset points",
        va="top",
        fontsize=8,
    )
    axes.set(title=title, xlabel="error of the final state", ylabel="milliseconds")
    axes.invert_xaxis()
    axes.grid(True)


def draw_work_precision(races: dict, folder: Path) -> None:
    """Races side by side, one legend for all."""
    figure, panels = plt.subplots(1, len(TITLES), figsize=(4.4 * len(TITLES), 4.6), layout="constrained")
    for axes, (name, title) in zip(panels, TITLES.items(), strict=True):
        draw_race(axes, title, races[name])
    entries: dict = {}
    for axes in panels:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    figure.legend(entries.values(), entries.keys(), loc="outside lower center", ncols=3)
    save(figure, folder / "work_precision.svg")


def costs(benchmarks: dict, family: str) -> list[tuple[int, float]]:
    """(n, sincos a link and iteration) of the chain benchmarks of one family, such as "planar/s=2/newton"."""
    prefix = f"chain/{family}/n="
    found = [
        (int(name.removeprefix(prefix)), entry["sincos_a_link_and_iteration"])
        for name, entry in benchmarks.items()
        if name.startswith(prefix) and "failed" not in entry
    ]
    return sorted(found)


def draw_scaling(benchmarks: dict, folder: Path) -> bool:
    """Cost a link and iteration against n; flat is linear. False where no chain solver was measured."""
    curves = {
        "space, s = 2, Newton": ("spatial/s=2/newton", "#3b82f6", "-"),
        "space, s = 8, fixed point": ("spatial/s=8/fixed-point", "#1f9d55", "-"),
        "plane, s = 2, Newton": ("planar/s=2/newton", "#3b82f6", "--"),
        "plane, s = 8, fixed point": ("planar/s=8/fixed-point", "#1f9d55", "--"),
    }
    points = {label: costs(benchmarks, family) for label, (family, _, _) in curves.items()}
    if not all(points.values()):
        return False
    figure, axes = plt.subplots(figsize=(6.4, 3.8), layout="constrained")
    for label, (_, color, line) in curves.items():
        links, cost = zip(*points[label], strict=True)
        axes.semilogx(links, cost, line, color=color, marker="o", markersize=3.5, label=label)
    axes.set(
        xlabel="links",
        ylabel="sincos a link and iteration",
        title="What one link costs, by links in the chain",
    )
    axes.set_ylim(bottom=0)
    axes.grid(True)
    axes.legend(ncols=2)
    save(figure, folder / "scaling.svg")
    return True


def draw_drift(before: dict, now: dict, folder: Path) -> None:
    """Energy error along runs in space, of the solver in angles that was and of the one that is."""
    names = [name for name in now if name in before and name != "steps"]
    figure, panels = plt.subplots(1, len(names), figsize=(9.6, 3.2), sharey=True, layout="constrained")
    for axes, name in zip(panels, names, strict=True):
        for label, runs, color in (("angles", before, "#e5484d"), ("rods", now, "#1f9d55")):
            errors = runs[name]
            steps = [runs["steps"] * (part + 1) / len(errors) for part in range(len(errors))]
            axes.loglog(steps, errors, color=color, label=label)
        axes.set(xlabel="steps", title=name)
        axes.grid(True)
    panels[0].set_ylabel("|ΔH| / Σ M g l")
    panels[0].legend()
    save(figure, folder / "drift.svg")


def draw_steering(now: dict, folder: Path) -> None:
    """Energy error along a chaotic run in space, by steps of each kind."""
    figure, axes = plt.subplots(figsize=(6, 3.4), layout="constrained")
    for label, color in (("by the last error", "#e5484d"), ("symmetric", "#1f9d55"), ("constant", "#3b82f6")):
        errors = now[f"steps {label}"]
        steps = [now["steps"] * (part + 1) / len(errors) for part in range(len(errors))]
        axes.loglog(steps, errors, color=color, label=label)
    axes.set(xlabel="steps", ylabel="|ΔH| / Σ M g l", title="Three links in space, chaotic, four stages")
    axes.grid(True)
    axes.legend()
    save(figure, folder / "steering.svg")


def save(figure: plt.Figure, file: Path) -> None:
    """Writes an SVG that is the same for the same figures."""
    figure.savefig(file, transparent=True, metadata={"Date": None})
    plt.close(figure)
    print(f"{file}: {file.stat().st_size // 1000} kB")


def main() -> None:
    """Reads races.json, benchmarks.json and drift.json, writes the pictures."""
    figures, images = map(Path, sys.argv[1:])
    mpl.rcParams.update(STYLE)
    draw_work_precision(json.loads((figures / "races.json").read_text(encoding="utf-8")), images)
    kept = json.loads((figures / "benchmarks.json").read_text(encoding="utf-8"))
    drifts = [
        json.loads((folder / file).read_text(encoding="utf-8"))
        for folder, file in ((BENCH, "drift_in_angles.json"), (figures, "drift.json"))
    ]
    draw_drift(*drifts, images)
    draw_steering(drifts[-1], images)
    if not draw_scaling(kept["benchmarks"], images):
        print("no chain solver was measured: scaling.svg is left as it is")


if __name__ == "__main__":
    main()
