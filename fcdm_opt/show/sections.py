"""Contacts magnified: a section through both bodies where they touch, before the motion and after it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.curve.contact import Contact
from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import deviation_of, gaps_off, round_surfaces
from fcdm_opt.geometry.facets import nearest_of_surfaces
from fcdm_opt.geometry.patches import line_of_contact, true_faces
from fcdm_opt.geometry.polygons import distances, fans
from fcdm_opt.geometry.solids import PlacedSolids
from fcdm_opt.geometry.tessellation import Swept, onto
from fcdm_opt.show import DARK, GREEN, GREY, NOTE, PURPLE
from fcdm_opt.show.lettering import Sheet, clipped, rounded_down
from fcdm_opt.tolerances import DEFAULT

INSET = 1.55  # inches across of an inset
CORNER = 0.8  # of half an inset: the bar of known length, and its label, are at most so long
STEPS, STILL, LARGEST = 3.0, 0.1, 0.75
"""Half of what an inset shows: this many times the gap that the motion closed there, or how far the contact slid where
it closed none; this share of the size where it went nowhere; at most this share."""

ALONG_AXIS, ACROSS_AXIS, LEVEL, TURNED = 1.0 - 1e-6, 2e-3, 0.9, 0.7
"""Component of a direction along an axis of the world from which on it is that axis, and up to which it is across it;
along z, of a level section; and of a section along an axis from which on it is turned to face that."""

SLIVER = 0.15  # share of a body's extent that a cut leaves at least
WIDEST = 0.1  # share of a body's size: a gap that is wider is seen without a window
ON_CURVE, ROUNDED = 12, 4.0
"""Pieces that a side of a facet is drawn in where its face is round; corners that are farther off than so many times
what facets leave of round faces stay where they are."""

LEVEL_OFFSET = 1e-6
"""Share of the size by which bodies are cut before a contact: faces in the plane itself are neither cut nor left."""

VIEWS = (("from the left", "from the right"), ("from the front", "from the back"), ("from below", "from above"))
"""From where a section is seen that faces along x, y and z, down and up."""


class Touching(NamedTuple):
    """Where two bodies touch, overlap, or are nearest to each other: its `kind` is "contact", "overlap" or "gap".

    `pieces`, (k, 3) each, are corners of convex polygons that make up the area that they share, or of the line or
    point, world frame; `normal`, (3,), is a unit vector across it. Of an overlap the pieces are the surface, and
    `across`, (2, 3), are points of both bodies' surfaces where it is deep; of a gap they are what is nearest of the
    second body, and `across` goes over the gap. `number` is as texts and tables count contacts, 0 where it is the only
    one, or one of very many; `text` is what touches what, and `pair` has the rows of both bodies among those shown.
    """

    pieces: tuple[Array, ...]
    normal: Array
    across: Array | None = None
    number: int = 0
    text: str = ""
    kind: str = "contact"
    pair: tuple[int, int] = (0, 1)

    @property
    def middle(self) -> Array:
        """A point of the contact, as near its middle as any."""
        if self.across is not None:
            return np.asarray(self.across.mean(axis=0))
        middles = np.array([piece.mean(axis=0) for piece in self.pieces])
        return np.asarray(middles[np.linalg.norm(middles - middles.mean(axis=0), axis=1).argmin()])

    @property
    def long(self) -> float:
        """How deep an overlap is, or how wide a gap, where `across` tells; 0 of a contact."""
        return 0.0 if self.across is None else float(np.linalg.norm(self.across[1] - self.across[0]))

    @property
    def colour(self) -> str:
        """What it is drawn in."""
        return {"contact": GREEN, "overlap": PURPLE, "gap": GREY}[self.kind]

    @property
    def is_overlap(self) -> bool:
        """Whether it is one."""
        return self.kind == "overlap"

    @property
    def is_wide(self) -> bool:
        """Whether it is a line or an area: no point."""
        return len(self.pieces[0]) > 1

    def moved(self, pose: Array) -> Touching:
        """Return the same after a rigid motion, (4, 4)."""
        turn, shift = pose[:3, :3], pose[:3, 3]
        across = None if self.across is None else self.across @ turn.T + shift
        pieces = tuple(own @ turn.T + shift for own in self.pieces)
        return self._replace(pieces=pieces, normal=turn @ self.normal, across=across)

    @classmethod
    def overlap(cls, movable: Body, static: Body) -> Touching | None:
        """Return what bodies as they are shown have in common, None where that is nothing, or may be their facets'."""
        solids = PlacedSolids(movable, static, np.ones(2), np.eye(4))
        pieces = solids.common()
        across = solids.deep_in(pieces) + static.seed if pieces else np.zeros((2, 3))
        depth = float(np.linalg.norm(across[1] - across[0]))
        if not depth > DEFAULT.touch * solids.size + gaps_off((movable, static))[0]:
            return None
        surface = [static.seed + triangle for corners, rows in pieces for triangle in corners[rows]]
        return cls(tuple(surface), (across[1] - across[0]) / depth, across, kind="overlap")

    @classmethod
    def gap(cls, curve: DecisionCurve, rho: Array, movable: Body, static: Body) -> Touching | None:
        """Return where bodies as they are shown, in the curve's pose at these scales, are nearest to each other.

        None where they touch, or are farther apart than can be shown with both of them. Brought together along what is
        shortest they touch there, as far as faces that lie side by side do.
        """
        (points, rows), (others, facing) = surface_of(movable), surface_of(static)
        long, across = nearest_of_surfaces(points, rows, others, facing)
        size = min(movable.size, static.size)
        if not DEFAULT.touch * size < long < WIDEST * size:
            return None
        pose = np.array(curve.transform)
        pose[:3, 3] += across[1] - across[0]
        met = touching(decision_curve(curve.movable, curve.static, box=curve.box, transform=pose), rho)
        corners = max((own for _, own in met), key=lambda own: float(np.ptp(own, axis=0).max()), default=across[1:])
        start = corners.mean(axis=0)
        across = np.array([start - (across[1] - across[0]), start])
        return cls((corners,), (across[1] - across[0]) / long, across, kind="gap")

    @classmethod
    def of(cls, feature: Feature, pieces: Sequence[Array], movable: Body, static: Body) -> Touching:
        """Return a contact of bodies as they are shown."""
        pieces = tuple(pieces)
        both = (movable, feature.one), (static, feature.two)
        sides = [(element.kind, body.vertices[np.array(element.vertices) - 1]) for body, element in both]
        flat = [*pieces[: len(pieces[0]) > 2], *(own for kind, own in sides if kind == "F")]
        if flat:
            return cls(pieces, np.linalg.svd(flat[0] - flat[0].mean(axis=0))[2][2])
        ends = [np.diff(own, axis=0)[0] for kind, own in sides if kind == "E"]
        across = np.cross(*ends) if len(ends) == 2 else np.zeros(3)
        if not np.linalg.norm(across) > 1e-9 * movable.size * static.size:
            across = static.seed - movable.seed
        return cls(pieces, across / max(float(np.linalg.norm(across)), 1e-300))


