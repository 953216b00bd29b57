"""Environments of Gymnasium: its own checks, seeds, members, and derivatives against differences."""

import copy
import doctest
import runpy
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pendula
import pytest

gymnasium = pytest.importorskip("gymnasium")
import pendula.envs  # noqa: E402
from gymnasium.utils.env_checker import check_env, data_equivalence  # noqa: E402
from pendula.envs import Acrobot, AcrobotVectorEnv, CartPendulum, CartPendulumVectorEnv  # noqa: E402

KINDS = {"CartPendulum": (CartPendulum, CartPendulumVectorEnv), "Acrobot": (Acrobot, AcrobotVectorEnv)}


def actions_of(env: Any, count: int) -> list[Any]:
    env.action_space.seed(5)
    return [env.action_space.sample() for _ in range(count)]


@pytest.mark.parametrize("dtype", [np.float64, np.float32])
@pytest.mark.parametrize("task", ["swing_up", "balance"])
@pytest.mark.parametrize("name", KINDS)
def test_gymnasium_finds_nothing_wrong(name: str, task: str, dtype: Any) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(f"pendula/{name}-v0", links=2, task=task, dtype=dtype)
        check_env(env.unwrapped)
        assert env.reset(seed=1)[0].dtype == dtype
        assert gymnasium.make_vec(f"pendula/{name}-v0", num_envs=2).reset(seed=1)[0].shape[0] == 2


@pytest.mark.parametrize("name", KINDS)
def test_a_seed_and_a_copy_give_the_same_to_the_bit(name: str) -> None:
    def rows(env: Any) -> list[Any]:
        return [env.step(action)[4]["state"] for action in actions_of(env, 50)]

    env = KINDS[name][0](links=2)
    first = env.reset(seed=3)[0]
    twin = copy.deepcopy(env)
    moved = rows(env)
    assert np.array_equal(moved, rows(twin))
    again = KINDS[name][0](links=2)
    assert np.array_equal(first, again.reset(seed=3)[0]) and np.array_equal(moved, rows(again))
    assert not np.array_equal(first, again.reset(seed=4)[0])


@pytest.mark.parametrize("mode", ["NextStep", "SameStep", "Disabled"])
@pytest.mark.parametrize(("name", "count"), [("CartPendulum", 5), ("Acrobot", 8)])
def test_members_are_single_environments_to_the_bit(name: str, count: int, mode: str) -> None:
    single, many = KINDS[name]
    # Some fall before the time is over, some do not.
    given = {"links": 2, "task": "balance", **({"force": 10.0} if name == "CartPendulum" else {})}
    alone = gymnasium.vector.SyncVectorEnv(
        [lambda: gymnasium.wrappers.TimeLimit(single(**given), 35)] * count, autoreset_mode=mode
    )
    together = many(count, max_episode_steps=35, autoreset_mode=mode, **given)
    assert data_equivalence(alone.reset(seed=7), together.reset(seed=7), exact=True)
    ended = np.zeros(2, int)
    for action in actions_of(alone, 80):
        wanted, got = alone.step(action), together.step(action)
        assert data_equivalence(wanted, got, exact=True)
        ended += [got[2].sum(), got[3].sum()]
        over = got[2] | got[3]
        if mode == "Disabled" and over.any():
            with pytest.raises(pendula.InputError, match="expected reset with reset_mask of what is over"):
                together.step(action)
            wanted, got = (env.reset(options={"reset_mask": over.copy()}) for env in (alone, together))
            assert data_equivalence(wanted, got, exact=True)
    assert ended.all()


