"""What a kernel can evaluate, and what it cannot."""

from __future__ import annotations

from sympy import (
    Expr,
    Function,
    acos,
    asin,
    atan,
    cos,
    cosh,
    exp,
    log,
    preorder_traversal,
    sin,
    sinh,
    tan,
    tanh,
)

TRIGONOMETRIC = (sin, cos)
FUNCTIONS: tuple[type[Function], ...] = (acos, asin, atan, cosh, exp, log, sinh, tan, tanh)
LANGUAGE = (
    "+ − * / powers roots exp log and the functions sin cos tan asin acos atan sinh cosh tanh; "
    "Abs sign Min Max Heaviside and Piecewise in models"
)
MOST_FACTORS = 64  # of a power, which is a product of as many
MOST_DIGITS = 300  # of a number before or after the point


def refusal(expression: Expr) -> str | None:
    """Why a kernel cannot evaluate an expression of a model; None where it can."""
    for part in preorder_traversal(expression):
        if part.is_Symbol:
            continue
        if part.is_Number and not (part.is_finite and part.is_real):
            return f"{part} is no finite real number"
        if part.is_Rational and part and not 10**-MOST_DIGITS < abs(part) < 10**MOST_DIGITS:
            return f"the number {part.evalf(3)} is out of the range that numbers of a kernel have"
        if part.is_number and part.is_real is False:
            return f"{part} is no real number"
        if part.is_Pow:
            if part.base.is_negative and part.exp.is_integer is not True:
                return f"{part} is no real number"
            if part.exp.is_Rational and abs(part.exp.p) > MOST_FACTORS and part.exp.q <= MOST_FACTORS:
                return f"a kernel cannot evaluate {part}: it has powers up to {MOST_FACTORS}"
        elif not (
            part.is_Add or part.is_Mul or part.is_number or isinstance(part, (*TRIGONOMETRIC, *FUNCTIONS))
        ):
            return f"a kernel cannot evaluate {part}: it has {LANGUAGE}"
    return None
