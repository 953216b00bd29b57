"""Starts and keywords are alike wherever a system moves, and what is none of them is told."""

import numpy as np
import pendula
import pytest

CART = pendula.Model("cart_chain", links=2)
FIRST = {"theta": [0.1, 0.2]}

# What takes a start, and how it tells where the motion began.
TAKE = {
    "simulate": lambda **given: CART.simulate(0.1, **given).y[:, 0],
    "Simulation": lambda **given: pendula.Simulation(CART, **given).state,
    "differentiate": lambda **given: pendula.differentiate(CART, t=[0.0], **given).y[:, 0],
    "lyapunov": lambda **given: pendula.lyapunov(CART, 0.2, count=1, **given).exponents,
    "linearize": lambda **given: pendula.linearize(CART, **given).A,
    "ensemble": lambda **given: (
        pendula.ensemble(CART, 0.1, axes={"system.parameters.cart_mass": [1.0, 2.0]}, **given)[
            "theta_1"
        ].values
    ),
}


@pytest.mark.parametrize("take", TAKE)
def test_a_start_is_given_by_keywords_or_a_mapping(take):
    by_keyword, by_mapping = TAKE[take](**FIRST), TAKE[take](start=FIRST)
    assert np.array_equal(by_keyword, by_mapping)
    mixed = TAKE[take](start={"theta": [0.1, 0.2]}, x_dot=0.0)
    assert np.array_equal(mixed, by_mapping)
    with pytest.raises(pendula.InputError, match="theta is given twice"):
        TAKE[take](start=FIRST, theta=1.0)


@pytest.mark.parametrize("take", TAKE)
@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ("rtol", r"here it is accuracy="),
        ("t_eval", "here it is t="),
        ("max_step", "here it is step="),
        ("dt", "here it is interval="),
        ("tolerence", r"did you mean tolerance"),
        ("thetaa", "did you mean theta"),
        ("nonsense", "expected some of .*theta"),
    ],
)
def test_a_keyword_that_is_none_is_no_start(take, wrong, told):
    with pytest.raises(pendula.InputError, match=f"^{take}: unknown keyword {wrong}.*{told}"):
        TAKE[take](**FIRST, **{wrong: 1e-9})


def test_a_start_may_stand_after_the_duration():
    assert np.array_equal(CART.simulate(0.1, FIRST).y, CART.simulate(0.1, **FIRST).y)


@pytest.mark.parametrize("call", [pendula.Model.simulate, pendula.differentiate, pendula.ensemble])
def test_the_word_of_scipy_is_told_where_the_duration_is_missing(call):
    with pytest.raises(pendula.InputError, match="unknown keyword t_span: here it is duration="):
        call(CART, t_span=(0, 1), **FIRST)


def test_keywords_are_listed_once_and_not_by_older_names():
    with pytest.raises(pendula.InputError) as refused:
        CART.simulate(0.1, nonsense=1)
    listed = str(refused.value).split("expected some of ")[1].split(", ")
    assert len(listed) == len(set(listed)) and "theta_dot_1" in listed and "theta_1_dot" not in listed
    older, present = CART.simulate(0.1, theta_1_dot=1.0), CART.simulate(0.1, theta_dot_1=1.0)
    assert np.array_equal(older.y, present.y) and older.y.any()
