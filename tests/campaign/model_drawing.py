"""Random models: the text of a model file, and what stands in scenarios that move it.

draw(seed, which) is one of them: a frame (masses on lines, an elastic pendulum, a bead on a curve, a cart, driven
pivots) and some pieces (springs, bumps, walls, wells, pulses and switches in time, friction, drag, an input), each with
numbers over decades, half of them literals in the text and half of them parameters.
"""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field

COUNT = 40
MAIN = (
    "line",
    "plane",
    "bead",
    "hoop",
    "elastic",
    "pivot",
    "cart",
    "heavier",
    "coupled",
    "space",
)


def power(dice: random.Random, low: float, high: float) -> float:
    return 10 ** dice.uniform(low, high)


def number(text: str, values: dict) -> float:
    """The value of a width: a literal, a parameter, or an expression in them."""
    return float(eval(text, {"sqrt": math.sqrt}, dict(values)))


@dataclass
class Model:
    """narrow: (expression, width), each as text. ranges: of parameters, in decades. starts: (low, high) by key."""

    family: str
    text: str
    narrow: list[tuple[str, str]]
    ranges: dict[str, tuple[float, float]]
    starts: dict[str, tuple[float, float]]
    has_input: bool
    fastest: float
    longest: float

    def values(self, dice: random.Random) -> dict[str, float]:
        return {name: power(dice, *decades) for name, decades in self.ranges.items()}

    def start(self, dice: random.Random, values: dict) -> dict[str, float]:
        del values
        return {key: dice.uniform(*span) for key, span in self.starts.items()}

    def duration(self, dice: random.Random) -> float:
        return self.longest * power(dice, -0.7, 0)

    def drives(self, dice: random.Random) -> list[dict]:
        if not self.has_input:
            return []
        sine = {
            "amplitude": power(dice, -2, 0.7),
            "frequency": power(dice, -1, 2),
            "phase": dice.uniform(0, 6),
        }
        return [{"input": "u", **sine}, *dice.choice([[], [{"input": "u", "constant": dice.uniform(-1, 1)}]])]


