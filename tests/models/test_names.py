"""Model files, coordinates, parameters, inputs and points may be called as anything in the kernel, or around it, is."""

import os
import subprocess
import sys

import pytest
from conftest import ROOT

sys.path.insert(0, str(ROOT / "codegen"))
from pendula_codegen.backends.cpp import struct_name
from pendula_codegen.model import read_model
from pendula_codegen.render import render_model

MODEL = """from sympy import cos as c, exp as e, sqrt as s


def define(model, links):
    angle, length = model.coordinate("{0}", "rad"), model.coordinate("{1}", "m")
    m = model.parameter("{2}", "kg", default=1.0, positive=True)
    k = model.parameter("{3}", "N/m", default=1.0, per_link=True)
    force = model.input("{4}", "N")
    model.lagrangian = m * (model.rate(angle) ** 2 + model.rate(length) ** 2) / 2 + k[0] * c(angle) * s(1 + length**2)
    model.force(angle, force * e(-length * model.time))
    model.point("{5}", (length * c(angle), length))
"""

# Of the kernel, of C++ and its libraries: types, functions, macros.
WORDS = (
    "Vector Matrix Parameters Inputs Points Eigen Real EOF M_PI errno NULL INFINITY I complex isnan int8_t sin sqrt "
    "exp std pendula kernels cos residual positions to of places sum_1 t1 sin_q q v p a f E M T chain momentum_form "
    "Number stdin sine_and_cosine coordinate_names linux unix FLT_MAX DBL_MAX nan pow log signbit st_mtime Furuta"
)
FILES = (
    "vector",
    "Matrix",
    "Parameters",
    "Inputs",
    "Eigen",
    "Real",
    "pendula",
    "kernels",
    "std",
    "cos",
    "EOF",
    "M_PI",
)

USE = """
template <pendula::System S>
int use() {
  typename S::template Parameters<double> parameters{};
  typename S::template Vector<double> q, v, a, p, f;
  typename S::template Matrix<double> A, B, C, D;
  typename S::template Inputs<double> inputs;
  typename S::template Points<double> points;
  double number = 0, numbers[9]{}, *places[9];
  S::read_parameters(numbers, parameters);
  S::parameter_places(parameters, places);
  typename S::template Parameters<float> others;
  S::cast_parameters(parameters, others);
  S::energy(parameters, q, v, number);
  S::power(parameters, q, v, inputs, number);
  S::hamiltonian_form(parameters, q, p, inputs, v, f);
  S::momentum_form_with_jacobians(parameters, q, v, inputs, p, f, A, B, C, D);
  S::residual_with_jacobians(parameters, q, v, a, inputs, f, A, B, C);
  S::acceleration(parameters, q, v, inputs, a);
  S::positions(parameters, q, points);
  S::velocities(parameters, q, v, points);
  return S::links;
}
"""


def test_kernels_of_all_such_names_compile_together(tmp_path):
    """And macros are afterwards what they were."""
    source = [
        "#include <complex.h>",
        "#include <sys/stat.h>",
        "#include <cerrno>",
        "#include <cfloat>",
        "#include <cstdio>",
    ]
    calls = []
    all_words = WORDS.split()
    for k, name in enumerate(FILES):
        words = [all_words[(6 * k + j) % len(all_words)] for j in range(6)]
        (tmp_path / f"{name}.py").write_text(MODEL.format(*words))
        alias = struct_name(name)
        text = render_model(read_model(tmp_path / f"{name}.py"), f"{name}.py", alias).text
        (tmp_path / f"{name}.hpp").write_text(text)
        source.append(f'#include "{name}.hpp"')
        calls.append(f"use<pendula::kernels::{name}_kernel>()")
    source += [
        "#include <pendula/kernels/planar_2.hpp>",
        "#include <pendula/system/system.hpp>",
        USE,
    ]
    source += [f"int main() {{ errno = 0; return {' + '.join(calls)} + (EOF == -1) + int(M_PI); }}"]
    (tmp_path / "all.cpp").write_text("\n".join(source))
    kept = os.environ.get("PENDULA_CONSUMER_FLAGS")
    if kept is None:
        pytest.fail("PENDULA_CONSUMER_FLAGS: expected the flags that compile and link a program with pendula")
    flags = [flag for flag in kept.split() if not flag.endswith((".a", ".so"))]
    compiled = subprocess.run(
        [
            *flags,
            "-std=c++20",
            "-fsyntax-only",
            "-Wall",
            "-Wextra",
            "-Wshadow",
            "-Werror",
            tmp_path / "all.cpp",
        ],
        capture_output=True,
        text=True,
    )
    assert compiled.returncode == 0, compiled.stderr
