"""A picture to draw frames on: smooth lines and discs, over a background that is drawn once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.path import Path
from matplotlib.transforms import Bbox, IdentityTransform
from PIL import Image

Colour = tuple[int, int, int]
CIRCLE = Path.unit_circle()


class Canvas:
    """Square, `size` pixels wide. Places are (…, 2) pixels, from the lower left corner, y up."""

    def __init__(self, size: int, background: Colour) -> None:
        self.size = size
        self._renderer = RendererAgg(size, size, 72)  # dots an inch: a point of line width is a pixel
        self._pen = self._renderer.new_gc()
        self._pen.set_joinstyle("round")
        self._pen.set_capstyle("round")
        corners = np.array([(0, 0), (size, 0), (size, size), (0, size), (0, 0)])
        self._fill(Path(corners), background)
        self.keep()

    def keep(self) -> None:
        """Makes what there is the background."""
        self._background = self._renderer.copy_from_bbox(Bbox.from_extents(0, 0, self.size, self.size))

    def clear(self) -> None:
        """Leaves the background only."""
        self._renderer.restore_region(self._background)

    def lines(self, lines: Sequence[np.ndarray], colour: Colour, width: float) -> None:
        """Lines through the places of each, all in one stroke."""
        codes = [[Path.MOVETO] + [Path.LINETO] * (len(line) - 1) for line in lines]
        if not codes:
            return
        self._pen.set_linewidth(width)
        self._pen.set_foreground(rgb(colour))
        self._draw(Path(np.concatenate(lines), np.concatenate(codes)), None)

    def discs(self, middles: np.ndarray, radii: np.ndarray, colour: Colour) -> None:
        """Discs, or ellipses where radii are (…, 2)."""
        if len(middles) == 0:
            return
        radii = np.broadcast_to(np.reshape(radii, (len(middles), -1)), (len(middles), 2))
        places = middles[:, None] + radii[:, None] * CIRCLE.vertices
        self._fill(Path(places.reshape(-1, 2), np.tile(CIRCLE.codes, len(middles))), colour)

    def polygon(self, corners: np.ndarray, colour: Colour) -> None:
        """A filled area, (corners, 2)."""
        self._fill(Path(np.vstack([corners, corners[:1]])), colour)

    def image(self) -> Image.Image:
        size = (self.size, self.size)
        return Image.frombytes("RGB", size, bytes(self._renderer.buffer_rgba()), "raw", "RGBX")

    def _fill(self, path: Path, colour: Colour) -> None:
        self._pen.set_linewidth(0)
        self._draw(path, rgb(colour))

    def _draw(self, path: Path, face: tuple[float, ...] | None) -> None:
        self._renderer.draw_path(self._pen, path, IdentityTransform(), face)


def rgb(colour: Colour) -> tuple[float, ...]:
    """Parts from 0 to 1, which is how Matplotlib wants them."""
    return tuple(part / 255 for part in colour)
