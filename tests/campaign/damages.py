"""Damages, mutations and kills without number: what the tests of the command line draw a few of.

usage: python tests/campaign/damages.py scenarios|runs|ensembles|kills|ensemble_kills --seed 1 --count 100000

Each number is a draw. How far it came is kept in FOLDER/KIND_SEED.json: the same command goes on from there after it
was stopped or killed. What failed is in FOLDER/failed_KIND_SEED_NUMBER.txt; the campaign goes on behind it. Ends with
exit status 1 where anything failed. `--from NUMBER --count 1` draws one again.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parents[1] / "cli"
TESTS = {
    "scenarios": "test_mutated_scenarios.py::test_mutated_scenarios_end_in_order",
    "runs": "test_damaged_files.py::test_a_run_goes_on_from_what_was_written_or_not_at_all",
    "ensembles": "test_damaged_files.py::test_an_ensemble_goes_on_from_what_was_written_or_not_at_all",
    "kills": "test_run_file.py::test_a_run_that_is_killed_leaves_a_file_that_opens_and_goes_on",
    "ensemble_kills": "test_ensemble.py::test_killed_at_any_time_it_goes_on",
}
AT_ONCE = 200  # draws of one pytest, which is what a stop may cost


def draw(given: argparse.Namespace, first: int, count: int) -> tuple[int, str]:
    """Where it failed, and how; the number after the last draw where it did not."""
    number = given.folder / f"draw_{given.kind}_{given.seed}"
    number.write_text(str(first))
    environment = os.environ | {
        "PENDULA_PROGRAM": str(given.program.resolve()),
        "PENDULA_SEED": str(given.seed),
        "PENDULA_FIRST_DRAW": str(first),
        "PENDULA_DRAWS": str(count),
        "PENDULA_DRAW": str(number.resolve()),
    }
    pytest = [sys.executable, "-B", "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", TESTS[given.kind]]
    done = subprocess.run(pytest, cwd=HERE, env=environment, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return first + count, ""
    return int(number.read_text()), done.stdout + done.stderr


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("kind", choices=TESTS)
    words.add_argument("--seed", type=int, default=1)
    words.add_argument("--from", dest="first", type=int, help="this number, wherever it came before")
    words.add_argument("--count", type=int, default=1000, help="so many from 0, or from this number")
    words.add_argument("--program", type=Path, default=Path("build/release/bin/pendula"))
    words.add_argument("--folder", type=Path, default=Path("build/damages"))
    given = words.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    progress = given.folder / f"{given.kind}_{given.seed}.json"
    so_far = json.loads(progress.read_text()) if progress.exists() else {"next": 0, "failed": []}
    again = given.first is not None
    at, failed = (given.first, []) if again else (so_far["next"], so_far["failed"])
    end = (given.first or 0) + given.count
    while at < end:
        reached, told = draw(given, at, min(AT_ONCE, end - at))
        if told:
            (given.folder / f"failed_{given.kind}_{given.seed}_{reached}.txt").write_text(told)
            failed.append(reached)
        at = reached + bool(told)
        if not again:
            fresh = progress.with_suffix(".new")
            fresh.write_text(json.dumps({"next": at, "failed": failed}))
            fresh.replace(progress)
        print(f"{given.kind}, seed {given.seed}: {at} of {end}, failed: {failed or 'none'}", flush=True)
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
