"""The description of a model for people and programs that run it: names, units, defaults."""

from __future__ import annotations

import ast
import re
from math import isfinite
from pathlib import Path

from pendula_codegen.model import Model, rate_name, read_model
from pendula_codegen.models import FOLDER, model_names

_REMARK = re.compile(r'model\.\w+\(\s*f?"([A-Za-z]\w*?)(?:_\{.*?\})?".*#\s*(.+)$')


def describe(file: Path, links: int | None = None) -> dict[str, object]:
    """The model as JSON; `default` is null if the scenario must give the number. Raises GenerationError."""
    model = read_model(file, links)
    text = file.read_text(encoding="utf-8")
    remarks = _remarks(text)

    def remark(name: str) -> str:
        return remarks.get(name) or remarks.get(re.sub(r"_\d+$", "", name), "")

    return {
        "model": file.stem,
        "about": _about(text),
        "file": str(file.resolve()),
        "links": model.links,
        "has_links": _has_links(model, text),
        "coordinates": [
            {
                "name": c.symbol.name,
                "unit": c.unit,
                "rate": rate_name(c.symbol.name),
                "momentum": f"p_{c.symbol.name}",
                "remark": remark(c.symbol.name),
            }
            for c in model.coordinates
        ],
        "parameters": [
            {
                "name": p.name,
                "unit": p.unit,
                "default": p.default if p.default is not None and isfinite(p.default) else None,
                "positive": p.positive,
                "per_link": p.per_link,
                "remark": remark(p.name),
            }
            for p in model.parameters
        ],
        "inputs": [
            {"name": i.symbol.name, "unit": i.unit, "remark": remark(i.symbol.name)} for i in model.inputs
        ],
        "motions": [
            {"name": m.symbol.name, "unit": m.unit, "default": m.default, "remark": remark(m.symbol.name)}
            for m in model.motions
        ],
        "constraints": [
            {
                "name": each.name,
                "unit": each.unit,
                "of": "rates" if each.of_rates else "positions",
                "remark": remark(each.name),
            }
            for each in model.constraints
        ],
        "degrees_of_freedom": len(model.coordinates) - len(model.constraints),
        "switches": [{"value": switch.text, "remark": ""} for switch in model.switches],
        "points": [
            {
                "name": point.name,
                "columns": [f"{point.name}_{axis}" for axis in "xyz"[: len(point.components)]],
                "kind": point.kind,
                "remark": remark(point.name),
            }
            for point in model.points
        ],
        "connections": [{"kind": each.kind, "ends": list(each.ends)} for each in model.connections],
    }


def describe_all() -> list[dict[str, object]]:
    """All built-in models, those with links with one link."""
    return [describe(FOLDER / f"{name}.py") for name in model_names()]


def _has_links(model: Model, text: str) -> bool:
    read = (part.id for part in ast.walk(ast.parse(text)) if isinstance(part, ast.Name))
    return any(p.per_link for p in model.parameters) or "links" in read


def _about(text: str) -> str:
    """The first line of the docstring of the file, or else of that of `define`."""
    module = ast.parse(text)
    defined = [part for part in module.body if isinstance(part, ast.FunctionDef) and part.name == "define"]
    said = filter(None, map(ast.get_docstring, [module, *defined]))
    return next(said, "").partition("\n")[0]


def _remarks(text: str) -> dict[str, str]:
    """Comments on the lines that declare names, by name without the number of a link."""
    found = filter(None, map(_REMARK.search, text.splitlines()))
    return {match[1]: match[2] for match in found}
