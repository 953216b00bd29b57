"""Systems other than chains: built-in models and model files."""

from __future__ import annotations

import copy
import math
import re
from collections.abc import Mapping, Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import _core
from ._core import InputError
from ._inputs import MOTIONS, Signals, inputs_of
from ._runs import mapping, places, plainly, quantity, require_known, tell, unknown
from ._systems import System, Tables, tables_of

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Kernel(NamedTuple):
    """How the functions of a model run."""

    by: str  #: "built in", "compiled", "jit" (by LLVM in this process) or "interpreted"
    file: Path | None  #: the file of the kernel; None if it is part of pendula


def models() -> list[str]:
    """Names of the models that come with pendula, for :class:`Model`.

    >>> import pendula
    >>> "furuta" in pendula.models()
    True
    """
    return _core.built_in_models(places()[0])


class Model(System):
    """Any other mechanical system: a built-in model by its name, or a model file.

    Parameters
    ----------
    model : str or path
        ``"furuta"`` (``pendula models`` lists them), or a file that defines ``define(model, links)``.
    links : int, optional
        Number of links, for models whose number of links is free.
    inputs : mapping, optional
        Values of inputs by name: a number, which is held, or a table of numbers over time, linear in between:
        ``(times, values)``, the name of a CSV file with columns ``t`` and that of the input, or a mapping with
        ``times`` and ``values`` or ``file`` and ``column``, and ``hold=True`` for steps.
    drives : sequence of mappings, optional
        Inputs that depend on time: ``input``, ``amplitude``, ``frequency``, ``phase``, ``constant``, or ``value``, an
        expression of time: ``"t < 1 ? 2 : 0"``.
    feedback : sequence of mappings, optional
        Functions of the motion that are added to inputs: ``input``, ``value`` (an expression of the columns:
        ``"-12*x - 9*x_dot"``), and for a controller that samples ``sample`` (s) and ``limit``.
    parameters
        Parameters by name; others have the model's defaults.

    Raises
    ------
    InputError
        An argument is wrong, or the model: its kernel is made here, if it was not made before.

    Examples
    --------
    >>> import pendula
    >>> cart = pendula.Model("cart_chain", links=2, cart_mass=2.0)
    >>> cart.coordinates, cart.inputs
    (['x', 'theta_1', 'theta_2'], ['push'])
    >>> cart.units["theta_dot_1"], cart.parameters["cart_mass"]
    ('rad/s', 2.0)
    """

    def __init__(
        self,
        model: str | PathLike[str],
        links: int | None = None,
        *,
        inputs: Mapping[str, object] | None = None,
        drives: Sequence[Mapping[str, object]] = (),
        feedback: Sequence[Mapping[str, object]] = (),
        **parameters: object,
    ) -> None:
        name = str(model)
        self._name = str(Path(name).resolve()) if name.endswith(".py") else name
        self._links = links
        known = [name for name, *_ in self._info.parameters]
        for name in parameters:
            if name not in known:
                raise unknown("Model", name, [*known, "links", *(Model.__init__.__kwdefaults__ or ())])
        self._parameters = {name: self._plain(name, one) for name, one in copy.deepcopy(parameters).items()}
        self._drives = tables_of("drives", drives)
        self._feedback = tables_of("feedback", feedback)
        self._inputs, self._signals = self._inputs_of(mapping("inputs", inputs))
        self._made_by = ""
        self._require_arguments()

    def _plain(self, name: str, given: object) -> object:
        """A parameter without its unit; wrong values stay as they are, for the reader of scenarios."""
        if isinstance(given, (list, tuple)):
            return [self._plain(name, one) for one in given]
        found = self._info.with_unit(given, name) if isinstance(given, str) else None
        return given if found is None else found

    def _inputs_of(self, given: Mapping[str, object]) -> tuple[dict[str, float], Signals]:
        require_known("inputs", given, self.inputs, MOTIONS if self.model_file() else "")
        held, signals = inputs_of(given)
        return {
            name: quantity(f"inputs.{name}", one, self._info, name) for name, one in held.items()
        }, signals

    def _require_arguments(self) -> None:
        """Raises InputError for wrong arguments. Parameters without a default may be given later."""
        tables = self.tables()
        later = {name: 1.0 for name, _, default in self._info.parameters if math.isnan(default)}
        tables["system"] = {**tables["system"], "parameters": {**later, **self._parameters} or None}  # type: ignore[dict-item]
        first = len(self._drives) + 1
        numbers = {f"drive[{first + k}]": f"inputs.{name}" for k, name in enumerate(self._inputs)}
        self._require_right(tables, {**numbers, **self._tables_over_time()})

    def __repr__(self) -> str:
        given = {
            "links": self._links,
            **self._parameters,
            "inputs": {**self._inputs, **self._signals},
            "drives": self._drives,
            "feedback": self._feedback,
        }
        told = "".join(f", {key}={one!r}" for key, one in given.items() if one not in (None, {}, []))
        return f"{self._made_by}({told[2:]})" if self._made_by else f"Model({self._name!r}{told})"

    @cached_property
    def _info(self) -> _core.ModelInfo:
        try:
            with plainly():
                return _core.describe_model(self._name, self._links, *places(), tell)
        except InputError as error:
            raise InputError(f"model: {error}") from None

    @property
    def links(self) -> int:
        """Number of links; 1 for a model without links."""
        return self._info.links

    @property
    def coordinates(self) -> list[str]:
        """Names of the coordinates."""
        return [name for name, _ in self._info.coordinates]

    @property
    def rates(self) -> list[str]:
        """Names of their rates."""
        return [name for name, _ in self._info.rates]

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs. Motions, which ``pendula describe`` lists, are no inputs: only drives move them."""
        return [name for name, _ in self._info.inputs]

    @property
    def constraints(self) -> list[str]:
        """Names of the constraints: ``run["force_loop"]`` is the force of the constraint loop."""
        return [name for name, _ in self._info.constraints]

    @property
    def points(self) -> list[str]:
        """Names of the points: ``run["bob_x"]`` is a component of the point bob."""
        return self._info.points

    @property
    def parameters(self) -> dict[str, object]:
        """Parameters as given, without units, or the model's defaults; NaN if there is none."""
        defaults = {name: default for name, _, default in self._info.parameters}
        return {**defaults, **copy.deepcopy(self._parameters)}

    @property
    def kernel(self) -> Kernel:
        """How the model's functions run. Makes the kernel if need be.

        >>> import pendula
        >>> pendula.Model("furuta").kernel.by in ("built in", "compiled", "jit", "interpreted")
        True
        """
        by = {"build": "built in", "compiler": "compiled", "llvm": "jit", "interpreter": "interpreted"}
        return Kernel(
            by[self._info.kernel_by], Path(self._info.kernel_file) if self._info.kernel_file else None
        )

    def start_names(self) -> list[str]:
        names = dict.fromkeys([*self.coordinates, *(re.sub(r"_\d+$", "", one) for one in self.coordinates)])
        rates = dict.fromkeys([*self.rates, *(re.sub(r"_\d+$", "", one) for one in self.rates)])
        found = ["assemble"] if self._info.constraints else []
        return [*names, *rates, *(f"p_{name}" for name in names), *found]

    def model_file(self) -> Path | None:
        return Path(self._name) if self._name.endswith(".py") else None

    def replaced(
        self, parameters: Mapping[str, NDArray[np.float64]], inputs: Mapping[str, NDArray[np.float64]]
    ) -> Model:
        other = copy.copy(self)
        sizes = {name: float(one[0]) if one.size == 1 else one for name, one in parameters.items()}
        other._parameters = {**self._parameters, **sizes}
        other._drives = [
            {**drive, "constant": 0.0} if drive.get("input") in inputs else drive for drive in self._drives
        ]
        other._inputs = {**self._inputs, **{name: float(one[0]) for name, one in inputs.items()}}
        return other

    def tables(self) -> Tables:
        system: dict[str, object] = {
            "model": self._name,
            "links": self._links,
            "parameters": self._parameters or None,
        }
        constants = [{"input": key, "constant": one} for key, one in self._inputs.items()]
        return {
            "system": system,
            "system.drive": [*self._drives, *constants],
            "system.feedback": list(self._feedback),
            "system.signal": list(self._signals.values()),
        }

    def unforced(self) -> Model:
        return self.replaced({}, {name: np.zeros(1) for name in self.inputs})

    def held(self, inputs: Mapping[str, object]) -> Model:
        numbers, signals = self._inputs_of(inputs)
        other = self.replaced({}, {name: np.array([numbers.get(name, 0.0)]) for name in inputs})
        other._signals = {
            **{name: one for name, one in self._signals.items() if name not in inputs},
            **signals,
        }
        return other
