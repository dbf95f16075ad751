"""The pair of bodies in space: solid, at given scales and pose, with what the motion did and what touches."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt import pacing
from fcdm_opt.curve.decision_curve import DecisionCurve
from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.geometry.facet_errors import deviation_of, round_surfaces
from fcdm_opt.geometry.measures import unit_normals
from fcdm_opt.geometry.naming import rows_of_element
from fcdm_opt.geometry.tessellation import ALONG
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show import BLACK, BLUE, DARK, GREY, LINE, NOTE, ORANGE, PAGE, PURPLE, VERMILLION, Figure, styled
from fcdm_opt.show.contact_faces import with_whole_faces
from fcdm_opt.show.lettering import BADGE, LEADING, SPACING, Names, Sheet, fitted, literal, rounded_down
from fcdm_opt.show.raster import Raster
from fcdm_opt.show.sections import INSET, Cut, Touching, change_at, draw_section, surface_of, touching
from fcdm_opt.show.texts import shortened
from fcdm_opt.tolerances import DEFAULT

REFUSED = "#A33F00"
"""Of words that there is no motion to use, 6 to 1 on the light ground that they have in any colour scheme."""

BODY_SIDE, VIEW = 2.6, (27.0, -54.0)
"""Inches across of a body alone, and degrees it is seen from; no symmetric view, in which edges of a cube meet."""

LEAST, MOST, FOOT, MARGIN = 1.9, 3.6, 0.55, 0.34
"""Inches that a scene may be high, below it for directions and scale (more where a legend needs it), and that bodies
keep from the edge of its area, for arrows."""

BANNER, FRAME, SLACK = NOTE + 1.0, 0.06, 0.94
"""Points of what is said above a scene, inches that the frame about it takes, and the share of the width that its words
fill: another font than ours, in a page, may be a little wider."""

WIDE, LOW = 3.1, 0.36
"""Inches across of a scene in a report: words of it can be read on a phone; below it, where no legend is."""

FINE = 180  # pixels an inch of what is drawn as pixels
AROUND = 30  # places to each side of a body where the arrow of its motion may stand
ARROW, MOVES = 0.45, {"arrowstyle": "-|>,head_width=0.28,head_length=0.55", "color": LINE, "linewidth": 1.6}
OLD: dict[str, Any] = {"linewidth": 0.8, "linestyle": (0, (4, 2.5))}
"""Length in inches, and looks, of an arrow that tells where a part of an assembly goes; looks of its old place."""

COLOURS: tuple[str, ...] = (VERMILLION, BLUE, ORANGE, "#5E5E5E", "#7A4FD0", "#F0E442", "#8C4F2B", PURPLE)
"""Of parts of an assembly, one after the other: told apart with any kind of colour vision, and from the green of
contacts; last that of overlaps."""

MOST_NAMED, LONGEST_NAME, LEGEND, LETTERS = 8, 160, 1.75, 44
"""Contacts that are numbered and told; letters of a body's name in the legend; inches to the left of this; letters that
fit in one of its lines."""

HEAD, NUMBERED = 9.0, 30.0  # points across an arrow's head, and a contact with its number
THIN = 0.7  # points: lines that are drawn thinner are so in the key of a page, too
LEAST_CONTACT, OPENED = 0.6, 0.45
"""Share of the corners of what touches that are to be seen, else bodies are cut open; white in the colour of cuts."""

LONGEST_BAR, LETTER, SEEN = 60.0, 9.0, 0.2
"""Points: the bar of known length is at most so long, and letters of two directions so far apart; a direction of the
world shorter than this on the page gets no name."""

AZIMUTHS = tuple(float(quarter + off) for quarter in (-180, -90, 0, 90) for off in (20, 35, 55, 70))
"""Degrees that a scene may be seen from: along no axis, and not halfway between two, where edges of boxes meet."""

FROM_BEHIND = 0.9
"""What a view from behind costs: almost half of the contact that it shows and one from the front hides."""

MOST_LOOKED_AT, MOST_RAYS = 60, 1000  # vertices of body 1, and rays at parts, that tell what is hidden
VEIL, EDGE_ON = 0.3, 0.01
"""How much of its colour a contact area has, which a body in front may hide; cosine of one that is seen as a line."""

OVERLAP, CUT, HIDDEN = "where they overlap", "cut open", "dashes, rings: hidden by a part, or cut away"
KINDS = {"contact": "in contact", "overlap": OVERLAP, "gap": "where the gap is least"}
"""What the key calls these, and how it begins to tell where bodies are cut."""

FAR, MOST_TURN = 0.12, 0.5
"""A motion that is shorter on the page than this share of the scene is drawn so long, and radians a drawn turn has."""

LEAST_TIMES, SEEN_TURN = 2.0, 0.1
"""A motion that is drawn less than so many times as far off, or that turns by more radians, is drawn as it is."""

TANGENT, SMOOTH = 0.93, 0.99
"""Cosine: faces that are turned less against one another are drawn as one curved surface, without an edge; the same
where one is known to be round, and how it is turned there."""

INNER = (0.0, 0.5, -0.5)
"""Where on a piece of a contact its number may stand: shares from the middle to a corner."""

LEAST_SEEN, MOST_LED = 1.5, 16
"""Pixels from the middle of a face to its outline from which on it is seen; numbers in a panel that lines lead to."""

MOST_INSETS, BELOW, ALIKE = 4, 2, 0.999
"""Contacts that are magnified; more than so many stand in a row below the scene; cosine between normals of those that
look alike."""


@styled
def scene_figure(
    shown: ShownBodies,
    *,
    contacts: Sequence[Touching] = (),
    unit: str = "",
    title: str = "",
    caption: str = "",
) -> Figure:
    """Draw bodies as solids: what is hidden is not drawn, and only edges that the bodies have.

    `contacts`, what touches, are magnified in insets. The old places of bodies that moved are drawn in dashes, as many
    times as far off as the legend says. The unit of lengths stands at the bar of known length.
    """
    insets = _magnified(contacts, shown)
    below, pitch = len(insets) > BELOW, INSET + 0.45
    column = INSET + 0.15 if insets and not below else 0.0
    lines = sum(1 + len(label) // LETTERS for *_, label in shown.solids)
    rows = 1 + lines + 2 * bool(contacts) + 2 * bool(shown.moves)
    foot = max(FOOT, 0.16 * rows)
    wide = PAGE - column if insets else 0.72 * PAGE
    height = float(np.clip(shown.slenderness * (wide - 0.3), LEAST, MOST))
    height = max(height + _banner(shown, wide)[1], 0.0 if below else len(insets) * pitch - foot)
    sheet = Sheet.of(wide + column, height + foot + pitch * below, title=title, caption=caption)
    axes = draw_scene(sheet, (0.0, foot + pitch * below, wide, height), shown, contacts=contacts)
    draw_directions(sheet, axes, shown, (0.0, 0.0), unit)
    _add_legend(sheet, axes, foot)
    inch, page = _inches_a_length(axes), page_directions(*shown.view)
    for k, contact in enumerate(insets):
        top = sheet.size[1] - k * pitch - 0.12 - INSET
        corner = (0.06 + k * PAGE / MOST_INSETS, foot + 0.25) if below else (wide + 0.05, top)
        draw_section(sheet, corner, *shown.met(contact), page, inch, unit)
    return sheet.figure


class ScenePieces(NamedTuple):
    """A scene in pieces that a page places side by side, or one below the other where it is narrow.

    Attributes
    ----------
    scene : matplotlib Figure
        `WIDE` inches across.
    insets : tuple of matplotlib Figure
        Contacts magnified, to be shown at the scene's scale.
    key : tuple of (str, str, str)
        What is drawn: its mark ("swatch", "stroke", "stroke dashed", else a sign or the number of a contact), its
        colour, and what it is.
    facing : (3,) array
        Direction to the reader from where the bodies are cut open, or would be.
    view : (elevation, azimuth)
        Degrees that it is seen from.
    """

    scene: Figure
    insets: tuple[Figure, ...]
    key: tuple[tuple[str, str, str], ...]
    facing: Array
    view: tuple[float, float]

    @property
    def cut(self) -> bool:
        """Whether bodies are cut open, as they would hide what touches; an overlap shows through them."""
        return any(text.startswith(CUT) and OVERLAP not in text for *_, text in self.key)


@styled
def scene_pieces(shown: ShownBodies, *, contacts: Sequence[Touching] = (), unit: str = "") -> ScenePieces:
    """Draw what `scene_figure` draws, for a page that has its own words: no title, caption and legend."""
    height = float(np.clip(shown.slenderness * (WIDE - MARGIN) + MARGIN, LEAST, WIDE)) + _banner(shown, WIDE)[1]
    sheet = Sheet.of(WIDE, height + LOW)
    axes = draw_scene(sheet, (0.0, LOW, WIDE, height), shown, contacts=contacts)
    draw_directions(sheet, axes, shown, (0.0, 0.0), unit)
    inch, page, insets = _inches_a_length(axes), page_directions(*shown.view), list[Figure]()
    facing = np.cross(page[:, 0], page[:, 1])
    for contact in reversed(_magnified(contacts, shown)):
        part = Sheet.of(INSET + 0.1, INSET + 0.34)
        facing = draw_section(part, (0.05, 0.18), *shown.met(contact), page, inch, unit)
        insets.insert(0, part.figure)
    cut = Cut.through(contacts, [body for body, *_ in shown.solids], page)[0] if contacts else None
    facing = facing if cut is None else cut.facing
    return ScenePieces(sheet.figure, tuple(insets), _key(axes, contacts, shown), facing, shown.view)


def _key(axes: Any, contacts: Sequence[Touching], shown: ShownBodies) -> tuple[tuple[str, str, str], ...]:
    """Return what a page says of what is drawn, see `ScenePieces.key`."""
    from matplotlib.colors import to_hex
    from matplotlib.lines import Line2D

    found = list[tuple[str, str, str]]()
    for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
        if isinstance(handle, Line2D):
            look = f"stroke{' dashed' * (handle.get_linestyle() != '-')}{' thin' * (handle.get_linewidth() < THIN)}"
            found.append((look, to_hex(handle.get_color()), label))
        else:
            found.append(("swatch", to_hex(np.reshape(handle.get_facecolor(), (-1, 4))[0]), label))
    numbered = (text.partition("\u00a0") for text in numbered_contacts(contacts, shown))
    return *found, *((number, "", text) for number, _, text in numbered)


def _magnified(contacts: Sequence[Touching], shown: ShownBodies) -> list[Touching]:
    """Return the contacts that get an inset, one of each number, in order: of many first those that are open.

    Then those that the motion closed, and those on which it slid; of these those that look unlike, and of these the
    first of each two bodies.
    """
    insets: list[Touching] = []
    for contact in contacts:
        if all(own.pair != contact.pair or contact.number not in (0, own.number) for own in insets):
            insets.append(contact)
    changes = [change_at([body for body, _ in both], own, moved) for both, own, moved in map(shown.met, insets)]
    ranks = [
        (
            own.kind != "gap",
            changes[k][1] == 0.0,
            not changes[k][0].any(),
            any(_look_alike(own, other) for other in insets[:k]),
            sum(other.pair == own.pair for other in insets[:k]),
            k,
        )
        for k, own in enumerate(insets)
    ]
    return [insets[k] for k in sorted(k for *_, k in sorted(ranks)[:MOST_INSETS])]


def _look_alike(one: Touching, two: Touching) -> bool:
    """Tell whether contacts are of the same bodies, and across the same direction."""
    return one.pair == two.pair and abs(float(one.normal @ two.normal)) >= ALIKE


def _inches_a_length(axes: Any) -> float:
    (left, _), (right, _) = axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    return float(right - left) / float(axes.figure.dpi)


@styled
def body_figure(body: Body) -> Figure:
    """Draw one body as drawn, with its seed."""
    shown = ShownBodies([(body, BLUE, body.name)], np.vstack([body.vertices, body.seed]), VIEW)
    height = float(np.clip(shown.slenderness * BODY_SIDE, LEAST, MOST))
    sheet = Sheet.of(BODY_SIDE, height)
    axes = _axes_for(sheet, (0.0, 0.0, BODY_SIDE, height), shown)
    _draw_solids(axes, shown)
    axes.scatter(*(body.seed @ page_directions(*VIEW)), s=22, marker="x", color=BLACK, zorder=5)
    return sheet.figure


def _add_legend(sheet: Sheet, axes: Any, foot: float) -> None:
    handles, labels = axes.get_legend_handles_labels()
    x, y, *_ = sheet.place(LEGEND, foot / 2, 0.0, 0.0)
    room = axes.get_position().width * sheet.figure.get_figwidth() - LEGEND - 0.27
    labels = [literal("\n".join(fitted(sheet.figure, label, NOTE, room))) for label in labels]
    sheet.figure.legend(handles, labels, loc="center left", bbox_to_anchor=(x, y), borderaxespad=0.0, handlelength=2.0)


@dataclass(frozen=True)
class ShownBodies:
    """Bodies where and as large as they are shown, and the view they are seen from, (elevation, azimuth) in degrees.

    `solids` are each body as drawn, see `Body.of_facets`, its colour, and what the key calls it: the movable one, the
    static one, and keep-outs near enough to be shown; or the parts of an assembly. `points`, (n, 3), are what must be
    on the page, and `named`, of two bodies alone, those whose elements features name. `moves`, (4, 4) each, are the
    motions that brought bodies here, the first ones in order; None for one that stays. The motion of body 1 is in words
    above where it is `banner`, or why there is none to use.
    """

    solids: Sequence[tuple[Body, str, str]]
    points: Array
    view: tuple[float, float]
    named: tuple[Body, Body] | None = None
    moves: Sequence[Array | None] = ()
    banner: str = ""

    @classmethod
    def of(
        cls,
        movable: Body,
        static: Body,
        *,
        rho: ArrayLike = (1.0, 1.0),
        transform: ArrayLike | None = None,
        keep_out: Sequence[Body] = (),
        view: tuple[float, float] | None = None,
        banner: str = "",
    ) -> ShownBodies:
        """Return two bodies at given scales and pose, seen from `view`, or from where they hide least of each other.

        Bodies are given as drawn; `rho`, (2,), are the scales at which they are shown, `transform`, (4, 4), is a rigid
        motion of body 1. Further static bodies, `keep_out`, are shown as they are; those far away are left out.
        """
        sizes = np.asarray(rho, dtype=float)
        placed = np.eye(4) if transform is None else transform
        named, (one, two) = (
            (first.scaled(float(sizes[0])).moved(placed), second.scaled(float(sizes[1])))
            for first, second in ((movable, static), (movable.of_facets, static.of_facets))
        )
        points = np.vstack([one.vertices, one.seed, two.vertices, two.seed])
        view = view or _best_view(one, two, np.empty((0, 3)))
        extent = np.ptp(points, axis=0).max()
        low, high = points.min(axis=0) - extent, points.max(axis=0) + extent
        near = [b for b in keep_out if (b.vertices.max(axis=0) >= low).all() and (b.vertices.min(axis=0) <= high).all()]
        points = np.vstack([points, *(np.clip(body.vertices, low, high) for body in near)])
        roles = (one, BLUE, "movable"), (two, VERMILLION, "static"), *((body, GREY, "keep-out") for body in near)
        solids = [(body, colour, f"{role}: {shortened(body.name, LONGEST_NAME)}") for body, colour, role in roles]
        moves = () if transform is None else (np.asarray(transform, dtype=float),)
        return cls(solids, points, view, named, moves, banner)

    @classmethod
    def of_parts(cls, bodies: Sequence[Body], names: Sequence[str], moves: Sequence[Array | None] = ()) -> ShownBodies:
        """Return several bodies where they are, each in a colour of its own."""
        points = np.vstack([np.vstack([body.vertices, body.seed]) for body in bodies])
        colours = [COLOURS[k % len(COLOURS)] for k in range(len(bodies))]
        labels = [shortened(name, LONGEST_NAME) for name in names]
        return cls(list(zip(bodies, colours, labels, strict=True)), points, VIEW, moves=moves)

    @property
    def bodies(self) -> tuple[Body, Body]:
        """The first two."""
        return self.solids[0][0], self.solids[1][0]

    def met(self, contact: Touching) -> tuple[list[tuple[Body, str]], Touching, Array]:
        """Return the two bodies of a contact with their colours, it, and the motion of one as seen from the other."""
        one, two = (self.moves[k] if k < len(self.moves) else None for k in contact.pair)
        seen = (np.eye(4) if one is None else one) @ np.linalg.inv(np.eye(4) if two is None else two)
        return [self.solids[k][:2] for k in contact.pair], contact, seen

    @cached_property
    def before(self) -> tuple[dict[int, Body], float]:
        """The bodies that moved before that, drawn as many times as far off where the largest motion is not seen."""
        from scipy.spatial.transform import Rotation

        page = page_directions(*self.view)
        size = float(np.ptp(self.points @ page, axis=0).max())
        moved = {k: (self.solids[k][0], motion) for k, motion in enumerate(self.moves) if motion is not None}
        was = {k: body.moved(np.linalg.inv(motion)) for k, (body, motion) in moved.items()}
        far = {k: np.linalg.norm((moved[k][0].vertices - own.vertices) @ page, axis=1).max() for k, own in was.items()}
        was = {k: own for k, own in was.items() if far[k] > 1e-12 * size}
        if not was:
            return {}, 1.0
        turns = {k: Rotation.from_matrix(moved[k][1][:3, :3].T) for k in was}
        most = max(turn.magnitude() for turn in turns.values())
        times = FAR * size / max(far.values())
        times = max(times / 2.0, min(times, self._room(was)))
        times = max(1.0, min(times, MOST_TURN / max(most, 1e-300)))
        if times < LEAST_TIMES or most > SEEN_TURN:
            return was, 1.0
        digit = 10.0 ** np.floor(np.log10(times))
        times = float(digit * np.floor(times / digit)) if times > 3.0 else float(f"{times:.2g}")
        for k, turn in turns.items():
            middle, motion = moved[k][0].vertices.mean(axis=0), np.eye(4)
            motion[:3, :3] = Rotation.from_rotvec(times * turn.as_rotvec()).as_matrix()
            motion[:3, 3] = middle - motion[:3, :3] @ middle + times * (was[k].vertices.mean(axis=0) - middle)
            was[k] = moved[k][0].moved(motion)
        return was, times

    def _room(self, was: Mapping[int, Body]) -> float:
        """Return how many times as far off bodies that moved stay within the box of the others, where they stand in it.

        Infinite along what they stand out of.
        """
        found = [np.inf]
        for k, old in was.items():
            others = np.vstack([body.vertices for j, (body, *_) in enumerate(self.solids) if j != k])
            for sign in (1.0, -1.0):
                points = self.solids[k][0].vertices, old.vertices, others
                low, least, end = ((sign * own).min(axis=0) for own in points)
                within = (low > end) & (least < low)
                found += ((low - end)[within] / (low - least)[within]).tolist()
        return min(found)

    @property
    def slenderness(self) -> float:
        """Height over width on the page."""
        width, height = np.ptp(self.points @ page_directions(*self.view), axis=0)
        return float(height / width)


def draw_scene(
    sheet: Sheet,
    area: tuple[float, float, float, float],
    shown: ShownBodies,
    *,
    contacts: Sequence[Touching] = (),
) -> Any:
    """Draw a scene into an area of a sheet (left, bottom, width, height; inches); return its axes, for a legend.

    Parameters are those of `scene_figure`.
    """
    page, arrows, (before, times) = page_directions(*shown.view), list[Array](), shown.before
    lines, strip = _banner(shown, area[2])
    if lines:
        look: dict[str, Any] = {"color": BLUE, "fontsize": BANNER, "va": "top", "ha": "center", "linespacing": LEADING}
        look |= {} if before else {"color": REFUSED, "weight": "bold", "bbox": {**BADGE, "edgecolor": REFUSED}}
        x, y, *_ = sheet.place(area[0] + area[2] / 2.0, area[1] + area[3] - FRAME, 0.0, 0.0)
        sheet.figure.text(x, y, literal("\n".join(lines)), **look)
    area = *area[:3], area[3] - strip
    axes = _axes_for(sheet, area, shown, [corner for own in before.values() for corner in own.vertices])
    raster, cut = _draw_solids(axes, shown, contacts)
    places = raster.roomiest() if shown.named is None else {}
    for k, old in before.items():
        place, dashes = _draw_old(axes, raster, shown, k, old, cut)
        steps = (old.vertices - shown.solids[k][0].vertices) @ page
        if shown.named is not None:
            arrow = _draw_arrow(axes, [raster, place], shown, old)
            _name_old(axes, raster, dashes, steps, arrow, [each.middle @ page for each in contacts])
        elif k in places and np.linalg.norm(flat := -steps.mean(axis=0)) > 0.0:
            half = flat / np.linalg.norm(flat) * ARROW / 2.0 / _inches_a_length(axes)
            axes.annotate("", places[k][0] + half, places[k][0] - half, arrowprops=MOVES, zorder=6)
            arrows += [places[k][0] + share * half for share in (-1.0, -0.3, 0.3, 1.0)]
    if before:
        far = f", drawn {times:g} times as far off" if times > 1.0 else ""
        parts, colour = ("the same part", BLUE) if shown.named is not None else ("the same parts", DARK)
        axes.plot([], [], color=colour, label=f"before the motion: {parts}{far}", **OLD)
    if contacts:
        _draw_contacts(axes, page, raster, contacts, cut, arrows)
    return axes


def _banner(shown: ShownBodies, width: float) -> tuple[list[str], float]:
    """Return what is said above bodies, in lines of a scene so many inches across, and how high these are in inches."""
    room = SLACK * (width - 2.0 * FRAME)
    lines = fitted(Sheet.of(width, 1.0).figure, shown.banner, BANNER, room, weight="bold") if shown.banner else []
    return lines, len(lines) * SPACING * BANNER / 72.0 + 3.0 * FRAME * bool(lines)


def draw_numbered(
    sheet: Sheet, area: tuple[float, float, float, float], shown: ShownBodies, numbers: Mapping[tuple[int, ...], str]
) -> tuple[Any, set[str]]:
    """Draw the first body into an area of a sheet, with numbers at its faces; return its axes, and those with room.

    `numbers`: of each face of the body; faces that have one in common get it once.
    """
    (body, colour, _), page = shown.solids[0], page_directions(*shown.view)
    axes = _axes_for(sheet, area, shown)
    raster, _ = _draw_solids(axes, shown)
    every = [*dict.fromkeys(numbers.values())]
    faces = raster.empty()
    for face, number in numbers.items():
        faces.fill(face_polygons(body, Element("F", face)), colour, every.index(number))
    names, middle = Names(axes, raster.visible(sharp_edges(body))), body.vertices.mean(axis=0) @ page
    places = {every[k]: own for k, own in faces.roomiest().items() if own[1] > LEAST_SEEN * faces.pixel}
    written, led = set[str](), 0
    for number, (place, _) in sorted(places.items(), key=lambda own: -own[1][1]):
        away = place - middle
        direction = away if away.any() else np.array([0.0, 1.0])
        if led < MOST_LED and (far := names.put(number, place, direction, colour=BLACK, upon=True)) is not None:
            written.add(number)
            led += far > 0.0
    return axes, written


def _draw_solids(axes: Any, shown: ShownBodies, contacts: Sequence[Touching] = ()) -> tuple[Raster, Cut | None]:
    """Draw bodies shaded, with the edges that can be seen, cut open where they would hide what touches.

    Returns the picture, to ask what is hidden, and where the bodies are cut.
    """
    from matplotlib.collections import LineCollection

    page, ((left, right), (bottom, top)) = page_directions(*shown.view), (axes.get_xlim(), axes.get_ylim())
    bodies = shown.solids
    inches = axes.get_position().width * axes.figure.get_figwidth()
    raster = Raster(page, np.array([left, bottom]), np.array([right, top]), int(FINE * inches))
    toward = np.cross(page[:, 0], page[:, 1])
    solids = [_cut_open(body, None, toward) for body, *_ in bodies]
    for k, (polygons, *_) in enumerate(solids):
        raster.fill(polygons, bodies[k][1], k)
    corners = [corner for each in contacts for own in each.pieces for corner in own]
    cut, seen = None, raster.share_seen(corners) if corners else 1.0
    if seen < LEAST_CONTACT:
        cut, met = Cut.through(contacts, [body for body, *_ in bodies], page)
        cut = cut if met > seen else None
    if cut is not None:
        whole, raster = raster, raster.empty()
        gone = cut.behind([edge for _, edges, _ in solids for edge in edges], -1.0)
        axes.add_collection(LineCollection(whole.visible(gone), colors=GREY, linewidths=0.5, alpha=0.6, zorder=2.5))
        solids = [_cut_open(body, cut, toward) for body, *_ in bodies]
        for k, (polygons, _, opened) in enumerate(solids):
            raster.fill(polygons, bodies[k][1], k)
            raster.fill(opened, bodies[k][1], k, white=OPENED)
    axes.imshow(raster.image, extent=(left, right, bottom, top), origin="lower", zorder=1, aspect="auto")
    axes.set(xlim=(left, right), ylim=(bottom, top))
    for (_, colour, label), (_, edges, _) in zip(bodies, solids, strict=True):
        axes.add_collection(LineCollection(raster.visible(edges), colors=LINE, linewidths=0.6, alpha=0.75, zorder=2))
        if label:
            axes.fill([], [], facecolor=colour, alpha=0.75, label=label)
    if cut is not None:
        where = OVERLAP if contacts[0].is_overlap else f"at the {contacts[0].kind}"
        axes.plot([], [], color=GREY, linewidth=0.6, label=f"{CUT} {where}; thin lines: what is cut away")
    return raster, cut


def _cut_open(body: Body, cut: Cut | None, toward: Array | None = None) -> tuple[list[Array], list[Array], list[Array]]:
    """Return what is left of a body: polygons, edges and what is laid open; the whole of one that is all before it."""
    points, triangles = surface_of(body, cut)
    if cut is None or not len(triangles):
        return own_polygons(body), list(sharp_edges(body, toward)), []
    opened = (np.abs(cut.heights(points)[triangles]) == 0.0).all(axis=1)
    edges = _sharp(body, points, triangles, unit_normals(points[triangles]), toward)
    return list(points[triangles[~opened]]), list(edges), list(points[triangles[opened]])


def _draw_old(
    axes: Any, raster: Raster, shown: ShownBodies, k: int, old: Body, cut: Cut | None
) -> tuple[Raster, Sequence[Array]]:
    """Draw the old place of a body in dashes, where it does not hide them itself; return where it is, and these."""
    from matplotlib.collections import LineCollection

    page = page_directions(*shown.view)
    width, own = float(np.ptp(axes.get_xlim())), raster.empty()
    polygons, edges, opened = _cut_open(old, cut, np.cross(page[:, 0], page[:, 1]))
    own.fill(polygons + opened, BLUE, 0)
    pieces = _joined(own.visible(edges), width)
    axes.add_collection(LineCollection(pieces, colors=shown.solids[k][1], zorder=3, **OLD))
    return own, pieces


def _name_old(
    axes: Any, raster: Raster, pieces: Sequence[Array], steps: Array, arrow: Array, contacts: Sequence[Array]
) -> None:
    """Name the old place at an end of its dashes, clear of these, arrow and contacts, by where corners came from."""
    away = steps[np.linalg.norm(steps, axis=1).argmax()]
    ahead = np.array([[0.02], [0.1]]) * float(np.ptp(axes.get_xlim())) * away / np.linalg.norm(away)
    ends = sorted((end for line in pieces for end in line), key=lambda end: -(end @ away))
    ends = [end for end in ends if raster.free(end + ahead)] or ends  # a small part before a large one is all upon it
    dashes = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in pieces] or [np.empty((0, 2, 2))])
    names = Names(axes, dashes)
    for point, wide in (*((own, HEAD) for own in arrow), *((own, NUMBERED) for own in contacts)):
        names.keep(point, wide)
    names.put("before", ends, away, colour=DARK, badge=True)


def _joined(pieces: Iterable[Array], size: float) -> list[Array]:
    """Return lines of pieces (2, 2) that meet end to end, by twos, so that dashes go on round a curve."""

    def place(point: Array) -> tuple[int, ...]:
        return tuple(np.rint(point / size * 1e6).astype(int).tolist())

    lines, ends = dict[int, list[Array]](), dict[tuple[int, ...], int]()
    for k, piece in enumerate(pieces):
        line = list(piece)
        for _ in range(2):  # at one end; turned round, at the other
            here = place(line[-1])
            if other := lines.pop(ends.get(here, -1), []):
                line += other[1:] if place(other[0]) == here else other[-2::-1]
            line.reverse()
        lines[k] = line
        ends |= {place(line[0]): k, place(line[-1]): k}
    return [np.array(line) for line in lines.values()]


def _draw_arrow(axes: Any, drawn: Sequence[Raster], shown: ShownBodies, old: Body) -> Array:
    """Draw the motion as an arrow next to body 1, clear of all that is drawn.

    Returns points along it.
    """
    page = page_directions(*shown.view)
    here, there = old.vertices @ page, shown.bodies[0].vertices @ page
    steps = there - here
    lengths = np.linalg.norm(steps, axis=1)
    far = int(lengths.argmax())
    if not lengths[far] > 0.0:
        return np.empty((0, 2))
    direction = steps[far] / lengths[far]
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    gap = 0.03 * (right - left)
    half = max(float(lengths[far]), 2.5 * gap) / 2.0 * direction
    across = np.array([-direction[1], direction[0]])
    grid = np.array([(x, y) for x in range(-AROUND, AROUND + 1) for y in range(-AROUND, AROUND + 1)])
    grid = grid[np.argsort(np.abs(grid) @ (0.6, 1.0), kind="stable")]
    places = there.mean(axis=0) + gap * grid @ np.array([direction, across])
    low, high = np.array([left + gap / 3.0, bottom]), np.array([right - gap / 3.0, top - gap])
    within = [at for at in places if all(((end >= low) & (end <= high)).all() for end in (at - half, at + half))]
    aside = 0.6 * gap * np.array([[0.0, 0.0], across, -across])  # so far from all bodies
    every = (np.array([at - half, at + half]) for at in within)
    clear = (line for line in every if all(own.free(line + shift) for own in drawn for shift in aside))
    middle = (within or places)[0]
    start, tip = next(clear, np.array([middle - half, middle + half]))
    style = {**MOVES, "color": BLUE, "linewidth": 2.0, "shrinkA": 0, "shrinkB": 0}
    if float(np.ptp(steps, axis=0).max()) > 0.2 * lengths[far]:
        arms = here - here.mean(axis=0)
        turn = float((arms[:, 0] * steps[:, 1] - arms[:, 1] * steps[:, 0]).sum())
        style["connectionstyle"] = f"arc3,rad={0.35 if turn > 0.0 else -0.35}"  # it turns that way
    axes.annotate("", tip, start, arrowprops=style, annotation_clip=False, zorder=6)
    return np.linspace(start, tip, 6)


def _draw_contacts(
    axes: Any, page: Array, raster: Raster, contacts: Sequence[Touching], cut: Cut | None, clear: Sequence[Array] = ()
) -> None:
    """Draw where bodies touch, not all of the faces that do: points, lines, areas as one; numbers keep `clear`.

    Points and lines that a body hides are rings and dashes.
    """
    toward, solid, hides = np.cross(page[:, 0], page[:, 1]), dict[str, list[Array]](), False
    rings, gone = {"facecolors": "none", "linewidths": 1.2, "zorder": 5}, dict[int, Array]()
    if cut is not None:  # of areas lines are seen, of lines points
        met = [[] if each.is_overlap else cut.met(each.pieces) for each in contacts]
        opened = {each.number for own, each in zip(met, contacts, strict=True) if own}
        rest = [
            own or ([] if each.number in opened and len(contacts) > MOST_NAMED else cut.behind(each.pieces))
            for own, each in zip(met, contacts, strict=True)
        ]
        seen = [each._replace(pieces=tuple(own)) for own, each in zip(rest, contacts, strict=True) if own]
        kept = {0, *(each.number for each in seen)}
        gone = {each.number: each.middle for each in contacts if seen and each.number not in kept}
        contacts = seen or contacts
    for contact, corners in ((each, piece) for each in contacts for piece in each.pieces):
        flat, look = corners @ page, {"color": contact.colour, "zorder": 5}
        if len(flat) > 2 and (contact.is_overlap or abs(float(contact.normal @ toward)) > EDGE_ON):
            middle = flat.mean(axis=0)
            solid.setdefault(contact.kind, []).append(corners[np.argsort(np.arctan2(*(flat - middle).T[::-1]))])
        elif len(flat) > 1:
            ends = [end(flat[:, np.ptp(flat, axis=0).argmax()]) for end in (np.argmin, np.argmax)]
            pieces = raster.visible([corners[ends]])
            for line in pieces:
                axes.plot(*line.T, linewidth=3.0, **look)
            hides |= not pieces
            axes.plot(*flat[ends].T, linewidth=1.2, linestyle=(0, (2, 1.5)), **look)
        elif raster.share_seen([*corners]):
            axes.scatter(*flat.T, s=34, edgecolors="white", linewidths=0.8, **look)
        else:
            hides = True
            axes.scatter(*flat.T, s=26, edgecolors=contact.colour, **rings)
    for kind, colour in {each.kind: each.colour for each in contacts}.items():
        _draw_areas(axes, raster.empty(), solid.get(kind, []), colour)
        axes.scatter([], [], s=40, marker="s", color=colour, label=KINDS[kind])
    for place in gone.values():
        axes.scatter(*(place @ page), s=26, edgecolors=contacts[0].colour, **rings)
    if hides or gone:
        axes.plot([], [], color=contacts[0].colour, linestyle=(0, (2, 1.5)), linewidth=1.2, label=HIDDEN)
    names, places = Names(axes), {number: [place] for number, place in gone.items()}
    for each in contacts:
        inner = [own.mean(axis=0) + share * (own[0] - own.mean(axis=0)) for share in INNER for own in each.pieces]
        places.setdefault(each.number, []).extend([each.middle, *inner] if each.is_wide else [each.middle])
    points = [own.middle @ page for own in contacts if not own.is_wide]
    for place in (*points, *(place @ page for place in gone.values()), *clear):
        names.keep(place, 6.0)
    for number, spots in places.items():
        if number:
            order = np.argsort(~raster.seen(spots[:MOST_LOOKED_AT]), kind="stable")
            names.put(str(number), np.array(spots)[order] @ page, (0.0, 1.0), colour=LINE, upon=True, badge=True)


def _draw_areas(axes: Any, areas: Raster, solid: Sequence[Array], colour: str) -> None:
    """Draw polygons as one area, through which bodies are seen."""
    from scipy.ndimage import gaussian_filter

    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    areas.fill(solid, colour, 0)
    if areas.covered.any():
        rows, columns = areas.covered.shape
        x = left + (np.arange(columns) + 0.5) * (right - left) / columns
        y = bottom + (np.arange(rows) + 0.5) * (top - bottom) / rows
        soft = gaussian_filter(areas.covered.astype(float), 1.0)
        axes.contourf(x, y, soft, levels=[0.3, 2.0], colors=[colour], alpha=VEIL, zorder=4)
        axes.contour(x, y, soft, levels=[0.3], colors=[colour], linewidths=1.2, zorder=4)


def sharp_edges(body: Body, toward: Array | None = None) -> Array:
    """Return the edges at which a body has a corner, (m, 2, 3): none where faces nearly go on one in another.

    Nor those that lie within the body, where it was cut into parts, nor between facets of one round face. Seen from
    the direction `toward` the reader, if one is given, outlines of its smooth faces too.
    """
    points, triangles = surface_of(body)
    looks = body.face_planes[0][body.face_triangles[1]] if body.triangles else unit_normals(points[triangles])
    return _sharp(body, points, triangles, looks, toward)


def _sharp(body: Body, points: Array, triangles: Ints, looks: Array, toward: Array | None = None) -> Array:
    """Return the edges, (m, 2, 3), at which triangles with these normals do not nearly go on in one another."""
    ends = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, own, counts = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    sides = np.argsort(own.reshape(-1), kind="stable") // 3
    last = np.cumsum(counts) - 1
    both, middles = np.array([sides[last - counts + 1], sides[last]]), points[edges].mean(axis=1)
    normals, on_round = looks[both], np.full(both.shape, -1)
    corners = points[triangles]
    room = DEFAULT.touch * body.size + 2.0 * max(deviation_of(body))
    for k, (surface, _) in enumerate(round_surfaces(body)):
        off = np.abs(surface.misses(corners.reshape(-1, 3))[0]).reshape(-1, 3)
        alike = (surface.misses(corners.mean(axis=1))[1] * looks).sum(axis=1)
        of = (off <= room).all(axis=1) & (np.abs(alike) > ALONG)
        true = surface.misses(middles)[1]
        for side in (0, 1):
            here = of[both[side]]
            on_round[side, here] = k
            normals[side, here] = np.sign(alike[both[side]])[here, None] * true[here]
    least = np.where((on_round < 0).all(axis=0), TANGENT, SMOOTH)
    sharp = ((normals[0] * normals[1]).sum(axis=1) < least) & ((on_round[0] < 0) | (on_round[0] != on_round[1]))
    if toward is not None:
        sharp |= (looks[both[0]] @ toward) * (looks[both[1]] @ toward) < 0.0
    return points[edges[(counts != 2) | sharp]]


def own_polygons(body: Body) -> list[Array]:
    """Return convex polygons that make up the body's own faces, (k, 3) each; not those of cuts."""
    points, triangles = surface_of(body)
    return list(points[triangles])


