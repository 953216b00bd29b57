"""examples/bicycle.py against the linear equations that are published for it."""

import json

import numpy as np
import pytest
from conftest import EXAMPLES
from numpy.typing import NDArray

# M q'' + v C1 q' + (g K0 + v^2 K2) q = 0, q = (lean, steer), with 14 digits: J. P. Meijaard, J. M. Papadopoulos,
# A. Ruina, A. L. Schwab, Proc. R. Soc. A 463 (2007) 1955.
M = np.array([[80.81722, 2.31941332208709], [2.31941332208709, 0.29784188199686]])
C1 = np.array([[0.0, 33.86641391492494], [-0.85035641456978, 1.68540397397560]])
K0 = np.array([[-80.95, -2.59951685249872], [-2.59951685249872, -0.80329488458618]])
K2 = np.array([[0.0, 76.59734589573222], [0.0, 2.65431523794604]])


def published(speed: float) -> NDArray[np.complex128]:
    by_place, by_rate = 9.81 * K0 + speed**2 * K2, speed * C1
    return np.linalg.eigvals(
        np.block(
            [[np.zeros((2, 2)), np.eye(2)], [np.linalg.solve(M, -by_place), np.linalg.solve(M, -by_rate)]]
        )
    )


@pytest.mark.parametrize("speed", [0.0, 1.0, 3.0, 5.0, 8.0, 10.0])
def test_eigenvalues_are_the_published_ones(speed, pendula):
    """Near 6.024 m/s, where one of them is 0, rounding takes more of its digits."""
    keys = [f"--set=start.rear_x_dot={speed}", "--set=start.rear_lean_dot=0.0"]
    ended = pendula("linearize", EXAMPLES / "bicycle.toml", "--json", *keys)
    assert ended.returncode == 0, ended.stderr
    found = np.array([complex(*pair) for pair in json.loads(ended.stdout)["eigenvalues"]])
    # Six more are 0: where it is, where it is heading, how far its wheels have turned, and its speed, which stays.
    assert len(found) == 10 and sum(np.abs(found) < 1e-5) == 6  # measured up to 1.5e-7
    for truth in published(speed):
        assert np.abs(found - truth).min() < 1e-10 * abs(truth)  # measured up to 1.5e-11
