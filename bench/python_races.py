"""How long Python's ways take to move many double pendulums to the same error, each as its users write it.

usage: python bench/python_races.py [--members N] [--error E] [--repetitions N]

Double pendulums of equal links, let go from angles of up to 1.5 rad, ten seconds, one core. Each contestant takes the
loosest of its tolerances by which half of a sample of the members end within the error, in angles and rates, of where
pendula's Taylor series of tolerance 1e-15 end. Slow contestants move fewer members; times are of one member.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable

import numpy as np

DURATION, GRAVITY = 10.0, 9.81  # s, m/s^2; masses and lengths are 1
SAMPLE = 64
Mover = Callable[[np.ndarray, float], np.ndarray]  # starts (members, 2), tolerance -> ends (members, 4)


def rates(a, b, u, v, sin, cos):
    """Accelerations of both links, by any sine and cosine."""
    sine, cosine = sin(a - b), cos(a - b)
    below = 1 + sine * sine
    first = -2 * GRAVITY * sin(a) + cosine * GRAVITY * sin(b) - sine * (u * u * cosine + v * v)
    second = 2 * (u * u * sine - GRAVITY * sin(b) + GRAVITY * sin(a) * cosine) + v * v * sine * cosine
    return first / below, second / below


def by_pendula(method: str | None = None) -> Mover:
    import pendula

    double = pendula.Chain(masses=[1, 1], gravity=GRAVITY)
    chosen = {} if method is None else {"method": method}

    def move(starts: np.ndarray, tolerance: float) -> np.ndarray:
        ends = pendula.ensemble(double, DURATION, {"theta": starts}, tolerance=tolerance, threads=1, **chosen)
        return np.stack(
            [ends[name].values for name in ("theta_1", "theta_2", "theta_dot_1", "theta_dot_2")], axis=1
        )

    return move


def by_heyoka() -> Mover:
    import heyoka

    a, b, u, v = heyoka.make_vars("a", "b", "u", "v")
    first, second = rates(a, b, u, v, heyoka.sin, heyoka.cos)
    equations = [(a, u), (b, v), (u, first), (v, second)]
    lanes = heyoka.recommended_simd_size()
    made = {}

    def move(starts: np.ndarray, tolerance: float) -> np.ndarray:
        if tolerance not in made:
            state = np.zeros((4, lanes))
            made[tolerance] = heyoka.taylor_adaptive_batch(equations, state, tol=tolerance, fast_math=True)
        integrator = made[tolerance]
        ends = np.empty((len(starts), 4))
        for begin in range(0, len(starts), lanes):
            some = starts[begin : begin + lanes]
            integrator.set_time(0.0)
            integrator.state[:2, : len(some)] = some.T
            integrator.state[2:] = 0
            integrator.propagate_until(DURATION)
            ends[begin : begin + lanes] = integrator.state[:, : len(some)].T
        return ends

    return move


def by_scipy() -> Mover:
    from scipy.integrate import solve_ivp

    def field(_, state):
        a, b, u, v = state
        return (u, v, *rates(a, b, u, v, math.sin, math.cos))

    def move(starts: np.ndarray, tolerance: float) -> np.ndarray:
        span = (0.0, DURATION)
        return np.array(
            [
                solve_ivp(field, span, (*start, 0.0, 0.0), method="DOP853", rtol=tolerance, atol=tolerance).y[
                    :, -1
                ]
                for start in starts
            ]
        )

    return move


def by_diffrax() -> Mover:
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)

    def field(_, state, __):
        a, b, u, v = state
        return jnp.stack([u, v, *rates(a, b, u, v, jnp.sin, jnp.cos)])

    @jax.jit
    def all_of(starts, tolerance):
        def one(start):
            return diffrax.diffeqsolve(
                diffrax.ODETerm(field),
                diffrax.Dopri8(),
                t0=0.0,
                t1=DURATION,
                dt0=None,
                y0=jnp.concatenate([start, jnp.zeros(2)]),
                stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
                saveat=diffrax.SaveAt(t1=True),
                max_steps=100_000,
            ).ys[0]

        return jax.vmap(one)(starts)

    return lambda starts, tolerance: np.asarray(all_of(starts, tolerance))


def by_jitcode() -> Mover:
    import jitcode
    import symengine

    a, b, u, v = (jitcode.y(k) for k in range(4))
    solver = jitcode.jitcode([u, v, *rates(a, b, u, v, symengine.sin, symengine.cos)], verbose=False)
    solver.compile_C()

    def move(starts: np.ndarray, tolerance: float) -> np.ndarray:
        ends = []
        solver.set_integrator("dop853", rtol=tolerance, atol=tolerance, nsteps=100_000)
        for start in starts:
            solver.set_initial_value([*start, 0.0, 0.0], 0.0)
            ends.append(solver.integrate(DURATION))
        return np.array(ends)

    return move


# name: how it is made, members for the time
CONTESTANTS: dict[str, tuple[Callable[[], Mover], int]] = {
    "pendula.ensemble": (by_pendula, 10**9),
    "heyoka, batches, fast_math": (by_heyoka, 10**9),
    "diffrax, Dopri8, vmap": (by_diffrax, 2000),
    "JiTCODE, dop853": (by_jitcode, 1000),
    "SciPy, DOP853": (by_scipy, 32),
}


def main() -> None:
    """Prints a line a contestant."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--members", type=int, default=10_000)
    parser.add_argument("--error", type=float, default=1e-8)
    parser.add_argument("--repetitions", type=int, default=5)
    options = parser.parse_args()
    starts = np.random.default_rng(1).uniform(-1.5, 1.5, (options.members, 2))
    sample = starts[:SAMPLE]
    truth = by_pendula("taylor")(sample, 1e-15)
    tolerances = [10.0**-k for k in range(3, 16)]
    least = None
    for name, (make, most) in CONTESTANTS.items():
        mover = make()
        for tolerance in tolerances:
            error = float(np.median(np.abs(mover(sample, tolerance) - truth).max(axis=1)))
            if error <= options.error:
                break
        some = starts[:most]
        mover(some, tolerance)
        times = []
        for _ in range(options.repetitions):
            began = time.perf_counter()
            mover(some, tolerance)
            times.append((time.perf_counter() - began) / len(some))
        taken = statistics.median(times)
        least = least or taken
        print(
            f"{name:28} {tolerance:.0e}  error {error:.1e}  {taken * 1e6:10.2f} us a member  {taken / least:8.2f}"
        )


if __name__ == "__main__":
    main()
