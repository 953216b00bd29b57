"""Random linkages, and their motions by a reference that pendula has no part in.

A linkage here is bobs in the plane or in space, with bars between them and to hooks, which may move, and lines that
some bobs slide along. Models say it in Cartesian coordinates, or in the angles of a chain between two hooks. The
reference moves the bobs in Cartesian coordinates: accelerations follow from the constraints differentiated twice, by
extrapolation of the midpoint rule in 80 bits, and every step ends on the constraints again.
"""

import math
import random
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import truth
from truth import Real

AXES = "xyz"


@dataclass
class Hook:
    """Where it is: at + amplitude sin(frequency t + phase)."""

    at: list[float]
    amplitude: list[float]
    frequency: float = 0.0
    phase: float = 0.0


@dataclass
class Linkage:
    """Bobs are numbered from 0 on, hooks after them. A line: the bob, a direction across it, and the product of the
    direction with the bob's place."""

    dimension: int
    masses: list[float]
    damping: float
    gravity: float
    hooks: list[Hook]
    bars: list[tuple[int, int, float]]  # of what, and the squared length
    lines: list[tuple[int, list[float], float]]
    places: list[list[float]]
    velocities: list[list[float]]
    angles: list[float] = field(default_factory=list)  # of a chain in angles, at the start
    lengths: list[float] = field(default_factory=list)  # of the links of a chain in angles


# --- what is drawn


def draw(seed: int, number: int) -> tuple[str, dict, str, Linkage]:
    """The family, the tables of a scenario, the text of its model, and the linkage."""
    dice = random.Random(f"linkages {seed} {number}")
    family = dice.choice(
        ["hung_chain", "chain_in_angles", "ring", "tree", "redundant", "slider", "shaken", "space"]
    )
    linkage = FAMILIES[family](dice)
    closed(linkage, dice)
    text = in_angles(linkage) if linkage.angles else in_places(linkage, dice)
    duration = dice.choice([1.0, 2.0, 5.0]) * dice.uniform(0.5, 1.5)
    run = {"duration": duration, **settings(dice)}
    output = dice.choice([{"interval": duration / dice.uniform(3, 40)}, {"every": 1}, {}])
    tables = {"system": {"model": "model.py"}, "start": start(linkage), "run": run, "output": output}
    return family, tables, text, linkage


def settings(dice: random.Random) -> dict:
    kind = dice.random()
    if kind < 0.3:
        return {}
    if kind < 0.5:
        return {"accuracy": 10 ** dice.uniform(-11, -4)}
    if kind < 0.75:
        return {"tolerance": 10 ** dice.uniform(-12, -4)} | dice.choice([{}, {"stages": dice.randint(2, 8)}])
    return {"step": 10 ** dice.uniform(-3, -1), "stages": dice.randint(1, 8)}


def base(dice: random.Random, dimension: int, bobs: int) -> Linkage:
    return Linkage(
        dimension=dimension,
        masses=[10 ** dice.uniform(-1, 1) for _ in range(bobs)],
        damping=dice.choice([0.0, 0.0, 10 ** dice.uniform(-2, 0)]),
        gravity=9.81,
        hooks=[],
        bars=[],
        lines=[],
        places=[],
        velocities=[[dice.uniform(-2, 2) for _ in range(dimension)] for _ in range(bobs)],
    )


def fixed(*at: float) -> Hook:
    return Hook(list(at), [0.0] * len(at))


def hung_chain(dice: random.Random, dimension: int = 2, bobs: int = 0) -> Linkage:
    """Between two hooks, its links at random angles about straight down and straight on."""
    bobs = bobs or dice.randint(2, 6)
    linkage = base(dice, dimension, bobs)
    at = [0.0] * dimension
    for _ in range(bobs):
        step = [dice.uniform(0.2, 1.0)] + [dice.uniform(-1, 1) for _ in range(dimension - 1)]
        at = [a + s for a, s in zip(at, step, strict=True)]
        linkage.places.append(at)
    end = [
        a + s
        for a, s in zip(at, [dice.uniform(0.2, 1.0)] + [dice.uniform(-1, 1)] * (dimension - 1), strict=True)
    ]
    linkage.hooks = [fixed(*[0.0] * dimension), fixed(*end)]
    linkage.bars = [(bobs, 0, 0.0)] + [(k, k + 1, 0.0) for k in range(bobs - 1)] + [(bobs - 1, bobs + 1, 0.0)]
    return linkage


