"""Every tolerance of the toolkit, in relative terms, each with its reason."""

from __future__ import annotations

import ast
import inspect
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """Relative tolerances; lengths are taken relative to the size of the bodies, angles in radians."""

    planarity: float = 1e-12
    """Hull facets whose vertices lie within `planarity` times the part's size of one plane are one face. Drawn quads
    are not exactly planar in floats (about 1e-16); 1e-12 is far above that and far below any real facet."""
    weld: float = 1e-12
    """Vertices of a mesh nearer to each other than this times its size, or than four of its coordinates' last digits,
    are one, and so are what is on an edge or in a plane: as `planarity`. Files in single precision give equal points
    with equal digits; nothing drawn is finer."""
    seam: float = 2e-6
    """Where a mesh is open, vertices nearer than this times its size are made one, and how far they were moved is told:
    exports leave seams of a millionth."""
    fold: float = 1e-4
    """Where a mesh crosses itself, what is finer than this times its extent is left out, a thousandth of it if that is
    enough, and how much is told: coordinates rounded to a few digits fold the slivers of a triangulation."""
    drawn: float = 1e-6
    """Corners of a polygon in a file that are off its plane by at most this times their largest coordinate are so by
    rounding to the file's digits, often 6 or 7: they are moved onto it. Polygons that are more bent are refused."""
    tessellation: float = 1e-2
    """Curved faces of a STEP file are cut into triangles that leave them by at most this times the length of their
    edges: fine for a contact in 1e-3, and few enough to be decomposed."""
    tessellation_turn: float = 0.4
    """Neighbouring triangles of a curved face turn by at most this, radians."""
    sharp: float = 1e-3
    """Planes of a STEP file that cross at a smaller angle than this, radians, do not fix a corner along their line."""
    flatness: float = 1e-12
    """A part whose thinnest extent is below `flatness` times its largest has no reliable inside and is refused."""
    normal: float = 4e-15
    """Face normals that plain arithmetic gives less well than this are worked out exactly, then rounded."""
    partition: float = 1e-6
    """Parts overlap when a ball larger than this fits inside both: ten times the LP solver's own tolerance."""
    tie: float = 1e-11
    """Directions and lengths that differ by less are taken as one by what has no exact path yet: unions, contact sets,
    the solver's flush contacts."""
    line: float = 1e-12
    """Where regions of several part pairs are joined, stretches shorter than this are dropped."""
    prune: float = 1e-8
    """A part pair is left out of a part of the scale box where it is apart, or hidden, by more than this times the
    bodies' extents and their offset: far above rounding, 1e-13, and above what joins pieces, `nominal`."""
    rim: float = 1e-6
    """The curve of unions is worked out in a box wider by this, so that what meets on the box's border is whole."""
    sign: float = 2e-13
    """A scale pair's side of a contact line is taken from floats where it is off the line by more than this, times the
    bodies' scaled sizes and their offset, and from rational arithmetic elsewhere; lines are right to 1e-13."""
    point: float = 1e-15
    """Scale pairs that differ by less are one: four roundings."""
    nominal: float = 1e-9
    """A nominal pair this near a switching point is that switching point (design: 1e-9)."""
    snap: float = 1e-6
    """A nominal pair this near the curve may be closed to it (design: 1e-6); a problem may choose another."""
    shared: float = 1e-6
    """A flush contact shares a segment longer, or a region wider, than this (relative to the smaller body), or it is
    none: within `touch` a narrower one cannot be told from a contact at its border. The judge asks for half."""
    touch: float = 1e-9
    """A pair is touching when its gap is at most this (relative to the smaller body, see `Problem.contact_slack`)."""
    tight: float = 1e-2
    """Share of `touch` within which parts touch beyond doubt: where some do, what is merely near is no contact."""
    side: float = 1e-6
    """Relative opening and closing of the pair at which the judge asks for "apart" and "overlapping"."""
    finer: float = 1e-4
    """Least share of `side` at which it asks again for "overlapping": where seeds lie near the plane of a contact, what
    closes it by `side` moves the parts along the plane by far more, past each other's rims."""
    requirement: float = 1e-9
    """Slack by which a requirement's inequality may be missed through rounding."""
    judge_gjk: float = 1e-12
    """Tolerance handed to the collision library on bodies of unit size; its default of 1e-6 is a dead zone."""
    solver: float = 1e-11
    """Constraint tolerance of the NLP solver, in units of the scaled constraints."""
    dual: float = 1e-8
    """Tolerance of the NLP solver's stationarity: an error d in it costs the amount only d^2."""
    active: float = 1e-8
    """A constraint of a least motion within this of its bound holds it: well above `cut`, to which solvers meet
    them."""
    stationary: float = 1e-6
    """Share of the amount's gradient that the active constraints may leave unbalanced: solvers stop at `dual`."""
    tied: float = 1e-7
    """Motions whose amounts differ by less are tied, and so are derivatives: well above `dual`."""
    cut: float = 1e-10
    """A constraint that was left out is added once it is violated by more than this."""
    least_unit: float = 1e-3
    """The program measures in a typical amount, but in no less than this times the size: rounding in the contact
    equations is about 1e-16 times the size, and `solver` must stay attainable in the program's unit."""
    march: float = 1e-7
    """Shortest step of the advancement along a ray, relative to the size: a graze shallower than this may be missed and
    is not claimed as proved."""
    determinant: float = 1e-9
    """Two contact lines whose normalised determinant is below this do not define a switching point."""
    seeds: float = 1e-9
    """Seeds nearer than this define no screw axis (design: 1e-9)."""
    path_points: int = 33
    """Points of a motion's ray, ends included, at which the tracked contact must be real (design: 33)."""
    path_asked: int = 9
    """How many of these points, ends included, the collision library is asked at about part pairs that a claim proves
    to touch there; about all others it is asked at every point."""
    path_turn: float = 0.1
    """Most that a motion may turn between two of these points, radians: more points are looked at where it turns
    more."""
    scale_points: int = 5
    """Scales of a keep-out's range, ends included, that the judge looks at one by one besides all of them at once."""
    rigid: float = 1e-9
    """How far a transform may be from orthogonal."""


DEFAULT = Tolerances()


def meanings() -> dict[str, str]:
    """Return what each tolerance means, by name: the text below it."""
    stated: Any = ast.parse(inspect.getsource(Tolerances)).body[0]
    pairs = zip(stated.body[1::2], stated.body[2::2], strict=True)
    return {item.target.id: " ".join(text.value.value.split()) for item, text in pairs}