def touching(curve: DecisionCurve, rho: ArrayLike) -> list[tuple[Contact, Array]]:
    """Return what touches at a scale pair, as `DecisionCurve.touching`; of bodies exact at points along whole lines.

    A cylinder that is exact at a point of a plane touches it all along.
    """
    bodies = curve.movable, curve.static
    faces = [true_faces(body.of_facets) for body in bodies]
    found = list[tuple[Contact, Array]]()
    for contact, corners in curve.touching(rho):
        sides = zip(bodies, (contact.feature.one, contact.feature.two), strict=True)
        if any(body.piece_of(own) is not None for body, own in sides):
            line = line_of_contact(faces, np.asarray(rho), curve.transform, corners.mean(axis=0))
            corners = corners if line is None else line
        found.append((contact, corners))
    return found


class Cut(NamedTuple):
    """A plane at which bodies are cut open; what stands before it is taken away.

    `point`, (3,), is on it, `facing`, (3,), is its unit normal, towards the reader, and `plane`, (3, 2), has its
    directions, right and up.
    """

    point: Array
    facing: Array
    plane: Array

    @classmethod
    def through(cls, contacts: Sequence[Touching], bodies: Sequence[Body], page: Array) -> tuple[Cut | None, float]:
        """Return the plane through the middle of a contact that meets the largest share of them, and that share.

        Those of one number are one contact; of planes that meet as many, the one that meets most of their areas. Of
        those across the first contact; None where each leaves but a sliver of some body.
        """
        first, found = contacts[0], list[tuple[float, float, Cut]]()
        numbers = np.array([each.number or -k for k, each in enumerate(contacts, 1)])
        each_once = numbers == np.unique(numbers)[:, None]
        facing, _ = section_plane(first.normal, np.zeros(3), page)
        for step in (np.zeros(3), facing):
            facing, plane = section_plane(first.normal, step, page)
            ends = np.array([(own.min(), own.max()) for own in (np.vstack(each.pieces) @ facing for each in contacts)])
            levels = np.array([first.middle @ facing]) if first.is_overlap else ends.mean(axis=1)
            within = (ends[:, :1] <= levels) & (levels <= ends[:, 1:])
            met, areas = (each_once[:, :, None] & within).any(axis=1).mean(axis=0), within.mean(axis=0)
            best = np.lexsort((areas, met))[-1]
            level = levels[best] + LEVEL_OFFSET * max(body.size for body in bodies)
            point = first.middle + (level - first.middle @ facing) * facing
            depths = [-(body.vertices - point) @ facing for body in bodies]
            if not any(0.0 < own.max() < SLIVER * np.ptp(own) for own in depths):
                found.append((float(met[best]), float(areas[best]), cls(point, facing, plane)))
        share, _, cut = max(found, key=lambda own: own[:2], default=(0.0, 0.0, None))
        return cut, share

    def behind(self, shapes: Sequence[Array], side: float = 1.0) -> list[Array]:
        """Return what of convex polygons, lines and points, (k, 3) each, is behind the plane; `side` -1: before it."""
        found = []
        for shape in shapes:
            heights, corners = side * self.heights(shape), list[Array]()
            for k in range(len(shape) if (heights < 0.0).any() and (heights > 0.0).any() else 0):
                here, there = heights[k], heights[k - 1]
                if here * there < 0.0 and (k or len(shape) > 2):
                    corners.append(shape[k] + here / (here - there) * (shape[k - 1] - shape[k]))
                corners += [shape[k]] if here <= 0.0 else []
            found += [np.array(corners)] if corners else [shape] if (heights <= 0.0).all() else []
        return found

    def met(self, shapes: Sequence[Array]) -> list[Array]:
        """Return where the plane meets convex polygons, straight lines and points: lines (2, 3), points (1, 3)."""
        ends = [(shape[self.heights(shape) == 0.0][:2], len(shape) > 2) for shape in self.behind(shapes)]
        return [own for own, is_area in ends if len(own) > is_area]

    def heights(self, shape: Array) -> Array:
        """Return how far corners stand before the plane, 0 for rounding."""
        arms = shape - self.point
        heights = arms @ self.facing
        return np.asarray(np.where(np.abs(heights) <= 1e-9 * np.abs(arms).max(), 0.0, heights))


