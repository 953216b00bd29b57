"""Motions that are prescribed: functions of time in place of a symbol, with its rates."""

import pytest
from sympy import Integer, Symbol, cos, sin

from pendula_codegen.errors import GenerationError
from pendula_codegen.feedback import close_loops
from pendula_codegen.model import Model


def shaken() -> tuple[Model, Symbol, Symbol]:
    model = Model("shaken", 1, "shaken.py")
    x, pivot = model.coordinate("x", "m"), model.motion("pivot", "m")
    model.lagrangian = model.rate(x + pivot) ** 2 / 2
    model.force(x, model.rate(model.rate(pivot)))
    model.point("bob", (x + pivot, 0))
    return model, x, pivot


def test_rates_are_those_of_what_drives_it():
    model, x, _ = shaken()
    close_loops(model, ["pivot=3 t * sin()", "pivot=t t *"])
    t, v = model.time, Symbol("x_dot", real=True)
    assert (model.lagrangian - (v + 3 * cos(3 * t) + 2 * t) ** 2 / 2).expand() == 0
    assert model.system.forces[0] == 2 - 9 * sin(3 * t)
    assert model.points[0].components[0] == x + sin(3 * t) + t**2


def test_it_rests_where_nothing_drives_it():
    model, x, _ = shaken()
    close_loops(model, [])
    assert model.lagrangian == Symbol("x_dot", real=True) ** 2 / 2
    assert model.system.forces == (Integer(0),)
    assert model.points[0].components[0] == x


def test_what_it_cannot_be_is_told():
    model, _, _ = shaken()
    with pytest.raises(GenerationError, match=r"the motion pivot holds 'x', a coordinate"):
        close_loops(model, ["pivot=x"])
    for law in ("t 1 < 0 1 ?:", "t 1 < 0 t 1 - ?:"):
        model, _, _ = shaken()
        with pytest.raises(GenerationError, match="the motion pivot or its rate jumps where t - 1 = 0"):
            close_loops(model, [f"pivot={law}"])


def test_inputs_have_no_rates_and_say_what_has():
    model, _, _ = shaken()
    push = model.input("push", "N")
    with pytest.raises(
        GenerationError, match=r'whose rates nobody knows: model\.motion\("push", "N"\) is an input'
    ):
        model.rate(push * 2)
    with pytest.raises(GenerationError, match=r"expected an input of the model: push, pivot; got pusch"):
        close_loops(model, ["pusch=t"])
