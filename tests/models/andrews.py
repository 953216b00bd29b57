"""Andrews' squeezing mechanism: seven bodies in the plane and a motor (Hairer, Wanner, Solving ODEs II, VII.7)."""

from sympy import Rational, cos, sin, sqrt


def define(model, links):
    names = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
    beta, theta, gamma, phi, delta, omega, epsilon = (model.coordinate(name, "rad") for name in names)
    motor = model.parameter("motor", "N*m", default=0.033)

    def mm(*values):  # in units of 0.01 mm
        return [Rational(value, 100000) for value in values]

    d, da, e, ea, rr, ra, ss, sa, sb, sc, sd = mm(
        2800, 1150, 2000, 1421, 700, 92, 3500, 1874, 1043, 1800, 2000
    )
    ta, tb, u, ua, ub, zf, zt, fa, rest = mm(2308, 916, 4000, 1228, 449, 2000, 4000, 1421, 7785)
    xa, ya, xb, yb, xc, yc = mm(-6934, -227, -3635, 3273, 1400, 7200)

    def at(x, y, *arms):
        """Goes from (x, y) along arms: length along and across an angle."""
        for along, across, angle in arms:
            x, y = (
                x + along * cos(angle) - across * sin(angle),
                y + along * sin(angle) + across * cos(angle),
            )
        return x, y

    bent, elbow, wrist = beta + theta, phi + delta, omega + epsilon
    bodies = [  # mass, moment of inertia, angle, centre
        ("0.04325", "2.194e-6", beta, at(0, 0, (ra, 0, beta))),
        ("0.00365", "4.410e-7", bent, at(0, 0, (rr, 0, beta), (-da, 0, bent))),
        ("0.02373", "5.255e-6", gamma, at(xb, yb, (sb, -sa, gamma))),
        ("0.00706", "5.667e-7", elbow, at(xa, ya, (zt, 0, delta), (0, ea - e, elbow))),
        ("0.07050", "1.169e-5", delta, at(xa, ya, (ta, tb, delta))),
        ("0.00706", "5.667e-7", wrist, at(xa, ya, (0, -u, epsilon), (zf - fa, 0, wrist))),
        ("0.05498", "1.912e-5", epsilon, at(xa, ya, (-ub, -ua, epsilon))),
    ]
    L = 0
    for mass, inertia, angle, centre in bodies:
        speed = sum(model.rate(each) ** 2 for each in centre)
        L += Rational(mass) * speed / 2 + Rational(inertia) * model.rate(angle) ** 2 / 2
    x, y = at(xb, yb, (sd, -sc, gamma))
    model.lagrangian = L - 4530 * (sqrt((x - xc) ** 2 + (y - yc) ** 2) - rest) ** 2 / 2
    model.force(beta, motor)
    tip = at(0, 0, (rr, 0, beta), (-d, 0, bent))
    for name, other in {
        "hook": at(xb, yb, (0, -ss, gamma)),
        "arm": at(xa, ya, (zt, 0, delta), (0, -e, elbow)),
        "leg": at(xa, ya, (0, -u, epsilon), (zf, 0, wrist)),
    }.items():
        for axis, here, there in zip("xy", tip, other, strict=True):
            model.constraint(f"{name}_{axis}", here - there, "m")
