"""The program `pendula`, as the wheel has it."""

import os
import sys
from pathlib import Path


def main() -> None:
    """Replaces this process by the program, which derives models by this Python."""
    program = Path(__file__).parent / "bin" / "pendula"
    os.environ.setdefault("PENDULA_PYTHON", sys.executable)
    os.execv(program, [str(program), *sys.argv[1:]])
