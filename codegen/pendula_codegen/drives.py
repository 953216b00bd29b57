"""Drives of a chain as part of its equations."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from sympy import Rational, sin

from pendula_codegen.chain import Chain
from pendula_codegen.errors import GenerationError


@dataclass(frozen=True)
class Drive:
    """A torque amplitude sin(frequency t + phase) on a link, counted from 0."""

    link: int
    amplitude: tuple[float, ...]
    frequency: float
    phase: float

    @staticmethod
    def of(numbers: Sequence[float]) -> Drive:
        """Of link, amplitude, frequency and phase, one after the other."""
        link, *amplitude, frequency, phase = numbers
        return Drive(int(link), tuple(amplitude), frequency, phase)


def driven(chain: Chain, drives: Iterable[Drive]) -> Chain:
    """The chain with amplitude sin(frequency t + phase) added to torques, each number exactly the double that it is."""
    added = []
    for drive in drives:
        if not 0 <= drive.link < chain.links:
            raise GenerationError(f"drive: expected a link from 0 to {chain.links - 1}, got {drive.link}")
        torque = chain.torque(drive.link + 1)
        if len(drive.amplitude) != len(torque):
            raise GenerationError(f"drive: expected {len(torque)} amplitudes, got {len(drive.amplitude)}")
        of_time = sin(Rational(drive.frequency) * chain.time + Rational(drive.phase))
        added += [
            (each, Rational(amplitude) * of_time)
            for each, amplitude in zip(torque, drive.amplitude, strict=True)
        ]
    return replace(chain, drives=(*chain.drives, *added))
