"""Damage as files meet it: bits that flip, blocks that are zeros or rubbish, ends that are missing."""

import os
import random
from collections.abc import Iterator


def draws(few: int) -> Iterator[random.Random]:
    """A generator for each of so many draws; PENDULA_DRAWS in the environment asks for more."""
    for seed in range(int(os.environ.get("PENDULA_DRAWS", few))):
        yield random.Random(seed)


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
