"""Feedback: what a scenario adds to an input of a model or a chain, as a function of the motion, or of time alone.

What is continuous stands in the forces of the kernel, which is as exact with it as without, derivatives included.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import sympy
from sympy import And, Expr, Integer, Or, Piecewise, Symbol
from sympy.logic.boolalg import Boolean

from pendula_codegen.chain import Chain
from pendula_codegen.chain_kernel import declared_by
from pendula_codegen.errors import GenerationError
from pendula_codegen.exact import MOST_DENOMINATOR, exact
from pendula_codegen.model import Input, Model, rate_name


def close_loops(model: Model, laws: Iterable[str]) -> None:
    """Adds feedback laws to inputs: each is INPUT=WORDS in postfix notation, as `x 9 * ~` for −(x · 9).

    Words are numbers, names of columns of the motion, operators (~ negates), comparisons, `?:` of a condition and two
    values, and functions as `sin()`. A prescribed motion, a function of time, becomes the sum of its laws.
    """
    names = _columns(model)
    inputs = {each.symbol.name: each.symbol for each in model.inputs}
    motions = {each.symbol.name: each.symbol for each in model.motions}
    moved: dict[Symbol, Expr] = {}
    for law in laws:
        name, _, words = law.partition("=")
        value = _value(words, names)
        if name in motions:
            symbol = motions[name]
            moved[symbol] = moved.get(symbol, Integer(0)) + value
        elif name in inputs:
            model.feed(inputs[name], value)
        else:
            known = ", ".join([*inputs, *motions]) or "there is none"
            raise GenerationError(f"expected an input of the model: {known}; got {name}")
    model.move(moved)


@dataclass(frozen=True)
class SampledLaw:
    """What a controller adds to an input, kept within ± limit."""

    input: str
    value: Expr
    limit: float


def sampled_laws(model: Model, laws: Iterable[str]) -> list[SampledLaw]:
    """Of LIMIT=INPUT=WORDS each, words as close_loops takes them."""
    return _sampled(laws, _columns(model), model.inputs, "the model")


def sampled_laws_of_chain(chain: Chain, laws: Iterable[str]) -> list[SampledLaw]:
    """The same of a chain."""
    return _sampled(laws, _columns_of_chain(chain), declared_by(chain).inputs, "the chain")


def _sampled(
    laws: Iterable[str], columns: Mapping[str, Expr], inputs: Sequence[Input], system: str
) -> list[SampledLaw]:
    known, found = {each.symbol.name for each in inputs}, []
    for law in laws:
        limit, name, words = law.split("=", 2)
        if name not in known:
            raise GenerationError(f"feedback: expected an input of {system}, got {name}")
        found.append(SampledLaw(name, exact(_value(words, columns)), float(limit)))
    return found


def _exponent(value: Expr) -> Expr:
    """An exponent: simple fractions stay exact, others become floats."""
    return sympy.Float(value) if value.is_Rational and value.q > MOST_DENOMINATOR else value


def _columns(model: Model) -> dict[str, Expr]:
    names: dict[str, Expr] = {"t": model.time}
    for coordinate in model.coordinates:
        names[coordinate.symbol.name] = coordinate.symbol
        names[rate_name(coordinate.symbol.name)] = model.rate(coordinate.symbol)
    for point in model.points:
        names |= {f"{point.name}_{axis}": value for axis, value in zip("xyz", point.components, strict=False)}
    return names


def _columns_of_chain(chain: Chain) -> dict[str, Expr]:
    names: dict[str, Expr] = {"t": chain.time}
    names |= {symbol.name: symbol for symbol in (*chain.coordinates, *chain.velocities)}
    for i, position in zip(chain.numbers, chain.positions, strict=True):
        names |= {f"{axis}_{i}": value for axis, value in zip("xyz", position, strict=False)}
    return names


def _number(condition: Boolean) -> Expr:
    """1 where it holds, else 0, as expressions have it."""
    return Piecewise((Integer(1), condition), (Integer(0), True))


def _truth(value: Expr) -> Boolean:
    """The condition that a number was made of; of any other number whether it is not 0."""
    if isinstance(value, Piecewise) and [piece for piece, _ in value.args] == [1, 0]:
        return value.args[0][1]
    if value.is_number:
        return sympy.true if value != 0 else sympy.false
    return Or(value > 0, value < 0)


_OF_ONE = ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh", "exp", "log", "sqrt", "sign")

# How many operands a word takes, and what is made of them.
_OPERATIONS: dict[str, tuple[int, Callable[..., Expr]]] = {
    "+": (2, operator.add),
    "-": (2, operator.sub),
    "*": (2, operator.mul),
    "/": (2, operator.truediv),
    "^": (2, lambda base, exponent: base ** _exponent(exponent)),
    "~": (1, operator.neg),
    "<": (2, lambda x, y: _number(x < y)),
    "<=": (2, lambda x, y: _number(x <= y)),
    ">": (2, lambda x, y: _number(x > y)),
    ">=": (2, lambda x, y: _number(x >= y)),
    "&&": (2, lambda x, y: _number(And(_truth(x), _truth(y)))),
    "||": (2, lambda x, y: _number(Or(_truth(x), _truth(y)))),
    "?:": (3, lambda x, yes, no: Piecewise((yes, _truth(x)), (no, True))),
    **{f"{name}()": (1, getattr(sympy, name)) for name in _OF_ONE},
    "abs()": (1, sympy.Abs),
    "min()": (2, sympy.Min),
    "max()": (2, sympy.Max),
}


def _value(words: str, names: Mapping[str, Expr]) -> Expr:
    stack: list[Expr] = []
    for word in words.split():
        if word in _OPERATIONS:
            count, made = _OPERATIONS[word]
            stack[-count:] = [made(*stack[-count:])]
        elif word in names:
            stack.append(names[word])
        else:
            stack.append(sympy.Rational(*float(word).as_integer_ratio()))
    (value,) = stack
    return value
