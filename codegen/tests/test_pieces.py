"""Functions of several pieces in models: what becomes of them, and what is refused."""

import random
from collections.abc import Callable

import pytest
from sympy import (
    Abs,
    Eq,
    Expr,
    Heaviside,
    Max,
    Min,
    Ne,
    Piecewise,
    Rational,
    Symbol,
    asin,
    cos,
    cosh,
    exp,
    lambdify,
    log,
    sign,
    sin,
    sqrt,
    tan,
)

from pendula_codegen.errors import GenerationError
from pendula_codegen.model import Model
from pendula_codegen.system_info import depends_on_time, is_periodic


def plain(unit: str = "m") -> tuple[Model, Expr, Expr]:
    """A model of one coordinate without forces, its coordinate and rate."""
    model = Model("pieces", 1, "pieces.py")
    x = model.coordinate("x", unit)
    v = model.rate(x)
    model.lagrangian = v**2 / 2
    return model, x, v


def values_of(model: Model, said: list[Expr], places: list[Symbol]) -> Callable[..., list[float]]:
    """Computes expressions without pieces at a place, with the indicators that belong to it."""
    symbols = list(places)
    switches = []
    for switch in model.switches:  # one may depend on those before it
        switches.append(lambdify(symbols, switch.value, "math"))
        symbols += [switch.above, switch.below]
    expressions = [lambdify(symbols, expression, "math") for expression in said]

    def values(*numbers: float) -> list[float]:
        all_numbers = list(numbers)
        for switch in switches:
            value = switch(*all_numbers)
            all_numbers += [float(value > 0), float(value <= 0)]
        return [expression(*all_numbers) for expression in expressions]

    return values


def test_pieces_are_what_sympy_says():
    """Values of a sum of everything, here and of SymPy, at places of all sides."""
    model, x, v = plain()
    y = model.coordinate("y", "m")
    said = {
        "Abs": v * Abs(v) + Abs(Abs(x) - 1),
        "sign": sign(x - y) * x + sign(v**2 - 1),
        "heaviside": Heaviside(x - 1) * y,
        "extremes": Max(x, y, v, 0) + Min(1, Max(-1, x * y)),
        "logic": Piecewise((x, (x > 0) & (y < 1)), (y, (v > 0) | ~(x < y)), (v, True)),
        "in one another": Piecewise((Piecewise((x**2, y > 0), (y, True)), x < y), (Abs(x), True)),
        "no values": Piecewise((log(x), x > 1), (sqrt(-x) + 1 / x, x < -0.5), (asin(x / 2), True)),
        "too large": Piecewise((exp(800 * x), x < 0), (cosh(800 * y), y**2 < 0.01), (tan(x), True)),
        "a root": sqrt(x**2) + Max(0, x) ** 3,
        "roots of pieces": Max(0, x, y) ** Rational(5, 2) + sqrt(Abs(x)) + log(Max(1, y)) + Abs(y) ** -0.5,
    }
    taken = [model._expression(value, "said") for value in said.values()]
    values = values_of(model, taken, [x, y, v])
    draw = random.Random(1)
    worst = 0.0
    for _ in range(200):
        numbers = {symbol: draw.uniform(-2, 2) for symbol in (x, y, v)}
        for value, ours in zip(said.values(), values(*numbers.values()), strict=True):
            truth = float(value.subs(numbers))
            worst = max(worst, abs(ours - truth) / max(1, abs(truth)))
    assert worst < 1e-14  # measured 3.2e-16
    assert len(
        {name for switch in model.switches for name in (switch.above.name, switch.below.name)}
    ) == 2 * len(model.switches)


def test_equal_switching_functions_are_one():
    model, x, v = plain()
    c = model.parameter("c", "1", default=1.0)
    model.force(x, -v * Abs(v) + sign(-v) + Max(0, 2 * v) + Piecewise((c, v <= 0), (0, v > 0), (1, True)))
    assert [switch.value for switch in model.switches] == [v]
    assert [parameter.name for parameter in model.ordered_parameters] == ["c", "above_1", "below_1"]
    assert [parameter.name for parameter in model.parameters] == ["c"]


def test_switching_functions_keep_the_size_that_they_are_written_in():
    """Decimal fractions are ones of large whole numbers, by which nothing is multiplied; they are told as decimals."""
    model, x, _v = plain()
    model.force(x, 1.1 * Min(0, Max(x - 0.248, -x - 0.1)) + Max(0, 0.165 * sin(1.872 * model.time) - x))
    assert [switch.text for switch in model.switches] == [
        "x - 0.074",
        "-above_1*x + 0.248*above_1 + below_1*x + 0.1*below_1",
        "x - 0.165*sin(1.872*t)",
    ]


