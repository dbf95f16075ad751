"""What a decision curve is listed as: segments, switching points and branches, and what a box leaves of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Configuration, Contact, Meeting, contact_set, meetings
from fcdm_opt.curve.envelope import Run
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import Piece
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.plain import Plain
from fcdm_opt.tolerances import DEFAULT

Box = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Segment(Plain):
    """One straight piece of the curve: one contact feature.

    Attributes
    ----------
    feature : Feature
    line : (3,) array
        (a, b, c) of the contact line a rho_1 + b rho_2 = c, in lengths (unit normal); overlap on the side of (a, b).
    normal : (3,) array
        Unit direction from body 1 to body 2, world frame.
    start, end : (2,) arrays
        Ends inside the box, in the order of the chain: overlap on the left.
    parts : tuple of int
        The part pair, 0-based.
    snug : bool
        Overlap on both sides: a fit without play.
    index : int
        1-based number in the box; 0 outside it.
    run : Run
        The unclipped stretch, and the pieces of the part pairs in it.
    """

    plain_names = ("index", "feature", "configuration", "slope", "line", "start", "end", "parts", "snug")

    feature: Feature
    line: Array
    normal: Array
    start: Array
    end: Array
    parts: tuple[int, int]
    snug: bool
    index: int
    run: Run

    def __repr__(self) -> str:
        """Return number, contact, line and ends on one line; everything else is an attribute."""
        a, b, c = (f"{x:.6g}" for x in self.line.tolist())
        start, end = (", ".join(f"{x:.6g}" for x in own.tolist()) for own in (self.start, self.end))
        return f"Segment({self.index}: {self.feature}, {a} rho_1 + {b} rho_2 = {c}, from ({start}) to ({end}))"

    @property
    def slope(self) -> float:
        """The derivative of rho_2 by rho_1 along it, infinite where it is vertical."""
        a, b, _ = self.line
        return float(-a / b) if b else math.inf

    @property
    def configuration(self) -> Configuration:
        """Which of the seven contact configurations it is, see `Contact.configuration`."""
        return self.run.whole.contact.configuration

    def nearest(self, rho: Array) -> Array:
        """Return the scale pair of the stretch nearest to a scale pair, (2,); the stretch may go on beyond the box."""
        piece = self.run.whole
        return piece.at(float(np.clip(piece.parameter(rho), piece.lo, piece.hi)))

    def piece_at(self, rho: Array) -> Piece:
        """Return the piece of the part pair that touches at a scale pair of the segment."""
        return self.run.at(rho)


@dataclass(frozen=True, eq=False)
class SwitchingPoint(Plain):
    """Where two segments meet, or a point of the curve on no segment: a fit without play, overlap on all sides.

    Attributes
    ----------
    rho : (2,) array
    features : tuple of two Feature
        Of the segments before and after it; of two contacts there where it is alone.
    lines : (2, 3) array
        Their contact lines.
    adjacent_contacts : tuple of two Contact
        What touches along them.
    pieces : tuple of two Piece
        The pieces of the part pairs that meet.
    bodies : tuple of two Body
    pose : (12,) array
        R, row by row, and d = s_2 - moved s_1.
    index : int
        1-based number in the box; 0 outside it. Those alone come last.
    alone : bool
        Whether no segment leads to it.
    """

    plain_names = ("index", "rho", "kind", "configurations", "label", "contacts", "contact_sets")

    rho: Array
    features: tuple[Feature, Feature]
    lines: Array
    adjacent_contacts: tuple[Contact, Contact]
    pieces: tuple[Piece, Piece]
    bodies: tuple[Body, Body]
    pose: Array
    index: int
    alone: bool = False

    def __repr__(self) -> str:
        """Return number, sizes and contacts on one line; everything else is an attribute."""
        place = ", ".join(f"{x:.6g}" for x in self.rho.tolist())
        return f"SwitchingPoint({self.index}: at ({place}), {' and '.join(map(str, self.features))})"

    @property
    def touching(self) -> tuple[Contact, ...]:
        """What touches there, each part pair once.

        One contact (for instance V1E2) where those of the two segments merge, else both; then those of all other part
        pairs that touch there too.
        """
        return tuple(meeting.contact for meeting in self._met)

    @cached_property
    def contact_sets(self) -> tuple[Array, ...]:
        """What the bodies share in each contact, (k, 3): a point, a segment's ends or a polygon's corners, world."""
        return tuple(shared(self.bodies, self.pose, meeting, self.rho) for meeting in self._met)

    @cached_property
    def _met(self) -> tuple[Meeting, ...]:
        before, after = self.pieces
        slack = DEFAULT.nominal * max(body.size for body in self.bodies)
        if before.parts == after.parts and before.corner:
            known = [Meeting(before.parts, before.corner)]
        else:
            sides = zip(self.pieces, self.adjacent_contacts, strict=True)
            known = [Meeting(piece.parts, contact) for piece, contact in sides]
            merged = before.feature.merged(after.feature)
            one, two = (shared(self.bodies, self.pose, own, self.rho).mean(axis=0) for own in known)
            if merged and np.abs(one - two).max() <= slack:  # one contact at a seam
                known = [Meeting(before.parts, before.contact.labelled(merged))]
        pairs = {piece.parts for piece in self.pieces}
        others = meetings(*self.bodies, self.pose, self.rho, slack)
        others = [other for other in others if other.parts not in pairs]
        return (*known, *without_borders(others, known))

    @property
    def contact_features(self) -> tuple[Feature, ...]:
        """One feature (for instance V1E2) where contacts merge, or all that are there at once, each named once."""
        return tuple(dict.fromkeys(contact.feature for contact in self.touching))

    @property
    def contacts(self) -> Array:
        """Contact points, one a contact feature, (k, 3), world frame: the middle of what is shared."""
        found: dict[Feature, list[Array]] = {}
        for contact, own in zip(self.touching, self.contact_sets, strict=True):
            found.setdefault(contact.feature, []).append(own)
        return frozen([middle(own) for own in found.values()])

    @property
    def configurations(self) -> tuple[Configuration, ...]:
        """Which of the seven contact configurations each contact feature is, see `Contact.configuration`."""
        first = {contact.feature: contact.configuration for contact in reversed(self.touching)}
        return tuple(first[feature] for feature in self.contact_features)

    @property
    def kind(self) -> str:
        """For instance "V1E2", or "V1F2 & V1F2" for two contacts at once."""
        return " & ".join(feature.kind for feature in self.contact_features)

    @property
    def label(self) -> str:
        """The contact features' labels."""
        return " & ".join(feature.label for feature in self.contact_features)


