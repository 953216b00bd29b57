"""The Lagrangian of a generated kernel, for programs that take Lagrangians or make code of equations."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from sympy import Expr, Symbol, expand_trig, lambdify

sys.path.insert(0, str(Path(__file__).parents[1] / "codegen"))

from pendula_codegen.chain import Chain
from pendula_codegen.links import LINKS
from pendula_codegen.model import Model, read_model
from pendula_codegen.models import find_model

# L as people write it, by the speeds of points; as the generator shortens it, with sines and cosines of differences of
# angles; and that in sines and cosines of angles alone.
FORMS = ("written", "differences", "angles")


@dataclass(frozen=True)
class Statement:
    """L(q, v, t) and the forces beside it; numbers and inputs in the order of the kernel."""

    coordinates: tuple[Symbol, ...]
    velocities: tuple[Symbol, ...]
    numbers: tuple[Symbol, ...]
    inputs: tuple[Symbol, ...]
    time: Symbol
    lagrangian: Expr
    forces: tuple[Expr, ...]

    def evaluated(self, expression: Expr, values: Sequence, functions: dict[str, Callable]) -> object:
        """An expression at values of (coordinates, velocities, numbers, inputs, time) of any type."""
        symbols = (*self.coordinates, *self.velocities, *self.numbers, *self.inputs, self.time)
        return lambdify(symbols, expression, modules=[functions, "math"])(*values)


def statement(kernel: str, form: str) -> Statement:
    """Of a kernel such as planar_2, cart_chain_2 or furuta, in one of FORMS."""
    model, _, links = kernel.rpartition("_")
    if model in LINKS:
        found = _of_chain(Chain(LINKS[model], int(links)), form)
    elif links.isdigit():
        found = _of_model(read_model(find_model(model), int(links)), form)
    else:
        found = _of_model(read_model(find_model(kernel)), form)
    if form == "angles":
        return replace(found, lagrangian=expand_trig(found.lagrangian))
    return found


def _of_model(model: Model, form: str) -> Statement:
    system = model.system
    lagrangian = model.lagrangian if form == "written" else system.lagrangian
    return Statement(
        system.coordinates,
        system.velocities,
        system.parameters,
        system.inputs,
        model.time,
        lagrangian,
        system.forces,
    )


def _of_chain(chain: Chain, form: str) -> Statement:
    kinds = (chain.mass, chain.length, chain.damping)
    numbers = [*(kind(i) for kind in kinds for i in chain.numbers), chain.model.gravity]
    torques = [component for i in chain.numbers for component in chain.torque(i)]
    kinetic = chain.kinetic_energy
    if form == "written":
        symbols = (symbol for rate in chain.rate_symbols for symbol in rate)
        rates = (component for rate in chain.rates for component in rate)
        kinetic = chain.kinetic_energy_of_bobs.subs(dict(zip(symbols, rates, strict=True)))
    # Inertias are of sums of masses, which are symbols of their own, too.
    lagrangian = (kinetic - chain.potential_energy).subs(chain.definitions).subs(chain.definitions)
    return Statement(
        chain.coordinates,
        chain.velocities,
        tuple(numbers),
        tuple(torques),
        Symbol("t", real=True),
        lagrangian,
        tuple(chain.forces),
    )
