"""The equations of a model file, straight from its Lagrangian: nothing of pendula's generator.

SymPy differentiates the Lagrangian as it was written, prints each entry as it comes, in C of 80-bit numbers, and cc
compiles it; model_reference.cpp moves it.
"""

import hashlib
import os
import subprocess
from functools import cached_property
from pathlib import Path

import numpy as np
from sympy import DiracDelta, Expr, Function, Integer, Symbol, cse, diff, lambdify, sympify
from sympy.codegen.ast import float80, real
from sympy.printing.c import C99CodePrinter

# Beyond e^2500 there is none that is not 0 or infinite in a double; quotients of such must not be inf / inf.
PRELUDE = """#include <math.h>
typedef long double R;
static R bounded(R x) { return expl(x > 2500 ? 2500 : x); }
"""


class Exponential(Function):
    """e^x with x as it was written: of exp(3921 t - 7490) SymPy makes e^-7490 exp(3921 t)."""

    def fdiff(self, argindex=1):
        del argindex
        return self


class Said:
    """Stands where a model file expects pendula's Model, and writes down what it says."""

    def __init__(self, links: int) -> None:
        self.links = links
        self.coordinates: list[Symbol] = []
        self.units: list[str] = []
        self.rates: dict[Symbol, Symbol] = {}
        self.parameters: list[Symbol] = []
        self.defaults: dict[str, float] = {}
        self.inputs: list[Symbol] = []
        self.forces: dict[Symbol, Expr] = {}
        self.points: dict[str, tuple] = {}
        self.lagrangian, self.dissipation = sympify(0), sympify(0)
        self.time = Symbol("t", real=True)

    def coordinate(self, name: str, unit: str) -> Symbol:
        symbol = Symbol(name, real=True)
        self.coordinates.append(symbol)
        self.units.append(unit)
        self.rates[symbol] = Symbol(f"{name}_dot", real=True)
        return symbol

    def rate(self, of: Expr) -> Expr:
        of = sympify(of)
        return diff(of, self.time) + sum(diff(of, q) * v for q, v in self.rates.items())

    def parameter(self, name: str, unit: str, *, default=None, positive=False, per_link=False):
        del unit
        names = [f"{name}_{i + 1}" for i in range(self.links)] if per_link else [name]
        symbols = [Symbol(each, real=True, positive=positive or None) for each in names]
        self.parameters += symbols
        self.defaults |= dict.fromkeys(names, default)
        return symbols if per_link else symbols[0]

    def input(self, name: str, unit: str) -> Symbol:
        del unit
        self.inputs.append(Symbol(name, real=True))
        return self.inputs[-1]

    def force(self, coordinate: Symbol, value: Expr) -> None:
        self.forces[coordinate] = self.forces.get(coordinate, 0) + value

    def point(self, name: str, components: tuple, *, kind: str = "bob") -> str:
        self.points[name] = tuple(map(sympify, components))
        return name

    def spring(self, start: str, end: str) -> None:
        """What is drawn moves nothing."""

    thread = pulleys = spring


class Printer(C99CodePrinter):
    def __init__(self) -> None:
        super().__init__({"type_aliases": {real: float80}, "user_functions": {"Exponential": "bounded"}})


