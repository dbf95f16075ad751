"""Bodies that are hard to build: what is the volume of their parts, how many corners and faces has their hull.

Data is one of

    ask "volume"    vertices, faces (triangles): volume of the solid inside, as the method has it: of the union of its
                    parts where it cuts into parts
    ask "hull"      vertices: how many corners and faces the convex hull has, and edges where the method tells
    ask "overlap"   one, two (corners of boxes), faces (triangles of each), area: how deep the boxes overlap; `area` is
                    that of the face that they would share

An answer may be {"refused": why}: right where there is no solid, flagged elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt_benchmarks.stability.body_families import FAULTY, families
from fcdm_opt_benchmarks.stability.case import WRONG_BEYOND, Grade, HardCase

Data = Mapping[str, Any]
Answer = dict[str, Any]
EVERY = 8  # cases of each family, one is in the quick form
ROUNDING = 1e-12
"""Of the size: what is this near to a plane that cuts is on it."""

NORMALS = 8
"""Digits to which normals of hulls are compared when faces are counted."""

COACD = {"resolution": 1000, "mcts_iterations": 60, "seed": 0}
"""The quickest search that its manual allows; preprocessing, and the accuracy at which parts are accepted, its own."""


# --------------------------------------------------------------------------------------------------------------- cases


def cases(quick: bool, seed: int) -> list[HardCase]:
    """Return the cases.

    Parameters
    ----------
    quick : bool
        Fewer of each family.
    seed : int
        Of turns and of random points.
    """
    return [case for own in families(seed).values() for case in own[:: EVERY if quick else 1]]


def judged(case: HardCase, answer: Mapping[str, Any]) -> Grade:
    """Compare an answer with the truth."""
    truth = case.truth
    if "refused" in answer:
        return Grade("right" if "refused" in truth else "flagged", None, str(answer["refused"]))
    if "refused" in truth:
        if 0 in answer.values():
            return Grade("right", None, "nothing there")
        given = ", ".join(f"{key} {value:g}" for key, value in answer.items())
        return Grade("wrong", None, f"{given} of what is no solid")
    error, reason = 0.0, ""
    for key, right in truth.items():
        if key == "source" or key not in answer:
            continue
        off = abs(answer[key] - right) / abs(right) if right else math.inf if answer[key] else 0.0
        if not off <= error:  # nan too
            error, reason = math.inf if math.isnan(off) else off, f"{key} {answer[key]!r}, not {right!r}"
    if not set(truth) & set(answer):
        raise KeyError(f"none of {', '.join(truth)}")
    wrong = not error <= (WRONG_BEYOND if {"volume", "depth"} & set(truth) else 0.0)
    return Grade("wrong" if wrong else "right", error, reason if wrong else "")


# ------------------------------------------------------------------------------------------------------------- methods


def _refusing(
    method: Callable[..., Answer], kind: type[Exception] = Exception, **settings: Any
) -> Callable[[Data], Answer]:
    """Return a method at some settings; what it raises is its refusal."""

    def answer(data: Data) -> Answer:
        try:
            return method(data, **settings)
        except (ModuleNotFoundError, MemoryError):
            raise
        except kind as reason:
            return {"refused": f"{type(reason).__name__}: {' '.join(str(reason).split())}"[:300]}

    return answer


def _ours(data: Data) -> Answer:
    from fcdm_opt.curve.decision_curve import decision_curve
    from fcdm_opt.geometry.bodies import Body

    if data["ask"] == "volume":
        body = Body.from_mesh(data["vertices"], data["faces"], decomposition="exact")
        return {"volume": union_volume([part.vertices for part in body.parts])}
    if data["ask"] == "hull":
        (part,) = Body.convex(data["vertices"]).parts
        return {"vertices": len(part.vertices), "edges": len(part.edges), "faces": len(part.loops)}
    curve = decision_curve(Body.convex(data["one"]), Body.convex(data["two"]))
    return {"depth": max(0.0, -float(curve.gap((1.0, 1.0))))}


def _coacd(data: Data) -> Answer:
    import coacd

    coacd.set_log_level("off")
    mesh = coacd.Mesh(np.array(data["vertices"], float), np.array(data["faces"]))
    parts = coacd.run_coacd(mesh, **COACD)
    if not parts:
        raise ValueError("no parts")
    return {"volume": union_volume([np.array(corners, float) for corners, _ in parts])}


def _by_trimesh(data: Data, *, checked: bool) -> Answer:
    import trimesh

    if data["ask"] == "hull":
        made = trimesh.convex.convex_hull(np.array(data["vertices"]))
        return {"vertices": len(made.vertices), "faces": _different(made.face_normals)}
    if data["ask"] == "overlap":
        meshes = [trimesh.Trimesh(data[key], data["faces"]) for key in ("one", "two")]
        both = trimesh.boolean.intersection(meshes, engine="manifold")
        return {"depth": 0.0 if both.is_empty else float(both.volume) / data["area"]}
    mesh = trimesh.Trimesh(data["vertices"], data["faces"])
    if checked and not mesh.is_volume:
        raise ValueError("is_volume is False")
    return {"volume": float(mesh.volume)}


def _by_manifold(data: Data, bits: int) -> Answer:
    from manifold3d import Error, Manifold, Mesh, Mesh64

    def made(vertices: Any, faces: Any) -> Any:
        kind, index, real = (Mesh64, np.uint64, np.float64) if bits == 64 else (Mesh, np.uint32, np.float32)
        mesh = kind(vert_properties=np.array(vertices, real), tri_verts=np.array(faces, index))
        mesh.merge()
        manifold = Manifold(mesh)
        if manifold.status() != Error.NoError:
            raise ValueError(manifold.status().name)
        return manifold

    if data["ask"] == "hull":
        hull = Manifold.hull_points(np.array(data["vertices"]))
        if not hull.volume() > 0:
            raise ValueError("the hull has no volume")
        mesh = hull.to_mesh64()
        points, faces = np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts, np.int64)
        return {"vertices": len(points), "faces": _different(_normals(points, faces))}
    if data["ask"] == "overlap":
        return {"depth": (made(data["one"], data["faces"]) ^ made(data["two"], data["faces"])).volume() / data["area"]}
    whole = made(data["vertices"], data["faces"])
    if whole.is_empty():
        raise ValueError("it is empty")
    return {"volume": whole.volume()}


def _qhull(data: Data) -> Answer:
    from scipy.spatial import ConvexHull

    made = ConvexHull(np.array(data["vertices"]))
    return {"vertices": len(made.vertices), "faces": _different(made.equations[:, :3])}


def _by_coal(data: Data, *, triangles: bool) -> Answer:
    import coal

    vectors = coal.StdVec_Vec3s()
    vectors.extend([np.array(row) for row in data["vertices"]])
    made = coal.Convex.convexHull(vectors, triangles, "Qt" if triangles else "")
    return {"vertices": int(made.num_points)}


METHODS = {
    "our bodies": _refusing(_ours, InputError),
    "CoACD": _refusing(_coacd),
    "trimesh": _refusing(_by_trimesh, checked=False),
    "trimesh, is_volume": _refusing(_by_trimesh, checked=True),
    "manifold3d": _refusing(_by_manifold, bits=64),
    "manifold3d, float32": _refusing(_by_manifold, bits=32),
    "Qhull (scipy)": _refusing(_qhull),
    "coal hull": _refusing(_by_coal, triangles=False),
    "coal hull, Qt": _refusing(_by_coal, triangles=True),
}
OURS = ("our bodies",)
ASKED = {
    "volume": ("our bodies", "CoACD", "trimesh", "trimesh, is_volume", "manifold3d", "manifold3d, float32"),
    "hull": ("our bodies", "trimesh", "manifold3d", "Qhull (scipy)", "coal hull", "coal hull, Qt"),
    "overlap": ("our bodies", "trimesh", "manifold3d", "manifold3d, float32"),
}
"""Who is asked what."""


def applies(name: str, case: HardCase) -> bool:
    """Tell whether a method can be asked.

    CoACD is not asked what its manual leaves to its preprocessing, which makes another solid: faulty surfaces.
    """
    return name in ASKED[case.data["ask"]] and not (name == "CoACD" and case.family in FAULTY)


# ------------------------------------------------------------------------------------------------- measuring of answers


def union_volume(parts: Sequence[Array]) -> float:
    """Return the volume of a union of convex parts, each (n, 3) points: of each what is outside of those before it."""
    from scipy.spatial import ConvexHull

    lowest = np.min([part.min(axis=0) for part in parts], axis=0)
    size = float(np.max([part.max(axis=0) for part in parts] - lowest))
    local = [own for part in parts if len(own := _corners((part - lowest) / size))]
    total = 0.0
    for k, part in enumerate(local):
        rest = [part]
        for other in local[:k]:
            rest = [piece for own in rest for piece in _outside(own, other)]
        total += sum(float(ConvexHull(piece).volume) for piece in rest)
    return total * size**3


def _outside(points: Array, other: Array) -> list[Array]:
    """Return convex pieces of a hull outside of another: behind each of its planes, and not behind those before it."""
    from scipy.spatial import ConvexHull

    pieces = []
    for plane in np.unique(ConvexHull(other).equations, axis=0):
        beyond, points = _cut(points, plane)
        if len(beyond):
            pieces.append(beyond)
        if not len(points):
            break
    return pieces


def _cut(points: Array, plane: Array) -> tuple[Array, Array]:
    """Return what of a hull is above a plane and what below, (m, 3) each, empty where that has no volume."""
    heights = points @ plane[:3] + plane[3]
    above, below = heights > ROUNDING, heights < -ROUNDING
    if not above.any() or not below.any():
        return (points, points[:0]) if above.any() else (points[:0], points)
    high, low = points[above], points[below]
    share = heights[above][:, None] / (heights[above][:, None] - heights[below][None, :])
    section = (high[:, None] + share[..., None] * (low[None] - high[:, None])).reshape(-1, 3)
    on = np.vstack([section, points[~above & ~below]])
    return _corners(np.vstack([high, on])), _corners(np.vstack([low, on]))


def _corners(points: Array) -> Array:
    """Return the corners of a hull, none where it is flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points[:0]


def _normals(points: Array, faces: Ints) -> Array:
    a, b, c = points[faces].transpose(1, 0, 2)
    across = np.cross(b - a, c - a)
    lengths = np.linalg.norm(across, axis=1)
    return across[lengths > 0] / lengths[lengths > 0, None]


def _different(normals: Array) -> int:
    """Return how many normals differ: a hull has as many faces."""
    return len(np.unique(np.round(normals, NORMALS) + 0.0, axis=0))
