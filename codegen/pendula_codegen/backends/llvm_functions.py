"""Functions that kernels call, as LLVM's text: the same as templates/sincos.c.j2, exp.c.j2 and log.c.j2 in C."""

from __future__ import annotations

from collections.abc import Callable

from pendula_codegen.backends.c import CALLS
from pendula_codegen.backends.llvm_text import LlvmFunction, literal

ROUND = 6755399441055744.0  # 1.5·2⁵²: adding it rounds to an integer, and leaves its low bits in the mantissa
LARGE = 1e5  # angles from which the standard library takes over
SMALLEST, LARGEST = float.fromhex("0x1p-1022"), float.fromhex("0x1.fffffffffffffp+1023")
LIBRARY = sorted({"sin", "cos", "exp", "log", *CALLS} - {"sqrt"})  # of C, of one number


def library_declarations() -> list[str]:
    lines = [f"declare double @{name}(double) #1" for name in LIBRARY]
    return [*lines, "declare double @pow(double, double) #1"]


def call_of(function: LlvmFunction, operation: str, x: str, exponent: float) -> str:
    """The result of an operation of a tape that is a function of one argument, or a power."""
    kind, width = function.numbers, function.width
    if operation == "sqrt":
        return function.intrinsic("sqrt", x)
    if operation == "pow":
        return function.let(f"call fastcc {kind} @pow.{width}({kind} {x}, double {literal(exponent)})")
    return function.let(f"call fastcc {kind} @{operation}.{width}({kind} {x})")


def functions_of(width: int, used: set[str]) -> list[str]:
    """The functions of `width` numbers that these operations call."""
    made = {"sincos": _sincos, "exp": _exp, "log": _log}
    own = [text for name, make in made.items() if name in used for text in make(width)]
    called = sorted(used & CALLS - {"sqrt"} | used & {"pow"})
    return [*own, *(_by_lane(name, width) for name in called)]


def _begin(name: str, width: int, takes: str, gives: str, more: str = "") -> LlvmFunction:
    of = "double" if width == 1 else f"<{width} x double>"
    return LlvmFunction(
        f"internal fastcc {gives.replace('V', of)} @{name}.{width}({takes.replace('V', of)})",
        width,
        f"{more}#0",
    )


def _by_lane(name: str, width: int) -> str:
    more = ", double %exponent" if name == "pow" else ""
    function = _begin(name, width, f"V %x{more}", "V")
    found = [function.let(f"call double @{name}(double {x}{more})") for x in function.lanes("%x")]
    function.line(f"ret {function.numbers} {function.together(found)}")
    return function.text()


def _by_library(function: LlvmFunction, name: str, x: str, where: str, found: str) -> str:
    """The standard library's values where a condition holds, elsewhere `found`."""
    others = [function.let(f"call double @{name}(double {lane})") for lane in function.lanes(x)]
    return function.choose(where, function.together(others), found)