def draw_section(
    sheet: Sheet,
    corner: tuple[float, float],
    solids: Sequence[tuple[Body, str]],
    contact: Touching,
    moved: Array,
    page: Array,
    inch: float,
    unit: str,
) -> Array:
    """Draw an inset with its lower left corner at a place of the sheet (inches), turned as the scene next to it is.

    `solids` are the two bodies as they are shown, each with its colour; `moved`, (4, 4), is the motion that brought the
    first here, as seen from the second. `page`, (3, 2), has the directions of the scene's page, right and up, and a
    length is `inch` there. Returns the direction to the reader.
    """
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    (movable, blue), (static, _) = solids
    bodies, middle, back = (movable, static), contact.middle, np.linalg.inv(moved)
    was, (step, closed) = movable.moved(back), change_at(bodies, contact, moved)
    size = min(float(np.ptp(body.vertices, axis=0).max()) for body in bodies)
    long = float(np.linalg.norm(step))
    wide = contact.long or closed or long
    half = min(STEPS * wide, LARGEST * size) if wide > 1e-9 * size else STILL * size
    facing, plane, cuts = _cut_through(bodies, contact, step, page, half)
    axes = sheet.axes(*corner, INSET, INSET)
    borders = list[Array]()
    for (_, colour), polygons in zip(reversed(solids), reversed(cuts), strict=True):
        borders += polygons
        if cut := [Path(own, closed=True) for own in polygons]:
            whole = Path.make_compound_path(*cut)
            axes.add_patch(PathPatch(whole, facecolor=colour, edgecolor="none", alpha=0.35))
            axes.add_patch(PathPatch(whole, facecolor="none", edgecolor=colour, linewidth=1.1))
    if long > 1e-9 * size:
        for polygon in section(was, middle, facing, plane, 1.5 * half):
            borders.append(polygon[[*range(len(polygon)), 0]])
            axes.plot(*borders[-1].T, color=blue, linewidth=0.9, linestyle=(0, (4, 2.5)))
        arrow = {"arrowstyle": "-|>", "color": blue, "linewidth": 1.2, "shrinkA": 0, "shrinkB": 0}
        start = -min(1.0, 4.0 * half / long) * step @ plane  # of a long slide what is seen
        drawn = axes.annotate("", (0.0, 0.0), start, arrowprops=arrow, annotation_clip=False)
        drawn.arrow_patch.set_clip_path(axes.patch)
        drawn.set_visible(contact.kind != "gap")  # which it would cross
    flat = ((np.vstack(contact.pieces) if contact.across is None else contact.across) - middle) @ plane
    ends = flat[[end(flat @ np.ptp(flat, axis=0)) for end in (np.argmin, np.argmax)]]
    if contact.kind == "gap":
        ends = flat
        axes.annotate("", *ends, arrowprops={"arrowstyle": "|-|", "color": DARK, "shrinkA": 0, "shrinkB": 0})
    else:
        axes.plot(*ends.T, color=contact.colour, linewidth=3.0, alpha=0.8)
        axes.plot([0.0], [0.0], "o", color=contact.colour, markersize=4.0)
    axes.set(xlim=(-half, half), ylim=(-half, half), xticks=[], yticks=[])
    bar = rounded_down(CORNER * half)
    sides = np.concatenate([np.stack([own[:-1], own[1:]], axis=1) for own in (ends, *borders)])
    left, foot = free_corner(half, sides)
    axes.plot([left, left + bar], [foot] * 2, color=DARK, linewidth=1.6)
    axes.text(left, foot + 0.04 * half, f"{bar:g} {unit}".strip(), fontsize=NOTE, color=DARK, va="bottom")
    times = INSET / (2.0 * half) / inch
    which = f"{contact.kind} {contact.number or ''}"
    axes.set_title(f"{which.strip()}, cut open, \u00d7 {float(f'{times:.2g}'):g}", fontsize=NOTE, color=DARK, pad=2.0)
    axes.set_xlabel(f"seen {_side(facing)}", fontsize=NOTE, color=DARK, labelpad=2.0)
    for spine in axes.spines.values():
        spine.set(color=DARK, linewidth=0.6)
    return facing


