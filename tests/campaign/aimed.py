"""Families that attack.py aims at what runs may get wrong without a word: each is a function that draws a case.

FAMILIES has them by name; case k of a seed is of family k modulo their number. A family that no compiled reference can
move, since its forces have pieces, has a motion in closed form: MOTIONS has it by the family's name.
"""

import random
from collections.abc import Callable, Iterator

import numpy as np

Real = np.longdouble
# Tables of the scenario, the text of model.py; for the compiled reference, expressions and widths of what is narrow.
Drawn = tuple[dict, str, *tuple[tuple[str, float], ...]]


def power(dice: random.Random, low: float, high: float) -> float:
    return 10 ** dice.uniform(low, high)


def asked(dice: random.Random) -> dict:
    """Nothing in a half of all cases; else an accuracy, a tolerance or a method."""
    return dice.choice(
        [
            {},
            {},
            {"accuracy": power(dice, -10, -4)},
            {
                "accuracy": power(dice, -10, -4),
                "method": dice.choice(["gauss", "taylor"]),
            },
            {"tolerance": power(dice, -11, -5)},
        ]
    )


# --- short fast phases


CARTESIAN = """from sympy import sqrt


def define(model, links):
    x = model.coordinate("x", "m")
    y = model.coordinate("y", "m")
    xd, yd = model.rate(x), model.rate(y)
    model.lagrangian = (xd**2 + yd**2) / 2 + 1 / sqrt(x**2 + y**2)
"""
POLAR = """def define(model, links):
    r = model.coordinate("r", "m")
    a = model.coordinate("a", "rad")
    rd, ad = model.rate(r), model.rate(a)
    model.lagrangian = (rd**2 + r**2 * ad**2) / 2 + 1 / r
"""


def close_passage(dice: random.Random) -> Drawn:
    """A body that falls past a centre of force, once to five times: at a distance of L²/2."""
    aside = power(dice, -2.3, -0.3)
    polar = dice.random() < 0.4
    start = {"r": 1.0, "a_dot": aside} if polar else {"x": 1.0, "y_dot": aside}
    run = {"duration": dice.uniform(1.0, 10.0), **asked(dice)}
    return {
        "system": {"model": "model.py"},
        "start": start,
        "run": run,
    }, POLAR if polar else CARTESIAN


def whip(dice: random.Random) -> Drawn:
    """A chain of three or four whose links between are light: they crack."""
    links = dice.choice([3, 3, 4])
    masses = [1.0, *(power(dice, -6, -3) for _ in range(links - 2)), 1.0]
    chain = {
        "space": "planar",
        "masses": masses,
        "lengths": [dice.uniform(0.5, 1.0) for _ in range(links)],
    }
    start = {"theta": [dice.uniform(-3, 3) for _ in range(links)]}
    run = {"duration": dice.uniform(0.5, 2.0), **asked(dice)}
    run.setdefault("accuracy", dice.choice([1e-4, 1e-6]))
    if "tolerance" in run:
        del run["accuracy"]
    if run.get("method") == "taylor":
        del run["method"]  # of three links and more there may be none
    return {
        "chain": {**chain, "links": links, "gravity": 9.81},
        "start": start,
        "run": run,
    }, ""


# --- hills that a look or two between may miss, and what is not smooth


POWERS = """from sympy import Abs, cos, sign, sqrt


def define(model, links):
    x = model.coordinate("x", "{unit}")
    v = model.rate(x)
    a = model.parameter("a", "1", default=1.0)
    model.lagrangian = v**2 / 2 - ({potential})
    model.force(x, {force})
"""
QUOTIENTS = """def define(model, links):
    x = model.coordinate("x", "m")
    v = model.rate(x)
    a = model.parameter("a", "1", default=1.0)
    w = model.parameter("w", "1", default=1.0)
    model.lagrangian = {lagrangian}
"""


def turn_or_pass(dice: random.Random, low: float, high: float) -> dict:
    """A start that any of what stands at 0 is met from."""
    return {
        "x": dice.uniform(low, high),
        "x_dot": dice.choice([0.0, dice.uniform(-3, 3), power(dice, -3, 1)]),
    }


def powers(dice: random.Random) -> Drawn:
    """Hills, walls and wells of a high power, drag and springs of one that is no integer, roots at zero."""
    k = dice.choice([20, 40, 60])
    unit, potential, force, narrow = dice.choice(
        [
            ("rad", f"a * ((1 + cos(x)) / 2) ** {k}", "0", ("sin(x/2)", 0.1)),
            ("rad", f"a * cos(x / 2) ** {k}", "0", ("sin(x/2)", 0.1)),
            ("m", f"a * x**{k}", "0", ("1 - x*x", 0.03)),
            ("m", f"x**2 / 2 - a * x**2 * (1 - x**2 / 16) ** {k}", "0", ("x", 0.1)),
            ("m", "x**2 / 2", "-a * sign(v) * Abs(v) ** 1.7", ("x_dot", 1e-3)),
            ("m", "x**2 / 2", "-a * v * Abs(v) ** 0.5", ("x_dot", 1e-3)),
            ("m", "0", "-a * sign(x) * Abs(x) ** 2.5", ("x", 1e-3)),
            ("m", "0", "-a * sign(x) * sqrt(Abs(x))", ("x", 1e-3)),
        ]
    )
    start = turn_or_pass(dice, -4, 4) if "16" in potential or unit == "rad" else turn_or_pass(dice, -0.9, 0.9)
    system = {"model": "model.py", "parameters": {"a": power(dice, -2, 1)}}
    run = {"duration": dice.uniform(2.0, 10.0), **asked(dice)}
    return (
        {"system": system, "start": start, "run": run},
        POWERS.format(unit=unit, potential=potential, force=force),
        narrow,
    )


