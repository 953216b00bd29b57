"""Linear systems beside a start or an equilibrium."""

import math

import pytest

CART = '[system]\nmodel = "cart_chain"\nlinks = 1\n[start]\ntheta = 3.0\nx = 0.7\n[run]\nduration = 1.0\n'


def test_a_double_pendulum_swings_by_its_two_frequencies(pendula, double):
    run = pendula("linearize", double, "--at", "equilibrium", "--json")
    assert run.status == 0, run.err
    assert run.json["names"] == ["theta_1", "theta_2", "theta_dot_1", "theta_dot_2"]
    assert run.json["state"] == [0, 0, 0, 0]
    found = sorted({round(abs(imaginary), 12) for _, imaginary in run.json["eigenvalues"]})
    wanted = [math.sqrt(9.81 * (2 - math.sqrt(2))), math.sqrt(9.81 * (2 + math.sqrt(2)))]
    assert found == pytest.approx(wanted, rel=1e-12)  # measured 1e-13
    assert [row[:2] for row in run.json["B"]] == [[0, 0], [0, 0], [1, -1], [-1, 2]]


def test_points_are_measured_and_eigenvalues_have_frequencies_and_damping(pendula, double):
    run = pendula("linearize", double, "--at", "equilibrium", "--json")
    assert run.json["outputs"] == ["x_1", "y_1", "x_2", "y_2"]
    assert run.json["C"] == [[1, 0, 0, 0], [0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 0, 0]]
    assert run.json["D"] == [[0, 0]] * 4
    wanted = [math.sqrt(9.81 * (2 + sign * math.sqrt(2))) / (2 * math.pi) for sign in (-1, 1)]
    found = sorted({round(one, 12) for one in run.json["frequencies"]})
    assert found == pytest.approx(wanted, rel=1e-12)  # measured 1e-13
    assert run.json["damping"] == pytest.approx([0] * 4, abs=1e-14)  # measured 2e-16
    damped = pendula("linearize", double, "--at", "equilibrium", "--set", "chain.damping=0.5", "--json").json
    discrete = pendula(
        "linearize", double, "--at", "equilibrium", "--set", "chain.damping=0.5", "--json", "--step", "0.05"
    ).json
    for key in ("frequencies", "damping"):
        assert sorted(discrete[key]) == pytest.approx(sorted(damped[key]), rel=1e-8)  # measured 3e-9
    assert 0.01 < min(damped["damping"]) < max(damped["damping"]) < 1
    text = pendula("linearize", double, "--at", "equilibrium").out
    assert "C, of y = C x" in text and f"{wanted[0]:.6g} Hz" in text


def test_a_step_may_have_a_unit(pendula, double):
    plain, unit = (pendula("linearize", double, "--json", "--step", step).json for step in ("0.01", "10 ms"))
    assert plain == unit and unit["step"] == 0.01
    natural = [
        "linearize",
        double,
        "--json",
        "--set",
        "chain.units=natural",
        "--set",
        "chain.lengths=9.81",
        "--step",
    ]
    assert pendula(*natural, "10 ms").json == pendula(*natural, "0.01").json  # of sqrt(l_1/g), here 1 s
    natural[-2] = "chain.lengths=39.24"
    assert pendula(*natural, "10 ms").json == pendula(*natural, "0.005").json


def test_own_columns_are_measured_unless_they_have_no_slopes(pendula, double):
    columns = 'height = "1 - cos(theta_1)", fast = "theta_dot_2*y_2", all = "2*energy"'
    double.write_text(double.read_text() + f"\n[output]\ncolumns = {{ {columns} }}\n")
    run = pendula("linearize", double, "--json")
    assert run.status == 0, run.err
    assert run.json["outputs"] == ["x_1", "y_1", "x_2", "y_2", "fast", "height"]  # names in order
    theta, other, _, rate = run.json["state"]
    fast, height = run.json["C"][4:]
    assert height == pytest.approx([math.sin(theta), 0, 0, 0], abs=1e-15)  # measured 0
    y = -math.cos(theta) - math.cos(other)
    wanted = [rate * math.sin(theta), rate * math.sin(other), 0, y]
    assert fast == pytest.approx(wanted, abs=1e-14)  # measured 0


def test_the_discrete_system_has_the_exponentials_of_its_eigenvalues(pendula, double):
    continuous, discrete = (
        pendula("linearize", double, "--at", "equilibrium", "--json", *step).json
        for step in ([], ["--step", "0.1"])
    )
    found = sorted(complex(*one).real for one in discrete["eigenvalues"])
    wanted = sorted(math.cos(0.1 * imaginary) for _, imaginary in continuous["eigenvalues"])
    assert found == pytest.approx(wanted, abs=1e-8)  # measured 1e-11: its steps are those of the scenario
    assert discrete["step"] == 0.1


def test_an_equilibrium_is_that_near_the_start_and_leaves_what_does_not_matter(pendula, tmp_path):
    (tmp_path / "cart.toml").write_text(CART)
    run = pendula("linearize", "cart.toml", "--at", "equilibrium", "--json")
    assert run.status == 0, run.err
    assert run.json["state"] == pytest.approx([0.7, math.pi, 0, 0], abs=1e-14)  # measured 0
    assert run.json["inputs"] == ["push"]
    assert max(real for real, _ in run.json["eigenvalues"]) > 1
    text = pendula("linearize", "cart.toml").out
    assert "dx/dt = A x + B u" in text and "theta_1          3" in text