@dataclass
class Builder:
    """Collects lines of a model file."""

    dice: random.Random
    coordinates: list[tuple[str, str]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    kinetic: list[str] = field(default_factory=list)
    potential: list[str] = field(default_factory=list)
    rayleigh: list[str] = field(default_factory=list)
    forces: list[str] = field(default_factory=list)
    points: list[str] = field(default_factory=list)
    narrow: list[tuple[str, str]] = field(default_factory=list)
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    starts: dict[str, tuple[float, float]] = field(default_factory=dict)
    pieces: list[str] = field(default_factory=list)
    has_input: bool = False

    def number(self, low: float, high: float) -> str:
        """A positive number of 10^low to 10^high: a literal, of few digits or of all, or a parameter."""
        if self.dice.random() < 0.5:
            value = power(self.dice, low, high)
            return repr(float(f"{value:.2g}") if self.dice.random() < 0.6 else value)
        name = f"p{len(self.ranges) + 1}"
        self.ranges[name] = (low, high)
        return name

    def coordinate(self, name: str, unit: str, span: tuple[float, float], speed: float) -> None:
        self.coordinates.append((name, unit))
        self.starts[name] = span
        self.starts[f"{name}_dot"] = (-speed, speed)

    def place(self) -> str:
        return repr(round(self.dice.uniform(-1, 1), 2))

    def text(self) -> str:
        names = [f'    {q} = model.coordinate("{q}", "{unit}")' for q, unit in self.coordinates]
        names += [f"    {q}_dot = model.rate({q})" for q, _ in self.coordinates]
        # Not all are declared as positive: SymPy rewrites less where it knows less.
        names += [
            f'    {p} = model.parameter("{p}", "1", default={power(self.dice, *r):.3g}'
            + self.dice.choice(["", ", positive=True"])
            + ")"
            for p, r in self.ranges.items()
        ]
        names += ["    t = model.time"] + (['    u = model.input("u", "N")'] if self.has_input else [])
        lagrangian = " + ".join(self.kinetic) + "".join(f" - ({v})" for v in self.potential)
        tail = [f"    model.lagrangian = {lagrangian}"]
        if self.rayleigh:
            tail.append(f"    model.dissipation = {' + '.join(self.rayleigh)}")
        body = [
            *names,
            *self.lines,
            *tail,
            *(f"    {line}" for line in self.forces + self.points),
        ]
        return (
            "from sympy import cos, exp, log, sin, sqrt\n\n\ndef define(model, links):\n"
            + "\n".join(body)
            + "\n"
        )


# --- frames: coordinates and kinetic energy; what stands in potentials is returned, with a rate


Place = tuple[
    str, str, str
]  # of a potential: the expression; its rate; the coordinate whose force is along it


def cartesian(b: Builder, names: str) -> list[Place]:
    for name in names:
        b.coordinate(name, "m", (-2, 2), 3)
        mass = b.number(-0.5, 0.5) if b.dice.random() < 0.4 else "1"
        b.kinetic.append(f"{mass}*{name}_dot**2/2")
        if b.dice.random() < 0.75:
            b.potential.append(f"{b.number(-0.7, 1.3)}*{name}**2/2")
            b.pieces.append("spring")
    if len(names) > 1:
        b.points.append(f'model.point("bob", ({", ".join(names)}))')
    return [(name, f"{name}_dot", name) for name in names]


def line(b: Builder) -> list[Place]:
    return cartesian(b, "x")


def plane(b: Builder) -> list[Place]:
    return cartesian(b, "xy")


def space(b: Builder) -> list[Place]:
    return cartesian(b, "xyz")


def coupled(b: Builder) -> list[Place]:
    places = cartesian(b, "xy")
    b.potential.append(f"{b.number(-1, 1.5)}*(x - y - {b.place()})**2/2")
    return [*places, ("(x - y)", "(x_dot - y_dot)", "x")]


def bead(b: Builder) -> list[Place]:
    b.coordinate("x", "m", (-1.5, 1.5), 2)
    curve = b.dice.choice(
        [
            "x**2/2",
            "x**4/4",
            "cos({}*x)",
            "exp(x/2)/2 + exp(-x/2)/2",
            "sqrt(x**2 + {}**2)",
        ]
    )
    if curve.startswith("sqrt"):
        width = b.number(-2, 0)
        b.narrow.append(("x", width))
        curve = curve.format(width)
    b.lines.append(f"    height = {curve.format(b.number(-0.3, 0.7))}")
    b.kinetic.append("(x_dot**2 + model.rate(height)**2)/2")
    b.potential.append("9.81*height")
    b.points.append('model.point("bead", (x, height))')
    return [("x", "x_dot", "x")]


def hoop(b: Builder) -> list[Place]:
    b.coordinate("theta", "rad", (-3, 3), 3)
    b.kinetic.append(f"(theta_dot**2 + {b.number(-0.5, 1)}**2*sin(theta)**2)/2")
    b.potential.append("-9.81*cos(theta)")
    b.points.append('model.point("bead", (sin(theta), -cos(theta)))')
    return [
        ("sin(theta)", "cos(theta)*theta_dot", "theta"),
        ("theta", "theta_dot", "theta"),
    ]


def elastic(b: Builder) -> list[Place]:
    b.coordinate("r", "m", (0.8, 1.5), 1)
    b.coordinate("theta", "rad", (-1.5, 1.5), 1)
    b.kinetic.append("(r_dot**2 + r**2*theta_dot**2)/2")
    b.potential.append(f"{b.number(1.3, 3)}*(r - 1)**2/2 - 9.81*r*cos(theta)")
    b.points.append('model.point("bob", (r*sin(theta), -r*cos(theta)))')
    return [
        ("r*sin(theta)", "(r_dot*sin(theta) + r*cos(theta)*theta_dot)", "theta"),
        ("theta", "theta_dot", "theta"),
    ]


def pivot(b: Builder) -> list[Place]:
    b.coordinate("theta", "rad", (-3, 3), 2)
    frequency = b.number(0, 1.7)
    shake = f"{b.number(-2, -0.7)}*cos({frequency}*t)"
    up = b.dice.choice([shake, "0"])
    aside = shake if up == "0" else b.dice.choice([f"0.05*sin({frequency}*t)", "0"])
    b.lines.append(f"    x, y = {aside} + sin(theta), {up} - cos(theta)")
    b.kinetic.append("(model.rate(x)**2 + model.rate(y)**2)/2")
    b.potential.append("9.81*y")
    b.points.append('model.point("bob", (x, y))')
    return [("theta", "theta_dot", "theta")]


def cart(b: Builder) -> list[Place]:
    links = b.dice.randint(1, 2)
    b.coordinate("x", "m", (-1, 1), 1)
    b.kinetic.append(f"{b.number(-0.5, 0.7)}*x_dot**2/2")
    b.lines.append("    right, up = x, 0")
    for name in ("alpha", "beta")[:links]:
        b.coordinate(name, "rad", (-2.5, 2.5), 1)
        b.lines.append(f"    right, up = right + sin({name}), up - cos({name})")
        b.lines.append(f"    {name}_right, {name}_up = right, up")
        mass = b.number(-0.5, 0.5)
        b.kinetic.append(f"{mass}*(model.rate({name}_right)**2 + model.rate({name}_up)**2)/2")
        b.potential.append(f"9.81*{mass}*{name}_up")
        b.points.append(f'model.point("bob_{name}", ({name}_right, {name}_up))')
    if b.dice.random() < 0.6:
        b.potential.append(f"{b.number(-0.5, 1.5)}*x**2/2")
    return [("x", "x_dot", "x"), ("alpha", "alpha_dot", "alpha")]


def heavier(b: Builder) -> list[Place]:
    """A mass that depends on the place."""
    b.coordinate("x", "m", (-2, 2), 2)
    b.kinetic.append(b.dice.choice(["(1 + x**2)*x_dot**2/2", "exp(x/3)*x_dot**2/2", "x_dot**2/(2 + cos(x))"]))
    b.potential.append(f"{b.number(-0.5, 1)}*x**2/2")
    return [("x", "x_dot", "x")]


# --- pieces


def spring(b: Builder, s: Place) -> None:
    b.potential.append(f"{b.number(-1, 1)}*({s[0]} - {b.place()})**2")


def quartic(b: Builder, s: Place) -> None:
    b.potential.append(f"{b.number(-1, 0.5)}*({s[0]}**2 - {b.number(-1, 0.3)})**2/4")


def polynomial(b: Builder, s: Place) -> None:
    b.potential.append(f"({b.place()}*{s[0]} + {b.place()}*{s[0]}**3 + {b.number(-1, 0)}*{s[0]}**6)/10")


def ripple(b: Builder, s: Place) -> None:
    wave = b.number(0, 2)
    b.potential.append(f"{b.number(-2, 0)}*cos({wave}*{s[0]})")
    b.narrow.append((s[0], f"1/({wave})"))


def bump(b: Builder, s: Place) -> None:
    at, width, sign = b.place(), b.number(-4, 0), b.dice.choice(["", "-"])
    form = b.dice.choice(
        [
            "exp(-(({s} - {c})/{w})**2)",
            "exp(-({s} - {c})**2/{w}**2)",
            "1/(1 + (({s} - {c})/{w})**2)",
        ]
    )
    b.potential.append(f"{sign}{b.number(-1.5, 1.3)}*" + form.format(s=s[0], c=at, w=width))
    b.narrow.append((f"{s[0]} - ({at})", width))


def wall(b: Builder, s: Place) -> None:
    width = b.number(-3, -0.5)
    side = b.dice.choice(["-", ""])
    b.potential.append(f"exp({side}({s[0]} {'+' if side else '-'} 1.5)/{width})")
    b.narrow.append((f"{s[0]} {'+' if side else '-'} 1.5", width))


def stair(b: Builder, s: Place) -> None:
    at, width = b.place(), b.number(-3.5, 0)
    b.potential.append(f"{b.number(-1, 1)}/(1 + exp(({s[0]} - {at})/{width}))")
    b.narrow.append((f"{s[0]} - ({at})", width))


def cusp(b: Builder, s: Place) -> None:
    at, width = b.place(), b.number(-4, 0)
    form = b.dice.choice(
        [
            "sqrt({d}**2 + {w}**2)",
            "-0.3/sqrt({d}**2 + {w}**2)",
            "log({d}**2 + {w}**2)/2",
        ]
    )
    if form.startswith("-"):
        width = b.number(-1.5, 0)
    b.potential.append(f"{b.number(-1, 0.5)}*(" + form.format(d=f"({s[0]} - {at})", w=width) + ")")
    b.narrow.append((f"{s[0]} - ({at})", width))


def morse(b: Builder, s: Place) -> None:
    b.potential.append(f"{b.number(-1, 1)}*(1 - exp(-({s[0]})))**2")


def in_time(b: Builder, s: Place, value: str) -> None:
    """A force that depends on time, as a part of the Lagrangian or beside it."""
    if b.dice.random() < 0.5:
        b.potential.append(f"-({s[0]})*{value}")
    else:
        b.forces.append(f"model.force({s[2]}, {value})")


def pulse(b: Builder, s: Place) -> None:
    at, width = repr(round(b.dice.uniform(0.2, 3), 2)), b.number(-6, 0)
    strength = f"{b.number(-1, 0.5)}/{width}" if b.dice.random() < 0.6 else b.number(-1, 1)
    form = b.dice.choice(
        [
            "exp(-((t - {c})/{w})**2)",
            "exp(-(t - {c})**2/(2*{w}**2))",
            "1/(1 + ((t - {c})/{w})**2)**2",
        ]
    )
    in_time(b, s, f"{strength}*" + form.format(c=at, w=width))
    b.narrow.append((f"t - {at}", width))


def switch(b: Builder, s: Place) -> None:
    at, width = repr(round(b.dice.uniform(0.2, 3), 2)), b.number(-6, 0)
    steep = b.dice.random() < 0.5
    forms = ["1/(1 + exp({k}*(t - {c})))", "(1 - 2/(1 + exp(2*{k}*(t - {c}))))"]
    k = repr(1 / float(width)) if steep and width[0] != "p" else f"1/{width}"
    in_time(b, s, f"{b.number(-1, 0.7)}*" + b.dice.choice(forms).format(k=k, c=at))
    b.narrow.append((f"t - {at}", width))


def ramp(b: Builder, s: Place) -> None:
    at, width = repr(round(b.dice.uniform(0.2, 3), 2)), b.number(-5, 0)
    in_time(b, s, f"{b.number(-1, 0.3)}*(t - {at} + sqrt((t - {at})**2 + {width}**2))")
    b.narrow.append((f"t - {at}", width))


def friction(b: Builder, s: Place) -> None:
    rate = f"{s[2]}_dot"
    if b.dice.random() < 0.6:
        rounding = b.number(-12, 0)
        b.forces.append(f"model.force({s[2]}, -{b.number(-1.3, 0.3)}*{rate}/sqrt({rate}**2 + {rounding}))")
        b.narrow.append((rate, f"sqrt({rounding})"))
    else:
        width = b.number(-5, 0)
        b.forces.append(f"model.force({s[2]}, -{b.number(-1.3, 0.3)}*(1 - 2/(1 + exp(2*{rate}/{width}))))")
        b.narrow.append((rate, width))


def drag(b: Builder, s: Place) -> None:
    rate = f"{s[2]}_dot"
    form = b.dice.choice(["{v}**2/2", "{v}**4/4", "force"])
    if form == "force":
        b.forces.append(f"model.force({s[2]}, -{b.number(-2, 0)}*{rate}*sqrt({rate}**2 + 1e-4))")
        b.narrow.append((rate, "0.01"))
    else:
        b.rayleigh.append(f"{b.number(-3, 0.5)}*" + form.format(v=rate))


def pushed(b: Builder, s: Place) -> None:
    b.has_input = True
    b.forces.append(f"model.force({s[2]}, {b.dice.choice(['u', '2*u', 'u*cos(' + s[2] + ')'])})")


PIECES: list[Callable[[Builder, Place], None]] = [
    spring,
    quartic,
    polynomial,
    ripple,
    morse,
]
PIECES += 3 * [bump, pulse, switch] + 2 * [wall, stair, cusp, friction, drag] + [ramp, pushed]


def draw(seed: int, which: int) -> Model:
    dice = random.Random(f"model:{seed}:{which}")
    b = Builder(dice)
    frame = MAIN[which % len(MAIN)]
    places = globals()[frame](b)
    for _ in range(dice.choice([1, 1, 2, 2, 3])):
        piece = dice.choice(PIECES)
        b.pieces.append(piece.__name__)
        piece(b, dice.choice(places))
    family = " ".join([frame, *sorted(set(b.pieces) - {"spring"})])
    return Model(family, b.text(), b.narrow, b.ranges, b.starts, b.has_input, 6.0, 12.0)


# --- models that pendula brings


def brought(dice: random.Random) -> tuple[str, dict]:
    """The name of one, and its scenario but for the settings; its fastest rate, 1/s, stands beside the tables."""
    name = dice.choice(
        [
            "cart_chain",
            "driven_chain",
            "rods",
            "joint_springs",
            "furuta",
            "swinging_atwood",
            "spring_pendulum",
        ]
    )
    links = dice.choice([1, 2]) if name in ("cart_chain", "driven_chain", "rods", "joint_springs") else 1
    rest = dice.random() < 0.4  # it comes to rest
    damping = power(dice, -2, 0.5) if rest else dice.choice([0.0, power(dice, -4, -1)])
    size = dice.choice([0.0, 1e-3, 0.5, 2.5])  # of the start
    system: dict = {"model": name}
    start: dict = {}
    parameters: dict = {}
    fastest = 6.0
    if links > 1:
        system["links"] = links
    angles = ["theta"] if name == "furuta" else [f"theta_{i + 1}" for i in range(links)]
    if name in ("cart_chain", "driven_chain", "rods", "joint_springs", "furuta"):
        for angle in angles:
            start[angle] = dice.uniform(-1, 1) * size
    if name in ("cart_chain", "driven_chain", "rods", "joint_springs"):
        parameters = {"masses": power(dice, -0.5, 0.5), "lengths": power(dice, -0.5, 0.3), "damping": damping}
    if name == "cart_chain":
        parameters |= {"cart_mass": power(dice, -1, 1), "cart_friction": damping}
        if dice.random() < 0.5:
            fastest = max(6.0, power(dice, -1, 2))
            system["drive"] = [{"input": "push", "amplitude": power(dice, -2, 1), "frequency": fastest}]
    if name == "driven_chain":
        fastest = power(dice, 0, 2.3)
        parameters |= {"frequency": fastest, "y_amplitude": power(dice, -3, -0.5) / max(1.0, fastest / 20)}
        parameters |= {"x_amplitude": dice.choice([0.0, 0.01])}
    if name == "joint_springs":
        parameters |= {"stiffness": power(dice, -1, 3)}
        fastest = max(6.0, math.sqrt(parameters["stiffness"] / parameters["masses"]) / parameters["lengths"])
    if name == "furuta":
        parameters = {"arm_friction": 0.1 * damping, "rod_friction": 0.01 * damping}
        start |= {"alpha": dice.uniform(-1, 1) * size, "alpha_dot": dice.uniform(-3, 3) * min(size, 1)}
        fastest = 15.0
    if name == "swinging_atwood":
        parameters = {"mu": power(dice, 0.05, 0.8)}
        start = {"r": power(dice, -0.5, 0.5), "theta": dice.uniform(0.1, 2.5)}
    if name == "spring_pendulum":
        parameters = {
            "stiffness": power(dice, 1, 3),
            "rest_length": dice.choice([0.0, 0.5]),
            "friction": damping,
        }
        start = {"x": dice.uniform(-1, 1) * size, "y": dice.uniform(-1, 1) * size, "z": -1.0}
        fastest = math.sqrt(parameters["stiffness"])
    system["parameters"] = parameters
    duration = power(dice, 1, 2.3) if rest else power(dice, -0.3, 1.2)
    return name, {"system": system, "start": start, "run": {"duration": duration}, "fastest": fastest}