def change_at(bodies: Sequence[Body], contact: Touching, moved: Array) -> tuple[Array, float]:
    """Return where to the first body slid at a contact, (3,), and how far it was open or overlapping there; else 0.

    `moved`, (4, 4), is the motion that brought it here, as seen from the second. 0 is what the digits of files leave
    open: of a plane that turns about a corner it stays on, too, along its old normal or its new one.
    """
    back, normal = np.linalg.inv(moved), contact.normal
    step = contact.middle - (back @ [*contact.middle, 1.0])[:3]
    closed = min(abs(float(step @ own)) for own in (normal, back[:3, :3] @ normal))
    room = max(DEFAULT.touch * min(body.size for body in bodies), 2.0 * sum(body.rounding for body in bodies))
    return (step if np.linalg.norm(step) > room else np.zeros(3)), closed if closed > room else 0.0


def _cut_through(
    bodies: Sequence[Body], contact: Touching, step: Array, page: Array, half: float
) -> tuple[Array, Array, list[list[Array]]]:
    """Return the direction of a section, its plane and closed outlines in it of each body.

    Where one of them is not to be seen so near to the contact, as at a corner, across that section if both are there.
    """
    found, along = list[tuple[Array, Array, list[list[Array]]]](), step
    for _ in range(2):
        facing, plane = section_plane(contact.normal, along, page)
        sections = (section(body, contact.middle, facing, plane, 1.5 * half) for body in bodies)
        cuts = [[own[[*range(len(own)), 0]] for own in loops] for loops in sections]
        window = [[-half, half]] * 2
        if all(any(clipped(np.stack([own[:-1], own[1:]], axis=1), window)[1].any() for own in each) for each in cuts):
            return facing, plane, cuts
        found.append((facing, plane, cuts))
        along = facing
    return found[0]


