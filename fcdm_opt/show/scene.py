"""The pair of bodies in space, at given scales and pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.curve.features import Feature
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.elements import Element
from fcdm_opt.show import BLACK, BLUE, DARK, GREEN, GREY, NOTE, ORANGE, PURPLE, VERMILLION, Figure, styled
from fcdm_opt.show.lettering import Names, Sheet, literal
from fcdm_opt.show.texts import shortened

WIDTH = 12.0 / 2.54
"""Inches: between a column and the page."""

ALONE, VIEW = 2.6, (27.0, -54.0)
"""Inches across of a body alone, and degrees it is seen from; no symmetric view, in which edges of a cube meet."""

LEAST, MOST, FOOT, MARGIN = 1.6, 3.9, 0.55, 0.2
"""Inches that a scene may be high, below it for directions and scale (more where a legend needs it), and that corners
keep from the edge of its area, for their numbers."""

COLOURS: tuple[str, ...] = (VERMILLION, BLUE, GREEN, PURPLE, ORANGE, GREY)
LINES: tuple[Any, ...] = ("solid", (0, (4, 2)), "dotted")
"""Of parts of an assembly, one after the other."""

MOST_NUMBERS, LONGEST_NAME = 80, 44
"""Corners that can be numbered legibly, and letters of a body's name in the legend."""

LONGEST_BAR, LETTER, SEEN = 60.0, 9.0, 0.2
"""Points: the bar of known length is at most so long, and letters of two directions so far apart; a direction of the
world shorter than this on the page gets no name."""


@styled
def scene_figure(
    shown: ShownPair,
    *,
    features: Sequence[Feature] = (),
    contacts: ArrayLike = (),
    unit: str = "",
    title: str = "",
    caption: str = "",
) -> Figure:
    """Draw both bodies: body 1 in solid lines, body 2 in dashed ones, vertices by number, seeds as crosses.

    Further bodies are grey, in dotted lines.

    Parameters
    ----------
    shown : ShownPair
    features : sequence of Feature
        Elements in contact, drawn with emphasis.
    contacts : (k, 3) array
        Contact points, world frame.
    unit : str
        Of lengths, beside the bar of known length.
    title, caption : str
        Text above and below the picture.
    """
    rows = 2 + len(shown.keep_out) + (len(features) > 0) + (np.size(contacts) > 0)
    foot = max(FOOT, 0.16 * rows)
    height = float(np.clip(shown.slenderness * (WIDTH - 0.3), LEAST, MOST))
    sheet = Sheet.of(WIDTH, height + foot + 0.35, title=title, caption=caption)
    axes = draw_scene(sheet, (0.0, foot, WIDTH, height + 0.35), shown, features=features, contacts=contacts)
    draw_directions(sheet, axes, shown, (0.0, 0.0), unit)
    _add_legend(sheet, axes, foot)
    return sheet.figure


@styled
def body_figure(body: Body) -> Figure:
    """Draw one body as drawn, with its seed."""
    page = page_directions(*VIEW)
    shown = ShownPair((body, body), (), np.vstack([body.vertices, body.seed]), VIEW)
    height = float(np.clip(shown.slenderness * ALONE, LEAST, MOST))
    sheet = Sheet.of(ALONE, height)
    _draw_body(_axes_for(sheet, (0.0, 0.0, ALONE, height), shown), page, body, BLUE, "solid", 0.16, body.name)
    return sheet.figure