def chain_in_angles(dice: random.Random) -> Linkage:
    linkage = hung_chain(dice)
    ends = [linkage.hooks[0].at, *linkage.places]
    for before, after in pairwise(ends):
        x, y = after[0] - before[0], after[1] - before[1]
        linkage.angles.append(math.atan2(x, -y))
        linkage.lengths.append(math.hypot(x, y))
    return linkage


def ring(dice: random.Random) -> Linkage:
    """A polygon that hangs by one corner."""
    bobs = dice.randint(2, 6)
    linkage = base(dice, 2, bobs)
    size = dice.uniform(0.3, 1.0)
    for k in range(bobs):
        turn = 2 * math.pi * (k + 1) / (bobs + 1) + dice.uniform(-0.2, 0.2)
        linkage.places.append([size * math.sin(turn), size * (math.cos(turn) - 1)])
    linkage.hooks = [fixed(0.0, 0.0)]
    linkage.bars = [(bobs, 0, 0.0)] + [(k, k + 1, 0.0) for k in range(bobs - 1)] + [(bobs - 1, bobs, 0.0)]
    return linkage


def tree(dice: random.Random) -> Linkage:
    """A loop with a chain that hangs from it."""
    linkage = ring(dice)
    at, bobs = linkage.places[0], len(linkage.masses)
    hooks = len(linkage.hooks)
    more = dice.randint(1, 2)
    moved = {bobs + k: bobs + more + k for k in range(hooks)}
    linkage.bars = [(moved.get(i, i), moved.get(j, j), 0.0) for i, j, _ in linkage.bars]
    before = 0
    for k in range(more):
        at = [at[0] + dice.uniform(-0.7, 0.7), at[1] - dice.uniform(0.2, 0.8)]
        linkage.places.append(at)
        linkage.masses.append(10 ** dice.uniform(-1, 1))
        linkage.velocities.append([dice.uniform(-2, 2), dice.uniform(-2, 2)])
        linkage.bars.append((before, bobs + k, 0.0))
        before = bobs + k
    return linkage


def redundant(dice: random.Random) -> Linkage:
    """A beam on three parallel cranks of one length."""
    linkage = base(dice, 2, 3)
    turn, length = dice.uniform(-2.5, 2.5), dice.uniform(0.3, 1.0)
    crank = [length * math.sin(turn), -length * math.cos(turn)]
    feet = [0.0, dice.uniform(0.5, 1.0), dice.uniform(1.3, 2.0)]
    linkage.places = [[x + crank[0], crank[1]] for x in feet]
    linkage.hooks = [fixed(x, 0.0) for x in feet]
    linkage.bars = [(3, 0, 0.0), (4, 1, 0.0), (5, 2, 0.0), (0, 1, 0.0), (1, 2, 0.0), (0, 2, 0.0)]
    linkage.lines = []
    return linkage


def slider(dice: random.Random) -> Linkage:
    """A crank, a rod, and a bob that slides along a line."""
    linkage = base(dice, 2, 2)
    crank, rod, turn = dice.uniform(0.3, 0.8), dice.uniform(1.0, 2.0), dice.uniform(-3, 3)
    linkage.places = [[crank * math.cos(turn), crank * math.sin(turn)], [0.0, dice.uniform(-0.1, 0.1)]]
    x, y = linkage.places[0]
    linkage.places[1][0] = x + math.sqrt(rod**2 - (y - linkage.places[1][1]) ** 2)
    linkage.hooks = [fixed(0.0, 0.0)]
    linkage.bars = [(2, 0, 0.0), (0, 1, 0.0)]
    linkage.lines = [(1, [0.0, 1.0], linkage.places[1][1])]
    return linkage


def shaken(dice: random.Random) -> Linkage:
    linkage = dice.choice([hung_chain, ring])(dice)
    hook = linkage.hooks[-1]
    hook.amplitude = [dice.uniform(-0.1, 0.1), dice.uniform(-0.1, 0.1)]
    hook.frequency, hook.phase = dice.uniform(1, 10), dice.uniform(-3, 3)
    return linkage


def space(dice: random.Random) -> Linkage:
    return hung_chain(dice, 3, dice.randint(2, 4))


FAMILIES = {
    f.__name__: f for f in (hung_chain, chain_in_angles, ring, tree, redundant, slider, shaken, space)
}


