"""A link that swings in space, z up: θ from the downward vertical, φ from the x axis (paper eq. 24–26)."""

from sympy import Matrix, Rational, atan2, cos, sin, sqrt, symbols

from pendula_codegen.link_model import LinkModel

theta, phi, m, length, g, damping = symbols("theta phi m l g lambda")
tau = symbols("tau_x tau_y tau_z")

MODEL = LinkModel(
    name="spatial",
    coordinates=(theta, phi),
    direction=Matrix([sin(theta) * cos(phi), sin(theta) * sin(phi), -cos(theta)]),
    angles=lambda u: (atan2(sqrt(u[0] ** 2 + u[1] ** 2), -u[2]), atan2(u[1], u[0])),
    up=Matrix([0, 0, 1]),
    mass=m,
    length=length,
    gravity=g,
    damping=damping,
    torque=tau,
    # A torque vector does work on the rotation û × dû.
    generalized_torque=lambda u, u_a: Matrix(tau).dot(u.cross(u_a)),
    dissipation=lambda u_dot: Rational(1, 2) * damping * u_dot.dot(u_dot),
)
