"""Fills the tables of a page from the kept figures, between marks `<!-- NAME -->` and `<!-- /NAME -->`.

usage: python bench/tabulate.py FIGURES_FOLDER PAGE.md

A row whose benchmark did not run is left out.
"""

import json
import math
import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

# The leads to reach: of races over GSL rk8pd at 1e-12 and over heyoka, of steps over GSL rk4imp.
PROBLEMS = ("D", "P2", "P5", "P10", "P20", "P50", "P100")
KERNEL_CHAINS = ("D", "P2", "P4")
KERNEL_SYSTEMS = ("cart chain", "spring pendulum", "furuta", "swinging atwood")
OVER_BASELINE = (7, 6, 5, 5, 6, 12, 40)
OVER_HEYOKA = (2.5, 2.8, 4, 5, 6.5, 14, 12)
BY_TOLERANCE = {
    "D": 2.5,
    "P5": 5,
    "P10": 6,
    "P20": 8,
    "P50": 20,
    "P100": 18,
}  # by tolerance alone, over heyoka
STEPS = {2: 15, 10: 30, 100: 700}
KERNELS_OVER_HEYOKA = {KERNEL_CHAINS: 2.5, KERNEL_SYSTEMS: 1.5}
OVER_CASADI = {
    "residual": ((1.8, "planar 1–4, spatial 1–3"), (1.5, "other systems")),
    "residual_with_jacobians": ((2.7, "planar 1–4, spatial 1–3"), (2.5, "other systems")),
}
EQUAL_ERROR = ("pendula by tolerance", "pendula series", "pendula Gauss by tolerance", "heyoka")
LINKS = (2, 5, 10, 20, 50, 100, 1000, 10_000, 100_000)
BASELINE = "GSL rk8pd 1e-12"
LINEAR = 2.5  # what caches may take, up to 1.76 as measured; an O(n²) part would make it 100


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table, or nothing where there is no row."""
    body = [list(row) for row in rows]
    if not body:
        return ""
    head = list(head)
    lines = [head, ["---"] * len(head), *body]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def number(value: float) -> str:
    """Three digits, without an exponent."""
    if value >= 100:
        return f"{value:.0f}"
    return f"{value:.2f}" if value < 10 else f"{value:.1f}"


class Figures:
    """The kept figures, by what the tables ask of them."""

    def __init__(self, folder: Path) -> None:
        """Reads benchmarks.json, races.json, memory.json and iterations.json, of steps by tolerance by_tolerance.json
        and tolerance_races.json, of kernels kernels.json and kernel_races.json."""
        kept = json.loads((folder / "benchmarks.json").read_text(encoding="utf-8"))
        self.context = kept["context"]
        self.benchmarks = succeeded(kept)
        kernels = json.loads((folder / "kernels.json").read_text(encoding="utf-8"))
        self.kernel_context = kernels["context"]
        self.kernels = {
            name: {**entry, "time": entry["fastest"], "nanoseconds": entry.get("fastest_nanoseconds")}
            for name, entry in succeeded(kernels).items()
        }
        self.kernel_races = json.loads((folder / "kernel_races.json").read_text(encoding="utf-8"))
        chosen = json.loads((folder / "by_tolerance.json").read_text(encoding="utf-8"))
        self.tolerance_context = chosen["context"]
        self.by_tolerance = succeeded(chosen)
        self.tolerance_races = json.loads((folder / "tolerance_races.json").read_text(encoding="utf-8"))
        self.races = json.loads((folder / "races.json").read_text(encoding="utf-8"))
        memory = (folder / "memory.json").read_text(encoding="utf-8").strip()
        self.memory = json.loads(memory) if memory else None
        self.iterations = json.loads((folder / "iterations.json").read_text(encoding="utf-8"))

    def cost(self, space: str, method: str, links: int) -> float | None:
        """Sincos a link and iteration."""
        entry = self.benchmarks.get(f"chain/{space}/{method}/n={links}")
        return entry and entry["sincos_a_link_and_iteration"]

    def step(self, who: str, links: int) -> float | None:
        """Microseconds of a step of 2-stage Gauss at h = 1e-3."""
        entry = self.benchmarks.get(f"step/{who}/n={links}")
        return entry and entry["step_microseconds"]

    def field(self, problem: str) -> dict[str, dict]:
        """Who ran a race, by name."""
        prefix = f"race/{problem}/"
        return {n.removeprefix(prefix): e for n, e in self.benchmarks.items() if n.startswith(prefix)}

    def kernel_field(self, problem: str) -> dict[str, dict]:
        """Who ran a race of kernels, by name."""
        prefix = f"race/{problem}/"
        return {n.removeprefix(prefix): e for n, e in self.kernels.items() if n.startswith(prefix)}

    def tolerance_field(self, problem: str) -> dict[str, dict]:
        """Who ran a race by tolerance alone, by name."""
        prefix = f"race/{problem}/"
        return {n.removeprefix(prefix): e for n, e in self.by_tolerance.items() if n.startswith(prefix)}

    def nanoseconds(self, name: str) -> float | None:
        """Of one call of a function."""
        entry = self.kernels.get(name)
        return entry and entry["nanoseconds"]

    def over_casadi(self, kernel: str, what: str, forms: Iterable[str]) -> float | None:
        """Time of CasADi's code, of the fastest of the forms, over that of a kernel's function."""
        ours = self.nanoseconds(f"function/{kernel}/{what}/pendula")
        theirs = [self.nanoseconds(f"function/{kernel}/{what}/CasADi, {form}") for form in forms]
        return min(theirs) / ours if ours and all(theirs) else None

    def finishers(self, problem: str, ours: bool) -> list[tuple[float, str]]:
        """(milliseconds, name) of those within 10 floors, the fastest first."""
        return sorted(
            (entry["time"], name)
            for name, entry in self.field(problem).items()
            if is_good(entry) and name.startswith("pendula") == ours and name != BASELINE
        )


def succeeded(kept: dict) -> dict[str, dict]:
    """The benchmarks of a file that ran through."""
    return {name: e for name, e in kept["benchmarks"].items() if "failed" not in e}


def machine(figures: Figures) -> str:
    """What the figures were measured with, and the unit."""
    return told(figures.context, figures.benchmarks, "medians")


def kernel_machine(figures: Figures) -> str:
    """The same of what is measured of kernels."""
    return told(figures.kernel_context, figures.kernels, "the fastest")


def told(c: dict, benchmarks: dict[str, dict], counts: str) -> str:
    """What a run was measured with, and which of its repetitions count."""
    unit = benchmarks["sincos"]["nanoseconds"]
    return (
        f"{c['processor']}, one core; {c['compiler']}, `{c['flags']}`; "
        f"{counts} of {c['repetitions']} repetitions; {c['date']}. "
        f"One scalar `sincos` (std::sin and std::cos of the same argument): {unit:.1f} ns."
    )


def cost_row(figures: Figures, what: str, space: str, method: str, wanted: float) -> Iterable[list[str]]:
    """The row of one bound on the cost of a link and iteration, n = 2 … 10⁴."""
    costs = [c for n in LINKS if n <= 10_000 and (c := figures.cost(space, method, n))]
    if costs:
        yield [what, f"≤ {wanted:g} sincos", f"{number(min(costs))}–{number(max(costs))} sincos"]


def growth(figures: Figures) -> list[float]:
    """Cost of a link and iteration at n = 10⁴ over n = 100, for the four methods that have a goal."""
    ratios = []
    for space in ("planar", "spatial"):
        for method in ("s=2/newton", "s=8/fixed-point"):
            long, short = figures.cost(space, method, 10_000), figures.cost(space, method, 100)
            if long and short:
                ratios.append(long / short)
    return ratios


def linear_row(figures: Figures) -> Iterable[list[str]]:
    """The row of linearity."""
    ratios = growth(figures)
    if ratios:
        found = ", ".join(f"{ratio:.2f}" for ratio in ratios)
        yield ["cost a link and iteration, n = 10⁴ over n = 100 (the four rows above)", "≤ 1.15", found]


def step_row(figures: Figures) -> Iterable[list[str]]:
    """The row of one step against rk4imp, by the faster of our two iterations."""
    leads, wanted = [], []
    for links, want in STEPS.items():
        peer = figures.step("GSL rk4imp", links)
        ours = [t for who in ("pendula Newton", "pendula fixed point") if (t := figures.step(who, links))]
        if peer and ours:
            leads.append(f"{number(peer / min(ours))}×")
            wanted.append(f"{want}×")
    if leads:
        yield [
            "one step, s = 2, h = 1e-3, against GSL rk4imp, n = 2 / 10 / 100",
            "≥ " + " / ".join(wanted),
            " / ".join(leads),
        ]


def race_row(figures: Figures, peer: str, wanted: Iterable[float]) -> Iterable[list[str]]:
    """The row of the races: our fastest within 10 floors against a peer as it ran."""
    leads = []
    for problem in PROBLEMS:
        ours = figures.finishers(problem, ours=True)
        theirs = figures.field(problem).get(peer)
        leads.append(f"{number(theirs['time'] / ours[0][0])}×" if ours and theirs else "–")
    if any(lead != "–" for lead in leads):
        yield [
            "the race " + ", ".join(PROBLEMS) + f", against {peer}",
            "≥ " + ", ".join(f"{want:g}×" for want in wanted),
            ", ".join(leads),
        ]


def tolerance_lead(figures: Figures, problem: str) -> float | None:
    """heyoka's time over ours, where both are within 10 floors by a tolerance alone."""
    field = figures.tolerance_field(problem)
    ours, theirs = field.get("pendula by tolerance"), field.get("heyoka")
    return theirs["time"] / ours["time"] if ours and theirs and is_good(ours) else None


