"""Tries to find runs of pendula that are wrong without a word.

usage: python tests/campaign/attack.py chains|models|events|ensembles|aimed|linkages --seed 1 --from 0 --count 1000

Each number is a case (drawing.py). The program moves it, references that it has no part in do too (truth.py), and each
row and event that it writes is compared (judging.py says what is right). What is silently wrong is kept, to be run
again, in FOLDER/silent/CASE. Verdicts are lines of FOLDER/verdicts_KIND_SEED.jsonl: a case that has one is not run
again, but with --again. References are kept in FOLDER/truths. Ends with exit status 1 where a case is silently wrong,
or the program crashed.

The compiled references need chain_reference, model_reference and linkage_reference, Python needs SymPy, NumPy and h5py.
"""

import argparse
import json
import os
import shutil
import sys
import traceback
from collections import Counter
from pathlib import Path

import drawing
import judging
import truth

BAD = ("SILENT", "crash", "harness")
JUDGED = ("right", "false doubt", "said", "SILENT")


def known(file: Path) -> dict[str, dict]:
    if not file.exists():
        return {}
    verdicts = map(json.loads, file.read_text().splitlines())
    return {verdict["name"]: verdict for verdict in verdicts}


def try_case(case: drawing.Case, given: argparse.Namespace, room: truth.Room) -> dict:
    program = judging.Program(
        given.program.resolve(), given.folder / "run" / str(os.getpid()), given.patience
    )
    try:
        verdict = vars(judging.judge(case, room, program))
    except Exception:  # the campaign's own fault: told, and the next one is tried
        verdict = vars(judging.Verdict(case.name, case.family, "", "harness", words=[traceback.format_exc()]))
    if verdict["kind"] in BAD and program.folder.exists():
        kept = given.folder / "silent" / case.name
        shutil.rmtree(kept, ignore_errors=True)
        kept.mkdir(parents=True)
        for name in ("scenario.toml", "model.py", "rows.csv", "events.csv"):
            if (program.folder / name).exists():
                shutil.copy(program.folder / name, kept)
        (kept / "what.json").write_text(json.dumps(verdict, indent=1, default=str))
    elif given.folder:
        shutil.rmtree(given.folder / "silent" / case.name, ignore_errors=True)
    for name in ("rows.csv", "events.csv", "model.py"):
        (program.folder / name).unlink(missing_ok=True)
    return verdict


def ratios(verdicts: list[dict]) -> list[float]:
    """True errors over those that runs expected, where both are known."""
    return sorted(v["error"] / v["expected"] for v in verdicts if v.get("expected") and v["kind"] in JUDGED)


def quantiles(verdicts: list[dict]) -> str:
    """What expected_error is worth."""
    found = ratios(verdicts)
    if not found:
        return "no run told an expected error"
    above = {limit: sum(ratio > limit for ratio in found) for limit in (1, 2, 10)}
    below = sum(ratio < 1e-3 for ratio in found)
    return (
        f"true error over expected_error, {len(found)} runs: median {found[len(found) // 2]:.2g}, "
        + ", ".join(f"above {limit} in {count}" for limit, count in above.items())
        + f", below a thousandth in {below}, largest {found[-1]:.2g}"
    )


def table(verdicts: list[dict]) -> None:
    kinds = Counter(v["kind"] for v in verdicts)
    print(", ".join(f"{count} {kind}" for kind, count in kinds.most_common()))
    for column in ("family", "method"):
        print()
        groups: dict[str, Counter] = {}
        for v in verdicts:
            name = v["settings"].split(",")[0] if column == "method" else v["family"]
            groups.setdefault(name, Counter())[v["kind"]] += 1
        for name, counts in sorted(groups.items()):
            print(f"{name:40}" + ", ".join(f"{count} {kind}" for kind, count in counts.most_common()))
    print()
    print(quantiles(verdicts))
    for v in verdicts:
        if v["kind"] in BAD:
            what = (v["wrong"] or v["words"] or [""])[0].strip().splitlines()[-1]
            print(f"{v['kind']} {v['name']} ({v['family']}; {v['settings']}): {what}")


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("kind", choices=drawing.KINDS)
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--from", dest="first", type=int, default=0)
    words.add_argument("--count", type=int)
    words.add_argument("--only", type=int, nargs="*", help="these numbers")
    words.add_argument("--again", action="store_true", help="those that have a verdict, too")
    words.add_argument("--program", type=Path, default=Path("build/release/bin/pendula"))
    words.add_argument("--references", type=Path, default=Path("build/release/bin"))
    words.add_argument("--folder", type=Path, default=Path("build/attack"))
    words.add_argument("--patience", type=float, default=60.0, help="seconds a run may take")
    given = words.parse_args()
    if given.count is None:
        given.count = drawing.FIRST[given.kind]
    numbers = given.only if given.only else range(given.first, given.first + given.count)
    given.folder = given.folder.resolve()
    given.folder.mkdir(parents=True, exist_ok=True)
    references = [
        (given.references / name).resolve()
        for name in ("chain_reference", "model_reference", "linkage_reference")
    ]
    for file in (given.program, *references):
        if not os.access(file, os.X_OK):
            words.error(
                f"{file} is no program; build pendula_cli, chain_reference, model_reference and linkage_reference"
            )
    kept = given.folder / "truths"
    kept.mkdir(exist_ok=True)
    room = truth.Room(*references, kept)
    judging.environment(given.folder / "kernels")
    file = given.folder / f"verdicts_{given.kind}_{given.seed}.jsonl"
    verdicts = known(file)
    cases = [drawing.draw(given.kind, given.seed, number) for number in numbers]
    for case in cases:
        if case.name in verdicts and not given.again:
            continue
        verdict = try_case(case, given, room)
        verdicts[case.name] = verdict
        with file.open("a") as opened:
            opened.write(json.dumps(verdict, default=str) + "\n")
        if verdict["kind"] in BAD:
            what = (verdict["wrong"] or verdict["words"] or [""])[0].strip().splitlines()[-1]
            print(f"{verdict['kind']} {case.name} ({case.family}; {verdict['settings']}): {what}", flush=True)
    mine = [verdicts[case.name] for case in cases]
    print()
    table(mine)
    sys.exit(1 if any(v["kind"] in BAD for v in mine) else 0)


if __name__ == "__main__":
    main()
