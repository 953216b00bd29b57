"""Poincaré sections: the states of a run at the instants of its events, two of their columns against each other."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .figure import COLOURS, Choice, is_angle, label, style, within_turn
from .run import PlotError, Run, numbers, read_lines

HEADER = ["name", "t", "direction"]
SAME = 1e-6  # two values of a coordinate closer than this, relative to the larger or in rad, are one


@dataclass(frozen=True)
class Section:
    """Events in order of time: the state at each, which event it is, and whether it goes up or down."""

    states: Run
    events: np.ndarray
    directions: np.ndarray

    @property
    def name(self) -> str:
        return self.states.name

    def between(self, start: float, end: float) -> Section:
        """The events from one time to another."""
        self.states.between(start, end)  # says so where there are none
        return self.only((self.states.time >= start) & (self.states.time <= end))

    def only(self, wanted: np.ndarray) -> Section:
        """Some of the events, by a mask."""
        return Section(self.states.only(wanted), self.events[wanted], self.directions[wanted])


def is_header(names: list[str]) -> bool:
    return names[: len(HEADER)] == HEADER


def read(path: Path) -> Section:
    """Reads what `simulate --events` writes. Raises PlotError."""
    header, lines = read_lines(path)
    if not lines:
        raise PlotError(f"{path}: expected events, got none")
    cells = [line.split(",") for line in lines]
    for number, row in enumerate(cells, start=2):
        if row[2:3] not in (["up"], ["down"]):
            raise PlotError(f"{path}:{number}: expected an event: its name, a time, up or down, …")
    columns = numbers(path, [header[1], *header[3:]], [",".join([row[1], *row[3:]]) for row in cells])
    events, directions = (np.array([row[column] for row in cells]) for column in (0, 2))
    return Section(Run(str(path), columns), events, directions)


def is_held(states: Run, coordinate: str, wanted: np.ndarray) -> bool:
    """Whether some of the states have few values of a coordinate, as those do that an event's expression fixes."""
    values = states.columns[coordinate][wanted]
    if is_angle(states, coordinate):
        points = np.column_stack([np.cos(values), np.sin(values)])
    else:
        points = values[:, None] / max(np.max(np.abs(values)), np.finfo(float).tiny)
    return 2 * len(np.unique(np.round(points / SAME), axis=0)) <= len(values)


def free_points(section: Section, coordinate: str) -> int:
    """At how many of the events a coordinate is not held."""
    kinds = [section.events == event for event in set(section.events)]
    return sum(np.sum(kind) for kind in kinds if not is_held(section.states, coordinate, kind))


def chosen(sections: list[Section], choice: Choice) -> tuple[str, str]:
    """The two columns: those asked for, or a coordinate and its rate, that which spreads the most points."""
    columns = asked_for(sections[0], choice)
    for section in sections:
        for name in columns:
            if name not in section.states.columns:
                there = ", ".join(section.states.columns)
                raise PlotError(f"{section.name}: expected a column, one of {there}, got {name}")
    return columns


def asked_for(section: Section, choice: Choice) -> tuple[str, str]:
    rates = {coordinate.name: coordinate.rate for coordinate in section.states.coordinates}
    names = choice.coordinates
    if len(names) == 2:
        return names
    if len(names) > 2:
        raise PlotError(f"{section.name}: expected one coordinate or two columns, got {', '.join(names)}")
    if not rates:
        raise PlotError(f"{section.name}: expected a coordinate and its rate among the columns, got none")
    name = names[0] if names else max(rates, key=lambda name: free_points(section, name))
    if name not in rates:
        raise PlotError(f"{section.name}: expected a coordinate, one of {', '.join(rates)}, got {name}")
    return name, rates[name]


def draw(axes: Axes, sections: list[Section], columns: tuple[str, str]) -> None:
    """A colour an event of each file; full points go up, hollow ones down. Angles are within one turn."""
    groups = [(section, event) for section in sections for event in dict.fromkeys(section.events)]
    several = len(sections) > 1
    for (k, (section, event)), direction in product(enumerate(groups), ("up", "down")):
        wanted = (section.events == event) & (section.directions == direction)
        if not wanted.any():
            continue
        colour = COLOURS[(k + 1) % len(COLOURS)]
        axes.plot(
            *(within_turn(section.states.only(wanted), column) for column in columns),
            linestyle="none",
            marker="o",
            markersize=2.5,
            markeredgewidth=0.6,
            color=colour,
            markerfacecolor=colour if direction == "up" else "none",
            label=(f"{section.name}, " if several else "") + f"{event}, {direction}",
        )
    axes.set_xlabel(label(sections[0].states, columns[0]))
    axes.set_ylabel(label(sections[0].states, columns[1]))
    axes.legend(loc="best", fontsize="small")


def of_event(section: Section, event: str) -> Section:
    """Those of one event; of all, where none is named."""
    there = list(dict.fromkeys(section.events))
    if event and event not in there:
        raise PlotError(f"{section.name}: expected an event, one of {', '.join(there)}, got {event}")
    return section.only(section.events == event) if event else section


def figure(sections: list[Section], choice: Choice) -> Figure:
    sections = [of_event(section, choice.event) for section in sections]
    columns = chosen(sections, choice)
    with style():
        drawn = Figure(figsize=(5.4, 4.6), layout="constrained")
        draw(drawn.add_subplot(), sections, columns)
    return drawn
