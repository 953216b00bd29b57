"""What a solution shows in JupyterLab, in Chromium. By hand: no test installs JupyterLab, which is large."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import Browser, Frame, Page

pytest.importorskip("jupyterlab")

SPACES = ("planar", "spatial")

# The picture as it is seen, and how many colours it has. WebGL keeps it until the frame ends.
PICTURE = """() => new Promise((tell) => requestAnimationFrame(() => {
  const canvas = document.querySelector("#stage canvas");
  const copy = Object.assign(document.createElement("canvas"), { width: canvas.width, height: canvas.height });
  const paper = copy.getContext("2d");
  paper.drawImage(canvas, 0, 0);
  const dots = new Uint32Array(paper.getImageData(0, 0, copy.width, copy.height).data.buffer);
  tell([copy.toDataURL(), new Set(dots).size]);
}))"""


def until(condition: Callable[[], Any], what: str, seconds: float = 60) -> Any:
    end = time.monotonic() + seconds
    while not (value := condition()):
        assert time.monotonic() < end, f"expected within {seconds} s: {what}"
        time.sleep(0.05)
    return value


def code(text: str) -> dict[str, Any]:
    return {
        "cell_type": "code",
        "id": f"cell-{len(text)}",
        "execution_count": None,
        "metadata": {},
        "outputs": [],
        "source": text,
    }


@pytest.fixture
def notebook(tmp_path: Path) -> Path:
    """A run in each space, the last value of a cell each."""
    first, second = (f'pendula.Chain(space="{space}", links=2).simulate(2.0, theta=1.0)' for space in SPACES)
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    text = {
        "cells": [code(f"import pendula\n\n{first}"), code(second)],
        "metadata": {"kernelspec": kernel},
        "nbformat": 4,
        "nbformat_minor": 5,
    }
    (tmp_path / "root").mkdir()
    file = tmp_path / "root" / "runs.ipynb"
    file.write_text(json.dumps(text))
    return file


@pytest.fixture(params=["Light", "Dark"])
def theme(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def server(theme: str, notebook: Path, tmp_path: Path) -> Iterator[str]:
    """The address of JupyterLab, with nothing of the user's and without its news."""
    settings = tmp_path / "settings" / "@jupyterlab" / "apputils-extension"
    settings.mkdir(parents=True)
    (settings / "notification.jupyterlab-settings").write_text(
        '{"fetchNews": "false", "checkForUpdates": false}'
    )
    (settings / "themes.jupyterlab-settings").write_text(f'{{"theme": "JupyterLab {theme}"}}')
    folders = {
        "HOME": "home",
        "IPYTHONDIR": "ipython",
        "JUPYTER_CONFIG_DIR": "config",
        "JUPYTER_DATA_DIR": "data",
        "JUPYTER_RUNTIME_DIR": "runtime",
        "JUPYTERLAB_SETTINGS_DIR": "settings",
        "JUPYTERLAB_WORKSPACES_DIR": "workspaces",
    }
    command = [
        *(sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root"),
        *("--ServerApp.ip=127.0.0.1", "--ServerApp.port=0", "--IdentityProvider.token="),
        f"--ServerApp.root_dir={notebook.parent}",
        "--LabApp.extension_manager=readonly",
    ]
    log = tmp_path / "log"

    def told() -> dict[str, Any] | None:
        assert process.poll() is None, log.read_text()
        for file in (tmp_path / "runtime").glob("jpserver-*.json"):
            if text := file.read_text():
                return json.loads(text)
        return None

    with log.open("w") as lines:
        process = subprocess.Popen(
            command,
            env=os.environ | {name: str(tmp_path / folder) for name, folder in folders.items()},
            stdout=lines,
            stderr=subprocess.STDOUT,
        )
        try:
            yield until(told, "JupyterLab runs")["url"]
        finally:
            process.terminate()  # it ends its kernels
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def run_all(page: Page, address: str) -> None:
    page.goto(address)
    page.locator('.jp-StatusBar-TextItem:has-text("| Idle")').wait_for()
    page.locator('.lm-MenuBar-itemLabel:text-is("Run")').click()
    page.locator('.lm-Menu-itemLabel:text-is("Run All Cells")').click()


def moving(frame: Frame) -> tuple[Any, Any]:
    """Two pictures of what moves, 0.3 s apart."""
    frame.wait_for_selector("#stage canvas")
    until(lambda: frame.evaluate("Number(document.getElementById('scrub').value) > 0.2"), "it moves")
    first = frame.evaluate(PICTURE)
    frame.wait_for_timeout(300)
    return first, frame.evaluate(PICTURE)


def test_a_solution_is_shown_by_jupyterlab(server: str, theme: str, notebook: Path, browser: Browser) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 900}, color_scheme="null")
    wrong: list[str] = []
    hosts: set[str | None] = set()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)
    page.on("request", lambda request: hosts.add(urlsplit(request.url).hostname))
    page.on("websocket", lambda socket: hosts.add(urlsplit(socket.url).hostname))
    run_all(page, f"{server}lab/tree/{notebook.name}")
    for cell, space in enumerate(SPACES):
        outputs = page.locator(".jp-CodeCell").nth(cell).locator(".jp-OutputArea-output")
        element = outputs.locator("iframe")
        element.wait_for(state="attached", timeout=60_000)
        element.scroll_into_view_if_needed()
        assert element.count() == outputs.count() == 1, outputs.all_inner_texts()
        handle = element.element_handle()
        frame = handle and handle.content_frame()
        assert frame
        (first, colours), (second, _) = moving(frame)
        assert colours > {"planar": 100, "spatial": 400}[space]  # measured 390 and 900, none drawn: 1
        assert first != second
        assert frame.evaluate("matchMedia('(prefers-color-scheme: dark)').matches") == (theme == "Dark")
        assert frame.title() == "pendula – pendula"
        # What scrolls is within the page: neither the output nor the frame does.
        assert outputs.evaluate("here => here.scrollHeight <= here.clientHeight")
        assert frame.evaluate("document.documentElement.scrollHeight <= innerHeight")
    page.keyboard.press("Control+s")
    text = until(lambda: "iframe" in (text := notebook.read_text()) and text, "the notebook is saved")
    outputs = [output for cell in json.loads(text)["cells"] for output in cell["outputs"]]
    assert [output["output_type"] for output in outputs] == ["execute_result"] * 2
    assert text.count("<iframe") == 2
    # Measured 661_684: 160_318 of the plane, 446_611 of space, escaped again as JSON.
    assert len(text) < 800_000
    assert wrong == []
    assert hosts - {None} == {urlsplit(server).hostname}