def face_polygons(body: Body, face: Element) -> list[Array]:
    """Return convex polygons that make up a face, (k, 3) each: of the parts that carry it where its own are not known.

    A part that overlaps others may carry the face beyond where it is the solid's.
    """
    if body.triangles and face.vertices in body.face_rows:
        return list(body.vertices[np.array(body.triangles[body.face_rows[face.vertices]])])
    return [part.vertices[list(loop)] for part in body.parts for loop in part.carriers(face)]


def draw_directions(sheet: Sheet, axes: Any, shown: ShownBodies, corner: tuple[float, float], unit: str = "") -> None:
    """Draw the world's directions at a corner of a sheet (inches), and beside them a bar of known length."""
    x, y, *_ = sheet.place(*corner, 0.0, 0.0)
    start = np.array([x, y]) * 72.0 * sheet.figure.get_size_inches() + [24.0, 20.0]
    points: dict[str, Any] = {"xycoords": "figure points", "textcoords": "figure points"}
    arrow = {"arrowstyle": "->", "color": DARK, "linewidth": 0.7, "shrinkA": 0.0, "shrinkB": 0.0, "mutation_scale": 6}
    letters: list[Array] = []
    small = {"xycoords": "figure points", "color": DARK, "fontsize": NOTE}
    for direction, name in zip(page_directions(*shown.view), "xyz", strict=True):
        axes.annotate("", start + 13.0 * direction, start, arrowprops=arrow, **points)
        length = float(np.linalg.norm(direction))
        if length > SEEN:
            tip = start + (13.0 + 5.5 / length) * direction
            while any(np.linalg.norm(tip - other) < LETTER for other in letters):
                tip = tip + direction / length
            letters.append(tip)
            axes.annotate(name, tip, ha="center", va="center", **small)
    scale = 72.0 * _inches_a_length(axes)  # points a unit of length
    length = rounded_down(LONGEST_BAR / scale)
    left = start + np.array([24.0, -12.0])
    bar = {**arrow, "arrowstyle": "|-|,widthA=0.2,widthB=0.2", "mutation_scale": 10}
    axes.annotate("", left + np.array([length * scale, 0.0]), left, arrowprops=bar, **points)
    word = unit or ("length unit" if length == 1 else "length units")
    axes.annotate(f"{length:g} {word}", left + np.array([0.0, 4.0]), ha="left", va="bottom", **small)


