"""The page of exports, block by block. As a program this writes what its commands print now."""

import os
import re
import shutil
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests/readme"))

import readme  # noqa: E402

PAGE = ROOT / "docs/reference/export.md"
BLOCK = re.compile(r"```(console|c|python)\n(.*?)```", re.DOTALL)
SOURCES = {"c": "main.c", "python": "mass.py"}  # what blocks are called
SECTION = re.compile(r"^## (.*?)\n.*?(?=^## |\Z)", re.DOTALL | re.MULTILINE)
# What a section takes besides a C compiler.
TOOLS = {
    "On a microcontroller": shutil.which("arm-none-eabi-gcc") and shutil.which("qemu-system-arm"),
    "CasADi and acados": find_spec("casadi"),
}


def printed(section: str, folder: Path) -> list[tuple[readme.Session, list[str]]]:
    """The sessions of a section, and what their commands print now; `folder` gets the program."""
    (folder / "examples").symlink_to(ROOT / "examples")
    path = f"{Path(readme.program()).parent}:{Path(sys.executable).parent}:{os.environ['PATH']}"
    kept = os.environ.get("XDG_CACHE_HOME", f"{folder}/kernels")
    found = []
    for kind, text in BLOCK.findall(section):
        if kind in SOURCES:
            (folder / SOURCES[kind]).write_text(text)
        else:
            session = readme.Session.parse(text)
            found.append((session, readme.shell(session.commands, folder, PATH=path, XDG_CACHE_HOME=kept)))
    return found


@pytest.mark.parametrize("title", SECTION.findall(PAGE.read_text()))
def test_what_the_page_shows_is_what_its_commands_print(title, tmp_path):
    if not TOOLS.get(title, True):
        pytest.skip(f"what '{title}' takes is not installed")
    [section] = [match[0] for match in SECTION.finditer(PAGE.read_text()) if match[1] == title]
    for session, output in printed(section, tmp_path):
        shown = session.shown or [""]
        assert len(shown) == len(output), output
        for ours, theirs in zip(shown, output, strict=True):
            assert readme.same_line(ours, theirs) or is_measured(ours), f"expected {ours!r}, got {theirs!r}"


def test_the_lines_of_python_are_those_of_the_example():
    example = [line.strip() for line in (ROOT / "examples/swing_up.py").read_text().splitlines()]
    [section] = [match[0] for match in SECTION.finditer(PAGE.read_text()) if match[1] == "CasADi and acados"]
    blocks = re.findall(r"```python\n(.*?)```", section, re.DOTALL)
    assert blocks and not [line for block in blocks for line in block.splitlines() if line not in example]


def is_measured(line: str) -> bool:
    """Whether a line tells a time, or what a compiler makes of a program."""
    return bool(re.search(r" s$|^(instructions|bytes)", line))


def write() -> None:
    def refreshed(match: re.Match[str]) -> str:
        if not TOOLS.get(match[1], True):
            return match[0]
        with tempfile.TemporaryDirectory() as folder:
            sessions = iter(printed(match[0], Path(folder)))
            return BLOCK.sub(lambda block: shown(block, sessions), match[0])

    def shown(block: re.Match[str], sessions) -> str:
        if block[1] in SOURCES:
            return block[0]
        session, output = next(sessions)
        return f"```console\n{session.text([line for line in output if line])}```"

    PAGE.write_text(SECTION.sub(refreshed, PAGE.read_text()))


if __name__ == "__main__":
    write()
