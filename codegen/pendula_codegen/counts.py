"""Operation counts of generated kernels, read back from what their documentation comments say."""

from __future__ import annotations

import json
import re

_COUNTS = re.compile(
    r"/// (?:(\d+) temporar(?:y|ies), )?(\d+) operations?(?:, (\d+) sin/cos)?\.\n"
    r"  template <class Real>\n  static void (\w+)\("
)


def count_table(headers: dict[str, str]) -> dict[str, dict[str, dict[str, int]]]:
    """Header -> function -> counts, for all generated functions that state them."""
    return {
        header: {
            name: {
                "temporaries": int(temporaries or 0),
                "operations": int(operations),
                "trig": int(trig or 0),
            }
            for temporaries, operations, trig, name in _COUNTS.findall(text)
        }
        for header, text in sorted(headers.items())
        if _COUNTS.search(text)
    }


def as_json(table: dict[str, dict[str, dict[str, int]]]) -> str:
    """One line a function, so that a change shows what became longer."""
    blocks = [
        f"  {json.dumps(header)}: {{\n"
        + ",\n".join(f"    {json.dumps(name)}: {json.dumps(counts)}" for name, counts in functions.items())
        + "\n  }"
        for header, functions in table.items()
    ]
    return "{\n" + ",\n".join(blocks) + "\n}\n"
