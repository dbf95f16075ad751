"""Bodies from what other libraries call a solid."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.bodies import Body, SeedRule
from fcdm_opt.geometry.decomposition import Method

KNOWN = "a Body, a trimesh.Trimesh, (vertices, faces), a coal.Convex, a coal BVH model"


def as_body(
    x: Any, *, seed: SeedRule | ArrayLike = "centroid", name: str = "body", decomposition: Method = "auto"
) -> Body:
    """Return a body from a solid in any of the usual forms.

    Parameters
    ----------
    x : Body, trimesh.Trimesh, (vertices, faces), coal.Convex or coal BVH model
        A body comes back as it is, with its own seed and name. A `coal.Convex` is the hull of its points; coal's
        other shapes are approximated by nothing here. Units are those of the numbers.
    seed : {"centroid", "vertices", "box"} or (3,) array
        See `Body.convex`.
    name : str
        Used in messages and pictures.
    decomposition : {"auto", "exact", "coacd"}
        See `Body.from_mesh`.

    Raises
    ------
    InputError
        For anything else, and for surfaces that bound no solid, see `Body.from_mesh`.
    """
    if isinstance(x, Body):
        return x
    library = {kind.__module__.partition(".")[0] for kind in type(x).__mro__}
    if "coal" in library and hasattr(x, "convexHull"):
        return Body.convex(np.array(x.points()), seed=seed, name=name)
    if "coal" in library and hasattr(x, "tri_indices"):
        triangles = map(x.tri_indices, range(x.num_tris))
        faces: Any = [(own[0], own[1], own[2]) for own in triangles]  # coal's triangles have three entries, but no end
        vertices = np.array(x.vertices())
    elif "trimesh" in library and hasattr(x, "faces"):
        vertices, faces = np.array(x.vertices), np.array(x.faces)
    elif isinstance(x, tuple | list) and len(x) == 2:
        vertices, faces = x
    else:
        what = f"cannot be made a body: {type(x).__module__}.{type(x).__qualname__}"
        hint = "; for a file Body.from_file(path, unit=...)" if isinstance(x, str) or hasattr(x, "__fspath__") else ""
        raise InputError(what, key=f"body '{name}'", allowed=KNOWN + hint)
    return Body.from_mesh(vertices, faces, decomposition=decomposition, seed=seed, name=name)