def tolerance_row(figures: Figures) -> Iterable[list[str]]:
    """The row of races by tolerance alone."""
    leads = [tolerance_lead(figures, problem) for problem in BY_TOLERANCE]
    if any(leads):
        found = ", ".join(f"{number(lead)}×" if lead else "–" for lead in leads)
        wanted = ", ".join(f"{want:g}×" for want in BY_TOLERANCE.values())
        yield ["by tolerance alone, " + ", ".join(BY_TOLERANCE) + ", against heyoka", f"≥ {wanted}", found]


def tolerance_machine(figures: Figures) -> str:
    """What the races by tolerance were measured with."""
    return told(figures.tolerance_context, figures.by_tolerance, "medians")


def tolerance_races(figures: Figures) -> str:
    """Races by tolerance alone: milliseconds within 10 floors, the tolerance that it took, and steps."""
    rows = []
    for problem in (p for p in PROBLEMS if p in figures.tolerance_races):
        race = figures.tolerance_races[problem]
        cells = [problem, f"{race['floor']:.1e}"]
        for name in ("pendula by tolerance", "heyoka"):
            entry = figures.tolerance_field(problem).get(name)
            if entry is None:
                cells += ["", ""]
                continue
            time = number(entry["time"])
            floors = entry["error"] / entry["floor"]
            cells += [time if is_good(entry) else f"*{time} ({floors:.0e})*", f"{entry['setting']:.0e}"]
        lead = tolerance_lead(figures, problem)
        rows.append([*cells, f"{number(lead)}×" if lead else "–"])
    return table(
        ["", "floor", "pendula, ms", "tolerance", "heyoka, ms", "tolerance", "heyoka over pendula"], rows
    )


