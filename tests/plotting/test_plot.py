"""`pendula plot`: what the pictures show, and what is said where there is nothing to show."""

import sys

import numpy as np
import pytest
from conftest import DOUBLE, ROOT
from pendula_plot import motion
from pendula_plot.__main__ import main
from pendula_plot.figure import Choice, figure, symbol
from pendula_plot.motion import trouble
from pendula_plot.run import PlotError, Run, read_run

ALL = ("series", "phase", "energy", "trace")


def test_both_kinds_of_file_are_the_same_run(runs):
    text, binary = read_run(runs / "double.csv"), read_run(runs / "double.h5")
    assert set(text.columns) == set(binary.columns)
    for name, values in text.columns.items():
        assert np.array_equal(values, binary.columns[name]), name
        assert text.unit(name) == binary.unit(name), name
    assert list(binary.masses) == [1.0, 0.5] and text.masses is None


def test_panels_show_the_columns_of_the_run(runs):
    run = read_run(runs / "double.h5")
    series, phase, energy, trace = figure([run], Choice(ALL)).axes
    drawn = motion.finer(run)
    first, second = series.lines
    assert np.array_equal(first.get_ydata(), drawn.columns["theta_1"])
    assert np.array_equal(second.get_ydata(), drawn.columns["theta_2"])
    assert np.array_equal(first.get_ydata()[np.isin(drawn.time, run.time)], run.columns["theta_1"])
    assert [text.get_text() for text in series.get_legend().get_texts()] == ["$θ_{1}$", "$θ_{2}$"]
    assert np.array_equal(phase.lines[0].get_xdata(), drawn.columns["theta_2"])
    assert np.array_equal(phase.lines[0].get_ydata(), drawn.columns["theta_dot_2"])
    assert phase.get_xlabel() == "$θ_{2}$ [rad]" and phase.get_ylabel() == r"$\dot{θ}_{2}$ [rad/s]"
    error = np.abs(run.columns["energy"] - run.columns["energy"][0])[1:]
    assert np.array_equal(np.nan_to_num(energy.lines[0].get_ydata()), error)
    rounding = energy.lines[1].get_ydata()
    assert rounding[-1] == pytest.approx(rounding[0] * np.sqrt(len(rounding)))
    assert energy.get_yscale() == "log" and energy.get_ylabel() == "$|E - E_0|$ [J]"
    assert np.array_equal(trace.lines[0].get_ydata(), drawn.columns["y_2"])


def swing(rows, turns=5.0):
    """A pendulum that swings once a second, with so many rows."""
    t = np.linspace(0, turns, rows)
    theta, rate = np.cos(2 * np.pi * t), -2 * np.pi * np.sin(2 * np.pi * t)
    columns = {"t": t, "theta_1": theta, "theta_dot_1": rate, "x_1": np.sin(theta), "y_1": -np.cos(theta)}
    return Run("swing", columns)


def test_a_legend_tells_that_it_shows_some(runs):
    t = np.linspace(0, 1, 500)
    columns = {name.format(k): np.sin(k * t) for name in ("theta_{}", "theta_dot_{}") for k in range(1, 10)}
    title = figure([Run("whip", {"t": t, **columns})], Choice(("series",))).axes[0].get_legend().get_title()
    assert title.get_text() == "7 of 9"
    few = figure([read_run(runs / "double.h5")], Choice(("series",))).axes[0].get_legend().get_title()
    assert few.get_text() == ""


def test_the_motion_between_rows_is_drawn():
    """As a row a step leaves it: with straight lines the bob would leave its circle by 0.03."""
    series, phase, trace = figure([swing(61)], Choice(("series", "phase", "trace"))).axes
    t, theta = series.lines[0].get_data()
    assert len(t) > 400
    assert np.max(np.abs(theta - np.cos(2 * np.pi * t))) < 5e-4  # measured 1.9e-4
    assert np.max(np.abs(np.hypot(*trace.lines[0].get_data()) - 1)) < 2e-3  # measured 9.0e-4
    theta, rate = phase.lines[0].get_data()
    assert np.max(np.abs(np.hypot(theta, rate / (2 * np.pi)) - 1)) < 5e-3  # measured 2.5e-3
    few = swing(61)
    assert all(np.isin(few.time, t)) and trouble(few) is None  # and rows stay


