"""Two links balance on a cart: model predictive control by CasADi and IPOPT, over steps that pendula exported.

    pendula export cart_chain --links 2 --as casadi --stages 4 --name cart -o exported
    cc -O2 -shared -fPIC exported/cart.c exported/cart_casadi.c -o exported/cart.so -lm
    python examples/balance_mpc.py exported/cart.so

Every 50 ms, IPOPT finds the forces of the next second, and the first of them pushes the cart. It takes CasADi
(pip install casadi). --with rk lets CasADi integrate equations that it derives itself (examples/swing_up.py).
"""

import argparse
import time

import casadi
from swing_up import interval

SAMPLE, HORIZON, SAMPLES = 0.05, 20, 60  # s, samples
MOST_FORCE = 60.0  # N


def controller(following: casadi.Function) -> tuple[casadi.Opti, casadi.MX, casadi.MX]:
    """The problem of one sample, its start as a parameter, and its forces."""
    problem = casadi.Opti()
    x, u, start = problem.variable(6, HORIZON + 1), problem.variable(1, HORIZON), problem.parameter(6)
    standing = casadi.DM([0, casadi.pi, casadi.pi, 0, 0, 0])
    away = x - casadi.repmat(standing, 1, HORIZON + 1)
    problem.minimize(casadi.sumsqr(away) + 0.01 * casadi.sumsqr(u) + 100 * casadi.sumsqr(away[:, -1]))
    problem.subject_to(x[:, 0] == start)
    for k in range(HORIZON):
        problem.subject_to(x[:, k + 1] == following(x[:, k], u[k]))
    problem.subject_to(problem.bounded(-MOST_FORCE, u, MOST_FORCE))
    problem.set_initial(x, casadi.repmat(standing, 1, HORIZON + 1))
    problem.solver("ipopt", {"print_time": False, "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 100}})
    return problem, start, u


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("library", help="what cc has made")
    parser.add_argument("--with", dest="kind", default="pendula", choices=["pendula", "rk", "collocation"])
    parser.add_argument("--substeps", type=int, default=1)
    parser.add_argument("--order", type=int, default=2, help="points of collocation")
    asked = parser.parse_args()
    following = interval(asked.kind, asked.library, asked.substeps, asked.order, SAMPLE)
    problem, start, u = controller(following)
    state, iterations, begin = (
        casadi.DM([0, casadi.pi + 0.2, casadi.pi - 0.1, 0, 0, 0]),
        0,
        time.perf_counter(),
    )
    for _ in range(SAMPLES):
        problem.set_value(start, state)
        found = problem.solve()
        iterations += found.stats()["iter_count"]
        state = following(state, found.value(u)[0])
        problem.set_initial(found.value_variables())
    seconds = time.perf_counter() - begin
    print("x, theta_1, theta_2", ", ".join(f"{float(value):.4f}" for value in state[:3].elements()))
    print(f"{iterations / SAMPLES:.1f} iterations a sample, all in {seconds:.1f} s")


if __name__ == "__main__":
    main()
