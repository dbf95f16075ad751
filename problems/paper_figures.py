"""Remake Figs. 3 to 7 of the FCDM paper from the reconstructed examples.

From the top of the repository, `python problems/paper_figures.py --out out/paper` writes each figure as PNG and SVG.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import fcdm_opt as fo
from fcdm_opt.show import BLACK, BLUE, GREEN, GREY, PAGE, PURPLE, VERMILLION, save, styled
from fcdm_opt.show.lettering import Names, Sheet
from fcdm_opt.show.plots import (
    DOUBLE,
    draw_at,
    draw_curve,
    draw_tolerance,
    listed,
    name_curve,
    name_sides,
    pieces,
    plane,
    reaching,
    window,
)
from fcdm_opt.show.raster import Raster
from fcdm_opt.show.scene import (
    ShownBodies,
    contacts_of,
    draw_directions,
    draw_scene,
    own_polygons,
    page_directions,
    sharp_edges,
)
from fcdm_opt.show.texts import motion_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).parent
NOTE_ON_BODIES = (
    "The bodies are reconstructions: the paper prints no coordinates. They meet every feature, switching point and "
    "motion that it publishes, and are not the authors' own."
)
PLAIN, OURS = (0, (5, 1.5)), (0, (1, 1.2))


@cache
def cases(example: int) -> tuple[fo.Problem, ...]:
    """Return the four cases of an example, A to D."""
    return tuple(fo.load_problems(HERE / f"example{example}.toml"))


@styled
def figure_3() -> Figure:
    """Draw both examples in space, as drawn, apart."""
    sheet = Sheet.of(
        PAGE, 3.3, title="Fig. 3  The two examples",
        caption=f"Polyhedron 1 (blue) is movable, polyhedron 2 (brown) static. {NOTE_ON_BODIES}",
    )  # fmt: skip
    for k, left in ((1, 0.0), (2, PAGE / 2)):
        asked = cases(k)[0]
        _scene(sheet, left, f"({'ab'[k - 1]})  Example {k}", ShownBodies.of(asked.movable, asked.static))
    return sheet.figure


@styled
def figure_4() -> Figure:
    """Draw both decision curves, with segments and switching points named."""
    sheet = Sheet.of(PAGE, 5.0, title="Fig. 4  The decision curves", caption=NOTE_ON_BODIES)
    for k, left in ((1, 0.5), (2, PAGE / 2 + 0.45)):
        curve = cases(k)[0].curve
        axes = sheet.axes(left, 2.2, 2.62, 2.55)
        axes.set_title(f"({'ab'[k - 1]})  Example {k}")
        plane(axes, curve.box)
        draw_curve(axes, curve, BLUE, "-", "decision curve")
        names = Names(axes, pieces(curve))
        name_curve(names, axes, curve, BLUE, sides=(1.0, -1.0))
        name_sides(names, curve)
        sheet.list(left, 1.75, 2.8, listed(curve))
    return sheet.figure


@styled
def figure_5() -> Figure:
    """Draw the contacts at both switching points of Example 2."""
    asked = cases(2)[0]
    sheet = Sheet.of(
        PAGE, 3.3, title="Fig. 5  Example 2 at its switching points",
        caption=f"Green: what is in contact. {NOTE_ON_BODIES}",
    )  # fmt: skip
    for point, left in zip(asked.curve.switching_points, (0.0, PAGE / 2), strict=True):
        shown = ShownBodies.of(asked.movable, asked.static, rho=point.rho)
        rho = f"({point.rho[0]:.4f}, {point.rho[1]:.4f})"
        title = f"({'ab'[point.index - 1]})  SW{point.index} at {rho}"
        labels = [feature.label for feature in point.contact_features]
        title = "\n".join([title, *labels])
        _scene(sheet, left, title, shown, contacts_of(asked.curve, point.rho, shown))
    return sheet.figure


def figure_6() -> Figure:
    """Draw Example 1 before and after the motions for requirements A to D."""
    return _requirements(1, "Fig. 6  Example 1, requirements A to D at SW3")


def figure_7() -> Figure:
    """Draw Example 2 before and after the motions for requirements A to D."""
    return _requirements(2, "Fig. 7  Example 2, requirements A to D at SW1")


FIGURES: dict[str, Callable[[], Figure]] = {
    "fig3": figure_3, "fig4": figure_4, "fig5": figure_5, "fig6": figure_6, "fig7": figure_7,
}  # fmt: skip


def _scene(sheet: Sheet, left: float, title: str, shown: ShownBodies, contacts: Sequence[Any] = ()) -> None:
    """Draw a scene into half of the sheet, with its title above and directions below."""
    axes = draw_scene(sheet, (left, 0.55, PAGE / 2, 2.3), shown, contacts=contacts)
    number_corners(axes, shown)
    draw_directions(sheet, axes, shown, (left + 0.1, 0.0))
    x, y, *_ = sheet.place(left + PAGE / 4, 3.28, 0.0, 0.0)
    sheet.figure.text(x, y, title, ha="center", va="top")


def number_corners(axes: Any, shown: ShownBodies) -> None:
    """Write each corner's number beside it, outwards if it can stand there, grey where hidden; hidden edges dotted."""
    from matplotlib.collections import LineCollection

    page, bodies = page_directions(*shown.view), list(zip(shown.bodies, (BLUE, VERMILLION), strict=True))
    (low, high), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    raster = Raster(page, np.array([low, bottom]), np.array([high, top]), 800)
    for k, (body, colour) in enumerate(bodies):
        raster.fill(own_polygons(body), colour, k)
    labels = [np.array(body.corners) for body, _ in bodies]
    edges = [sharp_edges(body) for body, _ in bodies]
    seen = np.concatenate([np.reshape(raster.visible(own), (-1, 2)) for own in edges])
    corners = [body.vertices[some - 1] @ page for (body, _), some in zip(bodies, labels, strict=True)]
    reach = 0.01 * np.ptp(np.concatenate(corners), axis=0).max()
    names = Names(axes, np.concatenate(edges) @ page)
    axes.add_collection(
        LineCollection(list(np.concatenate(edges) @ page), colors=GREY, linewidths=0.4, linestyles=":", zorder=2)
    )
    for place in np.concatenate(corners):
        names.keep(place, 3.0)
    for (_, colour), some, places in zip(bodies, labels, corners, strict=True):
        middle = places.mean(axis=0)
        for label, place in zip(some.tolist(), places, strict=True):
            hidden = not len(seen) or np.linalg.norm(seen - place, axis=1).min() > reach
            away = place - middle
            names.put(str(label), place, away if away.any() else (0.0, 1.0), colour=GREY if hidden else colour)


