"""Animations as WebP and GIF, written as their frames come: of each frame what has changed since the last one."""

from __future__ import annotations

import os
import struct
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image, ImageChops
from PIL.GifImagePlugin import getdata

from .run import PlotError

Pair = tuple[Image.Image | None, Image.Image]  # the frame before, and a frame
Part = tuple[tuple[int, int], Image.Image]  # left and top, and the picture of what has changed
UNCHANGED = 255  # a colour that lets through what was there
FREQUENT = 63  # colours that are kept as they are


def write(images: Iterable[Image.Image], path: Path, fps: float, samples: list[Image.Image]) -> None:
    """Writes frames of one size, to be shown again and again, in the colours of some of them. Raises PlotError."""
    writer = write_gif if path.suffix == ".gif" else write_webp
    try:
        with path.open("wb") as stream:
            writer(images, stream, fps, palette_of(samples))
    except OSError as error:
        raise PlotError(
            f"{path}: expected a file that can be written, got: {error.strerror or error}"
        ) from None


def palette_of(samples: list[Image.Image]) -> Image.Image:
    """An image of 255 colours: those that the samples have most of, exactly, and some near all others, however rare."""
    pixels = np.concatenate([np.asarray(image.convert("RGBX")).view(np.uint32) for image in samples])
    found, counts = np.unique(pixels, return_counts=True)
    colours = np.ascontiguousarray(found.view(np.uint8).reshape(1, -1, 4)[..., :3])
    most = colours[0, np.argsort(counts)[-FREQUENT:]]
    near = Image.fromarray(colours).quantize(UNCHANGED - len(most)).getpalette()
    palette = Image.new("P", (1, 1))
    palette.putpalette([*most.ravel().tolist(), *near][: 3 * UNCHANGED])
    return palette


def write_gif(images: Iterable[Image.Image], stream: BinaryIO, fps: float, palette: Image.Image) -> None:
    """Parts follow each other, each with the hundredths of a second that it stands."""
    parts = in_order(lambda pair: part(*pair, palette), pairs(images))
    for frame, (place, picture) in enumerate(parts):
        if frame == 0:
            common = 0xF7  # 256 colours follow, for all parts
            stream.write(b"GIF89a" + struct.pack("<HHBBB", *picture.size, common, 0, 0))
            stream.write(bytes(palette.getpalette()).ljust(768, b"\0"))
            stream.write(b"\x21\xff\x0bNETSCAPE2.0\x03\x01\0\0\0")  # again and again
        duration = 10 * delay(frame, fps, 100)
        stream.writelines(getdata(picture, place, duration=duration, disposal=1, transparency=UNCHANGED))
    stream.write(b";")


def write_webp(images: Iterable[Image.Image], stream: BinaryIO, fps: float, palette: Image.Image) -> None:
    """A RIFF file of parts, each with its place and the milliseconds that it stands."""

    def three(number: int) -> bytes:
        return struct.pack("<I", number)[:3]

    def encoded(pair: Pair) -> tuple[bytes, bytes]:
        (left, top), picture = part(*pair, palette)
        still = BytesIO()
        picture.save(still, "WEBP", lossless=True, quality=30, method=1)
        place = b"".join(map(three, (left // 2, top // 2, picture.width - 1, picture.height - 1)))
        return place, still.getvalue()[12:]  # without the head of a file

    def write_chunk(name: bytes, content: bytes) -> None:
        stream.write(name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2))

    stream.write(b"RIFF\0\0\0\0WEBP")
    for frame, (place, picture) in enumerate(in_order(encoded, pairs(images))):
        if frame == 0:
            moves, transparent = 0x02, 0x10
            write_chunk(b"VP8X", struct.pack("<I", moves | transparent) + place[6:])
            write_chunk(b"ANIM", b"\0\0\0\0" + b"\0\0")  # background; again and again
        write_chunk(b"ANMF", place + three(delay(frame, fps, 1000)) + b"\0" + picture)
    size = stream.tell() - 8
    stream.seek(4)
    stream.write(struct.pack("<I", size))


def delay(frame: int, fps: float, ticks: int) -> int:
    """How long a frame stands, in ticks of a second: whole ones, which add up to the right time."""
    return round((frame + 1) * ticks / fps) - round(frame * ticks / fps)


def pairs(images: Iterable[Image.Image]) -> Iterator[Pair]:
    before = None
    for image in images:
        yield before, image
        before = image


def part(before: Image.Image | None, image: Image.Image, palette: Image.Image) -> Part:
    """What has changed: the box around it, at even places as WebP wants them, with its colours of a palette."""
    if before is None:
        return (0, 0), image.quantize(palette=palette, dither=Image.Dither.NONE)
    difference = ImageChops.difference(before, image)
    left, top, right, bottom = difference.getbbox() or (0, 0, 1, 1)
    box = (left & ~1, top & ~1, right, bottom)
    picture = image.crop(box).quantize(palette=palette, dither=Image.Dither.NONE)
    red, green, blue = difference.crop(box).split()
    largest = ImageChops.lighter(ImageChops.lighter(red, green), blue)
    picture.paste(UNCHANGED, mask=largest.point([255] + [0] * 255))
    picture.info["transparency"] = UNCHANGED
    return box[:2], picture


def in_order(work: Callable[[Pair], tuple], items: Iterable[Pair]) -> Iterator[tuple]:
    """What `work` makes of each item, by all cores, a few items ahead."""
    cores = os.cpu_count() or 1
    with ThreadPoolExecutor(cores) as pool:
        ahead = deque()
        for item in items:
            ahead.append(pool.submit(work, item))
            if len(ahead) > 2 * cores:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()