def lyapunov_lead(figures: Figures, digits: int) -> float | None:
    """heyoka's time over ours for a leading Lyapunov exponent."""
    ours, theirs = (
        figures.by_tolerance.get(f"lyapunov/{who}/{digits} digits") for who in ("pendula", "heyoka")
    )
    return theirs["time"] / ours["time"] if ours and theirs else None


def lyapunov_row(figures: Figures) -> Iterable[list[str]]:
    """The row of Lyapunov exponents."""
    leads = [lyapunov_lead(figures, digits) for digits in (9, 12)]
    if all(leads):
        found = ", ".join(f"{number(lead)}×" for lead in leads)
        yield ["leading Lyapunov exponent, tolerance 1e-9, 1e-12, against heyoka", "≥ 2×", found]


def memory_row(figures: Figures) -> Iterable[list[str]]:
    """The row of peak memory."""
    if figures.memory:
        yield [
            "memory of the whole program, n = 10⁵, s = 2, planar",
            "≤ 64 MiB",
            f"{figures.memory['peak_mebibytes']:.1f} MiB",
        ]


def is_good(entry: dict) -> bool:
    """Whether a run ended within 10 floors."""
    return entry["error"] <= 10 * entry["floor"]


def kernel_lead(figures: Figures, problem: str) -> float | None:
    """heyoka's time over that of the fastest good kernel."""
    field = figures.kernel_field(problem)
    ours = [entry["time"] for name, entry in field.items() if name.startswith("pendula") and is_good(entry)]
    return field["heyoka"]["time"] / min(ours) if ours and "heyoka" in field else None