def without_borders(met: Sequence[Meeting], known: Sequence[Meeting] = ()) -> tuple[Meeting, ...]:
    """Leave out contacts between corners of what a larger one has: parts cut along that touch at its border too."""
    features = dict.fromkeys(own.contact.feature for own in (*known, *met))
    corners = {own: (frozenset(own.one.vertices), frozenset(own.two.vertices)) for own in features}
    held = {
        small
        for small, (a, b) in corners.items()
        if any(a <= c and b <= d and (a, b) != (c, d) for c, d in corners.values())
    }
    return tuple(own for own in met if own.contact.feature not in held)


def middle(sets: Sequence[Array]) -> Array:
    """Return the middle of a contact: of its corners, or of their box where it is spread over several parts."""
    corners = np.concatenate(sets)
    return corners.mean(axis=0) if len(sets) == 1 else (corners.min(axis=0) + corners.max(axis=0)) / 2


def shared(bodies: tuple[Body, Body], pose: Array, meeting: Meeting, rho: Array) -> Array:
    """Return what two bodies share where two of their parts touch at a scale pair, (k, 3), world frame."""
    one, two = (body.parts[k] for body, k in zip(bodies, meeting.parts, strict=True))
    return frozen(bodies[1].seed + contact_set(one, two, pose, meeting.contact, rho))


@dataclass(frozen=True, eq=False)
class Branch:
    """A connected chain of the curve inside the box."""

    segments: tuple[Segment, ...]

    @property
    def is_function(self) -> bool:
        """Whether rho_2 is a function of rho_1 along it."""
        runs = [segment.end[0] - segment.start[0] for segment in self.segments]
        return all(run > 0 for run in runs) or all(run < 0 for run in runs)


def in_box(point: Array, box: Box) -> bool:
    """Tell whether a scale pair lies in a box, or on its border within rounding."""
    return all(lo - e <= x <= hi + e for x, (lo, hi), e in zip(point, box, DEFAULT.line * np.abs(point), strict=True))


def is_point(piece: Piece) -> bool:
    """Tell whether a piece is too short for floats to tell its ends apart."""
    size = np.abs(piece.start).sum() + np.abs(piece.end).sum()
    return bool(size < np.inf and np.abs(piece.end - piece.start).sum() <= DEFAULT.point * size)


def clipped(piece: Piece, box: Box) -> tuple[Array, Array] | None:
    """Return the ends of the stretch of a piece inside the box, None if there is none of positive length."""
    limits = np.array(box, dtype=np.float64).ravel()

    def inside(start: Array, end: Array, endless: bool) -> tuple[Array, Array] | None:
        with np.errstate(all="ignore"):
            some, *ends = kernels.clip(start, end, endless, piece.line, limits, DEFAULT.point)
        return (frozen(ends[:2]), frozen(ends[2:])) if some else None

    if np.isfinite(piece.lo) and np.isfinite(piece.hi):
        return inside(piece.start, piece.end, False)
    if np.isfinite(piece.lo):
        return inside(piece.start, piece.travel, True)
    anchor = piece.end if np.isfinite(piece.hi) else piece.base
    before = inside(anchor, -piece.travel, True)
    after = None if np.isfinite(piece.hi) else inside(anchor, piece.travel, True)
    if before and after:
        return before[1], after[1]
    return (before[1], before[0]) if before else after
