"""`simulate --video` and `pendula gallery`."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
from pendula_plot import animation, shapes
from pendula_plot import film as film_module
from pendula_plot.film import Film, body_of
from pendula_plot.run import Connection, PlotError, Run, read_run
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
FAKE_FFMPEG = """#!/bin/sh
for last; do :; done
echo "$@" > arguments.txt
case $last in file:/*) cat > "${last#file:}" ;; *) exit 1 ;; esac
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
    again = ("--set", "run.duration=0.1", "--video", f"again.{ending}")
    assert f"\nfilm               again.{ending}\n" in pendula("simulate", f"{scenario}.toml", *again).stdout
    frames = frames_of(runs / f"film.{ending}")
    assert len(frames) == 10 and frames[0].shape == (640, 640, 3)
    assert all(np.abs(a - b).max() > 30 for a, b in pairwise(frames))
    assert not list(runs.glob("film.*.h5"))


def test_a_film_is_as_one_asks_for(runs, pendula):
    """Half a second of the motion, half as fast: 21 frames, the first and the last among them."""
    asked = "size=120,fps=20,speed=0.5,from=0.5,to=1"
    film = pendula("simulate", "double.toml", "--video", "film.gif", "--film", asked, "--quiet")
    assert (film.returncode, film.stderr) == (0, "")
    frames = frames_of(runs / "film.gif")
    assert len(frames) == 21 and frames[0].shape == (120, 120, 3)
    assert sum(durations_of(runs / "film.gif")) == 1050
    for wrong in ("size=3", "fast=2", "speed=", "from=2,to=1", ""):
        refused = pendula("simulate", "double.toml", "--video", "film.gif", "--film", wrong)
        assert refused.returncode == 2 and "expected some of size=640" in refused.stderr, wrong


def test_copies_are_in_the_film(runs, pendula):
    copies = ("--copies", 2, "--apart", 0.5, "--set", "run.duration=0.2")
    film = pendula("simulate", "double.toml", "--video", "film.gif", *copies, "--film", "size=200", "--quiet")
    assert (film.returncode, film.stderr) == (0, "")
    (first, *_) = frames_of(runs / "film.gif")
    for colour in (film_module.FIRST_RUN, film_module.LAST_RUN):
        assert np.abs(first - colour).max(axis=2).min() < 8  # measured 0, 3
    assert not list(runs.glob("film.*.h5"))
    alone = pendula("simulate", "double.toml", "--copies", 2)
    assert alone.returncode == 2 and "--copies requires --view or --video" in alone.stderr


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
    (runs / "steps.toml").write_text(scenario)
    limits = ("--set", "run.duration=1", "--set", "run.stages=8", "--set", "output.every=1")
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


@pytest.fixture
def with_ffmpeg(runs) -> str:
    """A path on which there is an ffmpeg, which keeps its arguments and the frames as they are."""
    tools = runs / "tools"
    tools.mkdir()
    (tools / "ffmpeg").write_text(FAKE_FFMPEG)
    (tools / "ffmpeg").chmod(0o755)
    return f"{tools}:{os.environ['PATH']}"


@pytest.mark.parametrize("ending", ["mp4", "webm"])
def test_ffmpeg_gets_every_frame(ending, runs, pendula, with_ffmpeg):
    film = pendula(
        "simulate", "double.toml", "--set", "run.duration=0.2", "--video", f"film.{ending}", PATH=with_ffmpeg
    )
    assert film.returncode == 0, film.stderr
    assert (runs / f"film.{ending}").stat().st_size == 7 * 640 * 640 * 3
    assert re.search(r"-s 640x640 -r 30 -i - .*-pix_fmt yuv420p", (runs / "arguments.txt").read_text())


@pytest.mark.parametrize(
    "name", ["-y.mp4", "tcp:127.0.0.1:9.mp4", "film_%03d.mp4", "a:b|c\nd.webm", "link.mp4"]
)
def test_ffmpeg_takes_a_name_for_that_of_a_file(name, runs, with_ffmpeg, monkeypatch):
    from pendula_plot.film import encode_by_ffmpeg

    monkeypatch.chdir(runs)
    monkeypatch.setenv("PATH", with_ffmpeg)
    (runs / "there").mkdir()
    (runs / "link.mp4").symlink_to("there/real.mp4")
    encode_by_ffmpeg(iter([Image.new("RGB", (64, 64))] * 2), Path(name), 30, 64)
    assert (runs / name).stat().st_size == 2 * 64 * 64 * 3
    assert (runs / "link.mp4").is_symlink() and not list(runs.glob(".film*"))


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
    from pendula_plot.gallery import CASES, STRIP_FILMS

    assert len({case.seconds for case in CASES[:STRIP_FILMS]}) == 1  # those of the strip end at once
    names = {file.stem for file in (ROOT / "examples").glob("*.toml")}
    assert {case.scenario for case in CASES} <= names and len({case.name for case in CASES}) == len(
        CASES
    ) == 17
    listed = (ROOT / "docs/gallery.md").read_text()
    for case in CASES:
        assert (
            f"| {case.title} | {case.text} | [{case.scenario}.toml](../examples/{case.scenario}.toml) |"
            in listed
        )


CART = """\
[system]
model = "cart_chain"
links = 1
[start]
theta_1 = 1.0
[run]
tolerance = 1e-9
duration = 1.0
[output]
interval = 0.02
"""


def pixel(image: Image.Image, place: np.ndarray) -> tuple[int, int, int]:
    """At a place of a canvas, whose y is up."""
    return image.getpixel((round(float(place[0])), image.height - 1 - round(float(place[1]))))


def test_a_film_draws_a_cart_on_its_rail(runs, pendula):
    (runs / "cart.toml").write_text(CART)
    done = pendula("simulate", "cart.toml", "-o", "cart.h5", PENDULA_KERNELS_BY="interpreter")
    assert done.returncode == 0, done.stderr
    run = read_run(runs / "cart.h5")
    assert (run.kinds, run.connections) == (["cart", "bob"], [])
    film = Film([run], 20, 400)
    size = film_module.CART * 400
    for row in (film.rows[0], film.rows[-1]):
        image = film._frame(row)
        middle = film.stage.pixels(film.bodies[0].places[row, 1])
        for side in (-1.4, 1.4):
            assert pixel(image, middle + size * np.array([side, 0.4])) == film_module.BOB
        assert pixel(image, middle - size * np.array([0, 1.02])) == film_module.RAIL
        assert pixel(image, (2, middle[1] - 1.02 * size)) == film_module.RAIL
    assert film.bodies[0].pivots == []  # nothing hangs on the origin
    assert film.bodies[0].rods == [(1, 2)]


def drawn_run(**more) -> Run:
    """A bob that swings on a spring from a wall, beside a pivot that rests in the origin."""
    t = np.linspace(0, 1, 51)
    columns = {"t": t, "pivot_x": 0 * t, "pivot_y": 0 * t, "wall_x": 0 * t - 1, "wall_y": 0 * t}
    columns |= {"bob_x": 0.5 + 0.3 * np.sin(6 * t), "bob_y": 0 * t - 0.2}
    return Run("drawn", columns, **more)


def test_a_film_draws_springs_and_threads():
    kinds = ["pivot", "pivot", "bob"]
    body = body_of(
        drawn_run(
            kinds=kinds,
            connections=[Connection("spring", 1, 2), Connection("thread", -1, 2), Connection("rod", -1, 1)],
        )
    )
    assert body.connections == [Connection("spring", 2, 3), Connection("thread", 0, 3)]
    # From pivot to wall, which keep their distance, none where the spring is, and what the model says.
    assert body.rods == [(1, 2), (0, 2)]
    assert body.pivots == [0, 1, 2]
    plain, sprung = (
        np.asarray(next(Film([run], 20, 400).frames()), dtype=int)
        for run in (drawn_run(), drawn_run(kinds=kinds, connections=[Connection("spring", 1, 2)]))
    )
    rods = [(np.abs(image - film_module.ROD).max(axis=2) < 8) for image in (plain, sprung)]
    heights = [int(rod.any(axis=1).sum()) for rod in rods]
    assert heights[0] < 6 and heights[1] > 30  # pixels; measured 3, 42


def test_forces_of_constraints_are_no_point():
    t = np.linspace(0, 1, 51)
    columns = {"t": t, "bob_x": t, "bob_y": t, "force_loop_x": t, "force_loop_y": t}
    assert [point.name for point in Run("tied", columns).points] == ["bob"]


@pytest.mark.parametrize("length", [1.0, 40.0, 300.0])
def test_a_spring_has_as_many_zigzags_however_long(length):
    path = shapes.spring(np.array([10.0, 20.0]), np.array([10.0, 20.0 + length]), 5.0)
    assert len(path) == 2 * 10 + 3
    assert np.array_equal(path[[0, -1]], [(10, 20), (10, 20 + length)])
    assert np.allclose(np.abs(path[2:-2, 0] - 10), 5) and np.allclose(path[[1, -2], 0], 10)


SLOPES = [((1, 0), 0), ((-2, 0), 0), ((-0.8, -0.6), 37), ((0.8, -0.6), -37), ((0, -1), 90)]


@pytest.mark.parametrize(("along", "angle"), SLOPES)
def test_carts_stand_upright(along, angle):
    axes = shapes.upright(np.array(along, dtype=float))
    assert np.degrees(np.arctan2(axes[0, 1], axes[0, 0])) == pytest.approx(angle, abs=0.2)
    assert axes[1, 1] > -1e-9 and np.allclose(axes @ axes.T, np.eye(2))


def test_films_and_pages_have_the_same_proportions():
    script = (ROOT / "src/view/page/shapes.js").read_text()
    assert (
        json.loads(re.search(r"const proportions = (\{.*?\});", script, re.DOTALL)[1]) == shapes.PROPORTIONS
    )


def test_a_drawing_of_other_points_is_refused(runs, pendula):
    with h5py.File(runs / "double.h5", "a") as file:
        del file["run/drawing"]
        file["run/drawing"] = json.dumps({"kinds": ["bob"], "connections": [["spring", 0, 7]]})
    with pytest.raises(PlotError, match="expected run/drawing of 2 points"):
        read_run(runs / "double.h5")