@pytest.mark.parametrize("env", [CartPendulum(2, force=20.0), Acrobot(3)], ids=["cart", "acrobot"])
def test_derivatives_of_a_step_are_those_of_differences(env: Any) -> None:
    env.reset(seed=1)
    for action in actions_of(env, 40):
        env.step(action)
    here, action = env.state, 0.3 * np.ones(env.action_space.shape)

    def after(state: Any, action: Any) -> Any:
        other = copy.deepcopy(env)
        other.reset(options={"start": other._named(state)})
        return other.step(action)[4]["state"]

    def slopes(function: Any, count: int) -> Any:
        h = 1e-4
        moves = h * np.eye(count)
        return np.stack(
            [
                (8 * (function(e) - function(-e)) - function(2 * e) + function(-2 * e)) / (12 * h)
                for e in moves
            ],
            axis=1,
        )

    A, B = env.linearize(action)
    by_state = slopes(lambda e: after(here + e, action), here.size)
    by_action = slopes(lambda e: after(here, action + e), action.size)
    assert np.abs(A - by_state).max() < 1e-10  # measured 4e-12; A is up to 1
    assert np.abs(B - by_action).max() < 1e-10  # measured 3e-12; B is up to 0.4
    assert np.array_equal(env.state, here)
    env.reset(seed=2)
    assert np.array_equal(A, env.linearize(action, here)[0])


def test_the_motors_of_an_acrobot_turn_nothing_about_its_pivot() -> None:
    """Without gravity its angular momentum about the pivot stays, which any torque of the pivot would change."""
    env = Acrobot(3, gravity=0.0, masses=[1.0, 2.0, 0.5], lengths=[1.0, 0.7, 1.2], torque=5.0)
    env.reset(options={"start": {"theta": [0.4, 1.0, -0.5], "theta_dot": [1.0, -2.0, 0.5]}})

    def momentum() -> float:
        theta, rates = np.split(env.state, 2)
        lengths = np.array([1.0, 0.7, 1.2])
        x, y = np.cumsum(lengths * np.sin(theta)), np.cumsum(-lengths * np.cos(theta))
        u = np.cumsum(lengths * np.cos(theta) * rates)
        v = np.cumsum(lengths * np.sin(theta) * rates)
        return float(np.sum([1.0, 2.0, 0.5] * (x * v - y * u)))

    before = momentum()
    for action in actions_of(env, 100):
        env.step(action)
    assert abs(momentum() - before) < 1e-12  # measured 7e-15
    assert abs(env.state[3:]).max() > 1


@pytest.mark.parametrize("links", [1, 2, 3])
def test_a_cart_goes_where_a_simulation_goes(links: int) -> None:
    env = CartPendulum(links)
    env.reset(seed=3, options={"start": {"theta": [2.5] * links}})
    exact = pendula.Simulation(pendula.Model("cart_chain", links), env._named(env.state), tolerance=1e-13)
    for action in actions_of(env, 50):
        env.step(action)
        exact.step(0.02, {"push": 30 * action[0]})
    assert np.abs(env.state - exact.state).max() < 1e-10  # measured 1e-12


@pytest.mark.parametrize("links", [2, 3, 4, 6])
def test_an_acrobot_goes_where_a_simulation_goes(links: int) -> None:
    env = Acrobot(links)
    env.reset(seed=3, options={"start": {"theta": [0.5] * links}})
    exact = pendula.Simulation(pendula.Chain(links=links), env._named(env.state), tolerance=1e-13)
    for action in actions_of(env, 50):
        env.step(action)
        torques = enumerate(env._inputs(action).tolist(), 1)
        exact.step(0.02, {f"torque_{k}": one for k, one in torques})
    assert np.abs(env.state - exact.state).max() < 1e-9  # measured 1e-12, of six links 1e-10


