"""How long the laboratory takes to its first frame, and for a frame, in a browser without a window.

usage: python bench/laboratory.py PENDULA CHROMIUM [--repetitions 5]

PENDULA is the program, CHROMIUM a browser of that kind. Prints medians in ms. A frame's time is what the page itself
takes; the motion is computed beside it, in a worker.
"""

import argparse
import statistics
import subprocess
import tempfile
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

LINKS = (2, 10, 100, 300)
FRAMES = """() => new Promise((done) => {
  const took = [];
  const ask = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (draw) => ask((now) => {
    const began = performance.now();
    draw(now);
    took.push(performance.now() - began);
    if (took.length === 120) done(took);
  });
})"""


def until(page: Page, condition: str) -> None:
    while not page.evaluate(condition):
        page.wait_for_timeout(20)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("chromium")
    parser.add_argument("--repetitions", type=int, default=5)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        file = Path(folder) / "lab.html"
        subprocess.run([given.program.resolve(), "lab", "-o", file], check=True)
        print(f"file: {file.stat().st_size / 1e6:.2f} MB")
        browser = playwright.chromium.launch(
            executable_path=given.chromium, args=["--disable-gpu"], chromium_sandbox=False
        )
        print("links  first frame  own time of a frame")
        for links in LINKS:
            first, frame = [], []
            for _ in range(given.repetitions):
                page = browser.new_page()
                page.goto(f"file://{file}#n={links}&th=1.2")
                until(page, "window.pendulaLab?.shown > 0.2")
                first.append(
                    page.evaluate("performance.getEntriesByName('pendula first frame')[0].startTime")
                )
                frame.append(statistics.median(page.evaluate(FRAMES)))
                page.close()
            print(f"{links:5}  {statistics.median(first):8.0f} ms  {statistics.median(frame):16.2f} ms")


if __name__ == "__main__":
    main()
