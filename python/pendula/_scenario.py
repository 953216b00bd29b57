"""Scenario files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _core, _toml
from ._core import InputError
from ._ensemble import move_members
from ._progress import bar
from ._runs import mapping, places, plainly, tell
from ._solution import Solution, concluded

if TYPE_CHECKING:
    import xarray


class Scenario:
    """A scenario file, run as by the command line.

    Parameters
    ----------
    file : path
    set : mapping, optional
        Keys to replace, ``{"run.step": 1e-4}``.
    """

    def __init__(self, file: str | PathLike[str], set: Mapping[str, object] | None = None) -> None:
        self.file: Path = Path(file)
        self._overrides = []
        for key, one in mapping("set", set).items():
            if not re.fullmatch(r"[A-Za-z_][\w.\[\]]*", key):
                raise InputError(f"set: expected a key of a scenario, such as run.step, got {key!r}")
            self._overrides.append(f"{key}={_toml.value(one, key)}")

    def __repr__(self) -> str:
        return f"Scenario({str(self.file)!r})"

    def run(self, *, progress: bool | None = None) -> Solution:
        """Runs the scenario, as :meth:`Chain.simulate`; equal to ``pendula simulate`` to the last bit."""
        text = self.file.read_text(encoding="utf-8")
        with bar(None, progress) as told, plainly():
            result = _core.simulate(text, str(self.file), self._overrides, [], told, *places(), tell)
        return concluded(result, in_file=True)

    def ensemble(
        self,
        *,
        threads: int = 0,
        file: str | PathLike[str] | None = None,
        shard: tuple[int, int] | None = None,
        resume: bool = False,
        client: Any = None,
        progress: bool = False,
    ) -> xarray.Dataset:
        """Moves all members of a scenario with ``[ensemble]``, as :func:`ensemble`; equal to ``pendula ensemble`` to
        the last bit."""
        return move_members(
            self.file.read_text(encoding="utf-8"),
            str(self.file),
            self._overrides,
            threads=threads,
            file=file,
            shard=shard,
            resume=resume,
            client=client,
            progress=progress,
        )
