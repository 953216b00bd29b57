"""The paper's formulas, typed by hand from its text: the oracle that the generator is held against.

Each takes the number of links and uses the generator's symbol names (theta_1, theta_dot_1, M_1, l_1, …).
Functions ending in _printed are what the paper prints where that is wrong; the others are the truth.
"""

from __future__ import annotations

from collections.abc import Callable

from sympy import Expr, Matrix, Symbol, cos, diag, expand, expand_trig, sin, symbols, zeros

g = Symbol("g")


def named(stem: str, i: int) -> Symbol:
    return Symbol(f"{stem}_{i}")


def theta(i: int) -> Symbol:
    return named("theta", i)


def phi(i: int) -> Symbol:
    return named("phi", i)


def M(i: int) -> Symbol:
    return named("M", i)


def length(i: int) -> Symbol:
    return named("l", i)


def column(stem: str, n: int) -> Matrix:
    return Matrix([named(stem, i) for i in range(1, n + 1)])


def pairs(n: int, entry: Callable[[int, int], Expr]) -> Matrix:
    """(n x n) matrix of l_i l_j M_max(i,j) entry(i, j)."""
    return Matrix(n, n, lambda i, j: _weight(i + 1, j + 1) * entry(i + 1, j + 1))


def _weight(i: int, j: int) -> Expr:
    return length(i) * length(j) * M(max(i, j))