def kernel_race_rows(figures: Figures) -> Iterable[list[str]]:
    """The rows of races of generated kernels."""
    for problems, want in KERNELS_OVER_HEYOKA.items():
        leads = [kernel_lead(figures, problem) for problem in problems]
        if any(leads):
            found = ", ".join(f"{number(lead)}×" if lead else "–" for lead in leads)
            yield ["generated kernels, " + ", ".join(problems) + ", against heyoka", f"≥ {want:g}×", found]


def kernel_names(figures: Figures) -> list[str]:
    """Kernels whose residuals were compared with CasADi's: chains first."""
    names = {name.split("/")[1] for name in figures.kernels if name.startswith("function/")}
    return sorted(names, key=lambda name: (not is_chain(name), name))


def is_chain(kernel: str) -> bool:
    """Whether a kernel is that of a chain, planar or spatial."""
    return kernel.startswith(("planar", "spatial"))


def casadi_rows(figures: Figures) -> Iterable[list[str]]:
    """The rows of residuals against CasADi's code for the same L as people write it."""
    for what, goals in OVER_CASADI.items():
        for (want, kind), chains in zip(goals, (True, False), strict=True):
            kernels = [k for k in kernel_names(figures) if is_chain(k) == chains]
            leads = [lead for k in kernels if (lead := figures.over_casadi(k, what, ["written"]))]
            if leads:
                name = what.replace("_", " ").replace("jacobians", "Jacobians")
                found = f"{number(min(leads))}–{number(max(leads))}×"
                yield [f"generated {name} against CasADi's C, {kind}", f"≥ {want:g}×", found]


def sines_row(figures: Figures) -> Iterable[list[str]]:
    """The row of the momentum form over its sines."""
    rates = [over_sines(figures, f"planar_{n}", "scalar") for n in (2, 3, 4)]
    if all(rates):
        found = ", ".join(number(rate) for rate in rates)
        yield ["momentum form over its sincos alone, planar 2, 3, 4", "≤ 1.3", found]


def over_sines(figures: Figures, kernel: str, numbers: str) -> float | None:
    """Time of the momentum form over that of its sines."""
    whole, sines = (figures.nanoseconds(f"form/{kernel}/{numbers}/{part}") for part in ("whole", "sines"))
    return whole / sines if whole and sines else None


def goals(figures: Figures) -> str:
    """What was to be reached, and what was."""
    rows = [
        *cost_row(figures, "planar, s = 2, Newton, n = 2 … 10⁴", "planar", "s=2/newton", 6),
        *cost_row(figures, "spatial, s = 2, Newton, likewise", "spatial", "s=2/newton", 18),
        *cost_row(figures, "planar, s = 8, fixed point, all stages", "planar", "s=8/fixed-point", 5),
        *cost_row(figures, "spatial, s = 8, fixed point", "spatial", "s=8/fixed-point", 10),
        *linear_row(figures),
        *step_row(figures),
        *race_row(figures, BASELINE, OVER_BASELINE),
        *race_row(figures, "heyoka", OVER_HEYOKA),
        *tolerance_row(figures),
        *lyapunov_row(figures),
        *memory_row(figures),
        *kernel_race_rows(figures),
        *casadi_rows(figures),
        *sines_row(figures),
    ]
    return table(["what", "to reach", "measured"], rows)


def races(figures: Figures) -> str:
    """Every race: milliseconds of each contestant at its cheapest setting within 10 floors."""
    return field_table({p: (figures.races[p]["floor"], figures.field(p)) for p in PROBLEMS})


def kernel_races(figures: Figures) -> str:
    """The same of generated kernels."""
    problems = [p for p in (*KERNEL_CHAINS, *KERNEL_SYSTEMS) if p in figures.kernel_races]
    return field_table({p: (figures.kernel_races[p]["floor"], figures.kernel_field(p)) for p in problems})


def cheapest(race: dict, name: str, error: float) -> float | None:
    """Milliseconds of a contestant's quickest run within an error, of all settings that were tried."""
    runs = race["trials"].get(name, {"runs": []})["runs"]
    return min(
        (r["milliseconds"] for r in runs if r["error"] is not None and r["error"] <= error), default=None
    )


