"""Environments for reinforcement learning, in Gymnasium's interface (`pip install pendula[gym]`).

>>> import gymnasium, pendula.envs
>>> env = gymnasium.make("pendula/CartPendulum-v0", links=2)
>>> observation, info = env.reset(seed=1)
>>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
>>> observation.shape
(8,)

All environments have in common:

action
    One number from -1 to 1 for each motor, times the largest force or torque; larger numbers are clipped. It is held
    for ``step`` seconds, in which pendula takes adaptive steps, by ``tolerance``.
observation
    Coordinates that are no angles, the sines of the angles, their cosines, the rates. The angle of each link is from
    the downward vertical. All are within the observation space: a state outside ends the episode, and its observation
    is clipped. ``info["state"]`` has coordinates and rates as they are, in 64 bits.
reward
    (1 + h) / 2 of each step, where h is the height of the last bob over the pivot, divided by the length of all links:
    0 where the chain hangs, 1 where it stands.
task
    "swing_up": it starts hanging. "balance": it starts upright, and the episode ends when h is below 0.8. Each
    coordinate and rate differs by up to 0.05 in m, rad, m/s, rad/s: uniform numbers from the seed, reproducible to the
    last bit.
start
    ``reset(options={"start": {"theta": [0.1, "5 deg"]}})`` starts exactly there, with the names of
    :meth:`pendula.Chain.simulate`; others are 0.
time
    ``gymnasium.make`` and ``make_vec`` make environments that are truncated after 500 steps.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._core import InputError
from ._derivatives import differentiate
from ._models import Model
from ._runs import mapping, numbers, plainly, positive, require_known, whole
from ._simulation import Simulation
from ._systems import Chain, System

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.utils.seeding import np_random
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as _error:
    raise ImportError("pendula.envs: expected Gymnasium, got none; pip install 'pendula[gym]'") from _error

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

NOISE = 0.05  # of starts, in m, rad, m/s, rad/s
FALLEN = 0.8  # of the height where it stands


class Pendulum(gymnasium.Env[Any, Any]):
    """The abstract base class of the environments :class:`CartPendulum` and :class:`Acrobot`."""

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  (as Gymnasium has it)
    observation_space: gymnasium.Space[NDArray[Any]]
    action_space: gymnasium.Space[NDArray[Any]]

    def __init__(
        self,
        system: System,
        lengths: ArrayLike,
        *,
        links: int,
        motors: int,
        limits: Sequence[float],
        speed_limit: float,
        task: str,
        step: float,
        tolerance: float,
        dtype: Any,
    ) -> None:
        if task not in ("swing_up", "balance"):
            raise InputError(f'task: expected "swing_up" or "balance", got {task!r}')
        if getattr(dtype, "__name__", str(dtype)) not in ("float32", "float64"):
            raise InputError(f"dtype: expected float32 or float64, got {dtype!r}")
        self._step, self._tolerance = positive("step", step), positive("tolerance", tolerance)
        self._system, self._task, self._links, self._motors = system, task, links, motors
        self._state: NDArray[np.float64] | None = None
        self._members = self._made_members()  # raises errors of the system now
        each = np.broadcast_to(numbers("lengths", lengths), (links,))
        self._share = np.ascontiguousarray(each / each.sum())  # of each link in the height
        places = np.array([*limits, *[np.inf] * links])
        self._limits = np.concatenate([places, np.full(places.size, positive("speed_limit", speed_limit))])
        seen = np.concatenate([[*limits], np.ones(2 * links), self._limits[places.size :]]).astype(dtype)
        one = np.ones(motors, dtype)
        self.observation_space = self._seeable = Box(-seen, seen, dtype=dtype)
        self.action_space = Box(-one, one, dtype=dtype)

    def _made_members(self) -> _core.HeldMembers:
        return _core.HeldMembers(self._started(self._system.at_zero())._made, self._step)

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_members"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._members = self._made_members()

    @abstractmethod
    def _inputs(self, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        """(…, motors) -> (…, inputs), in N or N m; linear, number by number, so that batches do not change bits."""

    @abstractmethod
    def _held(self, inputs: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        """Inputs by their names."""

    @property
    def state(self) -> NDArray[np.float64]:
        """The state, in 64 bits: x, theta_1, ..., x_dot, theta_dot_1, ...; an acrobot has no x."""
        return self._now().copy()

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Starts an episode: at a random state, or at ``options["start"]``. Raises InputError."""
        super().reset(seed=seed)
        self._state = self._begun(self.np_random, options)
        return self._seen(self._state[None])[0], {"state": self.state}

    def step(self, action: ArrayLike) -> tuple[NDArray[Any], float, bool, bool, dict[str, Any]]:
        """Holds an action for a step. Raises InputError; RunFailed if the computation fails."""
        inputs = self._inputs(self._acted(action, (self._motors,)))
        states = self._moved(inputs[None], self._now()[None])
        self._state = states[0]
        heights = self._heights(states)
        over = self._over(states, heights)
        return self._seen(states)[0], float((1 + heights[0]) / 2), bool(over[0]), False, {"state": self.state}

    def linearize(
        self, action: ArrayLike | None = None, state: ArrayLike | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """A and B of a step, x_next = A x + B a for deviations x of the state and a of the action, which is held.

        They are exact for the steps that a new :class:`pendula.Simulation` takes inside that one. Nothing moves.

        Parameters
        ----------
        action : (motors,) array_like, optional
            0 if left out.
        state : (2n,) array_like, optional
            As :attr:`state`; by default the present one.

        Returns
        -------
        A : (2n, 2n) array
        B : (2n, motors) array

        Raises
        ------
        InputError
            An argument is wrong.
        RunFailed
            The computation failed.
        """
        place = self.state if state is None else numbers("state", state)
        if place.shape != self._limits.shape or not np.isfinite(place).all():
            raise InputError(f"state: expected finite numbers of shape {self._limits.shape}, got {state!r}")
        wanted = np.zeros(self._motors) if action is None else action
        inputs = self._inputs(self._acted(wanted, (self._motors,)))
        found = differentiate(
            self._system.replaced({}, self._held(inputs)),
            self._step,
            start=self._named(place),
            tolerance=self._tolerance,
        )
        by_inputs = np.hstack([found.by_inputs[name][0] for name in self._held(inputs)])
        return found.by_start[0], by_inputs @ self._inputs(np.eye(self._motors)).T

    # The following take many states at once, (members, 2n). The result for each is that of the state alone, bit by bit.

    def _seen(self, states: NDArray[np.float64]) -> NDArray[Any]:
        angles = np.ascontiguousarray(states[:, self._angles()])
        first, rates = states[:, : self._angles().start], states[:, states.shape[1] // 2 :]
        seen = np.concatenate([first, np.sin(angles), np.cos(angles), rates], axis=1)
        space = self._seeable
        cut: NDArray[Any] = np.clip(seen.astype(space.dtype), space.low, space.high)
        return cut

    def _heights(self, states: NDArray[np.float64]) -> NDArray[np.float64]:
        cosines = np.cos(np.ascontiguousarray(states[:, self._angles()]))
        heights = np.zeros(len(states))
        for k, share in enumerate(self._share):
            heights -= share * cosines[:, k]
        return np.clip(heights, -1, 1)

    def _over(self, states: NDArray[np.float64], heights: NDArray[np.float64]) -> NDArray[np.bool_]:
        fallen = heights < FALLEN if self._task == "balance" else np.zeros(len(states), bool)
        return self._is_outside(states) | fallen

    def _is_outside(self, states: NDArray[np.float64]) -> NDArray[np.bool_]:
        outside: NDArray[np.bool_] = np.any(np.abs(states) > self._limits, axis=-1)
        return outside

    def _acted(self, actions: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
        found = numbers("action", actions)
        if found.shape != shape or not np.isfinite(found).all():
            raise InputError(f"action: expected finite numbers of shape {shape}, got {actions!r}")
        return np.clip(found, -1, 1)

    def _angles(self) -> slice:
        count = self._limits.size // 2
        return slice(count - self._links, count)

    def _named(self, state: NDArray[np.float64]) -> dict[str, object]:
        """Coordinates and rates by name, as the start of a simulation."""
        places, rates = np.split(state, 2)
        own = places.size - self._links
        named: dict[str, object] = {
            "theta": places[own:].tolist(),
            "theta_dot": rates[own:].tolist(),
        }
        return {**named, "x": float(places[0]), "x_dot": float(rates[0])} if own else named

    def _started(self, start: Mapping[str, object]) -> Simulation:
        return Simulation(self._system, start, tolerance=self._tolerance, remember=False)

    def _begun(self, random: np.random.Generator, options: dict[str, Any] | None) -> NDArray[np.float64]:
        """The state that an episode starts in."""
        given = mapping("options", options)
        start = given.pop("start", None)
        if given:
            raise InputError(f"options: expected start alone, got {', '.join(given)}")
        if start is None:
            state: NDArray[np.float64] = random.uniform(-NOISE, NOISE, self._limits.size)
            if self._task == "balance":
                state[self._angles()] += np.pi
            return state
        begun = self._started({**self._system.at_zero(), **mapping("options.start", start)})
        if self._is_outside(begun.state):
            limits = zip(begun.names, self._limits, begun.state, strict=True)
            raise InputError(
                "options.start: "
                + ", ".join(
                    f"expected |{name}| <= {limit:g}, got {one:g}"
                    for name, limit, one in limits
                    if abs(one) > limit
                )
            )
        return begun.state

    def _now(self) -> NDArray[np.float64]:
        if self._state is None:
            raise gymnasium.error.ResetNeeded("expected reset() first, got none")
        return self._state

    def _moved(self, inputs: NDArray[np.float64], states: NDArray[np.float64]) -> NDArray[np.float64]:
        """The states one step later, each with its row of inputs held."""
        with plainly():
            return self._members.move(np.ascontiguousarray(inputs), np.ascontiguousarray(states))


class CartPendulum(Pendulum):
    """A planar chain on a cart that a motor pushes: swing it up, or balance it.

    Parameters
    ----------
    links : int
    force : float
        The largest force of the motor, in N.
    track : float
        The largest distance of the cart from the middle, in m.
    task : {"swing_up", "balance"}
    step : float
        The time for which an action is held, in s.
    tolerance : float
        The tolerance of the steps inside, as for :class:`pendula.Simulation`.
    speed_limit : float
        The largest speed of the cart, in m/s, and of the links, in rad/s.
    dtype : {float64, float32}
        The type of observations and actions.
    parameters
        Parameters of the built-in model ``cart_chain``: ``masses``, ``lengths``, ``damping``, ``cart_mass``,
        ``cart_friction``, ``gravity``.

    Examples
    --------
    >>> import pendula.envs
    >>> env = pendula.envs.CartPendulum(links=1)
    >>> _ = env.reset(options={"start": {"theta": "180 deg"}})
    >>> A, B = env.linearize()
    >>> A.shape, B.shape
    ((4, 4), (4, 1))
    """

    def __init__(
        self,
        links: int = 1,
        *,
        force: float = 30.0,
        track: float = 2.4,
        task: str = "swing_up",
        step: float = 0.02,
        tolerance: float = 1e-9,
        speed_limit: float = 50.0,
        dtype: type[np.float64 | np.float32] = np.float64,
        **parameters: Any,
    ) -> None:
        self._force = positive("force", force)
        super().__init__(
            Model("cart_chain", whole("links", links, 1), **parameters),
            parameters.get("lengths", 1.0),
            links=links,
            motors=1,
            limits=(positive("track", track),),
            speed_limit=speed_limit,
            task=task,
            step=step,
            tolerance=tolerance,
            dtype=dtype,
        )

    def _inputs(self, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        return self._force * actions

    def _held(self, inputs: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        return {"push": inputs}


class Acrobot(Pendulum):
    """A planar chain with a motor in each joint but the first: swing it up, or balance it.

    The motor between two links turns the outer one by its torque, and the inner one by as much the other way.

    Parameters
    ----------
    links : int
        At least 2.
    torque : float
        The largest torque of each motor, in N m.
    task, step, tolerance, speed_limit, dtype
        As for :class:`CartPendulum`.
    parameters
        ``masses``, ``lengths``, ``damping`` and ``gravity`` of :class:`pendula.Chain`.
    """

    def __init__(
        self,
        links: int = 2,
        *,
        torque: float = 10.0,
        task: str = "swing_up",
        step: float = 0.02,
        tolerance: float = 1e-9,
        speed_limit: float = 50.0,
        dtype: type[np.float64 | np.float32] = np.float64,
        **parameters: Any,
    ) -> None:
        self._torque = positive("torque", torque)
        require_known("parameters", parameters, ("masses", "lengths", "damping", "gravity"))
        super().__init__(
            Chain(links=whole("links", links, 2), **parameters),
            parameters.get("lengths", 1.0),
            links=links,
            motors=links - 1,
            limits=(),
            speed_limit=speed_limit,
            task=task,
            step=step,
            tolerance=tolerance,
            dtype=dtype,
        )

    def _inputs(self, actions: NDArray[np.float64]) -> NDArray[np.float64]:
        none = np.zeros((*actions.shape[:-1], 1))
        return self._torque * -np.diff(np.concatenate([none, actions, none], axis=-1), axis=-1)

    def _held(self, inputs: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
        return {"torque": inputs}


class PendulumVectorEnv(VectorEnv[Any, Any, Any]):
    """Many environments of one kind. Each moves as a single one with its seed, to the last bit.

    They move side by side in the lanes of one core.

    Parameters
    ----------
    num_envs : int
    max_episode_steps : int, optional
        The number of steps after which an episode is truncated; by default never.
    autoreset_mode : gymnasium.vector.AutoresetMode or str
        "NextStep", "SameStep" or "Disabled", as Gymnasium has them; ``reset(options={"reset_mask": ...})`` resets some.
    options
        As for a single environment.
    """

    single: type[Pendulum]
    metadata: dict[str, Any]
    num_envs: int
    observation_space: gymnasium.Space[NDArray[Any]]
    action_space: gymnasium.Space[NDArray[Any]]
    single_observation_space: gymnasium.Space[NDArray[Any]]
    single_action_space: gymnasium.Space[NDArray[Any]]

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_episode_steps: int | None = None,
        autoreset_mode: AutoresetMode | str = "NextStep",
        **options: Any,
    ) -> None:
        super().__init__()
        if autoreset_mode not in (*AutoresetMode, *(mode.value for mode in AutoresetMode)):
            told = ", ".join(f'"{mode.value}"' for mode in AutoresetMode)
            raise InputError(f"autoreset_mode: expected one of {told}, got {autoreset_mode!r}")
        self._mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.single.metadata, "autoreset_mode": self._mode}
        self.num_envs = whole("num_envs", num_envs, 1)
        self._most = None if max_episode_steps is None else whole("max_episode_steps", max_episode_steps, 1)
        self._one = first = self.single(**options)
        self._randoms: list[np.random.Generator | None] = [None] * num_envs
        self._states: NDArray[np.float64] | None = None
        self.single_observation_space, self.single_action_space = first.observation_space, first.action_space
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)
        self._elapsed = np.zeros(num_envs, int)
        self._done = np.zeros(num_envs, bool)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[Any], dict[str, Any]]:
        """Starts episodes: of all environments, or where ``options["reset_mask"]`` is true.

        A single seed is that of the first environment; the others have the following seeds. Raises InputError.
        """
        count = self.num_envs
        seeds = [None if seed is None else seed + k for k in range(count)] if _is_one(seed) else list(seed)  # type: ignore[arg-type, operator]
        if len(seeds) != count:
            raise InputError(f"seed: expected {count} seeds, got {len(seeds)}")
        given = mapping("options", options)
        mask = np.asarray(given.pop("reset_mask", np.ones(count, bool)))
        if mask.shape != (count,) or mask.dtype != np.bool_ or not mask.any():
            raise InputError(f"options.reset_mask: expected ({count},) of bool, some true, got {mask!r}")
        if self._states is None:
            if not mask.all():
                raise gymnasium.error.ResetNeeded("expected reset() of all first, got none")
            self._states = np.empty((count, self._one._limits.size))
        begun = {k: self._begin(k, seeds[k], given) for k in np.flatnonzero(mask).tolist()}
        for k, state in begun.items():  # all or none
            self._states[k] = state
        self._elapsed[mask], self._done[mask] = 0, False
        return self._one._seen(self._states), _told(self._states, mask)

    def step(
        self, actions: ArrayLike
    ) -> tuple[NDArray[Any], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Holds an action for each, (num_envs, motors). Raises InputError; RunFailed if the computation fails."""
        one = self._one
        inputs = one._inputs(one._acted(actions, (self.num_envs, one._motors)))
        if self._states is None:
            raise gymnasium.error.ResetNeeded("expected reset() first, got none")
        begun = self._done.copy()
        if begun.any() and self._mode == AutoresetMode.DISABLED:
            over = ", ".join(map(str, np.flatnonzero(begun)))
            raise InputError(f"step: expected reset with reset_mask of what is over, got none of {over}")
        if begun.any():
            states = self._states.copy()
            states[~begun] = one._moved(inputs[~begun], states[~begun])
            for k in np.flatnonzero(begun).tolist():
                states[k] = self._begin(k)
        else:
            states = one._moved(inputs, self._states)
        self._elapsed = np.where(begun, 0, self._elapsed + 1)
        heights = one._heights(states)
        rewards = np.where(begun, 0.0, (1 + heights) / 2)
        terminated = one._over(states, heights) & ~begun
        truncated = np.zeros(self.num_envs, bool) if self._most is None else self._elapsed >= self._most
        self._done = terminated | truncated
        seen = one._seen(states)
        infos: dict[str, Any] = {}
        if self._mode == AutoresetMode.SAME_STEP and self._done.any():
            for ended in np.flatnonzero(self._done).tolist():
                last = {"final_obs": seen[ended].copy(), "final_info": {"state": states[ended].copy()}}
                infos = self._add_info(infos, last, ended)
                states[ended] = self._begin(ended)
            self._elapsed[self._done] = 0
            seen = one._seen(states)
            self._done = np.zeros(self.num_envs, bool)
        self._states = states
        return seen, rewards, terminated, truncated, {**infos, **_told(states, np.ones(self.num_envs, bool))}

    def _begin(
        self, k: int, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> NDArray[np.float64]:
        """The start of an episode of environment k: the same as of a single one with its seed."""
        random = self._randoms[k]
        if random is None or seed is not None:
            random = self._randoms[k] = np_random(seed)[0]
        return self._one._begun(random, options)


class CartPendulumVectorEnv(PendulumVectorEnv):
    """Many of :class:`CartPendulum`."""

    single: type[Pendulum] = CartPendulum


class AcrobotVectorEnv(PendulumVectorEnv):
    """Many of :class:`Acrobot`."""

    single: type[Pendulum] = Acrobot


def _is_one(seed: object) -> bool:
    return seed is None or isinstance(seed, (int, np.integer))


def _told(states: NDArray[np.float64], mask: NDArray[np.bool_]) -> dict[str, Any]:
    """The infos of a vector environment: states, and a mask of the environments that have one."""
    return {"state": np.where(mask[:, None], states, 0.0), "_state": mask.copy()}


for _name in ("CartPendulum", "Acrobot"):
    gymnasium.register(
        f"pendula/{_name}-v0",
        entry_point=f"pendula.envs:{_name}",
        vector_entry_point=f"pendula.envs:{_name}VectorEnv",
        max_episode_steps=500,
    )
