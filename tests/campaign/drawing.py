"""What the attack tries: chains, models, events and ensembles, each a pure function of a kind, a seed and a number.

draw(kind, seed, number) is a Case: a scenario, the text of its model where it has one, and what a reference must know
of it. Thresholds of events that lie beside a turning point need the motion, and are left open: `Level` says where they
are, and truth.py fills them in.

Numbers below FIRST[kind] are as they were drawn before the first run. What was found to be worth more tries comes
after these, so that a number stays what it was.
"""

import math
import random
from dataclasses import dataclass, field
from pathlib import Path

import aimed
import linkages
import model_drawing
from random_chains import Draw

FIRST = {"chains": 1000, "models": 400, "events": 3000, "ensembles": 300, "aimed": 400, "linkages": 200}
KINDS = tuple(FIRST)
BROUGHT = Path(__file__).parents[2] / "codegen" / "pendula_codegen" / "models"


@dataclass
class Level:
    """A number in an expression that depends on the motion.

    of        the expression whose value it is
    at        "turn" (the value at a turning point), "row", "start", "end", "time" (anywhere)
    which     0 to 1: which of the turning points or rows, or what part of the duration
    off       is added, relative to how far the expression goes in all; beyond the turning point where > 0
    """

    of: str
    at: str
    which: float
    off: float


@dataclass
class Case:
    """tables: the scenario. model: the text of model.py. narrow: (expression, width) of what is narrow in it.
    levels: for each event, the numbers that stand as {0}, {1} in `when`. around: for each event, expressions beside
    whose zeros `when` changes quickly. resumed: the part of the duration after which the run ends, and goes on; 0 for
    none. linkage: what is moved, where the reference is that of linkages."""

    kind: str
    seed: int
    number: int
    family: str
    tables: dict
    model: str = ""
    narrow: list[tuple[str, float]] = field(default_factory=list)
    levels: list[list[Level]] = field(default_factory=list)
    around: list[list[str]] = field(default_factory=list)
    resumed: float = 0.0
    linkage: linkages.Linkage | None = None

    @property
    def name(self) -> str:
        return f"{self.kind}_{self.seed}_{self.number}"


def draw(kind: str, seed: int, number: int) -> Case:
    return {
        "chains": a_chain,
        "models": a_model,
        "events": an_event,
        "ensembles": an_ensemble,
        "aimed": an_aimed_one,
        "linkages": a_linkage,
    }[kind](seed, number)


def an_aimed_one(seed: int, number: int) -> Case:
    family, tables, text, narrow = aimed.draw(seed, number)
    return Case("aimed", seed, number, family, tables, text, narrow)


def a_linkage(seed: int, number: int) -> Case:
    family, tables, text, linkage = linkages.draw(seed, number)
    return Case("linkages", seed, number, family, tables, text, linkage=linkage)


# --- how a run is moved, and what is written of it


def power(dice: random.Random, low: float, high: float) -> float:
    return 10 ** dice.uniform(low, high)


def settings(dice: random.Random, fastest: float, series: bool, long: bool = False) -> dict:
    """Keys of [run]. fastest: what changes most quickly, 1/s; series: whether Taylor series know the system; long: few
    steps must do."""
    methods = ["dopri5", "fehlberg78"] + (["taylor"] if series else [])
    step = power(dice, -2 if long else -3, -0.5) / fastest
    kind = dice.random()
    chosen = dice.choice([{}, {"method": "auto"}])
    if kind < 0.28:
        return chosen
    if kind < 0.40:
        return chosen | {"accuracy": power(dice, -11, -4)}
    if kind < 0.55:
        return (
            chosen
            | {"tolerance": power(dice, -12, -4)}
            | dice.choice([{}, {}, {"stages": dice.randint(1 if not long else 3, 8)}])
        )
    if kind < 0.72:
        form = {"form": "velocity"} if dice.random() < 0.1 else {}
        return {"step": step, "stages": dice.randint(1, 8)} | form
    if kind < 0.78:
        return {"method": "radau"} | dice.choice(
            [
                {},
                {"tolerance": power(dice, -10, -4)},
                {"step": step, "stages": dice.choice([2, 3])},
            ]
        )
    if kind < 0.95:
        return {"method": dice.choice(methods)} | dice.choice(
            [
                {},
                {"tolerance": power(dice, -12, -4)},
                {"accuracy": power(dice, -10, -4)},
            ]
        )
    return {"method": "rk4", "step": step}


