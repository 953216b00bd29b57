"""How much the kernels compute is recorded; a change that makes them longer must say so in its diff."""

import json
from pathlib import Path

from pendula_codegen.counts import as_json, count_table

RECORD = Path(__file__).parent / "operation_counts.json"
REFRESH = (
    "record with: PYTHONPATH=codegen python -m pendula_codegen counts --output codegen/tests/" + RECORD.name
)


def test_no_function_became_longer_unnoticed(fresh):
    recorded, counted = json.loads(RECORD.read_text()), count_table(fresh)
    changes = [
        f"{header} {name}: {recorded.get(header, {}).get(name)} -> {counts}"
        for header, functions in counted.items()
        for name, counts in functions.items()
        if recorded.get(header, {}).get(name) != counts
    ]
    assert changes == [], f"{'; '.join(changes)}; {REFRESH}"
    assert RECORD.read_text() == as_json(counted), REFRESH


def test_every_function_states_its_counts(fresh):
    """Only what a template writes has none."""
    written = {"solve_symmetric", "hamiltonian", "sine_and_cosine", "trig", "trig_of", "coordinates"}
    written |= {"read_parameters", "parameter_places", "cast_parameters"}
    for header in fresh.values():
        functions = {
            line.split("static void ")[1].split("(")[0]
            for line in header.text.splitlines()
            if "static void " in line
        }
        assert functions - written == set(header.counts)
        for name, counts in header.counts.items():
            if "static constexpr std::string_view name" in header.text:
                assert f"/// {counts}\n  template <class Real>\n  static void {name}(" in header.text
