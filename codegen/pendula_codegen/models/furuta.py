"""A Furuta pendulum: a rod that swings at the end of an arm, which a motor turns in the horizontal plane."""

from sympy import Rational, cos, sin


def define(model, links):
    alpha = model.coordinate("alpha", "rad")  # of the arm about the vertical axis, from x
    theta = model.coordinate("theta", "rad")  # of the rod from hanging down
    inertia = model.parameter("arm_inertia", "kg m^2", default=0.05, positive=True)  # about the axis
    r = model.parameter("arm_length", "m", default=0.3, positive=True)
    m = model.parameter("mass", "kg", default=0.2, positive=True)  # of the rod
    to_center = model.parameter("center", "m", default=0.2, positive=True)  # from joint to centre of mass
    own = model.parameter("rod_inertia", "kg m^2", default=0.003, positive=True)  # about the centre of mass
    g = model.parameter("gravity", "m/s^2", default=9.81)
    arm_friction = model.parameter("arm_friction", "N m s", default=0.0)
    rod_friction = model.parameter("rod_friction", "N m s", default=0.0)
    torque = model.input("torque", "N m")  # of the motor

    joint = (r * cos(alpha), r * sin(alpha), 0)
    # The rod swings in the vertical plane across the arm.
    center = (
        joint[0] - to_center * sin(theta) * sin(alpha),
        joint[1] + to_center * sin(theta) * cos(alpha),
        -to_center * cos(theta),
    )
    alpha_dot, theta_dot = model.rate(alpha), model.rate(theta)
    speed_squared = sum(model.rate(component) ** 2 for component in center)
    turning = theta_dot**2 + sin(theta) ** 2 * alpha_dot**2  # of a thin rod
    kinetic = Rational(1, 2) * (inertia * alpha_dot**2 + m * speed_squared + own * turning)
    model.lagrangian = kinetic - m * g * center[2]
    model.dissipation = Rational(1, 2) * (arm_friction * alpha_dot**2 + rod_friction * theta_dot**2)
    model.force(alpha, torque)
    model.point("joint", joint, kind="pivot")
    model.point("center", center)