def _sincos(width: int) -> list[str]:
    """To 0.8 ulp: polynomials (the minimax coefficients of fdlibm) of the argument less quarters of a turn."""
    large = _begin("sincos_of_large", width, "V %x, V %sine, V %cosine", "{ V, V }", "noinline cold ")
    is_large = large.compare("uge", large.intrinsic("fabs", "%x"), large.number(LARGE))
    found = [
        _by_library(large, "sin", "%x", is_large, "%sine"),
        _by_library(large, "cos", "%x", is_large, "%cosine"),
    ]
    large.line(f"ret {large.pairs} {large.pair(*found)}")

    f = _begin("sincos", width, "V %x", "{ V, V }", "noinline ")
    x, one = "%x", f.number(1.0)
    shifted = f.polynomial(x, ROUND, float.fromhex("0x1.45f306dc9c883p-1"))
    n = f.subtract(shifted, f.number(ROUND))
    # The two leading pieces of π/2 have 33 bits each, so that their products with that integer are exact.
    y = f.subtract(x, f.multiply(n, f.number(float.fromhex("0x1.921fb544p+0"))))
    middle = f.multiply(n, f.number(float.fromhex("0x1.0b4611a6p-34")))
    r = f.subtract(y, middle)
    last = f.multiply(n, f.number(float.fromhex("0x1.3198a2e037073p-69")))
    low = f.subtract(f.subtract(f.subtract(y, r), middle), last)
    z = f.multiply(r, r)
    z2 = f.multiply(z, z)
    p01 = f.polynomial(z, -1.66666666666666324348e-01, 8.33333333332248946124e-03)
    p23 = f.polynomial(z, -1.98412698298579493134e-04, 2.75573137070700676789e-06)
    p45 = f.polynomial(z, -2.50507602534068634195e-08, 1.58969099521155010221e-10)
    q01 = f.polynomial(z, 4.16666666666666019037e-02, -1.38888888888741095749e-03)
    q23 = f.polynomial(z, 2.48015872894767294178e-05, -2.75573143513906633035e-07)
    q45 = f.polynomial(z, 2.08757232129817482790e-09, -1.13596475577881948265e-11)
    half = f.multiply(f.number(0.5), z)
    rest = f.subtract(one, half)

    def joined(first: str, second: str, third: str) -> str:
        return f.add(f.multiply(z2, f.add(f.multiply(z2, third), second)), first)

    p, q = joined(p01, p23, p45), joined(q01, q23, q45)
    s = f.add(r, f.add(f.multiply(f.multiply(r, z), p), f.multiply(low, rest)))
    lost = f.subtract(f.subtract(f.subtract(one, rest), half), f.multiply(r, low))
    c = f.add(rest, f.add(f.multiply(z2, q), lost))

    zero, sign_bit = f.integer(0), f.integer(-(2**63))
    quadrant = f.as_integers(shifted)
    swap = f.integral("sub", zero, f.integral("and", quadrant, f.integer(1)))  # all ones in odd quadrants
    s_bits, c_bits = f.as_integers(s), f.as_integers(c)
    difference = f.integral("and", f.integral("xor", s_bits, c_bits), swap)
    turned = f.integral("sub", zero, f.integral("and", quadrant, f.integer(2)))
    sign = f.integral("and", turned, sign_bit)
    other_sign = f.integral("xor", sign, f.integral("and", swap, sign_bit))
    sine = f.as_numbers(f.integral("xor", f.integral("xor", s_bits, difference), sign))
    cosine = f.as_numbers(f.integral("xor", f.integral("xor", c_bits, difference), other_sign))

    are_small = f.all(f.compare("olt", f.intrinsic("fabs", x), f.number(LARGE)))
    _otherwise(
        f,
        are_small,
        f.pairs,
        f.pair(sine, cosine),
        lambda: f.let(
            f"call fastcc {f.pairs} @sincos_of_large.{width}({f.numbers} {x}, {f.numbers} {sine}, {f.numbers} {cosine})"
        ),
    )
    return [large.text(), f.text()]


def _otherwise(f: LlvmFunction, condition: str, kind: str, found: str, other: Callable[[], str]) -> None:
    """Returns `found` where the condition holds, else the result of other()."""
    f.line(f"br i1 {condition}, label %usual, label %rare")
    f.label("%rare")
    f.line(f"ret {kind} {other()}")
    f.label("%usual")
    f.line(f"ret {kind} {found}")


