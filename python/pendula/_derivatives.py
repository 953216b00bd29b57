"""Derivatives of motions with respect to the start, parameters and inputs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import _core
from ._core import InputError
from ._gradient import Varied
from ._linear import LinearSystem
from ._runs import duration_of, plainly, positive, quantity, state_names, warn
from ._simulation import Beginning, Simulation, split
from ._systems import System, ascending_times, span_of, starts_of, system_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._linear import Outputs


class Derivatives(NamedTuple):
    """A motion, and the exact derivatives of its discrete steps; step sizes are held fixed.

    The time of an event that ends the motion depends on the start, by the equations of motion there, to the accuracy of
    the steps. The derivatives of the last row include that of its time.
    """

    t: NDArray[np.float64]  #: (rows,) times, in s
    y: NDArray[np.float64]  #: (coordinates + rates, rows), in the order of ``names``
    names: list[str]  #: what the rows of ``y`` are
    by_start: NDArray[np.float64]  #: (rows, coordinates + rates, coordinates + rates)
    by_parameters: dict[str, NDArray[np.float64]]  #: by name: (rows, coordinates + rates, numbers of it)
    by_inputs: dict[str, NDArray[np.float64]]  #: the same; inputs are varied by constants
    time_by_start: NDArray[np.float64]  #: (coordinates + rates,) of the last time; zeros without an event
    time_by_parameters: dict[str, NDArray[np.float64]]  #: by name: (numbers of it,)
    time_by_inputs: dict[str, NDArray[np.float64]]  #: the same


def differentiate(
    system: System,
    duration: float | str | None = None,
    *,
    t: ArrayLike | None = None,
    start: Mapping[str, object] | None = None,
    until: str | None = None,
    direction: str = "both",
    tolerance: float | None = None,
    step: float | None = None,
    **options: object,
) -> Derivatives:
    """Moves a system, and differentiates its motion with respect to the start, parameters and inputs.

    Parameters
    ----------
    system : Chain or Model
    duration : float, optional
        In s; the last of the times ``t`` if left out.
    t : array_like, optional
        Times of the rows, in s, from 0 on, at which steps end; if left out, the duration alone.
    start : mapping, optional
        As for :meth:`Chain.simulate`, as keyword arguments, too. Where parameters vary, coordinates and rates of the
        start are held fixed, even if momenta are given. Of a model with constraints, derivatives by a start are those
        by the nearest one that keeps the constraints.
    until : str, optional
        An expression of ``t``, coordinates, rates and points that does not jump. The last row is where it first crosses
        zero.
    direction : {"both", "up", "down"}
        The direction in which it crosses zero.
    tolerance, step : float, optional
        As for :class:`Simulation`.
    method, stages, solver, iteration
        As ``[run]`` of a scenario: Gauss or Radau steps, in momentum form, or "taylor", of models and of chains with a
        kernel.

    Returns
    -------
    Derivatives

    Raises
    ------
    InputError
        An argument is wrong, or rows are at a pole of (theta, phi).
    RuntimeError
        With ``until``, for a chain of more links than this build has kernels for.
    RunFailed
        The computation failed.

    Examples
    --------
    >>> import numpy, pendula
    >>> chain = pendula.Chain(masses=[1, 2])
    >>> moved = pendula.differentiate(chain, 1.0, start={"theta": [1.0, 0.5]}, step=0.01)
    >>> moved.by_start.shape, moved.by_parameters["lengths"].shape
    ((1, 4, 4), (1, 4, 2))
    >>> round(float(numpy.linalg.det(moved.by_start[0])), 9) > 0
    True
    """
    given, runs = split(differentiate, system, start, options)
    if direction not in ("both", "up", "down"):
        raise InputError(f'direction: expected "both", "up" or "down", got {direction!r}')
    made = Beginning.of(system, given, tolerance=tolerance, step=step, options=runs).prepare()
    times = _times(duration, t, made)
    varied = Varied(made)
    warn(made.warnings, stacklevel=3)
    if until is not None:
        _slopes(made, until, made.time, made.start)
        event = {"when": until, "direction": direction, "stop": True}
        found = system.simulate(
            float(times[-1]),
            start=given,
            events={"until": event},
            tolerance=1e-9 if tolerance is None and step is None else tolerance,
            step=step,
            estimate=False,
            **runs,  # type: ignore[arg-type]
        )
        if found.status != 1:
            raise InputError(
                f"until: expected {until} to cross zero within {times[-1]:.6g} s, got no crossing"
            )
        times = np.append(times[times < found.t[-1]], found.t[-1])
    size = made.start.size
    seeds = np.eye(size + varied.count)
    with plainly():
        states, flat = _core.forward(
            made, made.time, made.start, made.time + times, seeds[:size].copy(), seeds[size:].copy()
        )
    by_all = flat.reshape(times.size, size, size + varied.count)
    of_time = np.zeros(size + varied.count)
    if until is not None:
        of_time = _at_event(made, until, float(made.time + times[-1]), states[-1], by_all[-1])
    by_parameters, by_inputs = varied.by_name(by_all[:, :, size:])
    time_by_parameters, time_by_inputs = varied.by_name(of_time[size:])
    return Derivatives(
        times,
        states.T,
        state_names(made),
        by_all[:, :, :size],
        by_parameters,
        by_inputs,
        of_time[:size],
        time_by_parameters,
        time_by_inputs,
    )


def linearize(
    system: System,
    start: Mapping[str, object] | None = None,
    *,
    step: float | str | None = None,
    tolerance: float | None = None,
    outputs: Outputs | None = None,
    **starts: object,
) -> LinearSystem:
    """The exact linearisation at a state.

    Parameters
    ----------
    system : Chain or Model
    start : mapping, optional
        Coordinates and rates, as for :meth:`Chain.simulate`, as keyword arguments, too; what is left out is 0.
    step : float, optional
        In s: the discrete system, from one time to the next, while inputs are held.
    tolerance : float, optional
        Of the steps inside one, as for :class:`Simulation`.
    outputs : sequence of str or mapping, optional
        The measured quantities: columns of a row or expressions of them, ``["x_2", "theta_2 - theta_1"]``, or these by
        name, ``{"bend": "theta_2 - theta_1"}``. By default all points.

    Returns
    -------
    LinearSystem
        For deviations from the state: ``A, B = pendula.linearize(…)``. It also has C and D, frequencies and damping.

    Raises
    ------
    InputError, RuntimeError
        As :meth:`Simulation.linearize`.

    Examples
    --------
    >>> import pendula
    >>> A, B = pendula.linearize(pendula.Chain(links=1), {"theta": 0.0}, step=0.1)
    >>> A.shape, B.shape
    ((2, 2), (2, 1))
    >>> hanging = pendula.linearize(pendula.Chain(links=1))
    >>> hanging.outputs, hanging.C.tolist()
    (['x_1', 'y_1'], [[1.0, 0.0], [0.0, 0.0]])
    >>> hanging.frequencies.round(4).tolist()  # in Hz
    [0.4985, 0.4985]
    """
    system = system_of(system)
    given = starts_of("linearize", system, start, starts, linearize.__kwdefaults__ or ())
    simulation = Simulation(system, {**system.at_zero(), **given})
    if step is None:
        if tolerance is not None:
            raise InputError("tolerance: expected none without step, got one")
        return simulation.linearize(outputs)
    length = positive("step", quantity("step", step, simulation._made))
    moved = differentiate(system, length, start={**system.at_zero(), **given}, tolerance=tolerance)
    by_inputs = [moved.by_inputs[name][0] for name in moved.by_inputs]
    b = np.hstack([np.empty((moved.y.shape[0], 0)), *by_inputs])
    told = simulation._seen(outputs)
    rows = [*map(state_names(simulation._made).index, told["names"])]
    return LinearSystem(moved.by_start[0][rows] @ told["basis"], b[rows], step=length, **told)


def _times(duration: object, t: ArrayLike | None, made: _core.Prepared) -> NDArray[np.float64]:
    times, end = span_of("differentiate", duration, t)
    if times is None:
        return np.array([duration_of(end, made)])
    if duration is not None:
        raise InputError("duration: expected none beside t, got both")
    return ascending_times(times)


def _slopes(
    made: _core.Prepared, until: object, time: float, state: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The derivatives of an expression with respect to time and state. Raises InputError."""
    if not isinstance(until, str):
        raise InputError(f"until: expected an expression, got {type(until).__name__}")
    try:
        return _core.gradient(made, until, time, state)
    except (ValueError, RuntimeError) as error:
        raise InputError(f"until: {error}") from None


def _at_event(
    made: _core.Prepared, until: str, time: float, state: NDArray[np.float64], by_all: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The derivative of the time of an event; adds its effect to the derivatives of the state there.

    With g the expression, f the field and Phi the derivative at that time: dt = -(g_x Phi) / (g_x f + g_t).
    """
    slopes = _slopes(made, until, time, state)
    with plainly():
        field = _core.field(made, time, state)
    speed = slopes[0] + slopes[1:] @ field
    if speed == 0:
        raise InputError(f"until: expected {until} to cross zero, got one that only touches it")
    of_time: NDArray[np.float64] = -(slopes[1:] @ by_all) / speed
    by_all += np.outer(field, of_time)
    return of_time
