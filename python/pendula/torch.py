"""Motions in PyTorch: differentiable backward (`pip install pendula[torch]`).

>>> import torch, pendula.torch
>>> chain = pendula.Chain(masses=[1, 1])
>>> state = torch.tensor([1.0, 0.5, 0.0, 0.0], dtype=torch.float64, requires_grad=True)
>>> pendula.torch.simulate(chain, [1.0], state, step=0.01)[0, -1].backward()
>>> state.grad.shape
torch.Size([4])
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ._core import InputError
from ._moved import Moved
from ._runs import mapping
from ._systems import System

try:
    torch: Any = importlib.import_module("torch")  # this way type checkers do not read it: it is large
except ImportError as _error:
    raise ImportError("pendula.torch: expected PyTorch, got none; pip install 'pendula[torch]'") from _error

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


def simulate(
    system: System,
    t: ArrayLike,
    state: Any,
    parameters: Mapping[str, Any] | None = None,
    **options: Any,
) -> Any:
    """The states of a motion at times, as a function that PyTorch differentiates.

    First derivatives are those of the discrete motion, with step sizes held fixed; backward only.

    Parameters
    ----------
    system : Chain or Model
    t : (times,) array_like
        In s, ascending from 0 on; not differentiated.
    state : (coordinates + rates,) tensor
        At the start, in the order of :attr:`pendula.Simulation.names`; of 64 bits, as all tensors here.
    parameters : mapping of tensors, optional
        Parameters and inputs that vary, by name; the others are those of the system.
    tolerance, step, method, stages, solver, iteration
        As for :func:`pendula.differentiate`.

    Returns
    -------
    (coordinates + rates, times) tensor

    Raises
    ------
    InputError
        An argument is wrong.
    RunFailed
        The computation failed.
    """
    moved = Moved(system, t, options)
    values = mapping("parameters", parameters)
    tensors = {"state": state, **{f"parameters.{name}": one for name, one in values.items()}}
    for name, given in tensors.items():
        if not isinstance(given, torch.Tensor) or given.dtype != torch.float64:
            got = given.dtype if isinstance(given, torch.Tensor) else type(given).__name__
            raise InputError(f"{name}: expected a tensor of torch.float64, got {got}")
    moved.require(state, values)
    return _Motion.apply(moved, tuple(values), *tensors.values())


class _Motion(torch.autograd.Function):  # type: ignore[misc]
    @staticmethod
    def forward(ctx: Any, moved: Moved, names: tuple[str, ...], *tensors: Any) -> Any:
        ctx.moved, ctx.names = moved, names
        ctx.save_for_backward(*tensors)
        state, *values = (one.detach().cpu().numpy() for one in tensors)
        states = moved.states(state, dict(zip(names, values, strict=True)))
        return torch.from_numpy(states.copy()).to(tensors[0].device)

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator]
    def backward(ctx: Any, by_states: Any) -> tuple[Any, ...]:
        tensors = ctx.saved_tensors
        state, *values = (one.detach().cpu().numpy() for one in tensors)
        named = dict(zip(ctx.names, values, strict=True))
        found = ctx.moved.gradient(state, named, by_states.cpu().numpy())
        parts = [found.start, *({**found.parameters, **found.inputs}[name] for name in ctx.names)]
        return (
            None,
            None,
            *(
                torch.from_numpy(part.copy()).reshape(one.shape).to(one.device)
                for part, one in zip(parts, tensors, strict=True)
            ),
        )
