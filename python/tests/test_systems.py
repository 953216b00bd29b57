"""Systems: what they have, when they are equal, and that what is wrong is told where it is given."""

import pickle

import numpy as np
import pendula
import pytest

CHAIN = pendula.Chain(masses=[1, 2], lengths=0.5, damping=0.1)


def test_a_chain_tells_what_it_has_as_a_model_does():
    assert CHAIN.links == 2
    assert np.array_equal(CHAIN.masses, [1, 2]) and np.array_equal(CHAIN.lengths, [0.5, 0.5])
    assert CHAIN.coordinates == ["theta_1", "theta_2"] and CHAIN.rates == ["theta_dot_1", "theta_dot_2"]
    assert CHAIN.inputs == ["torque_1", "torque_2"]
    assert [*CHAIN.parameters] == ["gravity", "masses", "lengths", "damping"]
    assert np.array_equal(CHAIN.parameters["damping"], [0.1, 0.1]) and CHAIN.parameters["gravity"] == 9.81
    assert CHAIN.units == {
        **dict.fromkeys(CHAIN.coordinates, "rad"),
        **dict.fromkeys(CHAIN.rates, "rad/s"),
        **dict.fromkeys(CHAIN.inputs, "N m"),
        **{"gravity": "m/s^2", "masses": "kg", "lengths": "m", "damping": "N m s/rad"},
    }
    told = pendula.Chain(masses=["100 g", 2], lengths="50 cm")
    assert np.array_equal(told.masses, [0.1, 2]) and np.array_equal(told.lengths, [0.5, 0.5])
    cart = pendula.Model("cart_chain", links=2, cart_mass="500 g", masses=["100 g", 2])
    assert cart.parameters["cart_mass"] == 0.5 and cart.parameters["masses"] == [0.1, 2]
    assert cart == pendula.Model("cart_chain", links=2, cart_mass=0.5, masses=[0.1, 2])
    whirl = pendula.Chain(links=2, space="spatial")
    assert whirl.coordinates == ["theta_1", "theta_2", "phi_1", "phi_2"] and whirl.links == 2
    assert whirl.inputs[:3] == ["torque_x_1", "torque_y_1", "torque_z_1"]
    with pytest.raises(pendula.InputError, match="links"):
        pendula.Chain().masses  # noqa: B018


def test_systems_are_equal_that_move_alike():
    assert pendula.Chain(masses=[1, 1]) == pendula.Chain(links=2) != CHAIN
    assert hash(pendula.Chain(masses=[1, 1])) == hash(pendula.Chain(links=2))
    assert pendula.Chain() == pendula.Chain() != pendula.Chain(masses=2.0)
    cart = pendula.Model("cart_chain", links=2, cart_mass=2.0)
    assert cart == pendula.Model("cart_chain", links=2, cart_mass=2.0) != pendula.Model("cart_chain", links=2)
    assert pickle.loads(pickle.dumps(cart)) == cart and cart != "cart_chain"
    assert repr(pendula.Chain(links=2, drives=[{"link": 1, "amplitude": 1, "frequency": 2}])).endswith(
        "drives=[{'link': 1, 'amplitude': 1, 'frequency': 2}])"
    )


# Nothing is simulated.
@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: pendula.Chain(masses=[1, -1]), r"masses\[2\]: expected .* got -1"),
        (lambda: pendula.Chain(masses=[1, 1], lengths=[1, 1, 1]), "lengths: expected"),
        (lambda: pendula.Chain(masses=-1), "masses: expected .* got -1"),
        (lambda: pendula.Chain(space="plane"), "space: expected .*did you mean planar"),
        (
            lambda: pendula.Chain(links=2, drives=[{"link": 3, "amplitude": 1, "frequency": 1}]),
            r"drives\[0\]\.link",
        ),
        (lambda: pendula.Model("furuto"), "model: expected .*did you mean furuta"),
        (
            lambda: pendula.Model("furuta", nothing=1.0),
            "unknown keyword nothing, expected some of arm_inertia, .* links",
        ),
        (lambda: pendula.Model("cart_chain", cart_mass=-1.0), "cart_mass: expected .* got -1"),
        (
            lambda: pendula.Model("cart_chain", inputs={"pull": 1.0}),
            "inputs: expected some of push, got pull",
        ),
        (
            lambda: pendula.Model("cart_chain", feedback=[{"input": "push", "value": "-z"}]),
            r"feedback\[0\]\.value",
        ),
    ],
)
def test_what_is_wrong_is_told_where_it_is_given(make, told):
    with pytest.raises(pendula.InputError, match=told):
        make()


# A mass matrix that is singular where all coordinates are zero.
def test_a_system_without_a_start_at_zero_is_one(tmp_path):
    (tmp_path / "spring.py").write_text(
        "def define(model, links):\n"
        "    r, phi = model.coordinate('r', 'm'), model.coordinate('phi', 'rad')\n"
        "    model.lagrangian = (model.rate(r)**2 + r**2 * model.rate(phi)**2 - (r - 1)**2) / 2\n"
    )
    assert pendula.Model(tmp_path / "spring.py").simulate(0.1, r=1.0).success


def test_what_is_public_is_shown():
    assert sorted(dir(pendula)) == sorted([*pendula.__all__, "map"])
    assert "model" in dir(pendula) and all(hasattr(pendula, name) for name in dir(pendula))


def test_the_last_bob_of_a_chain_may_be_held():
    chain = pendula.Chain(links=8, masses=0.1, lengths=0.25, end={"at": [1.2, 0.0]})
    run = chain.simulate(1.0, shape="hanging")
    assert np.ptp(run["theta_3"]) < 1e-13  # measured 6.7e-16
    assert run["force_end_y"][0] == pytest.approx(0.45 * 9.81, rel=1e-9)
    assert "end={" in repr(chain)
    assert chain != pendula.Chain(links=8, masses=0.1, lengths=0.25)
    with pytest.raises(pendula.InputError, match=r"end.at: expected a point within 2 of the pivot"):
        pendula.Chain(links=8, lengths=0.25, end={"at": [3.0, 0.0]}).simulate(1.0, shape="hanging")
    with pytest.raises(pendula.InputError, match="did you mean at"):
        pendula.Chain(links=8, lengths=0.25, end={"att": [3.0, 0.0]}).simulate(1.0, theta=0.0)
