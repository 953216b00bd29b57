"""`Solution.plot`: what it shows, where, and under which names."""

import matplotlib.pyplot as plt
import numpy as np
import pendula
import pytest

SINGLE = pendula.Chain(links=1)


def test_curves_are_the_motion_however_few_the_rows():
    run = SINGLE.simulate(10.0, theta=2.0, every=1)
    assert run.t.size < 100  # steps of series are long
    (line,) = run.plot("x_1").lines
    t, x = line.get_data()
    assert t.size >= 2000
    assert np.abs(x - np.sin(run.sol(t)[0])).max() < 1e-12  # measured 0
    assert np.isin(run.t, t).all()


def test_columns_of_one_unit_share_a_panel():
    run = SINGLE.simulate(1.0, theta=1.0)
    axes = run.plot("theta", "x_1", "y_1")
    assert [panel.get_ylabel() for panel in axes.figure.axes] == ["$θ_{1}$ [rad]", "$x$, $y$ [m]"]
    assert [line.get_label() for line in axes.figure.axes[1].lines] == ["$x_{1}$", "$y_{1}$"]
    assert axes.figure.axes[1].get_xlabel() == "$t$ [s]"
    with pytest.raises(
        pendula.InputError, match="axes: expected columns that share an axis, got theta_1; x_1"
    ):
        run.plot("theta", "x_1", axes=axes)


def test_phi_is_beside_no_other_angle():
    run = pendula.Chain(links=2, space="spatial").simulate(1.0, theta=1.0, phi_dot=1.0)
    labels = [panel.get_ylabel() for panel in run.plot().figure.axes]
    assert labels == ["$θ$ [rad]", "$φ$ [rad]"]


def test_runs_over_each_other_have_names_and_colours():
    axes = SINGLE.simulate(1.0, theta=1.0).plot("theta", label="one")
    assert SINGLE.simulate(1.0, theta=1.1).plot("theta", label="other", axes=axes) is axes
    assert [text.get_text() for text in axes.get_legend().get_texts()] == ["one", "other"]
    assert len({line.get_color() for line in axes.lines}) == 2


def test_default_rows_are_evenly_in_time():
    run = SINGLE.simulate(10.0, theta=1.0)
    assert np.array_equal(run.t, 0.01 * np.arange(1001))
    run = SINGLE.simulate(2 * np.pi, theta=1.0, estimate=False)
    assert run.t[-1] == 2 * np.pi and np.array_equal(run.t[:-1], 0.01 * np.arange(629))
    assert np.array_equal(run.go_on(20.0).t, 0.01 * np.arange(2001))
    steps = SINGLE.simulate(1.0, theta=1.0, every=1)
    assert steps.t.size == steps.nsteps + 1


@pytest.fixture(autouse=True)
def no_figures_left():
    yield
    plt.close("all")
