"""That the copies of the compiled library, one for each instruction set, mix with nothing.

Environment: PENDULA_LIBRARY, the static library; PENDULA_ARCHS, its instruction sets, least to best;
PENDULA_AR, PENDULA_NM, PENDULA_OBJDUMP, PENDULA_READELF, PENDULA_CXX, which read it and link from it.
"""

import os
import re
import subprocess
from pathlib import Path

import pytest

# The first byte of an instruction after the prefixes that may stand before it: of AVX, and of AVX-512.
FIRST = r"^ *[0-9a-f]+:[\t ]+(?:(?:2e|36|3e|26|64|65|67) )*"
ENCODINGS = {
    "VEX": re.compile(FIRST + "(?:c4|c5) ", re.MULTILINE),
    "EVEX": re.compile(FIRST + "62 ", re.MULTILINE),
}
ALLOWED = {"sse2": set(), "avx2": {"VEX"}, "avx512": {"VEX", "EVEX"}}

# What all copies share.
ONCE = [
    f"{name}.cpp.o"
    for name in (
        "c_kernel",
        "interpreted_kernel",
        "kernel_checks",
        "kernel_comparison",
        "kernel_text",
        "library",
    )
]

# Of the library itself, what a copy may ask the other objects for.
SHARED = re.compile(r".* pendula::library<.*>\(\)$")


def read(tool: str, *options: str) -> dict[str, str]:
    """What a tool says of each object in the library, by the object's name."""
    command = [os.environ[f"PENDULA_{tool}"], *options, os.environ["PENDULA_LIBRARY"]]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    pieces = re.split(r"^(?:.*\((\S+\.o)\):?.*|(\S+\.o):.*)$", text, flags=re.MULTILINE)
    return {a or b: body for a, b, body in zip(pieces[1::3], pieces[2::3], pieces[3::3], strict=True)}


# What is behind pendula.h.
FRONT = "pendula_front.o"


def copies() -> dict[str, str]:
    """Instruction set to object."""
    found = {name: re.fullmatch(r"pendula_(\w+)\.o", name) for name in read("NM") if name != FRONT}
    return {match[1]: name for name, match in found.items() if match}


@pytest.fixture(scope="module")
def encodings(tmp_path_factory) -> dict[str, set[str]]:
    """How the instructions of each object are encoded, where not as SSE."""
    folder = tmp_path_factory.mktemp("objects")
    return {name: encodings_in(code_of(name, folder)) for name in read("NM")}


def encodings_in(code: str) -> set[str]:
    return {encoding for encoding, pattern in ENCODINGS.items() if pattern.search(code)}


def code_of(name: str, folder: Path) -> str:
    """The instructions of an object; linked, because objdump takes minutes for a section each function."""
    subprocess.run(
        [os.environ["PENDULA_AR"], "x", os.environ["PENDULA_LIBRARY"], name], cwd=folder, check=True
    )
    link = [os.environ["PENDULA_CXX"], "-shared", name, "-o", "linked"]
    subprocess.run(link, cwd=folder, check=True)
    dump = [os.environ["PENDULA_OBJDUMP"], "-d", "--wide", "linked"]
    return subprocess.run(dump, cwd=folder, capture_output=True, text=True, check=True).stdout


def test_the_library_has_copies_and_what_they_share():
    assert list(copies()) == os.environ["PENDULA_ARCHS"].split()
    assert {*ONCE, FRONT} == set(read("NM")) - set(copies().values())


def test_of_the_front_the_functions_of_its_header_are_seen():
    header = (Path(__file__).parents[2] / "src/pendula/pendula.h").read_text()
    declared = set(re.findall(r"^[^\s/].*?\b(pendula_\w+)\(", header, re.MULTILINE))
    symbols = read("NM", "--extern-only", "--defined-only")[FRONT].split("\n")
    assert {line.split()[-1] for line in symbols if line} == declared


def test_the_front_needs_what_copies_share_and_nothing_of_eigen():
    names = [
        line.split(maxsplit=1)[1]
        for line in read("NM", "--undefined-only", "--demangle")[FRONT].split("\n")
        if line.strip()
    ]
    assert [name for name in names if SHARED.match(name)]
    assert [name for name in names if re.search("Eigen|xsimd", name)] == []


@pytest.mark.parametrize("instruction_set", copies())
def test_nothing_but_its_parts_can_be_seen_of_a_copy(instruction_set):
    symbols = read("NM", "--extern-only", "--defined-only", "--demangle")[copies()[instruction_set]]
    parts = re.compile(rf".* pendula::copy_of<.*, pendula::{instruction_set}>\(\)$")
    names = [line for line in symbols.split("\n") if line.strip()]
    assert names and [name for name in names if not parts.match(name)] == []


@pytest.mark.parametrize("sealed", [*copies().values(), FRONT])
def test_a_linker_finds_no_section_in_a_copy_that_it_could_replace(sealed):
    groups = read("READELF", "--section-groups")[sealed].strip()
    assert groups == "There are no section groups in this file."


@pytest.mark.parametrize("instruction_set", copies())
def test_a_copy_needs_little_of_the_others(instruction_set):
    symbols = read("NM", "--undefined-only", "--demangle")[copies()[instruction_set]]
    names = [line.split(maxsplit=1)[1] for line in symbols.split("\n") if line.strip()]
    assert "malloc" in names  # of the system
    assert [name for name in names if re.search("pendula|Eigen|xsimd", name) and not SHARED.match(name)] == []


@pytest.mark.parametrize("name", ONCE)
def test_what_copies_share_knows_nothing_of_eigen(name):
    symbols = read("NM", "--demangle")[name].split("\n")
    assert any("pendula::" in symbol for symbol in symbols)
    assert [symbol for symbol in symbols if "Eigen::" in symbol] == []


X86 = [one for one in copies() if one in ALLOWED]


@pytest.mark.parametrize("instruction_set", X86)
def test_a_copy_has_its_own_instructions_and_none_beyond(encodings, instruction_set):
    assert encodings[copies()[instruction_set]] == ALLOWED[instruction_set]


def test_what_copies_share_has_none_beyond_sse2(encodings):
    assert [name for name in set(encodings) - set(copies().values()) if encodings[name]] == []


@pytest.mark.parametrize("instruction_set", [one for one in X86 if one != "sse2"])
def test_nothing_runs_before_the_processor_was_asked(instruction_set):
    sections = re.findall(r" (\.\S+)", read("OBJDUMP", "-h")[copies()[instruction_set]])
    assert ".eh_frame" in sections
    assert [one for one in sections if re.match(r"\.(init_array|preinit_array|ctors|init)\b", one)] == []