def output(dice: random.Random, duration: float) -> dict:
    """Rows early and late."""
    kind = dice.random()
    if kind < 0.6:
        times = [duration * dice.random() for _ in range(6)]
        times += [duration * power(dice, -3, 0) for _ in range(4)]
        times += dice.choice([[], [duration], [0.0, duration]])
        return {"times": sorted(times)}
    if kind < 0.85:
        return {"interval": duration / dice.uniform(3, 40)}
    return dice.choice([{}, {"every": 1}, {"every": dice.randint(2, 30)}])


# --- chains


def a_chain(seed: int, number: int) -> Case:
    dice = random.Random(f"chains:{seed}:{number}")
    families = CHAINS if number < FIRST["chains"] else CHAINS_LATER
    (family,) = dice.choices(list(families), list(families.values()))
    drawing = AnyChain(dice)
    tables = getattr(drawing, family)()
    chain, start = tables["chain"], tables["start"]
    duration = tables.pop("duration")
    fastest = quickest(chain, start)
    loads = any(key in chain for key in ("damping", "torque", "drive"))
    long = duration * fastest > 300
    tables["run"] = {"duration": duration, **settings(dice, fastest, not loads, long)}
    if family == "coarse":
        tables["run"] = {
            "duration": duration,
            "stages": dice.randint(1, 8),
            "step": power(dice, -1, 0.5) / fastest,
        }
    tables["output"] = output(dice, duration)
    resumed = dice.uniform(0.05, 0.95) if family == "goes_on" else 0.0
    return Case("chains", seed, number, family, tables, resumed=resumed)


def pace(chain: dict) -> float:
    """What it swings with as a whole, 1/s; without gravity 1."""
    return math.sqrt(abs(chain["gravity"]) / sum(chain["lengths"])) or 1.0


def quickest(chain: dict, start: dict) -> float:
    """About the fastest rate that there is, 1/s."""
    if chain.get("units") == "natural":
        return max(1.0, *(abs(v) for v in start.get("theta_dot", [])))
    rates = [abs(v) for key in ("theta_dot", "phi_dot") for v in start.get(key, [])]
    return max(
        len(chain["masses"]) * pace(chain),
        *rates,
        *(d["frequency"] for d in chain.get("drive", [])),
    )


