"""pendula check passes right models, whatever their numbers, and finds what is wrong in a kernel."""

import json
import random
import sys

import pytest
from conftest import EXAMPLES
from test_documentation import blocks
from test_forcing import MODEL as FORCED
from test_forcing import SHARP

SYSTEMS = sorted(file for file in EXAMPLES.glob("*.toml") if "[system]" in file.read_text())
# Bars between joints, without a parameter: some products in its kernel are of two numbers.
NUMBERS = """
def define(model, links):
    fixed, joints = [(0, 0), (1, 0), (2, 0)], [[model.coordinate(f"{a}_{k}", "m") for a in "xy"] for k in range(3)]
    bars = (fixed[0], joints[0]), (joints[0], joints[1]), (fixed[1], joints[1]), (joints[1], joints[2])
    model.lagrangian = 0
    for p, q in (*bars, (fixed[2], joints[2])):
        for x, y in zip(p, q):
            u, v = (0 if each in (0, 1, 2) else model.rate(each) for each in (x, y))
            model.lagrangian += (u**2 + u * v + v**2) / 6
        model.lagrangian -= 9.81 * (p[1] + q[1]) / 2
"""
OWN = {"numbers": NUMBERS, "forced": FORCED, "sharp": SHARP, "sprung": blocks("python")[0]}
# With the links that other tests compile them for.
MODELS = [
    *[
        (name, None)
        for name in ("furuta", "spring_pendulum", "swinging_atwood", "forced", "numbers", "sharp")
    ],
    *[(name, 2) for name in ("cart_chain", "driven_chain", "rods", "sprung")],
    ("joint_springs", 3),
]
DRAWS = 2


def drawn(about: dict, draw: random.Random) -> str:
    """A scenario with parameters over four decades about their defaults, and a start of any size."""

    def sign() -> int:
        return draw.choice((-1, 1))

    def decades(low: float, high: float) -> float:
        return 10 ** draw.uniform(low, high)

    lines = ["[system]", f"model = {about['file']!r}"]
    if about["has_links"]:
        lines.append(f"links = {about['links']}")
    lines.append("[system.parameters]")
    for parameter in about["parameters"]:
        count = about["links"] if parameter["per_link"] else 1
        usual = abs(parameter["default"] or 1.0)
        numbers = [usual * decades(-2, 2) for _ in range(count)]
        lines.append(f"{parameter['name']} = {numbers if parameter['per_link'] else numbers[0]}")
    for entry in about["inputs"]:
        lines += ["[[system.drive]]", f"input = {entry['name']!r}"]
        lines += [f"amplitude = {decades(-2, 2)}", f"frequency = {decades(-2, 2)}"]
    lines.append("[start]")
    for coordinate in about["coordinates"]:
        size = draw.uniform(0.1, 3) if coordinate["unit"] == "rad" else decades(-1, 1)
        lines.append(f"{coordinate['name']} = {sign() * size}")
        lines.append(f"{coordinate['rate']} = {sign() * decades(-2, 1)}")
    return "\n".join([*lines, "[run]", "duration = 1.0", ""])


@pytest.mark.parametrize("file", SYSTEMS, ids=lambda file: file.stem)
def test_examples_pass(file, pendula):
    ended = pendula("check", file)
    assert ended.returncode == 0, ended.stdout + ended.stderr


@pytest.mark.parametrize(("model", "links"), MODELS)
def test_models_pass_with_any_numbers(model, links, pendula, tmp_path):
    named = model
    if model in OWN:
        named = tmp_path / f"{model}.py"
        named.write_text(OWN[model])
    told = pendula("describe", named, "--json", *([] if links is None else ["--links", links]))
    about = json.loads(told.stdout)
    if model not in OWN:
        about["file"] = model
    draw = random.Random(1)
    for _ in range(DRAWS):
        scenario = tmp_path / "drawn.toml"
        scenario.write_text(drawn(about, draw))
        ended = pendula("check", scenario)
        assert ended.returncode == 0, ended.stdout + ended.stderr + scenario.read_text()


# A compiler that takes momenta for the accelerations of four states.
WRONG_COMPILER = f"""#!{sys.executable}
import os, sys
from pathlib import Path
right = "  (Function)NAME(acceleration),"
wrong = f"#if WIDTH == 4\\n  (Function)NAME(momentum_from_velocity),\\n#else\\n{{right}}\\n#endif"
for text in [Path(word) for word in sys.argv if word.endswith(".c")]:
    own = text.with_suffix(f".{{os.getpid()}}")  # it runs beside others
    own.write_text(text.read_text().replace(f"\\n{{right}}\\n  (", f"\\n{{wrong}}\\n  ("))
    own.rename(text)
os.execvp("cc", ["cc", *sys.argv[1:]])
"""


def test_a_function_of_four_states_that_is_wrong_is_found(pendula, tmp_path):
    compiler = tmp_path / "wrong"
    compiler.write_text(WRONG_COMPILER)
    compiler.chmod(0o755)
    ended = pendula("check", EXAMPLES / "furuta.toml", CC=str(compiler), XDG_CACHE_HOME=str(tmp_path))
    failed = [line for line in ended.stdout.splitlines() if line.endswith("FAILED")]
    assert ended.returncode == 1 and len(failed) == 1, ended.stdout + ended.stderr
    assert "functions of 2, 4 and 8 states, as of one" in failed[0]
