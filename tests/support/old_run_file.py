"""Run files as they were when they had no checksums of what goes on."""

import h5py
import numpy as np


def checksum(row: np.ndarray) -> float:
    """Of a place to go on from, but for its first number."""
    value = 0xCBF29CE484222325
    for number in row[1:].view(np.uint64).tolist():
        value = (value ^ number) * 0x100000001B3 % 2**64
        value ^= value >> 32
    return float(value >> 12)


def forget_checksums(run: h5py.File) -> None:
    """Nor did places to go on from count events."""
    del run["run"].attrs["checksum"]
    places = run["run/checkpoint"][:, :-4].copy()
    places[:, 0] = [checksum(place) for place in places]
    del run["run/checkpoint"]
    run["run/checkpoint"] = places