class AnyChain(Draw):
    """Every family of chains is a method: tables, and a duration beside them."""

    def links(self, most: int = 8) -> int:
        return self.dice.randint(1, most)

    def base(
        self,
        space: str | None = None,
        most: int = 8,
        least: int = 1,
        spread: float = 0.3,
    ) -> dict:
        links = max(self.links(most), least)
        size = self.power(-1, 0.5)
        return {
            "space": space or self.dice.choice(["planar", "spatial"]),
            "links": links,
            "masses": [self.power(-spread, spread) for _ in range(links)],
            "lengths": [size * self.power(-spread, spread) for _ in range(links)],
            "gravity": 9.81,
        }

    def placed(self, chain: dict, theta: float, fast: float) -> dict:
        """Angles up to theta to both sides, rates up to fast times the pace."""
        rate = fast * pace(chain)
        start = {"theta": [self.dice.uniform(-theta, theta) for _ in chain["masses"]]}
        start["theta_dot"] = [self.dice.uniform(-rate, rate) for _ in chain["masses"]]
        if chain["space"] == "spatial":
            start["phi"] = [self.dice.uniform(-math.pi, math.pi) for _ in chain["masses"]]
            start["phi_dot"] = [self.dice.uniform(-rate, rate) for _ in chain["masses"]]
        return start

    def inertia(self, chain: dict, link: int) -> float:
        return sum(chain["masses"][link:]) * chain["lengths"][link] ** 2

    def damp(self, chain: dict, low: float, high: float) -> None:
        """Rates of decay from 10^low to 10^high times the pace."""
        rate = self.power(low, high) * pace(chain)
        each = self.dice.random() < 0.5
        chain["damping"] = [
            rate * self.inertia(chain, link) * (self.power(-0.5, 0.5) if each else 1)
            for link in range(chain["links"])
        ]

    def moment(self, chain: dict, link: int, size: float) -> float | list[float]:
        weight = sum(chain["masses"][link:]) * chain["lengths"][link] * max(abs(chain["gravity"]), 1e-3)
        if chain["space"] == "planar":
            return weight * size * self.dice.uniform(-1, 1)
        return [weight * size * self.dice.uniform(-1, 1) for _ in range(3)]

    def turns(self, chain: dict, low: float, high: float) -> float:
        """A duration of 10^low to 10^high swings."""
        return 2 * math.pi / pace(chain) * self.power(low, high)

    def plain(self) -> dict:
        chain = self.base()
        return {
            "chain": chain,
            "start": self.placed(chain, math.pi, self.dice.choice([0, 0, 1, 3])),
            "duration": self.turns(chain, -1, 0.8),
        }

    def rest(self) -> dict:
        chain = self.base(most=5)
        self.damp(chain, -1.5, 1)
        return {
            "chain": chain,
            "start": self.placed(chain, math.pi, self.dice.choice([0, 1, 5])),
            "duration": self.turns(chain, 0.5, 2.3),
        }

    def chaos(self) -> dict:
        chain = self.base(most=4, least=2)
        return {
            "chain": chain,
            "start": self.placed(chain, math.pi, 1),
            "duration": self.turns(chain, 0.7, 2.3),
        }

    def chaos_rest(self) -> dict:
        chain = self.base(most=3, least=2)
        self.damp(chain, -2.3, -0.8)
        return {
            "chain": chain,
            "start": self.placed(chain, math.pi, self.dice.choice([1, 3])),
            "duration": self.turns(chain, 1.3, 2.5),
        }

    def tiny(self) -> dict:
        chain = self.base(most=6)
        size = self.power(-9, -2)
        if self.dice.random() < 0.3:
            self.damp(chain, -3, 0)
        return {
            "chain": chain,
            "start": self.placed(chain, size, self.dice.choice([0, size])),
            "duration": self.turns(chain, -0.5, 1.5),
        }

    def upright(self) -> dict:
        chain = self.base(most=3)
        start = self.placed(chain, 0.0, 0.0)
        off = self.dice.choice([0.0, self.power(-15, -1), self.power(-4, -1)])
        start["theta"] = [self.dice.choice([math.pi, -math.pi]) + off for _ in chain["masses"]]
        if (
            self.dice.random() < 0.4 and chain["links"] == 1
        ):  # let fall from the top, or pushed to just reach it
            top = 2 * math.sqrt(9.81 / chain["lengths"][0])
            start = {
                **start,
                "theta": [0.0],
                "theta_dot": [top * (1 + self.dice.choice([-1, 1]) * off)],
            }
        if self.dice.random() < 0.3:
            self.damp(chain, -3, 0)
        return {
            "chain": chain,
            "start": start,
            "duration": self.turns(chain, -0.3, 1.3),
        }

    def spin(self) -> dict:
        chain = self.base(most=4)
        chain["gravity"] = self.dice.choice([9.81, 9.81, 0.0])
        start = self.placed(chain, math.pi, 0.0)
        rate = self.power(1, 3)
        for key in ("theta_dot", "phi_dot"):
            if key in start:
                start[key] = [self.dice.uniform(-rate, rate) for _ in chain["masses"]]
        if self.dice.random() < 0.4:
            self.damp(chain, -2, 0.5)
        return {
            "chain": chain,
            "start": start,
            "duration": self.power(0.5, 2.5) / rate * 2 * math.pi,
        }

    def pole(self) -> dict:
        chain = self.base("spatial", most=4)
        start = self.placed(chain, math.pi, self.dice.choice([0, 1, 3]))
        start["theta"] = [self.theta(True) for _ in chain["masses"]]
        if self.dice.random() < 0.3:
            self.damp(chain, -2, 0)
        return {
            "chain": chain,
            "start": start,
            "duration": self.turns(chain, -0.5, 0.8),
        }

    def driven(self) -> dict:
        chain = self.base(most=4)
        if self.dice.random() < 0.5:
            self.damp(chain, -2, 0.5)
        chain["drive"] = []
        frequency = self.power(-2, 2.5) * pace(chain)
        for link in {self.dice.randrange(chain["links"]) for _ in range(2)}:
            drive = {
                "link": link + 1,
                "amplitude": self.moment(chain, link, self.power(-3, 0.5)),
            }
            drive |= {
                "frequency": frequency * self.power(-0.3, 0),
                "phase": self.dice.uniform(0, 2 * math.pi),
            }
            chain["drive"].append(drive)
        duration = min(self.turns(chain, -0.3, 1.3), 3000 / frequency)
        return {
            "chain": chain,
            "start": self.placed(chain, 1.5, 1),
            "duration": duration,
        }

    def stiff(self) -> dict:
        chain = self.base(most=4)
        self.damp(chain, 0.5, 6)
        return {
            "chain": chain,
            "start": self.placed(chain, math.pi, 1),
            "duration": self.turns(chain, -1, 1),
        }

    def ratios(self) -> dict:
        chain = self.base(most=4, least=2)
        chain["masses"] = [self.power(-3, 3) for _ in chain["masses"]]
        chain["lengths"] = [self.power(-1.5, 0.5) for _ in chain["lengths"]]
        if self.dice.random() < 0.3:
            self.damp(chain, -2, 1)
        return {
            "chain": chain,
            "start": self.placed(chain, math.pi, 0.5),
            "duration": self.turns(chain, -1, 0.6),
        }

    def gravities(self) -> dict:
        chain = self.base(most=4)
        chain["gravity"] = self.dice.choice([0.0, self.power(-6, -1), self.power(2, 6), -self.power(-2, 2)])
        if self.dice.random() < 0.3:
            self.damp(chain, -2, 1)
        return {
            "chain": chain,
            "start": self.placed(chain, math.pi, 1),
            "duration": self.turns(chain, -0.7, 0.8),
        }

    def torques(self) -> dict:
        chain = self.base(most=4)
        if self.dice.random() < 0.7:
            self.damp(chain, -1.5, 1)
        chain["torque"] = [self.moment(chain, link, self.power(-3, 0.5)) for link in range(chain["links"])]
        return {
            "chain": chain,
            "start": self.placed(chain, math.pi, 1),
            "duration": self.turns(chain, -0.3, 1.6),
        }

    def long(self) -> dict:
        chain = self.base(most=50, least=9, spread=0.1)
        if self.dice.random() < 0.5:
            self.damp(chain, -2, 1)
        theta = self.dice.choice([1e-7, 0.1, 1.5])
        return {
            "chain": chain,
            "start": self.placed(chain, theta, 0),
            "duration": self.turns(chain, -1, 0),
        }

    def goes_on(self) -> dict:
        """A run that ends, and goes on."""
        return getattr(
            self, self.dice.choice(["plain", "rest", "chaos_rest", "driven", "upright", "chaos", "stiff"])
        )()

    def coarse(self) -> dict:
        """For constant steps that are too long."""
        return getattr(self, self.dice.choice(["plain", "rest", "driven", "upright", "pole", "torques"]))()

    def resonance(self) -> dict:
        """Driven at its own pace for long: beats of small size."""
        chain = self.base(most=2)
        if self.dice.random() < 0.7:
            self.damp(chain, -3, -1)
        amplitude = self.moment(chain, 0, self.power(-4, -1))
        frequency = pace(chain) * self.dice.uniform(0.7, 1.5)
        chain["drive"] = [{"link": 1, "amplitude": amplitude, "frequency": frequency, "phase": 0.0}]
        return {"chain": chain, "start": self.placed(chain, 0.1, 0), "duration": self.turns(chain, 1, 2)}

    def tiny_drive(self) -> dict:
        """At rest but for a drive that hardly moves it, or after a long time."""
        chain = self.base(most=3)
        amplitude = self.moment(chain, 0, self.power(-9, -4))
        frequency = pace(chain) * self.power(-3, 2)
        chain["drive"] = [{"link": 1, "amplitude": amplitude, "frequency": frequency, "phase": 0.0}]
        start = self.placed(chain, 0.0, 0.0)
        if self.dice.random() < 0.4:
            start["theta"] = [math.pi for _ in chain["masses"]]
        return {"chain": chain, "start": start, "duration": self.turns(chain, 0, 1)}

    def turned(self) -> dict:
        """Starts that have turned many times."""
        chain = self.base("planar", most=3)
        start = self.placed(chain, 2.0, 1)
        start["theta"] = [theta + 2 * math.pi * round(self.power(0, 5)) for theta in start["theta"]]
        return {"chain": chain, "start": start, "duration": self.turns(chain, -0.5, 0.8)}

    def hardly_stiff(self) -> dict:
        """Fast at first, slow later: what was fast is over after a thousandth of the run."""
        chain = self.base(most=3)
        self.damp(chain, 0.3, 2.5)
        return {"chain": chain, "start": self.placed(chain, math.pi, 30), "duration": self.turns(chain, 0, 2)}

    def at_once(self) -> dict:
        """Hardly any time at all."""
        chain = self.base(most=4)
        return {"chain": chain, "start": self.placed(chain, 3.0, 3), "duration": self.turns(chain, -9, -2)}

    def units(self) -> dict:
        chain = self.base(most=3)
        scale = self.power(-6, 6)
        chain["lengths"] = [scale * length for length in chain["lengths"]]
        weight = self.power(-6, 6)
        chain["masses"] = [weight * mass for mass in chain["masses"]]
        if self.dice.random() < 0.4:
            self.damp(chain, -2, 0.5)
        start = self.placed(chain, 2.0, 1)
        duration = self.turns(chain, -0.3, 0.8)
        if self.dice.random() < 0.3:
            unit = math.sqrt(chain["lengths"][0] / 9.81)
            chain["units"] = "natural"
            duration /= unit
            for key in ("theta_dot", "phi_dot"):
                if key in start:
                    start[key] = [unit * rate for rate in start[key]]
        return {"chain": chain, "start": start, "duration": duration}


