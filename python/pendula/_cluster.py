"""Ensembles on the workers of a dask.distributed cluster."""

from __future__ import annotations

import functools
import importlib
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _core
from ._core import InputError
from ._functions import kept_model
from ._runs import RunFailed, missing, places, plainly, tell

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Chunk = tuple[NDArray[Any], list[tuple[int, str]]]


class Work(NamedTuple):
    """The data from which a worker makes an ensemble."""

    text: str
    name: str
    overrides: tuple[str, ...]
    model: str  # text of the model's file; empty if there is none
    program: tuple[str, str]  # version and instruction set, which decide the last bits

    @classmethod
    def of(cls, made: _core.Ensemble, text: str, name: str, overrides: list[str]) -> Work:
        return cls(text, name, tuple(overrides), made.model, _program())

    def make(self) -> _core.Ensemble:
        if _program() != self.program:
            raise InputError(
                f"client: expected workers with pendula {' for '.join(self.program)}, got {' for '.join(_program())} "
                "(PENDULA_ARCH=avx2 in the environment of all holds them to what each of them can)"
            )
        overrides = list(self.overrides)
        if self.model:  # the worker may not have the file
            overrides.append(f'system.model="{kept_model("model", self.model)}"')
        with plainly():
            return _core.Ensemble(self.text, self.name, overrides, "", *places(), tell)


def _program() -> tuple[str, str]:
    return _core.version(), _core.instruction_set()


_one_at_a_time = threading.Lock()
_made = functools.lru_cache(maxsize=2)(Work.make)


def _move(work: Work, chunk: int) -> Chunk:
    """Runs on a worker."""
    with _one_at_a_time:
        made = _made(work)
    return made.chunk(chunk)


def move(made: _core.Ensemble, work: Work, client: Any, shown: Callable[[int], None] | None) -> None:
    """Lets the workers of a cluster move all members. Chunks of a worker that dies are moved again by others."""
    try:
        distributed = importlib.import_module("distributed")
    except ImportError as error:
        raise missing("dask", error) from None
    if not hasattr(client, "submit") or getattr(client, "asynchronous", False):
        kind = "an asynchronous one" if hasattr(client, "submit") else type(client).__name__
        raise InputError(f"client: expected a Client of dask.distributed that waits, got {kind}")
    # The work is a task of its own, so that the scheduler can make it again if the workers that had it are gone.
    known = client.submit(Work, *work, pure=False)
    futures = {client.submit(_move, known, k, pure=False): k for k in range(made.chunks)}
    done = 0
    try:
        for future in distributed.as_completed(list(futures)):
            rows, messages = future.result()
            made.add(futures.pop(future), rows, messages)
            done += len(rows)
            if shown:
                shown(done)
    except distributed.KilledWorker as error:
        raise RunFailed(f"client: {error}") from None
    finally:
        client.cancel([*futures, known])
