"""What a person does with a page, in Chromium, from a file:// address."""

import csv
import io
import itertools
import json
import math
import re

import pytest
from axe_playwright_python.sync_playwright import Axe
from conftest import NARROW, WIDE, until
from playwright.sync_api import Page

PLANAR = ["chaos", "hundred", "thousand", "cart", "no_points", "one_row", "events"]
SPATIAL = ["demo", "three_in_space", "hundred_in_space", "thousand_in_space", "free_point"]
STAGE = "#stage canvas"


def time_of(page: Page) -> float:
    return float(page.input_value("#scrub"))


def picture(page: Page, what: str = STAGE) -> bytes:
    """What is to be seen of an element, once it stands still."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page.locator(what).first.screenshot()


def scrub(page: Page, part: float) -> None:
    page.evaluate(
        """(part) => {
          const scrub = document.getElementById('scrub');
          scrub.value = Number(scrub.min) + part * (scrub.max - scrub.min);
          scrub.dispatchEvent(new Event('input'));
        }""",
        part,
    )


@pytest.mark.parametrize("name", [name for name in PLANAR + SPATIAL if name != "one_row"])
def test_a_page_opens_and_moves(open_page, name):
    page = open_page(name)
    first = picture(page)
    scrub(page, 0.8)
    assert picture(page) != first
    assert page.title() == f"{name} – pendula"


def test_a_run_of_one_row_is_a_still(open_page):
    page = open_page("one_row", motion="no-preference")
    page.keyboard.press("Space")
    page.keyboard.press("ArrowRight")
    assert time_of(page) == 0
    assert page.get_attribute("#play", "aria-label") == "Play"


def test_plays_by_itself_unless_motion_is_unwanted(open_page):
    moving = open_page("cart", motion="no-preference")
    until(moving, "Number(document.getElementById('scrub').value) > 0.2")
    still = open_page("cart", motion="reduce")
    still.wait_for_timeout(300)
    assert time_of(still) == 0


def test_keys_move_time(open_page):
    page = open_page("demo")
    page.keyboard.press("ArrowRight")
    assert time_of(page) == pytest.approx(0.01)
    page.keyboard.press("Shift+ArrowRight")
    assert time_of(page) == pytest.approx(0.11)
    page.keyboard.press("ArrowLeft")
    assert time_of(page) == pytest.approx(0.10)
    page.keyboard.press("End")
    assert time_of(page) == pytest.approx(10)
    page.keyboard.press("Home")
    assert time_of(page) == 0
    page.keyboard.press("Space")
    until(page, "Number(document.getElementById('scrub').value) > 0.1")
    page.keyboard.press("Space")
    paused = time_of(page)
    page.wait_for_timeout(150)
    assert time_of(page) == paused


def test_keys_change_speed_and_loop(open_page):
    page = open_page("cart")
    page.keyboard.press("+")
    assert page.input_value("#speed") == "2"
    page.keyboard.press("-")
    page.keyboard.press("-")
    assert page.input_value("#speed") == "0.5"
    page.keyboard.press("l")
    assert page.get_attribute("#loop", "aria-pressed") == "false"


@pytest.mark.parametrize("loops", [True, False])
def test_at_its_end_a_run_begins_again_or_stays(open_page, loops):
    page = open_page("cart")
    page.select_option("#speed", "8")
    scrub(page, 0.95)
    if not loops:
        page.click("#loop")
    page.click("#play")
    if loops:
        until(page, "Number(document.getElementById('scrub').value) < 6")
    else:
        page.wait_for_selector("#play[aria-label=Play]")
        assert time_of(page) == 12


def test_help_opens_and_closes_by_key(open_page):
    page = open_page("demo")
    page.keyboard.press("?")
    assert page.locator("#help").is_visible()
    assert "Made by pendula" in page.inner_text("#about")
    page.keyboard.press("Escape")
    assert not page.locator("#help").is_visible()


def drag(page: Page, what: str, by: tuple[int, int], **modifiers) -> None:
    box = page.locator(what).first.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down(**modifiers)
    page.mouse.move(x + by[0], y + by[1], steps=4)
    page.mouse.up(**modifiers)


VIEWS = {
    "turned": lambda page: drag(page, STAGE, (120, 40)),
    "moved": lambda page: drag(page, STAGE, (60, 20), button="right"),
    "zoomed": lambda page: (page.hover(STAGE), page.mouse.wheel(0, -400)),
    "turned by key": lambda page: page.keyboard.press("d"),
    "moved by key": lambda page: page.keyboard.press("Shift+W"),
    "zoomed by key": lambda page: page.keyboard.press("e"),
}


@pytest.mark.parametrize("name", ["demo", "cart"])
def test_the_view_changes_and_comes_back(open_page, name):
    page = open_page(name)
    scrub(page, 0.3)
    page.focus(STAGE)
    page.keyboard.press("r")  # from now on the ring of the focus is to be seen
    first = picture(page)
    for what, change in VIEWS.items():
        change(page)
        assert picture(page) != first, what
        page.keyboard.press("r")
        assert picture(page) == first, f"back from {what}"


@pytest.mark.parametrize("name", ["demo", "cart"])
def test_two_fingers_zoom(open_page, name):
    page = open_page(name, NARROW, touch=True)
    first = picture(page)
    box = page.locator(STAGE).bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    session = page.context.new_cdp_session(page)

    def touch(kind: str, *spreads: int) -> None:
        points = [{"x": x + spread, "y": y, "id": k} for k, spread in enumerate(spreads)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    touch("touchStart", -30, 30)
    touch("touchMove", -60, 60)
    touch("touchMove", -80, 80)
    touch("touchEnd")
    assert picture(page) != first


def test_a_plot_moves_the_time(open_page):
    page = open_page("cart")
    drag(page, ".plot", (1, 0))
    assert 4 < time_of(page) < 8


def events_of(page: Page) -> dict[str, dict]:
    """The events of the first run that a page holds, by name."""
    events = page.evaluate("() => JSON.parse(document.getElementById('scene').textContent).runs[0].events")
    return {event["name"]: event for event in events}


def test_keys_and_buttons_lead_to_events(open_page):
    page = open_page("events")
    events = events_of(page)
    times = sorted(time for event in events.values() for time in event["times"])
    for expected in times[:3]:
        page.keyboard.press("n")
        assert time_of(page) == pytest.approx(expected, rel=1e-14)  # which has 15 digits
    page.keyboard.press("p")
    assert time_of(page) == pytest.approx(times[1], rel=1e-14)
    page.click("#events button:has-text('turn')")
    following = next(time for time in events["turn"]["times"] if time > times[1])
    assert time_of(page) == pytest.approx(following, rel=1e-14)
    scrub(page, 1)
    page.keyboard.press("n")
    assert time_of(page) == pytest.approx(times[0], rel=1e-14)  # round over the end


def test_events_are_named_and_counted(open_page):
    page = open_page("events")
    events = events_of(page)
    texts = page.locator("#events button").all_inner_texts()
    assert texts == [f"{event['name']} {event['count']}" for event in events.values()]
    ticks = events["tick"]  # a whole turn of sin(200 t) every 31.4 ms: 636 in 20 s
    assert ticks["count"] == 636
    assert all(ticks["up"])
    assert ticks["times"][10] == pytest.approx(11 * math.pi / 100, abs=1e-9)
    assert {*events["down"]["up"]} == {True, False}
    assert set(events) == {"down", "turn", "tick"}


def test_marks_are_drawn_and_follow_the_theme(open_page):
    page = open_page("events")
    before = picture(page, "#marks")
    page.click("#theme")
    assert picture(page, "#marks") != before
    assert open_page("cart").locator("#marks").is_hidden()


def test_the_size_of_steps_is_shown_where_they_differ(open_page, pages):
    page = open_page("events")
    with (pages.folder / "events.csv").open() as stream:
        t = [float(row["t"]) for row in csv.DictReader(stream)]
    steps = [after - before for before, after in itertools.pairwise(t)]
    text = page.locator(".panel", has_text="Step size").locator(".keys").inner_text()
    least, largest = (float(word) for word in text.replace("−", "-").split() if word[0].isdigit())
    assert least == pytest.approx(min(steps), rel=6e-3)  # three digits are shown
    assert largest == pytest.approx(max(steps), rel=6e-3)
    assert open_page("cart").locator(".panel", has_text="Step size").count() == 0


def test_angles_are_wrapped_or_not(open_page):
    page = open_page("chaos")
    before = picture(page, ".panel:nth-of-type(3)")
    page.click("text=within ±π")
    assert picture(page, ".panel:nth-of-type(3)") != before


def test_links_of_long_chains_are_chosen(open_page):
    page = open_page("hundred")
    keys = page.locator(".panel", has_text="Angles").locator(".keys")
    assert keys.inner_text().split()[:6] == ["θ₁", "θ₂₁", "θ₄₁", "θ₆₀", "θ₈₀", "θ₁₀₀"]
    page.fill("[aria-label='Angles: to number']", "3")
    page.keyboard.press("Enter")
    assert keys.inner_text().split()[:3] == ["θ₁", "θ₂", "θ₃"]


def test_runs_that_differ_by_1e_9_part(open_page):
    """Overlaid at first, apart later; the distances come as doubles, although the copies are floats."""
    page = open_page("chaos")
    described = page.evaluate("() => JSON.parse(document.getElementById('scene').textContent).runs.length")
    assert described == 50
    assert "50 runs" in page.inner_text("#subtitle")
    assert "the other runs: every 2nd of 1001 rows" in page.inner_text("#subtitle")
    least, largest = page.evaluate(
        """() => {
          const run = JSON.parse(document.getElementById('scene').textContent).runs[1];
          const text = document.querySelectorAll('script.run')[1].textContent;
          const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
          const distances = new Float32Array(bytes.buffer.slice(bytes.length - 4 * run.rows));
          return [distances[0], Math.max(...distances)];
        }"""
    )
    assert least == pytest.approx(
        1e-9, rel=1e-6
    )  # measured 1.00000008e-9, a float: 1e-9 rad, one metre from the pivot
    assert largest > 1


def test_the_csv_is_the_trajectory(open_page, pages):
    page = open_page("demo")
    page.click("#open-data")
    page.click("#copy-csv")
    page.wait_for_selector("text=Copied")
    assert page.evaluate("navigator.clipboard.readText()") == (pages.folder / "demo.csv").read_text()


def test_the_csv_of_a_long_chain_says_what_it_is(open_page):
    page = open_page("thousand")
    page.click("#open-data")
    assert "about 7 digits" in page.inner_text("#honesty")
    with page.expect_download() as download:
        page.click("#save-csv")
    header, *rows = csv.reader(io.StringIO(download.value.path().read_text()))
    assert len(header) == 2001 and len(rows) == 101


def test_the_scenario_is_there_to_copy_and_does_not_break_out(open_page):
    page = open_page("demo")
    page.click("#open-data")
    assert "</script><script>window.broken" in page.inner_text("#scenario")
    page.click("#copy-scenario")
    assert "é" in page.evaluate("navigator.clipboard.readText()")
    assert page.evaluate("window.broken") is None


def test_between_rows_rods_keep_their_length_and_motion_is_cubic(browser, pages):
    """The page of every fourth row, asked for the places at the others, against a trajectory that has them."""
    html = (pages.folder / "coarse.html").read_text()
    probe = """window.placesAt = (times) => {
      const motion = new Motion();
      return times.map((time) => [...motion.at(runs[0], time, new Float64Array(12))]);
    };"""
    assert html.count("\nstart();\n") == 1
    (pages.folder / "probe.html").write_text(html.replace("\nstart();\n", f"\n{probe}\n"))
    rows = list(csv.DictReader(io.StringIO((pages.folder / "demo.csv").read_text())))
    page = browser.new_page()
    page.goto(f"file://{pages.folder}/probe.html")
    until(page, "'placesAt' in window")
    found = page.evaluate("(times) => window.placesAt(times)", [float(row["t"]) for row in rows])
    page.close()
    off, stretched = [], []
    for places, row in zip(found, rows, strict=True):
        truth = [float(row[f"{axis}_{link}"]) for link in range(1, 5) for axis in "xyz"]
        off.append(max(abs(a - b) for a, b in zip(places, truth, strict=True)))
        ends = [(0.0, 0.0, 0.0), *zip(*[iter(places)] * 3, strict=True)]
        stretched += [abs(math.dist(a, b) - 1) for a, b in itertools.pairwise(ends)]
    assert max(off[::4]) < 1e-14  # at its own rows; measured 0
    assert max(stretched) < 1e-12  # measured 6e-16
    assert max(off) < 0.1  # of 4 m; measured 0.026
    assert sorted(off)[len(off) // 2] < 1e-3  # measured 2.4e-4


def test_no_names_leak(open_page, pages):
    page = open_page("demo")
    (pages.folder / "blank.html").write_text("<!DOCTYPE html><title>blank</title>")
    blank = page.context.new_page()
    blank.goto(f"file://{pages.folder}/blank.html")
    own = set(blank.evaluate("Object.getOwnPropertyNames(window)"))
    # Elements with an id are to be found on the window in every browser; `painted` is this test's.
    ids = set(page.evaluate("[...document.querySelectorAll('[id]')].map((e) => e.id)"))
    assert set(page.evaluate("Object.getOwnPropertyNames(window)")) - own - ids <= {"painted"}


def test_light_and_dark(open_page):
    def ground(page: Page) -> str:
        return page.evaluate("getComputedStyle(document.body).backgroundColor")

    light, dark = open_page("demo", scheme="light"), open_page("demo", scheme="dark")
    assert ground(light) != ground(dark)
    first = picture(light)
    light.click("#theme")
    assert ground(light) == ground(dark)
    assert picture(light) != first


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("name", ["demo", "chaos", "no_points", "events"])
def test_axe_finds_nothing_serious(open_page, name, scheme):
    page = open_page(name, NARROW if name == "chaos" else WIDE, scheme)
    for opened in (None, "#open-data", "#open-help"):
        if opened:
            page.click(opened)
        found = Axe().run(page).response["violations"]
        assert [f"{each['id']}: {each['help']}" for each in found] == [], opened
        page.keyboard.press("Escape")


def test_controls_have_names(open_page):
    page = open_page("demo")
    for name in ["Play", "One row back", "One row forward", "Loop"]:
        assert page.get_by_role("button", name=name, exact=True).count() == 1
    assert page.get_by_role("slider", name="Time").get_attribute("aria-valuetext") == "0.00 s"
    assert "4 links in space" in page.locator(STAGE).get_attribute("aria-label")
    page.keyboard.press("Space")
    page.keyboard.press("Space")
    assert page.inner_text("#said").startswith("Paused at")


def test_a_page_is_small(pages):
    assert pages.sizes["demo"] <= 1_500_000  # measured 424,000


# What a frame paints: of long chains little more than their balls. A page has some 16 ms for it.
PAINTED = {"demo": 150, "hundred": 50, "hundred_in_space": 250, "thousand": 50, "thousand_in_space": 1200}


@pytest.mark.parametrize("name", PAINTED)
def test_a_frame_paints_little(open_page, name):
    page = open_page(name)
    picture(page)
    page.evaluate("window.painted = 0")
    scrub(page, 0.6)
    picture(page)
    assert 0 < page.evaluate("window.painted") <= PAINTED[name]  # measured 95, 27, 163, 27, 1059


def test_a_page_knows_carts_from_bobs(pages):
    text = (pages.folder / "cart.html").read_text()
    scene = re.search(r'<script type="application/json" id="scene">(.*?)</script>', text, re.DOTALL)[1]
    assert [point[4] for point in json.loads(scene)["points"]] == ["cart", "bob", "bob"]
