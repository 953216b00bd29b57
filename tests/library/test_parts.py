"""That a program has those parts of the library that it calls, where its linker leaves out what nobody needs.

Environment: PENDULA_LIBRARY, the static library; PENDULA_CXX and PENDULA_NM.
"""

import os
import re
import subprocess
from pathlib import Path

import pytest

SOURCES = Path(__file__).parents[2] / "src"
# Names of functions that each part has alone.
PARTS = {
    "chains": "make_chain_stages<",
    "kernels": "registry::table_",
    "models": "make_system_integrator",
    "lanes": "chain_lanes<",
    "interpreter": "copy_of<pendula::ProgramInterpreter",
    "exponents": "make_orthonormal",
}
MOVE = "pendula_simulation_new, pendula_step"  # what everybody calls
OF_CHAINS, OF_MODELS = {"chains", "kernels", "models"}, {"models"}


@pytest.mark.parametrize(
    ("called", "parts"),
    [
        (f"pendula_model_of_kernel, {MOVE}", OF_MODELS),
        (f"pendula_model_of_program, {MOVE}", OF_MODELS | {"interpreter"}),
        (f"pendula_model_of_chain, {MOVE}", OF_CHAINS),
        (f"pendula_model_of_chain, {MOVE}, pendula_lyapunov", OF_CHAINS | {"exponents"}),
        (f"pendula_model_of_chain, {MOVE}, pendula_propagate", OF_CHAINS | {"lanes"}),
    ],
)
def test_a_program_has_the_parts_that_it_calls(called, parts, tmp_path):
    functions = ", ".join(f"(void *)&{name}" for name in called.split(", "))
    source, program = tmp_path / "main.cpp", tmp_path / "program"
    calls = f"void *volatile called[] = {{{functions}}};\nint main() {{ return called[0] == called[1]; }}\n"
    source.write_text(f"#include <pendula/pendula.h>\n{calls}")
    command = [os.environ["PENDULA_CXX"], f"-I{SOURCES}", source, os.environ["PENDULA_LIBRARY"]]
    subprocess.run([*command, "-Wl,--gc-sections", "-pthread", "-o", program], check=True)
    listed = [os.environ["PENDULA_NM"], "--demangle", program]
    names = subprocess.run(listed, capture_output=True, text=True, check=True).stdout
    assert {part for part, name in PARTS.items() if re.search(rf"\b{re.escape(name)}", names)} == parts
