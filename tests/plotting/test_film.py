"""`simulate --video` and `pendula gallery`."""

import os
import re
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pendula_plot import animation
from pendula_plot.film import Film
from pendula_plot.run import read_run
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
FAKE_FFMPEG = """#!/bin/sh
for last; do :; done
echo "$@" > arguments.txt
cat > "$last"
"""


def frames_of(file: Path) -> list[np.ndarray]:
    frames = []
    with Image.open(file) as film:
        for k in range(film.n_frames):
            film.seek(k)
            frames.append(np.asarray(film.convert("RGB"), dtype=int))
    return frames


def durations_of(file: Path) -> list[float]:
    """How long each frame stands  [ms]."""
    with Image.open(file) as film:
        durations = []
        for k in range(film.n_frames):
            film.seek(k)
            film.load()
            durations.append(film.info["duration"])
    return durations


@pytest.mark.parametrize("ending", ["webp", "gif"])
@pytest.mark.parametrize("scenario", ["double", "space"])
def test_a_film_moves_in_real_time(scenario, ending, runs, pendula):
    film = pendula(
        "simulate", f"{scenario}.toml", "--set", "run.duration=0.3", "--video", f"film.{ending}", "--quiet"
    )
    assert (film.returncode, film.stdout, film.stderr) == (0, "", "")
    frames = frames_of(runs / f"film.{ending}")
    assert len(frames) == 10 and frames[0].shape == (640, 640, 3)
    assert all(np.abs(a - b).max() > 30 for a, b in pairwise(frames))
    assert not list(runs.glob("film.*.h5"))


@pytest.mark.parametrize("ending", ["webp", "gif"])
@pytest.mark.parametrize("fps", [24, 30, 60])
def test_frames_stand_as_long_as_they_should(ending, fps, tmp_path):
    images = [Image.new("RGB", (8, 8), (k, 0, 0)) for k in range(2 * fps)]
    animation.write(images, tmp_path / f"film.{ending}", fps, images[:1])
    durations = durations_of(tmp_path / f"film.{ending}")
    assert sum(durations) == 2000
    tick = 10 if ending == "gif" else 1
    assert all(abs(duration - 1000 / fps) < tick for duration in durations)


@pytest.mark.parametrize("ending", ["webp", "gif"])
@pytest.mark.parametrize("scenario", ["double", "space"])
def test_what_a_file_shows_is_what_was_drawn(scenario, ending, runs):
    """Of each frame only what has changed is written, in 255 colours."""
    film = Film([read_run(runs / f"{scenario}.h5")], 30, 200, 1.0)
    animation.write(film.frames(), runs / f"film.{ending}", 30, film.samples())
    drawn = [np.asarray(frame, dtype=int) for frame in film.frames()]
    off = np.abs(np.stack(drawn) - np.stack(frames_of(runs / f"film.{ending}"))).max(axis=3)
    assert off.mean() < 0.5  # of 255; measured 0.03, 0.13
    assert np.quantile(off, 0.999) < 12  # measured 6


@pytest.mark.parametrize("ending", ["webp", "gif"])
def test_a_film_of_what_stands_still_is_as_long_as_any(ending, tmp_path):
    images = [Image.new("RGB", (20, 20), (16, 20, 31))] * 10
    animation.write(images, tmp_path / f"film.{ending}", 10, images[:1])
    frames = frames_of(tmp_path / f"film.{ending}")
    assert len(frames) == 10 and sum(durations_of(tmp_path / f"film.{ending}")) == 1000
    assert all(np.array_equal(frames[0], frame) for frame in frames)


@pytest.mark.parametrize("ending", ["webp", "gif", "mp4"])
def test_a_film_takes_little_time_and_memory(ending, runs, pendula):
    """Of ten seconds; ffmpeg is not among what is measured here."""
    assert pendula("simulate", "space.toml", "--set", "run.duration=10", "-o", "ten.h5").returncode == 0
    (runs / "ffmpeg").write_text(FAKE_FFMPEG)
    (runs / "ffmpeg").chmod(0o755)
    command = [sys.executable, "-m", "pendula_plot", "film", "ten.h5", "--output", f"film.{ending}"]
    measured = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024)