# How often each comes.
CHAINS_LATER = {
    "goes_on": 3,
    "coarse": 3,
    "resonance": 1,
    "tiny_drive": 1,
    "turned": 1,
    "hardly_stiff": 2,
    "at_once": 1,
}
CHAINS = {
    "plain": 1,
    "rest": 2,
    "chaos": 1,
    "chaos_rest": 2,
    "tiny": 1,
    "upright": 2,
    "spin": 1,
    "pole": 1,
    "driven": 2,
    "stiff": 1,
    "ratios": 1,
    "gravities": 1,
    "torques": 1,
    "long": 1,
    "units": 1,
}


# --- models


def a_model(seed: int, number: int) -> Case:
    """Model number % 40 with parameters, start and settings of its own; later ones are those that pendula brings."""
    if number >= FIRST["models"]:
        return a_model_brought(seed, number)
    which, variant = number % model_drawing.COUNT, number // model_drawing.COUNT
    dice = random.Random(f"models:{seed}:{number}")
    model = model_drawing.draw(seed, which)
    values = model.values(dice if variant else random.Random(f"models:{seed}:{which}:0"))
    duration = model.duration(dice)
    start = model.start(dice, values)
    system: dict = {"model": "model.py"}
    if values:
        system["parameters"] = values
    drives = model.drives(dice)
    if drives:
        system["drive"] = drives
    run = {"duration": duration, **settings(dice, model.fastest, series=True)}
    tables = {
        "system": system,
        "start": start,
        "run": run,
        "output": output(dice, duration),
    }
    narrow = [(text, model_drawing.number(width, values)) for text, width in model.narrow]
    return Case("models", seed, number, f"{which}: {model.family}", tables, model.text, narrow)


