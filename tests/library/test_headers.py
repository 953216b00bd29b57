"""That each public header stands alone: a file that has it and nothing before it compiles.

Environment: PENDULA_CONSUMER_FLAGS, a compiler, where the headers are, and the library.
"""

import os
import re
import subprocess
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path

COMPILER, *OPTIONS = [
    word for word in os.environ["PENDULA_CONSUMER_FLAGS"].split() if not word.endswith(".a")
]
FOLDERS = [Path(option.removeprefix("-I")) for option in OPTIONS]
# Takes most of the time of most headers. It is precompiled for those that include it anyway, which that does not help.
SHARED = "Eigen/Core"


@cache
def read_by(header: str) -> frozenset[str]:
    """All that a header of pendula includes, itself or by other headers of pendula."""
    file = next((folder / header for folder in FOLDERS if (folder / header).exists()), None)
    if file is None or not header.startswith("pendula/"):
        return frozenset()
    named = re.findall(r"^#include [<\"](.+)[>\"]", file.read_text(), re.MULTILINE)
    return frozenset(named).union(*map(read_by, named))


def compiled(source: Path, *options: str) -> str:
    """What the compiler says of a file that does not compile; nothing of one that does."""
    command = [COMPILER, "-std=c++20", "-w", *OPTIONS, *options, source]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    return f"{source.name}: {ended.stderr}" if ended.returncode != 0 else ""


def test_each_stands_alone(tmp_path):
    headers = sorted(
        str(file.relative_to(folder))
        for folder in FOLDERS
        for file in (folder / "pendula").rglob("*.hpp")
        if (folder / "pendula").exists()
    )
    assert {"pendula/pendula.hpp", "pendula/kernels/planar_2.hpp", "pendula/version.hpp"} <= {*headers}
    shared = tmp_path / "shared.hpp"
    shared.write_text(f"#include <{SHARED}>\n")
    assert not compiled(shared, "-x", "c++-header", "-o", f"{shared}.gch")  # Clang takes this name, too

    def said_of(header: str) -> str:
        source = tmp_path / header.replace("/", "_").replace(".hpp", ".cpp")
        source.write_text(f"#include <{header}>\n")
        before = ["-include", str(shared)] if SHARED in read_by(header) else []
        return compiled(source, *before, "-fsyntax-only")

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        wrong = [said for said in pool.map(said_of, headers) if said]
    assert not wrong, "\n".join(wrong)
