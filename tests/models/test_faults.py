"""pendula check finds what is wrong in a kernel: faults that are put into its text."""

import os
import random
import re
import subprocess
import sys

import pytest
from conftest import ROOT
from test_forcing import SHARP

sys.path.insert(0, str(ROOT / "codegen"))

from pendula_codegen.comparison import Start, comparison
from pendula_codegen.model import Model, read_model
from pendula_codegen.models import find_model
from pendula_codegen.render import render_model

MODELS = [
    ("furuta", None),
    ("spring_pendulum", None),
    ("sharp", None),
    ("cart_chain", 2),
    ("rods", 2),
]
KINDS = ("Jacobian", "sign", "factor", "deleted term", "wrong input")

FUNCTION = re.compile(r"^  static void (\w+)\(.*?\) \{\n(.*?)^  \}\n", re.DOTALL | re.MULTILINE)
STATEMENT = re.compile(
    r"^    (?P<new>const Real )?(?P<left>\w+(?:\[\d\]|\(\d, \d\))?) = (?P<right>[^;]*);",
    re.MULTILINE,
)
READING = re.compile(r"^    const Real& (?P<left>\w+) = (?P<right>[\w.]+(?:\[\d\])?);", re.MULTILINE)
# What says where numbers stand; what subtracts products that are 0 where a mass matrix is diagonal; and what steps look
# for narrow forces by, in which no factor matters.
NO_PART_OF_IT = {"parameter_places", "solve_symmetric", "call_arguments"}


def without_last_term(text: str) -> str | None:
    """Of a sum, whose terms no bracket is around."""
    depth = 0
    for k in range(len(text) - 1, 0, -1):
        depth += (text[k] == ")") - (text[k] == "(")
        if depth == 0 and re.match(r"\s[+-]\s", text[k - 1 : k + 2]):
            return text[: k - 1]
    return None


def faulty(kind: str, statement: re.Match, body: str, draw: random.Random) -> str | None:
    """The right side of a statement with a fault; None where it cannot have one of this kind."""
    left, right = statement["left"], statement["right"]
    if kind == "wrong input":
        others = [other["right"] for other in READING.finditer(body) if other["right"] != right]
        return draw.choice(others) if others else None
    if right == "Real(0.0)":
        return None
    if kind == "deleted term":
        return without_last_term(right)
    if kind == "sign":
        return None if statement["new"] else f"-({right})"  # it may be squared
    return f"({right}) * Real(1.0 + 1e-9)" if (kind == "Jacobian") == ("_D_" in left) else None


def with_faults(header: str, first: int, draw: random.Random) -> tuple[str, list[str]]:
    """The text of a kernel with a fault of each kind, which begin where the number `fault` says so; what they are."""
    places, told = [], []
    for kind in KINDS:
        pattern = READING if kind == "wrong input" else STATEMENT
        found = []
        for function in FUNCTION.finditer(header):
            if function[1] in NO_PART_OF_IT:
                continue
            for statement in pattern.finditer(function[2]):
                wrong = faulty(kind, statement, function[2], draw)
                at = function.start(2) + statement.start("right")
                if wrong is not None and at not in [place for place, *_ in places]:
                    found.append((function[1], (at, statement["right"], wrong)))
        name = draw.choice(sorted({name for name, _ in found}))
        places.append(draw.choice([place for function, place in found if function == name]))
        told.append(
            f"{kind} in {name}: {' '.join(places[-1][1].split())} -> {' '.join(places[-1][2].split())}"
        )
    numbered = [(at, right, wrong, first + k) for k, (at, right, wrong) in enumerate(places)]
    for at, right, wrong, number in sorted(numbered, reverse=True):
        choice = f"fault == {number} ? {wrong} : {right}"
        header = header[:at] + choice + header[at + len(right) :]
    return header, told


