"""What a solution shows in a notebook, in Chromium without a net."""

import os
import re
import subprocess
import sys
import time
import types
from pathlib import Path

import pendula
import PIL.Image
import pytest
from playwright.sync_api import Browser, Frame


def shown(browser: Browser, html: str) -> tuple[Frame, list[str]]:
    """The iframe in a page with nothing else, and all that went wrong."""
    context = browser.new_context(viewport={"width": 900, "height": 700}, offline=True)
    page = context.new_page()
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda line: wrong.append(line.text) if line.type == "error" else None)
    page.on("request", lambda request: wrong.append(request.url) if request.url.startswith("http") else None)
    page.set_content(f"<!doctype html><title>notebook</title>{html}")
    frame = page.main_frame.child_frames[0]
    frame.wait_for_selector("#stage canvas")
    return frame, wrong


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_solution_shows_its_page(space, browser):
    run = pendula.Chain(space=space, links=2).simulate(2.0, theta=1.0)
    frame, wrong = shown(browser, run._repr_html_())
    end = time.monotonic() + 30
    while not frame.evaluate("Number(document.getElementById('scrub').value) > 0.2"):
        assert time.monotonic() < end, "expected it to move"
        frame.wait_for_timeout(20)
    first = frame.locator("#stage canvas").first.screenshot()
    frame.wait_for_timeout(300)
    assert frame.locator("#stage canvas").first.screenshot() != first
    assert wrong == []


EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.filterwarnings("ignore::pendula.TrustWarning")
@pytest.mark.parametrize("name", ["poincare.toml", "furuta.toml", "spatial_chain.toml"])
def test_the_page_is_that_of_the_program(name, tmp_path):
    few = ["--set", "run.duration=0.5", "--quiet"]
    command = [
        os.environ["PENDULA_PROGRAM"],
        "simulate",
        EXAMPLES / name,
        "--view",
        tmp_path / "theirs.html",
        *few,
    ]
    subprocess.run(command, check=True, stderr=subprocess.DEVNULL)
    run = pendula.Scenario(EXAMPLES / name, {"run.duration": 0.5}).run()
    run.save(tmp_path / "run.h5")
    run.to_html(tmp_path / "ours.html")
    pendula.open(tmp_path / "run.h5").to_html(tmp_path / "opened.html")
    # But for the laboratory, which the program's page of a chain carries.
    carried = rb'<script type="application/json" id="laboratory">.*?</script>|(?<="laboratory":")[^"]*'
    expected = re.sub(carried, b"", (tmp_path / "theirs.html").read_bytes())
    assert (tmp_path / "ours.html").read_bytes() == expected
    assert (tmp_path / "opened.html").read_bytes() == expected


def test_what_takes_long_shows_its_text():
    run = pendula.Chain(links=2).simulate(0.5, theta=1.0)
    run.summary["wall_seconds"] = 60.0
    assert run._repr_html_() is None and "60" not in repr(run)


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_solution_is_animated(space, tmp_path):
    run = pendula.Chain(space=space, links=2).simulate(1.0, theta=1.0)
    animation = run.animate(fps=10, seconds=0.5)
    animation.save(tmp_path / "double.gif", writer="pillow")
    with PIL.Image.open(tmp_path / "double.gif") as film:
        assert film.n_frames == 6
    drawn = animation._fig.axes[0].lines[0]
    last = drawn.get_data_3d() if space == "spatial" else drawn.get_data()
    assert [axis[-1] for axis in last] == [run[name][-1] for name in ("x_2", "y_2", "z_2")[: len(last)]]
    for wrong in ({"fps": 0}, {"seconds": -1}):
        with pytest.raises(pendula.InputError, match=r"animate: expected .* got "):
            run.animate(**wrong)


def test_a_run_of_some_seconds_has_a_bar(monkeypatch):
    told = []

    class Bar:
        def __init__(self, **given):
            self.n, self.given = 0.0, given

        def update(self, more):
            self.n += more
            told.append(self.n)

        def close(self):
            told.append("closed")

    monkeypatch.setitem(sys.modules, "tqdm", types.ModuleType("tqdm"))
    auto = types.ModuleType("tqdm.auto")
    auto.tqdm = Bar
    monkeypatch.setitem(sys.modules, "tqdm.auto", auto)
    long = {"step": 2e-4, "estimate": False, "every": 1000, "method": "rk4"}
    pendula.Chain(links=200).simulate(64.0, theta=1.0, progress=True, **long)
    assert told[-1] == "closed" and len(told) > 3 and told[:-1] == sorted(told[:-1]) and told[-2] <= 64
    told.clear()
    pendula.Chain(links=2).simulate(0.1, theta=1.0, progress=True)
    assert told == []
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    with pytest.raises(
        ImportError, match=r'expected tqdm.auto, which pip install "pendula\[progress\]" brings'
    ):
        pendula.Chain(links=2).simulate(0.1, theta=1.0, progress=True)


def test_a_map_leaves_the_backend_as_it_is(tmp_path):
    """That of notebooks turns interaction on when the first figure chooses it; off, no later figure is shown."""
    (tmp_path / "of_notebooks.py").write_text(
        "import matplotlib\nfrom matplotlib.backends.backend_agg import *\nmatplotlib.interactive(True)\n"
    )
    script = (
        "import matplotlib, pendula\n"
        "data = pendula.ensemble(pendula.Chain(links=1), 0.1, {'theta': ([0.1, 0.2],)})\n"
        "pendula.map(data, 'theta_1')\n"
        "assert matplotlib.get_backend() == 'module://of_notebooks' and matplotlib.is_interactive()\n"
    )
    paths = [str(tmp_path), str(Path(pendula.__file__).parents[1])]
    subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(paths), "MPLBACKEND": "module://of_notebooks"},
        check=True,
    )