# ------------------------------------------------------------------------------------------------------------- the view


def page_directions(elevation: float, azimuth: float) -> Array:
    """Return the page's two directions (3, 2) for a view in degrees: right and up."""
    up, turn = np.radians([elevation, azimuth])
    right = [-np.sin(turn), np.cos(turn), 0.0]
    above = [-np.sin(up) * np.cos(turn), -np.sin(up) * np.sin(turn), np.cos(up)]
    return np.column_stack([right, above])


def contacts_of(
    curve: DecisionCurve,
    rho: ArrayLike,
    shown: ShownBodies,
    counted: Sequence[Feature] = (),
    problem: Problem | None = None,
) -> list[Touching]:
    """Return what bodies that are shown share at a scale pair on their curve, each place once.

    Of a `problem` faces that lie there are told in place of their edges and corners, see `with_whole_faces`. Several
    contacts are numbered as they are `counted` elsewhere, others after these; the first `MOST_NAMED`, which are told.
    """
    features, bodies = [*counted], shown.named or shown.bodies
    met = [(contact.feature, own) for contact, own in pacing.in_time(touching, curve, rho, late=())]
    near = 1e-6 * max(body.size for body in bodies)
    met.sort(key=lambda own: own[0] not in features)
    faces = {feature: _faces_shown(feature, (curve.movable, curve.static), shown.bodies) for feature, _ in met}
    first = {both: feature for feature, both in reversed(faces.items()) if both}
    shared = {feature: _shared(both, shown.bodies, near) for both, feature in first.items()}
    made = {feature: [Touching.of(feature, list(own), *bodies)] for feature, own in shared.items() if len(own)}
    for feature, corners in met:
        if first.get(faces[feature]) in made:
            continue
        if all(np.linalg.norm(corners.mean(axis=0) - one.middle) > near for own in made.values() for one in own):
            made.setdefault(feature, []).append(Touching.of(feature, [corners], *bodies))
    features += [feature for feature in made if feature not in features]
    found = [(features.index(feature) + 1, one) for feature, own in made.items() for one in own]
    if len(found) == 1:
        return [found[0][1]]
    whole = ([own] if problem is None else with_whole_faces(problem, [own], curve.transform) for own in features)
    words = {k: own.in_words(curve.movable, curve.static) for k, (own,) in enumerate(islice(whole, MOST_NAMED), 1)}
    lowest = {text: k for k, text in reversed(words.items())}  # exact at two points, faces touch once
    named = (
        one._replace(number=lowest[words[number]], text=words[number]) if number in words else one
        for number, one in found
    )
    return sorted(named, key=lambda one: one.number or len(found))


