"""Contacts that distance and collision libraries are known to get wrong, with the numbers of the project's list."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import permutations, product
from math import pi
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.stability.contacts.scenes import (
    CUBE,
    DIAMOND,
    OCTAHEDRON,
    SLAB,
    SMALL_CUBE,
    STILL,
    TETRAHEDRON,
    TILT,
    Families,
    HardPair,
    Solid,
    box_of,
    each,
    family,
    hull_of,
    moved,
    placed,
    prism,
    random_turn,
    random_way,
    seen,
    shifted,
    solid,
    stretched,
    turned,
    turns,
)

OPENINGS = (1e-3, -1e-3, 1e-5, -1e-5, 1e-7, -1e-7, 1e-9, -1e-9, 1e-11, -1e-11, 1e-13, -1e-13)


FAMILIES: Families = {}


@family(FAMILIES, "random hulls, slightly opened")
def random_hulls(rng: np.random.Generator) -> list[HardPair]:
    """Random hulls of unit size in random poses, opened and closed."""
    made = []
    for k in range(12):
        one, two = hull_of(rng, 8 + k), shifted(hull_of(rng, 20 - k), 3 * random_way(rng))
        made.append(HardPair(f"pair {k + 1}", one, two, random_turn(rng)))
    return each(made, OPENINGS[2:])


@family(FAMILIES, "size 1 against 1e-3")
def small_on_large(rng: np.random.Generator) -> list[HardPair]:
    """Random hulls of size 1 and 1e-3."""
    made = []
    for k in range(6):
        one, two = hull_of(rng, 12), shifted(stretched(hull_of(rng, 12), 1e-3), 1.01 * random_way(rng))
        made.append(HardPair(f"pair {k + 1}", one, two, random_turn(rng)))
    return each(made, OPENINGS[:-4])


@family(FAMILIES, "boxes 1e-6 apart")
def millionth_gaps(rng: np.random.Generator) -> Iterable[HardPair]:
    """Boxes a millionth of their size apart."""
    for k, offset in enumerate([(1, 0, 0), (1, 0.3, 0.2), (0, 1, 0), (1, 1, 0), (1, 1, 1), (0.2, 0.1, -1)]):
        reach = np.array(offset, float)
        full = np.abs(reach) == 1
        reach[full] *= 2 + 1e-6
        for name, turn in (("as drawn", STILL), ("tilted", TILT), ("turned", random_turn(rng))):
            two = placed(shifted(CUBE, reach), turn)
            yield HardPair(f"offset {k + 1}, {name}", placed(CUBE, turn), two)


@family(FAMILIES, "normals at touch")
def normals(rng: np.random.Generator) -> list[HardPair]:
    """Contacts whose direction is known: edge to edge, face to face, of very different sizes too."""
    made = [
        HardPair(f"unit cubes, offset {offset}", SMALL_CUBE, shifted(SMALL_CUBE, offset))
        for offset in ((1, 1, 0), (0, 1, 1), (1, 0, 1), (1, 0, 0), (0, -1, 0), (1, 1, 1), (1, 1, 0.5), (1, 0.5, 0.25))
    ]
    large, tiny = stretched(SMALL_CUBE, 1e6), stretched(SMALL_CUBE, 1e-3)
    for axis in range(3):
        reach = np.zeros(3)
        reach[axis] = 0.5e6 + 0.5e-3
        made.append(HardPair(f"cubes of 1e6 and 1e-3 along axis {axis + 1}", large, shifted(tiny, reach)))
        made.append(HardPair(f"cubes of 1e-3 and 1e6 along axis {axis + 1}", tiny, shifted(large, -reach)))
    made += [
        HardPair("tetrahedra edge across edge", TETRAHEDRON, shifted(TETRAHEDRON, (0, 0, 2))),
        HardPair("octahedra vertex on vertex", OCTAHEDRON, shifted(OCTAHEDRON, (4, 0, 0))),
        HardPair("a diamond's edge on a face", DIAMOND, shifted(CUBE, (3, 0, 0))),
        HardPair("tilted cubes edge to edge", SMALL_CUBE, shifted(SMALL_CUBE, (1, 1, 0.25))),
    ]
    return [*made, *(scene.opened(0.0)._replace(transform=random_turn(rng)) for scene in made[::3])]


@family(FAMILIES, "thin prisms")
def thin_prisms(rng: np.random.Generator) -> Iterable[HardPair]:
    """Prisms of thickness 1e-6 and 1e-9 that overlap by half of it, cross each other, touch, or are just apart."""
    for sides, thickness in product((3, 4, 6), (1e-6, 1e-9)):
        thin = prism(sides, half=thickness / 2)
        name = f"{sides} sides, thickness {thickness:g}"
        yield from [
            HardPair(f"{name}, half of it overlaps", thin, shifted(thin, (0.1, 0.2, thickness / 2))),
            seen(f"{name}, tilted, half of it overlaps", thin, shifted(thin, (0.1, 0.2, thickness / 2)), TILT),
            HardPair(f"{name}, crossed", thin, shifted(thin, (0.1, 0.2, 0.0)), turned(0, 1.0)),
            HardPair(f"{name}, the same place", thin, thin),
            HardPair(f"{name}, touching", thin, shifted(thin, (0.1, 0.2, thickness))),
            HardPair(f"{name}, half of it apart", thin, shifted(thin, (0.1, 0.2, 1.5 * thickness))),
        ]  # fmt: skip


@family(FAMILIES, "the same place")
def coincident(rng: np.random.Generator) -> Iterable[HardPair]:
    """Solids at the same place, and touching ones of which libraries say that they overlap a little."""
    for name, turn in (("", STILL), (", tilted", TILT), (", turned", random_turn(rng))):
        for kind, own in (("cubes", CUBE), ("octahedra", OCTAHEDRON), ("tetrahedra", TETRAHEDRON)):
            yield HardPair(f"{kind} at the same place{name}", placed(own, turn), placed(own, turn))
        yield HardPair(f"cubes of one place and two sizes{name}", placed(CUBE, turn), placed(SLAB, turn))
        yield HardPair(f"cubes face to face{name}", placed(CUBE, turn), placed(shifted(CUBE, (2, 0, 0)), turn))
        yield HardPair(f"cubes beside each other{name}", placed(CUBE, turn), placed(shifted(CUBE, (2, 1, 1)), turn))


@family(FAMILIES, "FCL's boxes")
def fcl_boxes(rng: np.random.Generator) -> list[HardPair]:
    """Return the pairs of boxes of FCL's regression tests, in their poses, the second box as drawn."""
    return [
        HardPair(f"boxes {first} and {second}", box_of(first), box_of(second), _relative(one, two))
        for first, one, second, two in _FCL
    ]


