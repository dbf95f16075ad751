"""The pair of bodies in space, at given scales and pose."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, VERMILLION, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from fcdm_opt.curve.features import Feature

LABEL_DISTANCE = 9.0  # points between a vertex and its number
MOST_NUMBERS = 80  # corners that can be numbered legibly


def scene_figure(
    movable: Body,
    static: Body,
    *,
    rho: ArrayLike = (1.0, 1.0),
    transform: ArrayLike | None = None,
    features: Sequence[Feature] = (),
    contacts: ArrayLike = (),
    keep_out: Sequence[Body] = (),
    title: str = "",
    caption: str = "",
) -> Figure:
    """Draw both bodies: body 1 in solid lines, body 2 in dashed ones, vertices by number, seeds as crosses.

    Further bodies are grey, in dotted lines.

    Parameters
    ----------
    movable, static : Body
        As drawn.
    rho : (2,) array
        Scales at which they are shown.
    transform : (4, 4) array, optional
        Rigid motion of body 1.
    features : sequence of Feature
        Elements in contact, drawn with emphasis.
    contacts : (k, 3) array
        Contact points, world frame.
    keep_out : sequence of Body
        Further static bodies, as they are; those far away are left out.
    title, caption : str
        Text above and below the picture.
    """
    one, two = movable.scaled(float(np.asarray(rho)[0])), static.scaled(float(np.asarray(rho)[1]))
    if transform is not None:
        one = one.moved(transform)
    points = np.vstack([one.vertices, one.seed, two.vertices, two.seed])
    view = _best_view(points, two.seed - one.seed)
    reach = np.ptp(points, axis=0).max()
    room = points.min(axis=0) - reach, points.max(axis=0) + reach
    keep_out = [
        b for b in keep_out if (b.vertices.max(axis=0) >= room[0]).all() and (b.vertices.min(axis=0) <= room[1]).all()
    ]
    points = np.vstack([points, *(np.clip(body.vertices, *room) for body in keep_out)])
    figure, axes = _page_for(points, view)
    _draw_body(axes, one, BLUE, "solid", 0.16, f"1, movable: {one.name}")
    _draw_body(axes, two, VERMILLION, (0, (4, 2)), 0.08, f"2, static: {two.name}")
    for body in keep_out:
        _draw_body(axes, body, GREY, "dotted", 0.08, f"keep-out: {body.name}")
    for feature in features:
        for body, element in ((one, feature.one), (two, feature.two)):
            _draw_element(axes, body, element.kind, element.vertices)
    if features:
        axes.plot([], [], [], color=GREEN, linewidth=4.0, alpha=0.55, label="in contact")
    spots = np.asarray(contacts, dtype=float).reshape(-1, 3)
    if len(spots):
        axes.scatter(
            *spots.T,
            s=90,
            marker="o",
            facecolors="none",
            edgecolors=BLACK,
            linewidths=1.4,
            zorder=5,
            depthshade=False,
            label="contact point" if len(spots) == 1 else "contact points",
        )
    _number(figure, axes, ((one, BLUE), (two, VERMILLION)))
    _draw_directions(figure, axes, points, view)
    top = figure.get_figheight()
    figure.legend(loc="lower center", bbox_to_anchor=(0.58, 0.33 / top), ncols=2, frameon=False, fontsize=9)
    figure.suptitle(title, fontsize=11, y=1.0 - 0.12 / top, va="top")
    figure.text(0.5, 0.1 / top, caption, ha="center", va="bottom", fontsize=8.5)
    return figure


def true_edges(body: Body) -> dict[tuple[int, ...], Array]:
    """Return the body's own edges: vertex labels -> end points (2, 3); what a cut made on a face is left out."""
    return {
        element.vertices: body.vertices[[label - 1 for label in element.vertices]]
        for part in body.parts
        for element in part.elements["E"]
        if element.kind == "E"
    }


