"""The package as it is imported from the build, beside the program of the same build."""

import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import matplotlib
import pytest
from playwright.sync_api import Browser, sync_playwright

matplotlib.use("Agg")

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if not Path(os.environ.get("PENDULA_CHROMIUM", "")).is_file():
        pytest.skip("Chromium was not found")
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=os.environ["PENDULA_CHROMIUM"],
            args=["--disable-gpu", "--enable-unsafe-swiftshader"],
            chromium_sandbox=False,
        )
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def command_line() -> Callable[..., dict]:
    """Runs `pendula simulate` and gives its summary, and the rows of its file."""

    def run(scenario: Path, rows: Path, *words: str) -> dict:
        done = subprocess.run(
            [os.environ["PENDULA_PROGRAM"], "simulate", scenario, "--json", "-o", rows, *words],
            capture_output=True,
            text=True,
            check=False,
        )
        return json.loads(done.stdout)

    return run


def interrupted(work: Callable[[], object]) -> float:
    """Seconds from Ctrl-C, half a second after work began, to KeyboardInterrupt."""
    pressed = []

    def press() -> None:
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.5, press)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        work()
    timer.join()
    return time.monotonic() - pressed[0]


def ticks_during(work: Callable[[], object]) -> int:
    """How often another thread of Python, which sleeps a millisecond each time, goes on while this one works."""
    ticks = []
    stop = threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    began = time.monotonic()
    work()
    ended = time.monotonic()
    stop.set()
    thread.join()
    return sum(began < at < ended for at in ticks)
