"""Linkages in the laboratory: put together whatever is changed, taken by hand, with copies beside them."""

import math

import pytest
from conftest import await_frame, program, until
from playwright.sync_api import Page
from test_page import COPIES, EXPONENT, coordinates, on_screen, set_slider, shown, swing_and_let_go

# Of the committed models at their defaults: points at the ends of each bar (-1: the origin) and its length.
BARS = {
    "four_bar": [(-1, 1, 0.4), (1, 2, 1.1), (2, 0, 0.8)],
    "slider_crank": [(-1, 0, 0.3), (0, 1, 0.9)],
    "hanging_chain": [(-1, 1, 0.25), *[(k, k + 1, 0.25) for k in range(1, 7)], (7, 0, 0.25)],
    "peaucellier": [(-1, 1, 1), (-1, 2, 1), (0, 3, 0.42), (3, 1, 0.4), (3, 2, 0.4), (4, 1, 0.4), (4, 2, 0.4)],
    "walking_leg": [(-1, 1, 0.15), (1, 2, 0.5), (1, 3, 0.619), (0, 2, 0.415), (5, 6, 0.657), (3, 6, 0.49)],
}
MODELS = list(BARS)


# Points of the stage; of the last row, since what is shown between rows is interpolated; of the last copy.
SHOWN = "pendulaLab.stage.places"
LAST_ROW = """(({ history, size, stage }) => {
  const first = (history.rows - 1) * history.rowSize + 3 + 2 * size;
  const of = (k) => history.numbers[first + 2 * Math.floor(k / 3) + (k % 3) / 2];
  return Array.from({ length: 3 * stage.count }, (_, k) => (k % 3 === 1 ? 0 : of(k)));
})(pendulaLab)"""
LAST_COPY = "pendulaLab.copies.places.subarray(-3 * pendulaLab.stage.count)"


def apart(page: Page, name: str, places: str = SHOWN) -> float:
    """By how much a bar is longer or shorter than it is, at most, m."""
    place = page.evaluate(f"Array.from({places})")
    points = [place[k : k + 3] for k in range(0, len(place), 3)] + [[0, 0, 0]]
    return max(abs(math.dist(points[a], points[b]) - length) for a, b, length in BARS[name])


def settle(page: Page) -> None:
    until(page, "pendulaLab.history.rows > 0 && !pendulaLab.isWaiting && !pendulaLab.isSending")
    await_frame(page)


@pytest.mark.parametrize("name", MODELS)
def test_it_moves_with_copies_and_a_neighbour(name, open_lab):
    """The copies and the neighbour start beside the motion, on the constraints."""
    page = open_lab(f"model={name}&level=all&copies=50&apart=1e-6")
    assert apart(page, name) < 1e-13  # measured 1.2e-15
    page.evaluate("pendulaLab.measure(true)")  # and it plays
    until(page, f"{EXPONENT}.length > 0 && {COPIES}.length > 0 && pendulaLab.copies?.count === 50")
    page.evaluate("pendulaLab.play(false)")
    await_frame(page)
    assert page.is_hidden("#trouble")
    assert apart(page, name, LAST_ROW) < 1e-13  # measured 2.5e-16
    assert apart(page, name, LAST_COPY) < 1e-13  # measured 2.2e-16
    far = page.evaluate(f"Math.hypot(...{LAST_COPY}.map((x, k) => x - {SHOWN}[k]))")
    assert 1e-7 < far < 10


@pytest.mark.parametrize("angle", [100.0, -60.0])
def test_a_start_that_is_set_is_kept(angle, open_lab):
    page = open_lab("model=four_bar&level=all")
    below = coordinates(page)[2]
    set_slider(page, "θ₁", str(angle))
    settle(page)
    assert coordinates(page)[0] == pytest.approx(math.radians(angle), abs=1e-15)
    assert apart(page, "four_bar") < 1e-13  # measured 1.1e-16
    assert coordinates(page) == page.evaluate("pendulaLab.state.q")
    assert abs(coordinates(page)[2] - below) < 1.5  # it has not been put together in the other way


def test_a_start_goes_as_far_as_it_can(open_lab):
    """The rocker of this linkage cannot hang down; where it stops, crank and coupler lie in a line."""
    page = open_lab("model=four_bar&level=all")
    set_slider(page, "θ₃", "-90")
    settle(page)
    theta = coordinates(page)
    assert page.is_hidden("#trouble")
    assert apart(page, "four_bar") < 1e-13  # measured 1.1e-16
    assert abs(math.sin(theta[0] - theta[1])) < 0.05  # measured 0.025