def closed(linkage: Linkage, dice: random.Random) -> None:
    """Bars get the lengths that they have, and rates that the constraints allow."""
    del dice
    closing = Closing(linkage)
    at = closing.all_places(np.array(linkage.places, dtype=Real), Real(0))
    linkage.bars = [(i, j, float(((at[i] - at[j]) ** 2).sum())) for i, j, _ in linkage.bars]
    closing = Closing(linkage)
    q, v = closing.project(
        np.array(linkage.places, dtype=Real), np.array(linkage.velocities, dtype=Real), Real(0)
    )
    linkage.velocities = v.astype(float).tolist()
    if not linkage.angles:
        linkage.places = q.astype(float).tolist()


def start(linkage: Linkage) -> dict:
    if not linkage.angles:
        names = {}
        for k, (place, rate) in enumerate(zip(linkage.places, linkage.velocities, strict=True)):
            for axis, x, v in zip(AXES, place, rate, strict=False):
                names |= {f"{axis}_{k + 1}": x, f"{axis}_{k + 1}_dot": v}
        return names
    rates = angle_rates(linkage)
    return {f"theta_{k + 1}": a for k, a in enumerate(linkage.angles)} | {
        f"theta_{k + 1}_dot": r for k, r in enumerate(rates)
    }


def angle_rates(linkage: Linkage) -> list[float]:
    ends = [[0.0, 0.0], *linkage.velocities]
    return [
        ((b[0] - a[0]) * math.cos(turn) + (b[1] - a[1]) * math.sin(turn)) / length
        for a, b, turn, length in zip(ends, ends[1:], linkage.angles, linkage.lengths, strict=False)
    ]


def in_places(linkage: Linkage, dice: random.Random) -> str:
    bobs, axes = len(linkage.masses), AXES[: linkage.dimension]
    lines = ["from sympy import sin, sqrt", "", "def define(model, links):", "    at, v = {}, {}"]
    for k in range(bobs):
        names = ", ".join(f'model.coordinate("{axis}_{k + 1}", "m")' for axis in axes)
        lines.append(f"    at[{k}] = [{names}]")
        lines.append(f"    v[{k}] = [model.rate(x) for x in at[{k}]]")
        lines.append(f'    model.point("bob_{k + 1}", at[{k}])')
    for k, hook in enumerate(linkage.hooks):
        terms = [
            f"{a!r}" + (f" + {s!r} * sin({hook.frequency!r} * model.time + {hook.phase!r})" if s else "")
            for a, s in zip(hook.at, hook.amplitude, strict=True)
        ]
        lines.append(f"    at[{bobs + k}] = [{', '.join(terms)}]")
    lines.append(f"    masses = {linkage.masses!r}")
    lines.append("    kinetic = sum(m * sum(x**2 for x in v[k]) / 2 for k, m in enumerate(masses))")
    lines.append(f"    potential = sum(m * {linkage.gravity!r} * at[k][-1] for k, m in enumerate(masses))")
    lines.append("    model.lagrangian = kinetic - potential")
    if linkage.damping:
        lines.append(f"    model.dissipation = {linkage.damping!r} * sum(x**2 for k in v for x in v[k]) / 2")
    rooted = dice.random() < 0.3
    for k, (i, j, squared) in enumerate(linkage.bars):
        apart = f"sum((a - b) ** 2 for a, b in zip(at[{i}], at[{j}]))"
        if rooted:
            lines.append(f'    model.constraint("bar_{k + 1}", sqrt({apart}) - sqrt({squared!r}), "m")')
        else:
            lines.append(f'    model.constraint("bar_{k + 1}", {apart} - {squared!r}, "m^2")')
    for k, (i, across, off) in enumerate(linkage.lines):
        terms = " + ".join(f"{a!r} * at[{i}][{d}]" for d, a in enumerate(across) if a)
        lines.append(f'    model.constraint("line_{k + 1}", {terms} - {off!r}, "m")')
    return "\n".join(lines) + "\n"


def in_angles(linkage: Linkage) -> str:
    lines = [
        "from sympy import cos, sin",
        "",
        "def define(model, links):",
        "    x = y = vx = vy = kinetic = potential = 0",
    ]
    if linkage.damping:
        lines.append("    lost = 0")
    for k, length in enumerate(linkage.lengths):
        lines += [
            f'    theta = model.coordinate("theta_{k + 1}", "rad")',
            f"    x, y = x + {length!r} * sin(theta), y - {length!r} * cos(theta)",
            f"    across, up = {length!r} * cos(theta), {length!r} * sin(theta)",
            "    vx, vy = vx + across * model.rate(theta), vy + up * model.rate(theta)",
        ]
        lines += [
            f"    kinetic = kinetic + {linkage.masses[k]!r} * (vx**2 + vy**2) / 2",
            f"    potential = potential + {linkage.masses[k] * linkage.gravity!r} * y",
            f'    model.point("bob_{k + 1}", (x, y))',
        ]
        if linkage.damping:
            lines.append(f"    lost = lost + {linkage.damping!r} * (vx**2 + vy**2) / 2")
    lines.append("    model.lagrangian = kinetic - potential")
    if linkage.damping:
        lines.append("    model.dissipation = lost")
    x, y = linkage.hooks[1].at
    lines.append(
        f'    model.constraint("end", (x - {x!r}) ** 2 + (y - {y!r}) ** 2 - {linkage.bars[-1][2]!r}, "m^2")'
    )
    return "\n".join(lines) + "\n"


