"""Ensembles as datasets: from memory, from files, from parts of them."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

import numpy as np

from ._core import InputError
from ._runs import missing

if TYPE_CHECKING:
    import xarray

    from . import _core

# Attributes of a data set, without those by which HDF5 attaches it to its scales.
OWN = ("long_name", "units", "natural_unit", "flag_values", "flag_meanings")


# Data sets that only exist once members were moved.
MOVED = ("status", "trusted", "steps")


def dataset_of(made: _core.Ensemble, has_moved: bool = True) -> xarray.Dataset:
    """The dataset of members in memory, as :func:`open_ensemble` reads it from a file; or of members not moved yet."""
    data: dict[str, Any] = {}
    scales: dict[str, Any] = {}
    for k, (name, kind, attributes, flags) in enumerate(made.arrays):
        attrs: dict[str, Any] = dict(attributes)
        is_known = has_moved or name not in MOVED
        values: Any = made.numbers(k) if is_known else np.full(made.members, -1, np.int8)
        if flags:
            attrs["flag_values"] = np.arange(-1, flags - 1, dtype=values.dtype)
        if kind == "scale":
            scales[name] = (name, values, attrs)
        else:
            data[name] = (tuple(scales), values.reshape(made.shape), attrs)
    if failures := made.failures:
        scales["failed_member"] = ("failed_member", np.array([float(member) for member, _ in failures]))
        data["message"] = ("failed_member", np.array([text for _, text in failures], dtype=object))
    return dataset(data, scales, dict(made.attributes))


def dataset(data: dict[str, Any], scales: dict[str, Any], attrs: dict[str, Any]) -> xarray.Dataset:
    try:
        import xarray
    except ImportError as error:
        raise missing("data", error) from None
    return xarray.Dataset(data, scales, attrs)


def open_ensemble(file: str | PathLike[str]) -> xarray.Dataset:
    """Reads a file that ``pendula ensemble`` or :func:`ensemble` has written, whole.

    Parameters
    ----------
    file : path

    Returns
    -------
    xarray.Dataset
        As :func:`ensemble` returns it.
    """
    name = fspath(file)
    try:
        import h5py  # type: ignore[import-untyped]
    except ImportError as error:
        raise missing("data", error) from None
    data: dict[str, Any] = {}
    scales: dict[str, Any] = {}
    try:
        with h5py.File(name, "r") as opened:
            attrs = {key: _plain(one) for key, one in opened.attrs.items()}
            if attrs.get("kind") != "ensemble":
                raise InputError(f"{name}: expected a file of an ensemble, got another one")
            for key, array in opened.items():
                values = array.asstr()[...] if array.dtype.kind == "O" else array[...]
                own = {word: _plain(array.attrs[word]) for word in OWN if word in array.attrs}
                dims = (key,) if array.is_scale else tuple(dim[0].name[1:] for dim in array.dims)
                (scales if array.is_scale else data)[key] = (dims, values, own)
    except InputError:
        raise
    except (OSError, LookupError, RuntimeError, ValueError) as error:
        raise InputError(f"{name}: expected a file of an ensemble that can be read, got: {error}") from None
    return dataset(data, scales, attrs)


def _plain(value: Any) -> Any:
    return int(value) if isinstance(value, np.integer) else value


def merge(files: str | PathLike[str] | Sequence[str | PathLike[str]]) -> xarray.Dataset:
    """Joins the datasets of shards that wrote files of their own.

    Parameters
    ----------
    files : path or sequence of paths
        Of all shards of one ensemble, in any order.

    Returns
    -------
    xarray.Dataset
        The same as if one process had moved all members.

    Raises
    ------
    InputError
        The files are of different ensembles, or members are missing.
    """
    paths = [files] if isinstance(files, (str, PathLike)) else list(files)
    parts = [open_ensemble(file) for file in paths]
    if not parts:
        raise InputError("files: expected one file or more, got none")
    whole = parts[0]
    for path, part in zip(paths[1:], parts[1:], strict=True):
        if part.attrs["ensemble"] != whole.attrs["ensemble"]:
            raise InputError(
                f"{fspath(path)}: expected a part of the ensemble that {fspath(paths[0])} is of, got one of another "
                "scenario, program or instruction set"
            )
        whole = _joined(whole, part)
    done = int((whole["status"] != -1).sum())
    if done < whole.attrs["members"]:
        raise InputError(f"files: expected all {whole.attrs['members']} members, got {done}")
    return whole.assign_attrs(members_done=done, complete=1)


def _joined(whole: xarray.Dataset, part: xarray.Dataset) -> xarray.Dataset:
    is_there = part["status"].values != -1
    data: dict[str, Any] = {}
    for name, array in whole.data_vars.items():
        if name != "message":
            data[str(name)] = (array.dims, np.where(is_there, part[name].values, array.values), array.attrs)
    scales: dict[str, Any] = {
        str(name): (one.dims, one.values, one.attrs)
        for name, one in whole.coords.items()
        if name != "failed_member"
    }
    told = {
        member: text
        for one in (whole, part)
        if "message" in one
        for member, text in zip(one["failed_member"].values, one["message"].values, strict=True)
    }
    if told:
        scales["failed_member"] = ("failed_member", np.array(sorted(told)))
        data["message"] = ("failed_member", np.array([told[one] for one in sorted(told)], dtype=object))
    return dataset(data, scales, whole.attrs)
