"""The C++ reference: Doxygen reads the public headers before Sphinx begins, Breathe shows what it found."""

import subprocess
from pathlib import Path

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.typing import ExtensionMetadata

SOURCE = Path(__file__).resolve().parents[2] / "src"
# What pendula.hpp includes, and the kinds of numbers and options that a program meets there.
HEADERS = (
    "pendula.hpp",
    "simulation.hpp",
    "model.hpp",
    "own_model.hpp",
    "propagate.hpp",
    "lyapunov.hpp",
    "chain/chain.hpp",
    "chain/invariants.hpp",
    "chain/space.hpp",
    "chain/state.hpp",
    "run/event.hpp",
    "run/lyapunov_spectrum.hpp",
    "run/row_times.hpp",
    "system/member.hpp",
    "system/motion.hpp",
    "system/options.hpp",
)
SETTINGS = """
INPUT = {input}
OUTPUT_DIRECTORY = "{output}"
STRIP_FROM_PATH = "{source}"
GENERATE_XML = YES
GENERATE_HTML = NO
GENERATE_LATEX = NO
JAVADOC_AUTOBRIEF = NO
MULTILINE_CPP_IS_BRIEF = NO
MARKDOWN_SUPPORT = YES
EXCLUDE_SYMBOLS = *::detail*
QUIET = YES
WARN_IF_UNDOCUMENTED = NO
"""


def run_doxygen(app: Sphinx) -> None:
    output = Path(app.doctreedir) / "doxygen"
    output.mkdir(parents=True, exist_ok=True)
    headers = " ".join(f'"{SOURCE / "pendula" / header}"' for header in HEADERS)
    settings = SETTINGS.format(input=headers, output=output, source=SOURCE)
    try:
        done = subprocess.run(["doxygen", "-"], input=settings, capture_output=True, text=True, check=False)
    except FileNotFoundError as error:
        raise ExtensionError(
            "doxygen: expected the program, found none: scripts/setup --docs installs it"
        ) from error
    if done.returncode != 0:
        raise ExtensionError(f"doxygen: {done.stderr.strip()}")


def set_project(app: Sphinx) -> None:
    app.config.breathe_projects = {"pendula": str(Path(app.doctreedir) / "doxygen/xml")}
    app.config.breathe_default_project = "pendula"


def setup(app: Sphinx) -> ExtensionMetadata:
    set_project(app)
    app.connect("builder-inited", run_doxygen, priority=100)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
