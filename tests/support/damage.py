"""Damage as files meet it: bits that flip, blocks that are zeros or rubbish, ends that are missing."""

import os
import random
from collections.abc import Iterator
from pathlib import Path


def draws(few: int) -> Iterator[tuple[int, random.Random]]:
    """So many draws, each a number and a generator. A campaign (tests/campaign/damages.py) asks by the environment for
    others: PENDULA_DRAWS, how many; PENDULA_FIRST_DRAW; PENDULA_SEED; PENDULA_DRAW, a file to tell which this is."""
    asked = os.environ.get
    first, told, seed = (
        int(asked("PENDULA_FIRST_DRAW", 0)),
        asked("PENDULA_DRAW"),
        int(asked("PENDULA_SEED", 0)),
    )
    for number in range(first, first + int(asked("PENDULA_DRAWS", few))):
        if told:
            Path(told).write_text(str(number))
        yield number, random.Random(seed * 10**9 + number)


def flip(draw: random.Random, data: bytearray) -> None:
    data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)


def overwrite(draw: random.Random, data: bytearray) -> None:
    begin = draw.randrange(len(data))
    size = min(draw.choice([1, 8, 64, 512, 4096]), len(data) - begin)
    data[begin : begin + size] = draw.choice([bytes(size), draw.randbytes(size)])


def cut(draw: random.Random, data: bytearray) -> None:
    del data[draw.randrange(len(data)) :]


def damaged(draw: random.Random, whole: bytes) -> bytes:
    """The file with one damage, most often a flipped bit; never the file itself."""
    data = bytearray(whole)
    while data == whole:
        draw.choice([flip, flip, flip, overwrite, cut])(draw, data)
    return bytes(data)
