"""Pictures of damaged files: drawn, or told in one line; tests/campaign/damages.py draws more."""

import os
import sys
import time
import warnings

import pytest
from damage import damaged, draws
from pendula_plot import drawing
from pendula_plot import map as ensemble_map
from pendula_plot.__main__ import main
from pendula_plot.errors import PlotError, told_of_numbers
from pendula_plot.figure import Choice, write
from pendula_plot.film import Film
from pendula_plot.run import read_run

MAP = """
[[ensemble.axis]]
key = "start.theta[1]"
from = -1.0
to = 1.0
count = 5

[[ensemble.axis]]
key = "start.theta[2]"
from = -1.0
to = 1.0
count = 4
"""


def plot(file):
    write(drawing.draw([drawing.read(file)], Choice()), file.with_name("out.svg"))


def draw_map(file):
    write(
        ensemble_map.figure(ensemble_map.read(file, "energy_error"), ensemble_map.MapChoice()),
        file.with_name("out.svg"),
    )


def film(file):
    next(Film([read_run(file)], 30, 64).frames())


def kinds(folder, pendula):
    """Files of each kind, and what draws them."""
    (folder / "map.toml").write_text((folder / "double.toml").read_text() + MAP)
    assert pendula("ensemble", "map.toml", "-o", "map.h5").returncode == 0
    events = ["name,t,direction,x,x_dot", *(f"down,{k},up,{k / 3},{1 / k}" for k in range(1, 9))]
    (folder / "events.csv").write_text("\n".join([*events, ""]))
    shows = {"double.h5": plot, "space.h5": film, "double.csv": plot, "events.csv": plot, "map.h5": draw_map}
    return [(name, (folder / name).read_bytes(), show) for name, show in shows.items()]


def test_it_is_drawn_or_told_in_one_line(runs, pendula):
    for name, whole, show in kinds(runs, pendula):
        file = runs / f"damaged-{name}"
        for number, draw in draws(5):
            file.write_bytes(damaged(draw, whole))
            began = time.monotonic()
            try:
                with told_of_numbers(name), warnings.catch_warnings(action="ignore"):
                    show(file)
            except PlotError as error:
                assert "\n" not in str(error), (name, number)
            assert time.monotonic() - began < 20, (name, number)  # 4 measured, beside other work


def column(header: str, *rows: str) -> str:
    return "\n".join([header, *rows, ""])


EXTREMES = {
    "too large": column("t,x,x_dot", "0,1,1", "1,1.7e308,2", "2,-1.7e308,1"),
    "too late": column("t,x,x_dot", "0,1,1", "1.7e308,1,2"),
    "exponents": column("t,lambda_1", "1,1.7e308", "2,-1.7e308"),
    "no exponents": column("t,lambda_1", "1,nan", "2,nan"),
    "events": column("name,t,direction,x,x_dot", "a,1,up,1,2", "b,2,down,1.7e308,3"),
    "time alone": column("t", "0", "1"),
    "names": column("t,$x^,$x^_dot", "0,1,1"),
    "not a number": column("t,x,x_dot", "0,1,1", "1,one,1"),
}


def told(monkeypatch, capsys, *arguments):
    """What the package says of a command line that is wrong."""
    monkeypatch.setattr(sys, "argv", ["pendula_plot", *map(str, arguments)])
    assert main() == 2
    return capsys.readouterr().err


@pytest.mark.parametrize("name", EXTREMES)
def test_what_no_picture_can_show_is_told(name, tmp_path, monkeypatch, capsys):
    (tmp_path / "run.csv").write_text(EXTREMES[name])
    line = told(monkeypatch, capsys, "plot", tmp_path / "run.csv", "--output", tmp_path / "out.svg")
    assert line.startswith(f"pendula: {tmp_path}/run.csv") and line.count("\n") == 1


def test_only_files_are_read(tmp_path, monkeypatch, capsys):
    pipe = tmp_path / "pipe.h5"
    os.mkfifo(pipe)
    for name in (pipe, "/dev/zero"):
        for command in (["plot", name], ["map", name, "steps"]):
            line = told(monkeypatch, capsys, *command, "--output", tmp_path / "out.svg")
            assert line.endswith(", got neither a file nor a link to one\n")


def test_modules_of_the_working_folder_are_not_run(runs, pendula):
    """Nor those of PYTHONPATH, nor what a matplotlibrc there asks for."""
    for name in ("h5py", "numpy", "matplotlib", "pendula_plot", "PIL", "tomllib", "runpy", "usercustomize"):
        (runs / f"{name}.py").write_text("raise SystemExit('it ran')\n")
    (runs / "matplotlibrc").write_text("text.usetex: True\nbackend: module://pendula_plot\n")
    ended = pendula("plot", "double.h5", "-o", "out.svg", "--show", "energy", PYTHONPATH=str(runs))
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "picture            out.svg\n", "")
    assert "</svg>" in (runs / "out.svg").read_text()