@pytest.mark.parametrize(
    ("arguments", "status", "said"),
    [
        (["--step", "0"], 2, "--step: expected a positive time, got 0"),
        (["--step", "10 mm"], 2, "--step: expected a positive time, got 10 mm"),
        (
            ["--step", "0.1", "--set", "run.method=rk4"],
            2,
            "expected method = gauss or radau in momentum form",
        ),
        (
            ["--at", "equilibrium", "--set", "chain.drive=[{link=1,amplitude=1.0,frequency=1.0}]"],
            2,
            "expected start for a system that changes with time, got equilibrium",
        ),
        (["--set", "chain.links=40"], 2, "expected"),
    ],
)
def test_what_has_none_is_refused(arguments, status, said, pendula, double):
    run = pendula("linearize", double, *arguments)
    assert run.status == status
    assert said in run.err


def test_what_a_signal_adds_to_is_an_input(pendula, tmp_path):
    (tmp_path / "cart.toml").write_text(CART)
    signal = '[[system.signal]]\ninput = "push"\ntimes = [0.0, 1.0]\nvalues = [0.0, 2.0]\n'
    (tmp_path / "pushed.toml").write_text(CART.replace("[start]", f"{signal}[start]"))
    plain, pushed = (pendula("linearize", f"{name}.toml", "--json").json for name in ("cart", "pushed"))
    assert [pushed[key] for key in "ABCD"] == [plain[key] for key in "ABCD"]


def test_where_there_is_no_equilibrium_none_is_told(pendula, tmp_path):
    pushed = CART + '[[system.drive]]\ninput = "push"\nconstant = 5.0\n'
    (tmp_path / "pushed.toml").write_text(pushed)
    run = pendula("linearize", "pushed.toml", "--at", "equilibrium")
    assert run.status == 2
    assert "expected a start near an equilibrium" in run.err


def test_a_constant_torque_moves_the_equilibrium(pendula, double):
    run = pendula("linearize", double, "--set", "chain.torque=[0, 2.0]", "--at", "equilibrium", "--json")
    assert run.status == 0, run.err
    assert run.json["state"][1] == pytest.approx(math.asin(2 / 9.81), rel=1e-14)  # measured 0


def test_a_pole_is_refused(pendula, tmp_path):
    (tmp_path / "pole.toml").write_text(
        '[chain]\nspace = "spatial"\nmasses = [1.0]\nlengths = 1.0\n'
        "[start]\ntheta = 0.0\nphi = 0.0\n[run]\nduration = 1.0\n"
    )
    run = pendula("linearize", "pole.toml")
    assert run.status == 2
    assert "expected a state where the equations are regular" in run.err


def test_rows_and_columns_are_in_the_order_of_names(pendula, tmp_path):
    """Names that interleave: a_1, b_1, a_2 swing by 1, 2 and 3 rad/s."""
    (tmp_path / "several.py").write_text(
        "def define(model, links):\n"
        "    model.lagrangian = 0\n"
        "    for k, name in enumerate(('a_1', 'b_1', 'a_2')):\n"
        "        x = model.coordinate(name, 'm')\n"
        "        model.lagrangian += model.rate(x)**2 / 2 - (k + 1)**2 * x**2 / 2\n"
    )
    (tmp_path / "several.toml").write_text(
        '[system]\nmodel = "several.py"\n[start]\na_1 = 1.0\n[run]\nduration = 1.0\n'
    )
    found = pendula("linearize", "several.toml", "--json").json
    assert found["names"] == ["a_1", "b_1", "a_2", "a_dot_1", "b_dot_1", "a_dot_2"]
    assert found["state"] == [1, 0, 0, 0, 0, 0]
    assert [found["A"][3 + k][k] for k in range(3)] == [-1, -4, -9]


def test_a_linkage_has_the_linear_system_of_its_freedom(pendula, tmp_path):
    """A slider crank with a crank of r = 0.3 m that stands level, its rod along it: all forces are by hand."""
    (tmp_path / "slider.toml").write_text(
        '[system]\nmodel = "slider_crank"\n[start]\nrod = 0.0\ns = 1.2\n[run]\nduration = 1.0\n'
    )
    for arguments in ((), ("--at", "equilibrium")):
        found = pendula(
            "linearize", "slider.toml", "--set", "system.parameters.gravity=0", *arguments, "--json"
        ).json
        assert found["names"] == ["crank", "crank_dot"] and found["state"] == [0, 0]
        # The rod turns by -1/3 of the crank's turn, and its middle moves up by 0.15 of it; the slider rests.
        inertia = 0.05 + 0.5 * 0.15**2 + 0.5 * 0.9**2 / 12 / 9
        assert found["A"] == [[0, 1], [pytest.approx(0, abs=1e-14), 0]]  # measured 0
        assert found["B"] == [[0, 0], [pytest.approx(1 / inertia, rel=1e-14), pytest.approx(0, abs=1e-14)]]
        basis = found["basis"]
        assert basis["names"] == ["crank", "rod", "s", "crank_dot", "rod_dot", "s_dot"]
        assert [row[0] for row in basis["T"][:3]] == pytest.approx([1, -1 / 3, 0], abs=1e-15)
    text = pendula("linearize", "slider.toml").out
    assert "T, of their deviations T x: the constraints leave x free" in text