def test_rows_that_are_close_stay_as_they_are():
    run = swing(1001)
    assert motion.finer(run) is run


def test_a_blow_stays_a_corner():
    """A ball that falls for a second, is thrown up again, and so on."""
    t = np.linspace(0, 4, 399)
    since = np.mod(t, 2.0) - 1
    run = Run("ball", {"t": t, "height": 1 - since**2, "height_dot": -2 * since})
    drawn = motion.finer(run)
    assert np.min(drawn.columns["height"]) >= 0 and trouble(run) is None


def test_rows_that_are_too_few_are_told(tmp_path, monkeypatch, capsys):
    assert trouble(swing(21)).startswith("swing: 21 rows are too few to tell the motion between them")
    few = swing(13).columns
    header = ",".join(few)
    np.savetxt(
        tmp_path / "few.csv", np.column_stack([*few.values()]), "%.17g", ",", header=header, comments=""
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["pendula_plot", "plot", "few.csv", "--output", "few.svg"])
    assert main() == 0
    assert capsys.readouterr().err.startswith("pendula: warning: few.csv: 13 rows are too few")


def test_a_default_run_is_one_that_can_be_drawn(pendula, tmp_path):
    """A single pendulum at all defaults: series take steps of a sixth of a second."""
    single = DOUBLE.replace("[1.0, 0.5]", "1.0\nlinks = 1").replace("[2.5, 3.0]", "2.5")
    (tmp_path / "single.toml").write_text(single.split("[run]")[0])
    assert pendula("simulate", "single.toml", "-o", "single.csv").returncode == 0
    run = read_run(tmp_path / "single.csv")
    places = run.positions()[:, 0]
    middles = (places[1:] + places[:-1]) / 2
    assert len(run.time) == 1001
    off = np.max(np.abs(np.hypot(*middles.T) - 1))  # of the lines that any program would draw
    assert off < 0.01  # measured 4.4e-4


def test_columns_of_one_unit_share_a_panel(runs):
    run = read_run(runs / "space.h5")
    theta, phi = figure([run], Choice(("series",))).axes
    assert (theta.get_ylabel(), phi.get_ylabel()) == ("$θ$ [rad]", "$φ$ [rad]")
    angle, place, rate = figure([run], Choice(("series",), ("theta_1", "x_2", "theta_dot_1", "y_2"))).axes
    assert (angle.get_ylabel(), place.get_ylabel()) == ("$θ_{1}$ [rad]", "$x$, $y$ [m]")
    assert rate.get_ylabel() == r"$\dot{θ}_{1}$ [rad/s]"
    (together,) = figure([run], Choice(("series",), wrapped=True)).axes
    assert len(together.lines) == 4  # within one turn they can be compared


def test_a_phase_portrait_is_of_any_two_columns(runs):
    run = read_run(runs / "double.h5")
    (phase,) = figure([run], Choice(("phase",), phase=("theta_1", "x_2"))).axes
    assert (phase.get_xlabel(), phase.get_ylabel()) == ("$θ_{1}$ [rad]", "$x_{2}$ [m]")
    assert np.array_equal(phase.lines[0].get_ydata()[-1], run.columns["x_2"][-1])
    with pytest.raises(PlotError, match="expected two columns, as in theta_1,theta_dot_1, got x_2"):
        figure([run], Choice(("phase",), phase=("x_2",)))
    with pytest.raises(PlotError, match="got theta_3"):
        figure([run], Choice(("phase",), phase=("x_2", "theta_3")))


def test_energies_are_not_held_against_rounding_where_loads_act(pendula, runs):
    assert pendula("simulate", "double.toml", "--set", "chain.damping=0.1", "-o", "damped.h5").returncode == 0
    (energy,) = figure([read_run(runs / "damped.h5")], Choice(("energy",))).axes
    assert len(energy.lines) == 1 and energy.get_ylabel() == r"$\mathrm{energy}$ [J]"
    assert energy.get_yscale() == "linear"


