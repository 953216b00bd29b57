"""The laboratory: its module in node, its page in Chromium."""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Error, Page, sync_playwright

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src/view/lab"
COMMITTED = ROOT / "generated/laboratory.html"
sys.path.insert(0, str(ROOT / "cmake"))
from refresh_lab import module_of  # noqa: E402

SMALL = (1000, 700)


def program(*arguments: str, text: str = "") -> subprocess.CompletedProcess:
    return subprocess.run(
        [os.environ["PENDULA_PROGRAM"], *arguments], input=text, capture_output=True, text=True, timeout=120
    )


def ends_in_module(cases: list[dict]) -> list[dict]:
    """Where the committed module brings motions to."""
    with tempfile.NamedTemporaryFile(suffix=".wasm") as module:
        Path(module.name).write_bytes(module_of(COMMITTED.read_text(encoding="utf-8")))
        done = subprocess.run(
            [os.environ["PENDULA_NODE"], Path(__file__).parent / "ends.js", module.name, SOURCE],
            input=json.dumps(cases),
            capture_output=True,
            text=True,
            timeout=300,
            check=True,
        )
    assert not done.stderr
    return json.loads(done.stdout)


def until(page: Page, condition: str, seconds: float = 45) -> None:
    """Waits for a condition; playwright's own way is what the page's security policy forbids."""

    def holds() -> bool:
        try:
            return bool(page.evaluate(condition))
        except Error as error:  # the page begins again
            assert "navigation" in str(error), error
            return False

    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, f"expected within {seconds} s: {condition}"
        page.wait_for_timeout(20)


def await_frame(page: Page) -> None:
    """Waits until the page has drawn what it knows now."""
    page.evaluate("() => { window.framesThen = pendulaLab.frames; pendulaLab.changed(); }")
    until(page, "pendulaLab.frames > framesThen && !pendulaLab.isSending && !pendulaLab.isWaiting")


def begin_anew(page: Page, act: Callable[[], object]) -> None:
    """Does what makes the page load again, and waits until the new one has begun.

    The old page goes on for a moment with the new link, and would answer for the new one."""
    page.evaluate("window.isOld = true")
    act()
    until(page, "!window.isOld && window.pendulaLab?.history.rows > 0")


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=os.environ["PENDULA_CHROMIUM"], args=["--disable-gpu"], chromium_sandbox=False
        )
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def lab_file(tmp_path_factory) -> Path:
    """The page that `pendula lab -o` writes."""
    file = tmp_path_factory.mktemp("lab") / "lab.html"
    done = program("lab", "-o", str(file))
    assert done.returncode == 0, done.stderr
    assert not done.stderr
    return file


@pytest.fixture
def open_lab(lab_file: Path, browser: Browser) -> Iterator[Callable[..., Page]]:
    """open_lab(link, ...) -> a page that has begun; no error, and no request but for itself."""
    contexts, wrong = [], []

    def open_one(
        link="", size=SMALL, scheme="light", motion="reduce", touch=False, locale="en-GB", file=lab_file
    ) -> Page:
        context = browser.new_context(
            viewport={"width": size[0], "height": size[1]},
            color_scheme=scheme,
            reduced_motion=motion,
            has_touch=touch,
            locale=locale,
        )
        contexts.append(context)
        page = context.new_page()
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("console", lambda said: said.type == "error" and wrong.append(said.text))
        page.on("request", lambda request: _only(request))
        page.goto(f"file://{file}" + (f"#{link}" if link else ""), timeout=120_000)
        until(page, "window.pendulaLab?.history.rows > 0")
        await_frame(page)
        return page

    def _only(request) -> None:
        if request.url.startswith(("http", "ftp")):
            wrong.append(f"asks for {request.url}")

    yield open_one
    for context in contexts:
        context.close()
    assert not wrong
