"""How energy drifts in environments whose motors are at zero, and how many steps they take a second.

usage: python bench/environments.py [--seconds S] [--repetitions N]

Each mechanism is let go and moves for ten seconds. The drift is the largest change of its energy, divided by the work
that lifts it from hanging to standing. Gymnasium's CartPole and Acrobot move by their own `step`. A cart of pendula has
a point mass where CartPole has a rod, with numbers that give it the same equations: so the error of the angle after ten
seconds can be told, too, against SciPy's DOP853 on those equations. Speeds are steps a second of the processor's time,
medians."""

import argparse
import statistics
import time
from collections.abc import Callable

import gymnasium
import numpy as np
import pendula.envs
from gymnasium.envs.classic_control import AcrobotEnv, CartPoleEnv
from gymnasium.envs.classic_control.cartpole import CartPoleVectorEnv
from scipy.integrate import solve_ivp

STEP, DURATION = 0.02, 10.0  # s
# CartPole's rod of mass m = 0.1 and length 2 l = 1 swings as a point mass of 3/4 m at 4/3 l: the cart has the rest.
CART = {"masses": 0.075, "lengths": 2 / 3, "cart_mass": 1.025, "gravity": 9.8}
CART_ANGLE, CHAIN_ANGLES = 2.0, (2.0, 1.0)  # rad from hanging


def cart_energy(state: np.ndarray) -> float:
    """Of CartPole, (x, x_dot, theta, theta_dot), theta from upright, over the work to lift it."""
    _, u, theta, w = state
    kinetic = 1.1 * u * u / 2 + 0.05 * u * w * np.cos(theta) + 0.05 * 0.5 * 4 / 3 * w * w / 2
    return (kinetic + 0.05 * 9.8 * np.cos(theta)) / (2 * 0.05 * 9.8)


def cart_angle() -> float:
    """Where CartPole's equations bring the angle, by SciPy."""

    def field(_: float, state: np.ndarray) -> list[float]:
        _, u, theta, w = state
        sine, cosine = np.sin(theta), np.cos(theta)
        push = 0.05 * w * w * sine / 1.1
        turned = (9.8 * sine - cosine * push) / (0.5 * (4 / 3 - 0.1 * cosine * cosine / 1.1))
        return [u, push - 0.05 * turned * cosine / 1.1, w, turned]

    start = [0.0, 0.0, np.pi - CART_ANGLE, 0.0]
    return solve_ivp(field, (0, DURATION), start, method="DOP853", rtol=1e-13, atol=1e-13).y[2, -1]


def acrobot_energy(state: np.ndarray) -> float:
    """Of Gymnasium's Acrobot: rods of 1 kg and 1 m, with moments of inertia of 1 about their centres."""
    first, bend, u, bend_dot = state
    second, w = first + bend, u + bend_dot
    kinetic = (1 + 0.25 + 1) * u * u / 2 + (1 + 0.25) * w * w / 2 + 0.5 * u * w * np.cos(bend)
    height = -1.5 * np.cos(first) - 0.5 * np.cos(second)
    return (kinetic + 9.8 * height) / (2 * 2.0 * 9.8)


def chain_energy(state: np.ndarray) -> float:
    """Of two links of 1 kg and 1 m, as pendula.envs.Acrobot has them."""
    a, b, u, w = state
    kinetic = u * u + w * w / 2 + u * w * np.cos(a - b)
    return (kinetic - 9.81 * (2 * np.cos(a) + np.cos(b))) / (2 * 3 * 9.81)


def cart_pole(integrator: str) -> gymnasium.Env:
    env = CartPoleEnv()
    env.reset(seed=1)
    env.kinematics_integrator, env.force_mag = integrator, 0.0
    env.theta_threshold_radians = env.x_threshold = np.inf  # it would say that it is over, and go on
    env.state = np.array([0.0, 0.0, np.pi - CART_ANGLE, 0.0])
    return env


