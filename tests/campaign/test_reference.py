"""The reference against what is known without it, and its methods against each other."""

import math
import random

import pytest
import random_chains
import reference

ALL = [("extrapolation", 1e-17), ("fehlberg", 1e-17), ("implicit", 1e-12)]


def chain(space="planar", links=1, **given) -> reference.Chain:
    start = {
        "theta": given.pop("theta"),
        **{key: given.pop(key) for key in list(given) if key.endswith("_dot")},
    }
    table = {"space": space, "links": links, "masses": 1.0, "lengths": 1.0, **given}
    return reference.read({"chain": table, "start": start})


def agm(a: float, b: float) -> float:
    while abs(a - b) > 1e-16 * a:
        a, b = (a + b) / 2, math.sqrt(a * b)
    return a


@pytest.mark.parametrize(("method", "tolerance"), ALL)
def test_a_pendulum_is_back_after_its_elliptic_period(compiled, method, tolerance):
    c = chain(theta=2.0, lengths=0.7)
    period = 2 * math.pi * math.sqrt(0.7 / 9.81) / agm(1.0, math.cos(1.0))
    (end,) = compiled.run(c, [period], method, tolerance)
    there = [[0.7 * math.sin(2.0), -0.7 * math.cos(2.0)]]
    assert end.distance(there, [[0.0, 0.0]], c) < 1e-9  # measured 2e-15, 1.8e-15, 7.5e-12


@pytest.mark.parametrize(("method", "tolerance"), ALL)
def test_a_cone_is_a_motion(compiled, method, tolerance):
    turning = math.sqrt(9.81 / math.cos(0.8))
    c = chain("spatial", theta=0.8, phi_dot=turning)
    (end,) = compiled.run(c, [2.0], method, tolerance)
    s, across = math.sin(0.8), 2.0 * turning
    there = [[s * math.cos(across), s * math.sin(across), -math.cos(0.8)]]
    rates = [[-s * turning * math.sin(across), s * turning * math.cos(across), 0.0]]
    assert end.distance(there, rates, c) < 1e-9  # measured 1.4e-16, 2.8e-16, 2.7e-12


@pytest.mark.parametrize(("damping", "methods"), [(0.5, ALL), (1e6, ALL[2:])])
@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_driven_damped_link_without_gravity_is_linear(compiled, space, damping, methods):
    """θ̈ = σ + A sin(ω t + φ) − λ θ̇ on a link of 1 kg and 1 m; in space the torque is (0, −σ, 0)."""
    steady, amplitude, frequency, phase = 0.3, 0.8, 7.0, 0.4

    def torque(size: float):
        return size if space == "planar" else [0.0, -size, 0.0]

    drive = {"link": 1, "amplitude": torque(amplitude), "frequency": frequency, "phase": phase}
    c = chain(
        space, theta=0.2, theta_dot=3.0, gravity=0.0, damping=damping, torque=[torque(steady)], drive=[drive]
    )
    swing = amplitude / complex(damping, frequency) * complex(math.cos(phase), math.sin(phase))
    drift = steady / damping
    transient = 3.0 - drift - swing.imag  # θ̇ = drift + Im(swing e^{iωt}) + transient e^{−λt}
    turned = swing * complex(math.cos(2 * frequency), math.sin(2 * frequency))
    rate = drift + turned.imag + transient * math.exp(-2 * damping)
    angle = (
        0.2 + 2 * drift - (turned - swing).real / frequency - transient * math.expm1(-2 * damping) / damping
    )
    s, co = math.sin(angle), math.cos(angle)
    there, moving = ([[s, -co]], [[co * rate, s * rate]])
    if space == "spatial":
        there, moving = ([[s, 0.0, -co]], [[co * rate, 0.0, s * rate]])
    for method, tolerance in methods:
        (end,) = compiled.run(c, [2.0], method, tolerance)
        assert end.distance(there, moving, c) < 1e-10, method  # measured 1.5e-12


@pytest.mark.parametrize("number", range(12))
def test_methods_and_equations_agree_on_random_chains(compiled, number):
    """Tensions by extrapolation against dense multipliers by Fehlberg, each converged alone."""
    scenario = random_chains.Draw(random.Random(f"methods:{number}")).scenario()
    scenario["chain"].pop("damping", None)  # an explicit method would take minutes where it is heavy
    c = reference.read(scenario)
    (one,) = compiled.run(c, [0.1], "extrapolation", 1e-17)
    (other,) = compiled.run(c, [0.1], "fehlberg", 1e-17)
    assert one.distance(other.bobs, other.velocities, c) < 1e-14  # measured 0 to 8.1e-17


@pytest.mark.parametrize("number", range(4))
def test_implicit_and_explicit_methods_agree_on_damped_chains(compiled, number):
    scenario = random_chains.Draw(random.Random(f"damped:{number}")).scenario()
    inertias = [
        m * r**2 for m, r in zip(scenario["chain"]["masses"], scenario["chain"]["lengths"], strict=True)
    ]
    scenario["chain"]["damping"] = [30 * inertia for inertia in inertias]
    c = reference.read(scenario)
    (one,) = compiled.run(c, [0.1], "extrapolation", 1e-17)
    (other,) = compiled.run(c, [0.1], "implicit", 1e-12)
    assert one.distance(other.bobs, other.velocities, c) < 1e-12  # measured 4.6e-15 to 1e-14


def test_a_disturbance_grows_near_the_upright_rest_only(compiled):
    """There it grows like cosh √(g/l) t, 6000 times in three seconds."""
    (upright,) = compiled.find(chain(theta=math.pi, theta_dot=1e-4), [3.0])
    (hanging,) = compiled.find(chain(theta=0.5), [3.0])
    assert hanging.growth < 10  # measured 1.7
    assert upright.growth > 6000  # measured 4.4e+04
    assert upright.uncertainty < 1e-9  # measured 4e-12
