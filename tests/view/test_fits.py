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


@pytest.mark.parametrize("runs", RUNS)
def test_everything_fits(runs, browser, tmp_path):
    scenario, *options = RUNS[runs]
    command = [os.environ["PENDULA_PROGRAM"], "simulate", ROOT / "examples" / scenario, "--quiet"]
    subprocess.run([*command, "--view", tmp_path / "page.html", *options], check=True)
    with browser.new_page(reduced_motion="reduce") as page:
        look(page, f"file://{tmp_path}/page.html")


@pytest.mark.parametrize("name", ["demo", "chaos", "cart", "no_points", "hundred"])
def test_other_pages_fit(name, browser, pages):
    with browser.new_page(reduced_motion="reduce") as page:
        look(page, f"file://{pages.folder}/{name}.html")