def _draw_body(axes: Any, body: Body, colour: str, style: Any, alpha: float, label: str) -> None:
    from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

    own = set(body.faces)
    polygons = [
        part.vertices[list(loop)]
        for part in body.parts
        for loop, element in zip(part.loops, part.elements["F"], strict=True)
        if element.vertices in own
    ]
    axes.add_collection3d(Poly3DCollection(polygons, facecolors=colour, edgecolors="none", alpha=alpha, zorder=1))
    edges = list(true_edges(body).values())
    axes.add_collection3d(Line3DCollection(edges, colors=colour, linestyles=[style], linewidths=1.4, zorder=3))
    axes.plot([], [], [], color=colour, linestyle=style, linewidth=1.4, label=label)
    axes.scatter(*body.seed, s=36, marker="x", color=colour, depthshade=False, zorder=3)


def _draw_element(axes: Any, body: Body, kind: str, labels: Sequence[int]) -> None:
    """Emphasise a vertex, an edge or a face."""
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    points = body.vertices[[label - 1 for label in labels]]
    if kind == "V":
        axes.scatter(*points.T, s=30, color=GREEN, depthshade=False, zorder=4)
    elif kind == "E":
        axes.plot(*points.T, color=GREEN, linewidth=4.0, alpha=0.55, zorder=2)
    else:
        polygons = [
            part.vertices[list(loop)]
            for part in body.parts
            for loop, element in zip(part.loops, part.elements["F"], strict=True)
            if element.kind == "F" and element.vertices == tuple(labels)
        ]
        axes.add_collection3d(Poly3DCollection(polygons, facecolors=GREEN, edgecolors="none", alpha=0.25, zorder=2))


def _draw_directions(figure: Figure, axes: Any, points: Array, view: tuple[float, float]) -> None:
    """World directions in the lower left corner, and a bar of known length above them."""
    corner = np.array([42.0, 40.0])
    for direction, name in zip(_page(*view), "xyz", strict=True):
        axes.annotate(
            "",
            corner + 24.0 * direction,
            corner,
            xycoords="figure points",
            textcoords="figure points",
            arrowprops={"arrowstyle": "->", "color": GREY, "shrinkA": 0.0, "shrinkB": 0.0},
        )
        axes.annotate(
            name, corner + 32.0 * direction, xycoords="figure points", color=GREY, fontsize=8, ha="center", va="center"
        )
    right = _page(*view)[:, 0]
    ends = _on_page(figure, axes, np.vstack([points[0], points[0] + right])) * 72.0 / figure.dpi
    scale = float(ends[1, 0] - ends[0, 0])
    power = 10.0 ** np.floor(np.log10(120.0 / scale))
    length = power * max(step for step in (1, 2, 5) if step * power * scale <= 120.0)
    start = np.array([12.0, 84.0])
    reach = np.array([length * scale, 0.0])
    axes.annotate(
        "",
        start + reach,
        start,
        xycoords="figure points",
        textcoords="figure points",
        arrowprops={"arrowstyle": "|-|,widthA=0.2,widthB=0.2", "color": GREY, "shrinkA": 0.0, "shrinkB": 0.0},
    )
    axes.annotate(
        f"{length:g}",
        start + reach / 2 + np.array([0.0, 4.0]),
        xycoords="figure points",
        color=GREY,
        fontsize=8,
        ha="center",
        va="bottom",
    )


# ------------------------------------------------------------------------------------------------------------ the view


def _page(elevation: float, azimuth: float) -> Array:
    """Return the page's two directions (3, 2) for a view in degrees: right and up."""
    up, turn = np.radians([elevation, azimuth])
    right = [-np.sin(turn), np.cos(turn), 0.0]
    above = [-np.sin(up) * np.cos(turn), -np.sin(up) * np.sin(turn), np.cos(up)]
    return np.column_stack([right, above])


