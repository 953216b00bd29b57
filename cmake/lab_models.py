"""The built-in models as the laboratory has them: python lab_models.py CODEGEN OUTPUT, with the generator's packages.

Writes JSON: by name how many links a model has at `first`, and what is `made` of it, by number of links: what describe
tells of it, its program for the interpreter, and where it begins.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

LINKS = {"cart_chain": 2, "driven_chain": 2, "joint_springs": 3}  # at first, of those that have links
MOST_LINKS = 3  # programs grow by the square of it

# Where they begin, and with what parameters that are not their defaults. Angles of links come last. The page puts
# linkages together, from what is nearly closed.
STARTS = {
    "cart_chain": {"q": [0, 2.0, 1.2, 0.8]},
    "driven_chain": {
        "q": [3.0, 3.1, 3.0],
        "p": {"y_amplitude": 0.05, "frequency": 120, "damping": 0.05, "lengths": 0.5},
    },
    "four_bar": {"q": [1.57, 0.78, -2.92], "v": [9, -6, -6]},
    "furuta": {"q": [0, 2.6], "v": [3, 0]},
    "hanging_chain": {"q": [1.31, 1.31, 1.4, 1.05, 1.05, 2.09, 2.88, 4.48], "p": {"damping": 0.002}},
    "joint_springs": {"q": [1.2, 0.6, 0.2]},
    "peaucellier": {"q": [0.3, -0.95, 0.79, -0.61, 0.39, -0.56, 0.7, -1]},
    "rods": {"q": [2.0]},
    "slider_crank": {"q": [0.7, -0.216, 1.109], "v": [8, -2.09, -1.95]},
    "spring_pendulum": {"q": [0.7, 0, -1.1], "v": [0, 0.9, 0]},
    "swinging_atwood": {"q": [1, 1.5707963267948966]},
    "walking_leg": {
        "q": [0.15, 0, -0.24, 0.313, -0.27, -0.455, -0.748, 0.081, -0.592, -0.281, -0.432, -0.918],
        "v": [0, 1.9, -1.18, 0.42, 1.56, 0.46, -0.48, -1.11, 1.08, -0.44, 2.86, 0.01],
    },
}


# The laboratory takes Gauss steps; these are for derivatives along Taylor series, and a program may lack them.
UNUSED = ("series_start_along", "series_next_along")


def without(program: str, functions: tuple[str, ...]) -> str:
    """A program without some of its functions, each of which goes to where the next one begins."""
    kept, is_wanted = [], True
    for line in program.splitlines(keepends=True):
        kind, *words = line.split()
        if kind in ("function", "end"):
            is_wanted = not words or words[0] not in functions
        if is_wanted:
            kept.append(line)
    return "".join(kept)


def generator(codegen: Path, command: str, model: str, links: int, *more: str) -> str:
    counted = ["--links", str(links)] if model in LINKS else []
    return subprocess.run(
        [sys.executable, "-m", "pendula_codegen", command, "--model", model, *counted, *more],
        env={**os.environ, "PYTHONPATH": str(codegen), "PYTHONDONTWRITEBYTECODE": "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout


def main() -> None:
    codegen, output = Path(sys.argv[1]), Path(sys.argv[2])
    names = sorted(file.stem for file in (codegen / "pendula_codegen/models").glob("[a-z]*.py"))
    models = {}
    for name in names:
        counts = range(1, MOST_LINKS + 1) if name in LINKS else [1]
        made = {links: make(codegen, name, links) for links in counts}
        models[name] = {"first": LINKS.get(name, 1), "made": made}
    output.write_text(json.dumps(models))


def make(codegen: Path, name: str, links: int) -> dict:
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / "program"
        generator(codegen, "program", name, links, "--as", "bytecode", "--output", str(program))
        text = program.read_text()
    described = json.loads(generator(codegen, "describe", name, links).splitlines()[-1])
    del described["file"]
    start = dict(STARTS.get(name, {}))
    if "q" in start:
        start["q"] = start["q"][: len(described["coordinates"])]
    return {"model": described, "program": without(text, UNUSED), "start": start}


if __name__ == "__main__":
    main()
