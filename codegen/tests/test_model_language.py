"""What a model may say: what means something else than it seems, or cannot be computed, is refused with its line."""

from pathlib import Path

import pytest
from sympy import Rational, sqrt

from pendula_codegen.errors import GenerationError
from pendula_codegen.kernel_program import render_bytecode, render_c, render_llvm
from pendula_codegen.model import Model, read_model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.render import render_model

HEAD = """from sympy import *


def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    t, push = model.time, model.input("push", "N")
    m = model.parameter("mass", "kg", default=1.0, positive=True)
    kinetic = m * (model.rate(x)**2 + model.rate(y)**2) / 2
    model.lagrangian = kinetic - x**2 / 2
"""


def read(folder: Path, line: str) -> Model:
    file = folder / "said.py"
    file.write_text(f"{HEAD}    {line}\n")
    return read_model(file)


REFUSED = {
    "model.force(x, -model.rate(model.rate(x)))": "rate holds 'x_dot', the rate of x, which may not stand in it",
    "model.force(x, model.rate(x * model.rate(y)))": "rate holds 'y_dot', the rate of y, which may not stand in it",
    "model.force(x, model.rate(push))": "rate holds 'push', an input, whose rates nobody knows: model.motion",
    "model.force(x, model.rate(sin(x) + push**2))": "rate holds 'push', an input, whose rates nobody knows",
    "model.force(x, gamma(x))": "force: a kernel cannot evaluate gamma(x): it has + − * /",
    "model.force(x, Piecewise((x, x > 0)))": "force: Piecewise((x, x > 0)) has no value where none of its conditions",
    "model.force(x, Piecewise((x, Eq(x, 0)), (0, True)))": "force: a kernel cannot tell pieces apart by Eq(x, 0): it",
    "model.lagrangian += sign(x)": "lagrangian: it or a momentum jumps where x = 0, which would be a blow",
    "model.lagrangian += Max(0, push)": "lagrangian: the input push may stand in forces only",
    "model.force(x, x // 2)": "force: a kernel cannot evaluate floor(x/2): it has",
    "model.force(x, x**65)": "force: a kernel cannot evaluate x**65: it has powers up to 64",
    "model.force(x, x**1000.0)": "force: a kernel cannot evaluate x**1000: it has powers up to 64",
    "model.force(x, x * sqrt(Integer(-2)))": "is no real number",
    "model.force(x, (-2)**x)": "(-2)**x is no real number",
    "model.force(x, x * oo)": "is no finite real number",
    "model.force(x, (1e-200 * x)**2)": "force: the number 1.00E-400 is out of the range",
    "model.force(x, 1e200 * x * 1e200)": "force: the number 1.00E+400 is out of the range",
    "model.point('bob', (x, y), kind='wagon')": "'pivot', 'weight' or 'floor', got 'wagon'",
    "model.point('bob', (x, y), kind=1)": "'pivot', 'weight' or 'floor', got 1",
    "model.spring('origin', 'bob')": "spring: expected a point that the model has by now, one of origin; got 'bob'",
    "model.thread(model.point('bob', (x, y)), 'origin_1')": "by now, one of bob, origin; got 'origin_1'",
    "model.spring('origin', (x, y))": "spring: expected a point that the model has by now, one of origin; got (x, y)",
    "model.spring(model.point('bob', (x, y)), 'bob')": "spring: expected two different points, got bob twice",
    "model.constraint('tie', x - push, 'm')": "constraint tie holds 'push', an input, which may not stand in it",
    "model.constraint('tie', x * model.rate(y) ** 2, 'm')": "expected an expression of positions, or one",
    "model.constraint('tie', sin(model.rate(y)), 'm/s')": "linear in rates, got another function of y_dot",
    "model.constraint('tie', model.rate(x) - push, 'm/s')": "constraint tie holds 'push', an input, which may not",
    "model.constraint('tie', Abs(x) * model.rate(x), 'm/s')": "constraint tie: expected one smooth function, got one",
    "model.constraint('one', x - y, 'm'), model.constraint('two', model.rate(x) - model.rate(y), 'm/s')": (
        "constraint two: expected one that others do not contain, got what one fix already"
    ),
    "model.constraint('tie', x + Symbol('z'), 'm')": "tie holds the symbol 'z', which the model does not declare",
    "model.constraint('tie', Abs(x) - y, 'm')": "constraint tie: expected one smooth function, got one of several",
    "model.constraint('tie', Integer(2), 'm')": "constraint tie: expected 0 somewhere, got 2, which is never 0",
    "model.constraint('tie', m - t, 'm')": "constraint tie: expected one that some coordinate or rate changes",
    "model.constraint('tie', sin(x)**2 + cos(x)**2 - 2, 'm')": "tie: expected one that some coordinate or rate",
    "model.constraint('tie', x, 'm'), model.constraint('tie', y, 'm')": "expected a new name, got 'tie', which is a",
    "model.constraint('x', x, 'm')": "expected a new name, got 'x', which is a coordinate already",
    "model.constraint('one', x * y - 1, 'm'), model.constraint('two', 2 - 2 * x * y, 'm')": (
        "constraint two: expected one that others do not contain, got what one fix already"
    ),
    "model.force(x, Symbol('x', positive=True))": "force holds a symbol 'x' that is not the model's own, a coordinate",
}