def test_inputs_are_drawn_like_coordinates(tmp_path):
    """They have no rate: a phase portrait is that of the coordinate."""
    (tmp_path / "cart.csv").write_text("t,x,x_dot,push,energy\n0,1,3,3,0\n1,4,3,6,0\n2,7,3,9,0\n")
    run = read_run(tmp_path / "cart.csv")
    series, phase = figure([run], Choice(("series", "phase"), ("push",))).axes
    assert list(series.lines[0].get_ydata()) == [3, 6, 9]
    assert list(phase.lines[0].get_xdata()) == [1, 4, 7] and list(phase.lines[0].get_ydata()) == [3, 3, 3]


def test_natural_units_are_named(pendula, runs):
    natural = ["--set", 'chain.units="natural"', "--set", "run.duration=1"]
    assert pendula("simulate", "double.toml", *natural, "-o", "natural.h5").returncode == 0
    run = read_run(runs / "natural.h5")
    assert [run.unit(name) for name in ("t", "x_2", "theta_1")] == ["sqrt(l_1/g)", "l_1", "rad"]


def test_space_is_traced_in_space(runs):
    (trace,) = figure([read_run(runs / "space.h5")], Choice(("trace",))).axes
    assert trace.name == "3d" and trace.get_zlabel() == "$z_{2}$ [m]"


def test_several_runs_lie_over_each_other(runs):
    series, *_ = figure(
        [read_run(runs / name) for name in ("double.h5", "space.h5")], Choice(("series",))
    ).axes
    assert [line.get_label().rpartition("/")[2] for line in series.lines] == ["double.h5", "space.h5"]


def test_wrapped_angles_are_cut_where_they_jump(runs):
    run = read_run(runs / "double.h5")
    (series,) = figure([run], Choice(("series",), ("theta_2",), wrapped=True)).axes
    shown, whole = series.lines[0].get_ydata(), motion.finer(run).columns["theta_2"]
    assert np.max(np.abs(whole)) > np.pi and np.isnan(shown).any()
    there = ~np.isnan(shown)
    assert np.max(np.abs(shown[there])) <= np.pi
    assert np.allclose(np.sin(shown[there]), np.sin(whole[there]), atol=1e-12)


def test_steps_are_shown_where_rows_are_steps(pendula, tmp_path):
    (tmp_path / "chosen.toml").write_text(DOUBLE.replace("step     = 5e-3", "tolerance = 1e-8"))
    for every, name in [(1, "steps.h5"), (1, "steps.csv"), (3, "thinned.h5")]:
        simulate = pendula("simulate", "chosen.toml", "--set", f"output.every={every}", "-o", name)
        assert simulate.returncode == 0
    run, text, thinned = (read_run(tmp_path / name) for name in ("steps.h5", "steps.csv", "thinned.h5"))
    assert (run.steps_a_row, text.steps_a_row, thinned.steps_a_row) == (1, None, 3)
    *_, steps = figure([run], Choice()).axes
    values, edges, _ = steps.patches[0].get_data()
    assert np.array_equal(edges, run.time) and np.array_equal(values, np.diff(run.time))
    assert np.max(values) > 2 * np.min(values[:-1])  # measured: 7.7, so that the steps do differ
    assert steps.get_ylabel() == "$t_{k+1} - t_k$ [s]"
    assert len(figure([text], Choice()).axes) == len(figure([thinned], Choice()).axes) == len(ALL)
    assert len(figure([text], Choice(("steps",))).axes) == 1  # asked for
    with pytest.raises(PlotError, match=r"expected a row a step .* to show steps, got rows every 3 steps"):
        figure([thinned], Choice(("steps",)))


def test_steps_that_are_alike_are_shown_when_asked_for(pendula, runs):
    assert pendula("simulate", "double.toml", "--set", "output.every=1", "-o", "each.h5").returncode == 0
    run = read_run(runs / "each.h5")
    assert run.steps_a_row == 1 and len(figure([run], Choice()).axes) == len(ALL)
    (steps,) = figure([run], Choice(("steps",))).axes
    lengths = steps.patches[0].get_data().values
    assert np.allclose(lengths, 5e-3, rtol=1e-12)  # measured: 7e-14, the rounding of t
    plot = pendula("plot", "each.h5", "-o", "steps.svg", "--show", "steps,energy")  # the program passes it on
    assert (plot.returncode, plot.stderr) == (0, "")
    assert (runs / "steps.svg").read_text().count('<g id="axes_') == 2
    at_times = Run("at.h5", {"t": run.time}, scenario="[output]\ninterval = 0.1\n")
    with pytest.raises(PlotError, match="got rows at times"):
        figure([at_times], Choice(("steps",)))


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("theta_1", "$θ_{1}$"),
        ("theta_dot_12", r"$\dot{θ}_{12}$"),
        ("theta_1_dot", r"$\dot{θ}_{1}$"),
        ("x", "$x$"),
        ("lambda_2", "$λ_{2}$"),
    ],
)
def test_names_are_printed_as_in_books(name, printed):
    assert symbol(name) == printed