def test_what_is_seen_and_earned_is_what_the_page_says() -> None:
    env = CartPendulum(2, lengths=[1.0, 3.0], track=1.0)
    seen, told = env.reset(
        options={"start": {"x": 0.5, "theta": ["90 deg", np.pi], "theta_dot": [1.0, -2.0]}}
    )
    assert np.array_equal(told["state"], [0.5, np.pi / 2, np.pi, 0, 1, -2])
    assert np.allclose(seen, [0.5, 1, 0, 0, -1, 0, 1, -2], rtol=0, atol=1e-15)  # measured 1.3e-16
    seen, reward, terminated, truncated, told = env.step([1.0])
    height = -(1 * np.cos(told["state"][1]) + 3 * np.cos(told["state"][2])) / 4
    assert reward == pytest.approx((1 + height) / 2, rel=1e-15) and not terminated and not truncated
    while not terminated:
        seen, reward, terminated, truncated, told = env.step([7.0])  # as much as 1
    assert told["state"][0] > 1 and seen[0] == 1 and seen in env.observation_space
    same = CartPendulum(2, lengths=[1.0, 3.0], track=1.0)
    same.reset(options={"start": {"x": 0.5, "theta": ["90 deg", np.pi], "theta_dot": [1.0, -2.0]}})
    while not same.step([1.0])[2]:
        pass
    assert np.array_equal(same.state, told["state"])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CartPendulum(0), "links: expected a whole number >= 1, got 0"),
        (lambda: Acrobot(1), "links: expected a whole number >= 2, got 1"),
        (lambda: CartPendulum(force=-1), "force: expected a number > 0, got -1"),
        (lambda: CartPendulum(task="jump"), 'task: expected "swing_up" or "balance", got \'jump\''),
        (lambda: CartPendulum(dtype=int), "dtype: expected float32 or float64"),
        (lambda: CartPendulum(weight=1), "weight"),
        (lambda: CartPendulum(2, lengths=[1.0, 2.0, 3.0]), "lengths"),
        (lambda: Acrobot(2, lengths=[1.0, 2.0, 3.0]), "lengths"),
        (lambda: Acrobot(torques=1), "expected some of masses, lengths, damping, gravity, got torques"),
        (lambda: CartPendulum().reset(options={"begin": 1}), "options: expected start alone, got begin"),
        (lambda: CartPendulum().reset(options={"start": {"y": 1}}), "start.y"),
        (lambda: CartPendulum().reset(options={"start": {"x": 3}}), r"expected \|x\| <= 2.4, got 3"),
        (lambda: begun().step([1, 2]), r"action: expected finite numbers of shape \(1,\), got \[1, 2\]"),
        (lambda: begun().step([np.nan]), "action: expected finite numbers"),
        (lambda: begun().linearize([1, 2]), "action: expected finite numbers"),
        (lambda: begun().linearize(state=[1, 2]), r"state: expected finite numbers of shape \(4,\)"),
        (lambda: CartPendulumVectorEnv(0), "num_envs: expected a whole number >= 1, got 0"),
        (lambda: CartPendulumVectorEnv(2, autoreset_mode="now"), 'one of "NextStep", "SameStep", "Disabled"'),
        (lambda: CartPendulumVectorEnv(2).reset(seed=[1]), "seed: expected 2 seeds, got 1"),
        (
            lambda: CartPendulumVectorEnv(2).reset(options={"reset_mask": [True]}),
            r"options.reset_mask: expected \(2,\) of bool",
        ),
    ],
)
def test_wrong_arguments_are_refused(make: Any, message: str) -> None:
    with pytest.raises(pendula.InputError, match=message):
        make()


def begun() -> Any:
    env = CartPendulum()
    env.reset(seed=1)
    return env


def test_a_step_before_reset_is_refused() -> None:
    with pytest.raises(gymnasium.error.ResetNeeded, match="expected reset"):
        CartPendulum().step([0.0])


def test_examples_of_docstrings() -> None:
    tried = doctest.testmod(pendula.envs)
    assert tried.attempted and not tried.failed


def test_the_example_swings_up() -> None:
    """Its first iterations: all of them take 14 s."""
    example = runpy.run_path(str(Path(__file__).parents[2] / "examples/swing_up_ilqr.py"))
    env = CartPendulum(2, force=example["FORCE"], track=10.0, step=example["STEP"])
    costs = [example["cost"](*example["swung_up"](env, most)[:2]) for most in (0, 5)]
    assert costs[1] < 0.6 * costs[0]  # measured 0.40
