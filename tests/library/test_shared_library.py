"""The shared library for C: what is seen of it.

Environment: PENDULA_SHARED_LIBRARY, the shared library; PENDULA_NM, PENDULA_READELF, which read it.
"""

import os
import re
import subprocess
from pathlib import Path

HEADER = Path(__file__).parents[2] / "src/pendula/pendula.h"


def read(tool: str, *options: str) -> str:
    command = [os.environ[f"PENDULA_{tool}"], *options, os.environ["PENDULA_SHARED_LIBRARY"]]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_the_functions_of_the_header_are_seen_and_nothing_else():
    declared = set(re.findall(r"^[^\s/].*?\b(pendula_\w+)\(", HEADER.read_text(), re.MULTILINE))
    symbols = [line.split() for line in read("NM", "-D", "--defined-only").splitlines()]
    assert {name for _, kind, name in symbols if kind == "T"} == {f"{name}@@PENDULA_0" for name in declared}
    # The version itself, which some linkers write with its own version.
    assert {name.split("@@")[0] for _, kind, name in symbols if kind != "T"} == {"PENDULA_0"}


def test_programs_ask_for_its_interface():
    assert "Library soname: [libpendula.so.0]" in read("READELF", "-d")


def test_it_needs_what_every_system_has():
    needed = set(re.findall(r"\(NEEDED\).*\[(.*?)\.so", read("READELF", "-d")))
    assert {name for name in needed if not name.startswith("ld-linux")} <= {
        "libstdc++",
        "libm",
        "libgcc_s",
        "libc",
    }