@styled
def _requirements(example: int, title: str) -> Figure:
    """Draw (1) the curve as drawn and (2) to (5) those after the published motions and ours."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    asked = cases(example)
    sheet = Sheet.of(
        PAGE, 5.75, title=title,
        caption="(1) whole box; (2) to (5) enlarged: the tolerance box and the marked points. Double lines: ends of "
        f"the coherent range of the published motion, where they pass there. {NOTE_ON_BODIES}",
    )  # fmt: skip
    side, gap = 1.68, 0.5
    spots = [(0.5 + (side + gap) * (k % 3), 3.85 if k < 3 else 1.55) for k in range(5)]
    whole = sheet.axes(*spots[0], side, side)
    first = asked[0]
    plane(whole, first.box)
    draw_tolerance(whole, first.changed(goal="at"))
    draw_curve(whole, first.curve, BLUE, "-", "")
    _mark(whole, first.nominal_pair, "*", BLACK)
    whole.set_title("(1)  as drawn")
    name_curve(Names(whole, pieces(first.curve)), whole, first.curve, BLUE, sides=(1.0, -1.0))
    words = []
    for k, problem in enumerate(asked, 1):
        axes = sheet.axes(*spots[k], side, side)
        axes.set_title(f"({k + 1})  requirement {problem.name}")
        words.append(f"({k + 1})  {_draw_requirement(axes, problem)}")
    for k, axes in enumerate(sheet.figure.axes):
        axes.set_xlabel(r"$\rho_1$  (scale of body 1, movable)")
        axes.set_ylabel(r"$\rho_2$  (scale of body 2, static)" if k % 3 == 0 else r"$\rho_2$")
        axes.locator_params(nbins=4)
    sheet.list(0.1, 1.1, PAGE - 0.2, words)
    hollow = {"linestyle": "none", "markerfacecolor": "none"}
    key = {
        "original curve": Line2D([], [], color=BLUE),
        "after the published motion": Line2D([], [], color=VERMILLION, linestyle=PLAIN),
        "after our smallest motion": Line2D([], [], color=PURPLE, linestyle=OURS),
        "tolerance": Patch(facecolor=GREY, alpha=0.3),
        "required": Patch(facecolor=GREEN, alpha=0.1),
        "original switching point": Line2D([], [], marker="*", color=BLACK, markersize=6, linestyle="none"),
        "with tolerance (parts made)": Line2D([], [], marker="D", markeredgecolor=GREEN, markersize=5.5, **hollow),
        "new one, published": Line2D([], [], marker="o", markeredgecolor=VERMILLION, markersize=8, **hollow),
        "new one, ours": Line2D([], [], marker="s", markeredgecolor=PURPLE, markersize=8, **hollow),
    }
    x, y, *_ = sheet.place(spots[2][0] - 0.3, spots[3][1] + side, 0.0, 0.0)
    sheet.figure.legend(key.values(), key.keys(), loc="upper left", bbox_to_anchor=(x, y), handlelength=2.6)
    return sheet.figure


def _draw_requirement(axes: Any, problem: fo.Problem) -> str:
    """Draw one requirement enlarged; return the motions in words."""
    assert problem.published is not None
    solution = fo.solve(problem)
    found = fo.coherent_range(problem, problem.published)
    new = found.rho(1.0)
    limits = window(problem, solution, [new])
    plane(axes, limits)
    draw_tolerance(axes, problem)
    transform = problem.motion.transform(problem.published, problem.movable.seed, problem.static.seed)
    curves = [
        (problem.curve, BLUE, "-"),
        (fo.decision_curve(problem.movable, problem.static, box=problem.box, transform=transform), VERMILLION, PLAIN),
    ]
    if solution.transform is not None:
        ours = fo.decision_curve(problem.movable, problem.static, box=problem.box, transform=solution.transform)
        curves.append((ours, PURPLE, OURS))
    for end in (found.low, found.high):
        if math.isfinite(end):
            draw_at(axes, found, end * (1.0 - 2.0**-20), GREY, DOUBLE, 0.8)
    for curve, colour, style in curves:
        draw_curve(axes, reaching(curve, limits), colour, style, "")
    _mark(axes, problem.nominal_pair, "*", BLACK)
    _mark(axes, problem.target, "D", GREEN)
    _mark(axes, new, "o", VERMILLION)
    if solution.rho is not None:
        _mark(axes, solution.rho, "s", PURPLE)
    amount = math.hypot(*(w * q for w, q in zip(problem.weights, problem.published, strict=True)))
    return (
        f"{problem.name}: published {problem.published_text}, amount {amount:.4g}, coherent from {found.low:.4g} to "
        f"{found.high:.4g} times that; ours {motion_text(solution)}, amount {solution.amount:.4g}"
    )


def _mark(axes: Any, rho: Any, marker: str, colour: str) -> None:
    size = {"*": 6.0, "D": 5.5, "o": 9.0, "s": 9.0}[marker]
    axes.plot(
        *np.asarray(rho), marker=marker, markersize=size, color=colour, zorder=5, linestyle="none",
        markerfacecolor=colour if marker == "*" else "none", markeredgewidth=1.0,
    )  # fmt: skip


def main() -> None:
    """Write every figure to the directory that is asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/paper"), help="directory, made if it is not there")
    parser.add_argument("--small", action="store_true", help="write smaller PNGs too")
    given = parser.parse_args()
    for name, draw in FIGURES.items():
        for path in save(draw(), given.out / name, small=given.small):
            print(path)


if __name__ == "__main__":
    main()
