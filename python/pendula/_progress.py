"""Progress of long runs and ensembles."""

from __future__ import annotations

import importlib.util
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from ._runs import missing


def _is_watched() -> bool:
    """Whether output is seen: on a terminal, or in a notebook."""
    return "ipykernel" in sys.modules or (sys.stderr is not None and sys.stderr.isatty())


def _tqdm() -> Any:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # in notebooks without ipywidgets it draws with text
        from tqdm.auto import tqdm  # type: ignore[import-untyped]
    return tqdm


@contextmanager
def bar(duration: object, wanted: bool | None) -> Iterator[Callable[[float], None] | None]:
    """Yields a function to call with the present time of a run, in s; None if no bar is wanted.

    Raises ImportError if it is wanted and tqdm is not installed.
    """
    if wanted is None:
        wanted = _is_watched() and importlib.util.find_spec("tqdm") is not None
    if not wanted:
        yield None
        return
    try:
        tqdm = _tqdm()
    except ImportError as error:
        raise missing("progress", error) from None
    total = duration if isinstance(duration, (int, float)) else None
    shown: list[Any] = []

    def told(time: float) -> None:
        if not shown:
            shown.append(tqdm(total=total, unit="s", leave=False, bar_format=_BAR if total else _TIME))
        shown[0].update(time - shown[0].n)

    try:
        yield told
    finally:
        for one in shown:
            one.close()


_BAR = "{l_bar}{bar}| t = {n:.4g} of {total:.4g} [{elapsed}<{remaining}]"
_TIME = "t = {n:.4g} [{elapsed}]"


@contextmanager
def progress_line(wanted: bool, members: int) -> Iterator[Callable[[int], None] | None]:
    """Yields a function to call with the number of members done; it shows a bar of tqdm, else a line."""
    if not wanted:
        yield None
        return
    try:
        tqdm = _tqdm()
    except ImportError:
        began = time.monotonic()

        def show(done: int) -> None:
            rate = done / max(time.monotonic() - began, 1e-3)
            print(f"\r{done} of {members} members, {rate:.0f} a second", end="", file=sys.stderr, flush=True)

        try:
            yield show
        finally:
            print(file=sys.stderr)
        return
    with tqdm(total=members, unit=" members") as one:

        def draw(done: int) -> None:
            one.update(done - one.n)

        yield draw