def numbered_contacts(contacts: Sequence[Touching], shown: ShownBodies) -> list[str]:
    """Return what the numbers in a picture of contacts stand for: "1 left face of key, face 7 of slot".

    No line breaks after the number. Of one that is not cut open, with the number of one that is and looks as it does.
    """
    insets, words = _magnified(contacts, shown), dict[int, str]()
    for each in contacts:
        alike = next((f"as in cut {own.number}" for own in insets if _look_alike(own, each)), "in the scene alone")
        where = "" if any(own.number == each.number for own in insets) else f" ({alike})"
        words |= {each.number: f"{each.text}{where}"} if each.text and each.number not in words else {}
    return [f"{number}\u00a0{words[number]}" for number in words]


def _faces_shown(feature: Feature, named: tuple[Body, Body], shown: tuple[Body, Body]) -> tuple[Element, ...]:
    """Return the faces of bodies as they are shown that two faces on one another are of; none of other features.

    `named`: the bodies that the feature names, as drawn. None of bodies of one part each: these share one piece.
    """
    sides = list(zip(named, shown, (feature.one, feature.two), strict=True))
    whole = any(body.triangles for body in shown) and all(body.triangles or len(body.parts) == 1 for body in shown)
    if not whole or feature.kind != "F1F2":
        return ()
    rows = [rows_of_element(own, element)[:1] for own, _, element in sides]
    return tuple(Element("F", shown[k].faces[row]) for k, own in enumerate(rows) for row in own if all(rows))


