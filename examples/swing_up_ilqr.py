"""Two links on a cart swing up by iLQR, on the exact derivatives of the steps of pendula.envs: NumPy alone.

    pip install pendula[gym]
    python examples/swing_up_ilqr.py

Each iteration linearizes the steps along the motion, finds by Riccati's recursion which change of the actions, and
which feedback, lessens the cost of that linear motion, and tries it on the true one. Costs are quadratic: of the
actions on the way, of what is left to the goal at the end. Then a linear regulator, of the same derivatives, balances.
"""

import argparse
import time

import numpy as np
import pendula.envs

STEPS, STEP, FORCE = 90, 0.04, 300.0  # s, N
GOAL = np.array([0.0, np.pi, np.pi, 0.0, 0.0, 0.0])
AT_END = np.diag([10.0, 100.0, 100.0, 3.0, 10.0, 10.0])
ON_THE_WAY = np.diag([0.05, 0.0, 0.0, 0.0, 0.0, 0.0])
OF_ACTION = 30.0


def cost(states: np.ndarray, actions: np.ndarray) -> float:
    """Of a motion."""
    off = states - GOAL
    on_the_way = np.einsum("ti,ij,tj", off[:-1], ON_THE_WAY, off[:-1]) + OF_ACTION * np.sum(actions**2)
    return float(on_the_way + off[-1] @ AT_END @ off[-1]) / 2


def moved(
    env: pendula.envs.CartPendulum,
    states: np.ndarray,
    actions: np.ndarray,
    feedback: np.ndarray,
    change: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """The motion whose actions change, and follow what differs from the states so far."""
    env.reset(options={"start": {"theta": 0.0}})
    found, given = [env.state], []
    for k in range(len(actions)):
        action = actions[k] + change[k] + feedback[k] @ (found[-1] - states[k])
        given.append(np.clip(action, -1, 1))
        found.append(env.step(given[-1])[4]["state"])
    return np.array(found), np.array(given)


def backward(
    steps: list, states: np.ndarray, actions: np.ndarray, damping: float
) -> tuple[np.ndarray, np.ndarray]:
    """Feedback and changes of the actions that are best for the linear motion."""
    slope, bend = AT_END @ (states[-1] - GOAL), AT_END
    feedback, change = [], []
    for (A, B), state, action in zip(reversed(steps), states[-2::-1], actions[::-1], strict=True):
        by_state = ON_THE_WAY @ (state - GOAL) + A.T @ slope
        by_action = OF_ACTION * action + B.T @ slope
        twice = OF_ACTION * np.eye(1) + B.T @ bend @ B + damping * np.eye(1)
        mixed = B.T @ bend @ A
        feedback.append(-np.linalg.solve(twice, mixed))
        change.append(-np.linalg.solve(twice, by_action))
        plain = twice - damping * np.eye(1)
        K, k = feedback[-1], change[-1]
        slope = by_state + K.T @ plain @ k + K.T @ by_action + mixed.T @ k
        bend = ON_THE_WAY + A.T @ bend @ A + K.T @ plain @ K + K.T @ mixed + mixed.T @ K
    return np.array(feedback[::-1]), np.array(change[::-1])


def swung_up(env: pendula.envs.CartPendulum, most: int) -> tuple[np.ndarray, np.ndarray, int]:
    """States, actions, iterations."""
    actions = 0.03 * np.sin(3.0 * np.arange(STEPS) * STEP)[:, None]
    none = np.zeros((STEPS, 1, 6)), np.zeros((STEPS, 1))
    states, actions = moved(env, np.zeros((STEPS + 1, 6)), actions, *none)
    least, damping, iterations = cost(states, actions), 1.0, 0
    while iterations < most:
        iterations += 1
        steps = [env.linearize(*both) for both in zip(actions, states[:-1], strict=True)]
        before = least
        while damping < 1e10:
            feedback, change = backward(steps, states, actions, damping)
            others = [moved(env, states, actions, feedback, k * change) for k in (1.0, 0.5, 0.2, 0.05)]
            best = min(others, key=lambda other: cost(*other))
            if cost(*best) < least:
                (states, actions), least, damping = best, cost(*best), max(damping / 5, 1e-6)
                break
            damping *= 5
        if before - least < 1e-4 * before:
            break
    return *moved(env, states, actions, *none), iterations


def regulator(env: pendula.envs.CartPendulum) -> np.ndarray:
    """The feedback of a linear regulator beside the goal."""
    A, B = env.linearize(state=GOAL)
    bend = np.eye(6)
    for _ in range(1000):
        K = -np.linalg.solve(OF_ACTION * np.eye(1) + B.T @ bend @ B, B.T @ bend @ A)
        bend = np.eye(6) + A.T @ bend @ (A + B @ K)
    return K


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--iterations", type=int, default=60, help="at most")
    asked = parser.parse_args()
    env = pendula.envs.CartPendulum(2, force=FORCE, track=10.0, step=STEP)
    began = time.perf_counter()
    states, actions, iterations = swung_up(env, asked.iterations)
    print(f"{iterations} iterations in {time.perf_counter() - began:.1f} s, cost {cost(states, actions):.3f}")
    print("the cart and the links end at", ", ".join(f"{one:.4f}" for one in states[-1, :3]))
    print(f"the cart goes {abs(states[:, 0]).max():.2f} m far, by up to {FORCE * abs(actions).max():.1f} N")
    K = regulator(env)
    for _ in range(round(10 / STEP)):
        env.step(K @ (env.state - GOAL))
    print("ten seconds later they are at", ", ".join(f"{one:.4f}" for one in env.state[:3]))


if __name__ == "__main__":
    main()
