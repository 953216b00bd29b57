"""Multiple pendulums and other mechanical systems, moved by symplectic Gauss-Legendre steps.

>>> import pendula
>>> double = pendula.Chain(masses=[1, 1], lengths=1.0)
>>> run = double.simulate(1.0, theta="90 deg", step=0.01)
>>> run.success, run.y.shape[0]
(True, 4)

Units are SI, angles radians, unless a system says ``units="natural"``.
"""

from ._core import InputError, instruction_set
from ._core import version as _version
from ._derivatives import Derivatives, Gradient, differentiate, linearize
from ._ensemble import ensemble
from ._ensemble_data import merge, open_ensemble
from ._functions import ModelFunction, model
from ._map import map as map  # not in __all__: `from pendula import *` leaves Python its own
from ._runs import RunFailed, Solution, TrustWarning
from ._simulation import Lyapunov, Simulation, lyapunov
from ._systems import Chain, Model, Scenario

__version__ = _version()
InputError.__doc__ = (
    "An argument is wrong: the message names it, what was expected and what was got. A ValueError."
)

__all__ = [
    "Chain",
    "Derivatives",
    "Gradient",
    "InputError",
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
    "open_ensemble",
]
