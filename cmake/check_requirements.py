"""Says which packages of a requirements file the running Python lacks.

usage: python check_requirements.py REQUIREMENTS.txt

Exit 0 when it has them all; else one line on standard output names each that is missing or of a version that
will not do, and the exit status is 1; 2, and a message, where a line of the file is not understood.
"""

import re
import sys
from importlib import metadata
from pathlib import Path
from typing import NamedTuple


class Requirement(NamedTuple):
    """`name==version`, or `name>=version` for a lower bound."""

    name: str
    relation: str
    version: str

    def complaint(self) -> str | None:
        """What is wrong with the installed package, or None."""
        wanted = self.version if self.relation == "==" else f"{self.version} or newer"
        try:
            installed = metadata.version(self.name)
        except metadata.PackageNotFoundError:
            return f"{self.name} {wanted} is missing"
        newer = self.relation == ">=" and release(installed) >= release(self.version)
        return None if newer or installed == self.version else f"{self.name} is {installed}, not {wanted}"


def release(version: str) -> tuple[int, ...]:
    """The numbers that a version begins with, 3.1 for 3.1rc2 and for 3.1.0."""
    numbers = [int(part) for part in re.match(r"\d*(\.\d+)*", version)[0].split(".") if part]
    while numbers and numbers[-1] == 0:
        numbers.pop()
    return tuple(numbers)


def requirements(path: Path) -> list[Requirement]:
    """Those of a file, and of the files that it includes by `-r`."""
    found: list[Requirement] = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        text = line.partition("#")[0].strip()
        if text.startswith("-r "):
            found += requirements(path.parent / text[3:].strip())
        elif match := re.fullmatch(r"([\w.-]+)\s*(==|>=)\s*([\w.]+)", text):
            found.append(Requirement(*match.groups()))
        elif text:
            raise ValueError(f'{path}:{number}: expected "name==version" or "name>=version", got "{text}"')
    return found


def main() -> int:
    try:
        wanted = requirements(Path(sys.argv[1]))
    except (OSError, ValueError) as error:
        print(error, file=sys.stderr)
        return 2
    complaints = [text for each in wanted if (text := each.complaint())]
    print(", ".join(complaints), end="")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