def quotients(dice: random.Random) -> Drawn:
    """Hills with flat tops, narrow gates, masses that almost vanish."""
    k, gate = dice.choice([10, 20, 60]), power(dice, -5, -1)
    width = dice.choice([dice.uniform(0.05, 1.0), gate])
    lagrangian, narrow = dice.choice(
        [
            (f"v**2 / 2 - x**2 / 2 - a / (1 + (x / w) ** {k})", width / k),
            ("v**2 / 2 - x**2 / 2 - a / (1 + (x / w) ** 2)", width),
            ("(x**2 + w**2) * v**2 / 2 - a * x**2 / 2", width),
        ]
    )
    system = {"model": "model.py", "parameters": {"a": power(dice, -2, 1), "w": width}}
    run = {"duration": dice.uniform(2.0, 10.0), **asked(dice)}
    edges = f"x*x/{width!r} - {width!r}" if f"** {k}" in lagrangian else "x"
    return (
        {"system": system, "start": turn_or_pass(dice, -4, 4), "run": run},
        QUOTIENTS.format(lagrangian=lagrangian),
        (edges, narrow),
    )


# --- pieces


WALL = """from sympy import Max


def define(model, links):
    x = model.coordinate("x", "m")
    k = model.parameter("k", "N/m", default=1.0)
    model.lagrangian = model.rate(x) ** 2 / 2 - 9.81 * x - k * Max(0, -x) ** 2 / 2
"""
DETENT = """from sympy import sign


def define(model, links):
    x = model.coordinate("x", "m")
    a = model.parameter("a", "N", default=1.0)
    c = model.parameter("c", "N*s/m", default=1.0)
    model.lagrangian = model.rate(x) ** 2 / 2
    model.force(x, -a * sign(x) - c * model.rate(x))
"""


def stiff_wall(dice: random.Random) -> Drawn:
    """A ball on a floor that it stays in for a microsecond."""
    system = {"model": "model.py", "parameters": {"k": power(dice, 4, 12)}}
    run = {"duration": dice.uniform(0.5, 5.0), **asked(dice)}
    return {"system": system, "start": {"x": dice.uniform(0.2, 2.0)}, "run": run}, WALL


def piled_switches(dice: random.Random) -> Drawn:
    """A preloaded detent with a viscous damper: swings get ever shorter."""
    system = {
        "model": "model.py",
        "parameters": {"a": power(dice, -1, 1), "c": power(dice, -1, 1)},
    }
    run = {"duration": power(dice, 0, 1.3), **asked(dice)}
    return {
        "system": system,
        "start": {"x": dice.uniform(0.1, 2.0)},
        "run": run,
    }, DETENT


# --- damping


SPRING = """def define(model, links):
    x = model.coordinate("x", "m")
    c = model.parameter("c", "N*s/m", default=1.0)
    model.lagrangian = model.rate(x) ** 2 / 2 - x**2 / 2
    model.dissipation = c * model.rate(x) ** 2 / 2
"""
BUFFER = """from sympy import Heaviside


def define(model, links):
    x = model.coordinate("x", "m")
    c = model.parameter("c", "N*s/m", default=1.0)
    model.lagrangian = model.rate(x) ** 2 / 2 - 9.81 * x
    model.force(x, -c * model.rate(x) * Heaviside(-x))
"""


def strong_damping(dice: random.Random) -> Drawn:
    """A spring, most often overdamped, with and without a rate at the start that the damping stops at once."""
    start = {"x": dice.choice([1.0, 1.0, 0.0]), "x_dot": dice.choice([-1, 1]) * power(dice, -6, 1)}
    if start["x"] and dice.random() < 0.2:
        del start["x_dot"]
    run = {"duration": power(dice, -1, 1), **asked(dice)}
    if dice.random() < 0.3:
        run["method"] = "radau"
    return {
        "system": {"model": "model.py", "parameters": {"c": power(dice, 0, 7)}},
        "start": start,
        "run": run,
    }, SPRING


def late_damping(dice: random.Random) -> Drawn:
    """A body that falls into a damper."""
    system = {"model": "model.py", "parameters": {"c": power(dice, 0, 7)}}
    start = {"x": dice.uniform(0.2, 2.0), "x_dot": dice.choice([0.0, dice.uniform(-3, 3)])}
    return {
        "system": system,
        "start": start,
        "run": {"duration": dice.uniform(1.0, 5.0), **asked(dice)},
    }, BUFFER


