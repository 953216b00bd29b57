"""The page of a gallery in a real browser."""

import os
import sys
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def index(tmp_path_factory) -> str:
    sys.path.insert(0, str(ROOT / "plotting"))
    from pendula_plot import gallery

    folder = tmp_path_factory.mktemp("gallery")
    gallery.write(folder, ROOT / "examples", os.environ["PENDULA_PROGRAM"], "conical_motion")
    return f"file://{folder}/index.html"


@pytest.mark.parametrize("size", [(390, 844), (1440, 900)])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_opens_fits_and_is_accessible(size, scheme, index, browser):
    context = browser.new_context(viewport={"width": size[0], "height": size[1]}, color_scheme=scheme)
    page = context.new_page()
    wrong = []
    page.on("console", lambda message: wrong.append(message.text))
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("request", lambda request: wrong.extend([] if request.url.startswith("file:") else [request.url]))
    page.goto(index)
    for image in page.locator("img").all():
        image.scroll_into_view_if_needed()
        page.wait_for_timeout(200)
        assert image.evaluate("image => image.complete && image.naturalWidth") == 320
    page.locator("details").first.click()
    assert page.evaluate("document.documentElement.scrollWidth") <= size[0]
    found = Axe().run(page).response["violations"]
    assert [f"{each['id']}: {each['help']}" for each in found] == [] and wrong == []
    context.close()


def test_a_scenario_is_copied_and_a_picture_leads_to_its_page(index, browser):
    context = browser.new_context()
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(index)
    page.locator("summary").first.click()
    page.locator("button").first.click()
    page.wait_for_function("document.querySelector('button').textContent === 'Copied'")
    assert page.evaluate("navigator.clipboard.readText()") == (ROOT / "examples/conical.toml").read_text()
    page.locator("article a").first.click()
    page.wait_for_selector("canvas")
    assert "conical" in page.title()
    context.close()


def test_those_who_want_no_motion_get_stills(index, browser):
    context = browser.new_context(reduced_motion="reduce")
    page = context.new_page()
    page.goto(index)
    page.wait_for_timeout(300)
    assert page.locator("img").first.evaluate("image => image.currentSrc").endswith(".png")
    context.close()