@pytest.mark.parametrize("ending", ["svg", "png", "pdf"])
def test_pictures_are_written_alike_each_time(ending, runs, pendula):
    begin = {"svg": b"<?xml", "png": b"\x89PNG", "pdf": b"%PDF"}[ending]
    for name in ("a", "b"):
        plot = pendula("plot", "double.h5", "space.h5", "-o", f"{name}.{ending}", "--from", "1", "--to", "2")
        assert (plot.returncode, plot.stderr) == (0, "")
        assert plot.stdout == f"picture            {name}.{ending}\n"
    assert (runs / f"a.{ending}").read_bytes().startswith(begin)
    assert (runs / f"a.{ending}").read_bytes() == (runs / f"b.{ending}").read_bytes()


def test_what_is_wrong_is_told(runs, pendula, monkeypatch, capsys):
    monkeypatch.chdir(runs)
    (runs / "text.csv").write_text("a,b\n1,2\n")
    (runs / "torn.csv").write_text("t,x_1,y_1,energy\n0,1,2,3\n0.1,1,oops,3\n")
    (runs / "bytes.csv").write_bytes(b"\xff\xfe\x00")
    (runs / "header.csv").write_text("t,x_1,y_1,energy\n")
    before = (runs / "double.h5").read_bytes()
    for arguments, expected in [
        (["none.csv"], "none.csv: expected a trajectory that can be read, got: No such file or directory"),
        (["text.csv"], "text.csv: expected a trajectory with columns t, …, got a,b"),
        (["torn.csv"], "torn.csv:3: expected a number in each of the 4 columns"),
        (["bytes.csv"], "bytes.csv: expected a trajectory, CSV or HDF5, got a file that is no text"),
        (["header.csv"], "header.csv: expected rows, got none"),
        (
            ["double.h5", "--from", "5"],
            "double.h5: expected rows between --from and --to, got rows from t = 0 to 3",
        ),
        (
            ["double.h5", "--coordinates", "theta_3"],
            "double.h5: expected a coordinate, one of theta_1, theta_2, or another column, got theta_3",
        ),
        (["double.h5", "--output", "a.bmp"], "a.bmp: expected a name that ends in .svg, .png or .pdf"),
        (
            ["double.h5", "--output", "no/a.svg"],
            "no/a.svg: expected a file that can be written, got: No such file or directory",
        ),
        (
            ["double.h5", "--output", "double.h5"],
            "double.h5: expected a file for the picture, got a run itself",
        ),
    ]:
        output = [] if "--output" in arguments else ["--output", "a.svg"]
        monkeypatch.setattr(sys, "argv", ["pendula_plot", "plot", *arguments, *output])
        assert main() == 2
        assert capsys.readouterr().err == f"pendula: {expected}\n"
    plot = pendula("plot", "none.csv", "-o", "a.svg")  # so through the program
    assert (plot.returncode, plot.stderr.count("\n")) == (2, 1)
    assert (runs / "double.h5").read_bytes() == before
    assert not (runs / "a.svg").exists()


def test_a_row_that_is_just_being_written_is_left_out(runs):
    whole = (runs / "double.csv").read_text()
    (runs / "double.csv").write_text(whole[:-20])
    assert len(read_run(runs / "double.csv").time) == whole.count("\n") - 2


def test_a_missing_python_is_told(runs, pendula):
    plot = pendula("plot", "double.h5", "-o", "a.svg", PENDULA_PYTHON="/none/python")
    assert plot.returncode == 2
    setup = f"which {ROOT}/scripts/setup installs"
    expected = f"pictures take a Python, {setup}; /none/python could not be started (PENDULA_PYTHON names another one)"
    assert plot.stderr == f"pendula: {expected}\n"