@family(FAMILIES, "kissing cubes")
def kissing_cubes(rng: np.random.Generator) -> Iterable[HardPair]:
    """Tilted cubes face to face, opened by a few roundings, after FCL #493."""
    tilt = turned(0, pi / 12) @ turned(1, -pi / 18) @ turned(2, 17 * pi / 180)
    for side, opening in product((0.01, 0.25, 0.5, 10.0, 1000.0), (-1e-15, -2.5e-16, -1e-16, 0, 1e-16, 2.5e-16, 1e-15)):
        own, base = stretched(SMALL_CUBE, side), np.array([0, 0, 5 * side])
        one = moved(base, tilt)
        two = moved(base + tilt[:3, :3] @ [0, side + opening * max(1.0, side), 0], tilt)
        yield HardPair(f"side {side:g}, opened by {opening:g}", own, placed(own, two), one)


@family(FAMILIES, "nearly parallel edges")
def nearly_parallel_edges(rng: np.random.Generator) -> Iterable[HardPair]:
    """Boxes with nearly parallel edges a few millionths apart, after coal #604."""
    one, two = box_of((0.363, 0.277, 0.363)), box_of((0.363, 0.363, 0.277))
    for k in range(12):
        turn = turned(0, rng.uniform(-1e-2, 1e-2)) @ turned(1, rng.uniform(-1e-2, 1e-2))
        turn = turn @ turned(2, rng.uniform(-1e-2, 1e-2) * 10.0 ** -(k % 4))
        way = np.array([(1, 1, 0), (1, 0, 1), (0, 1, 1), (1, 0.1, 0.2)][k % 4], float)
        yield _apart_by(f"rotation {k + 1}", one, two, turn, way / np.linalg.norm(way), 3.575e-6)


