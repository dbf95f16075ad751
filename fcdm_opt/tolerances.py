"""Every tolerance of the toolkit, in relative terms, each with its reason."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """Relative tolerances; lengths are taken relative to the size of the bodies, angles in radians.

    Attributes
    ----------
    planarity
        Hull facets whose vertices lie within `planarity` times the part's size of one plane are one face. Drawn
        quads are not exactly planar in floats (about 1e-16); 1e-12 is far above that and far below any real facet.
    flatness
        A part whose thinnest extent is below `flatness` times its largest has no reliable inside and is refused.
    normal
        Face normals that plain arithmetic gives less well than this are worked out exactly, then rounded.
    partition
        Parts overlap when a ball larger than this fits inside both: ten times the LP solver's own tolerance.
    tie
        Directions and lengths that differ by less are taken as one by what has no exact path yet: unions, contact sets,
        the solver's flush contacts.
    line
        Where regions of several part pairs are joined, stretches shorter than this are dropped.
    sign
        A scale pair's side of a contact line is taken from floats where it is off the line by more than this, times
        the bodies' scaled sizes and their offset, and from rational arithmetic elsewhere; lines are right to 1e-13.
    point
        Scale pairs that differ by less are one: four roundings.
    nominal
        A nominal pair this near a switching point is that switching point (design: 1e-9).
    snap
        A nominal pair this near the curve may be closed to it (design: 1e-6); a problem may choose another.
    touch
        A pair is touching when its gap is at most this (relative to the smaller body, see `Problem.contact_slack`).
    side
        Relative opening and closing of the pair at which the judge asks for "apart" and "overlapping".
    requirement
        Slack by which a requirement's inequality may be missed through rounding.
    judge_gjk
        Tolerance handed to the collision library on bodies of unit size; its default of 1e-6 is a dead zone.
    solver
        Constraint tolerance of the NLP solver, in units of the scaled constraints.
    dual
        Tolerance of the NLP solver's stationarity: an error d in it costs the amount only d^2.
    cut
        A constraint that was left out is added once it is violated by more than this.
    least_unit
        The program measures in a typical amount, but in no less than this times the size: rounding in the contact
        equations is about 1e-16 times the size, and `solver` must stay attainable in the program's unit.
    march
        Shortest step of the advancement along a ray, relative to the size: a graze shallower than this may be missed
        and is not claimed as proved.
    determinant
        Two contact lines whose normalised determinant is below this do not define a switching point.
    seeds
        Seeds nearer than this define no screw axis (design: 1e-9).
    path_points
        Points of a motion's ray, ends included, at which the tracked contact must be real (design: 33).
    path_turn
        Most that a motion may turn between two of these points, radians: more points are looked at where it turns more.
    rigid
        How far a transform may be from orthogonal.
    """

    planarity: float = 1e-12
    flatness: float = 1e-12
    normal: float = 4e-15
    partition: float = 1e-6
    tie: float = 1e-11
    line: float = 1e-12
    sign: float = 2e-13
    point: float = 1e-15
    nominal: float = 1e-9
    snap: float = 1e-6
    touch: float = 1e-9
    side: float = 1e-6
    requirement: float = 1e-9
    judge_gjk: float = 1e-12
    solver: float = 1e-11
    dual: float = 1e-8
    cut: float = 1e-10
    least_unit: float = 1e-3
    march: float = 1e-7
    determinant: float = 1e-9
    seeds: float = 1e-9
    path_points: int = 33
    path_turn: float = 0.1
    rigid: float = 1e-9


DEFAULT = Tolerances()