def test_points_say_what_they_are_drawn_as(tmp_path):
    """Whatever a kernel is printed as, it says the same as the file."""
    model = read(
        tmp_path,
        "wall = model.point('wall', (0, 1), kind='pivot'); model.point('cart', (x, 0), kind='cart'); "
        "model.point('ball', (x, y)); model.spring(wall, 'cart'); model.thread('origin', 'ball'); "
        "model.point('ground', (0, -1), kind='floor'); block = model.point('block', (1, x), kind='weight'); "
        "model.pulleys(block, wall); model.rod(block, 'ball')",
    )
    assert [point.kind for point in model.points] == ["pivot", "cart", "bob", "floor", "weight"]
    connections = [("spring", (0, 1)), ("thread", (-1, 2)), ("pulleys", (4, 0)), ("rod", (4, 2))]
    assert [(each.kind, each.ends) for each in model.connections] == connections
    lines = [
        "point wall 2 pivot",
        "point cart 2 cart",
        "point ball 2 bob",
        "connection spring 0 1",
        "connection thread -1 2",
        "point block 2 weight",
        "connection pulleys 4 0",
        "connection rod 4 2",
    ]
    c = render_c(model, "said.py", "said.c").replace("\\t", " ")
    program = render_bytecode(model).replace("\t", " ")
    llvm = render_llvm(model, "sse2").replace("\\09", " ")
    for line in lines:
        assert line in c
        assert line in program.splitlines()
        assert line in llvm
    header = render_model(model, "said.py").text
    assert 'point_kinds = {"pivot", "cart", "bob", "floor", "weight"};' in header
    assert 'connection_kinds = {"spring", "thread", "pulleys", "rod"};' in header
    assert "connection_ends = {0, 1, -1, 2, 4, 0, 4, 2};" in header


@pytest.mark.parametrize("line", REFUSED)
def test_it_is_refused_with_its_line(line, tmp_path):
    with pytest.raises(GenerationError) as refused:
        read(tmp_path, line)
    assert str(refused.value).startswith(f"{tmp_path / 'said.py'}:10: ")
    assert REFUSED[line] in str(refused.value)


def test_many_coordinates_and_constraints_do_not_depend_on_one_another(tmp_path):
    """Of 60 in a row a determinant is 1e-16 of the product of its diagonal, or less."""
    model = read(
        tmp_path,
        "row = [model.coordinate(f'u_{k}', 'm') for k in range(60)]; "
        "model.lagrangian += sum((model.rate(b) - model.rate(a))**2 for a, b in zip([0, *row], row)); "
        "[model.constraint(f'tie_{k}', row[k + 1] - row[k], 'm') for k in range(59)]",
    )
    assert len(model.constraints) == 59


def test_a_constant_has_no_rate_and_time_has_one():
    model = Model("said", 1, "said.py")
    x, m = model.coordinate("x", "m"), model.parameter("m", "kg")
    assert model.rate(m) == 0 and model.rate(2) == 0 and model.rate(model.time) == 1
    assert model.rate(x * model.time) == model.rate(x) * model.time + x


def test_floating_point_exponents_are_those_of_fractions():
    """x to the power of 2.0 was exp(2.0 log x): no number where x < 0."""
    model = Model("said", 1, "said.py")
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x) ** 2.0 / 2 - x**2.0 * (1 + x**2) ** 0.5
    assert model.lagrangian == model.rate(x) ** 2 / 2 - x**2 * sqrt(1 + x**2)


@pytest.mark.parametrize(
    ("said", "printed"),
    [
        # No number where x < 0, as SymPy has none that is real there.
        (lambda x: x ** Rational(1, 3), "cbrt(sqrt_1)"),
        (lambda x: x ** Rational(-1, 5), "pow(x_, Real(1.0 / 5.0))"),
        (lambda x: x**0.3, "pow(x_, Real(0.3))"),
        (lambda x: (1 + x**2) ** Rational(1, 3), "cbrt(Real(1.0) + x_ * x_)"),
    ],
)
def test_roots_of_negative_numbers_are_none(said, printed, tmp_path):
    file = tmp_path / "said.py"
    file.touch()
    model = Model("said", 1, str(file))
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x) ** 2 / 2
    model.force(x, said(x))
    assert printed in render_model(model, "said.py").text


def test_coefficients_of_very_different_sizes_are_kept():
    """Their ratio, that shared sums are made by, is no double."""
    model = Model("said", 1, "said.py")
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    model.lagrangian = model.rate(x) ** 2 / 2 + model.rate(y) ** 2 / 2
    model.force(x, 1e-290 * x + 1e290 * y)
    model.force(y, 2e-290 * x + 2e290 * y)
    kernel = ModelKernel(model)
    for function in kernel.functions():
        for coefficient, _ in (
            term for terms in kernel.program(function).graph.sums.values() for term in terms
        ):
            assert 1e-300 < abs(float(coefficient)) < 1e300
