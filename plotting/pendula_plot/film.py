"""Films of runs: frames drawn here, encoded by ffmpeg (mp4, webm) or by Pillow (gif, webp)."""

from __future__ import annotations

import math
import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from .run import PlotError, Run

BACKGROUND, TRACE_OLD, TRACE_NEW = (16, 20, 31), (58, 76, 140), (255, 184, 77)
ROD, BOB, FLOOR, SHADOW = (150, 162, 190), (207, 216, 234), (36, 43, 60), (8, 10, 16)
FIRST_RUN, LAST_RUN = (86, 180, 233), (255, 222, 90)
FINER = 2  # each way; frames are drawn larger and made smaller, which smooths edges
TRACE_SECONDS = 3.0
FFMPEG = {
    ".mp4": ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-crf", "20"],
    ".webm": ["-c:v", "libvpx-vp9", "-pix_fmt", "yuv420p", "-crf", "32", "-b:v", "0"],
}


@dataclass
class Stage:
    """Where points appear: from `right`, `up` and `toward` the eye to pixels."""

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
        """(…, dimension) to (…, 2), y down."""
        seen = (places @ self.axes[:2].T - self.middle) * self.scale
        return np.stack([self.size / 2 + seen[..., 0], self.size / 2 - seen[..., 1]], axis=-1)


@dataclass
class Body:
    """What is drawn of a run: its points at all rows, the origin first where rods begin there."""

    places: np.ndarray  # (rows, points, dimension)
    rods: list[tuple[int, int]]
    radii: np.ndarray  # relative to the picture


def body_of(run: Run) -> Body:
    """Of a chain all rods; of a model those between neighbours, from the origin on, that keep their length."""
    if run.dimension < 2:
        raise PlotError(f"{run.name}: expected points to film, got a run without any")
    bobs = run.positions()
    places = np.concatenate([np.zeros((len(bobs), 1, run.dimension)), bobs], axis=1)
    count = places.shape[1]
    lengths = np.linalg.norm(np.diff(places, axis=1), axis=2)
    keeps = np.ptp(lengths, axis=0) <= 1e-6 * lengths.max(axis=0) + 1e-300
    rods = [(k, k + 1) for k in range(count - 1) if run.is_chain or keeps[k] or (k == 0 and count == 2)]
    masses = run.masses
    relative = np.ones(count - 1) if masses is None else np.cbrt(masses / masses.max())
    largest = min(0.022, 0.6 / count)
    return Body(places, rods, np.maximum(largest * relative, 0.2 * largest))


def rows_at(run: Run, fps: float, seconds: float) -> np.ndarray:
    """The last row before each frame, in real time."""
    end = min(run.time[-1] - run.time[0], seconds)
    frames = run.time[0] + np.arange(max(1, math.floor(end * fps) + 1)) / fps
    return np.clip(np.searchsorted(run.time, frames + 1e-9, side="right") - 1, 0, None)


def colour_between(old: tuple, new: tuple, place: float) -> tuple[int, ...]:
    return tuple(round(a + (b - a) * place) for a, b in zip(old, new, strict=True))


def draw_floor(draw: ImageDraw.ImageDraw, stage: Stage, body: Body, row: int) -> None:
    """A grid under the motion, and the shadow of it that falls straight down."""
    if stage.floor is None:
        return
    reach = float(np.abs(body.places[..., :2]).max()) * 1.05
    for place in np.linspace(-reach, reach, 9):
        for line in ([(-reach, place), (reach, place)], [(place, -reach), (place, reach)]):
            ends = stage.pixels(np.array([[*end, stage.floor] for end in line]))
            draw.line([tuple(end) for end in ends], fill=FLOOR, width=FINER)
    fallen = body.places[row].copy()
    fallen[:, 2] = stage.floor
    pixels = stage.pixels(fallen)
    for first, second in body.rods:
        draw.line([tuple(pixels[first]), tuple(pixels[second])], fill=SHADOW, width=3 * FINER)
    for (x, y), radius in zip(pixels[1:], body.radii * stage.size, strict=True):
        draw.ellipse([x - radius, y - radius / 3, x + radius, y + radius / 3], fill=SHADOW)


