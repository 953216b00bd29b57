"""Two links on a cart swing up: direct multiple shooting by CasADi and IPOPT, over steps that pendula exported.

    pendula export cart_chain --links 2 --as casadi --name cart -o exported
    cc -O2 -shared -fPIC exported/cart.c exported/cart_casadi.c -o exported/cart.so -lm
    python examples/swing_up.py exported/cart.so

It takes CasADi (pip install casadi). --with rk or collocation takes CasADi's integrators instead, of equations that
CasADi derives from the same Lagrangian; --substeps says how many steps an interval has. What is printed ends with the
largest error of the integration of an interval, against steps of pendula a hundred times as short.
"""

import argparse
import time

import casadi

INTERVALS, DURATION = 60, 3.0  # s
MOST_FORCE, MOST_WAY = 60.0, 2.0  # N, m
NUMBERS = casadi.DM([1, 1, 1, 1, 0, 0, 1, 0, 9.81])  # masses, lengths, damping, cart, friction, gravity
# Second derivatives, for solvers that ask: differences of the exact first ones.
OPTIONS = {"jacobian_options": {"enable_fd": True, "fd_method": "central"}}


def by_hand() -> casadi.Function:
    """The equations of motion as CasADi derives them from the Lagrangian: x, u -> x_dot."""
    q, v, u = casadi.SX.sym("q", 3), casadi.SX.sym("v", 3), casadi.SX.sym("u")
    place, rate, energy = casadi.vertcat(q[0], 0), casadi.vertcat(v[0], 0), v[0] ** 2 / 2
    for k in (1, 2):
        place += casadi.vertcat(casadi.sin(q[k]), -casadi.cos(q[k]))
        rate += v[k] * casadi.vertcat(casadi.cos(q[k]), casadi.sin(q[k]))
        energy += casadi.sumsqr(rate) / 2 - 9.81 * place[1]
    p = casadi.gradient(energy, v)
    right = casadi.gradient(energy, q) - casadi.jtimes(p, q, v) + casadi.vertcat(u, 0, 0)
    acceleration = casadi.solve(casadi.jacobian(p, v), right)
    return casadi.Function("f", [casadi.vertcat(q, v), u], [casadi.vertcat(v, acceleration)])


def interval(
    kind: str, library: str, substeps: int, order: int = 2, duration: float = DURATION / INTERVALS
) -> casadi.Function:
    """x, u -> x an interval later."""
    x, u, h = casadi.MX.sym("x", 6), casadi.MX.sym("u"), duration / substeps
    later = x
    if kind == "pendula":
        step = casadi.external("cart_next", library, OPTIONS)
        for _ in range(substeps):
            later = step(later, u, NUMBERS, 0, h)
        return casadi.Function("next", [x, u], [later])
    f, y, w = by_hand(), casadi.SX.sym("x", 6), casadi.SX.sym("u")
    options = {"number_of_finite_elements": substeps, "simplify": True}
    if kind == "collocation":
        options |= {"interpolation_order": order, "collocation_scheme": "legendre"}
        options |= {"rootfinder_options": {"abstol": 1e-12}}
    whole = casadi.integrator("whole", kind, {"x": y, "p": w, "ode": f(y, w)}, 0, h * substeps, options)
    return casadi.Function("next", [x, u], [whole(x0=x, p=u)["xf"]])


def swing_up(following: casadi.Function) -> tuple[casadi.DM, casadi.DM, dict, float]:
    """States and forces of least effort from hanging to standing, what IPOPT tells, and seconds."""
    problem = casadi.Opti()
    x, u = problem.variable(6, INTERVALS + 1), problem.variable(1, INTERVALS)
    problem.minimize(casadi.sumsqr(u) * DURATION / INTERVALS)
    problem.subject_to(x[:, 0] == casadi.DM.zeros(6))
    problem.subject_to(x[:, -1] == casadi.DM([0, casadi.pi, casadi.pi, 0, 0, 0]))
    for k in range(INTERVALS):
        problem.subject_to(x[:, k + 1] == following(x[:, k], u[k]))
    problem.subject_to(problem.bounded(-MOST_FORCE, u, MOST_FORCE))
    problem.subject_to(problem.bounded(-MOST_WAY, x[0, :], MOST_WAY))
    problem.set_initial(x[1:3, :], casadi.repmat(casadi.linspace(0, casadi.pi, INTERVALS + 1).T, 2, 1))
    ipopt = {
        "hessian_approximation": "limited-memory",
        "max_iter": 3000,
        "print_level": 0,
        "sb": "yes",
        "tol": 1e-6,
    }
    problem.solver("ipopt", {"print_time": False, "ipopt": ipopt})
    begin = time.perf_counter()
    found = problem.solve()
    return found.value(x), found.value(u), found.stats(), time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("library", help="what cc has made")
    parser.add_argument("--with", dest="kind", default="pendula", choices=["pendula", "rk", "collocation"])
    parser.add_argument("--substeps", type=int, default=1)
    parser.add_argument("--order", type=int, default=2, help="points of collocation")
    asked = parser.parse_args()
    following = interval(asked.kind, asked.library, asked.substeps, asked.order)
    x, u, told, seconds = swing_up(following)
    exact = interval("pendula", asked.library, 100)
    error = max(
        float(casadi.norm_inf(following(x[:, k], u[k]) - exact(x[:, k], u[k]))) for k in range(INTERVALS)
    )
    ends = ", ".join(f"{value:.6f}" for value in x[:3, -1])
    print(f"{told['return_status']} after {told['iter_count']} iterations in {seconds:.2f} s")
    print(
        f"effort {float(casadi.sumsqr(u)) * DURATION / INTERVALS:.4f} N^2 s; the cart and the links end at {ends}"
    )
    print(f"an interval errs by {error:.1e} at most")


if __name__ == "__main__":
    main()