def equal_error(figures: Figures) -> str:
    """The time to an error: of what pendula chooses, of either method, of heyoka; and heyoka's over pendula's."""
    rows = []
    for problem, race in figures.kernel_races.items():
        for what, error in (("10 floors", 10 * race["floor"]), ("1e-9", 1e-9), ("1e-6", 1e-6)):
            chosen, series, gauss, heyoka = (cheapest(race, name, error) for name in EQUAL_ERROR)
            lead = f"{number(heyoka / chosen)}×" if chosen and heyoka else "–"
            times = (f"{t:.3f}" if t else "–" for t in (chosen, series, gauss, heyoka))
            rows.append([problem, what, *times, lead])
    rows.sort(key=lambda row: not row[-1].startswith("0."))  # where heyoka wins, first
    return table(["", "error", *EQUAL_ERROR, "heyoka over pendula"], rows)


def field_table(fields: dict[str, tuple[float, dict[str, dict]]]) -> str:
    """Floor and contestants of each problem."""
    names = list(dict.fromkeys(name for _, field in fields.values() for name in field))
    names.sort(key=lambda name: (not name.startswith("pendula"), name != BASELINE))
    rows = [["floor of the error", *(f"{floor:.1e}" for floor, _ in fields.values())]]
    for name in names:
        cells = []
        for _, field in fields.values():
            entry = field.get(name)
            if entry is None:
                cells.append("")
            elif is_good(entry):
                cells.append(number(entry["time"]))
            else:
                cells.append(f"*{number(entry['time'])} ({entry['error'] / entry['floor']:.0e})*")
        rows.append([name, *cells])
    return table(["", *fields], rows)


def functions(figures: Figures) -> str:
    """Residuals, ours and CasADi's."""
    rows = []
    for kernel in kernel_names(figures):
        cells = []
        for what in OVER_CASADI:
            ours = figures.nanoseconds(f"function/{kernel}/{what}/pendula")
            leads = [
                figures.over_casadi(kernel, what, ["written"]),
                figures.over_casadi(kernel, what, ["differences", "angles"]),
            ]
            cells.append(number(ours) if ours else "–")
            cells += [f"{number(lead)}×" if lead else "–" for lead in leads]
        rows.append([kernel.replace("_", " "), *cells])
    columns = ("CasADi", "L shortened")
    return table(["", "residual, ns", *columns, "with Jacobians, ns", *columns], rows)


def sines(figures: Figures) -> str:
    """The momentum form and its sines."""
    rows = []
    for kernel in ("planar_2", "planar_3", "planar_4"):
        cells = []
        for numbers in ("scalar", "lanes"):
            for part in ("sines", "whole"):
                time = figures.nanoseconds(f"form/{kernel}/{numbers}/{part}")
                cells.append(number(time) if time else "–")
            rate = over_sines(figures, kernel, numbers)
            cells.append(number(rate) if rate else "–")
        rows.append([kernel.replace("_", " "), *cells])
    head = ["", "sincos alone, ns", "(q, p) → (q̇, ṗ), ns", "over it"]
    return table([*head, "eight lanes: sincos alone, ns", "whole, ns", "over it"], rows)


def peers(figures: Figures) -> str:
    """Our fastest against the fastest of the others, with the dense dynamics and with ours."""
    rows = []
    for problem in PROBLEMS:
        ours, others = figures.finishers(problem, ours=True), figures.finishers(problem, ours=False)
        if not ours or not others:
            continue
        plain = [other for other in others if "O(n)" not in other[1]]
        cells = [problem, f"{ours[0][1]}: {number(ours[0][0])}"]
        for found in (plain, others):
            if found:
                time, name = found[0]
                cells.append(f"{name}: {number(time)} ({number(time / ours[0][0])}×)")
            else:
                cells.append("–")
        rows.append(cells)
    return table(["", "pendula, ms", "fastest peer on its own, ms", "fastest peer of all, ms"], rows)


def steps(figures: Figures) -> str:
    """One step of 2-stage Gauss."""
    rows = []
    for who in ("GSL rk4imp", "pendula Newton", "pendula fixed point"):
        cells = [figures.step(who, links) for links in STEPS]
        if any(cells):
            rows.append([who, *(number(cell) if cell else "–" for cell in cells)])
    return table(["µs a step", *(f"n = {links}" for links in STEPS)], rows)


