"""The built-in models as the laboratory has them: python lab_models.py CODEGEN OUTPUT, with the generator's packages.

Writes JSON: by name what describe tells of a model, and its program for the interpreter.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

LINKS = {"cart_chain": 2, "driven_chain": 2, "joint_springs": 3}  # of those that have links; else 1

# Where they begin, and with what parameters that are not their defaults.
STARTS = {
    "cart_chain": {"q": [0, 2.0, 1.2]},
    "driven_chain": {
        "q": [3.0, 3.1],
        "p": {"y_amplitude": 0.05, "frequency": 120, "damping": 0.05, "lengths": 0.5},
    },
    "furuta": {"q": [0, 2.6], "v": [3, 0]},
    "joint_springs": {"q": [1.2, 0.6, 0.2]},
    "rods": {"q": [2.0]},
    "spring_pendulum": {"q": [0.7, 0, -1.1], "v": [0, 0.9, 0]},
    "swinging_atwood": {"q": [1, 1.5707963267948966]},
}


def generator(codegen: Path, command: str, model: str, *more: str) -> str:
    links = ["--links", str(LINKS[model])] if model in LINKS else []
    return subprocess.run(
        [sys.executable, "-m", "pendula_codegen", command, "--model", model, *links, *more],
        env={**os.environ, "PYTHONPATH": str(codegen), "PYTHONDONTWRITEBYTECODE": "1"},
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    ).stdout


def main() -> None:
    codegen, output = Path(sys.argv[1]), Path(sys.argv[2])
    names = sorted(file.stem for file in (codegen / "pendula_codegen/models").glob("[a-z]*.py"))
    models = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            program = Path(folder) / f"{name}.program"
            generator(codegen, "program", name, "--as", "bytecode", "--output", str(program))
            described = json.loads(generator(codegen, "describe", name).splitlines()[-1])
            del described["file"]
            models[name] = {"model": described, "program": program.read_text(), "start": STARTS.get(name, {})}
    output.write_text(json.dumps(models))


if __name__ == "__main__":
    main()