def a_model_brought(seed: int, number: int) -> Case:
    dice = random.Random(f"models:{seed}:{number}")
    name, tables = model_drawing.brought(dice)
    fastest, duration = tables.pop("fastest"), tables["run"]["duration"]
    tables["run"] |= settings(dice, fastest, series=True, long=duration * fastest > 300)
    tables["output"] = output(dice, duration)
    return Case("models", seed, number, name, tables, (BROUGHT / f"{name}.py").read_text())


# --- events


def an_event(seed: int, number: int) -> Case:
    """Five cases, numbers 5 k to 5 k + 4, look at one motion; each goes by a method of its own."""
    dice = random.Random(f"events:{seed}:{number // 5}")
    drawing = AnyChain(dice)
    chain = drawing.base(most=dice.choice([1, 1, 2, 3]))
    if dice.random() < 0.2:
        drawing.damp(chain, -2, 0)
    if dice.random() < 0.15:
        amplitude = drawing.moment(chain, 0, 0.3)
        chain["drive"] = [
            {
                "link": 1,
                "amplitude": amplitude,
                "frequency": drawing.power(-1, 1.5),
                "phase": 0.3,
            }
        ]
    start = drawing.placed(chain, dice.choice([0.01, 0.5, 1.5, 3.0]), dice.choice([0, 0, 1, 3]))
    duration = drawing.turns(chain, -0.3, 0.7)
    dice = random.Random(f"events:{seed}:{number}:own")
    run = {
        "duration": duration,
        **settings(dice, quickest(chain, start), set(chain).isdisjoint(LOADS)),
    }
    tables = {
        "chain": chain,
        "start": start,
        "run": run,
        "output": output(dice, duration),
    }
    families, levels, around, tables["event"] = set(), [], [], []
    for k in range(dice.randint(1, 3)):
        if number < FIRST["events"]:
            family, when, open_numbers = an_expression(dice, chain, duration)
            around.append([])
        else:
            family, when, open_numbers, beside = a_later_expression(dice, chain)
            around.append(beside)
        event = {
            "name": f"e{k + 1}",
            "when": when,
            "direction": dice.choice(["both", "both", "both", "up", "down"]),
        }
        if dice.random() < 0.08:
            event["stop"] = True
        families.add(family)
        levels.append(open_numbers)
        tables["event"].append(event)
    return Case("events", seed, number, " ".join(sorted(families)), tables, levels=levels, around=around)


