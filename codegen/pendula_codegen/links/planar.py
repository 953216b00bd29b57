"""A link that swings in the vertical x–y plane, y up (paper eq. 1–2, 23)."""

from sympy import Matrix, Rational, atan2, cos, sin, symbols

from pendula_codegen.link_model import LinkModel

theta, m, length, g, damping, sigma = symbols("theta m l g lambda sigma")

MODEL = LinkModel(
    name="planar",
    coordinates=(theta,),
    direction=Matrix([sin(theta), -cos(theta)]),
    angles=lambda u: (atan2(u[0], -u[1]),),
    up=Matrix([0, 1]),
    mass=m,
    length=length,
    gravity=g,
    damping=damping,
    torque=(sigma,),
    # The torque turns about the axis that points out of the plane.
    generalized_torque=lambda u, u_a: sigma * (u[0] * u_a[1] - u[1] * u_a[0]),
    dissipation=lambda u_dot: Rational(1, 2) * damping * u_dot.dot(u_dot),
)
