"""Contacts of degenerate geometry: parallel, flush, tiny, huge, far away, with the numbers of the project's list."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise, product

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks.stability.contacts.scenes import (
    BLOCK,
    CUBE,
    DIAMOND,
    OCTAHEDRON,
    SLAB,
    SLIGHT,
    TETRAHEDRON,
    TILT,
    Families,
    HardPair,
    Solid,
    family,
    hull_of,
    moved,
    orientations,
    placed,
    prism,
    pyramid,
    random_way,
    seeded,
    seen,
    shifted,
    solid,
    sphere,
    stretched,
    turned,
    turns,
)
from fcdm_opt_benchmarks.stability.drawn_parts import PARTS

FAMILIES: Families = {}


@family(FAMILIES, "parallel boxes")
def parallel_boxes(rng: np.random.Generator) -> list[HardPair]:
    """Axis-aligned boxes in all 24 orientations."""
    made = []
    for k, turn in enumerate(orientations()):
        reach = np.abs(turn[:3, :3]) @ (1, 2, 3) + (3, 1, 2)
        for name, ways in (("face on face", (1, 0, 0)), ("edge on edge", (0, 1, 1)), ("three lines meet", (1, 1, 1))):
            made.append(HardPair(f"orientation {k + 1}, {name}", SLAB, shifted(BLOCK, ways * reach), turn))
    return [*made, *turns(made)]


@family(FAMILIES, "turned by 1e-3 to 1e-15", count=2)
def nearly_parallel(rng: np.random.Generator) -> Iterable[HardPair]:
    """Cubes turned by 1e-3 to 1e-15 rad out of parallel."""
    for k in range(3, 16):
        angle = 10.0**-k
        for name, offset in (("face", (4, 0.5, 0.25)), ("edge", (4, 4, 0.5)), ("vertex", (4, 4, 4))):
            two = shifted(CUBE, offset)
            yield HardPair(f"{name}, {angle:g} about one axis", CUBE, two, turned(1, angle))
            both = turned(1, angle) @ turned(2, 0.7 * angle)
            yield HardPair(f"{name}, {angle:g} about two axes", CUBE, two, both)


@family(FAMILIES, "flush contacts")
def flush_contacts(rng: np.random.Generator) -> list[HardPair]:
    """Vertex on vertex, edges on one line, faces of one outline, cubes at the same place."""
    mirrored = stretched(TETRAHEDRON, -1)
    made = [
        HardPair("vertex on vertex, cubes", CUBE, shifted(CUBE, (4, 4, 4))),
        HardPair("vertex on vertex, octahedra", OCTAHEDRON, shifted(OCTAHEDRON, (0, 0, 8))),
        HardPair("vertex on vertex, tetrahedra", TETRAHEDRON, shifted(mirrored, (4, 4, 4))),
        HardPair("edges on one line, of one length", CUBE, shifted(CUBE, (4, 4, 0))),
        HardPair("edges on one line, one further on", CUBE, shifted(CUBE, (4, 4, 1))),
        HardPair("edges on one line, of other lengths", CUBE, shifted(SLAB, (4, 6, 0.5))),
        HardPair("edges on one line, diamonds", DIAMOND, shifted(DIAMOND, (8, 0, 0))),
        HardPair("faces of one outline", CUBE, shifted(CUBE, (4, 0, 0))),
        HardPair("faces shifted in their plane", CUBE, shifted(CUBE, (4, 0.5, -0.25))),
        HardPair("faces a diagonal away", CUBE, shifted(CUBE, (4, 2, 2))),
        HardPair("faces one inside the other", CUBE, shifted(SLAB, (4, 0, 0))),
    ]
    scaled = [scene._replace(name=f"{scene.name}, scaled", rho=(1.3, 1.0)) for scene in made]
    drawn = [scene._replace(name=f"{scene.name}, at {rho}", rho=rho) for scene in made for rho in ((1, 3), (2, 2))]
    same = [
        HardPair("the same cube twice", CUBE, CUBE),
        HardPair("the same cube twice, other seeds", CUBE, seeded(CUBE, (0.5, 0.25, 0.125))),
        HardPair("the same cube twice, seeds on opposite faces", seeded(CUBE, (-1, 0, 0)), seeded(CUBE, (1, 0, 0))),
        HardPair("the same cube twice, seeds at opposite corners", seeded(CUBE, (-1, -1, -1)), seeded(CUBE, (1, 1, 1))),
        HardPair("the same cube twice, seeds outside", seeded(CUBE, (3, 0, 0)), seeded(CUBE, (3, 1, 0))),
    ]
    more = [
        scene._replace(name=f"{scene.name}, scales {rho}", rho=rho) for scene in same for rho in ((1, 1.5), (0.5, 1.0))
    ]
    return [*turns([*made, *scaled]), *drawn, *same, *more]


@family(FAMILIES, "places of the seeds", count=1)
def seed_places(rng: np.random.Generator) -> Iterable[HardPair]:
    """Seeds inside, on a face, on an edge, at a vertex, outside, and outside in line with a face or edge."""
    for (p, first), (q, second) in product(_SEEDS.items(), _SEEDS.items()):
        for where, offset in (("away", (5, 1, 2)), ("behind", (-5, 1, 2)), ("at the same place", (0, 0, 0))):
            two = shifted(seeded(SLAB, second), offset)
            yield HardPair(f"seeds {p}, {q}; second {where}", seeded(CUBE, first), two, rho=(1.3, 1.0))
    around = seeded(shifted(CUBE, (11, 0, 0)), (0, 0, 0))  # a closed curve: far from its seed
    against = shifted(seeded(shifted(CUBE, (0, 11, 0)), (0, 22, 0)), (11, -11, 0))
    yield from [
        HardPair("closed polygon, cubes", around, against),
        HardPair("closed polygon, tilted", placed(around, TILT), placed(against, TILT)),
    ]


@family(FAMILIES, "seeds at one point")
def no_offset(rng: np.random.Generator) -> list[HardPair]:
    """Seeds at one point: d = 0."""
    made = []
    for (p, first), (q, second) in product(_SEEDS.items(), _SEEDS.items()):
        for name, own in (("cubes", CUBE), ("a cube and an octahedron", OCTAHEDRON)):
            two = shifted(seeded(own, second), np.subtract(first, second))
            made.append(HardPair(f"seeds {p}, {q}, {name}", seeded(CUBE, first), two))
    return [scene if k % 2 else scene.opened(SLIGHT[k // 2 % len(SLIGHT)]) for k, scene in enumerate(made)]


@family(FAMILIES, "ways between the seeds", count=1)
def offset_ways(rng: np.random.Generator) -> Iterable[HardPair]:
    """D parallel to a face, through a vertex, through an edge, along an edge."""
    for where, d in _WAYS.items():
        yield from [
            HardPair(f"d {where}, cubes", CUBE, shifted(CUBE, d)),
            HardPair(f"d {where}, cube and tetrahedron", CUBE, shifted(TETRAHEDRON, d)),
            HardPair(f"d {where}, octahedron and tetrahedron", OCTAHEDRON, shifted(TETRAHEDRON, d)),
            HardPair(f"d {where}, seed on a face", seeded(CUBE, (0, 0, 1)), shifted(CUBE, d)),
            HardPair(f"d {where}, both seeds on faces", seeded(CUBE, (1, 0, 0)), shifted(seeded(CUBE, (-1, 0, 0)), d)),
            HardPair(f"d {where}, seeds at vertices", *(
                seeded(OCTAHEDRON, (0, 2, 0)), shifted(seeded(TETRAHEDRON, (1, 1, 1)), d)
            )),
        ]  # fmt: skip


@family(FAMILIES, "size ratio 1e-8 to 1e8", count=2)
def size_ratios(rng: np.random.Generator) -> Iterable[HardPair]:
    """Sizes in the ratio 1e-8 to 1e8."""
    for k in (-8, -6, -4, -2, 2, 4, 6, 8):
        for name, own, reach, other, way in (
            ("cubes face on face", stretched(CUBE, 10.0**k), 1, CUBE, (1, 0, 0)),
            ("cubes off the middle", stretched(CUBE, 10.0**k), 1, CUBE, (1, 0.25, 0.125)),
            ("cubes vertex on vertex", stretched(CUBE, 10.0**k), 1, CUBE, (1, 1, 1)),
            ("octahedron and tetrahedron", stretched(OCTAHEDRON, 10.0**k), 2, TETRAHEDRON, (1, 0.3, 0.2)),
            ("tilted tetrahedra", stretched(placed(TETRAHEDRON, TILT), 10.0**k), 1, TETRAHEDRON, (0.6, 0.7, 0.2)),
        ):
            offset = (1.0 if k > 4 else 1.5) * (1 + reach * 10.0**k) * np.array(way)
            yield HardPair(f"1e{k}, {name}", own, shifted(other, offset), box=((1e-9, 1e9), (1e-9, 1e9)))


@family(FAMILIES, "aspect 1e4 to 1e8", count=3)
def aspects(rng: np.random.Generator) -> Iterable[HardPair]:
    """Plates and needles of aspect 1e4 to 1e8."""
    for k in (4, 6, 8):
        t = 10.0**-k
        plate, needle = stretched(CUBE, 1, 1, t), stretched(CUBE, 1, t, t)
        for name, one, two, offset in (
            ("plates face on face", plate, plate, (0, 0, 3 * t)),
            ("plates edge on edge", plate, plate, (3, 0.25, 0)),
            ("plates crossed", plate, stretched(CUBE, t, 1, 1), (1.5, 0.25, 0.5)),
            ("needles end to end", needle, needle, (3, 0, 0)),
            ("needles crossed", needle, stretched(CUBE, t, 1, t), (0.5, 0.25, 3 * t)),
            ("a needle on a cube", stretched(CUBE, t, t, 1), CUBE, (0.25, 0.125, 3)),
            ("a long one on a plate", stretched(CUBE, 1 / t, 1, 1), stretched(CUBE, 1 / t, 1 / t, 1), (0, 5, 3)),
            ("flat tetrahedra", stretched(TETRAHEDRON, 1, 1, t), stretched(TETRAHEDRON, 1, t, 1), (1, 2, 0.5)),
            ("thin, tilted", *(
                placed(stretched(TETRAHEDRON, 1, t, t), TILT), stretched(OCTAHEDRON, 1, t, 1), (1, 0.5, 0.25)
            )),
            ("a tilted plate on a plate", placed(plate, TILT), placed(plate, TILT), TILT[:3, 2] * 3 * t),
        ):  # fmt: skip
            yield HardPair(f"1e{k}, {name}", one, shifted(two, offset))


@family(FAMILIES, "1e6 from the origin", count=3)
def far_away(rng: np.random.Generator) -> Iterable[HardPair]:
    """Pairs drawn 1e6 from the origin, tilted too, and brought from there."""
    place = np.array([1e6, -1e6, 1e6])
    for name, one, two in _plain():
        yield from [
            HardPair(name, shifted(one, place), shifted(two, place)),
            seen(f"{name}, tilted", placed(one, TILT), placed(two, TILT), moved(place)),
            HardPair(f"{name}, brought from there", shifted(one, place), two, moved(-place)),
        ]


@family(FAMILIES, "micrometres, kilometres", count=2)
def units(rng: np.random.Generator) -> Iterable[HardPair]:
    """Pairs in micrometres, millimetres, kilometres and 1e6."""
    tilted = ("tilted tetrahedra", placed(TETRAHEDRON, TILT), placed(shifted(TETRAHEDRON, (3, 1, 2)), TILT @ TILT))
    return [
        HardPair(f"{name}, unit {unit:g}", stretched(one, unit), stretched(two, unit))
        for unit in (1e-9, 1e-6, 1e-3, 1e3, 1e6)
        for name, one, two in (*_plain(), tilted)
    ]


@family(FAMILIES, "4 to 100,000 vertices")
def vertex_counts(rng: np.random.Generator) -> Iterable[HardPair]:
    """Hulls of 4 to 100,000 vertices."""
    for count in (4, 5, 30, 300, 1000, 10_000, 100_000):
        for k in range(1 if count > 1000 else 2):
            one = hull_of(rng, count) if count <= 30 else sphere(rng, count)
            other = shifted(hull_of(rng, 4 if k else 12), 2.5 * random_way(rng))
            scene = HardPair(f"{count} vertices, {k + 1}", one, other, heavy=count > 300)
            yield from turns([scene], SLIGHT[1:], count=4 if count <= 1000 else 1)


@family(FAMILIES, "coplanar points", count=2)
def coplanar_points(rng: np.random.Generator) -> Iterable[HardPair]:
    """Seven of 15 points in a plane, and a cube with points on all its edges and faces."""
    return [
        HardPair(f"{name}, offset {offset}", one, shifted(two, offset))
        for offset in ((0, 0, 9), (9, 0, 0), (6, 6, 6), (5, 1.5, 7))
        for name, one, two in (
            ("seven of 15, mirrored", _SEVEN, stretched(_SEVEN, -1)),
            ("seven of 15 on a grid", _SEVEN, _GRID),
            ("grids", _GRID, _GRID),
            ("seven of 15 on a cube, tilted", placed(_SEVEN, TILT), placed(CUBE, TILT)),
        )
    ]


@family(FAMILIES, "repeated and inner points", count=2)
def superfluous_points(rng: np.random.Generator) -> Iterable[HardPair]:
    """Points named twice and points inside."""
    twice = solid([*CUBE["vertices"], *CUBE["vertices"][::-1], (0, 0, 0), (0.5, 0.25, 0), (1, 1, 1)])
    inner = solid([(0, 0, 0), (0.5, 1, 1), *CUBE["vertices"], (-1, 0, 0)])
    return [
        HardPair(f"{name}, offset {offset}", one, shifted(two, offset))
        for offset in ((0, 0, 3), (3, 0, 0), (3, 3, 3), (3, 1.5, 2))
        for name, one, two in (
            ("twice and inside", twice, inner),
            ("twice", twice, twice),
            ("inside, tilted", placed(inner, TILT), placed(twice, TILT)),
        )
    ]


@family(FAMILIES, "prisms and pyramids", count=1)
def many_sides(rng: np.random.Generator) -> Iterable[HardPair]:
    """Regular prisms and pyramids with 3 to 1000 sides."""
    for sides in (3, 4, 5, 6, 7, 12, 64, 300, 1000):
        up, down = pyramid(sides), stretched(pyramid(sides), 1, 1, -1)
        for name, one, two in (
            ("prisms cap on cap", prism(sides), shifted(prism(sides), (0, 0, 3.5))),
            ("prisms cap on cap, turned", prism(sides), shifted(prism(sides, 0.3), (0.25, 0.125, 3.5))),
            ("prisms side by side", prism(sides), shifted(prism(sides), (3, 0.5, 0.25))),
            ("prisms edge along edge", prism(sides), shifted(stretched(prism(sides), -1, -1, 1), (3, 0, 0.25))),
            ("pyramid on a prism", up, shifted(prism(sides), (0.25, 0.125, 3.5))),
            ("pyramids apex on apex", up, shifted(down, (0, 0, 3.5))),
            ("pyramids side by side, tilted", placed(up, TILT), placed(shifted(up, (2.5, 1, 0.5)), TILT)),
        ):
            yield HardPair(f"{sides} sides, {name}", one, two, heavy=sides > 64)


@family(FAMILIES, "three features meet")
def many_features(rng: np.random.Generator) -> list[HardPair]:
    """Scale pairs at which three or more features meet; unions of two parts with a seam at the contact too."""
    made = []
    for rho in ((1.0, 1.0), (1.5, 1.25), (0.5, 3.0)):
        for name, one, two in (
            ("cube, octahedron", CUBE, OCTAHEDRON),
            ("tetrahedron, octahedron", TETRAHEDRON, OCTAHEDRON),
            ("boxes", SLAB, BLOCK),
            ("cube with its seed outside, tetrahedron", seeded(CUBE, (3, 0.5, 0.25)), TETRAHEDRON),
        ):
            for i, j in ((0, 0), (1, 2), (3, 1)):
                arms = [np.subtract(own["vertices"][k], own["seed"]) for own, k in ((one, i), (two, j))]
                offset = rho[0] * arms[0] - rho[1] * arms[1] + np.subtract(one["seed"], two["seed"])
                made.append(
                    HardPair(f"{name}, vertices {i + 1} and {j + 1} at {rho}", one, shifted(two, offset), rho=rho)
                )
    rows = [*shifted(CUBE, (-1, 0, 0))["vertices"], *shifted(CUBE, (1, 0, 0))["vertices"]]
    bar = solid(rows, parts=(range(8), range(8, 16)))
    made += [
        HardPair("a tip on the seam of a bar", solid(OCTAHEDRON["vertices"]), shifted(bar, (0, 0, -3))),
        HardPair("a cube over the seam of a bar", CUBE, shifted(bar, (0.25, 0.125, -2))),
        HardPair("the seams of two bars", bar, shifted(bar, (0, 0, 2))),
    ]
    return [*made, *turns(made)]


@family(FAMILIES, "parts as drawn")
def ordinary_parts(rng: np.random.Generator) -> list[HardPair]:
    """Dovetail, lid, peg, key, T in a U and L on a step: flush as drawn, tilted together, made larger and smaller."""
    made = []
    for name, (movable, static) in PARTS.items():
        one, two = (solid(np.vstack(own.parts), own.seed, _numbered(own.parts)) for own in (movable, static))
        made.append(HardPair(f"{name}, as drawn", one, two))
        made.append(seen(f"{name}, tilted", one, two, TILT))
        made += [HardPair(f"{name}, at {rho}", one, two, rho=rho) for rho in ((1.01, 1.01), (0.99, 1.01), (0.99, 0.99))]
    return [*made, *turns(made)]


def _numbered(parts: Sequence[Array]) -> list[range]:
    """Return the places of each part's corners in the list of all."""
    ends = np.cumsum([0, *map(len, parts)]).tolist()
    return [range(*ends_of) for ends_of in pairwise(ends)]


