"""Each of the campaigns, small: cases that were wrong without a word once, and some that were right. The whole ones are
attack.py's."""

import os
import tomllib
from pathlib import Path

import attack
import drawing
import judging
import pytest
import truth

CASES = {
    "chains": {
        "at rest in the end, rows in the first milliseconds": [103, 144, 832, 912],
        "at rest in the end, explicit with an accuracy": [655, 914],
        "at rest in the end, no more than ten accuracies off": [86, 801, 961],
        "chaos made by rounding, constant steps": [553, 589, 650],
        "chaos in between, by a tolerance": [312, 984],
        "right": [5, 11, 24],
    },
    "models": {"brought with pendula": [400, 404, 411, 422]},
    "events": {
        "functions of time": [0, 4, 8, 57],
        "pairs at a jump": [12, 27],
        "pairs closer than an interpolant": [7],
        "pairs of a product of what moves": [931],
        "narrow in the state": [3008, 3012, 3026],
        "right": [2, 21, 33],
    },
    "ensembles": {"rows of members": [8, 52], "right": [3, 5]},
}
ALL = [
    pytest.param(kind, number, id=f"{kind} {number}: {what}")
    for kind, groups in CASES.items()
    for what, numbers in groups.items()
    for number in numbers
]


@pytest.fixture(scope="session")
def room(tmp_path_factory) -> truth.Room:
    references = [
        Path(os.environ[name]) for name in ("CHAIN_REFERENCE", "MODEL_REFERENCE", "LINKAGE_REFERENCE")
    ]
    return truth.Room(*references, tmp_path_factory.mktemp("truths"))


@pytest.mark.parametrize(("kind", "number"), ALL)
def test_nothing_is_wrong_without_a_word(room, program, tmp_path, kind, number):
    verdict = judging.judge(drawing.draw(kind, 1, number), room, judging.Program(program, tmp_path / "run"))
    assert verdict.kind not in (*attack.BAD, "slow", "no reference"), verdict


# Runs whose rows in short fast phases were wrong, each in a file of its own.
TRIALS = Path(__file__).parents[1] / "trials"


@pytest.mark.parametrize("name", ["models/passage", "models/passage_wider", "models/passage_polar", "whip"])
def test_rows_in_short_fast_phases_are_right_or_said_with_their_size(room, program, tmp_path, name):
    file, text = TRIALS / f"{name}.toml", ""
    tables = tomllib.loads(file.read_text())
    if "system" in tables:
        text = (file.parent / tables["system"]["model"]).read_text()
        tables["system"]["model"] = "model.py"
    else:
        tables["chain"] |= {"links": len(tables["chain"]["masses"]), "gravity": 9.81}
    tables["output"] = {"every": 1}  # rows at an interval may miss the phase
    case = drawing.Case("trials", 0, 0, name, tables, text)
    verdict = judging.judge(case, room, judging.Program(program, tmp_path / "run"))
    # Of two of them rounding leaves no more: errors are 0.4 to 2.1 of what is told.
    assert verdict.kind == "right" or (verdict.kind == "said" and verdict.error < 4 * verdict.expected), (
        verdict
    )