def test_derivatives_of_pieces():
    model, x, v = plain()
    model.lagrangian = v**2 / 2 - Piecewise((5 * x**2, x < 0), (0, True))
    (switch,) = model.switches
    assert model.system.lagrangian.diff(x) == -10 * switch.below * x
    model.dissipation = Abs(v) ** 3
    above, below = model.switches[1].above, model.switches[1].below
    assert [
        model.force_along(x).subs({v: s * 2, above: (1 + s) // 2, below: (1 - s) // 2}) for s in (1, -1)
    ] == [-12, 12]


@pytest.mark.parametrize(
    ("lagrangian", "where"),
    [
        (lambda x, v: Piecewise((1, x < 0), (0, True)), "x = 0"),
        (lambda x, v: sign(x - 1) * (x + 1), "x - 1 = 0"),
        (lambda x, v: Abs(v), "x_dot = 0"),
        (lambda x, v: (2 + sign(x)) * v**2, "x = 0"),
        (lambda x, v: Piecewise((x**2, x**2 < 2), (3, True)), "x**2 - 2 = 0"),
    ],
)
def test_lagrangians_that_jump_are_refused(lagrangian, where):
    model, x, v = plain()
    model.lagrangian = v**2 / 2 + lagrangian(x, v)
    with pytest.raises(GenerationError, match="jumps where") as refused:
        model.system  # noqa: B018
    assert where in str(refused.value)


@pytest.mark.parametrize(
    "lagrangian",
    [
        lambda x, v: Piecewise((x**2, x < 0), (0, True)),
        lambda x, v: Max(0, Abs(x) - 1) ** 2,
        lambda x, v: (2 + Abs(x)) * v**2,
        lambda x, v: Piecewise((x**2, x**2 < 2), (2, True)),
        lambda x, v: Piecewise((x, x < 1), (1 + log(x), True)),
    ],
)
def test_lagrangians_whose_pieces_meet_are_taken(lagrangian):
    model, x, v = plain()
    model.lagrangian = v**2 / 2 + lagrangian(x, v)
    assert model.switches and model.system


def test_a_potential_may_switch_in_time():
    """There is no slope in space, so no blow; a mass that switches is one."""
    model, x, v = plain()
    k = model.parameter("k", "N/m", default=1.0)
    model.lagrangian = v**2 / 2 - (1 + Heaviside(model.time - 0.5)) * x**2 / 2 - Heaviside(k - 2) * x
    assert model.switches and model.system
    model, x, v = plain()
    model.lagrangian = (1 + Heaviside(model.time - 0.5)) * v**2 / 2
    with pytest.raises(GenerationError, match="a momentum jumps where 2\\*t - 1 = 0"):
        model.system  # noqa: B018


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (lambda x, v: Piecewise((x, x < 0), (0, x > 1)), "expected a last piece"),
        (lambda x, v: Piecewise((x, Eq(x, v)), (0, True)), "cannot tell pieces apart by Eq"),
        (lambda x, v: Piecewise((x, Ne(x, v)), (0, True)), "cannot tell pieces apart by"),
        (lambda x, v: sign(x).diff(x), "a kernel cannot evaluate"),
        (lambda x, v: sum(Abs(x - k) for k in range(17)), "up to 16 switching functions"),
    ],
)
def test_what_cannot_be_told_is_refused(value, message):
    model, x, v = plain()
    with pytest.raises(GenerationError, match=message):
        model.force(x, value(x, v))


def test_pieces_by_inputs_stand_in_forces_only():
    model, x, v = plain()
    push = model.input("push", "N")
    model.force(x, Max(0, push))
    assert model.system
    model.lagrangian = v**2 / 2 - Abs(x * push)
    with pytest.raises(GenerationError, match="the input push may stand in forces only"):
        model._check_lagrangian(model._lagrangian)
    with pytest.raises(GenerationError, match="'push', an input, which may not stand in it"):
        model.point("p", (x * sign(push), 0))


def test_indicators_have_names_of_their_own():
    model, x, v = plain()
    model.force(x, -sign(v))
    with pytest.raises(GenerationError, match="'above_1', which is the indicator of a switching function"):
        model.parameter("above_1", "1")


def test_feedback_goes_into_switching_functions():
    model, x, _v = plain()
    push = model.input("push", "N")
    model.force(x, Max(-1, Min(1, push)))
    model.feed(push, -3 * x)
    assert all(x in switch.value.free_symbols for switch in model.switches)


def test_time_and_turns_in_switching_functions():
    model, x, _v = plain("rad")
    model.force(x, sign(sin(x)))
    assert is_periodic(model.held_expressions(), x) and not depends_on_time(model)
    model.force(x, sign(x - 1) + sign(cos(model.time)))
    vars(model).pop("system", None)
    assert not is_periodic(model.held_expressions(), x) and depends_on_time(model)
