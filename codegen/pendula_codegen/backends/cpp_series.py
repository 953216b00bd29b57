"""Taylor series in C++: the two tapes as member functions of a kernel."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

from pendula_codegen.backends.cpp import Counts, RenderedFunction, eigen_entry, place, wrap
from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.linear_solve import UNROLLED
from pendula_codegen.series_tape import SeriesTapes, series_tapes
from pendula_codegen.tape import Row, Step, Tape, Value

LONGEST = 60  # of an expression that needs no name
_SUM, _PRODUCT, _NAME = range(3)  # what binds more tightly comes later
_SIGNS = {"add": "+", "subtract": "-", "multiply": "*"}


def kernel_series(kernel: SystemKernel) -> SeriesTapes | None:
    """None where nothing moves by it, and where there are too many coordinates for all of it to be written out."""
    if not kernel.moves_by_series or len(kernel.system.coordinates) > UNROLLED:
        return None
    return series_tapes(kernel, lambda where: (place(where, eigen_entry), 0))


def series_constants(tapes: SeriesTapes) -> list[str]:
    """What a kernel says of its series."""
    series = tapes.series
    pairs = ", ".join(f"{{{a}, {b}}}" for a, b in series.places)
    lines = [
        f"static constexpr bool series_has_momenta = {str(series.has_momenta).lower()};",
        f"static constexpr int series_operands = {len(series.operands)};",
        f"static constexpr int series_kept = {tapes.kept};",
    ]
    sums = f"static constexpr std::array<std::array<std::size_t, 2>, {len(series.sums)}> series_sums"
    return [*lines, *wrap(f"{sums}{{{{{pairs}}}}};" if pairs else f"{sums}{{}};")]


def render_series(kernel: SystemKernel, tapes: SeriesTapes) -> list[RenderedFunction]:
    parameters, inputs = kernel.parameters.name, kernel.inputs.name
    places = [place(leaf.place, eigen_entry) for leaf in kernel.leaves() if leaf.kind == "input"]

    def of_start(row: Row) -> str:
        array, k = row
        if array == "inputs":
            return places[k]
        return f"{parameters}.time" if array == "times" else _entry(row, ("unit",))

    start = _Printer(tapes.start, of_start)
    following = _Printer(tapes.next, lambda row: _entry(row))
    state = "q, p" if tapes.series.has_momenta else "q, v"
    n, sums = 2 * tapes.series.size, len(tapes.series.sums)
    named = [
        (parameters, f"const Parameters<Real>& {parameters}"),
        (inputs, f"const Inputs<Real>& {inputs}"),
        ("unit", "const Real& unit"),
        ("state", "const Real* state"),
        ("next", "Real* next"),
        ("kept", "Real* kept"),
    ]
    return [
        RenderedFunction(
            "series_start",
            [
                f"Taylor series of {state} in powers of time / unit: order 0",
                "",
                f"state  coefficients of order 0, ({n}): {state}",
                f"next   out, those of order 1, ({n})",
                f"kept   out, what further orders read, ({tapes.kept})",
                str(start.counts),
            ],
            _arguments(named, start.lines),
            start.lines,
            start.counts,
        ),
        RenderedFunction(
            "series_next",
            [
                "Order k ≥ 1; each argument is anything that has its numbers as from[i]",
                "",
                "kept      of order 0",
                "inputs    coefficients of order k",
                "order     k, 1/k, unit/(k + 1), and the coefficient of time: unit for k = 1, else 0",
                f"state     coefficients of order k, ({n})",
                f"sums      Σ A_j B_(k−j), 0 < j < k, A and B as series_sums has them, ({sums})",
                f"next      out, coefficients of order k + 1, ({n})",
                f"operands  out, coefficients of order k of what stands in sums, ({len(tapes.series.operands)})",
                str(following.counts),
            ],
            _arguments(
                [
                    ("kept", "const auto& kept"),
                    *((name, f"const Real* {name}") for name in ("inputs", "order", "state", "sums")),
                    ("next", "Real* next"),
                    ("operands", "Real* operands"),
                ],
                following.lines,
            ),
            following.lines,
            following.counts,
        ),
    ]


def _entry(row: Row, scalars: Sequence[str] = ()) -> str:
    """Of an array; a place as it is written."""
    array, k = row
    if array in scalars or not array.isidentifier():
        return array
    return f"{array}[{k}]"


def _arguments(named: Sequence[tuple[str, str]], lines: Sequence[str]) -> list[str]:
    """Those that are not read have no name."""
    text = " ".join(lines)

    def is_read(name: str) -> bool:
        return any(f"{name}{sign}" in text for sign in (".", "[", "(", " ", ";", ")"))

    return [
        written if is_read(name) else f"{written.removesuffix(name)}/*{name}*/" for name, written in named
    ]


class _Printer:
    """A tape as statements; what is read once is no statement of its own."""

    def __init__(self, tape: Tape, row: Callable[[Row], str]):
        self._row = row
        self._uses = Counter(value for step in tape.steps for value in step.operands)
        self._uses.update(tape.outputs.values())
        self._text: dict[Value, tuple[int, str]] = {}
        self._temporaries = self._calls = 0
        statements = [line for step in tape.steps for line in self._step(step)]
        statements += [f"{_entry(row)} = {self._text[value][1]};" for row, value in tape.outputs.items()]
        self.lines = [piece for line in statements for piece in wrap(line)]
        operations = sum(1 for step in tape.steps if step.operation in (*_SIGNS, "negative", "inverse"))
        self.counts = Counts(self._temporaries, operations, self._calls)

    def _step(self, step: Step) -> list[str]:
        match step.operation:
            case "number":
                return self._known(step, _NAME, f"Real({step.number!r})")
            case "read":
                return self._known(step, _NAME, self._row(step.row))
            case "add":
                return self._operation(step, _SUM, _SUM, _PRODUCT)
            case "subtract":
                return self._operation(step, _SUM, _SUM, _PRODUCT)
            case "multiply":
                return self._operation(step, _PRODUCT, _PRODUCT, _NAME)
            case "negative":
                return self._named(step, _SUM, f"-{self._operand(step.operands[0], _NAME)}")
            case "inverse":
                return self._named(step, _PRODUCT, f"Real(1.0) / {self._operand(step.operands[0], _NAME)}")
            case "sincos":
                self._calls += 2
                self._temporaries += 2
                sine, cosine = (f"t{value}" for value in step.results)
                self._text |= {
                    value: (_NAME, name) for value, name in zip(step.results, (sine, cosine), strict=True)
                }
                argument = self._operand(step.operands[0], _SUM)
                return [f"Real {sine}, {cosine};", f"sine_and_cosine({argument}, {sine}, {cosine});"]
        self._calls += 1
        argument = self._operand(step.operands[0], _SUM)
        more = f", Real({step.number!r})" if step.operation == "pow" else ""
        return self._named(step, _NAME, f"{step.operation}({argument}{more})", is_long=True)

    def _operation(self, step: Step, level: int, left: int, right: int) -> list[str]:
        x, y = step.operands
        text = f"{self._operand(x, left)} {_SIGNS[step.operation]} {self._operand(y, right)}"
        return self._named(step, level, text)

    def _operand(self, value: Value, least: int) -> str:
        level, text = self._text[value]
        return text if level >= least else f"({text})"

    def _known(self, step: Step, level: int, text: str) -> list[str]:
        self._text[step.first] = level, text
        return []

    def _named(self, step: Step, level: int, text: str, is_long: bool = False) -> list[str]:
        if self._uses[step.first] == 1 and len(text) <= LONGEST and not is_long:
            return self._known(step, level, text)
        self._temporaries += 1
        self._text[step.first] = _NAME, f"t{step.first}"
        return [f"const Real t{step.first} = {text};"]