def _shared(faces: tuple[Element, ...], shown: tuple[Body, Body], near: float) -> Array:
    """Return triangles that make up what two faces share, (t, 3, 3), where they lie in a plane, as near to it."""
    from manifold3d import CrossSection, FillRule, triangulate

    polygons = [face_polygons(body, face) for body, face in zip(shown, faces, strict=True)]
    origin, normal = polygons[0][0][0], unit_normals(polygons[0][0][None])[0]
    if np.abs((np.concatenate([*polygons[0], *polygons[1]]) - origin) @ normal).max() > near:  # exact, of round faces
        return np.empty((0, 3, 3))
    flat = np.linalg.svd(normal[None])[2][1:]
    one, two = (CrossSection([(each - origin) @ flat.T for each in own], FillRule.NonZero) for own in polygons)
    loops = (one ^ two).to_polygons()
    if not loops:
        return np.empty((0, 3, 3))
    return origin + (np.vstack(loops) @ flat)[np.array(triangulate(loops))]


def shifts_of(problem: Problem) -> tuple[tuple[float, ...], ...]:
    """Return the directions in which the motion of a problem shifts the part, for `view_of`; of three or more none."""
    given = [tuple(shift.tolist()) for shift in problem.motion.shift_directions if shift is not None]
    return tuple(given) if len(given) < 3 else ()