PROGRAM = """
#include <cstdlib>
#include <fstream>
#include <iostream>
#include <string>
#include <vector>

namespace pendula::kernels {
inline int fault = 0;
}

INCLUDES
#include <pendula/system/kernel_comparison.hpp>
#include <pendula/system/kernel_table.hpp>

// How many lines of the check fail.
template <pendula::System S>
int failures(const char* file) {
  std::ifstream stream(file);
  std::vector<double> said;
  for (std::string word; stream >> word;) said.push_back(std::strtod(word.c_str(), nullptr));
  int count = 0;
  for (const pendula::KernelLine& line : pendula::KernelComparison(pendula::system_table<S>, said).check()) {
    count += !(line.error <= line.limit);
  }
  return count;
}

int main() {
  CALLS
}
"""


def start_of(model: Model) -> Start:
    size = len(model.coordinates)
    usual = [p.default if p.default is not None else 1.0 for p in model.ordered_parameters for _ in p.symbols]
    return Start(usual, 0.0, [0.7 + 0.3 * k for k in range(size)], [0.3] * size)


def test_faults_are_found(tmp_path):
    """Five in each of five models; without them all is right."""
    (tmp_path / "sharp.py").write_text(SHARP)
    includes, calls, told = [], [], []
    for name, links in MODELS:
        model = read_model(tmp_path / "sharp.py" if name == "sharp" else find_model(name), links)
        (tmp_path / f"{name}.txt").write_text(comparison(model, start_of(model), 1))
        header = render_model(model, f"{name}.py").text
        struct = re.search(r"^struct (\w+) \{", header, re.MULTILINE)[1]
        text, faults = with_faults(header, len(told) + 1, random.Random(name))
        (tmp_path / f"{name}.hpp").write_text(text)
        includes.append(f'#include "{name}.hpp"')
        numbers = ["0", *(str(len(told) + k + 1) for k in range(len(faults)))]
        told += faults
        calls += [
            f"for (int k : {{{', '.join(numbers)}}}) pendula::kernels::fault = k, std::cout << k << ' ' << "
            f'failures<pendula::kernels::{struct}>("{name}.txt") << std::endl;'
        ]
    kept = os.environ.get("PENDULA_CONSUMER_FLAGS")
    if kept is None:
        pytest.fail("PENDULA_CONSUMER_FLAGS: expected the flags that compile and link a program with pendula")
    source = PROGRAM.replace("INCLUDES", "\n".join(includes)).replace("CALLS", "\n".join(calls))
    (tmp_path / "faults.cpp").write_text(source)
    compiler, *flags = kept.split()
    subprocess.run(
        [compiler, "-std=c++20", "-O0", "faults.cpp", *flags, "-o", "faults"],
        cwd=tmp_path,
        check=True,
    )
    ran = subprocess.run([tmp_path / "faults"], cwd=tmp_path, capture_output=True, text=True, check=True)
    lines = [tuple(map(int, line.split())) for line in ran.stdout.splitlines()]
    assert [failed for fault, failed in lines if fault == 0] == [0] * len(MODELS)
    missed = [told[fault - 1] for fault, failed in lines if fault > 0 and failed == 0]
    print(*missed, sep="\n")
    assert (len(lines), missed) == (len(MODELS) * (1 + len(KINDS)), [])


# A Python that runs the generator, and then changes what it wrote.
FAULTY = """#!/bin/sh
"{python}" "$@" || exit $?
for word do
  case $previous in --output) grep -q '{right}' "$word" && sed -i 's/{right}/{wrong}/' "$word" || exit 3;; esac
  previous=$word
done
"""


def test_a_kernel_without_a_force_does_not_pass(pendula, environment, tmp_path):
    (tmp_path / "sharp.py").write_text(SHARP)
    python = tmp_path / "python"
    right, wrong = "WRITE(f, 0) = .*;", "WRITE(f, 0) = SPLAT(0.0);"
    python.write_text(FAULTY.format(python=environment["PENDULA_PYTHON"], right=right, wrong=wrong))
    python.chmod(0o755)
    ended = pendula("check", tmp_path / "sharp.py", PENDULA_PYTHON=str(python))
    assert ended.returncode == 1, ended.stdout + ended.stderr
    failed = [line for line in ended.stdout.splitlines() if line.endswith("FAILED")]
    assert any("momenta and forces" in line for line in failed)
