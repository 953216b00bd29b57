"""On a phone and on screens nothing of a page is cut, and nothing lies on anything else."""

import os
import subprocess
from pathlib import Path

import pytest
from conftest import NARROW, until

ROOT = Path(__file__).resolve().parents[2]
SIZES = [NARROW, (1280, 720), (1440, 900), (1920, 1080)]
# As the program writes them, with few plots and many: of steps, of events, of links to choose from.
RUNS = {
    "1 in the plane": ["triple_pendulum.toml"],
    "3 in the plane": ["double_pendulum.toml", "--copies", "2", "--apart", "5e-9"],
    "50 in the plane": ["double_pendulum.toml", "--copies", "49"],
    "1 in natural units": ["natural_units.toml"],
    "1 with events": ["poincare.toml", "--set", "run.duration=20"],
    "1 with inputs": ["cart_chain.toml", "--set", "run.duration=5"],
    "9 with inputs": ["cart_chain.toml", "--set", "run.duration=5", "--copies", "8"],
    "6 in space": ["whip.toml", "--copies", "5", "--set", "run.duration=1"],
}


def look(page, address: str) -> None:
    """At its last row, in all sizes."""
    page.add_init_script(path=Path(__file__).with_name("fits.js"))
    page.goto(address)
    until(page, "performance.getEntriesByName('pendula first frame').length === 1")
    page.keyboard.press("End")
    wrong = {}
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        wrong[width] = page.evaluate("window.misfits(innerWidth < 820)")
        stage, bar = (page.locator(what).bounding_box() for what in ("#stage", ".bar"))
        assert stage["width"] > 0.5 * width and stage["height"] >= 260
        assert bar["y"] + bar["height"] <= height  # the player is seen without scrolling
    assert wrong == {width: [] for width, _ in SIZES}


def write(folder: Path, scenario: Path, *options: str) -> None:
    command = [os.environ["PENDULA_PROGRAM"], "simulate", scenario, "--quiet"]
    subprocess.run([*command, "--view", folder / "page.html", *options], check=True)


@pytest.mark.parametrize("runs", RUNS)
def test_everything_fits(runs, browser, tmp_path):
    scenario, *options = RUNS[runs]
    write(tmp_path, ROOT / "examples" / scenario, *options)
    with browser.new_page(reduced_motion="reduce") as page:
        look(page, f"file://{tmp_path}/page.html")


# Numbers at upright axes, which stand on canvases, and the plots that they are of.
TICKS = """(() => {
  const pen = CanvasRenderingContext2D.prototype;
  const before = pen.fillText;
  window.ticks = [];
  pen.fillText = function (text, ...place) {
    const panel = this.canvas.closest(".panel");
    if (panel && this.textAlign === "right") window.ticks.push([panel.querySelector("h2").textContent, text]);
    return before.call(this, text, ...place);
  };
})()"""
AT_REST = """[system]
model = "swinging_atwood"
parameters = { mu = 1.0 }
[start]
r = 1.0
theta = 1e-17
[run]
duration = 5
"""


def test_axes_of_what_rests_are_not_those_of_rounding(browser, tmp_path):
    (tmp_path / "rest.toml").write_text(AT_REST)
    write(tmp_path, tmp_path / "rest.toml")
    with browser.new_page(reduced_motion="reduce", viewport={"width": 1280, "height": 720}) as page:
        page.add_init_script(TICKS)
        page.goto(f"file://{tmp_path}/page.html")
        until(page, "performance.getEntriesByName('pendula first frame').length === 1")
        ticks = page.evaluate("ticks")
    assert len(ticks) > 6 and not [tick for tick in ticks if "e−" in tick[1]]


def test_upright_axes_have_three_numbers(browser, tmp_path):
    """Where six plots stand beside a low stage, too: a phase portrait had a zero alone."""
    write(tmp_path, ROOT / "examples/cart_chain.toml", "--set", "run.duration=5", "--copies", "8")
    with browser.new_page(reduced_motion="reduce", viewport={"width": 1280, "height": 720}) as page:
        page.add_init_script(TICKS)
        page.goto(f"file://{tmp_path}/page.html")
        until(page, "performance.getEntriesByName('pendula first frame').length === 1")
        found = page.evaluate("ticks")
        assert page.inner_text("#legend") == "start x + 8e-09 m"
        assert "of the others" not in page.inner_text("#subtitle")
        headings = page.locator(".panel h2").all_inner_texts()
    assert headings == [
        "Distance from the first run",
        "Change of energy",
        "Step size",
        "Inputs",
        "Coordinates",
        "Phase portrait",
    ]
    for heading in headings:
        assert len({text for plot, text in found if plot == heading and text != "s"}) >= 3, heading


@pytest.mark.parametrize("name", ["demo", "chaos", "cart", "no_points", "hundred"])
def test_other_pages_fit(name, browser, pages):
    with browser.new_page(reduced_motion="reduce") as page:
        look(page, f"file://{pages.folder}/{name}.html")
