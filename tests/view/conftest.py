"""Pages in a real browser: PENDULA_WRITE_PAGES writes them, PENDULA_CHROMIUM opens them."""

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

WIDE, NARROW, SMALL = (1440, 900), (390, 844), (860, 640)

# Counts what is painted on the stage, in strokes, areas and pictures.
PAINT_WATCH = """(() => {
  const pen = CanvasRenderingContext2D.prototype;
  window.painted = 0;
  for (const name of ["stroke", "fill", "drawImage", "fillRect"]) {
    const before = pen[name];
    pen[name] = function (...all) {
      if (this.canvas.parentNode?.id === "stage") ++window.painted;
      return before.apply(this, all);
    };
  }
})()"""


def until(page: Page, condition: str, seconds: float = 30) -> None:
    """Waits for a condition; playwright's own way is what the page's security policy forbids."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, f"expected within {seconds} s: {condition}"
        page.wait_for_timeout(20)


@dataclass
class Pages:
    """The pages of one call of write_pages: where they are, how large each is [bytes]."""

    folder: Path
    sizes: dict[str, int] = field(default_factory=dict)


@pytest.fixture(scope="session")
def pages(tmp_path_factory) -> Pages:
    made = Pages(tmp_path_factory.mktemp("pages"))
    command = [os.environ["PENDULA_WRITE_PAGES"], str(made.folder)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=True)
    assert not done.stderr
    for line in done.stdout.splitlines():
        name, _, _, size, _ = line.split()
        made.sizes[name] = int(size)
    return made


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    """Chromium without a screen."""
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=os.environ["PENDULA_CHROMIUM"], args=["--disable-gpu"], chromium_sandbox=False
        )
        yield chromium
        chromium.close()


@pytest.fixture
def open_page(pages: Pages, browser: Browser) -> Iterator[Callable[..., Page]]:
    """open_page(name, size, scheme, motion) -> a page, loaded and drawn; no error, no request but for itself."""
    contexts, wrong = [], []

    def open_one(name: str, size=SMALL, scheme="light", motion="reduce", touch=False) -> Page:
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]},
            color_scheme=scheme,
            reduced_motion=motion,
            has_touch=touch,
        )
        context.grant_permissions(["clipboard-read", "clipboard-write"])
        contexts.append(context)
        page = context.new_page()
        page.add_init_script(PAINT_WATCH)
        page.on("pageerror", lambda error: wrong.append(f"{name}: {error}"))
        page.on("console", lambda said: _complaint(said) and wrong.append(f"{name}: {said.text}"))
        address = f"file://{pages.folder}/{name}.html"
        page.on(
            "request", lambda request: request.url.startswith(("file:", "http")) and _only(request, address)
        )
        page.goto(address, timeout=120_000)
        until(page, "performance.getEntriesByName('pendula first frame').length === 1")
        return page

    # Warnings of the browser's own, of how fast it can draw here, are not the page's.
    def _complaint(said) -> bool:
        return said.type == "error"

    def _only(request, address: str) -> None:
        if request.url != address:
            wrong.append(f"{address} asks for {request.url}")

    yield open_one
    for context in contexts:
        context.close()
    assert not wrong
