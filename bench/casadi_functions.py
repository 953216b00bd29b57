"""Writes CasADi's C++ for the residuals of generated kernels, and a table of the functions in it.

usage: python bench/casadi_functions.py FOLDER KERNEL...

CasADi (Andersson et al. 2019; doi:10.1007/s12532-018-0139-4) differentiates the same Lagrangian by itself:

    E = ∂p/∂q v + ∂p/∂v a + ∂p/∂t − ∂L/∂q − Q,  p = ∂L/∂v,

with its pass for common subexpressions. L is handed over in all FORMS of lagrangians.py.
"""

import sys
from pathlib import Path

import casadi as ca
from lagrangians import FORMS, Statement, statement

FUNCTIONS = {"sin": ca.sin, "cos": ca.cos, "sqrt": ca.sqrt}
TABLE = """// Written by bench/casadi_functions.py.
#pragma once
#include <array>
#include <string_view>

#include "casadi_functions.h"

namespace bench {{

/// One function of one kernel, as CasADi makes it of a form of L; of arguments q, v, a, parameters, inputs and time.
struct CasadiFunction {{
  std::string_view kernel, what, form;
  int (*evaluate)(const double**, double**, long long*, double*, int);
}};

inline constexpr std::array casadi_functions{{
{entries}
}};

}}  // namespace bench
"""


def functions_of(kernel: str, form: str) -> dict[str, ca.Function]:
    """The residual, and the residual with its Jacobians by q, v and a, all dense."""
    said = statement(kernel, form)
    count = len(said.coordinates)
    q, v, a = (ca.SX.sym(name, count) for name in "qva")
    numbers, inputs = ca.SX.sym("numbers", len(said.numbers)), ca.SX.sym("inputs", len(said.inputs))
    time = ca.SX.sym("time")
    residual = _residual(said, q, v, a, numbers, inputs, time)
    jacobians = [ca.jacobian(residual, x) for x in (q, v, a)]
    arguments = [q, v, a, numbers, inputs, time]
    outputs = {"residual": [residual], "residual_with_jacobians": [residual, *jacobians]}
    return {
        what: ca.Function(f"{kernel}_{what}_{form}", arguments, [ca.densify(each) for each in ca.cse(found)])
        for what, found in outputs.items()
    }


def _residual(
    said: Statement, q: ca.SX, v: ca.SX, a: ca.SX, numbers: ca.SX, inputs: ca.SX, time: ca.SX
) -> ca.SX:
    values = [*(each for vector in (q, v, numbers, inputs) for each in ca.vertsplit(vector)), time]
    lagrangian = said.evaluated(said.lagrangian, values, FUNCTIONS)
    forces = [said.evaluated(force, values, FUNCTIONS) for force in said.forces]
    momenta = ca.gradient(lagrangian, v)
    moved = ca.jtimes(momenta, q, v) + ca.jtimes(momenta, v, a) + ca.jacobian(momenta, time)
    return moved - ca.gradient(lagrangian, q) - ca.vertcat(*forces)


def main() -> None:
    """Writes the files into the folder."""
    folder, *kernels = sys.argv[1:]
    generator = ca.CodeGenerator("casadi_functions.cpp", {"cpp": True, "with_header": True})
    entries = []
    for kernel in kernels:
        for form in FORMS:
            for what, function in functions_of(kernel, form).items():
                generator.add(function)
                entries.append(f'    CasadiFunction{{"{kernel}", "{what}", "{form}", {function.name()}}},')
    generator.generate(f"{folder}/")
    table = TABLE.format(entries="\n".join(entries))
    Path(folder, "casadi_table.hpp").write_text(table, encoding="utf-8")


if __name__ == "__main__":
    main()
