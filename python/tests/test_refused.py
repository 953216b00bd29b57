"""Wrong arguments are refused: the message names the argument, what was expected and what was got."""

import re
import tempfile
from pathlib import Path

import numpy as np
import pendula
import pytest

CHAIN = pendula.Chain(links=2)
CART = pendula.Model("cart_chain")
SIMULATION = pendula.Simulation(CART, {"theta": 0.1})
RUN = CHAIN.simulate(0.1, theta=1.0, step=0.01)
FOLDER = Path(tempfile.gettempdir())
NAN = float("nan")
MASKED = np.ma.masked_array([1.0, 2.0], [True, False])


def simulate(**given):
    return lambda: CHAIN.simulate(given.pop("duration", 0.1), **{"theta": 1.0, **given})


def chain(**given):
    return lambda: pendula.Chain(**given).simulate(0.1, theta=1.0)


def model(*names, **given):
    return lambda: pendula.Model(*names, **given).simulate(0.1)


# What is called, the argument, and what the message says that it got.
REFUSED = {
    # shapes
    "theta of three": (simulate(theta=[1, 2, 3]), "theta", r"\[1, 2, 3\]"),
    "theta of two axes": (simulate(theta=np.ones((2, 2))), "theta", "list|array|1"),
    "times of two axes": (simulate(t=[[0, 1]]), "t", r"shape \(1, 2\)"),
    "no times": (simulate(t=[]), "t", r"shape \(0,\)"),
    "ragged times": (simulate(t=[[0], [0, 1]]), "t", "inhomogeneous"),
    "lengths of three": (chain(masses=[1, 1], lengths=[1, 1, 1]), "lengths", "3|1, 1, 1"),
    "damping of three": (chain(masses=[1, 1], damping=[1, 1, 1]), "damping", "3|1, 1, 1"),
    "times in sol": (lambda: RUN.sol([[0.1]]), "t", r"shape \(1, 1\)"),
    "times after the end": (lambda: RUN.sol(7.0), "t", "7.0"),
    # numbers that are none
    "NaN": (simulate(theta=NAN), "theta", "nan"),
    "infinity": (simulate(theta=[0.1, np.inf]), "theta", "inf"),
    "NaN as mass": (chain(masses=[1, NAN]), "masses", "nan"),
    "NaN among times": (simulate(t=[0, NAN]), "t", "nan"),
    "NaN as duration": (simulate(duration=NAN), "duration", "nan"),
    "NaN as input": (lambda: CART.simulate(0.1, inputs={"push": NAN}), "inputs.push", "nan"),
    "NaN in sol": (lambda: RUN.sol(NAN), "t", "nan"),
    "NaN to go on to": (lambda: RUN.go_on(NAN), "duration", "nan"),
    "NaN held": (lambda: SIMULATION.hold(push=NAN), "push", "nan"),
    # signs
    "negative duration": (simulate(duration=-1.0), "duration", "-1"),
    "negative step": (simulate(step=-0.1), "step", "-0.1"),
    "negative mass": (chain(masses=[1, -1]), "masses", "-1"),
    "no rows": (simulate(every=0), "every", "0"),
    "decreasing times": (simulate(t=[0, 2, 1]), "t", r"2"),
    # names
    "unknown start": (simulate(thet=1.0), "thet", "unknown key.*did you mean theta"),
    "unknown space": (chain(space="plane"), "space", "plane"),
    "unknown method": (simulate(method="euler"), "method", "euler"),
    "unknown units": (chain(links=2, units="metric"), "units", "metric"),
    "unknown model": (model("no_such_model"), "model", "no_such_model"),
    "unknown file": (model("no_such_model.py"), "model", "no_such_model.py"),
    "unknown parameter": (model("furuta", nothing=1.0), "nothing", "unknown key"),
    "unknown input": (lambda: CART.simulate(0.1, inputs={"pull": 1.0}), "input", "pull"),
    "unknown drive": (model("cart_chain", drives=[{"input": "pull"}]), r"drives\[0\].input", "pull"),
    "unknown keyword of a chain": (chain(length=1.0), "Chain", "length; did you mean lengths"),
    "unknown keyword of a model": (model("cart_chain", linkz=1), "Model", "linkz; did you mean links"),
    "unknown link": (
        chain(links=2, drives=[{"link": 3, "amplitude": 1, "frequency": 1}]),
        r"drives\[0\].link",
        "3",
    ),
    "unknown column": (simulate(events={"hit": "foo + 1"}), "events.hit.when", "foo"),
    "unknown column of some event": (
        simulate(events={"f": lambda t, y: 1, "hit": "foo"}),
        "events.hit.when",
        "foo",
    ),
    "unknown direction": (
        simulate(events={"hit": {"when": "theta_1", "direction": "left"}}),
        "events.hit.direction",
        "left",
    ),
    "unknown key": (lambda: pendula.Scenario("a.toml", {"run.step=0.1\n#": 1}), "set", "run.step"),
    # types
    "complex": (simulate(theta=1j), "start.theta", "complex"),
    "masked": (simulate(theta=MASKED), "start.theta", "mask"),
    "masked times": (simulate(t=MASKED), "t", "mask"),
    "objects": (simulate(theta=np.array([object(), 1])), "theta", "object"),
    "bytes": (simulate(theta=b"1"), "theta", "bytes"),
    "text as times": (simulate(t=["a", "b"]), "t", "U1"),
    "complex masses": (chain(masses=np.array([1j, 1])), "masses", "complex"),
    "truth": (simulate(theta=True), "theta", "true"),
    "start that is no mapping": (simulate(start=[1.0]), "start", "list"),
    "drives that are no list": (chain(drives={"link": 1}), "drives", "dict"),
    "events that are no mapping": (simulate(events=["theta_1"]), "events", "list"),
    "an event that is a number": (simulate(events={"hit": 5}), "events.hit", "int"),
    "a function as input": (
        lambda: CART.simulate(0.1, inputs={"push": lambda t: t}),
        "inputs.push",
        "function",
    ),
    "an input of a chain": (simulate(inputs={"push": 1.0}), "inputs", "push"),
    "a path of a number": (lambda: RUN.to_netcdf(FOLDER / "rows.csv"), "file", "rows.csv"),
    "a file of no format": (lambda: RUN.save(FOLDER / "rows.txt"), "rows.txt", ""),
    "a file that is not there": (lambda: pendula.open(FOLDER / "none.h5"), "none.h5", "not there"),
    "twice": (simulate(start={"theta": 1.0}), "theta", "twice"),
    "an event without a function": (simulate(events={"hit": {"direction": "up"}}), "when", "no such key"),
    "an event of no name": (simulate(events={"a b": lambda t, y: 1.0}), "events", "a b"),
    "a key of no event": (
        simulate(events={"hit": {"when": lambda t, y: 1.0, "end": True}}),
        "events.hit",
        "end",
    ),
    "seconds": (lambda: RUN.animate(seconds=-1), "seconds", "-1"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_wrong_arguments_are_refused(case):
    call, argument, got = REFUSED[case]
    with pytest.raises(pendula.InputError) as refused:
        call()
    sentence = str(refused.value)
    assert not sentence.startswith("pendula")
    assert re.search(argument, sentence), sentence
    assert "expected" in sentence or "unknown key" in sentence or "twice" in sentence, sentence
    assert re.search(got, sentence), sentence


class Foreign:
    """An array of another package."""

    def __init__(self, numbers):
        self.numbers = np.asarray(numbers)

    def __array__(self, dtype=None, copy=None):
        return self.numbers


class Lent:
    """One that is known by DLPack alone."""

    def __init__(self, numbers):
        self.numbers = np.asarray(numbers)

    def __dlpack__(self, **given):
        return self.numbers.__dlpack__(**given)

    def __dlpack_device__(self):
        return self.numbers.__dlpack_device__()


@pytest.mark.parametrize("kind", [Foreign, Lent, list, tuple, np.float32, np.asfortranarray])
def test_arrays_of_any_kind_are_taken(kind):
    theta = [0.5, 0.25]
    given = np.array(theta, dtype=np.float32) if kind is np.float32 else kind(theta)
    masses = np.array([1, 0, 2, 0])[::2]
    run = pendula.Chain(masses=masses).simulate(0.1, theta=given, step=0.01)
    assert np.array_equal(run.y, pendula.Chain(masses=[1, 2]).simulate(0.1, theta=theta, step=0.01).y)
