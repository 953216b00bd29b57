"""`pendula map`: what is kept of an ensemble over its axes."""

import h5py
import numpy as np
import pytest
from conftest import DOUBLE
from matplotlib.colors import LogNorm
from pendula_plot.map import MapChoice, figure, read
from pendula_plot.run import PlotError
from PIL import Image

AXES = """\
[[event]]
name = "up"
when = "abs(theta_2) - pi"
direction = "up"

[[ensemble.axis]]
key   = "start.theta[1]"
from  = -1.0
to    = 3.0
count = 9

[[ensemble.axis]]
key   = "chain.masses[2]"
from  = -0.1
to    = 2.0
count = 4
"""


@pytest.fixture
def ensemble(pendula, tmp_path):
    (tmp_path / "double.toml").write_text(DOUBLE + AXES)
    assert pendula("ensemble", "double.toml", "-o", "out.h5").returncode == 0
    return tmp_path / "out.h5"


def test_members_are_the_middles_of_cells(ensemble):
    axes, bar = figure(read(ensemble, "energy_error"), MapChoice()).axes
    _, image = axes.images
    with h5py.File(ensemble) as file:
        values = file["energy_error"][...].T
    assert np.array_equal(np.ma.filled(image.get_array(), np.nan), values, equal_nan=True)
    assert image.get_extent() == pytest.approx([-1.25, 3.25, -0.45, 2.35])
    assert axes.get_xlabel() == "$θ_{1}$ [rad]" and axes.get_ylabel() == "masses[2] [kg]"
    assert bar.get_ylabel() == "energy error" and isinstance(image.norm, LogNorm)


def test_those_that_failed_and_those_it_never_happened_to_are_told_apart(ensemble):
    axes, _ = figure(read(ensemble, "event_up"), MapChoice()).axes
    marks, _ = axes.images
    colours = marks.get_array()
    assert len(np.unique(colours[0].reshape(-1, 4), axis=0)) == 1  # a mass below zero: all failed
    assert not np.array_equal(colours[0, 0], colours[1, 0])
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["not within 3 s", "failed"]


def test_how_long_members_were_moved_is_told(pendula, tmp_path):
    (tmp_path / "double.toml").write_text(DOUBLE.replace("duration", "# duration") + AXES)
    for changes, expected in [
        ((), "not within 10 s"),
        (("--set", "run.duration=2.5"), "not within 2.5 s"),
        (
            ("--set", "ensemble.axis[2].key=run.duration", "--set", "ensemble.axis[2].from=1"),
            "not within its duration",
        ),
    ]:
        done = pendula("ensemble", "double.toml", "-o", "out.h5", *changes)
        assert done.returncode == 0, done.stderr
        axes, _ = figure(read(tmp_path / "out.h5", "event:up"), MapChoice()).axes
        assert axes.get_legend().get_texts()[0].get_text() == expected


def test_angles_go_round(ensemble):
    axes, _ = figure(read(ensemble, "theta_2"), MapChoice()).axes
    image = axes.images[1]
    assert image.get_cmap().name == "twilight_shifted"
    assert (image.norm.vmin, image.norm.vmax) == pytest.approx((-np.pi, np.pi))
    assert np.abs(image.get_array().compressed()).max() <= np.pi


def test_a_key_may_be_as_the_scenario_has_it(ensemble):
    assert read(ensemble, "event:up").key == read(ensemble, "event_up").key == "event_up"
    assert read(ensemble, "event:up:count").key == "event_up_count"


def test_files_of_old_are_read(ensemble):
    """Data sets were called as the scenario calls what they keep."""
    now = figure(read(ensemble, "event_up"), MapChoice()).axes
    with h5py.File(ensemble, "a") as file:
        for name in ("event_up", "event_up_count", "start_theta_1", "chain_masses_2"):
            file.move(name, file[name].attrs["long_name"])
        for data in file.values():
            data.attrs.pop("long_name", None)
    old = figure(read(ensemble, "event:up"), MapChoice()).axes
    shown = [np.ma.filled(axes[0].images[1].get_array(), np.nan) for axes in (now, old)]
    assert np.array_equal(*shown, equal_nan=True)
    for axes in range(2):
        assert old[axes].get_xlabel() == now[axes].get_xlabel()
        assert old[axes].get_ylabel() == now[axes].get_ylabel()


def test_a_line_where_another_number_has_a_value(ensemble):
    plain = figure(read(ensemble, "energy_error"), MapChoice())
    lined = figure(read(ensemble, "energy_error", "steps"), MapChoice("linear", 600.0))
    assert len(lined.axes[0].collections) == len(plain.axes[0].collections) + 1


def test_the_command_draws(ensemble, pendula):
    done = pendula("map", "out.h5", "event:up", "-o", "map.png", "--scale", "linear", "--contour", "steps=5")
    assert done.returncode == 0, done.stderr
    assert done.stdout == "picture            map.png\n"
    with Image.open(ensemble.with_name("map.png")) as picture:
        assert min(picture.size) > 900


def test_one_axis_is_a_curve(pendula, tmp_path):
    one = AXES[: AXES.rindex("[[ensemble.axis]]")]
    (tmp_path / "double.toml").write_text(DOUBLE + one)
    assert pendula("ensemble", "double.toml", "-o", "out.h5").returncode == 0
    (axes,) = figure(read(tmp_path / "out.h5", "theta_1"), MapChoice()).axes
    assert axes.get_xlabel() == "$θ_{1}$ [rad]" and len(axes.lines[0].get_xdata()) == 9


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("out.h5", "theta_3", "-o", "map.png"), 'theta_dot_1, theta_dot_2, trusted, got "theta_3"'),
        (("out.h5", "theta_1", "-o", "map.gif"), "expected a name that ends in .svg, .png or .pdf"),
        (("double.toml", "theta_1", "-o", "map.png"), "double.toml: expected a file of pendula ensemble"),
        (("out.h5", "theta_1", "-o", "map.png", "--contour", "steps"), "expected KEY=VALUE"),
        (("none.h5", "theta_1", "-o", "map.png"), "that can be read, got: No such file or directory\n"),
    ],
)
def test_what_cannot_be_drawn_is_told(ensemble, pendula, arguments, message):
    done = pendula("map", *arguments)
    assert done.returncode == 2
    assert message in done.stderr


def test_three_axes_are_too_many(pendula, tmp_path):
    more = AXES + '[[ensemble.axis]]\nkey = "run.duration"\nfrom = 1.0\nto = 2.0\ncount = 2\n'
    (tmp_path / "double.toml").write_text(DOUBLE + more)
    pendula("ensemble", "double.toml", "-o", "out.h5")
    with pytest.raises(PlotError, match="expected one axis or two"):
        figure(read(tmp_path / "out.h5", "theta_1"), MapChoice())
