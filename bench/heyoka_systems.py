"""Systems of races.json that are no chains, as heyoka gets them: by their Lagrangians."""

from dataclasses import dataclass, field

import heyoka as hy
import numpy as np
from lagrangians import FORMS, Statement, statement

FUNCTIONS = {"sin": hy.sin, "cos": hy.cos, "sqrt": hy.sqrt}


@dataclass
class System:
    """A system with its numbers, how it starts, and where it ends; fields as in races.json."""

    kernel: str
    parameters: list[float]
    inputs: list[float]
    sines: list[list[float]]
    q: list[float]
    v: list[float]
    duration: float
    floor: float
    end: list[str]
    sizes: list[float]
    trials: dict = field(default_factory=dict)
    unrolled = True

    def start(self) -> np.ndarray:
        """Coordinates and rates at the start."""
        return np.array([*self.q, *self.v])

    def formulations(self, number: type = float) -> list[list[tuple]]:
        """Equations of motion by heyoka's own derivation, from each form of the Lagrangian.

        Numbers are of a type, so that what heyoka makes of constants is as accurate as that.
        """
        return [self._derived(statement(self.kernel, form), number) for form in FORMS]

    def _derived(self, said: Statement, number: type) -> list[tuple]:
        q = hy.make_vars(*(symbol.name for symbol in said.coordinates))
        v = hy.make_vars(*(symbol.name for symbol in said.velocities))
        parameters = [hy.expression(number(value)) for value in self.parameters]
        resting = [0.0] * len(v)

        def evaluated(expression: object, rates: list, inputs: list) -> hy.expression:
            values = [*q, *rates, *parameters, *inputs, hy.time]
            return hy.expression(0.0) + said.evaluated(expression, values, FUNCTIONS)

        # Inputs push along coordinates, whatever the motion; the rest of the forces is linear in the rates.
        pushes = [evaluated(force, resting, self._inputs(number)) for force in said.forces]
        drags = [evaluated(force, v, [0.0] * len(self.inputs)) for force in said.forces]
        lagrangian = evaluated(said.lagrangian, v, self.inputs) + hy.sum(
            [x * push for x, push in zip(q, pushes, strict=True)]
        )
        dissipation = -0.5 * hy.sum([rate * drag for rate, drag in zip(v, drags, strict=True)])
        return hy.lagrangian(lagrangian, q, v, dissipation)

    def _inputs(self, number: type) -> list:
        given = [hy.expression(number(value)) for value in self.inputs]
        for index, *sine in self.sines:
            amplitude, frequency, phase = (hy.expression(number(value)) for value in sine)
            given[index] = given[index] + amplitude * hy.sin(frequency * hy.time + phase)
        return given
