"""The Lagrangian of a generated kernel, for programs that take Lagrangians or make code of equations."""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sympy import Expr, Symbol, expand_trig, lambdify

sys.path.insert(0, str(Path(__file__).parents[1] / "codegen"))

from pendula_codegen.chain import Chain
from pendula_codegen.links import LINKS
from pendula_codegen.mechanics import LagrangianSystem
from pendula_codegen.model import read_model
from pendula_codegen.models import find_model

FORMS = ("differences", "angles")  # that sines and cosines are of


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
    """Of a kernel such as planar_2, cart_chain_2 or furuta, in sines of angles or of differences of them too."""
    model, _, links = kernel.rpartition("_")
    if not links.isdigit():
        system = read_model(find_model(kernel)).system
        found = _whole(system, system.parameters, system.inputs, system.lagrangian)
    elif model in LINKS:
        found = _of_chain(Chain(LINKS[model], int(links)))
    else:
        system = read_model(find_model(model), int(links)).system
        found = _whole(system, system.parameters, system.inputs, system.lagrangian)
    lagrangian = expand_trig(found.lagrangian) if form == "angles" else found.lagrangian
    return Statement(**{**vars(found), "lagrangian": lagrangian})


def _whole(
    system: LagrangianSystem, numbers: Sequence[Symbol], inputs: Sequence[Symbol], lagrangian: Expr
) -> Statement:
    time = system.time or Symbol("t", real=True)
    return Statement(
        system.coordinates,
        system.velocities,
        tuple(numbers),
        tuple(inputs),
        time,
        lagrangian,
        system.forces,
    )


def _of_chain(chain: Chain) -> Statement:
    kinds = (chain.mass, chain.length, chain.damping)
    numbers = [kind(i) for kind in kinds for i in chain.numbers]
    torques = [component for i in chain.numbers for component in chain.torque(i)]
    # Inertias are of sums of masses, which are symbols of their own, too.
    lagrangian = chain.system.lagrangian.subs(chain.definitions).subs(chain.definitions)
    return _whole(chain.system, [*numbers, chain.model.gravity], torques, lagrangian)
