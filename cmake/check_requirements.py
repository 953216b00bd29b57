"""Says which packages of a pinned requirements file the running Python lacks.

usage: python check_requirements.py REQUIREMENTS.txt

Exit 0 when it has them all; else one line on standard output names each that is missing or of another
version, and the exit status is 1.
"""

import sys
from importlib import metadata
from pathlib import Path


def pins(path: Path) -> dict[str, str]:
    """Package name to version, of the lines `name==version` of a file and of those it includes by `-r`."""
    found: dict[str, str] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        text = line.partition("#")[0].strip()
        if text.startswith("-r "):
            found |= pins(path.parent / text[3:].strip())
        elif "==" in text:
            name, _, version = text.partition("==")
            found[name.strip()] = version.strip()
    return found


def complaint(name: str, version: str) -> str | None:
    """What is wrong with an installed package, or None."""
    try:
        installed = metadata.version(name)
    except metadata.PackageNotFoundError:
        return f"{name} {version} is missing"
    return None if installed == version else f"{name} is {installed}, not {version}"


def main() -> int:
    complaints = [text for item in pins(Path(sys.argv[1])).items() if (text := complaint(*item))]
    print(", ".join(complaints), end="")
    return 1 if complaints else 0


if __name__ == "__main__":
    sys.exit(main())
