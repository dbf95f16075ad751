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


def polyhedron(points: np.ndarray, faces: Sequence[Sequence[int]], unit: str, bore: float = 0.0) -> str:
    """Return a STEP file of a solid with plane faces, corners counter-clockwise seen from outside.

    With a `bore` of this radius along z, through the origin, from the faces that look along z to those against it.
    """
    part = Part()
    corners = [part.corner(x) for x in points]
    edges: dict[tuple[int, int], str] = {}
    shell = []
    rims: dict[bool, str] = {}
    if bore:
        x, z = np.eye(3)[[0, 2]]
        ends = [level * z for level in (points[:, 2].max(), points[:, 2].min())]
        places = [end + bore * x for end in ends]
        top, bottom = (part.corner(place) for place in places)
        rims = {
            up: part.curve(corner, corner, part.circle(end, z, x, bore))
            for up, corner, end in zip((True, False), (top, bottom), ends, strict=True)
        }
        seam = part.side(top, bottom, *places)
        surface = part.add(f"CYLINDRICAL_SURFACE('',{part.axes(ends[0], z, x)},{float(bore)!r})")
        shell.append(
            part.face([[(rims[True], True), (seam, True), (rims[False], False), (seam, False)]], surface, False)
        )
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
        holes = [[(rims[up], not up)]] if rims and abs(normal[2]) == 1 else []
        shell.append(part.face([sides, *holes], part.add(f"PLANE('',{axes})")))
    return part.text(shell, unit)


def revolved(profile: Sequence[Sequence[float]], axes: np.ndarray, unit: str = "mm") -> str:
    """Return a STEP file of what a closed profile sweeps about the third of the axes, its columns.

    Each row is a corner's radius and height, counter-clockwise, and where an arc leads to the next one those of its
    centre: straight sides sweep planes, cylinders and cones, arcs about a point of the axis spheres, others tori.
    """
    part, (x, y, z) = Part(), axes.T
    places = [r * x + h * z for r, h, *_ in profile]
    corners = [part.corner(place) for place in places]
    rims = [
        [part.curve(corner, corner, part.circle(h * z, z, x, r))] * (r > 0)
        for corner, (r, h, *_) in zip(corners, profile, strict=True)
    ]
    shell = []
    for j, (r, h, *centre) in enumerate(profile):
        k = (j + 1) % len(profile)
        s, g, *_ = profile[k]
        if r == s == 0 and not centre:
            continue  # the axis
        one, two = ([(rim, way) for rim in rims[end]] for end, way in ((j, True), (k, False)))
        if h == g and not centre:
            surface = part.add(f"PLANE('',{part.axes(h * z, z if s < r else -z, x)})")
            shell.append(part.face([own for own in ((one, two) if s < r else (two, one)) if own], surface))
            continue
        out = g > h
        if centre:
            c, d = centre
            out = (r - c) * (g - d) > (h - d) * (s - c)
            radius = float(np.hypot(r - c, h - d))
            seam = part.curve(corners[j], corners[k], part.circle(c * x + d * z, -y, x, radius), out)
            kind, sizes = ("TOROIDAL", f"{float(c)!r},{radius!r}") if c else ("SPHERICAL", f"{radius!r}")
            frame = part.axes(d * z, z, x)
        else:
            seam = part.side(corners[j], corners[k], places[j], places[k])
            wider = (s - r) * (g - h) > 0
            angle = float(np.arctan2(abs(s - r), abs(g - h)))
            kind, sizes = ("CYLINDRICAL", f"{float(r)!r}") if r == s else ("CONICAL", f"{float(r)!r},{angle!r}")
            frame = part.axes(h * z, z if wider or r == s else -z, x)
        surface = part.add(f"{kind}_SURFACE('',{frame},{sizes})")
        shell.append(part.face([[*one, (seam, True), *two, (seam, False)]], surface, bool(out)))
    return part.text(shell, unit)


def cylinder(radius: float, height: float, axes: np.ndarray) -> str:
    """Return a STEP file, in mm, of a cylinder from the origin along the third of the axes, its columns."""
    return revolved([(0, 0), (radius, 0), (radius, height), (0, height)], axes)
