"""That the copies of the compiled library, one for each instruction set, mix with nothing.

Environment: PENDULA_LIBRARY, the static library; PENDULA_ARCHS, its instruction sets, least to best;
PENDULA_NM, PENDULA_OBJDUMP, PENDULA_READELF, which read it.
"""

import os
import re
import subprocess

import pytest

VEX = re.compile(r"^ *[0-9a-f]+:\t(?:(?:2e|36|3e|26|64|65|67) )*(?:c4|c5) ", re.MULTILINE)
EVEX = re.compile(r"^ *[0-9a-f]+:\t(?:(?:2e|36|3e|26|64|65|67) )*62 ", re.MULTILINE)

# Of the library itself, what a copy may ask the other objects for.
SHARED = re.compile(r"pendula::(library\(\)|make_explicit_integrator\(.*\))$")


def read(tool: str, *options: str) -> dict[str, str]:
    """What a tool says of each object in the library, by the object's name."""
    command = [os.environ[f"PENDULA_{tool}"], *options, os.environ["PENDULA_LIBRARY"]]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    pieces = re.split(r"^(?:File: .*\((\S+\.o)\)|(\S+\.o):.*)$", text, flags=re.MULTILINE)
    return {a or b: body for a, b, body in zip(pieces[1::3], pieces[2::3], pieces[3::3], strict=True)}


def copies() -> dict[str, str]:
    """Instruction set to object."""
    found = {name: re.fullmatch(r"pendula_(\w+)\.o", name) for name in read("NM")}
    return {match[1]: name for name, match in found.items() if match}


@pytest.fixture(scope="module")
def code() -> dict[str, str]:
    return read("OBJDUMP", "-d", "--wide")


def test_the_library_has_copies_and_what_they_share():
    assert list(copies()) == os.environ["PENDULA_ARCHS"].split()
    assert {"library.cpp.o", "explicit_integrator.cpp.o"} == set(read("NM")) - set(copies().values())


@pytest.mark.parametrize("instruction_set", copies())
def test_nothing_but_its_entry_can_be_seen_of_a_copy(instruction_set):
    symbols = read("NM", "--extern-only", "--defined-only")[copies()[instruction_set]]
    assert [line.split()[-1] for line in symbols.split("\n") if line] == [
        f"pendula_library_{instruction_set}"
    ]


@pytest.mark.parametrize("instruction_set", copies())
def test_a_linker_finds_no_section_in_a_copy_that_it_could_replace(instruction_set):
    assert "There are no section groups" in read("READELF", "--section-groups")[copies()[instruction_set]]


@pytest.mark.parametrize("instruction_set", copies())
def test_a_copy_needs_little_of_the_others(instruction_set):
    symbols = read("NM", "--undefined-only", "--demangle")[copies()[instruction_set]]
    names = [line.split(maxsplit=1)[1] for line in symbols.split("\n") if line.strip()]
    assert "malloc" in names  # of the system
    assert [name for name in names if re.search("pendula|Eigen|xsimd", name) and not SHARED.match(name)] == []


@pytest.mark.parametrize("name", ["library.cpp.o", "explicit_integrator.cpp.o"])
def test_what_copies_share_does_not_touch_eigen(name):
    assert "Eigen" not in read("NM", "--demangle")[name]


X86 = [one for one in copies() if one != "baseline"]


@pytest.mark.parametrize("instruction_set", X86)
def test_a_copy_has_its_own_instructions_and_none_beyond(code, instruction_set):
    text = code[copies()[instruction_set]]
    assert bool(VEX.search(text)) == (instruction_set != "sse2")
    assert bool(EVEX.search(text)) == (instruction_set == "avx512")


def test_what_copies_share_has_none_beyond_sse2(code):
    for name in set(code) - set(copies().values()):
        assert not VEX.search(code[name]) and not EVEX.search(code[name]), name


@pytest.mark.parametrize("instruction_set", [one for one in X86 if one != "sse2"])
def test_nothing_runs_before_the_processor_was_asked(instruction_set):
    sections = read("OBJDUMP", "-h")[copies()[instruction_set]]
    assert ".text" in sections
    assert not re.search(r"\.(init_array|preinit_array|ctors|init)\b", sections)