def _exp(width: int) -> list[str]:
    """eˣ = 2ⁿ eʳ, |r| ≤ ½ log 2, by the series of eʳ, to 1.03 ulp."""
    if width == 1:
        return [_by_lane("exp", 1)]
    f = _begin("exp", width, "V %any", "V")
    low, high = f.number(-746.0), f.number(710.0)
    bounded = f.choose(f.compare("olt", "%any", low), low, "%any")
    x = f.choose(f.compare("ogt", bounded, high), high, bounded)
    n = f.subtract(f.polynomial(x, ROUND, float.fromhex("0x1.71547652b82fep+0")), f.number(ROUND))
    # log 2 in two pieces, of which the first has 33 bits.
    rest = f.subtract(x, f.multiply(n, f.number(float.fromhex("0x1.62e42feep-1"))))
    r = f.subtract(rest, f.multiply(n, f.number(float.fromhex("0x1.a39ef35793c76p-33"))))
    r2 = f.multiply(r, r)
    r4 = f.multiply(r2, r2)
    p01 = f.polynomial(r, 0.5, 1.0 / 6.0)
    p23 = f.polynomial(r, 1.0 / 24.0, 1.0 / 120.0)
    p45 = f.polynomial(r, 1.0 / 720.0, 1.0 / 5040.0)
    p67 = f.polynomial(r, 1.0 / 40320.0, 1.0 / 362880.0)
    p89 = f.polynomial(r, 1.0 / 3628800.0, 1.0 / 39916800.0)
    p1011 = f.polynomial(r, 1.0 / 479001600.0, 1.0 / 6227020800.0)
    high_part = f.multiply(r4, f.add(f.multiply(r2, p1011), p89))
    p = f.add(
        f.multiply(r4, f.add(high_part, f.add(f.multiply(r2, p67), p45))), f.add(f.multiply(r2, p23), p01)
    )
    power = f.add(f.number(1.0), f.add(r, f.multiply(r2, p)))
    # In two factors, each of which a double can have.
    half = f.polynomial(n, ROUND, 0.5)
    other = f.add(f.subtract(n, f.subtract(half, f.number(ROUND))), f.number(ROUND))
    for part in (half, other):
        exponent = f.integral("add", f.as_integers(part), f.integer(1023))
        power = f.multiply(power, f.as_numbers(f.integral("shl", exponent, f.integer(52))))
    f.line(f"ret {f.numbers} {power}")
    return [f.text()]


def _log(width: int) -> list[str]:
    """log x = n log 2 + log (1 + g), √½ ≤ 1 + g < √2, to 0.85 ulp, the latter by fdlibm's polynomial in g/(2 + g)."""
    if width == 1:
        return [_by_lane("log", 1)]
    others = _begin("log_of_others", width, "V %x, V %found", "V", "noinline cold ")
    is_other = others.let(f"xor {others.bits} {_is_normal(others)}, splat (i1 true)")
    others.line(f"ret {others.numbers} {_by_library(others, 'log', '%x', is_other, '%found')}")

    f = _begin("log", width, "V %x", "V")
    root = 0x3FE6A09E667F3BCD
    shifted = f.integral("add", f.as_integers("%x"), f.integer(0x3FF0000000000000 - root))
    exponent = f.integral("and", f.integral("lshr", shifted, f.integer(52)), f.integer(0xFFF))
    rounding = f.as_integers(f.number(ROUND))
    n_bits = f.integral("add", rounding, f.integral("sub", exponent, f.integer(1023)))
    n = f.subtract(f.as_numbers(n_bits), f.number(ROUND))
    mantissa = f.integral("and", shifted, f.integer(0xFFFFFFFFFFFFF))
    g = f.subtract(f.as_numbers(f.integral("add", mantissa, f.integer(root))), f.number(1.0))
    s = f.do("fdiv", g, f.add(f.number(2.0), g))
    z = f.multiply(s, s)
    w = f.multiply(z, z)
    half = f.multiply(f.multiply(f.number(0.5), g), g)
    even = f.polynomial(w, 2.222219843214978396e-01, 1.531383769920937332e-01)
    even = f.multiply(w, f.add(f.multiply(w, even), f.number(3.999999999940941908e-01)))
    odd = f.polynomial(w, 1.818357216161805012e-01, 1.479819860511658591e-01)
    for coefficient in (2.857142874366239149e-01, 6.666666666666735130e-01):
        odd = f.add(f.multiply(w, odd), f.number(coefficient))
    odd = f.multiply(z, odd)
    tail = f.multiply(n, f.number(float.fromhex("0x1.a39ef35793c76p-33")))
    inner = f.add(f.multiply(s, f.add(half, f.add(even, odd))), tail)
    rest = f.subtract(g, f.subtract(half, inner))
    found = f.add(f.multiply(n, f.number(float.fromhex("0x1.62e42feep-1"))), rest)
    _otherwise(
        f,
        f.all(_is_normal(f)),
        f.numbers,
        found,
        lambda: f.let(f"call fastcc {f.numbers} @log_of_others.{width}({f.numbers} %x, {f.numbers} {found})"),
    )
    return [others.text(), f.text()]


def _is_normal(f: LlvmFunction) -> str:
    enough = f.compare("oge", "%x", f.number(SMALLEST))
    return f.let(f"and {f.bits} {enough}, {f.compare('ole', '%x', f.number(LARGEST))}")
