"""Compares what an example printed, lines of `name number unit`, with the same motion by the command line.

usage: compare.py PENDULA SCENARIO EVENT PRINTED FOLDER [START ABOVE BELOW]

EVENT is the expression whose zeros the line `events` counts. Where START is a key, `change_of_theta_2` is compared with
the difference of runs that start from the values ABOVE and BELOW, 2e-6 apart. FOLDER is for files. What is compared,
and how far it is off, is printed; numbers are off relative to 1 or their size.
"""

import csv
import subprocess
import sys
from pathlib import Path


def run(pendula: str, scenario: Path, folder: Path, *options: str) -> tuple[dict[str, float], int]:
    """The last row, and the number of events."""
    rows, events = folder / "rows.csv", folder / "events.csv"
    command = [pendula, "simulate", scenario, "--quiet", "-o", rows, "--events", events, *options]
    subprocess.run(command, check=True)
    with rows.open() as file:
        last = list(csv.DictReader(file))[-1]
    return {name: float(number) for name, number in last.items()}, len(events.read_text().splitlines()) - 1


def main(pendula: str, original: str, event: str, printed: str, work: str, *differences: str) -> None:
    folder = Path(work)
    scenario = folder / "scenario.toml"
    scenario.write_text(f'{Path(original).read_text()}\n[[event]]\nname = "event"\nwhen = "{event}"\n')
    words = [line.split() for line in Path(printed).read_text().splitlines()]
    got = {name: float(number) for name, number, *_ in words}
    last, events = run(pendula, scenario, folder)
    largest = max(abs(got[name] - number) / max(1, abs(number)) for name, number in last.items())
    print(f"{len(last)} numbers, off by {largest:.1e}; {events} events, got {got['events']:.0f}")
    good = len(last) == len(got) - len(differences[:1]) - 1 and largest < 1e-8 and got["events"] == events > 0
    if differences:
        key, *values = differences
        above, below = (run(pendula, scenario, folder, "--set", f"{key}={value}")[0] for value in values)
        change = (above["theta_2"] - below["theta_2"]) / 2e-6
        off = abs(got["change_of_theta_2"] / change - 1)
        print(f"a change of {change:.6g}, off by {off:.1e} of it")
        good = good and off < 1e-6
    sys.exit(not good)


if __name__ == "__main__":
    main(*sys.argv[1:])