LOADS = {"damping", "torque", "drive"}
EVENTS = {
    "turn": 4,
    "rate": 1,
    "time": 2,
    "squeeze": 1,
    "product": 1,
    "pair": 1,
    "row": 1,
    "start": 1,
    "end": 1,
    "mixed": 1,
    "jump": 1,
    "angle": 1,
}


def an_expression(dice: random.Random, chain: dict, duration: float) -> tuple[str, str, list[Level]]:
    """A family, the expression with {0}, {1} for its open numbers, and these."""
    what = a_quantity(dice, chain)
    depth = dice.choice([-1, -1, 1]) * power(dice, -12, -3)
    part = dice.random()
    turns = power(dice, -1, 3)  # rad/s, no more than some hundred events
    turns = min(turns, 2000 / duration)
    phase = dice.uniform(-3, 3)
    (family,) = dice.choices(list(EVENTS), list(EVENTS.values()))
    if family == "turn":
        return family, f"{what} - {{0}}", [Level(what, "turn", part, depth)]
    if family == "rate":
        rate = f"theta_dot_{dice.randint(1, chain['links'])}"
        return family, f"{rate} - {{0}}", [Level(rate, "turn", part, depth)]
    if family == "time":
        return family, f"cos({turns!r}*t + {phase!r}) - {1 + depth!r}", []
    if family == "squeeze":
        gap = power(dice, -10, -2) * duration
        at = part * duration
        return family, f"(t - {at!r})*(t - {at + gap!r})", []
    if family == "product":
        return (
            family,
            f"({what} - {{0}})*cos({turns!r}*t + {phase!r})",
            [Level(what, "time", part, 0.0)],
        )
    if family == "pair":
        levels = [Level(what, "time", part, 0.0), Level(what, "time", part, depth)]
        return family, f"({what} - {{0}})*({what} - {{1}})", levels
    if family in ("row", "start", "end"):
        return (
            family,
            f"{what} - {{0}}",
            [Level(what, family, part, dice.choice([0.0, depth]))],
        )
    if family == "mixed":
        size = power(dice, -4, 0)
        return (
            family,
            f"{what} - {{0}} + {size!r}*sin({turns!r}*t)",
            [Level(what, "time", part, 0.0)],
        )
    if family == "jump":
        period = max(power(dice, -1, 0.5), duration / 300)
        return (
            family,
            f"fmod(t, {period!r}) - {period * dice.choice([0.5, 1e-3, 1 - 1e-6])!r}",
            [],
        )
    link = dice.randint(1, chain["links"])
    if chain["space"] == "spatial":  # angles leap at poles, x, y and z do not
        return "turn", f"z_{link} - {{0}}", [Level(f"z_{link}", "turn", part, depth)]
    return (
        family,
        f"sin(theta_{link} - {{0}})",
        [Level(f"theta_{link}", "turn", part, depth)],
    )


