"""mechanics.py knows no chains: any Lagrangian goes through it."""

import pytest
from sympy import Symbol, cos, exp, simplify, sin, sqrt, symbols

from pendula_codegen.errors import GenerationError
from pendula_codegen.mechanics import LagrangianSystem, euler_lagrange, gradient, jacobian, momenta

r, phi, r_dot, phi_dot, r_ddot, phi_ddot, m, k = symbols("r phi r_dot phi_dot r_ddot phi_ddot m k")


def kepler(lagrangian=None, forces=None) -> LagrangianSystem:
    return LagrangianSystem(
        name="kepler",
        coordinates=(r, phi),
        velocities=(r_dot, phi_dot),
        parameters=(m, k),
        inputs=(Symbol("drag"),),
        lagrangian=lagrangian or m / 2 * (r_dot**2 + r**2 * phi_dot**2) + k / r,
        forces=forces or (-Symbol("drag") * r_dot, 0 * r),
    )


def test_kepler_motion_by_the_textbook():
    radial, angular = euler_lagrange(kepler(), (r_ddot, phi_ddot))
    assert simplify(radial - (m * r_ddot - m * r * phi_dot**2 + k / r**2)) == 0
    assert simplify(angular - (m * r**2 * phi_ddot + 2 * m * r * r_dot * phi_dot)) == 0
    assert momenta(kepler()) == [m * r_dot, m * r**2 * phi_dot]


@pytest.mark.parametrize(
    "expression",
    [sqrt(1 + r**2) * sin(phi * r), exp(-r * phi) / (1 + cos(phi)) ** 2, r**phi * (r + phi * (r - phi**3))],
)
def test_gradient_of_any_expression(expression):
    derived = gradient(expression, (r, phi, m))
    assert [simplify(a - expression.diff(s)) for a, s in zip(derived, (r, phi, m), strict=True)] == [0, 0, 0]


def test_jacobian_has_a_row_an_expression():
    assert jacobian([r * phi, r**2], [r, phi]) == [[phi, r], [2 * r, 0]]


def test_undeclared_symbol_in_the_lagrangian():
    message = "the Lagrangian of model 'kepler' holds the symbol 'q', which the model does not declare"
    with pytest.raises(GenerationError, match=f"^{message}$"):
        kepler(lagrangian=m * r_dot**2 + Symbol("q") * r)


def test_undeclared_symbol_in_a_load():
    message = "a load of model 'kepler' holds the symbol 'wind', which the model does not declare"
    with pytest.raises(GenerationError, match=f"^{message}$"):
        kepler(forces=(Symbol("wind"), 0 * r))
