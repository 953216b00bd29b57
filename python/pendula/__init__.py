"""Multiple pendulums and other mechanical systems, moved by symplectic Gauss-Legendre steps.

>>> import pendula
>>> double = pendula.Chain(masses=[1, 1], lengths=1.0)
>>> run = double.simulate(1.0, theta="90 deg", step=0.01)
>>> run.success, run.y.shape[0]
(True, 4)

Units are SI, angles radians, unless a system says ``units="natural"``.
"""

from typing import TYPE_CHECKING

from ._core import InputError, instruction_set
from ._core import version as _version
from ._derivatives import Derivatives, differentiate, linearize
from ._ensemble import ensemble
from ._ensemble_data import merge, open_ensemble
from ._gradient import Gradient
from ._linear import LinearSystem
from ._map import map as map  # not in __all__: `from pendula import *` leaves Python its own
from ._models import Kernel, Model, models
from ._runs import RunFailed, TrustWarning
from ._scenario import Scenario
from ._simulation import Lyapunov, Simulation, lyapunov
from ._solution import Solution, open
from ._systems import Chain

if TYPE_CHECKING:
    from ._functions import ModelFunction, model


def __getattr__(name: str) -> object:
    """Imports ModelFunction and model when they are first used."""
    if name not in ("ModelFunction", "model"):
        raise AttributeError(f"module 'pendula' has no attribute {name!r}")
    from . import _functions

    return getattr(_functions, name)


def __dir__() -> list[str]:
    """The public names."""
    return [*__all__, "map"]


__version__ = _version()
InputError.__doc__ = (
    "An argument is wrong: the message names it, what was expected and what was got. A ValueError."
)

__all__ = [
    "Chain",
    "Derivatives",
    "Gradient",
    "InputError",
    "Kernel",
    "LinearSystem",
    "Lyapunov",
    "Model",
    "ModelFunction",
    "RunFailed",
    "Scenario",
    "Simulation",
    "Solution",
    "TrustWarning",
    "__version__",
    "differentiate",
    "ensemble",
    "instruction_set",
    "linearize",
    "lyapunov",
    "merge",
    "model",
    "models",
    "open",
    "open_ensemble",
]
