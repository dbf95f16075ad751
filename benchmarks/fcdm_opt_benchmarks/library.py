"""Libraries of rivals: imported where they are installed, and what several methods build with coal."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.arrays import Array


def library(name: str) -> Any:
    """Import an optional library; raise `FcdmError` that says what to install."""
    try:
        return import_module(name)
    except ImportError as reason:
        raise FcdmError(f"this rival method needs {name}: pip install {name} ({reason})") from reason


def coal_hull(points: Array) -> Any:
    """Return the hull of points, (n, 3), as coal's users build it; its own points, in their order, may be rewritten."""
    coal = library("coal")
    vectors = coal.StdVec_Vec3s()
    vectors.extend(list(points))
    return coal.Convex.convexHull(vectors, True, "Qt")