FAMILIES: dict[str, Callable[[random.Random], Drawn]] = {
    each.__name__: each
    for each in (
        close_passage,
        whip,
        powers,
        quotients,
        stiff_wall,
        piled_switches,
        strong_damping,
        late_damping,
    )
}


# --- motions in closed form: (t, x, v) at each switching, and x(t), v(t) from there on


Piece = tuple[Real, Callable[[Real], tuple[Real, Real]]]


def bounces(x: Real, v: Real, parameters: dict[str, Real]) -> Iterator[Piece]:
    """Parabolas, and arcs of sines below zero. v is 0 at the start."""
    del v
    g, k = Real(9.81), Real(parameters["k"])
    w, fast = np.sqrt(k), np.sqrt(2 * g * x)
    rise = g / k
    time, top = Real(0), np.sqrt(2 * x / g)
    within = 2 * (4 * np.arctan(Real(1)) - np.arctan(fast * w / g)) / w
    yield time, lambda t, h=x: (h - g * t * t / 2, -g * t)
    time += top
    while True:
        yield (
            time,
            lambda t: (
                rise * (np.cos(w * t) - 1) - fast / w * np.sin(w * t),
                -rise * w * np.sin(w * t) - fast * np.cos(w * t),
            ),
        )
        time += within
        yield time, lambda t: (fast * t - g * t * t / 2, fast - g * t)
        time += 2 * top


def detents(x: Real, v: Real, parameters: dict[str, Real]) -> Iterator[Piece]:
    """x'' = −a s − c x' by sides s, from x > 0 at rest."""
    a, c = Real(parameters["a"]), Real(parameters["c"])
    time, side, limit = Real(0), Real(1), a / c
    while True:

        def piece(t: Real, x: Real = x, v: Real = v, s: Real = side) -> tuple[Real, Real]:
            fast, lost = v + s * limit, -np.expm1(-c * t)
            return x + fast * lost / c - s * limit * t, fast * np.exp(-c * t) - s * limit

        yield time, piece
        t = 2 * abs(v) / a if v else np.sqrt(2 * x / a) * (1 + c * np.sqrt(x / a))
        for _ in range(60):  # Newton from beyond: x(t) is concave towards the other side
            there, speed = piece(t)
            change = there / speed
            t -= change
            if abs(change) <= 4e-20 * t:
                break
        x, v = Real(0), piece(t)[1]
        time, side = time + t, -side


def exponentials(x: Real, v: Real, parameters: dict[str, Real]) -> Iterator[Piece]:
    """x'' = −x − c x'; below c = 2 its rates are complex."""
    c = np.clongdouble(parameters["c"])
    fast = -(c + np.sqrt((c - 2) * (c + 2))) / 2
    slow = 1 / fast
    b = (v - slow * x) / (fast - slow)
    a = x - b

    def piece(t: Real) -> tuple[Real, Real]:
        one, other = a * np.exp(slow * t), b * np.exp(fast * t)
        return (one + other).real, (slow * one + fast * other).real

    yield Real(0), piece
    yield Real(np.inf), piece


def falls(x: Real, v: Real, parameters: dict[str, Real]) -> Iterator[Piece]:
    """x'' = −g, below zero −g − c x'."""
    g, c = Real(9.81), Real(parameters["c"])
    yield Real(0), lambda t: (x + v * t - g * t * t / 2, v - g * t)
    speed = -np.sqrt(v * v + 2 * g * x)
    slow = -g / c

    def within(t: Real) -> tuple[Real, Real]:
        lost = -np.expm1(-c * t)
        return slow * t + (speed - slow) * lost / c, speed - (speed - slow) * lost

    yield (v - speed) / g, within
    yield Real(np.inf), within


MOTIONS: dict[str, Callable[[Real, Real, dict[str, Real]], Iterator[Piece]]] = {
    "stiff_wall": bounces,
    "piled_switches": detents,
    "strong_damping": exponentials,
    "late_damping": falls,
}
MOST_PIECES = 20000


def rows(
    family: str,
    start: tuple[Real, Real],
    parameters: dict[str, Real],
    times: list[float],
) -> np.ndarray:
    """x, v and t at ascending times, as far as MOST_PIECES come."""
    motion = MOTIONS[family](*start, parameters)
    found: list[tuple[Real, Real, Real]] = []
    begin, piece = next(motion)
    after = next(motion)
    pieces = 1
    for t in map(Real, times):
        while after[0] <= t and pieces < MOST_PIECES:
            (begin, piece), after, pieces = after, next(motion), pieces + 1
        if pieces == MOST_PIECES:
            break
        found.append((*piece(t - begin), t))
    return np.array(found, dtype=Real).reshape(-1, 3)


def draw(seed: int, number: int) -> tuple[str, dict, str, list[tuple[str, float]]]:
    """Family, tables, the text of the model, what is narrow in it."""
    dice = random.Random(f"aimed:{seed}:{number}")
    family = list(FAMILIES)[number % len(FAMILIES)]
    tables, text, *narrow = FAMILIES[family](dice)
    tables["output"] = dice.choice([{"every": 1}, {"every": 1}, {"interval": tables["run"]["duration"] / 50}])
    return family, tables, text, narrow
