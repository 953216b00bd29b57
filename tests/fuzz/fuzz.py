"""Runs the fuzzers, one after the other, each on one core.

usage: python tests/fuzz/fuzz.py scenario expression program run_file --minutes 30

Seeds are examples and what tests use. What reaches something new is kept in FOLDER/corpus/KIND, from where the next
call goes on. What crashes, leaks, hangs for a minute or takes 2 GB is in FOLDER/found; it ends that fuzzer. Ends
with exit status 1 where something is.
"""

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

PROJECT = Path(__file__).resolve().parents[2]
KINDS = ("scenario", "expression", "program", "run_file")
EXPRESSION = re.compile(r'^(?:when|value) = "(.*)"', re.MULTILINE)
WORD = re.compile(r"\b[A-Za-z_]\w+", re.ASCII)
FORMULAS = (
    "sin(t) + cos(x) * tan(x) - asin(1) / acos(0) ^ atan(x)",
    "atan2(x, t) + fmod(t, 0.5) + min(x, 1) - max(x_dot, energy)",
    "x > 0 ? t : -t",
    "sinh(x) + cosh(x) + tanh(x) + exp(x) + log(x) + ln(x) + log2(x) + log10(x)",
    "sqrt(abs(x)) + sign(x) + rint(t) + floor(t) + 3e-5*pi",
    "x >= 1 && t <= 1 || x == 2 && t != 3",
)


def write_seeds(kind: str, folder: Path, given: argparse.Namespace) -> None:
    scenarios = [file.read_text() for file in sorted((PROJECT / "examples").glob("*.toml"))]
    if kind == "scenario":
        texts = scenarios
    elif kind == "expression":
        texts = [*FORMULAS, *(found for text in scenarios for found in EXPRESSION.findall(text))]
    elif kind == "program":
        texts = [file.read_text() for file in sorted(given.fuzzers.glob("*.program"))]
    else:
        for name in ("double_pendulum", "conical", "poincare"):
            file, short = folder / f"{name}.h5", ["run.duration=0.1", "output.interval=0.05"]
            options = [word for setting in short for word in ("--set", setting)]
            example = PROJECT / f"examples/{name}.toml"
            subprocess.run([given.program, "simulate", example, *options, "--quiet", "-o", file], check=True)
        return
    for number, text in enumerate(texts):
        (folder / f"seed_{number}").write_text(text)


def fuzz(kind: str, given: argparse.Namespace) -> bool:
    corpus, found = given.folder / "corpus" / kind, given.folder / "found"
    seeds = given.folder / "seeds" / kind
    for folder in (corpus, found, seeds):
        folder.mkdir(parents=True, exist_ok=True)
    write_seeds(kind, seeds, given)
    options = [
        f"-max_total_time={round(60 * given.minutes)}",
        "-timeout=60",
        "-rss_limit_mb=2048",
        "-max_len=65536",
        f"-artifact_prefix={found / kind}_",
        "-print_final_stats=1",
    ]
    if kind != "run_file":
        texts = (file.read_text() for file in seeds.iterdir())
        words = sorted({word for text in texts for word in WORD.findall(text)})
        dictionary = given.folder / f"{kind}.words"
        dictionary.write_text("".join(f'"{word}"\n' for word in words))
        options.append(f"-dict={dictionary}")
    command = ["nice", "-n", "19", given.fuzzers / f"{kind}_fuzz", *options, corpus, seeds]
    log, before = given.folder / f"{kind}.log", set(found.glob(f"{kind}_*"))
    with log.open("w") as told:
        leaks = {"LSAN_OPTIONS": f"suppressions={PROJECT / 'tests/fuzz/leaks.txt'}:print_suppressions=0"}
        done = subprocess.run(command, stdout=told, stderr=told, env=os.environ | leaks, check=False)
    if done.returncode == 0:
        # HDF5 meets texts of damaged files in a process of its own first, which may die (saved_run.cpp).
        for file in set(found.glob(f"{kind}_*")) - before:
            file.unlink()
    said = log.read_text(errors="replace")
    runs = re.findall(r"number_of_executed_units: *(\d+)", said)
    print(f"{kind}: {runs[-1] if runs else 'no'} inputs, exit status {done.returncode}, {log}", flush=True)
    return done.returncode == 0


def main() -> None:
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("kinds", nargs="+", choices=KINDS)
    words.add_argument("--minutes", type=float, default=30.0)
    words.add_argument("--fuzzers", type=Path, default=PROJECT / "build/fuzz/tests/fuzz")
    words.add_argument("--program", type=Path, default=PROJECT / "build/release/bin/pendula")
    words.add_argument("--folder", type=Path, default=PROJECT / "build/fuzz")
    given = words.parse_args()
    good = [fuzz(kind, given) for kind in given.kinds]
    sys.exit(not all(good))


if __name__ == "__main__":
    main()
