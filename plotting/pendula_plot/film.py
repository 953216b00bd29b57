"""Films of runs, written as their frames are drawn: by ffmpeg (mp4, webm), or without it (gif, webp)."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image

from . import animation, motion, shapes
from .canvas import Canvas, Colour
from .run import Connection, PlotError, Run

# What is large has multiples of 4: these colours Pillow finds exactly in a palette.
BACKGROUND, FLOOR, SHADOW, ROD, BOB = (16, 20, 32), (36, 44, 60), (8, 8, 16), (152, 164, 192), (208, 216, 236)
TRACE_OLD, TRACE_NEW, WHITE = (58, 76, 140), (255, 184, 77), (255, 255, 255)
RAIL = (92, 104, 128)
FIRST_RUN, LAST_RUN = (86, 180, 233), (255, 222, 90)
TRACE_SECONDS, TRACE_PIECES = 3.0, 24
CART, SPRING = 0.032, 0.02  # size of a cart, and half the width of a spring, of the picture
SAMPLES = 6
X264_IN_TIME = ["-preset", "veryfast"]
VP9_IN_TIME = ["-deadline", "realtime", "-cpu-used", "5", "-lag-in-frames", "0"]
FFMPEG = {  # in less time than a film takes to see, with few frames in memory
    ".mp4": [
        "-c:v",
        "libx264",
        *X264_IN_TIME,
        "-pix_fmt",
        "yuv420p",
        "-movflags",
        "+faststart",
        "-crf",
        "20",
    ],
    ".webm": ["-c:v", "libvpx-vp9", *VP9_IN_TIME, "-pix_fmt", "yuv420p", "-crf", "32", "-b:v", "0"],
}


@dataclass
class Stage:
    """Where points appear: from `right`, `up` and `toward` the eye to pixels, y up."""

    axes: np.ndarray  # (3, 3), rows right, up, toward
    middle: np.ndarray
    scale: float
    size: int
    floor: float | None

    @staticmethod
    def around(places: np.ndarray, size: int) -> Stage:
        """Everything that the motion comes by, filling the picture."""
        if places.shape[2] == 3:
            azimuth, elevation = math.radians(35), math.radians(14)
            toward = np.array(
                [
                    math.cos(azimuth) * math.cos(elevation),
                    math.sin(azimuth) * math.cos(elevation),
                    math.sin(elevation),
                ]
            )
            right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
            axes = np.array([right, np.cross(toward, right), toward])
            floor = float(places[..., 2].min()) - 0.06 * float(np.ptp(places))
        else:
            axes, floor = np.eye(3)[:, :2], None
        seen = places.reshape(-1, places.shape[2]) @ axes[:2].T
        low, high = seen.min(axis=0), seen.max(axis=0)
        extent = max(float((high - low).max()), 1e-9)
        return Stage(axes, (low + high) / 2, 0.86 * size / extent, size, floor)

    def pixels(self, places: np.ndarray) -> np.ndarray:
        """(…, dimension) to (…, 2)."""
        return (places @ self.axes[:2].T - self.middle) * self.scale + self.size / 2


@dataclass
class Body:
    """What is drawn of a run: its points at all rows, the origin first where rods begin there."""

    places: np.ndarray  # (rows, points, dimension)
    rods: list[tuple[int, int]]
    connections: list[Connection]  # between points of `places`
    kinds: list[str]
    rails: dict[int, np.ndarray]  # of carts: the direction of their rail
    radii: np.ndarray  # relative to the picture

    def of_kind(self, kind: str) -> list[int]:
        return [k for k, each in enumerate(self.kinds) if each == kind]

    @property
    def pivots(self) -> list[int]:
        """Also the origin, where something is fixed to it."""
        held = {end for each in self.connections for end in (each.start, each.end)}
        held.update(end for rod in self.rods for end in rod)
        return [*([0] if 0 in held else []), *self.of_kind("pivot")]


def body_of(run: Run) -> Body:
    """Of a chain all rods; of a model those between neighbours, from the origin on, that keep their length, where
    nothing else is between them, carts are on rails, weights hang on threads and floors lie."""
    if run.dimension < 2:
        raise PlotError(f"{run.name}: expected points to film, got a run without any")
    bobs = run.positions()
    places = np.concatenate([np.zeros((len(bobs), 1, run.dimension)), bobs], axis=1)
    count = places.shape[1]
    lengths = np.linalg.norm(np.diff(places, axis=1), axis=2)
    keeps = np.ptp(lengths, axis=0) <= 1e-6 * lengths.max(axis=0) + 1e-300
    kinds = ["", *(run.kinds or ["bob"] * (count - 1))]
    joints = [Connection(each.kind, each.start + 1, each.end + 1) for each in run.connections]
    joined = {frozenset((each.start, each.end)) for each in joints}

    def is_rod(k: int) -> bool:
        if run.is_chain:
            return True
        if kinds[k + 1] == "cart" or {"weight", "floor"} & {*kinds[k : k + 2]} or {k, k + 1} in joined:
            return False
        if k == 0 and kinds[1] == "pivot" and not np.ptp(places[:, 1], axis=0).any():
            return False
        return bool(keeps[k]) or (k == 0 and count == 2)

    rods = [(k, k + 1) for k in range(count - 1) if is_rod(k)]
    rods += [(each.start, each.end) for each in joints if each.kind == "rod"]
    connections = [each for each in joints if each.kind != "rod"]
    rails = {k: rail_of(places[:, k]) for k, kind in enumerate(kinds) if kind == "cart"}
    masses = run.masses
    relative = np.ones(count - 1) if masses is None else np.cbrt(masses / masses.max())
    largest = min(0.022, 0.6 / count)
    radii = np.maximum(largest * relative, 0.2 * largest)
    return Body(places, rods, connections, kinds, rails, radii)


def rail_of(path: np.ndarray) -> np.ndarray:
    """The direction of the line along which a point moves; level where it rests."""
    way = path - path[0]
    farthest = way[np.argmax(np.linalg.norm(way, axis=1))]
    return farthest if farthest.any() else np.eye(path.shape[1])[0]


def rows_at(run: Run, fps: float, seconds: float) -> np.ndarray:
    """The last row before each frame, in real time."""
    end = min(run.time[-1] - run.time[0], seconds)
    frames = run.time[0] + np.arange(max(1, math.floor(end * fps) + 1)) / fps
    return np.clip(np.searchsorted(run.time, frames + 1e-9, side="right") - 1, 0, None)


def colour_between(old: Colour, new: Colour, place: float) -> Colour:
    return tuple(round(a + (b - a) * place) for a, b in zip(old, new, strict=True))


def trace_strokes() -> list[tuple[Colour, float]]:
    """Colour and width of each piece of the trace, the oldest first."""
    strokes = []
    for fresh in (np.arange(TRACE_PIECES) + 0.5) / TRACE_PIECES:
        colour = colour_between(TRACE_OLD, TRACE_NEW, fresh)
        strokes.append((colour_between(BACKGROUND, colour, min(1, 0.15 + fresh)), 1 + 1.5 * fresh))
    return strokes


TRACE_STROKES = trace_strokes()


def looks(count: int) -> list[tuple[Colour, Colour, float]]:
    """Of each run the colours of its bobs and of its rods, and their part of the full size."""
    if count == 1:
        return [(BOB, ROD, 1.0)]
    colours = [colour_between(FIRST_RUN, LAST_RUN, k / (count - 1)) for k in range(count)]
    return [(colour, colour_between(BACKGROUND, colour, 0.6), 0.6) for colour in colours]


class Film:
    """Runs that have the same rows, in real time; the first has a trace, several have colours of their own."""

    def __init__(self, runs: list[Run], fps: float, size: int, seconds: float = math.inf) -> None:
        self.time = runs[0].time
        self.rows = rows_at(runs[0], fps, seconds)
        self.bodies = [body_of(run) for run in runs]
        self.looks = looks(len(runs))
        seen = [body.places[: self.rows[-1] + 1] for body in self.bodies]
        self.stage = Stage.around(np.concatenate(seen), size)
        self.canvas = Canvas(size, BACKGROUND)
        self._draw_grid()
        self.canvas.keep()

    def frames(self) -> Iterator[Image.Image]:
        return map(self._frame, self.rows)

    def samples(self) -> list[Image.Image]:
        """A few of the frames, which show what colours there are."""
        return [self._frame(row) for row in self.rows[:: max(1, len(self.rows) // SAMPLES)]]

    def still(self) -> Image.Image:
        """The frame in the middle."""
        return self._frame(self.rows[len(self.rows) // 2])

    def _frame(self, row: int) -> Image.Image:
        self.canvas.clear()
        self._draw_shadow(self.bodies[0], row)
        self._draw_trace(self.bodies[0], row)
        for body, look in reversed([*zip(self.bodies, self.looks, strict=True)]):
            self._draw_body(body, row, *look)
        first = self.bodies[0]
        pivots = self.stage.pixels(first.places[row, first.pivots])
        self.canvas.discs(pivots, np.full(len(pivots), 3.0), WHITE)  # where it hangs
        return self.canvas.image()

    def _draw_grid(self) -> None:
        """The floor under the motion."""
        if self.stage.floor is None:
            return
        reach = max(float(np.abs(body.places[..., :2]).max()) for body in self.bodies) * 1.05
        lines = []
        for place in np.linspace(-reach, reach, 9):
            for ends in ([(-reach, place), (reach, place)], [(place, -reach), (place, reach)]):
                lines.append(self.stage.pixels(np.array([[*end, self.stage.floor] for end in ends])))
        self.canvas.lines(lines, FLOOR, 1)

    def _draw_shadow(self, body: Body, row: int) -> None:
        """It falls straight down."""
        if self.stage.floor is None:
            return
        fallen = body.places[row].copy()
        fallen[:, 2] = self.stage.floor
        pixels = self.stage.pixels(fallen)
        lines = [*body.rods, *((each.start, each.end) for each in body.connections)]
        self.canvas.lines([pixels[[*ends]] for ends in lines], SHADOW, 3)
        radii = body.radii[:, None] * self.stage.size * (1, 1 / 3)
        self.canvas.discs(pixels[1:], radii, SHADOW)

    def _draw_trace(self, body: Body, row: int) -> None:
        """The path of the last point, old parts fading: in pieces of one brightness each, the oldest first."""
        ages = np.linspace(TRACE_SECONDS, 0, TRACE_PIECES + 1)
        rows = np.searchsorted(self.time, self.time[row] - ages).clip(max=row)
        for (begin, end), (colour, width) in zip(pairwise(rows), TRACE_STROKES, strict=True):
            if begin < end:
                path = self.stage.pixels(body.places[begin : end + 1, -1])
                self.canvas.lines([path], colour, width)

    def _draw_body(self, body: Body, row: int, bob: Colour, rod: Colour, share: float) -> None:
        """Rails, springs and rods, then carts and bobs; `share` of their full size."""
        pixels = self.stage.pixels(body.places[row])
        width = share * max(1, min(3, round(120 / len(pixels))))
        size = share * CART * self.stage.size
        carts = [(pixels[k], self._rail_axes(along)) for k, along in body.rails.items()]
        for middle, axes in carts:
            self.canvas.lines([shapes.rail(middle, axes, size, 2 * self.stage.size)], RAIL, 2)
        for each in body.connections:
            ends = pixels[[each.start, each.end]]
            is_spring = each.kind == "spring"
            path = shapes.spring(*ends, share * SPRING * self.stage.size) if is_spring else ends
            if each.kind == "pulleys":
                path = shapes.over_pulleys(*ends)
                self.canvas.discs(path[1:], np.full(2, shapes.PROPORTIONS["pulley"] * size), rod)
            self.canvas.lines([path], rod, 2 * share)
        self.canvas.lines([pixels[[*ends]] for ends in body.rods], rod, width)
        for middle, axes in carts:
            self.canvas.polygon(shapes.cart_box(middle, axes, size), bob)
            radius = shapes.PROPORTIONS["wheel"] * size
            self.canvas.discs(shapes.wheels(middle, axes, size), np.full(2, radius), rod)
        for k in body.of_kind("weight"):
            self.canvas.polygon(shapes.weight(pixels[k], size), bob)
        self.canvas.lines([shapes.floor(pixels[k], size) for k in body.of_kind("floor")], RAIL, 2)
        bobs = body.of_kind("bob")
        radii = share * self.stage.size * body.radii[np.array(bobs, dtype=int) - 1]
        self.canvas.discs(pixels[bobs], radii, bob)

    def _rail_axes(self, along: np.ndarray) -> np.ndarray:
        return shapes.upright(self.stage.axes[:2] @ along)


def check(path: Path) -> None:
    """Raises PlotError where a film of that name cannot be made here."""
    if path.suffix not in (*FFMPEG, ".gif", ".webp"):
        raise PlotError(f"{path}: expected a name that ends in .mp4, .webm (by ffmpeg), .gif or .webp")
    if path.suffix in FFMPEG and shutil.which("ffmpeg") is None:
        raise PlotError(f"{path}: expected ffmpeg on this machine, got none; .gif and .webp take no ffmpeg")
    if not path.absolute().parent.is_dir():
        raise PlotError(f"{path}: expected a file that can be written, got: {path.parent}/ does not exist")


def encode_by_ffmpeg(images: Iterator[Image.Image], path: Path, fps: float, size: int) -> None:
    # Under a name of its own, told as that of a file: ffmpeg takes -y.mp4 for an option, tcp:x.mp4 for a server.
    part = path.absolute().with_name(f".film{os.getpid()}{path.suffix}")
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{size}x{size}", "-r", f"{fps:g}", "-i", "-"]
    command = ["ffmpeg", "-y", "-loglevel", "error", *source, *FFMPEG[path.suffix], f"file:{part}"]
    try:
        with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as encoder:
            try:
                for image in images:
                    encoder.stdin.write(image.tobytes())
            except BrokenPipeError:
                pass  # it tells why
            _, complaint = encoder.communicate()
        if encoder.returncode != 0:
            told = " ".join(complaint.decode(errors="replace").split())
            raise PlotError(f"{path}: ffmpeg could not write it: {told}")
        part.replace(path.resolve())
    finally:
        part.unlink(missing_ok=True)


def alike(runs: list[Run], spacing: float) -> list[Run]:
    """Runs with the same rows, close enough for traces; as long as the shortest."""
    if all(len(run.time) == len(runs[0].time) for run in runs) and (
        len(runs[0].time) < 2 or np.max(np.diff(runs[0].time)) <= 1.5 * spacing
    ):
        return runs
    begin, end = max(run.time[0] for run in runs), min(run.time[-1] for run in runs)
    times = np.append(np.arange(begin, end, spacing), end)
    return [motion.at(run, times) for run in runs]


def write(runs: list[Run], path: Path, fps: float, size: int, speed: float = 1) -> None:
    """Writes a film in the format that its name ends in, `speed` times as fast as the motion. Raises PlotError."""
    film = Film(alike(runs, speed / fps / 4), fps / speed, size)
    if path.suffix in FFMPEG:
        encode_by_ffmpeg(film.frames(), path, fps, size)
    else:
        animation.write(film.frames(), path, fps, film.samples())
