"""What a body's card says, and its edges, seen obliquely from above."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fcdm_opt.show.notebook.card import Card
from fcdm_opt.show.notebook.pictures import Mark, Picture, drawing
from fcdm_opt.show.scene import page_directions
from fcdm_opt.show.texts import counted, number, numbers

if TYPE_CHECKING:
    from fcdm_opt.geometry.bodies import Body

VIEW = 27.0, -54.0
"""Elevation and azimuth in degrees that the body is seen from; no symmetric view, in which edges of a cube meet."""

EDGES = 400
"""Edges that are drawn; of bodies with more only their outline."""

MARGIN = 0.04
"""Room about the picture, as a share of the body's size."""


def body_card(body: Body) -> Card:
    """Return the card of a body: what it is made of, its seed, and its edges."""
    facts = [
        ("corners", str(len(body.corners))),
        ("faces", str(len(body.faces))),
        ("convex parts", str(len(body.parts))),
        ("seed", f"({numbers(body.seed)})"),
        ("extent", " x ".join(map(number, np.ptp(body.vertices, axis=0).tolist())), "length"),
        ("off the solid", numbers(body.deviation, 3) if any(body.deviation) else "", "outward, inward at most"),
    ]
    return Card(f"Body: {body.name}", facts=facts, lists={"how it was made": body.notes}, picture=_edges(body))


def _edges(body: Body) -> Picture | None:
    """Return a picture of the body's own edges, those at the back of their part thin, and of the seed."""
    page = page_directions(*VIEW)
    eye = np.cross(*page.T)
    lines: list[Mark] = []
    many = sum(len(part.edges) for part in body.parts) > EDGES
    for part in body.parts:
        flat, seen = part.vertices @ page, part.normals @ eye > 0.0
        for k, (origin, end, one, two) in enumerate(part.edges.tolist()):
            if part.elements["E"][k].kind != "E" or (many and seen[one] == seen[two]):
                continue  # a cut between parts runs here
            lines.append(Mark("front" if seen[one] or seen[two] else "back", (flat[origin], flat[end])))
    lines.sort(key=lambda line: line.style)
    flat, seed = body.vertices @ page, body.seed @ page
    corners, room = np.vstack([flat, seed]), MARGIN * body.size
    limits = np.column_stack([corners.min(axis=0) - room, corners.max(axis=0) + room])
    told = f"{counted(len(lines), 'edge')} of the body, seen from above; the cross is its seed"
    return drawing([*lines, Mark("seed", seed, "seed")], limits, told=told)
