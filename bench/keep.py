"""Keeps of a Google Benchmark run what is worth committing: medians, and what they were measured with.

usage: python bench/keep.py RAW.json KEPT.json
"""

import json
import platform
import sys
from pathlib import Path

DROPPED = {
    "family_index",
    "per_family_instance_index",
    "name",
    "run_name",
    "run_type",
    "repetitions",
    "repetition_index",
    "threads",
    "aggregate_name",
    "aggregate_unit",
    "iterations",
    "cpu_time",
}


def processor() -> str:
    """The processor's name as the system gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def context(raw: dict) -> dict:
    """What the figures were measured with, and nothing about whose machine it was."""
    kept = {key: raw[key] for key in ("compiler", "flags", "repetitions", "num_cpus", "caches") if key in raw}
    return {"date": raw["date"][:10], "processor": processor(), **kept}


def is_kept(entry: dict) -> bool:
    """Whether an entry is the median of its repetitions, or the only one."""
    if entry["run_type"] == "aggregate":
        return entry["aggregate_name"] == "median"
    return entry.get("repetitions", 1) <= 1


def kept(raw: dict) -> dict:
    """Benchmarks by name: `time` in `time_unit`, and the counters; `fastest` of all repetitions, too."""
    benchmarks: dict[str, dict] = {}
    spread: dict[str, float] = {}
    fastest: dict[str, list[dict]] = {}
    for entry in raw["benchmarks"]:
        name = entry["run_name"].removesuffix("/manual_time")
        if entry["run_type"] == "iteration" and not entry.get("error_occurred"):
            fastest.setdefault(name, []).append(entry)
        if entry.get("error_occurred"):
            benchmarks[name] = {"failed": entry["error_message"]}
        elif entry.get("aggregate_name") == "cv":
            spread[name] = round(entry["real_time"], 4)
        elif is_kept(entry) and "failed" not in benchmarks.get(name, {}):
            benchmarks[name] = {key: value for key, value in entry.items() if key not in DROPPED}
    for name, entry in benchmarks.items():
        if "failed" not in entry:
            entry["time"] = entry.pop("real_time")
            entry["fastest"] = min(each["real_time"] for each in fastest[name])
            if "nanoseconds" in entry:
                entry["fastest_nanoseconds"] = min(each["nanoseconds"] for each in fastest[name])
            entry["relative_spread"] = spread.get(name, 0.0)
    return {"context": context(raw["context"]), "benchmarks": benchmarks}


def main() -> None:
    """Reads the first file, writes the second."""
    source, target = map(Path, sys.argv[1:])
    raw = json.loads(source.read_text(encoding="utf-8"))
    target.write_text(json.dumps(kept(raw), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