def _side(facing: Array) -> str:
    """Return from where a section is seen: "from the left", of an oblique one its normal, "from (0.6, -0.8, 0)"."""
    k = int(np.abs(facing).argmax())
    if abs(facing[k]) > ALONG_AXIS:
        return VIEWS[k][int(facing[k] > 0.0)]
    return f"from ({', '.join(f'{x + 0.0:g}' for x in facing.round(2).tolist())})"


def free_corner(half: float, lines: Array) -> tuple[float, float]:
    """Return where a bar of known length begins in a square about 0: in the first corner that lines keep clear of.

    Where there is none, at a side between corners, and then in the first that the first line, (2, 2), keeps clear of.
    """
    wide, high = CORNER * half, 0.35 * half  # with its label
    sides = -0.92 * half, 0.92 * half - wide
    corners = [(x, y * half) for rows in ((-0.88, 0.68), (-0.5, -0.1, 0.3)) for x in sides for y in rows]
    for some in (lines, lines[:1]):
        for x, y in corners:
            if not clipped(some, [[x, x + wide], [y - 0.1 * half, y + high]])[1].any():
                return x, y
    return corners[0]


def section_plane(normal: Array, step: Array, page: Array) -> tuple[Array, Array]:
    """Return the direction from a section to the reader, and the section's directions (3, 2), right and up.

    The normal lies in the section, and the motion, but for less than a turn to the nearest axis of the world across the
    normal. Where that leaves a choice it is cut along axes of the world, and seen from the side that the scene is seen
    from; up is z, in a section that is nearly level what is up there.
    """
    toward = np.cross(page[:, 0], page[:, 1])
    facing = np.cross(normal, step)
    for axis in np.eye(3):
        if abs(axis @ normal) < ACROSS_AXIS and abs(axis @ facing) > TURNED * np.linalg.norm(facing):
            facing = axis * (axis @ facing)
    if np.linalg.norm(facing) <= 0.1 * np.linalg.norm(step) or not step.any():
        across = [axis for axis in np.eye(3) if abs(axis @ normal) < 1.0 - ALONG_AXIS]
        facing = max(across, key=lambda axis: abs(axis @ toward)) if across else toward - (toward @ normal) * normal
        if np.linalg.norm(facing) < 0.05:
            facing = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    facing = facing * (1.0 if facing @ toward >= 0.0 else -1.0) / np.linalg.norm(facing)
    up = page[:, 1] if abs(facing[2]) > LEVEL else np.eye(3)[2]
    up = up - (up @ facing) * facing
    if np.abs(facing).max() > ALONG_AXIS:
        k = int(np.abs(up).argmax())
        up = np.sign(up[k]) * np.eye(3)[k]
    up = up / np.linalg.norm(up)
    return facing, np.column_stack([np.cross(up, facing), up])


