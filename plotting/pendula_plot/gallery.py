"""A page of striking motions: each with a small film, a page to look at it closely, and its scenario to copy."""

from __future__ import annotations

import html
import shlex
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from PIL import Image

from . import animation
from .film import Film
from .run import PlotError, Run, read_run

FPS, SIZE = 20, 320
STRIP_FILMS, STRIP_SIZE = 4, 240
ROWS_A_FRAME = 4  # for the traces
ABREAST = 2  # cases that are made at once: of one the program runs while the other is drawn
TITLE = "<title>pendula: a gallery</title>"


@dataclass(frozen=True)
class Case:
    """One motion; `scenario` is its file among the examples without its ending."""

    scenario: str
    title: str
    text: str
    seconds: float = 6
    copies: int = 0  # further runs, each with a start that is 1e-9 away from the last

    @property
    def name(self) -> str:
        """Of its files."""
        return self.title.lower().replace(" ", "_").replace("'", "")


CASES = (
    Case(
        "triple_pendulum", "Triple pendulum", "Three links let go from above: chaos that never settles.", 10
    ),
    Case(
        "triple_pendulum",
        "Fifty copies",
        "Each starts 10⁻⁹ rad from the next: they are one until chaos parts them.",
        10,
        49,
    ),
    Case("whip", "Whip in space", "Thirty links that get lighter: the end outruns everything before it.", 10),
    Case("rope", "Rope of 200 links", "Let go almost level, it curls, cracks and swings back.", 10),
    Case("conical", "Conical motion", "Three links turn around the vertical as one, nearly."),
    Case("spherical_pendulum", "Precession", "A spherical pendulum: its ellipse turns."),
    Case("driven_chain", "Kapitza's pendulum", "Shaken fast enough, it stands on its head."),
    Case(
        "swinging_atwood",
        "Swinging Atwood machine",
        "A counterweight of three times the bob: the ratio without chaos.",
    ),
    Case("spring_pendulum", "Spring pendulum", "A bob on a spring, in space, bounces and swings at once.", 8),
    Case("furuta", "Furuta pendulum", "A motor at the arm swings the rod beyond the level.", 10),
    Case(
        "driven_damped",
        "Driven and damped",
        "Friction in every joint, a push in rhythm: energy comes and goes.",
    ),
    Case(
        "four_bar",
        "Four-bar linkage",
        "Three bars in a loop: the crank turns over, the rocker to and fro.",
    ),
    Case("walking_leg", "Walking leg", "Jansen's linkage: a crank turns, and a foot walks."),
    Case("peaucellier", "Straight line", "Peaucellier's linkage swings, and its tracer stays on a line."),
    Case(
        "slider_crank",
        "Slider crank",
        "A motor turns the crank faster and faster, friction holds the slider.",
        10,
    ),
    Case("hanging_chain", "Hanging chain", "Eight rods between two hooks, let go from one side."),
    Case("cart_chain", "Cart", "Two links on a cart that a force pushes to and fro."),
)


def settings(seconds: float) -> list[str]:
    """Rows at the frames and between them, as long as the film."""
    interval = 1 / (FPS * ROWS_A_FRAME)
    return ["--set", f"output.interval={interval}", "--set", f"run.duration={seconds}"]


def starts(scenario: Path, copies: int) -> list[list[str]]:
    """Settings for the first angle of each run."""
    if copies == 0:
        return [[]]
    first, *others = tomllib.loads(scenario.read_text(encoding="utf-8"))["start"]["theta"]
    return [["--set", f"start.theta={[first + k * 1e-9, *others]}"] for k in range(copies + 1)]


def simulate(program: str, scenario: Path, arguments: list[str]) -> None:
    command = [program, "simulate", str(scenario), "--quiet", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise PlotError(f"{shlex.join(command)}: {done.stderr.strip()}")


def runs_of(program: str, scenario: Path, case: Case) -> list[Run]:
    with tempfile.TemporaryDirectory() as folder:
        rows = Path(folder) / "rows.h5"
        runs = []
        for start in starts(scenario, case.copies):
            simulate(program, scenario, [*settings(case.seconds), *start, "-o", str(rows)])
            runs.append(read_run(rows))
    return runs


def make(program: str, scenario: Path, case: Case, folder: Path) -> list[Run]:
    """The film, a still of it, and the page of one case; gives its runs."""
    print(f"{case.title} …", file=sys.stderr, flush=True)
    runs = runs_of(program, scenario, case)
    film = Film(runs, FPS, SIZE)
    film.still().save(folder / f"{case.name}.png", optimize=True)
    animation.write(film.frames(), folder / f"{case.name}.webp", FPS, film.samples())
    copies = ["--copies", str(case.copies)] if case.copies else []
    simulate(program, scenario, ["--view", str(folder / f"{case.name}.html"), *copies])
    return runs


def write_strip(films: list[Film], path: Path) -> None:
    """Films side by side, as long as the shortest: none stands still."""
    samples = [join(images) for images in zip(*(film.samples() for film in films), strict=False)]
    animation.write(map(join, zip(*(film.frames() for film in films), strict=False)), path, FPS, samples)


def join(images: Sequence[Image.Image]) -> Image.Image:
    joined = Image.new("RGB", (sum(image.width for image in images), images[0].height))
    for k, image in enumerate(images):
        joined.paste(image, (sum(other.width for other in images[:k]), 0))
    return joined


def card(case: Case, scenario: str) -> str:
    name, title, text = case.name, html.escape(case.title), html.escape(case.text)
    return f"""<article>
<a href="{name}.html"><picture><source srcset="{name}.png" media="(prefers-reduced-motion: reduce)">
<img src="{name}.webp" width="{SIZE}" height="{SIZE}" loading="lazy" alt="{title}, moving"></picture></a>
<h2><a href="{name}.html">{title}</a></h2>
<p>{text}</p>
<details><summary>{case.scenario}.toml</summary>
<button type="button">Copy</button>
<pre tabindex="0" aria-label="{case.scenario}.toml">{html.escape(scenario)}</pre></details>
</article>
"""


def write(folder: Path, scenarios: Path, program: str, only: str = "") -> None:
    """Writes the gallery into a folder, which is made where it is not there. Raises PlotError.

    index.html has a card for each case; strip.webp shows the first ones side by side.
    """
    cases = [case for case in CASES if not only or case.name in only.split(",")]
    template = (Path(__file__).parent / "gallery.html").read_text(encoding="utf-8")
    index = folder / "index.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if index.exists() and TITLE not in index.read_text(encoding="utf-8", errors="replace"):
            raise PlotError(
                f"{index}: expected a folder for the gallery, got one with a page of another kind"
            )
        files = [scenarios / f"{case.scenario}.toml" for case in cases]
        with ThreadPoolExecutor(ABREAST) as pool:
            made = pool.map(lambda case, file: make(program, file, case, folder), cases, files)
            strip = [Film(runs, FPS, STRIP_SIZE) for runs in islice(made, STRIP_FILMS)]
            write_strip(strip, folder / "strip.webp")
            list(made)  # raises what went wrong
        texts = [file.read_text(encoding="utf-8") for file in files]
        cards = [card(case, text) for case, text in zip(cases, texts, strict=True)]
        index.write_text(template.replace("<!-- cards -->", "".join(cards)), encoding="utf-8")
    except OSError as error:
        raise PlotError(
            f"{error.filename or folder}: expected a file that can be written, got: {error.strerror}"
        ) from None
    print(f"{index} is the gallery; open it in a browser")
