"""Commands of the README and of docs/, typed into a shell: what they print now, and whether that is what a page shows.

`python tests/readme/readme.py` writes the present output into the pages; test_readme.py compares. A block of the
language `console` has commands after `$ ` and their output. The calls of `pendula` in blocks of the language `sh` are
run as well, those of a page one after the other; what they print is not shown.
Environment: PENDULA_PROGRAM, the program to run.
"""

import os
import re
import shlex
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
# tests/export runs the page of exports, which takes other compilers.
PAGES = [README, *(page for page in sorted((ROOT / "docs").rglob("*.md")) if page.name != "export.md")]
ELLIPSIS = "…"  # on a line of its own: lines left out
CONSOLE = re.compile(r"```console\n(.*?)```", re.DOTALL)


@dataclass(frozen=True)
class Session:
    """A console block: commands, and the output shown below the last of them."""

    commands: list[str]
    shown: list[str]

    @staticmethod
    def parse(block: str) -> "Session":
        lines = block.rstrip("\n").split("\n")
        commands = [line[2:] for line in lines if line.startswith("$ ")]
        return Session(commands, lines[len(commands) :])

    def text(self, output: list[str]) -> str:
        return "\n".join([f"$ {command}" for command in self.commands] + output) + "\n"


def sessions() -> list[Session]:
    return [Session.parse(block) for page in PAGES for block in CONSOLE.findall(page.read_text())]


def blocks(page: Path, language: str) -> list[str]:
    fences = re.finditer(r"^```(\w*)\n(.*?)^```$", page.read_text(), re.DOTALL | re.MULTILINE)
    return [fence[2] for fence in fences if fence[1] == language]


def calls(page: Path) -> list[str]:
    """Those of the program whose output is not shown."""
    return [
        line for block in blocks(page, "sh") for line in block.splitlines() if line.startswith("pendula ")
    ]


def program() -> str:
    return os.environ["PENDULA_PROGRAM"]


@contextmanager
def fresh_checkout() -> Iterator[Path]:
    """A folder that has what a checkout has, and nothing that a command made."""
    with tempfile.TemporaryDirectory() as folder:
        for name in ("examples", "scripts"):
            (Path(folder) / name).symlink_to(ROOT / name)
        yield Path(folder)


def shell(lines: list[str], folder: Path, check: bool = True, **environment: str) -> list[str]:
    """What both streams of the lines hold, typed into a shell."""
    done = subprocess.run(
        ["bash", "-ec", "\n".join(lines)],
        cwd=folder,
        env=os.environ | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=check,
    )
    return done.stdout.rstrip("\n").split("\n")


def run_pendula(commands: list[str], check: bool = False) -> list[str]:
    """The program is on the path; one of its calls shows an error. Kernels of models are kept between tests."""
    with fresh_checkout() as folder:
        path = f"{Path(program()).parent}:{os.environ['PATH']}"
        kept = os.environ.get("XDG_CACHE_HOME", f"{folder}/kernels")
        return shell(commands, folder, check, PATH=path, XDG_CACHE_HOME=kept)


def run_demo(commands: list[str]) -> list[str]:
    """The program's call and what it ends with; what comes before the call differs by machine."""
    done = subprocess.run(shlex.split(commands[0]), cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    lines = done.stdout.rstrip("\n").split("\n")
    [call] = [line for line in lines if line.startswith("+ build/release/bin/pendula")]
    end = next(i for i, line in enumerate(lines) if line.startswith("energy at start"))
    return [ELLIPSIS, call, ELLIPSIS, *lines[end:]]


def set_path(commands: list[str]) -> list[str]:
    """In a shell with this path the program is the one that the demo has built."""
    found = shell([*commands, "command -v pendula"], ROOT)
    assert found == [str(ROOT / "build/release/bin/pendula")], found
    return []


def name_script(commands: list[str]) -> list[str]:
    """A call of scripts/test, which runs this. How many tests there are is the build's: README.md shows no number."""
    assert commands == ["scripts/test"]
    return []


def run_cmake(commands: list[str]) -> list[str]:
    """Installs what the demo has built, into another home. Or only configures, elsewhere: it is the demo that
    builds a kernel that generated/ lacks."""
    with tempfile.TemporaryDirectory() as folder:
        if "--install" in commands[0]:
            shell([*commands, "~/.local/bin/pendula --version"], ROOT, HOME=folder)
        else:
            shell([f"{commands[0]} -B {shlex.quote(folder)}"], ROOT)
            assert commands[1:] == ["cmake --build build/release"]
    return []


RUNNERS = {
    "pendula": run_pendula,
    "scripts/demo": run_demo,
    "scripts/test": name_script,
    "cmake": run_cmake,
    "export": set_path,
}


def output(session: Session) -> list[str]:
    """Of all commands; the last one tells which kind they are."""
    return RUNNERS[session.commands[-1].split()[0]](session.commands)


def same_word(shown: str, now: str, relative: float) -> bool:
    """Equal, or numbers that differ by what chaos makes of another processor's round-off."""
    if shown == now:
        return True
    try:
        a, b = float(shown.rstrip(",;")), float(now.rstrip(",;"))
    except ValueError:
        return False
    return abs(a - b) <= relative * max(abs(a), abs(b)) + 1e-12


def same_line(shown: str, now: str) -> bool:
    if shown.startswith("stepping time") and now.startswith("stepping time"):
        return True  # time is the machine's
    a, b = shown.split(), now.split()
    # What an accuracy takes differs by what rounds: by instruction set and compiler, 263 to 288 steps were seen.
    found = ("steps", "rejected steps", "iterations", "tolerance", "expected error")
    relative = 0.5 if shown.startswith(found) else 1e-6
    return len(a) == len(b) and all(same_word(x, y, relative) for x, y in zip(a, b, strict=True))


def write() -> None:
    def refreshed(match: re.Match[str]) -> str:
        session = Session.parse(match[1])
        return f"```console\n{session.text(output(session))}```"

    for page in PAGES:
        page.write_text(CONSOLE.sub(refreshed, page.read_text()))


if __name__ == "__main__":
    write()