def acrobot(step: float) -> gymnasium.Env:
    env = AcrobotEnv()
    env.reset(seed=1)
    env.dt = step
    env.state = np.array([CHAIN_ANGLES[0], CHAIN_ANGLES[1] - CHAIN_ANGLES[0], 0.0, 0.0])
    return env


def pendulum(kind: type, theta: object, **options: object) -> gymnasium.Env:
    env = kind(**options)
    env.reset(options={"start": {"theta": theta}})
    return env


def in_cart_poles_words(state: np.ndarray) -> np.ndarray:
    """x, x_dot, theta from upright, and its rate: what pendula calls theta is from hanging, the other way round."""
    x, theta, u, w = state
    return np.array([x, u, np.pi - theta, -w])


def drift(env: gymnasium.Env, action: object, step: float, energy: Callable) -> float:
    begun, most = energy(env.state), 0.0
    for _ in range(round(DURATION / step)):
        env.step(action)
        most = max(most, abs(energy(env.state) - begun))
    return most


def speed(env: object, actions: list, seconds: float, repetitions: int, members: int = 1) -> float:
    """Steps a second of the processor's time, the median."""
    found = []
    env.reset(seed=1)
    for _ in range(repetitions):
        began, count = time.process_time(), 0
        while time.process_time() - began < seconds:
            for action in actions:
                env.step(action)
            count += len(actions) * members
        found.append(count / (time.process_time() - began))
    return statistics.median(found)


def main() -> None:
    """Prints the table of docs/how-to/environments.md."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=0.5, help="of each measurement of speed")
    parser.add_argument("--repetitions", type=int, default=5)
    options = parser.parse_args()
    many = {"num_envs": 1024, "max_episode_steps": 10**9}
    none, one = np.zeros(1), 1
    by_pendula = pendula.envs.CartPendulum
    truth = cart_angle()

    def row(
        what: str, env: gymnasium.Env, action: object, step: float, energy: Callable, angle: Callable | None
    ):
        off = drift(env, action, step, energy)
        error = "" if angle is None else f"{abs(angle(env.state) - truth):.1e}"
        rate = speed(env, [action] * 20, options.seconds, options.repetitions)
        print(f"| {what} | {step:g} s | {off:.1e} | {error} | {rate:,.0f} |")

    print(
        "| environment | step | drift of the energy | error of the angle | steps/s |\n|---|---|---|---|---|"
    )
    for name, integrator in (("Euler", "euler"), ("semi-implicit Euler", "semi-implicit euler")):
        row(f"Gymnasium's CartPole, {name}", cart_pole(integrator), one, STEP, cart_energy, lambda s: s[2])
    env = pendulum(by_pendula, CART_ANGLE, **CART, track=1e9)
    row(
        "the same cart, `CartPendulum`",
        env,
        none,
        STEP,
        lambda s: cart_energy(in_cart_poles_words(s)),
        lambda s: in_cart_poles_words(s)[2],
    )
    for step in (0.2, STEP):
        row("Gymnasium's Acrobot, RK4", acrobot(step), one, step, acrobot_energy, None)
    env = pendulum(pendula.envs.Acrobot, list(CHAIN_ANGLES))
    row("two links, `Acrobot`", env, none, STEP, chain_energy, None)
    print()
    for links in (1, 2, 3):
        envs = pendula.envs.CartPendulumVectorEnv(links=links, **many)
        actions = list(np.random.default_rng(1).uniform(-1, 1, (20, many["num_envs"], 1)))
        rate = speed(envs, actions, options.seconds, options.repetitions, many["num_envs"])
        print(f"`CartPendulumVectorEnv`, 1024 members, {links} links, random actions: {rate:,.0f} steps/s")
    envs = CartPoleVectorEnv(num_envs=many["num_envs"], max_episode_steps=10**9)
    actions = list(np.random.default_rng(1).integers(0, 2, (20, many["num_envs"])))
    rate = speed(envs, actions, options.seconds, options.repetitions, many["num_envs"])
    print(f"Gymnasium's `CartPoleVectorEnv`, Euler, 1024 members: {rate:,.0f} steps/s")


if __name__ == "__main__":
    main()