def section(body: Body, point: Array, normal: Array, plane: Array, half: float = np.inf) -> list[Array]:
    """Return the outlines of what a plane cuts of a body, (k, 2) each, along it; of holes clockwise.

    So near to the point, `half`, round faces are as round as they are, not as their facets.
    """
    frame = np.column_stack([plane, normal]).T
    placed = solid_of(body).transform(np.column_stack([frame, frame @ (body.seed - point)]))
    loops = map(np.asarray, placed.slice(0.0).simplify(DEFAULT.nominal * body.size).to_polygons())
    return [_rounded(own, body, point, normal, plane, half) for own in loops]


def _rounded(loop: Array, body: Body, point: Array, normal: Array, plane: Array, half: float) -> Array:
    """Return an outline (k, 2) with what is near its middle brought from facets onto the round faces they stand for."""
    near = clipped(np.stack([loop, np.roll(loop, -1, axis=0)], axis=1), [[-half, half]] * 2)[1]
    if not round_surfaces(body) or not near.any():
        return loop
    faces, level = true_faces(body), Swept(point, normal, (0.0, -1.0), 0.0, 0.0)
    spots = point + loop @ plane.T
    middles = (spots + np.roll(spots, -1, axis=0)) / 2.0
    owners = np.full(len(spots), -1)
    for k in np.flatnonzero(near).tolist():
        owners[k] = faces.owners[distances(middles[k][None], faces.corners)[:, 0].argmin()]
    known = owners >= 0
    ends = spots.copy()
    for k in np.flatnonzero(known | np.roll(known, 1)).tolist():
        meet = [faces.patches[own].surface for own in {int(owners[k - 1]), int(owners[k])} if own >= 0]
        ends[k] = onto(spots[k][None], [*meet, level])[0]
    room = DEFAULT.touch * body.size + ROUNDED * max(deviation_of(body))
    ends = np.where(np.linalg.norm(ends - spots, axis=1)[:, None] <= room, ends, spots)
    found = list[Array]()
    for k, own in enumerate(owners.tolist()):
        line = ends[[k]]
        if own >= 0 and faces.is_round[own]:
            straight = ends[k] + np.arange(ON_CURVE)[:, None] / ON_CURVE * (ends[(k + 1) % len(ends)] - ends[k])
            line = np.concatenate([line, onto(straight[1:], [faces.patches[own].surface, level])])
        found.append(line)
    return (np.concatenate(found) - point) @ plane


@lru_cache(maxsize=64)
def solid_of(body: Body) -> Any:
    """Return a body as one solid about its seed, without walls between its parts."""
    from manifold3d import Error, Manifold, Mesh64, OpType

    if body.triangles:
        rows = np.array([triangle for face in body.triangles for triangle in face], np.uint64)
        solid = Manifold(Mesh64(np.ascontiguousarray(body.vertices - body.seed), rows))
        if solid.status() == Error.NoError:
            return solid
    parts = [Manifold.hull_points(part.vertices - body.seed) for part in body.parts]
    if body.triangles:  # an open surface over so many pyramids
        return Manifold.compose(parts)
    return Manifold.batch_boolean(parts, OpType.Add).as_original().simplify(DEFAULT.nominal * body.size)


def surface_of(body: Body, cut: Cut | None = None) -> tuple[Array, Ints]:
    """Return the surface of a body without what its parts turn to each other: points (n, 3), and triangles of these.

    With a `cut` that of what is behind it, closed by the section; without points where that is nothing.
    """
    if cut is None and body.triangles:
        return body.vertices, np.array([triangle for face in body.triangles for triangle in face])
    if cut is None and len(body.parts) == 1:
        return body.parts[0].vertices, fans(body.parts[0].loops)
    solid = solid_of(body)
    if cut is not None:
        solid = solid.trim_by_plane(-cut.facing, cut.facing @ (body.seed - cut.point))
        solid = solid.as_original().simplify(DEFAULT.nominal * body.size)  # no slivers, whose normals are noise
    mesh = solid.to_mesh64()
    return np.asarray(mesh.vert_properties)[:, :3] + body.seed, np.asarray(mesh.tri_verts, np.int64)
