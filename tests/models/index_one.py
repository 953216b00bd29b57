"""A second method for linkages, which shares nothing with pendula but the model file.

Accelerations and forces follow from M a - G^T lambda = f and G a = -(d2g/dt2 without accelerations). They are moved by
extrapolation of the midpoint rule (Gragg, Bulirsch, Stoer), in long double: C++ that SymPy writes here.
"""

import os
import subprocess
from pathlib import Path

from sympy import Symbol, cse, diff, nsimplify
from sympy.printing.cxx import CXX17CodePrinter


class Recorded:
    """Takes what a model file says: the part of its language that linkages with forces and numbers need."""

    def __init__(self):
        self.q, self.rates, self.forces, self.constraints, self.lagrangian = [], {}, {}, [], 0

    def coordinate(self, name, unit):
        q = Symbol(name, real=True)
        self.q.append(q)
        self.rates[q] = Symbol(f"{name}_dot", real=True)
        return q

    def parameter(self, name, unit, default):
        return nsimplify(repr(default))

    def rate(self, value):
        return sum(diff(value, q) * v for q, v in self.rates.items())

    def force(self, q, value):
        self.forces[q] = self.forces.get(q, 0) + value

    def constraint(self, name, value, unit):
        self.constraints.append(value)


class LongDoubles(CXX17CodePrinter):
    def _print_Rational(self, expr):
        return f"({expr.p}.0L / {expr.q}.0L)"

    def _print_Integer(self, expr):
        return f"{expr.p}.0L"

    def _print_Pow(self, expr):
        base = self._print(expr.base)
        return {2: f"({base}) * ({base})", -1: f"1 / ({base})"}.get(
            expr.exp, f"std::pow({base}, {self._print(expr.exp)})"
        )


PROGRAM = """
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>
using R = long double;
using Y = std::vector<R>;
constexpr int n = %(n)d, m = %(m)d, N = n + m;
static void terms(const Y& y, R* M, R* f, R* G, R* second) {
%(terms)s}
static Y field(const Y& y) {
  R M[n * n], f[n], G[m * n], second[m], A[N][N + 1] = {};
  terms(y, M, f, G, second);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) A[i][j] = M[i * n + j];
    for (int c = 0; c < m; ++c) A[n + c][i] = G[c * n + i], A[i][n + c] = -G[c * n + i];
    A[i][N] = f[i];
  }
  for (int c = 0; c < m; ++c) A[n + c][N] = -second[c];
  for (int c = 0; c < N; ++c) {
    int p = c;
    for (int r = c + 1; r < N; ++r) p = std::abs(A[r][c]) > std::abs(A[p][c]) ? r : p;
    for (int j = 0; j <= N; ++j) std::swap(A[c][j], A[p][j]);
    for (int r = c + 1; r < N; ++r) {
      const R by = A[r][c] / A[c][c];
      for (int j = c; j <= N; ++j) A[r][j] -= by * A[c][j];
    }
  }
  Y x(N), d(2 * n);
  for (int i = N - 1; i >= 0; --i) {
    x[i] = A[i][N];
    for (int j = i + 1; j < N; ++j) x[i] -= A[i][j] * x[j];
    x[i] /= A[i][i];
  }
  for (int i = 0; i < n; ++i) d[i] = y[n + i], d[n + i] = x[i];
  return d;
}
static Y midpoint(const Y& y, R H, int parts) {
  const R h = H / parts;
  Y before = y, now = y, d = field(y);
  for (int i = 0; i < 2 * n; ++i) now[i] += h * d[i];
  for (int part = 1; part < parts; ++part) {
    d = field(now);
    for (int i = 0; i < 2 * n; ++i) before[i] += 2 * h * d[i];
    std::swap(before, now);
  }
  d = field(now);
  for (int i = 0; i < 2 * n; ++i) now[i] = (before[i] + now[i] + h * d[i]) / 2;
  return now;
}
int main(int, char** given) {
  const R duration = std::strtold(given[1], nullptr);
  const int steps = std::atoi(given[2]), columns = 8;
  Y y(2 * n);
  for (int i = 0; i < 2 * n; ++i) y[i] = std::strtold(given[3 + i], nullptr);
  for (int step = 0; step < steps; ++step) {
    std::vector<Y> row;
    for (int j = 0; j < columns; ++j) {
      row.push_back(midpoint(y, duration / steps, 2 * (j + 1)));
      for (int l = j - 1; l >= 0; --l) {
        const R ratio = R(j + 1) / (l + 1);
        for (int i = 0; i < 2 * n; ++i) row[l][i] = row[l + 1][i] + (row[l + 1][i] - row[l][i]) / (ratio * ratio - 1);
      }
    }
    y = row[0];
  }
  for (const R one : y) std::printf("%%.19Lg\\n", one);
}
"""


def program(define, folder: Path) -> Path:
    """Compiles the motion of a model: duration, number of steps, coordinates and rates -> those at its end."""
    model = Recorded()
    define(model, 1)
    q, v = model.q, [*model.rates.values()]
    momenta = [diff(model.lagrangian, rate) for rate in v]
    terms = {
        "M": [diff(p, rate) for p in momenta for rate in v],
        "f": [
            diff(model.lagrangian, x) + model.forces.get(x, 0) - model.rate(p)
            for x, p in zip(q, momenta, strict=True)
        ],
        "G": [diff(g, x) for g in model.constraints for x in q],
        "second": [model.rate(model.rate(g)) for g in model.constraints],
    }
    shared, found = cse([each for group in terms.values() for each in group])
    write = LongDoubles().doprint
    lines = [f"const R {name} = y[{k}];" for k, name in enumerate([*q, *v])]
    lines += [f"const R {name} = {write(value)};" for name, value in shared]
    places = [f"{name}[{k}]" for name, group in terms.items() for k in range(len(group))]
    lines += [f"{place} = {write(value)};" for place, value in zip(places, found, strict=True)]
    source, made = folder / "index_one.cpp", folder / "index_one"
    body = "".join(f"  {line}\n" for line in lines)
    source.write_text(PROGRAM % {"n": len(q), "m": len(model.constraints), "terms": body})
    compiler = os.environ.get("PENDULA_CONSUMER_FLAGS", "c++").split()[0]
    subprocess.run([compiler, "-O1", "-std=c++20", "-w", "-o", made, source], check=True)
    return made
