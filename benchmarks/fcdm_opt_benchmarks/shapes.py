"""Corners of simple solids, and what is drawn by lot of directions: plain arrays, nothing of what is measured."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray[Any, np.dtype[np.float64]]


def box(low: Any, high: Any) -> Array:
    """Return the corners of an axis-aligned box, (8, 3)."""
    return np.array(list(product(*zip(low, high, strict=True))), dtype=np.float64)


def polygon(sides: int, phase: float = 0.0) -> Array:
    """Return the corners of a regular polygon of radius 1; opposite ones of an even number are exactly so."""
    angles = 2 * np.pi * np.arange(sides if sides % 2 else sides // 2) / sides + phase
    corners = np.column_stack([np.cos(angles), np.sin(angles)])
    return corners if sides % 2 else np.vstack([corners, -corners])


def prism(outline: Any, low: float, high: float) -> Array:
    """Return the corners of a prism over an outline in x and y, (n, 2): those below, then those above."""
    flat = np.asarray(outline, dtype=np.float64)
    return np.vstack([np.column_stack([flat, np.full(len(flat), z)]) for z in (low, high)])


def random_directions(rng: np.random.Generator, count: int) -> Array:
    """Return unit vectors, uniform, (count, 3)."""
    ways = rng.normal(size=(count, 3))
    return ways / np.linalg.norm(ways, axis=1)[:, None]


def random_rotation(rng: np.random.Generator) -> Array:
    """Return a rotation matrix, uniform."""
    return np.asarray(Rotation.from_quat(rng.normal(size=4), scalar_first=True).as_matrix())