def test_what_cannot_be_put_together_is_said(open_lab):
    page = open_lab("model=four_bar&level=all")
    before = page.evaluate("pendulaLab.state")
    set_slider(page, "From support to support", "5")
    until(page, "!document.getElementById('trouble').hidden")
    said = page.inner_text("#trouble")
    assert said.startswith("It cannot be put together so: ") and "loop_x" in said
    state = page.evaluate("pendulaLab.state")
    assert (state["p"], state["q"]) == (before["p"], before["q"])
    page.evaluate("pendulaLab.play(true)")
    until(page, "pendulaLab.shown > 0.3")
    assert apart(page, "four_bar", LAST_ROW) < 1e-13  # measured 2.5e-16
    set_slider(page, "From support to support", "1.1")
    settle(page)
    assert page.is_hidden("#trouble")
    assert page.evaluate("pendulaLab.state.p.includes(1.1)")


def test_a_page_of_ones_own_begins_closed(open_lab, tmp_path):
    told = program("lab", "walking_leg", "-o", str(tmp_path / "leg.html"))
    assert (told.returncode, told.stderr) == (0, "")
    assert apart(open_lab(file=tmp_path / "leg.html"), "walking_leg") < 1e-13  # measured 5.6e-17


def test_another_parameter_goes_on_from_where_it_is(open_lab):
    page = open_lab("model=walking_leg&level=all&speed=0.25", motion="no-preference")
    until(page, "pendulaLab.shown > 0.1")
    set_slider(page, "Size", "0.0095")
    settle(page)
    until(page, "pendulaLab.shown > 0.3")
    assert page.is_hidden("#trouble")


# A point of each that is taken; where it can go, a circle or a line, and what is nearest there.
TAKEN = {"four_bar": 1, "slider_crank": 0, "hanging_chain": 4, "peaucellier": 4, "walking_leg": 1}
NEAREST = {
    "four_bar": lambda x, y, z: [0.4 * c / math.hypot(x, z) for c in (x, 0, z)],
    "slider_crank": lambda x, y, z: [0.3 * c / math.hypot(x, z) for c in (x, 0, z)],
    "peaucellier": lambda x, y, z: [x, 0, -1],
    "hanging_chain": lambda x, y, z: [x, y, z],
}


@pytest.mark.parametrize("name", MODELS)
def test_it_is_turned_by_hand(name, open_lab):
    page = open_lab(f"model={name}")
    point = str(TAKEN[name])
    x, y = on_screen(page, point)
    page.mouse.move(x, y)
    page.mouse.down()
    until(page, "pendulaLab.hand.isHolding")
    for step in range(1, 9):
        page.mouse.move(x - 5 * step, y + 3 * step)
    until(page, "pendulaLab.hand.isPosed && !pendulaLab.hand.posing")
    await_frame(page)
    assert apart(page, name) < 1e-13  # measured 2.2e-16
    assert math.dist(on_screen(page, point), (x, y)) > 10
    if name in NEAREST:
        wanted, place = page.evaluate(
            f"[pendulaLab.hand.wanted, Array.from({SHOWN}.subarray(3 * {point}, 3 * {point} + 3))]"
        )
        assert (
            math.dist(NEAREST[name](*wanted), place) < 1e-4
        )  # measured 6e-6, less than a hundredth of a pixel
    page.mouse.up()
    until(page, "pendulaLab.history.rows > 0 && !pendulaLab.hand.isPosed && !pendulaLab.isWaiting")
    await_frame(page)
    here = page.evaluate("pendulaLab.state.q")
    page.keyboard.press("Space")
    until(page, "pendulaLab.shown > 0.2")
    assert page.is_hidden("#trouble")
    assert coordinates(page) != here
    assert apart(page, name, LAST_ROW) < 1e-13  # measured 2.5e-16


def test_it_is_thrown(open_lab):
    page = open_lab("model=four_bar&speed=0.03125", motion="no-preference")
    until(page, "pendulaLab.shown > 0")
    x, y = on_screen(page, "1")
    page.mouse.move(x, y)
    page.mouse.down()
    until(page, "pendulaLab.hand.isHolding && pendulaLab.hand.isPosed")
    page.evaluate("pendulaLab.state.speed = 1")
    swing_and_let_go(page, (x, y), 40, "Math.hypot(...pendulaLab.hand.speed) > 0.5")
    until(
        page,
        "!pendulaLab.hand.isPosed && !pendulaLab.isWaiting && pendulaLab.shown > pendulaLab.state.t + 0.1",
    )
    assert page.is_hidden("#trouble")
    assert max(map(abs, page.evaluate("pendulaLab.state.v"))) > 0.1
    assert shown(page) > 0