def draw_trace(
    draw: ImageDraw.ImageDraw, stage: Stage, body: Body, rows: np.ndarray, ages: np.ndarray
) -> None:
    """The path of the last point, old parts fading."""
    path = stage.pixels(body.places[rows, -1])
    for k in range(1, len(path)):
        fresh = 1 - ages[k] / TRACE_SECONDS
        colour = colour_between(BACKGROUND, colour_between(TRACE_OLD, TRACE_NEW, fresh), min(1, 0.15 + fresh))
        draw.line([tuple(path[k - 1]), tuple(path[k])], fill=colour, width=round((1 + 1.5 * fresh) * FINER))


def draw_body(draw: ImageDraw.ImageDraw, stage: Stage, body: Body, row: int, colour: tuple[int, ...]) -> None:
    """Rods, then bobs, those that are far away first."""
    pixels = stage.pixels(body.places[row])
    width = max(1, min(3, round(120 / len(pixels)))) * FINER
    for first, second in body.rods:
        draw.line([tuple(pixels[first]), tuple(pixels[second])], fill=ROD, width=width)
    order = (
        np.argsort(body.places[row, 1:] @ stage.axes[2])
        if stage.floor is not None
        else range(len(pixels) - 1)
    )
    for k in order:
        x, y = pixels[k + 1]
        radius = body.radii[k] * stage.size
        draw.ellipse([x - radius, y - radius, x + radius, y + radius], fill=colour)
    x, y = pixels[0]
    draw.ellipse([x - 3 * FINER, y - 3 * FINER, x + 3 * FINER, y + 3 * FINER], fill=(255, 255, 255))


def frame(stage: Stage, bodies: list[Body], runs: list[Run], row: int) -> Image.Image:
    """All runs at one row, in colours of their own where they are several; the first one has a trace."""
    image = Image.new("RGB", (stage.size, stage.size), BACKGROUND)
    draw = ImageDraw.Draw(image)
    draw_floor(draw, stage, bodies[0], row)
    time = runs[0].time
    since = int(np.searchsorted(time, time[row] - TRACE_SECONDS))
    rows = np.append(np.arange(since, row, max(1, (row - since) // 240)), row)
    draw_trace(draw, stage, bodies[0], rows, time[row] - time[rows])
    for k in reversed(range(len(bodies))):
        place = k / max(1, len(bodies) - 1)
        draw_body(
            draw,
            stage,
            bodies[k],
            row,
            BOB if len(bodies) == 1 else colour_between(FIRST_RUN, LAST_RUN, place),
        )
    return image.resize((stage.size // FINER, stage.size // FINER), Image.Resampling.LANCZOS)


def frames(runs: list[Run], fps: float, size: int, seconds: float = math.inf) -> Iterator[Image.Image]:
    """Frames in real time, of runs that have the same rows."""
    bodies = [body_of(run) for run in runs]
    rows = rows_at(runs[0], fps, seconds)
    last = int(rows[-1])
    stage = Stage.around(np.concatenate([body.places[: last + 1] for body in bodies]), size * FINER)
    for row in rows:
        yield frame(stage, bodies, runs, int(row))


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


def encode_by_pillow(images: Iterator[Image.Image], path: Path, fps: float) -> None:
    save_frames(list(images), path, fps)


def save_frames(images: list[Image.Image], path: Path, fps: float) -> None:
    first, *rest = images
    # GIF counts in hundredths of a second.
    duration = round(100 / fps) * 10 if path.suffix == ".gif" else round(1000 / fps)
    kept = {"quality": 60, "method": 2} if path.suffix == ".webp" else {"optimize": True}
    try:
        first.save(path, save_all=True, append_images=rest, duration=duration, loop=0, **kept)
    except OSError as error:
        raise PlotError(
            f"{path}: expected a file that can be written, got: {error.strerror or error}"
        ) from None


def write(run: Run, path: Path, fps: float, size: int, seconds: float = math.inf) -> None:
    """Writes a film in the format that its name ends in. Raises PlotError."""
    if path.suffix in FFMPEG:
        encode_by_ffmpeg(frames([run], fps, size, seconds), path, fps, size)
    else:
        encode_by_pillow(frames([run], fps, size, seconds), path, fps)