class Model:
    """A model file. narrow: expressions of its coordinates, rates and t that must not be stepped over."""

    def __init__(self, text: str, narrow: tuple[str, ...] = (), links: int = 1) -> None:
        self.text, self.narrow, self.links = text, narrow, links
        self.said = Said(links)
        room: dict = {}
        exec(compile(text, "model.py", "exec"), room)
        room["exp"] = Exponential
        room["define"](self.said, links)
        said = self.said
        self.q = said.coordinates
        self.v = [said.rates[q] for q in self.q]
        self.a = [Symbol(f"{q}_dot_dot", real=True) for q in self.q]
        self.du = [Symbol(f"{u}_dot", real=True) for u in said.inputs]

    @property
    def names(self) -> list[str]:
        return [str(symbol) for symbol in (*self.q, *self.v)]

    def source(self) -> str:
        said, n = self.said, len(self.q)
        momenta = [diff(said.lagrangian, v) for v in self.v]
        mass = [diff(p, v) for p in momenta for v in self.v]
        rest = [
            sum(diff(p, q) * v for q, v in zip(self.q, self.v, strict=True))
            + diff(p, said.time)
            - diff(said.lagrangian, q)
            + diff(said.dissipation, said.rates[q])
            - said.forces.get(q, 0)
            for p, q in zip(momenta, self.q, strict=True)
        ]
        whole = [rest[i] + sum(mass[n * i + j] * self.a[j] for j in range(n)) for i in range(n)]
        by_q = [diff(w, q) for w in whole for q in self.q]
        by_v = [diff(w, v) for w in whole for v in self.v]
        by_t = [
            diff(w, said.time) + sum(diff(w, u) * du for u, du in zip(said.inputs, self.du, strict=True))
            for w in whole
        ]
        symbols = {str(s): s for s in (*self.q, *self.v, *said.parameters, said.time)}
        narrow = [sympify(text, locals=symbols) for text in self.narrow]
        first = [self._along(g) for g in narrow]
        second = [
            sympify(0) if g.free_symbols & set(self.v) else self._along(d)
            for g, d in zip(narrow, first, strict=True)
        ]
        start = "const R* of_q, const R* of_v"
        return PRELUDE + "\n".join(
            [
                self._function(
                    f"void residual({start}, R t, const R* of_p, const R* of_u, R* to_mass, R* to_rest)",
                    {"to_mass": mass, "to_rest": rest},
                ),
                self._function(
                    f"void jacobian({start}, const R* of_a, R t, const R* of_p, const R* of_u, const R* of_du, "
                    "R* to_q, R* to_v, R* to_t)",
                    {"to_q": by_q, "to_v": by_v, "to_t": by_t},
                ),
                self._function(
                    f"void narrow({start}, const R* of_a, R t, const R* of_p, R* to_value, R* to_rate, R* to_second)",
                    {"to_value": narrow, "to_rate": first, "to_second": second},
                ),
            ]
        )

    def _along(self, g: Expr) -> Expr:
        """dg/dt along the motion."""
        terms = diff(g, self.said.time)
        for q, v, a in zip(self.q, self.v, self.a, strict=True):
            terms += diff(g, q) * v + diff(g, v) * a
        return terms

    def _function(self, head: str, outputs: dict[str, list[Expr]]) -> str:
        places = {}
        for array, symbols in (("q", self.q), ("v", self.v), ("a", self.a), ("p", self.said.parameters)):
            places |= {s: f"of_{array}[{k}]" for k, s in enumerate(symbols)}
        for array, symbols in (("u", self.said.inputs), ("du", self.du)):
            places |= {s: f"of_{array}[{k}]" for k, s in enumerate(symbols)}
        printer = Printer()
        everything = [
            entry.replace(DiracDelta, lambda *_: Integer(0))
            for entries in outputs.values()
            for entry in entries
        ]
        shared, entries = cse(everything, symbols=(Symbol(f"shared_{k}") for k in range(10**6)), order="none")
        used = set().union(*(e.free_symbols for e in (*entries, *(e for _, e in shared))))
        lines = [f"const R {s} = {place};" for s, place in places.items() if s in used]
        lines += [f"const R {s} = {printer.doprint(e)};" for s, e in shared]
        names = [f"{array}[{k}]" for array, those in outputs.items() for k in range(len(those))]
        lines += [f"{name} = {printer.doprint(e)};" for name, e in zip(names, entries, strict=True)]
        return head + " {\n  " + "\n  ".join(lines) + "\n}\n"

    def library(self, folder: Path) -> Path:
        """Compiled, and kept in the folder."""
        key = hashlib.sha256(f"{self.text} {self.narrow} {self.links} {PRELUDE}".encode()).hexdigest()[:20]
        file = folder / f"{key}.so"
        if not file.exists():
            source = folder / f"{key}.c"
            source.write_text(self.source())
            made = folder / f"{key}.{os.getpid()}.so"
            compiler = ["cc", "-std=c11", "-O1", "-w", "-shared", "-fPIC", "-o", made, source, "-lm"]
            subprocess.run(compiler, check=True)
            made.rename(file)
        return file

    @cached_property
    def _observe(self):
        said = self.said
        energy = sum(diff(said.lagrangian, v) * v for v in self.v) - said.lagrangian
        outputs = [energy, *(c for point in said.points.values() for c in point)]
        kinetic = sum(diff(said.lagrangian, v, w) * v * w / 2 for v in self.v for w in self.v)
        arguments = [*self.q, *self.v, said.time, *said.parameters]
        return lambdify(arguments, [*outputs, kinetic], modules=[{"Exponential": np.exp}, "numpy"])

    def columns(self, rows: np.ndarray, parameters: list[float]) -> dict[str, np.ndarray]:
        """What a trajectory has, of rows of coordinates, rates and time; and the kinetic energy."""
        numbers = [*rows.T, *(np.longdouble(p) for p in parameters)]
        with np.errstate(all="ignore"):
            energy, *parts, kinetic = self._observe(*numbers)
        whole = {"t": rows[:, -1]} | dict(zip(self.names, rows.T[:-1], strict=True))
        names = [f"{name}_{axis}" for name, point in self.said.points.items() for axis in "xyz"[: len(point)]]
        whole |= {name: part + 0 * rows[:, -1] for name, part in zip(names, parts, strict=True)}
        return whole | {"energy": energy + 0 * rows[:, -1], "kinetic": kinetic + 0 * rows[:, -1]}
