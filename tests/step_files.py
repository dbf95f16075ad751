"""STEP files (AP214) of polyhedra and of a cylinder: the smallest that name faces, edges and a unit."""

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
        self.lines.append(text)
        return f"#{len(self.lines)}"

    def triple(self, kind: str, x: Iterable[float]) -> str:
        return self.add(f"{kind}('',({','.join(repr(float(value)) for value in x)}))")

    def point(self, x: Any) -> str:
        return self.triple("CARTESIAN_POINT", x)

    def direction(self, x: Any) -> str:
        return self.triple("DIRECTION", x)

    def axes(self, origin: Any, z: Any, x: Any) -> str:
        return self.add(f"AXIS2_PLACEMENT_3D('',{self.point(origin)},{self.direction(z)},{self.direction(x)})")

    def corner(self, x: Any) -> str:
        return self.add(f"VERTEX_POINT('',{self.point(x)})")

    def side(self, one: str, two: str, p: Any, q: Any) -> str:
        along = np.subtract(q, p)
        vector = self.add(f"VECTOR('',{self.direction(along / np.linalg.norm(along))},1.)")
        line = self.add(f"LINE('',{self.point(p)},{vector})")
        return self.add(f"EDGE_CURVE('',{one},{two},{line},.T.)")

    def face(self, sides: Sequence[tuple[str, bool]], surface: str) -> str:
        ways = [self.add(f"ORIENTED_EDGE('',*,*,{edge},{'.T.' if way else '.F.'})") for edge, way in sides]
        loop = self.add(f"EDGE_LOOP('',({','.join(ways)}))")
        bound = self.add(f"FACE_OUTER_BOUND('',{loop},.T.)")
        return self.add(f"ADVANCED_FACE('',({bound}),{surface},.T.)")

    def text(self, faces: Sequence[str], unit: str) -> str:
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


def polyhedron(points: np.ndarray, faces: Sequence[Sequence[int]], unit: str) -> str:
    """A STEP file of a solid with plane faces, corners counter-clockwise seen from outside."""
    part = Part()
    corners = [part.corner(x) for x in points]
    edges: dict[tuple[int, int], str] = {}
    shell = []
    for face in faces:
        sides = []
        for a, b in zip(face, [*face[1:], face[0]], strict=True):
            if (b, a) not in edges:
                edges[a, b] = part.side(corners[a], corners[b], points[a], points[b])
            sides.append((edges[a, b], True) if (a, b) in edges else (edges[b, a], False))
        outline = points[list(face)] - points[face[0]]
        normal = np.cross(outline, np.roll(outline, -1, axis=0)).sum(axis=0)
        axes = part.axes(points[face[0]], normal / np.linalg.norm(normal), outline[1] / np.linalg.norm(outline[1]))
        shell.append(part.face(sides, part.add(f"PLANE('',{axes})")))
    return part.text(shell, unit)


def cylinder(radius: float, height: float, axes: np.ndarray) -> str:
    """A STEP file, in mm, of a cylinder from the origin along the third of the axes, its columns."""
    part, (x, _, z) = Part(), axes.T
    ends = [np.zeros(3), height * z]
    corners = [part.corner(end + radius * x) for end in ends]
    circles = [part.add(f"CIRCLE('',{part.axes(end, z, x)},{radius!r})") for end in ends]
    rims = [part.add(f"EDGE_CURVE('',{v},{v},{own},.T.)") for v, own in zip(corners, circles, strict=True)]
    seam = part.side(*corners, *(end + radius * x for end in ends))
    surface = part.add(f"CYLINDRICAL_SURFACE('',{part.axes(ends[0], z, x)},{radius!r})")
    planes = [part.add(f"PLANE('',{part.axes(end, way * z, x)})") for end, way in zip(ends, (-1, 1), strict=True)]
    side = part.face([(rims[0], True), (seam, True), (rims[1], False), (seam, False)], surface)
    return part.text([side, part.face([(rims[0], False)], planes[0]), part.face([(rims[1], True)], planes[1])], "mm")
