"""STEP files (AP214) of polyhedra and of solids of revolution: the smallest that name faces, edges and a unit."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

UNITS = {"mm": ".MILLI.", "cm": ".CENTI.", "m": "$"}
FRAME = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','2000-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN {{ 1 0 10303 214 1 1 1 1 }}'));
ENDSEC;
DATA;
{}
ENDSEC;
END-ISO-10303-21;
"""


class Part:
    """Entities of a STEP file; each method adds one and returns its number as `#k`."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def add(self, text: str) -> str:
        """Add an entity."""
        self.lines.append(text)
        return f"#{len(self.lines)}"

    def triple(self, kind: str, x: Iterable[float]) -> str:
        """Add three numbers of a kind."""
        return self.add(f"{kind}('',({','.join(repr(float(value)) for value in x)}))")

    def point(self, x: Any) -> str:
        """Add a point."""
        return self.triple("CARTESIAN_POINT", x)

    def direction(self, x: Any) -> str:
        """Add a direction."""
        return self.triple("DIRECTION", x)

    def axes(self, origin: Any, z: Any, x: Any) -> str:
        """Add a frame."""
        return self.add(f"AXIS2_PLACEMENT_3D('',{self.point(origin)},{self.direction(z)},{self.direction(x)})")

    def corner(self, x: Any) -> str:
        """Add a vertex."""
        return self.add(f"VERTEX_POINT('',{self.point(x)})")

    def side(self, one: str, two: str, p: Any, q: Any) -> str:
        """Add a straight edge between two vertices."""
        along = np.subtract(q, p)
        vector = self.add(f"VECTOR('',{self.direction(along / np.linalg.norm(along))},1.)")
        return self.curve(one, two, self.add(f"LINE('',{self.point(p)},{vector})"))

    def circle(self, centre: Any, z: Any, x: Any, radius: float) -> str:
        """Add a circle."""
        return self.add(f"CIRCLE('',{self.axes(centre, z, x)},{float(radius)!r})")

    def curve(self, one: str, two: str, curve: str, way: bool = True) -> str:
        """Add an edge along a curve."""
        return self.add(f"EDGE_CURVE('',{one},{two},{curve},{'.T.' if way else '.F.'})")

    def face(self, loops: Sequence[Sequence[tuple[str, bool]]], surface: str, way: bool = True) -> str:
        """Add a face of loops, counter-clockwise seen from outside, the outer first; `way`: as the surface itself."""
        bounds: list[str] = []
        for sides in loops:
            ways = [self.add(f"ORIENTED_EDGE('',*,*,{edge},{'.T.' if along else '.F.'})") for edge, along in sides]
            loop = self.add(f"EDGE_LOOP('',({','.join(ways)}))")
            bounds.append(self.add(f"FACE_{'' if bounds else 'OUTER_'}BOUND('',{loop},.T.)"))
        return self.add(f"ADVANCED_FACE('',({','.join(bounds)}),{surface},{'.T.' if way else '.F.'})")

    def text(self, faces: Sequence[str], unit: str) -> str:
        """Return the file with these faces."""
        shell = self.add(f"CLOSED_SHELL('',({','.join(faces)}))")
        solid = self.add(f"MANIFOLD_SOLID_BREP('',{shell})")
        origin = self.axes((0, 0, 0), (0, 0, 1), (1, 0, 0))
        metre = UNITS.get(unit, ".MILLI.")
        length = self.add(f"(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({metre},.METRE.))")
        if unit == "in":
            size = self.add(f"LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),{length})")
            powers = self.add("DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.)")
            length = self.add(f"(CONVERSION_BASED_UNIT('INCH',{size})LENGTH_UNIT()NAMED_UNIT({powers}))")
        angle = self.add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))")
        cone = self.add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())")
        slack = self.add(f"UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),{length},'accuracy','')")
        context = self.add(
            f"(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT(({slack}))"
            f"GLOBAL_UNIT_ASSIGNED_CONTEXT(({length},{angle},{cone}))REPRESENTATION_CONTEXT('',''))"
        )
        shape = self.add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({origin},{solid}),{context})")
        application = self.add("APPLICATION_CONTEXT('automotive design')")
        kind = self.add(f"PRODUCT_CONTEXT('',{application},'mechanical')")
        product = self.add(f"PRODUCT('part','part','',({kind}))")
        formation = self.add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
        stage = self.add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')")
        definition = self.add(f"PRODUCT_DEFINITION('design','',{formation},{stage})")
        own = self.add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
        self.add(f"SHAPE_DEFINITION_REPRESENTATION({own},{shape})")
        return FRAME.format("\n".join(f"#{k + 1}={line};" for k, line in enumerate(self.lines)))


def _seams(axes: np.ndarray, split: bool) -> list[np.ndarray]:
    """Return the directions, from the third of some axes, at which round faces about it have a seam."""
    return [axes[:, 0], -axes[:, 0]] if split else [axes[:, 0]]


def _rim(part: Part, ends: Sequence[str], centre: Any, axes: np.ndarray, radius: float) -> list[str]:
    """Add a circle about the third of some axes, an edge from each of its vertices to the next."""
    x, _, z = axes.T
    circle = part.circle(centre, z, x, radius)
    return [part.curve(one, two, circle) for one, two in zip(ends, [*ends[1:], ends[0]], strict=True)]


def _swept(
    part: Part, rims: Sequence[Sequence[str]], seams: Sequence[str], surfaces: Sequence[str], out: bool
) -> list[str]:
    """Add the faces between two rims and the seams from the one to the other, which are none at a tip."""
    faces = []
    for k, surface in enumerate(surfaces):
        one, two = ([(own[k], along)] if own else [] for own, along in zip(rims, (True, False), strict=True))
        loop = [*one, (seams[(k + 1) % len(seams)], True), *two, (seams[k], False)]
        faces.append(part.face([loop], surface, out))
    return faces


def _around(edges: Sequence[str], along: bool) -> list[tuple[str, bool]]:
    """Return a loop along the edges of a rim, or against them."""
    return [(own, along) for own in (edges if along else reversed(edges))]


def polyhedron(
    points: np.ndarray, faces: Sequence[Sequence[int]], unit: str, bore: float = 0.0, *, split: bool = False
) -> str:
    """Return a STEP file of a solid with plane faces, corners counter-clockwise seen from outside.

    With a `bore` of this radius along z, through the origin, from the faces that look along z to those against it;
    `split`: in two halves along its axis.
    """
    part = Part()
    corners = [part.corner(x) for x in points]
    edges: dict[tuple[int, int], str] = {}
    shell = []
    rims: dict[bool, list[str]] = {}
    if bore:
        frame = np.eye(3)
        x, z = frame[[0, 2]]
        ends = [level * z for level in (points[:, 2].max(), points[:, 2].min())]
        places = [[end + bore * side for side in _seams(frame, split)] for end in ends]
        vertices = [[part.corner(place) for place in own] for own in places]
        found = [_rim(part, own, end, frame, bore) for own, end in zip(vertices, ends, strict=True)]
        rims = dict(zip((True, False), found, strict=True))
        both = zip(*vertices, *places, strict=True)
        seams = [part.side(top, bottom, *own) for top, bottom, *own in both]
        frames = [part.axes(end, along, x) for end, along in zip(ends, (z, -z), strict=True)][: len(seams)]
        surfaces = [part.add(f"CYLINDRICAL_SURFACE('',{own},{float(bore)!r})") for own in frames]
        shell += _swept(part, found, seams, surfaces, False)
    for face in faces:
        sides = []
        for a, b in zip(face, [*face[1:], face[0]], strict=True):
            if (b, a) not in edges:
                edges[a, b] = part.side(corners[a], corners[b], points[a], points[b])
            sides.append((edges[a, b], True) if (a, b) in edges else (edges[b, a], False))
        outline = points[list(face)] - points[face[0]]
        normal = np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0)
        normal /= np.linalg.norm(normal)
        axes = part.axes(points[face[0]], normal, outline[1] / np.linalg.norm(outline[1]))
        up = bool(normal[2] > 0)
        holes = [_around(rims[up], not up)] if rims and abs(normal[2]) == 1 else []
        shell.append(part.face([sides, *holes], part.add(f"PLANE('',{axes})")))
    return part.text(shell, unit)


def revolved(profile: Sequence[Sequence[float]], axes: np.ndarray, unit: str = "mm", *, split: bool = False) -> str:
    """Return a STEP file of what a closed profile sweeps about the third of the axes, its columns.

    Each row is a corner's radius and height, counter-clockwise, and where an arc leads to the next one those of its
    centre: straight sides sweep planes, cylinders and cones, arcs about a point of the axis spheres, others tori.
    `split`: round faces in two halves, as many CAD systems write them, each with a frame of its own.
    """
    part, (x, y, z), seamed = Part(), axes.T, _seams(axes, split)
    places = [[r * side + h * z for side in (seamed if r > 0 else seamed[:1])] for r, h, *_ in profile]
    corners = [[part.corner(place) for place in own] for own in places]
    rims = [_rim(part, own, h * z, axes, r) if r > 0 else [] for own, (r, h, *_) in zip(corners, profile, strict=True)]
    shell = []
    for j, (r, h, *centre) in enumerate(profile):
        k = (j + 1) % len(profile)
        s, g, *_ = profile[k]
        if r == s == 0 and not centre:
            continue  # the axis
        if h == g and not centre:
            surface = part.add(f"PLANE('',{part.axes(h * z, z if s < r else -z, x)})")
            loops = [_around(rims[j], True), _around(rims[k], False)]
            shell.append(part.face([own for own in loops[:: 1 if s < r else -1] if own], surface))
            continue
        out, seams, surfaces = g > h, list[str](), list[str]()
        for number, side in enumerate(seamed):
            one, two = (own[number % len(own)] for own in (corners[j], corners[k]))
            if centre:
                c, d = centre
                out = (r - c) * (g - d) > (h - d) * (s - c)
                radius, turned = float(np.hypot(r - c, h - d)), -y if number == 0 else y
                seams.append(part.curve(one, two, part.circle(c * side + d * z, turned, side, radius), out))
                kind, sizes = ("TOROIDAL", f"{float(c)!r},{radius!r}") if c else ("SPHERICAL", f"{radius!r}")
                frame = part.axes(d * z, z if number == 0 else -z, x)
            else:
                seams.append(part.side(one, two, *(places[end][number % len(places[end])] for end in (j, k))))
                wider = (s - r) * (g - h) > 0
                angle = float(np.arctan2(abs(s - r), abs(g - h)))
                kind, own, level = "CONICAL", *((s, g) if number and s else (r, h))
                sizes, along = f"{float(own)!r},{angle!r}", z if wider else -z
                if r == s:
                    kind, sizes, along = "CYLINDRICAL", f"{float(r)!r}", z if number == 0 else -z
                frame = part.axes(level * z, along, x)
            surfaces.append(part.add(f"{kind}_SURFACE('',{frame},{sizes})"))
        shell += _swept(part, (rims[j], rims[k]), seams, surfaces, bool(out))
    return part.text(shell, unit)


def cylinder(radius: float, height: float, axes: np.ndarray) -> str:
    """Return a STEP file, in mm, of a cylinder from the origin along the third of the axes, its columns."""
    return revolved([(0, 0), (radius, 0), (radius, height), (0, height)], axes)
