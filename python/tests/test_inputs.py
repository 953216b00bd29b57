"""Inputs that are tables of numbers over time, and drives that are expressions of it."""

from pathlib import Path

import numpy as np
import pendula
import pytest

CART = pendula.Model("cart_chain", links=1)
TIMES = np.array([0.1, 0.4, 0.9])
PUSHES = np.array([0.0, 2.0, -1.0])
START: dict[str, object] = {"theta_1": 0.3}


def pushed(inputs: object, **more: object) -> pendula.Solution:
    return CART.simulate(1.5, start=START, inputs={"push": inputs}, tolerance=1e-12, interval=0.05, **more)  # type: ignore[arg-type, dict-item]


def test_tables_are_arrays_files_and_mappings(tmp_path: Path) -> None:
    file = tmp_path / "push.csv"
    file.write_text("push,t\n" + "".join(f"{p},{t}\n" for t, p in zip(TIMES, PUSHES, strict=True)))
    run = pushed((TIMES, PUSHES))
    for given in (str(file), file, {"times": TIMES, "values": PUSHES}, {"file": file, "column": "push"}):
        assert np.array_equal(pushed(given).y, run.y)
    assert np.abs(run["push"] - np.interp(run.t, TIMES, PUSHES)).max() < 1e-13  # measured 0
    assert np.array_equal(CART.simulate(1.5, start=START, tolerance=1e-12, interval=0.05)["push"], 0 * run.t)


def test_held_tables_are_what_a_program_holds() -> None:
    run = pushed({"times": TIMES, "values": PUSHES, "hold": True})
    simulation = pendula.Simulation(CART, START, tolerance=1e-12)
    for end, push in zip([*TIMES, 1.5], [0.0, *PUSHES], strict=True):
        simulation.step(end - simulation.time, push=push)
    assert np.abs(run.y[:, -1] - simulation.state).max() < 1e-10  # measured 7.7e-15


def test_derivatives_go_through_knots() -> None:
    """Against differences of motions."""
    cart = pendula.Model("cart_chain", links=1, inputs={"push": (TIMES, PUSHES)})
    options: dict[str, object] = {"stages": 6, "step": 0.02}
    found = pendula.differentiate(cart, t=[1.5], start=START, **options)  # type: ignore[arg-type]

    def ends(shift: float, offset: float) -> np.ndarray:
        shifted = pendula.Model("cart_chain", links=1, inputs={"push": (TIMES, PUSHES + offset)})
        return shifted.simulate(1.5, start={"theta_1": 0.3 + shift}, **options).y[:, -1]  # type: ignore[arg-type]

    by_angle = (ends(1e-4, 0) - ends(-1e-4, 0)) / 2e-4
    by_push = (ends(0, 1e-4) - ends(0, -1e-4)) / 2e-4
    assert np.abs(found.by_start[-1][:, 1] - by_angle).max() < 1e-6  # measured 2.3e-8
    assert np.abs(found.by_inputs["push"][-1][:, 0] - by_push).max() < 1e-6  # measured 2.5e-12


def test_chains_take_tables_of_torques() -> None:
    chain = pendula.Chain(masses=["100 g", 1], lengths="50 cm")
    run = chain.simulate(1.0, theta="20 deg", inputs={"torque_2": ([0, 1], [0, 1])}, interval=0.1)
    assert np.abs(run["torque_2"] - run.t).max() < 1e-15  # measured 0
    with pytest.raises(pendula.InputError, match="expected tables over time of a chain, which has torque"):
        chain.simulate(1.0, theta=0.1, inputs={"torque_2": 1.0})


def test_drives_are_expressions_of_time() -> None:
    cart = pendula.Model("cart_chain", links=1, drives=[{"input": "push", "value": "t < 1 ? 0.5 : 0"}])
    run = cart.simulate(2.0, start=START, interval=0.25)
    assert run["push"].tolist() == [0.5] * 4 + [0.0] * 5


def test_what_is_wrong_is_told() -> None:
    for given, message in (
        (lambda t: t, r"inputs\.push: expected a number, \(times, values\) or a CSV file, got function"),
        ((TIMES,), r"inputs\.push: expected \(times, values\), got 1 of them"),
        (([0, 0], [1, 2]), r"^inputs\.push\.times\[2\]: expected a time after the one before it"),
        (([0, 1], [1]), r"^inputs\.push\.values: expected as many numbers as times has, 2"),
        ("none.csv", r"none\.csv: expected a CSV file that can be read"),
        ("5 cm", r"inputs\.push: expected a finite number or a string in N, got '5 cm'"),
        ({"time": TIMES}, r"inputs\.push: expected some of file, column, times, values, hold, got time"),
    ):
        with pytest.raises(pendula.InputError, match=message):
            pushed(given)
    with pytest.raises(pendula.InputError, match=r"^inputs: expected numbers, got tables over time"):
        pendula.Simulation(pendula.Model("cart_chain", links=1, inputs={"push": (TIMES, PUSHES)}), START)


def test_numbers_may_have_units() -> None:
    cart = pendula.Model("cart_chain", links=1, inputs={"push": "100 mN"})
    assert cart == pendula.Model("cart_chain", links=1, inputs={"push": 100 * 1e-3})
    run = CART.simulate("10 ms", START, inputs={"push": "100 mN"})
    assert run.t[-1] == 10 * 1e-3 and run["push"][-1] == 100 * 1e-3
    over_time = CART.simulate("10 ms", START, inputs={"push": (["0 ms", "20 ms"], ["0 N", "200 mN"])})
    assert over_time["push"][-1] == pytest.approx(0.1, rel=1e-15)


def test_a_motion_is_told_to_be_no_input(tmp_path: Path) -> None:
    (tmp_path / "pulled.py").write_text(
        "def define(model, links):\n"
        "    theta, rope = model.coordinate('theta', 'rad'), model.motion('rope', 'm', default=1.0)\n"
        "    model.lagrangian = rope**2 * model.rate(theta)**2 / 2 - theta**2\n"
    )
    pulled = pendula.Model(tmp_path / "pulled.py")
    for call in (
        lambda: pendula.Model(tmp_path / "pulled.py", inputs={"rope": 2.0}),
        lambda: pulled.simulate(1.0, inputs={"rope": 2.0}),
        lambda: pendula.Simulation(pulled).step(0.1, rope=2.0),
    ):
        with pytest.raises(
            pendula.InputError, match=r'^inputs: expected none, got rope; a motion .* drives=\[\{"input"'
        ):
            call()
