"""Motions in PyTorch, against their derivatives without it. By hand: no test installs PyTorch, which is large."""

from typing import Any

import numpy as np
import pendula
import pytest

torch = pytest.importorskip("torch")
import pendula.torch  # noqa: E402

CHAIN = pendula.Chain(masses=[1, 1], torque=[0.1, 0.2])
TIMES = [0.5, 1.0]


def tensor(numbers: Any) -> Any:
    return torch.tensor(numbers, dtype=torch.float64, requires_grad=True)


def test_states_and_gradients_are_the_same() -> None:
    state, lengths, torque = tensor([1.0, 0.5, 0.0, 0.0]), tensor([1.0, 1.2]), tensor([0.3, -0.2])
    states = pendula.torch.simulate(CHAIN, TIMES, state, {"lengths": lengths, "torque": torque}, step=0.01)
    chain = pendula.Chain(masses=[1, 1], lengths=[1.0, 1.2], torque=[0.3, -0.2])
    plain = pendula.differentiate(chain, t=TIMES, start={"theta": [1.0, 0.5]}, step=0.01)
    assert np.array_equal(states.detach().numpy(), plain.y)
    weights = np.arange(8.0).reshape(4, 2)
    (states * torch.tensor(weights)).sum().backward()
    for given, by in (
        (state, plain.by_start),
        (lengths, plain.by_parameters["lengths"]),
        (torque, plain.by_inputs["torque"]),
    ):
        wanted = np.einsum("yt,tyk->k", weights, by)
        assert np.abs(given.grad.numpy() - wanted).max() < 1e-11 * np.abs(wanted).max()  # measured 2e-15


def test_gradients_pass_differences() -> None:
    def last(state: Any, lengths: Any) -> Any:
        return pendula.torch.simulate(CHAIN, TIMES, state, {"lengths": lengths}, step=0.01)

    assert torch.autograd.gradcheck(last, (tensor([1.0, 0.5, 0.0, 0.0]), tensor([1.0, 1.2])))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"state": [1.0, 0.5, 0.0, 0.0]}, "state: expected a tensor of torch.float64, got list"),
        ({"state": torch.zeros(4)}, "state: expected a tensor of torch.float64, got torch.float32"),
        ({"state": tensor([0.0] * 3)}, r"state: expected shape \(4,\), got \(3,\)"),
        ({"parameters": {"lengths": tensor([1.0])}}, "parameters.lengths: expected 2 numbers, got 1"),
        ({"t": [1.0, 0.5]}, "t: expected a vector of times from 0 on, ascending"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(pendula.InputError, match=message):
        pendula.torch.simulate(CHAIN, **{"t": TIMES, "state": tensor([0.0] * 4), **arguments})
