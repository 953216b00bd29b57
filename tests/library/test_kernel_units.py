"""What is compiled from a kernel: its functions, of one state and of several, and the loop of an iteration. No solver.

Environment: PENDULA_OBJECTS, the objects of one copy of the library, with colons between them; PENDULA_NM.
"""

import os
import re
import subprocess
from pathlib import Path

import pytest

UNITS = [Path(name) for name in os.environ["PENDULA_OBJECTS"].split(":") if "/kernel_" in name]

# The kernel itself, the functions that its table points to, and functions of numbers.
OF_A_KERNEL = re.compile(
    r"pendula::(kernels::|registry::table_|detail::(KernelFunctions<|KernelSeries<|sums_of_kernel<|one_by_one<|sincos_of_large<)"
    r"|(for_each_register|sincos|sin|cos|tan|asin|acos|atan|sinh|cosh|tanh|exp|log|sqrt|cbrt|pow)<)"
)


def names_in(unit: Path) -> list[str]:
    """Functions and constants of pendula that an object defines, without what they give."""
    command = [os.environ["PENDULA_NM"], "-C", "--defined-only", str(unit)]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    names = [line.split(maxsplit=2)[2] for line in text.splitlines()]
    return [name[name.index("pendula::") :] for name in names if "pendula::" in name]


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_a_kernels_unit_holds_no_solver(unit):
    names = names_in(unit)
    assert [name for name in names if not OF_A_KERNEL.match(name)] == []
    loops = {name for name in names if re.search(r"KernelFunctions<.*>::iterate\(", name)}
    assert len(loops) == 4  # of 1, 2, 4 and 8 stages


def test_there_are_kernels():
    assert UNITS