@family(FAMILIES, "no thickness")
def flat_inputs(rng: np.random.Generator) -> list[HardPair]:
    """Bodies without thickness: no solids, which may be refused, but not answered wrong."""
    square = solid([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    triangle = solid([(0, 0, 0), (1, 0, 0), (0, 1, 0)], (0.25, 0.25, 0.0))
    upright = placed(square, np.array([[0, 0, 1.0, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]))
    return [
        HardPair("squares in parallel planes", square, shifted(square, (0.5, 0.25, 1))),
        HardPair("squares in one plane, apart", square, shifted(square, (2.5, 0.25, 0))),
        HardPair("squares in one plane, overlapping", square, shifted(square, (0.5, 0.25, 0))),
        HardPair("squares crossing", square, shifted(upright, (0.25, 0.125, 0.25))),
        HardPair("a square on a cube", square, shifted(CUBE, (0.25, 0.125, 1))),
        HardPair("a square in a cube", square, shifted(CUBE, (0.25, 0.125, 0.5))),
        HardPair("a square 1e-7 above a cube", square, shifted(CUBE, (0.25, 0.125, 1 + 1e-7))),
        HardPair("triangles in one plane, a corner shared", triangle, shifted(triangle, (1, 0, 0))),
        HardPair("triangles 1e-9 apart", triangle, shifted(triangle, (0.125, 0.125, 1e-9))),
        HardPair("a triangle tilted above a square", placed(triangle, TILT), shifted(square, (0, 0, -1.5))),
    ]


@family(FAMILIES, "boxes at 9e4", count=2)
def far_boxes(rng: np.random.Generator) -> Iterable[HardPair]:
    """Boxes of size 2 and 100 at coordinates about 9e4."""
    for name, place in (("one axis", (9e4, 0, 0)), ("two axes", (9e4, -9e4, 0)), ("three axes", (9e4, 9e4, -9e4))):
        for way, offset in (("face", (52, 3, 5)), ("edge", (52, 52, 5)), ("vertex", (52, 52, 52))):
            large = shifted(stretched(CUBE, 50.0), np.add(place, offset))
            yield HardPair(f"{name}, {way}", shifted(CUBE, place), large)
            yield seen(f"{name}, {way}, tilted", shifted(CUBE, place), large, TILT)


@family(FAMILIES, "rounded cubes", count=3)
def rounded_cubes(rng: np.random.Generator) -> Iterable[HardPair]:
    """Return the rounded cube of 24 vertices, all permutations of (+-a, +-a, +-b)."""
    a, b = 0.414213562373, 0.171572875254
    places = {(s * x, t * y, u * z) for x, y, z in permutations((a, a, b)) for s, t, u in product((1, -1), repeat=3)}
    own = solid(sorted(places))
    for k, offset in enumerate([(1.2, 0, 0), (1, 1, 0), (1, 1, 1), (1.1, 0.3, 0.2), (0.7, 0.9, -0.4)]):
        yield HardPair(f"two of them, offset {k + 1}", own, shifted(own, offset))
        yield HardPair(f"a cube, offset {k + 1}", own, shifted(stretched(CUBE, 0.5), offset), random_turn(rng))


@family(FAMILIES, "edges of no length")
def zero_edges(rng: np.random.Generator) -> list[HardPair]:
    """Triangles with an edge of no length: prisms and tetrahedra on them, corners named twice, or nearly twice."""
    made = []
    for name, step in (("none", 0.0), ("1e-16", 1e-16), ("1e-12", 1e-12), ("1e-9", 1e-9)):
        base = [(0, 0, 0), (1, 0, 0), (1, step, 0), (0, 1, 0)]
        wedge = solid([(x, y, z + h) for h in (0, 1) for x, y, z in base], (0.25, 0.25, 0.5))
        tip = solid([*base, (0.2, 0.2, 1)], (0.25, 0.25, 0.25))
        scenes = [
            HardPair(f"an edge of length {name}: prisms", wedge, shifted(wedge, (2, 0.25, 0.5))),
            HardPair(f"an edge of length {name}: tetrahedra", tip, shifted(tip, (1.5, 1, 0.5)), turned(2, 0.3)),
            HardPair(f"an edge of length {name}: on a cube", tip, shifted(CUBE, (0.25, 0.125, -2))),
        ]
        blur = step if step <= DEFAULT.planarity else 0.0
        made += [scene._replace(blur=2 * blur) for scene in scenes]
    flat = solid([(0, 0, 0), (1, 0, 0), (1, 0, 0)], (0.5, 0, 0))
    return [*turns(made, count=2), HardPair("a triangle that is a segment", flat, shifted(CUBE, (0.5, 0.25, 2)))]


@family(FAMILIES, "a box on a box")
def boxes_on_boxes(rng: np.random.Generator) -> Iterable[HardPair]:
    """Boxes of half size .1 on, .25 above, and .25 inside boxes of half size 1 to 100; resting off the middle too."""
    small = stretched(CUBE, 0.1)
    for half in (1.0, 10.0, 25.0, 50.0, 100.0):
        large = stretched(CUBE, half)
        for name, x, z in (
            ("resting", 0.25, half + 0.1),
            ("lifted by .25", 0.0, half + 0.35),
            ("inside by .25", 0.0, half - 0.15),
            ("resting on the rim", half - 0.25, half + 0.1),
        ):
            yield HardPair(f"half size {half:g}, {name}", small, large, moved((x, 0.0, z)))


@family(FAMILIES, "meshes that MuJoCo #3383 says touch", count=2)
def separated_meshes(rng: np.random.Generator) -> Iterable[HardPair]:
    """Small hulls of unlike widths, apart by their own size: MuJoCo 3.9 and 3.10 give one in twenty a distance of 0."""
    for k in range(24):
        sizes, widths = rng.integers(5, 30, 2).tolist(), rng.uniform(0.02, 0.3, (2, 3))
        one, two = (solid((rng.normal(size=(n, 3)) * width).tolist()) for n, width in zip(sizes, widths, strict=True))
        yield HardPair(f"pair {k + 1}", one, shifted(two, 1.2 * random_way(rng)))


@family(FAMILIES, "cubes at 100 m")
def cubes_far_out(rng: np.random.Generator) -> Iterable[HardPair]:
    """Cubes of 1000, 100, 50 and 10 mm at 100 m, and 100 m apart."""
    for side in (1.0, 0.1, 0.05, 0.01):
        own = stretched(SMALL_CUBE, side)
        for name, offset in (("face", (1, 0, 0)), ("edge", (1, 1, 0)), ("off the middle", (1, 0.3, 0.2))):
            two = shifted(own, 1.2 * side * np.array(offset))
            yield from turns([seen(f"side {side:g}, {name}", own, two, moved((100, 100, 100)))], count=3)
        yield HardPair(f"side {side:g}, 100 m apart", own, shifted(own, (100, 0, 0)), box=((1e-3, 1e6),) * 2)
        yield HardPair(f"side {side:g}, 100 m apart, tilted", own, shifted(own, (60, 80, 0)), TILT)


_FCL: list[tuple[tuple[float, ...], Any, tuple[float, ...], Any]] = [
    (
        (0.03, 0.12, 0.1),
        [[-3.0627937852578681533e-08, -0.99999999999999888978, -2.8893865161583314238e-08, 0.63499979627350811029],
         [0.9999999999999980016, -3.0627939739957803544e-08, 6.4729926918527511769e-08, -0.48500002215636439651],
         [-6.4729927722963847085e-08, -2.8893863029448751323e-08, 0.99999999999999711342, 1.0778146458339641356]],
        (0.025, 0.35, 1.845),
        [[0, -1, 0, 0.8], [1, 0, 0, -0.4575], [0, 0, 1, 1.0225]],
    ),
    (
        (0.46, 0.48, 0.01),
        [[1, 0, 0, -0.721], [0, 1, 0, -0.772], [0, 0, 1, 0.81]],
        (0.049521, 0.146, 0.0725),
        [[0.10758262492983036718, -0.6624881850015212903, -0.74130653817877356637, -0.42677133002999478872],
         [0.22682184885125472595, -0.709614040775253474, 0.6670830248314786326, -0.76596851247746788882],
         [-0.96797615037608542021, -0.23991106241273435495, 0.07392465377049164954, 0.80746731400091054098]],
    ),
    (
        (0.49, 0.05, 0.21),
        [[4.8966386501092529215e-12, -1, 0, -0.44], [1, 4.8966386501092529215e-12, 0, -0.61499999999858001587],
         [0, 0, 1, 0.355]],
        (0.035, 0.12, 0.03),
        [[0.83512153565236335595, -0.55006546945762568868, -9.4542360608233572896e-16, -0.40653441507331000704],
         [0.55006546945762568868, 0.83512153565236313391, 1.1787444236552387666e-15, -0.69166166923735727945],
         [1.2902271444330665572e-16, -1.4878153530113264589e-15, 1, 0.43057093858718892276]],
    ),
    (
        (0.614, 3, 0.37), [[1, 0, 0, -0.675], [0, 1, 0, 0], [0, 0, 1, 0.9115]],
        (0.494, 0.552, 0.01), [[1, 0, 0, -0.692], [0, 1, 0, 0], [0, 0, 1, 0.935]],
    ),
    (
        (0.2, 0.33, 0.1), [[1, 0, 0, -0.071], [0, 1, 0, -0.772], [0, 0, 1, 0.8]],
        (0.452, 0.27, 0.6), [[1, 0, 0, 0.121], [0, 1, 0, -0.78769605692727695523], [0, 0, 1, 0.53422044196125151316]],
    ),
    (
        (0.3165, 0.2276, 0.1768),
        [[0.44540578475530234748, 0.89532881496493399442, -8.8937407685638678971e-09, 1.2652949075960071568],
         [-0.89532881496493377238, 0.44540578475530190339, -2.8948680226084145336e-08, 1.4551012423210101243],
         [-2.1957263975186326105e-08, 2.0856732016652919226e-08, 0.99999999999999955591, 0.49480006232932938204]],
        (0.4943, 0.3546, 0.0752),
        [[0.44171122913485860728, 0.8971572827861190591, -1.622764514865468214e-09, 1.1304016226141906376],
         [-0.8971572827861190591, 0.44171122913485860728, -5.1621053952306079594e-09, 1.8410802645284281009],
         [-3.9144271413829990148e-09, 3.7360349218094348098e-09, 1, 0.44400006232932492933]],
    ),
]  # fmt: skip


def _relative(one: Any, two: Any) -> Array:
    """Return the pose of the first frame as the second one sees it."""
    first, second = (np.vstack([np.array(rows, float), [0, 0, 0, 1]]) for rows in (one, two))
    R = second[:3, :3].T
    return moved(R @ (first[:3, 3] - second[:3, 3]), np.block([[R @ first[:3, :3], np.zeros((3, 1))], [STILL[3:]]]))


def _apart_by(name: str, one: Solid, two: Solid, turn: Array, way: Array, gap: float) -> HardPair:
    """Return a scene with the second solid moved along a way until the largest separation is about a given gap."""
    P, Q = np.array(one["vertices"]) @ turn[:3, :3].T, np.array(two["vertices"])
    crosses = np.cross(turn[:3, :3].T[:, None], np.eye(3)[None]).reshape(-1, 3)
    lengths = np.linalg.norm(crosses, axis=1)
    n = np.vstack([turn[:3, :3].T, np.eye(3), crosses[lengths > 1e-6] / lengths[lengths > 1e-6, None]])
    n *= np.where(n @ way < 0, -1.0, 1.0)[:, None]
    # apart along n by t n.way - reach: the least t at which the widest is the gap
    reach, rate = (P @ n.T).max(axis=0) - (Q @ n.T).min(axis=0), n @ way
    moving = rate > 1e-3
    t = ((gap + reach[moving]) / rate[moving]).min()
    return HardPair(name, one, shifted(two, t * way), turn)
