"""The arrows between the rooms of the source, who may include whom, and between modules of Python."""

import ast
import re
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = ROOT / "src"

# A room, and those that it knows besides itself.
KNOWS = {
    "pendula/numeric": set(),
    "pendula/system": {"pendula/numeric"},
    "pendula/gauss": {"pendula/system", "pendula/numeric"},
    "pendula/chain": {"pendula/gauss", "pendula/system", "pendula/numeric"},
    "pendula/explicit": {"pendula/chain", "pendula/system", "pendula/numeric"},
    "pendula/taylor": {"pendula/explicit", "pendula/chain", "pendula/system", "pendula/numeric"},
    "pendula/run": {
        "pendula/chain",
        "pendula/explicit",
        "pendula/gauss",
        "pendula/system",
        "pendula/numeric",
    },
    "pendula/ensemble": {
        "pendula/run",
        "pendula/taylor",
        "pendula/explicit",
        "pendula/chain",
        "pendula/gauss",
        "pendula/system",
        "pendula/numeric",
    },
    "library": {
        "pendula/ensemble",
        "pendula/run",
        "pendula/taylor",
        "pendula/chain",
        "pendula/explicit",
        "pendula/gauss",
        "pendula/system",
        "pendula/numeric",
    },
    "io": {"pendula/ensemble", "pendula/run", "pendula/chain", "pendula/system", "pendula/numeric"},
    "front": {
        "io",
        "pendula/ensemble",
        "pendula/run",
        "pendula/chain",
        "pendula/gauss",
        "pendula/system",
        "pendula/numeric",
    },
    "lab": {"library", "pendula/run", "pendula/chain", "pendula/gauss"},
    "view": {"io", "pendula/run", "pendula/chain", "pendula/system", "pendula/numeric"},
    "cli": {
        "view",
        "io",
        "pendula/ensemble",
        "pendula/run",
        "pendula/chain",
        "pendula/system",
        "pendula/numeric",
    },
}
GENERATED = {"pendula/kernels"}


def included(file: Path) -> set[str]:
    """Folders of this project's headers that a file includes."""
    names = re.findall(
        r'#include [<"]((?:pendula|io|view|cli|front|library|lab)/[\w/]+\.hpp)[>"]', file.read_text()
    )
    return {name.rsplit("/", 1)[0] for name in names}


@pytest.mark.parametrize("room", KNOWS)
def test_a_room_knows_what_is_below_it_only(room):
    allowed = KNOWS[room] | GENERATED | {room}
    files = [file for file in (SOURCE / room).iterdir() if file.suffix in (".hpp", ".cpp")]
    assert files
    wrong = {
        f"{file.name} -> {other}"
        for file in files
        for other in included(file) - allowed
        if other != "pendula"
    }
    assert not wrong


def test_every_room_has_its_arrows():
    rooms = {path.relative_to(SOURCE).parent.as_posix() for path in SOURCE.rglob("*.hpp")}
    assert rooms - {"pendula"} == set(KNOWS)


def heights() -> dict[str, int]:
    """How far from the top each room begins in the picture of CONTRIBUTING."""
    picture = (ROOT / "docs/images/rooms.svg").read_text()
    return {name: int(y) for y, name in re.findall(r'<text class="n" x="\d+" y="(\d+)">(\w+)<', picture)}


def test_the_picture_shows_what_stands_on_what():
    at = heights()
    assert set(at) == {room.split("/")[-1] for room in KNOWS} | {"kernels"}
    for room, known in KNOWS.items():
        for below in known:
            assert at[room.split("/")[-1]] <= at[below.split("/")[-1]], f"{room} -> {below}"


def test_the_arrows_make_no_circle():
    TopologicalSorter(KNOWS).prepare()


def imports(package: Path) -> dict[str, set[str]]:
    """Modules of a package, and which of the others each imports, within functions and for type checkers, too."""
    files = {
        path.relative_to(package.parent).with_suffix("").as_posix().removesuffix("/__init__"): path
        for path in package.rglob("*.py")
    }
    found: dict[str, set[str]] = {name: set() for name in files}
    for name, path in files.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                said = (node.module or "").replace(".", "/")
                module = f"{package.name}/{said}".rstrip("/") if node.level else said
                found[name] |= {module, *(f"{module}/{each.name}" for each in node.names)} & {*files}
    return {name: others - {name, package.name} for name, others in found.items()}  # in which all are


@pytest.mark.parametrize("package", ["python/pendula", "codegen/pendula_codegen", "plotting/pendula_plot"])
def test_modules_of_python_make_no_circle(package):
    arrows = imports(ROOT / package)
    assert sum(map(len, arrows.values())) >= len(arrows)
    TopologicalSorter(arrows).prepare()