def _best_view(points: Array, offset: Array) -> tuple[float, float]:
    """Choose the view that keeps the vertices apart on the page, body 1 in front but not hiding where they meet."""

    def merit(view: tuple[float, float]) -> float:
        page = _page(*view)
        flat = points @ page
        distances = np.linalg.norm(flat[:, None] - flat[None], axis=2)
        spread = distances[np.triu_indices(len(flat), 1)].min() * np.linalg.norm(offset @ page)
        behind = offset @ np.cross(*page.T) > 0
        return float(-1.0 if behind else spread)

    return max(product((14.0, 22.0, 30.0), np.arange(-175.0, 180.0, 10.0).tolist()), key=merit)


def _page_for(points: Array, view: tuple[float, float]) -> tuple[Figure, Any]:
    """Return a figure shaped like the scene, with 3-D axes of one scale that let the scene fill it."""
    width, height = np.ptp(points @ _page(*view), axis=0)
    margins = np.array([0.7, 2.0])  # inches; below: directions, legend, caption; above: title
    room = np.array([7.2 - margins[0], float(np.clip((7.2 - margins[0]) * height / width, 2.4, 6.0))])
    figure = new_figure(*(room + margins))
    page, side = room + margins, 2.0 * (room + margins).max()  # mplot3d clips to a square: larger than the page
    middle = room / 2 + [margins[0] / 2, 1.45]
    axes: Any = figure.add_axes(
        (*((middle - side / 2) / page), *(side / page)), projection="3d", proj_type="ortho", computed_zorder=False
    )
    low, high = points.min(axis=0), points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_axis_off()
    axes.view_init(*view)
    axes.set_box_aspect(high - low)
    drawn = _on_page(figure, axes, points) / figure.dpi
    axes.set_box_aspect(high - low, zoom=float((room / np.ptp(drawn, axis=0)).min()))
    drawn = _on_page(figure, axes, points) / figure.dpi
    shift = middle - (drawn.min(axis=0) + drawn.max(axis=0)) / 2
    axes.set_position((*((middle + shift - side / 2) / page), *(side / page)))
    return figure, axes


def _on_page(figure: Figure, axes: Any, points: Array) -> Array:
    """Return points (n, 3) in pixels of the page (n, 2)."""
    from mpl_toolkits.mplot3d import proj3d

    figure.draw_without_rendering()  # fixes the projection
    x, y, _ = proj3d.proj_transform(*points.T, axes.get_proj())
    return np.asarray(axes.transData.transform(np.column_stack([x, y])))


def _number(figure: Figure, axes: Any, bodies: Sequence[tuple[Body, str]]) -> None:
    """Write each corner's number beside it, on the side where most room is left on the page; not those of cuts."""
    own = [np.unique(np.concatenate(body.faces)) for body, _ in bodies]
    if sum(map(len, own)) > MOST_NUMBERS:
        return
    corners = [body.vertices[labels - 1] for (body, _), labels in zip(bodies, own, strict=True)]
    places = _on_page(figure, axes, np.vstack(corners)) * 72.0 / figure.dpi
    middle = places.mean(axis=0)
    taken = list(places)
    angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    offsets = LABEL_DISTANCE * np.column_stack([np.cos(angles), np.sin(angles)])
    labels = [(label, colour) for (_, colour), some in zip(bodies, own, strict=True) for label in some.tolist()]
    for (label, colour), place in zip(labels, places, strict=True):
        outward = (place - middle) / max(LABEL_DISTANCE, float(np.linalg.norm(place - middle)))
        near = np.linalg.norm(np.array(taken)[:, None] - place - offsets, axis=2)
        room = np.sort(near, axis=0)[:2].sum(axis=0) + offsets @ outward
        best = offsets[int(np.argmax(room))]
        taken.append(place + best)
        axes.annotate(
            str(label),
            tuple(place + best),
            xycoords="figure points",
            color=colour,
            fontsize=9,
            ha="center",
            va="center",
            zorder=6,
            bbox={"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none", "alpha": 0.6},
        )