@styled
def parts_figure(
    bodies: Sequence[Body], names: Sequence[str], *, unit: str = "", title: str = "", caption: str = ""
) -> Figure:
    """Draw several bodies where they are, each in its colour and kind of line, with its name in the legend."""
    points = np.vstack([np.vstack([body.vertices, body.seed]) for body in bodies])
    shown = ShownPair((bodies[0], bodies[1]), (), points, VIEW)
    foot = max(FOOT, 0.16 * (len(bodies) + 1))
    height = float(np.clip(shown.slenderness * (WIDTH - 0.3), LEAST, MOST))
    sheet = Sheet.of(WIDTH, height + foot + 0.35, title=title, caption=caption)
    axes, page = _axes_for(sheet, (0.0, foot, WIDTH, height + 0.35), shown), page_directions(*shown.view)
    for k, (body, name) in enumerate(zip(bodies, names, strict=True)):
        colour, style = COLOURS[k % len(COLOURS)], LINES[k // len(COLOURS) % len(LINES)]
        _draw_body(axes, page, body, colour, style, 0.12, shortened(name, LONGEST_NAME))
    draw_directions(sheet, axes, shown, (0.0, 0.0), unit)
    _add_legend(sheet, axes, foot)
    return sheet.figure


def _add_legend(sheet: Sheet, axes: Any, foot: float) -> None:
    handles, labels = axes.get_legend_handles_labels()
    x, y, *_ = sheet.place(1.75, foot / 2, 0.0, 0.0)
    labels = [*map(literal, labels)]
    sheet.figure.legend(handles, labels, loc="center left", bbox_to_anchor=(x, y), borderaxespad=0.0, handlelength=2.6)


@dataclass(frozen=True)
class ShownPair:
    """Bodies where and as large as they are shown, and the view they are seen from.

    Attributes
    ----------
    bodies : (movable, static)
    keep_out : tuple of Body
        Those near enough to be shown.
    points : (n, 3) array
        What must be on the page.
    view : (elevation, azimuth)
        Degrees.
    """

    bodies: tuple[Body, Body]
    keep_out: tuple[Body, ...]
    points: Array
    view: tuple[float, float]

    @classmethod
    def of(
        cls,
        movable: Body,
        static: Body,
        *,
        rho: ArrayLike = (1.0, 1.0),
        transform: ArrayLike | None = None,
        keep_out: Sequence[Body] = (),
    ) -> ShownPair:
        """Return the bodies at given scales and pose, seen from where they hide least of each other.

        Parameters
        ----------
        movable, static : Body
            As drawn.
        rho : (2,) array
            Scales at which they are shown.
        transform : (4, 4) array, optional
            Rigid motion of body 1.
        keep_out : sequence of Body
            Further static bodies, as they are; those far away are left out.
        """
        sizes = np.asarray(rho, dtype=float)
        one, two = movable.scaled(float(sizes[0])), static.scaled(float(sizes[1]))
        one = one if transform is None else one.moved(transform)
        points = np.vstack([one.vertices, one.seed, two.vertices, two.seed])
        view = _best_view(points, two.seed - one.seed)
        reach = np.ptp(points, axis=0).max()
        low, high = points.min(axis=0) - reach, points.max(axis=0) + reach
        near = [b for b in keep_out if (b.vertices.max(axis=0) >= low).all() and (b.vertices.min(axis=0) <= high).all()]
        points = np.vstack([points, *(np.clip(body.vertices, low, high) for body in near)])
        return cls((one, two), tuple(near), points, view)

    @property
    def slenderness(self) -> float:
        """Height over width on the page."""
        width, height = np.ptp(self.points @ page_directions(*self.view), axis=0)
        return float(height / width)


def draw_scene(
    sheet: Sheet,
    area: tuple[float, float, float, float],
    shown: ShownPair,
    *,
    features: Sequence[Feature] = (),
    contacts: ArrayLike = (),
) -> Any:
    """Draw a scene into an area of a sheet (left, bottom, width, height; inches); return its axes, for a legend."""
    axes, page = _axes_for(sheet, area, shown), page_directions(*shown.view)
    one, two = shown.bodies
    _draw_body(axes, page, one, BLUE, "solid", 0.16, f"1, movable: {shortened(one.name, LONGEST_NAME)}")
    _draw_body(axes, page, two, VERMILLION, (0, (4, 2)), 0.08, f"2, static: {shortened(two.name, LONGEST_NAME)}")
    for body in shown.keep_out:
        _draw_body(axes, page, body, GREY, "dotted", 0.08, f"keep-out: {shortened(body.name, LONGEST_NAME)}")
    for feature in features:
        for body, element in ((one, feature.one), (two, feature.two)):
            _draw_element(axes, page, body, element)
    if features:
        axes.plot([], [], color=GREEN, linewidth=3.2, alpha=0.55, label="in contact")
    spots = np.asarray(contacts, dtype=float).reshape(-1, 3) @ page
    if len(spots):
        axes.scatter(*spots.T, s=55, marker="o", facecolors="none", edgecolors=BLACK, linewidths=1.1, zorder=5,
                     label="contact point" if len(spots) == 1 else "contact points")  # fmt: skip
    _number(axes, page, ((one, BLUE), (two, VERMILLION)))
    return axes


def true_edges(body: Body) -> dict[tuple[int, ...], Array]:
    """Return the body's own edges: vertex labels -> end points (2, 3); what a cut made on a face is left out."""
    return {
        element.vertices: body.vertices[[label - 1 for label in element.vertices]]
        for part in body.parts
        for element in part.elements["E"]
        if element.kind == "E"
    }


def own_polygons(body: Body) -> list[Array]:
    """Return convex polygons that make up the body's own faces, (k, 3) each; not those of cuts."""
    if body.skin:
        return [body.vertices[list(triangle)] for face in body.skin for triangle in face]
    faces = set(body.faces)
    return [
        part.vertices[list(loop)]
        for part in body.parts
        for loop, element in zip(part.loops, part.elements["F"], strict=True)
        if element.vertices in faces
    ]


def face_polygons(body: Body, face: Element) -> list[Array]:
    """Return convex polygons that make up a face, (k, 3) each: of the parts that carry it where its own are not known.

    A part that overlaps others may carry the face beyond where it is the solid's.
    """
    if body.skin and face.vertices in body.faces:
        return [body.vertices[list(triangle)] for triangle in body.skin[body.faces.index(face.vertices)]]
    return [part.vertices[list(loop)] for part in body.parts for loop in part.carriers(face)]


def _draw_body(axes: Any, page: Array, body: Body, colour: str, style: Any, alpha: float, label: str) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    polygons = [polygon @ page for polygon in own_polygons(body)]
    axes.add_collection(PolyCollection(polygons, facecolors=colour, edgecolors="none", alpha=alpha, zorder=1))
    edges = [ends @ page for ends in true_edges(body).values()]
    axes.add_collection(LineCollection(edges, colors=colour, linestyles=[style], linewidths=1.1, zorder=3))
    axes.plot([], [], color=colour, linestyle=style, linewidth=1.1, label=label)
    axes.scatter(*(body.seed @ page), s=22, marker="x", color=colour, zorder=3)


def _draw_element(axes: Any, page: Array, body: Body, element: Element) -> None:
    """Emphasise a vertex, an edge or a face."""
    from matplotlib.collections import PolyCollection

    points = body.vertices[[label - 1 for label in element.vertices]] @ page
    if element.kind == "V":
        axes.scatter(*points.T, s=20, color=GREEN, zorder=4)
    elif element.kind == "E":
        axes.plot(*points.T, color=GREEN, linewidth=3.2, alpha=0.55, zorder=2)
    else:
        polygons = [polygon @ page for polygon in face_polygons(body, element)]
        axes.add_collection(PolyCollection(polygons, facecolors=GREEN, edgecolors="none", alpha=0.25, zorder=2))


def draw_directions(sheet: Sheet, axes: Any, shown: ShownPair, corner: tuple[float, float], unit: str = "") -> None:
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
    (here, _), (there, _) = axes.transData.transform([(0.0, 0.0), (1.0, 0.0)])
    scale = float(there - here) * 72.0 / sheet.figure.dpi  # points a unit of length
    power = 10.0 ** np.floor(np.log10(LONGEST_BAR / scale))
    length = power * max(step for step in (1, 2, 5) if step * power * scale <= LONGEST_BAR)
    left = start + np.array([24.0, -12.0])
    reach = np.array([length * scale, 0.0])
    bar = {**arrow, "arrowstyle": "|-|,widthA=0.2,widthB=0.2", "mutation_scale": 10}
    axes.annotate("", left + reach, left, arrowprops=bar, **points)
    word = unit or ("length unit" if length == 1 else "length units")
    axes.annotate(f"{length:g} {word}", left + np.array([0.0, 4.0]), ha="left", va="bottom", **small)


# ------------------------------------------------------------------------------------------------------------- the view


def page_directions(elevation: float, azimuth: float) -> Array:
    """Return the page's two directions (3, 2) for a view in degrees: right and up."""
    up, turn = np.radians([elevation, azimuth])
    right = [-np.sin(turn), np.cos(turn), 0.0]
    above = [-np.sin(up) * np.cos(turn), -np.sin(up) * np.sin(turn), np.cos(up)]
    return np.column_stack([right, above])


def _best_view(points: Array, offset: Array) -> tuple[float, float]:
    """Choose the view that keeps the vertices apart on the page, body 1 in front but not hiding where they meet."""

    def merit(view: tuple[float, float]) -> float:
        page = page_directions(*view)
        flat = points @ page
        distances = np.linalg.norm(flat[:, None] - flat[None], axis=2)
        spread = distances[np.triu_indices(len(flat), 1)].min() * np.linalg.norm(offset @ page)
        behind = offset @ np.cross(*page.T) > 0
        return float(-1.0 if behind else spread)

    return max(product((14.0, 22.0, 30.0), np.arange(-175.0, 180.0, 10.0).tolist()), key=merit)


def _axes_for(sheet: Sheet, area: tuple[float, float, float, float], shown: ShownPair) -> Any:
    """Return axes of one scale over an area that the scene fills, but for what numbers need at its edges."""
    flat = shown.points @ page_directions(*shown.view)
    size = np.array(area[2:])
    half = float((np.ptp(flat, axis=0) / (size - 2.0 * MARGIN)).max()) * size / 2.0
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2.0
    axes = sheet.axes(*area)
    axes.set(xlim=(middle[0] - half[0], middle[0] + half[0]), ylim=(middle[1] - half[1], middle[1] + half[1]))
    axes.set_axis_off()
    return axes


def _number(axes: Any, page: Array, bodies: Sequence[tuple[Body, str]]) -> None:
    """Write each corner's number beside it, outwards if it can stand there; not those of cuts."""
    labels = [np.array(body.corners) for body, _ in bodies]
    if sum(map(len, labels)) > MOST_NUMBERS:
        return
    corners = [body.vertices[some - 1] @ page for (body, _), some in zip(bodies, labels, strict=True)]
    edges = [np.array(list(true_edges(body).values())) @ page for body, _ in bodies]
    names = Names(axes, np.concatenate(edges))
    for place in np.concatenate(corners):
        names.keep(place, 3.0)
    for (_, colour), some, places in zip(bodies, labels, corners, strict=True):
        middle = places.mean(axis=0)
        for label, place in zip(some.tolist(), places, strict=True):
            away = place - middle
            names.put(str(label), place, away if away.any() else (0.0, 1.0), colour=colour)