def a_later_expression(dice: random.Random, chain: dict) -> tuple[str, str, list[Level], list[str]]:
    """Those that turn faster than the motion, are narrow, have kinks or jump; and beside what."""
    names = ["x", "y", "theta"] if chain["space"] == "planar" else ["x", "y", "z"]
    what = f"{dice.choice(names)}_{dice.randint(1, chain['links'])}"
    part, size = dice.random(), sum(chain["lengths"])
    here = Level(what, "time", part, 0.0)
    family = dice.choice(
        ["fast", "fast", "narrow", "narrow", "kink", "leap", "branch", "root", "rate product"]
    )
    if family == "fast":
        turns = power(dice, 0.5, 2.5) / (1 if what.startswith("theta") else size)
        level = dice.choice([dice.uniform(-1, 1), 1 - power(dice, -8, -1)])
        return family, f"sin({turns!r}*{what}) - {level!r}", [], []
    if family == "narrow":
        width = power(dice, -6, -1) * size
        return family, f"exp(-(({what} - {{0}})/{width!r})^2) - 0.5", [here], [f"{what} - {{0}}"]
    if family == "kink":
        depth = power(dice, -9, -1) * size
        return family, f"{depth!r} - abs({what} - {{0}})", [here], [f"{what} - {{0}}"]
    if family == "leap":
        return family, f"sign({what} - {{0}}) + 0.5", [here], [f"{what} - {{0}}"]
    if family == "branch" and chain["space"] == "planar":
        return family, f"atan2(x_1, y_1) - {dice.uniform(-3.2, 3.2)!r}", [], ["x_1"]
    if family == "root":
        return (
            family,
            f"sqrt(abs({what} - {{0}})) - {math.sqrt(power(dice, -9, -1) * size)!r}",
            [here],
            [f"{what} - {{0}}"],
        )
    rate = f"theta_dot_{dice.randint(1, chain['links'])}" if chain["space"] == "planar" else what
    levels = [here, Level(rate, "time", dice.random(), 0.0)]
    return "rate product", f"({what} - {{0}})*({rate} - {{1}})", levels, []


