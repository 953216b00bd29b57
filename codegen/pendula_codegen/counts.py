"""Operation counts of generated kernels, as a table that is committed."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict

from pendula_codegen.render import Header

Table = dict[str, dict[str, dict[str, int]]]


def count_table(headers: Mapping[str, Header]) -> Table:
    """Header -> function -> counts, for all generated functions."""
    return {
        name: {function: asdict(counts) for function, counts in header.counts.items()}
        for name, header in sorted(headers.items())
        if header.counts
    }


def as_json(table: Table) -> str:
    """One line for each function, so that a diff shows what became longer."""
    blocks = [
        f"  {json.dumps(header)}: {{\n"
        + ",\n".join(f"    {json.dumps(name)}: {json.dumps(counts)}" for name, counts in functions.items())
        + "\n  }"
        for header, functions in table.items()
    ]
    return "{\n" + ",\n".join(blocks) + "\n}\n"
