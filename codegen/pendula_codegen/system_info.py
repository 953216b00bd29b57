"""What a kernel says of itself, as SystemInfo of pendula/system/plain_system.hpp has it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from sympy import Expr, Integer, Symbol, expand, pi

from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.model import Model
from pendula_codegen.model_kernel import ModelKernel
from pendula_codegen.series_tape import SeriesTapes


def info_lines(kernel: ModelKernel, tapes: SeriesTapes) -> list[str]:
    """One thing in a line, its words with tabs between them: src/pendula/system/kernel_text.hpp reads it."""
    model = kernel.model
    rows: list[tuple[object, ...]] = [
        ("name", model.name),
        ("model", Path(model.file).stem),
        ("links", model.links),
        ("depends_on_time", depends_on_time(model)),
        ("constant_masses", has_constant_masses(kernel)),
    ]
    for c in model.coordinates:
        periodic = c.is_angle and is_periodic(model.held_expressions(), c.symbol)
        rows.append(("coordinate", c.symbol.name, c.unit, c.is_angle, periodic))
    for p in model.ordered_parameters:
        standard = "nan" if p.default is None else repr(p.default)
        rows.append(("parameter", p.name, p.unit, len(p.symbols), standard, p.positive, p.per_link))
    rows += [("input", i.symbol.name, i.unit) for i in model.inputs]
    rows += [("point", p.name, len(p.components), p.kind) for p in model.points]
    rows += [("connection", each.kind, *each.ends) for each in model.connections]
    rows += [("argument", is_base) for _, is_base in kernel.call_arguments]
    rows += [("switch", switch.text) for switch in model.switches]
    rows += [("constraint", each.name, each.unit, each.of_rates) for each in model.constraints]
    series = tapes.series
    rows.append(("series", series.has_momenta, len(series.sums), len(series.operands), tapes.kept))
    rows += [("sum", *pair) for pair in series.places]
    return [
        "\t".join(str(int(word)) if isinstance(word, bool) else str(word) for word in row) for row in rows
    ]


def is_periodic(held: Sequence[Expr], coordinate: Symbol) -> bool:
    """Whether the motion is the same a full turn further: of an angle that nothing winds up."""
    turned = {coordinate: coordinate + 2 * pi}
    return all(expression.subs(turned) == expression for expression in held)


def has_constant_masses(kernel: SystemKernel) -> bool:
    """Whether no entry on the diagonal of the mass matrix depends on the coordinates."""
    changing = {*kernel.system.coordinates}
    diagonal = (expand(kernel.mass[k, k]) for k in range(kernel.mass.rows))
    return not any(entry.free_symbols & changing for entry in diagonal)


def depends_on_time(model: Model) -> bool:
    """Or whether something else that is there at rest may bring energy: what constraints of rates hold besides A v."""
    still = dict.fromkeys(model.system.velocities, Integer(0))
    if any(each.of_rates and each.value.xreplace(still) != 0 for each in model.constraints):
        return True
    held = [*model.held_expressions(), *(c for p in model.points for c in p.components)]
    return any(expression.has(model.time) for expression in held)