"""
    done = subprocess.run(
        [sys.executable, "-c", measured, *command],
        cwd=runs,
        env={**os.environ, "PATH": f"{runs}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT / "plotting")},
        capture_output=True,
        text=True,
        check=True,
    )
    seconds, megabytes = map(float, done.stdout.split())
    print(f"{ending}: {seconds:.1f} s of processor time, {megabytes:.0f} MB")
    assert seconds < 8  # measured 3.3, 1.8, 1.1, where others kept both cores busy
    assert megabytes < 150  # measured 119, 111, 77


def test_frames_do_not_wait_for_rows(runs, pendula):
    """Long steps, and a row each: every frame is another one, and the rows are as without a film."""
    scenario = (runs / "double.toml").read_text().replace("step     = 5e-3", "tolerance = 1e-9")
    (runs / "steps.toml").write_text(scenario.replace("every = 2", ""))
    limits = ("--set", "run.duration=1", "--set", "run.stages=8")
    assert pendula("simulate", "steps.toml", "-o", "alone.csv", *limits).returncode == 0
    film = pendula("simulate", "steps.toml", "-o", "beside.csv", "--video", "film.gif", *limits)
    assert film.returncode == 0, film.stderr
    assert len((runs / "alone.csv").read_text().splitlines()) < 25
    assert (runs / "alone.csv").read_bytes() == (runs / "beside.csv").read_bytes()
    frames = frames_of(runs / "film.gif")
    moved = [int((np.abs(a - b).max(axis=2) > 30).sum()) for a, b in pairwise(frames)]
    assert len(frames) == 31 and min(moved) > 250  # pixels; measured 510


def test_a_film_of_a_run_file_leaves_the_file(runs, pendula):
    film = pendula(
        "simulate", "double.toml", "--set", "run.duration=0.2", "--video", "film.gif", "-o", "kept.h5"
    )
    assert film.returncode == 0 and (runs / "kept.h5").exists() and len(frames_of(runs / "film.gif")) == 7


@pytest.mark.parametrize("ending", ["mp4", "webm"])
def test_ffmpeg_gets_every_frame(ending, runs, pendula):
    tools = runs / "tools"
    tools.mkdir()
    (tools / "ffmpeg").write_text(FAKE_FFMPEG)
    (tools / "ffmpeg").chmod(0o755)
    path = f"{tools}:{os.environ['PATH']}"
    film = pendula(
        "simulate", "double.toml", "--set", "run.duration=0.2", "--video", f"film.{ending}", PATH=path
    )
    assert film.returncode == 0, film.stderr
    assert (runs / f"film.{ending}").stat().st_size == 7 * 640 * 640 * 3
    assert re.search(r"-s 640x640 -r 30 -i - .*-pix_fmt yuv420p", (runs / "arguments.txt").read_text())


def test_what_cannot_be_filmed_is_told_before_the_run(runs, pendula):
    for name, expected in [
        ("film.avi", "film.avi: expected a name that ends in .mp4, .webm (by ffmpeg), .gif or .webp"),
        ("film.mp4", "film.mp4: expected ffmpeg on this machine, got none; .gif and .webp take no ffmpeg"),
        ("no/film.gif", "no/film.gif: expected a file that can be written, got: no/ does not exist"),
    ]:
        film = pendula("simulate", "double.toml", "--video", name, "-o", "out.csv", PATH=str(runs))
        assert (film.returncode, film.stdout, film.stderr) == (2, "", f"pendula: {expected}\n")
    assert not (runs / "out.csv").exists()


def test_a_gallery_has_what_its_page_shows(runs, pendula):
    from pendula_plot import gallery

    examples = ROOT / "examples"
    gallery.write(runs / "gallery", examples, os.environ["PENDULA_PROGRAM"], "conical_motion")
    page = (runs / "gallery/index.html").read_text()
    assert page.count("<article>") == 1
    for name in re.findall(r'(?:src|srcset|href)="([^"]+)"', page):
        assert (runs / "gallery" / name).stat().st_size > 1000, name
    assert (examples / "conical.toml").read_text().splitlines()[5] in page
    assert len(frames_of(runs / "gallery/strip.webp")) == 121


def test_a_page_of_another_kind_is_not_replaced(runs, pendula):
    (runs / "index.html").write_text("<title>mine</title>")
    ended = pendula("gallery", ".")
    expected = "index.html: expected a folder for the gallery, got one with a page of another kind"
    assert (ended.returncode, ended.stderr) == (2, f"pendula: {expected}\n")
    assert (runs / "index.html").read_text() == "<title>mine</title>"


def test_copies_start_apart_and_share_a_picture(runs):
    from pendula_plot.gallery import CASES, runs_of

    (case,) = (case for case in CASES if case.copies)
    case = replace(case, copies=2, seconds=0.2)
    scenario = ROOT / f"examples/{case.scenario}.toml"
    copies = runs_of(os.environ["PENDULA_PROGRAM"], scenario, case)
    starts = [run.columns["theta_1"][0] for run in copies]
    assert np.allclose(np.diff(starts), 1e-9, atol=1e-15)
    assert len(list(Film(copies, 20, 100).frames())) == 5


def test_every_case_of_the_gallery_is_an_example():
    from pendula_plot.gallery import CASES

    names = {file.stem for file in (ROOT / "examples").glob("*.toml")}
    assert {case.scenario for case in CASES} <= names and len({case.name for case in CASES}) == len(
        CASES
    ) == 12
    listed = (ROOT / "docs/gallery.md").read_text()
    for case in CASES:
        assert (
            f"| {case.title} | {case.text} | [{case.scenario}.toml](../examples/{case.scenario}.toml) |"
            in listed
        )