@family(FAMILIES, "corner of the scale box")
def box_corners(rng: np.random.Generator) -> Iterable[HardPair]:
    """Boxes that touch at the corner of the scale box."""
    for name, box in (("lowest", ((1.0, 3.0), (1.0, 3.0))), ("highest", ((0.25, 1.0), (0.25, 1.0)))):
        for way, offset in (("face", (2, 0, 0)), ("edge", (2, 2, 0)), ("vertex", (2, 2, 2)), ("off", (2, 0.5, 0.25))):
            yield HardPair(f"{name} corner, {way}", CUBE, shifted(CUBE, offset), box=box)
            own = placed(CUBE, TILT)
            yield HardPair(f"{name} corner, {way}, tilted", own, placed(shifted(CUBE, offset), TILT), box=box)


_SEEDS = {
    "inside": (0, 0, 0),
    "on a face": (1, 0, 0),
    "on an edge": (1, 1, 0),
    "at a vertex": (1, 1, 1),
    "outside": (3, 0.5, 0.25),
    "outside in a face's plane": (1, 3, 0),
    "outside in an edge's line": (1, 1, 3),
}
_WAYS = {
    "through a face": (4, 0.5, 0.25),
    "through the middle of a face": (4, 0, 0),
    "through an edge": (4, 4, 0.5),
    "through the middle of an edge": (4, 4, 0),
    "through a vertex": (4, 4, 4),
    "parallel to a face": (0, 3, 5),
    "along an edge of a tetrahedron": (4, -4, 0),
    "along a normal of a tetrahedron": (-4, 4, 4),
    "through a vertex of an octahedron": (0, -5, 0),
}
_SEVEN = solid([(3, 0, 3), (0, 3, 3), (-3, 3, 3), (-3, 0, 3), (0, -3, 3), (3, -3, 3), (0, 0, 3), (4, 1, 0), (1, 4, 0),
                (-4, 2, 0), (-1, -4, 0), (2, 1, -3), (-1, 2, -3), (-2, -1, -4), (3, -3, -1)])  # fmt: skip
_GRID = solid(list(product((-1, 0, 1), repeat=3)))


def _plain() -> list[tuple[str, Solid, Solid]]:
    return [
        ("face on face", CUBE, shifted(CUBE, (4, 0.5, 0.25))),
        ("edge on edge", CUBE, shifted(SLAB, (4, 6, 0.5))),
        ("vertex on vertex", CUBE, shifted(CUBE, (4, 4, 4))),
        ("octahedron and tetrahedron", OCTAHEDRON, shifted(TETRAHEDRON, (4, 2, 1))),
        ("seeds outside", seeded(CUBE, (3, 0.5, 0.25)), shifted(seeded(OCTAHEDRON, (0, 3, 1)), (5, 1, 2))),
    ]
