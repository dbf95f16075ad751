"""Random input: integer hulls in small ranges (many parallel faces and edges) and large ones (generic), seeded."""

from __future__ import annotations

import os
from fractions import Fraction
from typing import Any

import numpy as np
from cases import Shape, shape, union
from hypothesis import settings
from hypothesis import strategies as st
from oracles import Vec, hull, minus, rational

PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
SEEDS = ("inside", "vertex", "face", "outside")


def random_points(rng: np.random.Generator, count: int, reach: int) -> list[Vec]:
    """Distinct integer points in [-reach, reach]^3 that span a volume, every one a corner of their hull."""
    while True:
        rows = rng.integers(-reach, reach, (count, 3), endpoint=True).tolist()
        try:
            solid = hull({k: (x, y, z) for k, (x, y, z) in enumerate(rows)})
        except ValueError:  # flat: draw again
            continue
        return list(solid.vertices.values())


def random_shape(rng: np.random.Generator, reach: int, seed: str = "inside", count: int = 8) -> Shape:
    """Convex shape with a seed strictly inside, on a vertex, on a face or anywhere near, usually outside."""
    rows = random_points(rng, int(rng.integers(4, count + 1)), reach)
    solid = hull(dict(enumerate(rows)))
    if seed == "inside":
        point = _mean(rng, rows)
    elif seed == "vertex":
        point = rational([rows[int(rng.integers(len(rows)))]])[0]
    elif seed == "face":
        faces = sorted(sorted(face) for face in solid.facets.values())
        face = faces[int(rng.integers(len(faces)))]
        point = _mean(rng, [rows[k] for k in sorted(face)])
    else:
        point = rational([rng.integers(-2 * reach, 2 * reach, 3, endpoint=True).tolist()])[0]
    return shape(rows, point)


def _mean(rng: np.random.Generator, rows: Any) -> tuple[Fraction, ...]:
    """Weighted mean of all rows in sixty-fourths: an exact float, also after a shift by integers."""
    weights = 1 + rng.multinomial(64 - len(rows), np.full(len(rows), 1 / len(rows)))
    return tuple(sum(Fraction(int(w), 64) * x[axis] for w, x in zip(weights, rows, strict=True)) for axis in range(3))


def random_pair(
    rng: np.random.Generator, reach: int, seeds: tuple[str, str] = ("inside", "inside")
) -> tuple[Shape, Shape]:
    """Two convex shapes at an offset: generic, along an axis or diagonal, along two vertices of body 1, or small."""
    one, two = (random_shape(rng, reach, seed) for seed in seeds)
    kind = int(rng.integers(5))
    offset = rng.integers(-4 * reach, 4 * reach, 3, endpoint=True).tolist()
    if kind == 1:
        offset = [0 if axis != rng.integers(3) else 3 * reach for axis in range(3)]
    elif kind == 2:
        offset = [int(s) * 3 * reach for s in rng.choice([-1, 1], 3)]
    elif kind == 3:
        offset = [2 * x for x in minus(one.vertices[1], one.vertices[0])]
    elif kind == 4:
        offset = rng.integers(-reach, reach, 3, endpoint=True).tolist()
    return one, two.shifted(offset)


def aligned_points(rng: np.random.Generator, reach: int) -> list[Vec]:
    """Integer corners of a box, a box with edges or a corner cut off, a prism or a pyramid, along the axes."""
    low, high = -rng.integers(1, reach, 3, endpoint=True), rng.integers(1, reach, 3, endpoint=True)
    cut = int(rng.integers(5))
    if cut < 2:
        rows = [(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])]
    else:
        flat = _outline(rng, low, high)
        rows = [(x, y, low[2]) for x, y in flat]
        rows += [(x, y, high[2]) for x, y in flat] if cut < 4 else [(0, 0, high[2])]
    order, signs = rng.permutation(3), rng.choice([-1, 1], 3)
    turned = [tuple(int(signs[k] * row[order[k]]) for k in range(3)) for row in rows]
    return list(dict.fromkeys(turned))


def _outline(rng: np.random.Generator, low: Any, high: Any) -> list[tuple[int, int]]:
    """Corners of a rectangle with some of its corners cut off, by as much each way or not."""
    found = []
    for u, v in ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])):
        p, q = (int(rng.integers(1, abs(end), endpoint=True)) for end in (u, v))
        if rng.random() < 0.5:
            found += [(int(u - np.sign(u) * p), int(v)), (int(u), int(v - np.sign(v) * q))]
        else:
            found.append((int(u), int(v)))
    return list(dict.fromkeys(found))


def aligned_pair(rng: np.random.Generator, reach: int, seeds: tuple[str, str]) -> tuple[Shape, Shape]:
    """Two parts as they are drawn: along the axes, moved by whole numbers, seeds where `random_shape` has them."""
    made = []
    for seed in seeds:
        rows = aligned_points(rng, reach)
        ends = np.array([np.min(rows, axis=0), np.max(rows, axis=0)])
        middle = [Fraction(int(x), 2) for x in ends.sum(axis=0)]
        if seed == "inside":
            point = middle if rng.random() < 0.5 else [Fraction(int(x), 4) for x in ends.sum(axis=0)]
        elif seed == "vertex":
            point = rows[int(rng.integers(len(rows)))]
        elif seed == "face":
            axis = int(rng.integers(3))
            point = [Fraction(int(ends[1, k])) if k == axis else middle[k] for k in range(3)]
        else:
            point = rng.integers(-2 * reach, 2 * reach, 3, endpoint=True).tolist()
        made.append(shape(rows, point))
    return made[0], made[1].shifted(rng.integers(-3 * reach, 3 * reach, 3, endpoint=True).tolist())


def aligned_union(rng: np.random.Generator, reach: int, parts: int) -> Shape:
    """Union of aligned parts with one seed, near the first; parts may overlap, touch or lie apart."""
    own = []
    for _ in range(parts):
        rows = aligned_points(rng, reach)
        own.append(shape(rows, rows[0]).shifted(rng.integers(-reach, reach, 3, endpoint=True).tolist()))
    return union(*own, seed=[Fraction(int(x), 2) for x in rng.integers(-2, 2, 3, endpoint=True)])


def random_union(rng: np.random.Generator, reach: int, parts: int) -> Shape:
    """Union of convex shapes with one seed, near the first; parts may overlap, touch or lie apart."""
    shifts = rng.integers(-reach, reach, (parts, 3), endpoint=True).tolist()
    own = [random_shape(rng, reach, "inside", 7).shifted(shift) for shift in shifts]
    return union(*own, seed=own[0].seed)


def random_rotation(rng: np.random.Generator) -> np.ndarray:
    """Rotation matrix from an integer quaternion: rational, rounded once."""
    while not (q := [int(x) for x in rng.integers(-5, 6, 4)])[0]:
        pass
    w, x, y, z = q
    rows = [
        [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
    return np.array(rows) / sum(k * k for k in q)


def random_pose(rng: np.random.Generator, reach: float = 1.0) -> np.ndarray:
    """Rigid 4x4 transform."""
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = random_rotation(rng), reach * rng.uniform(-1, 1, 3)
    return T


generators = st.integers(0, 2**32 - 1).map(np.random.default_rng)
reaches = st.sampled_from([2, 3, 1000])


def runs(examples: int) -> settings:
    """That many examples with `--slow`, a third without.

    A few where the kernels are not compiled and everything takes a hundred times as long.
    """
    share = 50 if PLAIN else 1 if settings.get_current_profile_name() == "slow" else 3
    return settings(max_examples=max(2, examples // share))