def a_quantity(dice: random.Random, chain: dict) -> str:
    link = dice.randint(1, chain["links"])
    names = ["x", "y", "theta"] if chain["space"] == "planar" else ["x", "y", "z"]
    one = f"{dice.choice(names)}_{link}"
    if dice.random() < 0.15:
        return f"({one}^2 + 0.5*{dice.choice(names[:2])}_{dice.randint(1, chain['links'])})"
    return one


# --- ensembles


def an_ensemble(seed: int, number: int) -> Case:
    dice = random.Random(f"ensembles:{seed}:{number}")
    drawing = AnyChain(dice)
    family = dice.choice(
        [
            "plain",
            "plain",
            "rest",
            "chaos_rest",
            "upright",
            "spin",
            "driven",
            "pole",
            "stiff",
            "torques",
        ]
    )
    tables = getattr(drawing, family)()
    chain, start = tables["chain"], tables["start"]
    while chain["links"] > 4:  # many members are moved twice
        tables = getattr(drawing, family)()
        chain, start = tables["chain"], tables["start"]
    duration = tables.pop("duration")
    fastest = quickest(chain, start)
    run = settings(dice, fastest, set(chain).isdisjoint(LOADS), duration * fastest > 300)
    tables["run"] = {"duration": duration, **run}
    keep = ["final"] + [key for key in ("points", "energy", "energy_error", "steps") if dice.random() < 0.4]
    ensemble: dict = {"keep": keep}
    if dice.random() < 0.35:
        ensemble["method"] = "auto"
    levels = []
    if dice.random() < 0.5:
        axis = "y" if chain["space"] == "planar" else "z"
        what = f"{axis}_{dice.randint(1, chain['links'])}"
        event = {"name": "e1", "when": f"{what} - {{0}}"}
        tables["event"] = [event]
        at, off = dice.choice([("time", 0.0), ("turn", -power(dice, -6, -2))])
        levels.append([Level(what, at, dice.random(), off)])
        keep.append("event:e1")
    keys = dice.sample(keys_of(chain, start, duration), 2)
    if dice.random() < 0.6:
        ensemble["axis"] = [
            {"key": key, "from": low, "to": high, "count": dice.randint(2, 3)} for key, (low, high) in keys
        ]
    else:
        ensemble |= {"count": dice.randint(3, 7), "seed": dice.randint(1, 1000)}
        ensemble["random"] = [{"key": key, "from": low, "to": high} for key, (low, high) in keys]
    tables["ensemble"] = ensemble
    return Case("ensembles", seed, number, family, tables, levels=levels)


def keys_of(chain: dict, start: dict, duration: float) -> list[tuple[str, tuple[float, float]]]:
    """Keys that may be an axis, and between what."""
    last = chain["links"]
    keys = [
        ("start.theta[1]", (start["theta"][0] - 0.3, start["theta"][0] + 0.3)),
        (
            f"start.theta_dot[{last}]",
            (start["theta_dot"][-1] - 1, start["theta_dot"][-1] + 1),
        ),
        ("run.duration", (duration / 2, duration)),
        (f"chain.masses[{last}]", (chain["masses"][-1] / 2, chain["masses"][-1] * 2)),
        ("chain.gravity", (chain["gravity"] / 2, chain["gravity"] or 1.0)),
    ]
    if "damping" in chain:
        keys.append(
            (
                f"chain.damping[{last}]",
                (chain["damping"][-1] / 10, chain["damping"][-1]),
            )
        )
    if "drive" in chain:
        frequency = chain["drive"][0]["frequency"]
        keys.append(("chain.drive[1].frequency", (frequency / 2, frequency)))
    return keys
