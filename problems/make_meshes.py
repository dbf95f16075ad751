"""Makes the meshes of the problem files, all small enough to read.

Own making, under the project's licence (Apache-2.0). `python problems/make_meshes.py` writes them to `meshes/`; running
it again gives the same bytes. Lengths in mm unless said otherwise; every solid is drawn where its problem wants it. The
formats differ on purpose, so that the problems exercise every reader: see `MESHES` at the end.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

FOLDER = Path(__file__).parent / "meshes"
HALF_HEIGHT = np.sqrt(3.0) / 2.0


class Solid(NamedTuple):
    """Corners (n, 3) and polygons as rows of corners, counter-clockwise seen from outside."""

    vertices: np.ndarray
    faces: list[list[int]]

    def triangles(self) -> list[list[int]]:
        """Return the polygons cut into triangles."""
        return [triangle for face in self.faces for triangle in ears(self.vertices, face)]


# --------------------------------------------------------------------------------------------------------------- solids


def prism(outline: Sequence[Sequence[float]], low: float, high: float) -> Solid:
    """Return a prism along z over a simple polygon, given counter-clockwise."""
    count = len(outline)
    vertices = [(*corner, level) for level in (low, high) for corner in outline]
    ring = [[k, (k + 1) % count, (k + 1) % count + count, k + count] for k in range(count)]
    faces = [list(range(count))[::-1], list(range(count, 2 * count)), *ring]
    return Solid(np.array(vertices, dtype=float), faces)


def tube(outside: Sequence[Sequence[float]], inside: Sequence[Sequence[float]], low: float, high: float) -> Solid:
    """Return a prism along z with a hole, from two polygons of equally many corners that face each other."""
    count = len(outside)
    vertices = [(*corner, level) for level in (low, high) for outline in (outside, inside) for corner in outline]
    faces = []
    for k in range(count):
        a, b = k, (k + 1) % count  # below: outside, then inside; the same above
        faces += [
            [a, b, b + 2 * count, a + 2 * count],
            [b + count, a + count, a + 3 * count, b + 3 * count],
            [b, a, a + count, b + count],
            [a + 2 * count, b + 2 * count, b + 3 * count, a + 3 * count],
        ]
    return Solid(np.array(vertices), faces)


def stepped(outside: Solid, inside: Solid, *, top: bool) -> Solid:
    """Return two boxes of `box` as one solid: the inside box hangs down from the outside one's top or bottom.

    From the top it is a pocket, from the bottom a plug; a ring of quads joins them there.
    """
    ring = [4, 5, 6, 7] if top else [0, 1, 2, 3]
    open_end = [12, 13, 14, 15]
    kept = [face for face in outside.faces if set(face) != set(ring)]
    hanging = [[k + 8 for k in face] for face in inside.faces]
    hanging = [face[::-1] if top else face for face in hanging if set(face) != set(open_end)]
    joined = [[ring[k - 1], ring[k], open_end[k], open_end[k - 1]] for k in range(4)]
    joined = joined if top else [face[::-1] for face in joined]
    return Solid(np.vstack([outside.vertices, inside.vertices]), kept + joined + hanging)


def box(*ranges: tuple[float, float]) -> Solid:
    """Return an axis-aligned box from its ranges in x, y, z; corners 0 to 3 below, 4 to 7 above."""
    (x0, x1), (y0, y1), (z0, z1) = ranges
    return prism([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], z0, z1)


def together(*solids: Solid) -> Solid:
    """Return separate solids as one mesh."""
    starts = np.cumsum([0] + [len(solid.vertices) for solid in solids])
    faces = [
        [int(start) + k for k in face] for start, solid in zip(starts, solids, strict=False) for face in solid.faces
    ]
    return Solid(np.vstack([solid.vertices for solid in solids]), faces)


def upright(solid: Solid) -> Solid:
    """Return a solid turned about x, so that what was drawn in x and y stands in x and z."""
    x, y, z = solid.vertices.T
    return solid._replace(vertices=np.column_stack([x, -z + 0.0, y]))


def square(half: float, middle: tuple[float, float] = (0.0, 0.0)) -> list[tuple[float, float]]:
    """Return a square by half its width."""
    return [(middle[0] + x * half, middle[1] + y * half) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]


def hexagon(apothem: float, middle: tuple[float, float] = (0.0, 0.0)) -> list[tuple[float, float]]:
    """Return a regular hexagon with two sides across x, by half its width over flats."""
    radius = apothem / HALF_HEIGHT
    corners = [(1, -0.5), (1, 0.5), (0, 1), (-1, 0.5), (-1, -0.5), (0, -1)]
    return [(middle[0] + x * apothem, middle[1] + y * radius) for x, y in corners]


def gear(teeth: Sequence[float], centre: float, *, number: int = 20, module: float = 4.0, play: float = 0.25) -> Solid:
    """Return a sector of a spur gear: teeth at these angles in degrees, flanks of two chords of the involute.

    The pressure angle is 20 degrees; each tooth is thinner by `play` than half the pitch. Corners are rounded to
    a tenth of a micrometre, so that the file is the same on every machine.
    """
    pitch = module * number / 2.0
    base = pitch * np.cos(np.radians(20.0))
    half = np.pi / (2.0 * number) - play / (2.0 * pitch)

    def involute(radius: float) -> float:
        turn = np.arccos(min(1.0, base / radius))
        return float(np.tan(turn) - turn)

    flank = [(r, half + involute(pitch) - involute(r)) for r in (pitch - 1.25 * module, pitch, pitch + module)]
    step = np.pi / number
    ends = [np.radians(teeth[0]) - step, np.radians(teeth[-1]) + step]
    polar = [(pitch - 2.5 * module, ends[0]), (flank[0][0], ends[0])]
    for tooth in np.radians(teeth):
        polar += [(r, tooth - psi) for r, psi in flank] + [(r, tooth + psi) for r, psi in reversed(flank)]
    polar += [(flank[0][0], ends[1]), (pitch - 2.5 * module, ends[1])]
    outline = [(round(centre + r * np.cos(t), 4) + 0.0, round(r * np.sin(t), 4) + 0.0) for r, t in polar]
    return prism(outline, 0.0, 10.0)


def ears(vertices: np.ndarray, face: Sequence[int]) -> list[list[int]]:
    """Return a simple planar polygon cut into triangles, one ear after the other."""
    points = vertices[list(face)]
    normal = np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
    left, found = list(face), []

    def side(a: int, b: int, c: int) -> float:
        return float(normal @ np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a]))

    def is_ear(k: int) -> bool:
        a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
        others = [p for p in left if p not in (a, b, c)]
        blocked = any(min(side(a, b, p), side(b, c, p), side(c, a, p)) >= 0.0 for p in others)
        return side(a, b, c) > 0.0 and not blocked

    while len(left) > 3:
        k = next(k for k in range(len(left)) if is_ear(k))  # a simple polygon has two
        found.append([left[k - 1], left[k], left[(k + 1) % len(left)]])
        left.pop(k)
    return [*found, left]


# -------------------------------------------------------------------------------------------------------------- formats


def stl_text(solid: Solid) -> bytes:
    """Return ASCII STL."""
    lines = ["solid mesh"]
    for triangle in solid.triangles():
        lines += [" facet normal 0 0 0", "  outer loop"]
        lines += [f"   vertex {numbers(solid.vertices[k])}" for k in triangle]
        lines += ["  endloop", " endfacet"]
    return text([*lines, "endsolid mesh"])


def stl_binary(solid: Solid) -> bytes:
    """Return binary STL; its floats are short."""
    head = b"binary, by make_meshes.py".ljust(80) + struct.pack("<I", len(solid.triangles()))
    return head + b"".join(
        struct.pack("<12fH", *np.zeros(3), *solid.vertices[triangle].ravel(), 0) for triangle in solid.triangles()
    )


def obj(solid: Solid) -> bytes:
    """Return OBJ with polygons, numbered from 1."""
    corners = [f"v {numbers(vertex)}" for vertex in solid.vertices]
    return text([*corners, *("f " + " ".join(str(k + 1) for k in face) for face in solid.faces)])


def off(solid: Solid) -> bytes:
    """Return OFF with polygons."""
    head = ["OFF", f"{len(solid.vertices)} {len(solid.faces)} 0"]
    return text([*head, *map(numbers, solid.vertices), *_counted(solid.faces)])


def ply_text(solid: Solid) -> bytes:
    """Return ASCII PLY with polygons and long floats."""
    return text([*_ply_head(solid, solid.faces, "ascii"), *map(numbers, solid.vertices), *_counted(solid.faces)])


def ply_binary(solid: Solid) -> bytes:
    """Return binary PLY with triangles and long floats."""
    triangles = solid.triangles()
    rows = b"".join(struct.pack("<B3i", 3, *triangle) for triangle in triangles)
    return text(_ply_head(solid, triangles, "binary_little_endian")) + solid.vertices.astype("<f8").tobytes() + rows


def glb(solid: Solid) -> bytes:
    """Return binary glTF with short floats in mm under a node that scales them to metres, the format's unit."""
    triangles = np.array(solid.triangles(), dtype="<u4")
    points = solid.vertices.astype("<f4")
    data = points.tobytes() + triangles.tobytes()
    views = [(0, points.nbytes, 34962), (points.nbytes, triangles.nbytes, 34963)]
    content = {
        "asset": {"version": "2.0", "generator": "make_meshes.py"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [0.001, 0.001, 0.001]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": len(points),
                "type": "VEC3",
                "min": points.min(axis=0).tolist(),
                "max": points.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": 5125, "count": triangles.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": length, "target": target}
            for start, length, target in views
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    head = json.dumps(content, separators=(",", ":")).encode()
    head = head.ljust(-(-len(head) // 4) * 4)
    chunks = struct.pack("<I4s", len(head), b"JSON") + head + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def in_unit(length: float, write: Callable[[Solid], bytes]) -> Callable[[Solid], bytes]:
    """Return a writer whose numbers count units of this many mm."""
    return lambda solid: write(solid._replace(vertices=solid.vertices / length))


def numbers(values: Sequence[float]) -> str:
    """Return numbers with as many digits as it takes to read the same floats again."""
    return " ".join(repr(float(value)).removesuffix(".0") for value in values)


def text(lines: Sequence[str]) -> bytes:
    """Return lines as bytes, with the same line ends everywhere."""
    return "".join(f"{line}\n" for line in lines).encode()


def _counted(faces: Sequence[Sequence[int]]) -> list[str]:
    return [" ".join(map(str, (len(face), *face))) for face in faces]


def _ply_head(solid: Solid, faces: Sequence[Sequence[int]], kind: str) -> list[str]:
    return [
        "ply",
        f"format {kind} 1.0",
        f"element vertex {len(solid.vertices)}",
        *(f"property double {name}" for name in "xyz"),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]


# --------------------------------------------------------------------------------------------------------------- meshes

RAIL = [(-24, -8), (24, -8), (24, 0), (10, 0), (14, 8), (-14, 8), (-10, 0), (-24, 0)]
SLIDE = [(-24, 0), (-10.5, 0), (-15, 9), (15, 9), (10.5, 0), (24, 0), (24, 16), (-24, 16)]
SHAFT = [(8, -20), (20, -8), (20, 8), (8, 20), (6.25, 20), (6.25, 12)]
SHAFT += [(-x, y) for x, y in reversed(SHAFT)]
SLOT = [(-15, 0), (15, 0), (15, 20), (5.0625, 20), (5.0625, 12), (-5.0625, 12), (-5.0625, 20), (-15, 20)]
BRACKET = [(-15, 2), (15, 2), (15, 5), (-9, 5), (-9, 30), (-15, 30)]

MESHES: dict[str, tuple[Solid, Callable[[Solid], bytes]]] = {
    "square_plate.stl": (tube(square(20), square(10), 0, 10), stl_binary),
    "square_peg.stl": (prism(square(9.75, (0.25, -0.125)), -8, 18), stl_text),
    "hexagon_plate.off": (tube(hexagon(16), hexagon(10), 0, 10), off),
    "hexagon_peg.ply": (prism(hexagon(9.75, (0.25, 0.0)), -8, 18), ply_text),
    "dovetail_rail.obj": (upright(prism(RAIL, -30, 30)), obj),
    "dovetail_slide.obj": (upright(prism(SLIDE, -15, 15)), obj),
    "keyway_shaft.ply": (prism(SHAFT, -30, 30), ply_binary),
    "keyway_key.off": (box((-6, 6), (12, 24), (-40, 40)), off),
    "lid_box.glb": (stepped(box((-20, 20), (-15, 15), (-20, 0)), box((-18, 18), (-13, 13), (-18, 0)), top=True), glb),
    "lid.glb": (stepped(box((-20, 20), (-15, 15), (0, 4)), box((-17.5, 17.5), (-12.5, 12.5), (-3, 0)), top=False), glb),
    "gear_driver.obj": (gear([-17.75, 0.25, 18.25], 0.0), obj),
    "gear_driven.obj": (gear([153, 171, 189, 207], 80.0), obj),
    "nut.off": (tube(hexagon(16), hexagon(10.25), -5, 5), off),
    "nut_key.ply": (prism(hexagon(10), -50, 20), ply_binary),
    "bracket.obj": (upright(prism(BRACKET, -12, 12)), in_unit(10, obj)),  # in cm
    "bracket_plate.stl": (box((-40, 40), (-20, 20), (-8, 0)), stl_binary),
    "slot.stl": (prism(SLOT, 0, 30), stl_binary),
    "slot_key.stl": (box((-5, 5), (12.125, 20.125), (2, 28)), stl_binary),
    "bracket_ribs.off": (together(box((14, 18), (-20, 20), (0, 1.5)), box((-22, -18), (-20, 20), (0, 1.5))), off),
}


def main(folder: Path = FOLDER) -> None:
    """Write every mesh."""
    folder.mkdir(exist_ok=True)
    for name, (solid, write) in MESHES.items():
        (folder / name).write_bytes(write(solid))


if __name__ == "__main__":
    main()