def normal_form(expression: Expr) -> Expr:
    """Polynomials in sines and cosines of independent angles have one form with no sin² in it: zero is 0."""
    expanded = expand(expand_trig(expression))
    even = expanded.replace(
        lambda e: e.is_Pow and isinstance(e.base, sin) and e.exp > 1,
        lambda e: (1 - cos(e.base.args[0]) ** 2) ** (e.exp // 2) * e.base ** (e.exp % 2),
    )
    return expand(even)


# --- plane


def equations_13(n: int) -> list[Expr]:
    """Left-hand sides of (13)."""
    rows = []
    for d in range(1, n + 1):
        row = M(d) * length(d) ** 2 * named("theta_ddot", d) + M(d) * g * length(d) * sin(theta(d))
        for i in [*range(1, d), *range(d + 1, n + 1)]:
            row += _weight(d, i) * named("theta_ddot", i) * cos(theta(d) - theta(i))
            row += _weight(d, i) * named("theta_dot", i) ** 2 * sin(theta(d) - theta(i))
        rows.append(row)
    return rows


def equations_14() -> list[Expr]:
    """(14): the three equations of three links, written out."""
    t1, t2, t3, v1, v2, v3, a1, a2, a3 = symbols("theta_1:4 theta_dot_1:4 theta_ddot_1:4")
    l1, l2, l3, M1, M2, M3 = symbols("l_1:4 M_1:4")
    return [
        M1 * l1**2 * a1 + M1 * g * l1 * sin(t1)
        + M2 * l1 * l2 * a2 * cos(t1 - t2) + M3 * l1 * l3 * a3 * cos(t1 - t3)
        + M2 * l1 * l2 * v2**2 * sin(t1 - t2) + M3 * l1 * l3 * v3**2 * sin(t1 - t3),
        M2 * l2**2 * a2 + M2 * g * l2 * sin(t2)
        + M2 * l2 * l1 * a1 * cos(t2 - t1) + M2 * l2 * l1 * v1**2 * sin(t2 - t1)
        + M3 * l2 * l3 * a3 * cos(t2 - t3) + M3 * l2 * l3 * v3**2 * sin(t2 - t3),
        M3 * l3**2 * a3 + M3 * g * l3 * sin(t3)
        + M3 * l3 * l1 * a1 * cos(t3 - t1) + M3 * l3 * l2 * a2 * cos(t3 - t2)
        + M3 * l3 * l1 * v1**2 * sin(t3 - t1) + M3 * l3 * l2 * v2**2 * sin(t3 - t2),
    ]  # fmt: skip


def kinetic_energy_8(n: int) -> Expr:
    """(8)."""
    total = 0
    for i in range(1, n + 1):
        total += M(i) * length(i) ** 2 * named("theta_dot", i) ** 2
        for j in [*range(1, i), *range(i + 1, n + 1)]:
            rates = named("theta_dot", i) * named("theta_dot", j)
            total += _weight(i, j) * rates * cos(theta(i) - theta(j))
    return total / 2


def potential_energy_9(n: int) -> Expr:
    """(9)."""
    return -sum(M(i) * g * length(i) * cos(theta(i)) for i in range(1, n + 1))


def minus_L_theta_12(n: int, printed: bool) -> list[Expr]:
    """−∂L/∂θ_d as in (11) and (12); printed: with the second sum as the paper has it."""
    rows = []
    for d in range(1, n + 1):
        row = M(d) * g * length(d) * sin(theta(d))
        for i in [*range(1, d), *range(d + 1, n + 1)]:
            true = named("theta_dot", d) * named("theta_dot", i) * sin(theta(d) - theta(i))
            wrong = named("theta_dot", i) * cos(theta(d) - theta(i))
            row += _weight(d, i) * (wrong if printed and i > d else true)
        rows.append(row)
    return rows


def block_C_19(n: int) -> Matrix:
    return pairs(n, lambda i, j: cos(theta(i) - theta(j)))


def block_S_20(n: int) -> Matrix:
    return pairs(n, lambda i, j: sin(theta(j) - theta(i)))


def block_S_20_printed(n: int) -> Matrix:
    return pairs(n, lambda i, j: sin(theta(i) - theta(j)) if i >= j else sin(theta(j) - theta(i)))


def block_S_21_printed(n: int) -> Matrix:
    """(21), n = 3 in the paper: cosines in all rows but the first."""
    return pairs(n, lambda i, j: (sin if i == 1 or i == j else cos)(theta(j) - theta(i)))


def block_h_18(n: int) -> Matrix:
    return Matrix([M(i) * g * length(i) * sin(theta(i)) for i in range(1, n + 1)])


def equations_15(n: int, S: Matrix) -> list[Expr]:
    """(15), C θ̈ − S θ̇² + h."""
    squares = column("theta_dot", n).applyfunc(lambda rate: rate**2)
    return list(block_C_19(n) * column("theta_ddot", n) - S * squares + block_h_18(n))


# --- space


def blocks_28_34(n: int) -> dict[str, Matrix]:
    """(28)–(34)."""

    def c(i: int, j: int) -> Expr:
        return cos(phi(i) - phi(j))

    def s(i: int, j: int) -> Expr:
        return sin(phi(i) - phi(j))

    def ct(i: int) -> Expr:
        return cos(theta(i))

    def st(i: int) -> Expr:
        return sin(theta(i))

    B21 = pairs(n, lambda i, j: -s(i, j) * st(i) * st(j))
    return {
        "A11": pairs(n, lambda i, j: c(i, j) * ct(i) * ct(j) + st(i) * st(j)),
        "A12": pairs(n, lambda i, j: s(i, j) * ct(i) * st(j)),
        "A21": pairs(n, lambda i, j: -s(i, j) * st(i) * ct(j)),
        "A22": pairs(n, lambda i, j: c(i, j) * st(i) * st(j)),
        "B11": pairs(n, lambda i, j: c(i, j) * ct(i) * st(j) - st(i) * ct(j)),
        "B12": pairs(n, lambda i, j: c(i, j) * ct(i) * st(j)),
        "B21": B21,
        "B22": B21,
    }


def block_C1_35_printed(n: int) -> Matrix:
    return pairs(n, lambda i, j: sin(phi(i) - phi(j)) * cos(theta(i)) * cos(theta(j)))


def block_C2_36_printed(n: int) -> Matrix:
    return pairs(n, lambda i, j: cos(phi(i) - phi(j)) * sin(theta(i)) * cos(theta(j)))


def block_C1(n: int) -> Matrix:
    return 2 * block_C1_35_printed(n)


def block_C2(n: int) -> Matrix:
    return 2 * block_C2_36_printed(n)


def block_g_37(n: int) -> Matrix:
    return Matrix([length(i) * g * M(i) * sin(theta(i)) for i in range(1, n + 1)])


def equations_27(n: int, C1: Matrix, C2: Matrix) -> list[Expr]:
    """(27), everything on one side."""
    k = blocks_28_34(n)
    v, w = column("theta_dot", n), column("phi_dot", n)
    a, b = column("theta_ddot", n), column("phi_ddot", n)
    v2, w2, vw = (x.multiply_elementwise(y) for x, y in ((v, v), (w, w), (v, w)))
    first = k["A11"] * a + k["A12"] * b - k["B11"] * v2 - k["B12"] * w2 + C1 * vw + block_g_37(n)
    second = k["A21"] * a + k["A22"] * b - k["B21"] * v2 - k["B22"] * w2 + C2 * vw
    return [*first, *second]


def equations_39(factor: int) -> list[Expr]:
    """(39), n = 1; `factor` stands before the Coriolis term of the second row: 1 as printed, 2 in truth."""
    t, v, w, a, b = symbols("theta_1 theta_dot_1 phi_dot_1 theta_ddot_1 phi_ddot_1")
    inertia = length(1) ** 2 * M(1)
    mass = diag(inertia, inertia * sin(t) ** 2)
    squares = zeros(2, 2)
    squares[0, 1] = inertia * cos(t) * sin(t)
    coriolis = Matrix([0, factor * inertia * v * w * sin(t) * cos(t)])
    gravity = Matrix([length(1) * g * M(1) * sin(t), 0])
    return list(mass * Matrix([a, b]) - squares * Matrix([v**2, w**2]) + coriolis + gravity)


def accelerations_40(factor: int) -> dict[Symbol, Expr]:
    """(40) with φ̈ = factor θ̇ φ̇ cot θ: 1 as printed, −2 in truth."""
    t, v, w = symbols("theta_1 theta_dot_1 phi_dot_1")
    return {
        Symbol("theta_ddot_1"): w**2 * cos(t) * sin(t) - g / length(1) * sin(t),
        Symbol("phi_ddot_1"): factor * v * w * cos(t) / sin(t),
    }


# --- two links without dimensions (section 3.3.1)

m, l = symbols("m l")  # noqa: E741


def equations_41(general: list[Expr]) -> list[Expr]:
    """Two-link equations in the paper's units M_1 = l_1 = 1, M_2 = m, l_2 = l."""
    return [row.subs(dict(zip(symbols("M_1 M_2 l_1 l_2"), (1, m, 1, l), strict=True))) for row in general]


def equations_41_typed() -> list[Expr]:
    """First line of (41), everything on one side."""
    t1, t2, v1, v2, a1, a2 = symbols("theta_1:3 theta_dot_1:3 theta_ddot_1:3")
    mass = Matrix([[1, m * l * cos(t2 - t1)], [m * l * cos(t1 - t2), m * l**2]])
    squares = Matrix([[0, m * l * sin(t2 - t1)], [m * l * sin(t1 - t2), 0]])
    gravity = Matrix([g * sin(t1), m * g * l * sin(t2)])
    return list(mass * Matrix([a1, a2]) - squares * Matrix([v1**2, v2**2]) + gravity)


def numerators_42(printed: bool) -> dict[Symbol, Expr]:
    """Accelerations of (42) times 1 − m cos²(θ_2−θ_1)."""
    t1, t2, v1, v2 = symbols("theta_1 theta_2 theta_dot_1 theta_dot_2")
    first = m * l * v2**2 * sin(t2 - t1) - g * sin(t1)
    second_gravity = g * sin(t1 if printed else t2)
    return {
        Symbol("theta_ddot_1"): first - m * cos(t2 - t1) * (v1**2 * sin(t1 - t2) - g * sin(t2)),
        Symbol("theta_ddot_2"): (v1**2 * sin(t1 - t2) - second_gravity - cos(t1 - t2) * first) / l,
    }
