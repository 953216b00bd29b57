"""What scripts/duplicates takes for the same lines."""

import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).parents[2] / "scripts/duplicates"
SEVEN = [f"step({k});" for k in range(7)]


def said_of(folder: Path, **files: list[str]) -> tuple[int, list[str]]:
    for name, lines in files.items():
        (folder / f"{name}.hpp").write_text("\n".join(lines) + "\n")
    done = subprocess.run([sys.executable, SCRIPT, folder], capture_output=True, text=True)
    assert not done.stderr
    return done.returncode, done.stdout.replace(f"{folder.resolve()}/", "").splitlines()


def test_seven_lines_are_a_pair(tmp_path):
    there = ["#pragma once", "", *SEVEN, "first();"]
    assert said_of(tmp_path, a=there, b=["other();", *SEVEN]) == (1, ["   7 lines  a.hpp:3  b.hpp:2"])


def test_six_lines_are_none(tmp_path):
    assert said_of(tmp_path, a=SEVEN[1:], b=["other();", *SEVEN[1:], "last();"]) == (0, [])


def test_a_pair_is_told_once_and_whole(tmp_path):
    twelve = [*SEVEN, *(f"walk({k});" for k in range(5))]
    assert said_of(tmp_path, a=twelve, b=twelve) == (1, ["  12 lines  a.hpp:1  b.hpp:1"])


def test_a_file_may_repeat_itself_without_overlap(tmp_path):
    assert said_of(tmp_path, a=[*SEVEN, "between();", *SEVEN]) == (1, ["   7 lines  a.hpp:1  a.hpp:9"])
    assert said_of(tmp_path, a=["same();"] * 13) == (0, [])


def test_spaces_comments_and_brackets_do_not_part_lines(tmp_path):
    other = [
        "/* two",
        "lines */",
        *(f"  step( {k} );  // the step {k}" for k in range(3)),
        "}",
        "",
        *SEVEN[3:],
    ]
    assert said_of(tmp_path, a=SEVEN, b=other) == (1, ["   7 lines  a.hpp:1  b.hpp:3"])


def test_a_comment_in_a_string_is_none(tmp_path):
    addresses = [f'open("https://{k}");' for k in range(7)]
    assert said_of(tmp_path, a=addresses, b=[line.replace("//", "//x") for line in addresses]) == (0, [])


def test_includes_and_namespaces_do_not_count(tmp_path):
    frame = ["#pragma once", *(f"#include <{k}>" for k in range(6)), "namespace pendula {", "namespace {"]
    assert said_of(tmp_path, a=[*frame, *SEVEN[1:]], b=[*frame, *SEVEN[1:]]) == (0, [])
