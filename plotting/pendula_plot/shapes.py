"""What carts, rails and springs look like, in pixels with y up."""

from __future__ import annotations

import numpy as np

# Lengths in the size of a cart, or parts of a spring: those of pages (src/view/page/shapes.js).
PROPORTIONS = {
    "springTurns": 10,
    "springEnd": 0.1,
    "pulley": 0.6,
    "weightWide": 0.8,
    "weightHigh": 1.1,
    "floorWide": 14,
    "cartLong": 1.6,
    "cartHigh": 0.62,
    "wheelAside": 0.95,
    "wheelBelow": 0.66,
    "wheel": 0.36,
    "railBelow": 1.02,
}


def upright(along: np.ndarray) -> np.ndarray:
    """Axes along a rail and up from it, (2, 2): which way a rail runs does not matter, its upper side is up."""
    length = np.linalg.norm(along)
    x, y = along / length if length > 0 else (1.0, 0.0)
    if x < -1e-9 or (abs(x) <= 1e-9 and y < 0):
        x, y = -x, -y
    return np.array([(x, y), (-y, x)])


def cart_box(middle: np.ndarray, axes: np.ndarray, size: float) -> np.ndarray:
    """Its corners, (4, 2)."""
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    return middle + size * corners * (PROPORTIONS["cartLong"], PROPORTIONS["cartHigh"]) @ axes


def wheels(middle: np.ndarray, axes: np.ndarray, size: float) -> np.ndarray:
    """Their middles, (2, 2)."""
    aside, below = PROPORTIONS["wheelAside"], PROPORTIONS["wheelBelow"]
    return middle + size * np.array([(-aside, -below), (aside, -below)]) @ axes


def weight(top: np.ndarray, size: float) -> np.ndarray:
    """Corners of a box whose upper edge hangs at a place, (4, 2)."""
    wide, high = PROPORTIONS["weightWide"] * size, 2 * PROPORTIONS["weightHigh"] * size
    return top + np.array([(-wide, 0), (wide, 0), (wide, -high), (-wide, -high)])


def floor(middle: np.ndarray, size: float) -> np.ndarray:
    """Its ends, (2, 2)."""
    return middle + PROPORTIONS["floorWide"] * size * np.array([(-1, 0), (1, 0)])


def over_pulleys(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """A thread up from a place, over a wheel there, to a wheel at another, (3, 2)."""
    return np.array([start, (start[0], end[1]), end])


def rail(middle: np.ndarray, axes: np.ndarray, size: float, reach: float) -> np.ndarray:
    """Its ends, (2, 2): `reach` pixels from the cart to both sides."""
    return middle - size * PROPORTIONS["railBelow"] * axes[1] + np.array([[-reach], [reach]]) * axes[0]


def spring(start: np.ndarray, end: np.ndarray, wide: float) -> np.ndarray:
    """Its line: as many zigzags however long it is, `wide` to each side."""
    along = end - start
    length = np.linalg.norm(along)
    across = np.array([-along[1], along[0]]) / (length if length > 0 else 1)
    corners = 2 * PROPORTIONS["springTurns"]
    side = np.where(np.arange(corners + 1) % 2, wide, -wide)
    side[[0, -1]] = 0
    parts = np.linspace(PROPORTIONS["springEnd"], 1 - PROPORTIONS["springEnd"], corners + 1)
    return np.vstack([start, start + parts[:, None] * along + side[:, None] * across, end])