@lru_cache(maxsize=32)
def view_of(
    curve: DecisionCurve, nominal: tuple[float, float], shifts: tuple[tuple[float, ...], ...] = ()
) -> tuple[float, float]:
    """Return from where contact and motion at the nominal sizes are seen best: one view for all answers to a question.

    As elevation and azimuth, degrees; `shifts` are directions of the motion.
    """
    one, two = curve.movable.scaled(nominal[0]).moved(curve.transform), curve.static.scaled(nominal[1])
    sets = curve.contact_sets(nominal)
    return _best_view(one, two, np.vstack(sets) if sets else np.empty((0, 3)), shifts)


def _best_view(one: Body, two: Body, spots: Array, shifts: Iterable[ArrayLike] = ()) -> tuple[float, float]:
    """Return from where two bodies that touch at some spots, or are apart, are seen best.

    Best is where most of the contact is hidden by no body, and where its normal and the shifts lie flat on the page,
    the one that does so least as flat as can be: then its slope, a gap and the motion are seen as long as they are;
    from the front (-y), with x to the right, if that does not hide most of it. Bodies that are apart are seen across
    what joins their seeds; where no contact is to be seen, most of body 1 is.
    """
    from scipy.spatial import ConvexHull

    points = np.vstack([one.vertices, two.vertices])
    if not len(spots):
        normal = two.seed - one.seed
    elif len(spots) < 3:
        normal = one.vertices.mean(axis=0) - two.vertices.mean(axis=0)
    else:  # in which they spread least
        normal = np.linalg.svd(spots - spots.mean(axis=0))[2][2]
    size = float(np.ptp(points, axis=0).max())
    lines = np.array([normal, *shifts])
    long = np.linalg.norm(lines, axis=1)
    lines = lines[long > DEFAULT.touch * size] / long[long > DEFAULT.touch * size, None]
    parts = [*one.parts, *two.parts]
    normals = np.concatenate([part.normals for part in parts])
    levels = np.concatenate([part.levels for part in parts])
    firsts = np.cumsum([0, *(len(part.normals) for part in parts)])[:-1]
    views = list(product((18.0, 32.0, 50.0), AZIMUTHS))
    points = points[ConvexHull(points).vertices]

    def hidden(spots: Array, view: tuple[float, float]) -> float:
        """Return the share of spots that the inside of a convex part hides.

        There, time times speed along a ray is at most the level for each of the part's faces, which begin at `firsts`.
        """
        toward, inside = np.cross(*page_directions(*view).T), list[bool]()
        speeds = normals @ toward
        flat = np.abs(speeds) < 1e-12
        for start in spots[:: -(-len(spots) * len(parts) // MOST_RAYS)] + 1e-3 * size * toward:
            heights = levels - normals @ start
            times = heights / np.where(flat, 1.0, speeds)
            enter = np.maximum.reduceat(np.where(flat | (speeds > 0.0), 0.0, times), firsts)
            leave = np.minimum.reduceat(np.where(flat | (speeds < 0.0), np.inf, times), firsts)
            clear = np.logical_or.reduceat(flat & (heights <= 0.0), firsts)
            inside.append(bool((~clear & (leave > np.maximum(enter, 0.0) + 1e-9)).any()))
        return float(np.mean(inside))

    shares = {view: hidden(spots, view) if len(spots) else 1.0 for view in views}
    if min(shares.values()) == 1.0:
        shares = {view: hidden(one.vertices[:: -(-len(one.vertices) // MOST_LOOKED_AT)], view) for view in views}

    def objective(view: tuple[float, float]) -> float:
        page = page_directions(*view)
        toward, flat = np.cross(page[:, 0], page[:, 1]), points @ page
        area = float(np.prod(np.ptp(flat, axis=0))) / size**2
        flatness = float(np.sqrt(max(0.0, 1.0 - np.square(lines @ toward).max(initial=0.0))))
        cost = view[0] / 120.0 + FROM_BEHIND * (view[1] > 0.0)
        return float(2.0 * (1.0 - shares[view]) + 0.8 * flatness + 0.2 * area - cost)

    return max(views, key=objective)


def _axes_for(sheet: Sheet, area: tuple[float, float, float, float], shown: ShownBodies, more: ArrayLike = ()) -> Any:
    """Return axes of one scale over an area that the scene fills, but for what numbers need at its edges."""
    flat = np.vstack([shown.points, np.reshape(more, (-1, 3))]) @ page_directions(*shown.view)
    size = np.array(area[2:])
    margin = min(MARGIN, 0.07 * area[2])
    half = float((np.ptp(flat, axis=0) / (size - 2.0 * margin)).max()) * size / 2.0
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    axes = sheet.axes(*area)
    axes.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]))
    axes.set_axis_off()
    return axes
