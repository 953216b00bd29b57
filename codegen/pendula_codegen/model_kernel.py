"""The kernel of a model: what every system has, in the words of the model's file."""

from __future__ import annotations

from functools import cached_property

from sympy import Matrix

from pendula_codegen.entry_points import SystemKernel
from pendula_codegen.mechanics import jacobian, time_slope
from pendula_codegen.model import Model
from pendula_codegen.places import Place
from pendula_codegen.vocabulary import Angle, Leaf


class ModelKernel(SystemKernel):
    """Everything that is emitted for one model file."""

    suffix = "_"  # nothing else has: not a type, a function, or a macro

    def __init__(self, model: Model):
        super().__init__(model.system)
        self.model = model

    @cached_property
    def points(self) -> tuple[Matrix | None, Matrix | None]:
        components = [component for point in self.model.points for component in point.components]
        if not components:
            return None, None
        system = self.system
        slopes = jacobian(components, system.coordinates)
        rates = [
            sum(slope * v for slope, v in zip(row, system.velocities, strict=True))
            + time_slope(system, component)
            for component, row in zip(components, slopes, strict=True)
        ]
        return Matrix(components), Matrix(rates)

    def angles(self) -> list[Angle]:
        held = [(k, c) for k, c in enumerate(self.model.coordinates) if c.is_angle]
        return [Angle(c.symbol, Place("q", index=(k,))) for k, c in held]

    def leaves(self) -> list[Leaf]:
        parameters = [
            Leaf(symbol, Place("parameters", parameter.name, (i,) if parameter.per_link else ()), "parameter")
            for parameter in self.model.parameters
            for i, symbol in enumerate(parameter.symbols)
        ]
        time = Leaf(self.model.time, Place("parameters", "time"), "parameter")
        inputs = [
            Leaf(given.symbol, Place("inputs", index=(k,)), "input")
            for k, given in enumerate(self.model.inputs)
        ]
        return [*parameters, time, *inputs]
