"""Scenarios that are changed at random end in order: as runs, or with an error in plain words. Nothing hangs, dies of a
signal, or is silent; tests/campaign/damages.py draws more changes."""

import json
import random
import re
import resource
import signal
import subprocess
from functools import partial
from pathlib import Path

from conftest import DOUBLE, SPHERICAL, program
from damage import damaged, draws

EXAMPLES = Path(__file__).parents[2] / "examples"

FULL = """\
[chain]
space = "planar"
links = 3
masses = [1.0, 0.5, 0.25]
lengths = [1.0, 0.7, 0.4]
gravity = 9.81
damping = 0.01
torques = [0.0, 0.1, 0.0]

[start]
theta = [0.4, 0.2, -0.3]
theta_dot = 0.1

[run]
method = "gauss"
stages = 4
tolerance = 1e-8
duration = 2.0

[output]
interval = 0.1

[[event]]
name = "left"
when = "sin(theta_1) + 0.1*theta_dot_2 - fmod(t, 0.5)"
direction = "up"

[ensemble]
keep = ["final", "events"]

[[ensemble.axis]]
key = "start.theta[1]"
from = 0.1
to = 0.4
count = 3

[[ensemble.random]]
key = "chain.masses[2]"
distribution = "normal"
mean = 0.5
deviation = 0.01
"""
CHAINS = (
    "double_pendulum",
    "driven_damped",
    "hundred_links",
    "poincare",
    "spatial_chain",
    "triple_pendulum",
    "whip",
)

VALUES = (
    *(
        "0",
        "-1",
        "1",
        "2",
        "3",
        "1e308",
        "-1e308",
        "1e-308",
        "5e-324",
        "nan",
        "inf",
        "-inf",
        "1e400",
        "0x7f",
        "1_0",
    ),
    *(
        "9223372036854775807",
        "9223372036854775808",
        "1e9",
        "4096",
        "1e-9",
        "0.1.2",
        "1979-05-27",
        "true",
        '"gauss"',
    ),
    *('""', '"\\u0000"', "'", "[]", "[[]]", "[1, [2]]", "[1, 'a']", "{}", "{ a = 1 }", "[nan, 1]", '"90°"'),
)
NUMBER = re.compile(r"(?<![\w.])-?\d[\w.+-]*")
WORD = re.compile(r"\w+")


def changed(draw: random.Random, text: str, words: list[str]) -> str:
    lines = text.splitlines(keepends=True)
    k, other = draw.randrange(len(lines)), draw.randrange(len(lines))

    def replaced(found: list[re.Match], value: str) -> str:
        if not found:
            return text
        place = draw.choice(found)
        return text[: place.start()] + value + text[place.end() :]

    match draw.randrange(9):
        case 0:
            del lines[k]
        case 1:
            lines.insert(other, lines[k])
        case 2:
            lines[k], lines[other] = lines[other], lines[k]
        case 3:
            return replaced(list(WORD.finditer(text)), draw.choice(words))
        case 4:
            key, found, _ = lines[k].partition("=")
            lines[k] = f"{key}= {draw.choice(VALUES)}\n" if found else lines[k]
        case 5:
            at = draw.randrange(len(text))
            return text[:at] + draw.choice("[]{}\"'=.,#\n\\\t\0é-+*/()^") + text[at + draw.randrange(2) :]
        case 6:
            lines.insert(k, f"{draw.choice(words)} = {draw.choice(VALUES)}\n")
        case _:
            return replaced(list(NUMBER.finditer(text)), draw.choice(VALUES))
    return "".join(lines)


def ended(command: list, folder) -> tuple[int | None, str, str]:
    """Of a run that is asked to end after a second, and then does so soon, without a status."""
    room = partial(resource.setrlimit, resource.RLIMIT_AS, (4 << 30, 4 << 30))
    with subprocess.Popen(
        command,
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        preexec_fn=room,
    ) as run:
        try:
            out, err = run.communicate(timeout=1)
        except subprocess.TimeoutExpired:
            run.send_signal(signal.SIGTERM)
            try:
                out, err = run.communicate(timeout=5)  # 0.1 measured
            except subprocess.TimeoutExpired:
                run.kill()
                raise
            if run.returncode == -signal.SIGTERM:
                return None, "", err.decode(errors="replace")
    return run.returncode, out.decode(errors="replace"), err.decode(errors="replace")


def test_mutated_scenarios_end_in_order(tmp_path):
    texts = [DOUBLE, SPHERICAL, *[FULL] * 3, *((EXAMPLES / f"{name}.toml").read_text() for name in CHAINS)]
    words = sorted({word for text in texts for word in WORD.findall(text) if not word[0].isdigit()})
    file = tmp_path / "run.toml"
    ends = []
    for number, draw in draws(150):
        text = draw.choice(texts)
        for _ in range(draw.choice([1, 1, 1, 2, 3])):
            text = changed(draw, text, words) or "\n"
        data = text.encode()
        if draw.randrange(10) == 0:
            data = damaged(draw, data)
        file.write_bytes(data)
        command = ["simulate", "run.toml", "--json"]
        if "[ensemble" in text and draw.randrange(2):
            command = ["ensemble", "run.toml", "-o", "out.h5", "--json", "--threads", "1"]
        status, out, err = ended([program(), *command], tmp_path)
        told = f"draw {number}, status {status}: {err[-500:]}\n{text}"
        assert status is None or 0 <= status < 4, told
        if status == 0:
            json.loads(out)
        elif status is not None:
            assert err.startswith("pendula: "), told
        for trace in ("Traceback", "HDF5-DIAG", "terminate called", "std::", "bad_alloc"):
            assert trace not in err, told
        ends.append(status)
    assert {0, 2} <= set(ends) or len(ends) < 100
