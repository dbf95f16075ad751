"""Whole batches of decision curves against the exact ones: features, lines, directions and ends, segment by segment."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.curve.batch import DecisionCurves
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.method import Pair, Touching
from fcdm_opt_benchmarks.placed import elements
from fcdm_opt_benchmarks.references.exact import ExactStretches, as_float, whole_curve

ENDS = 2  # of a segment


class CurveFault(NamedTuple):
    """What is wrong with a curve of a batch: pose, segment (or -1), what, as found and as it is."""

    pose: int
    segment: int
    what: str
    found: Any
    exact: Any


def feature_faults(pair: Pair, transforms: Array, curves: DecisionCurves) -> list[CurveFault]:
    """Compare every segment of a batch with the exact curve: feature, line, direction and both ends.

    Parameters
    ----------
    pair : Pair
    transforms : (N, 4, 4) array
    curves : DecisionCurves
        Of the pair at these poses.

    Returns
    -------
    list of CurveFault
        Lines may be off by `Tolerances.line` of their largest entry, ends by as much over the sine of the angle under
        which their lines cross. A contact in more than a point may be named by any features sharing a corner with it,
        or by a facet of the bodies' difference that it lies on: its normal supports both bodies in what is named.
        Stretches that floats cannot tell from points are left out.
    """
    if len(transforms) != len(curves):
        return [CurveFault(-1, -1, "poses", len(curves), len(transforms))]
    box = np.array(curves.box)
    named = elements(pair)
    faults: list[CurveFault] = []
    rows: list[int] = []
    truths: list[tuple[Array, Array, Array]] = []
    for pose, transform in enumerate(transforms):
        curve, whole = whole_curve(pair, transform)
        exact = [own for own in ExactStretches(whole, box).stretches if own.long]
        mine = [k for k in range(*curves.offsets[pose : pose + 2].tolist()) if _long(curves.vertices[k])]
        if len(mine) != len(exact):
            faults.append(CurveFault(pose, -1, "number of segments", len(mine), len(exact)))
            continue
        status = "contact" if exact else _STATUS[curve.side(box.mean(axis=1).tolist())]
        if str(curves.status[pose]) != status:
            faults.append(CurveFault(pose, -1, "status", str(curves.status[pose]), status))
        for k, own in zip(mine, exact, strict=True):
            kind, i, j = curves.features[k].tolist()
            told, piece = (named[kind][0][i], named[kind][1][j]), own.piece
            touching = zip(told, piece.tight, own.touching, strict=True)
            near = told == own.touching or all(set(a) <= set(b) or set(a) & set(c) for a, b, c in touching)
            if not near and not (curves.tied[pose] and _supports(pair, transform, told)):
                faults.append(CurveFault(pose, k, "feature", told, own.touching))
            ends = np.array([[as_float(x) for x in point] for point in (own.start, own.end)])
            rows.append(k)
            normal, line = piece.normal, piece.line
            if curves.tied[pose]:  # edges along each other touch under many normals: any of them, to the same line
                normal = curves.normals[k]
                line = line * float(np.linalg.norm(curves.lines[k]) / np.linalg.norm(line))
            truths.append((normal, line, ends))
    if rows:
        faults += _number_faults(curves, np.array(rows), truths, box)
    return sorted(faults)


def _supports(pair: Pair, transform: Array, told: Touching) -> bool:
    """Tell, in rationals, whether a face of one body and a vertex of the other are both furthest along its normal."""
    placed = [_moved(pair[0].parts[0].vertices, transform), _moved(pair[1].parts[0].vertices, np.eye(4))]
    face = max(range(2), key=lambda body: len(told[body]))
    if len(told[face]) < 3:
        return False
    a, b, c = (placed[face][k] for k in told[face][:3])
    u, v = ([y - x for x, y in zip(a, end, strict=True)] for end in (b, c))
    n = [u[k - 2] * v[k - 1] - u[k - 1] * v[k - 2] for k in range(3)]
    heights = [[sum(x * y for x, y in zip(n, point, strict=True)) for point in points] for points in placed]
    outward = 1 if max(heights[face]) == heights[face][told[face][0]] else -1
    furthest = [max(h * sign for h in own) for own, sign in zip(heights, _towards(face, outward), strict=True)]
    return all(
        heights[body][k] * sign == furthest[body]
        for body, sign in enumerate(_towards(face, outward))
        for k in told[body]
    )


def _towards(face: int, outward: int) -> tuple[int, int]:
    """Return the signs that turn a face's normal into the direction outward of body 1 and of body 2."""
    return (outward, -outward) if face == 0 else (-outward, outward)


def _moved(points: Array, transform: Array) -> list[list[Fraction]]:
    rows = [[Fraction(x) for x in row] for row in transform[:3].tolist()]
    return [
        [sum((r * Fraction(x) for r, x in zip(row, point, strict=False)), row[3]) for row in rows]
        for point in points.tolist()
    ]


_STATUS = {1: "apart", 0: "apart", -1: "overlapping"}


def _number_faults(
    curves: DecisionCurves, rows: Array, truths: Sequence[tuple[Array, Array, Array]], box: Array
) -> list[CurveFault]:
    """Compare directions, lines and ends, all at once."""
    normals, lines, ends = (np.array(column) for column in zip(*truths, strict=True))
    poses = np.searchsorted(curves.offsets, rows, side="right") - 1
    gradients = lines[:, :2] / np.linalg.norm(lines[:, :2], axis=1)[:, None]
    sines = np.empty((len(rows), ENDS))
    for end, step in ((0, -1), (1, 1)):
        neighbour = np.roll(np.arange(len(rows)), -step)
        inside = (poses[neighbour] == poses) & (ends[neighbour, 1 - end] == ends[:, end]).all(axis=1)
        across = np.abs(gradients[:, 0] * gradients[neighbour, 1] - gradients[:, 1] * gradients[neighbour, 0])
        on_side = np.abs(ends[:, end, :, None] - box) <= DEFAULT.line * box  # of rho_1 = const, and rho_2 = const
        sides = np.where(on_side.any(axis=2), np.abs(gradients[:, ::-1]), np.inf).min(axis=1)
        sines[:, end] = np.where(inside, across, np.minimum(sides, 1.0))
    sizes = np.abs(lines).max(axis=1)
    off = {
        "normal": np.abs(curves.normals[rows] - normals).max(axis=1),
        "line": np.abs(curves.lines[rows] - lines).max(axis=1) / sizes,
        "ends": (np.abs(curves.vertices[rows] - ends) / ends.max(axis=2)[:, :, None]).max(axis=2) * sines,
    }
    off["ends"] = off["ends"].max(axis=1)
    exact = {"normal": normals, "line": lines, "ends": ends}
    found = {"normal": curves.normals, "line": curves.lines, "ends": curves.vertices}
    return [
        CurveFault(int(poses[k]), int(rows[k]), what, found[what][rows[k]].tolist(), exact[what][k].tolist())
        for what, errors in off.items()
        for k in np.flatnonzero(~(errors <= DEFAULT.line)).tolist()
    ]


def _long(ends: Array) -> bool:
    (x, y), (u, v) = ends.tolist()
    return abs(u - x) + abs(v - y) > DEFAULT.line * (x + y)
