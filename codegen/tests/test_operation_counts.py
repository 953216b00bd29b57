"""How much the kernels compute is recorded; a change that makes them longer must say so in its diff."""

import json
from pathlib import Path

from pendula_codegen.counts import as_json, count_table

RECORD = Path(__file__).parent / "operation_counts.json"
REFRESH = (
    "record with: PYTHONPATH=codegen python -m pendula_codegen counts --output codegen/tests/" + RECORD.name
)


def test_no_function_became_longer_unnoticed(fresh_headers):
    recorded, counted = json.loads(RECORD.read_text()), count_table(fresh_headers)
    changes = [
        f"{header} {name}: {recorded.get(header, {}).get(name)} -> {counts}"
        for header, functions in counted.items()
        for name, counts in functions.items()
        if recorded.get(header, {}).get(name) != counts
    ]
    assert changes == [], f"{'; '.join(changes)}; {REFRESH}"
    assert RECORD.read_text() == as_json(counted), REFRESH


def test_every_flat_function_states_its_counts(fresh_headers):
    """Only those that solve a linear system with loops, or count in sines and angles, have none."""
    looped = {"solve_symmetric", "velocity_from_momentum", "acceleration", "hamiltonian"}
    looped |= {"trig", "coordinates"}
    table = count_table(fresh_headers)
    for header, text in fresh_headers.items():
        if "static void" in text:
            functions = {
                line.split("static void ")[1].split("(")[0]
                for line in text.splitlines()
                if "static void " in line
            }
            assert functions - looped == set(table[header])
