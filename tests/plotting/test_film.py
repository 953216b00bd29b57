"""`simulate --video` and `pendula gallery`."""

import os
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

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

    examples = Path(__file__).parents[2] / "examples"
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
    from pendula_plot.film import frames
    from pendula_plot.gallery import CASES, runs_of

    (case,) = (case for case in CASES if case.copies)
    case = replace(case, copies=2, seconds=0.2)
    scenario = Path(__file__).parents[2] / f"examples/{case.scenario}.toml"
    copies = runs_of(os.environ["PENDULA_PROGRAM"], scenario, case)
    starts = [run.columns["theta_1"][0] for run in copies]
    assert np.allclose(np.diff(starts), 1e-9, atol=1e-15)
    assert len(list(frames(copies, 20, 100))) == 5


def test_every_case_of_the_gallery_is_an_example():
    from pendula_plot.gallery import CASES

    names = {file.stem for file in (Path(__file__).parents[2] / "examples").glob("*.toml")}
    assert {case.scenario for case in CASES} <= names and len({case.name for case in CASES}) == len(
        CASES
    ) == 12
    listed = (Path(__file__).parents[2] / "docs/gallery.md").read_text()
    for case in CASES:
        assert (
            f"| {case.title} | {case.text} | [{case.scenario}.toml](../examples/{case.scenario}.toml) |"
            in listed
        )