def chain(figures: Figures) -> str:
    """The cost of a link and iteration, for every n."""
    rows = []
    for space in ("planar", "spatial"):
        for stages in (2, 4, 8):
            for method in ("newton", "fixed-point"):
                cells = [figures.cost(space, f"s={stages}/{method}", links) for links in LINKS]
                if any(cells):
                    numbers = (number(cell) if cell else "–" for cell in cells)
                    rows.append([f"{space}, s = {stages}, {method}", *numbers])
    return table(["sincos a link and iteration, n =", *map(str, LINKS)], rows)


def few(figures: Figures) -> str:
    """Step times on few links: dense kernels in momentum and in velocity form, and the chain solver."""
    kernels = sorted({name.split("/")[1] for name in figures.benchmarks if name.startswith("few/")})
    rows = []
    for kernel in kernels:
        cells = []
        for stages in (1, 2, 4, 8):
            solvers = ("dense, momentum", "dense, velocity", "chain")
            entries = [figures.benchmarks.get(f"few/{kernel}/s={stages}/{solver}") for solver in solvers]
            times = (number(entry["step_microseconds"]) if entry else "–" for entry in entries)
            cells.append(" / ".join(times))
        rows.append([kernel.replace("_", " "), *cells])
    head = ["µs a step", "s = 1, h = 1e-3", "s = 2, h = 1e-3", "s = 4, h = 5e-3", "s = 8, h = 1e-2"]
    return table(head, rows)


def simplified(figures: Figures) -> str:
    """Iterations of three methods, and what an iteration of the simplified Newton may cost to be worth it."""
    rows = []
    for run in figures.iterations:
        links, stages = run["links"], run["stages"]
        costs = [figures.cost("planar", f"s={stages}/{name}", links) for name in ("newton", "fixed-point")]
        if not all(costs):
            continue
        unit = costs[0] / costs[1]
        newton, simple, fixed = (
            run["iterations"][name] or math.inf for name in ("newton", "simplified newton", "fixed-point")
        )
        even = min(newton * unit, fixed) / simple
        cells = [number(value) if math.isfinite(value) else "–" for value in (newton, fixed, simple, even)]
        cells[0] += f" ({number(unit)})"
        rows.append([str(links), str(stages), f"{run['turn']:g}", *cells])
    return table(["n", "s", "h ω", "Newton", "fixed point", "simplified Newton", "breaks even at"], rows)


def work_precision(figures: Figures) -> str:
    """The picture of the races, once there is one."""
    text = "Time against error of the final state: the double pendulum, ten links, a hundred"
    return f"![{text}](../images/work_precision.svg)" if figures.races else ""


def scaling(figures: Figures) -> str:
    """The picture of the chain solver's costs, once there is one."""
    measured = any(name.startswith("chain/") for name in figures.benchmarks)
    text = "Cost of a link and iteration against the number of links"
    return f"![{text}](../images/scaling.svg)" if measured else ""


TABLES: dict[str, Callable[[Figures], str]] = {
    "machine": machine,
    "work precision": work_precision,
    "scaling": scaling,
    "goals": goals,
    "races": races,
    "peers": peers,
    "steps": steps,
    "chain": chain,
    "simplified": simplified,
    "few links": few,
    "tolerance machine": tolerance_machine,
    "tolerance races": tolerance_races,
    "kernel machine": kernel_machine,
    "kernel races": kernel_races,
    "equal error": equal_error,
    "functions": functions,
    "sines": sines,
}


def filled(page: str, figures: Figures) -> str:
    """The page with every table between its marks."""
    for name, make in TABLES.items():
        pattern = rf"(<!-- {name} -->\n).*?(<!-- /{name} -->)"
        text = make(figures)
        page, count = re.subn(pattern, lambda m, t=text: f"{m[1]}{t}\n{m[2]}", page, flags=re.DOTALL)
        if count != 1:
            raise SystemExit(f"tabulate.py: the page has {count} places for {name}, expected one")
    return page


def main() -> None:
    """Reads the figures, rewrites the page; fails where the cost of a long chain is not linear."""
    folder, page = map(Path, sys.argv[1:])
    figures = Figures(folder)
    page.write_text(filled(page.read_text(encoding="utf-8"), figures), encoding="utf-8")
    if any(ratio > LINEAR for ratio in growth(figures)):
        raise SystemExit(f"tabulate.py: a link costs over {LINEAR} times as much at n = 10⁴ as at n = 100")


if __name__ == "__main__":
    main()