# --- the reference


class Closing:
    """What brings a linkage onto its constraints, in 80 bits."""

    def __init__(self, linkage: Linkage) -> None:
        self.linkage = linkage
        self.bobs, self.axes = len(linkage.masses), linkage.dimension
        self.inverse = 1 / np.array(linkage.masses, dtype=Real)[:, None]
        self.hooks = linkage.hooks
        self.one = np.array([bar[0] for bar in linkage.bars], dtype=int)
        self.other = np.array([bar[1] for bar in linkage.bars], dtype=int)
        self.squared = np.array([bar[2] for bar in linkage.bars], dtype=Real)
        self.constraints = len(linkage.bars) + len(linkage.lines)

    def hooks_at(self, time: Real, order: int) -> np.ndarray:
        """Their places, or the derivatives of these."""
        found = np.zeros((len(self.hooks), self.axes), dtype=Real)
        for k, hook in enumerate(self.hooks):
            w, phase = Real(hook.frequency), Real(hook.frequency) * time + Real(hook.phase)
            factor = [np.sin(phase), w * np.cos(phase)][order]
            found[k] = np.array(hook.amplitude, dtype=Real) * factor
            if order == 0:
                found[k] += np.array(hook.at, dtype=Real)
        return found

    def all_places(self, q: np.ndarray, time: Real) -> np.ndarray:
        return np.concatenate([q, self.hooks_at(time, 0)])

    def defects(self, q: np.ndarray, time: Real) -> np.ndarray:
        at = self.all_places(q, time)
        bars = ((at[self.one] - at[self.other]) ** 2).sum(axis=1) - self.squared
        lines = [np.array(across, dtype=Real) @ q[i] - Real(off) for i, across, off in self.linkage.lines]
        return np.concatenate([bars, np.array(lines, dtype=Real)])

    def slopes(self, q: np.ndarray, time: Real) -> np.ndarray:
        """∂g/∂q  (constraints, bobs and hooks, axes)."""
        at = self.all_places(q, time)
        apart = 2 * (at[self.one] - at[self.other])
        found = np.zeros((self.constraints, len(at), self.axes), dtype=Real)
        rows = np.arange(len(self.one))
        np.add.at(found, (rows, self.one), apart)
        np.add.at(found, (rows, self.other), -apart)
        for k, (i, across, _) in enumerate(self.linkage.lines):
            found[len(rows) + k, i] = np.array(across, dtype=Real)
        return found

    def push(self, slopes: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        """M⁻¹ Gᵀ λ with G M⁻¹ Gᵀ λ = wanted, of a G that may have dependent rows."""
        G = slopes[:, : self.bobs]
        weighted = G * self.inverse
        K = np.einsum("cbd,ebd->ce", G, weighted)
        return np.einsum("c,cbd->bd", solved(K, wanted), weighted)

    def project(self, q: np.ndarray, v: np.ndarray, time: Real) -> tuple[np.ndarray, np.ndarray]:
        """The nearest state that is on the constraints."""
        for _ in range(20):
            off = self.defects(q, time)
            step = self.push(self.slopes(q, time), off)
            q = q - step
            if np.abs(step).max(initial=0) < 1e-18:
                break
        slopes = self.slopes(q, time)
        rates = np.concatenate([v, self.hooks_at(time, 1)])
        return q, v - self.push(slopes, np.einsum("cbd,bd->c", slopes, rates))


def solved(matrix: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Of a symmetric system with dependent rows: by Cholesky's factors, the largest pivots first."""
    a, n = matrix.copy(), len(matrix)
    order, least = list(range(n)), np.abs(np.diag(matrix)).max(initial=0) * Real(1e-14)
    L = np.zeros_like(a)
    rank = 0
    for k in range(n):
        best = k + int(np.argmax(np.diag(a)[k:]))
        if a[best, best] <= least:
            break
        if best != k:
            a[[k, best]] = a[[best, k]]
            a[:, [k, best]] = a[:, [best, k]]
            L[[k, best]] = L[[best, k]]
            order[k], order[best] = order[best], order[k]
        L[k, k] = np.sqrt(a[k, k])
        L[k + 1 :, k] = a[k + 1 :, k] / L[k, k]
        a[k + 1 :, k + 1 :] -= np.outer(L[k + 1 :, k], L[k + 1 :, k])
        rank = k + 1
    y = wanted[order][:rank].copy()
    for k in range(rank):
        y[k] = (y[k] - L[k, :k] @ y[:k]) / L[k, k]
    for k in reversed(range(rank)):
        y[k] = (y[k] - L[k + 1 : rank, k] @ y[k + 1 :]) / L[k, k]
    found = np.zeros(n, dtype=Real)
    found[order[:rank]] = y
    return found


class LinkageSubject(truth.Subject):
    def __init__(self, room: truth.Room, linkage: Linkage) -> None:
        self.linkage = linkage
        self.numbers = len(linkage.masses) * linkage.dimension
        super().__init__(room, 2 * self.numbers + 1, 2 * self.numbers, [("extrapolation", 1e-13, 1e-16)])

    def ask(self, method, tolerance, disturbance, telling, times):
        command = [self.room.linkage_reference, method, tolerance, truth.LIMIT, disturbance, telling]
        return self.room.rows(command, self._numbers(times), self.width)

    def _numbers(self, times: list[float]) -> str:
        linkage = self.linkage
        numbers = [linkage.dimension, len(linkage.masses), linkage.gravity, linkage.damping]
        for mass, place, velocity in zip(linkage.masses, linkage.places, linkage.velocities, strict=True):
            numbers += [mass, *place, *velocity]
        numbers.append(len(linkage.hooks))
        for hook in linkage.hooks:
            numbers += [*hook.at, *hook.amplitude, hook.frequency, hook.phase]
        for table in (linkage.bars, [(i, *across, off) for i, across, off in linkage.lines]):
            numbers += [len(table), *(number for row in table for number in row)]
        return " ".join(float(number).hex() for number in [*numbers, len(times), *times])

    def names(self) -> list[str]:
        axes = AXES[: self.linkage.dimension]
        places = [f"{axis}_{k + 1}" for k in range(len(self.linkage.masses)) for axis in axes]
        return places + [f"{name}_dot" for name in places]

    def columns(self, rows):
        return dict(zip([*self.names(), "t"], rows.T, strict=True))

    def compared(self, columns, sizes=None):
        if self.linkage.angles and "theta_1" in columns:
            columns = self.of_angles(columns)
        columns = columns | {n: columns[truth.other_spelling(n)] for n in self.names() if n not in columns}
        numbers = np.array([columns[name] for name in self.names()]).T
        return numbers if sizes is None else numbers / sizes

    def of_angles(self, columns):
        x = y = vx = vy = Real(0)
        found = {}
        for k, length in enumerate(self.linkage.lengths):
            theta = columns[f"theta_{k + 1}"].astype(Real)
            name = f"theta_{k + 1}_dot"
            rate = columns[name if name in columns else truth.other_spelling(name)].astype(Real)
            s, c = np.sin(theta), np.cos(theta)
            x, y = x + length * s, y - length * c
            vx, vy = vx + length * c * rate, vy + length * s * rate
            found |= {f"x_{k + 1}": x, f"y_{k + 1}": y, f"x_{k + 1}_dot": vx, f"y_{k + 1}_dot": vy}
        return found

    def derived(self, columns):
        numbers = self.compared(columns)
        n, axes = self.numbers, self.linkage.dimension
        masses = np.array(self.linkage.masses, dtype=Real)
        places, rates = (part.reshape(-1, len(masses), axes) for part in (numbers[:, :n], numbers[:, n:]))
        kinetic = (masses * (rates**2).sum(axis=2)).sum(axis=1) / 2
        heights = self.linkage.gravity * (masses * places[:, :, -1]).sum(axis=1)
        size = float(np.abs(kinetic).max()) + float(np.abs(heights).max())
        return {"energy": kinetic + heights}, {"energy": max(size, 1e-300)}

    def sizes(self, columns):
        numbers = np.abs(np.array([columns[name] for name in self.names()]).T)
        n = self.numbers
        place = max(float(numbers[:, :n].max()), 1e-300)
        speed = max(float(numbers[:, n:].max()), 0.01 * place / float(columns["t"].max()))
        return np.array([place] * n + [speed] * n, dtype=Real)
