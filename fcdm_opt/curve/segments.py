"""What a decision curve is listed as: segments, switching points and branches, and what a box leaves of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import Contact
from fcdm_opt.curve.envelope import Run
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import Piece
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.tolerances import DEFAULT

Box = tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Segment:
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

    feature: Feature
    line: Array
    normal: Array
    start: Array
    end: Array
    parts: tuple[int, int]
    snug: bool
    index: int
    run: Run

    @property
    def configuration(self) -> str:
        """Which of the seven contact configurations it is, see `Contact.configuration`."""
        return self.run.whole.contact.configuration

    def piece_at(self, rho: Array) -> Piece:
        """Return the piece of the part pair that touches at a scale pair of the segment."""
        return self.run.at(rho)


@dataclass(frozen=True, eq=False)
class SwitchingPoint:
    """Where two segments meet.

    Attributes
    ----------
    rho : (2,) array
    features : tuple of two Feature
        Of the segments before and after it.
    lines : (2, 3) array
        Their contact lines.
    pieces : tuple of two Piece
        Their unclipped pieces.
    touching : tuple of Contact
        What touches there: one contact (for instance V1E2) where the two segments' merge, or two at once.
    contact_sets : tuple of (k, 3) arrays
        What the bodies share in each contact: a point, a segment's ends or a polygon's corners, world frame.
    index : int
        1-based number in the box; 0 outside it.
    """

    rho: Array
    features: tuple[Feature, Feature]
    lines: Array
    pieces: tuple[Piece, Piece]
    touching: tuple[Contact, ...]
    contact_sets: tuple[Array, ...]
    index: int

    @property
    def contact_features(self) -> tuple[Feature, ...]:
        """One feature (for instance V1E2) where the two contacts merge, or both where they are two at once."""
        return tuple(contact.feature for contact in self.touching)

    @property
    def contacts(self) -> Array:
        """Contact points, one a contact, (k, 3), world frame."""
        return frozen([own.mean(axis=0) for own in self.contact_sets])

    @property
    def configurations(self) -> tuple[str, ...]:
        """Which of the seven contact configurations each contact is, see `Contact.configuration`."""
        return tuple(contact.configuration for contact in self.touching)

    @property
    def kind(self) -> str:
        """For instance "V1E2", or "V1F2 & V1F2" for two contacts at once."""
        return " & ".join(feature.kind for feature in self.contact_features)

    @property
    def label(self) -> str:
        """The contact features' labels."""
        return " & ".join(feature.label for feature in self.contact_features)


@dataclass(frozen=True, eq=False)
class Branch:
    """A connected chain of the curve inside the box.

    Attributes
    ----------
    segments : tuple of Segment
    """

    segments: tuple[Segment, ...]

    @property
    def is_function(self) -> bool:
        """Whether rho_2 is a function of rho_1 along it."""
        runs = [segment.end[0] - segment.start[0] for segment in self.segments]
        return all(run > 0 for run in runs) or all(run < 0 for run in runs)


def in_box(point: Array, box: Box) -> bool:
    """Tell whether a scale pair lies in a box, or on its border within rounding."""
    slack = DEFAULT.line * np.abs(point)
    return all(lo - e <= x <= hi + e for x, (lo, hi), e in zip(point, box, slack, strict=True))


def is_point(piece: Piece) -> bool:
    """Tell whether a piece is too short for floats to tell its ends apart."""
    size = np.abs(piece.start).sum() + np.abs(piece.end).sum()
    return bool(size < np.inf and np.abs(piece.end - piece.start).sum() <= DEFAULT.point * size)


def clipped(piece: Piece, box: Box) -> tuple[Array, Array] | None:
    """Return the ends of the stretch of a piece inside the box, None if there is none of positive length."""
    limits = np.array(box, dtype=np.float64).ravel()

    def left(start: Array, end: Array, endless: bool) -> tuple[Array, Array] | None:
        some, *ends = kernels.clip(start, end, endless, piece.line, limits, DEFAULT.point)
        return (frozen(ends[:2]), frozen(ends[2:])) if some else None

    if np.isfinite(piece.lo) and np.isfinite(piece.hi):
        return left(piece.start, piece.end, False)
    if np.isfinite(piece.lo):
        return left(piece.start, piece.travel, True)
    anchor = piece.end if np.isfinite(piece.hi) else piece.base
    before = left(anchor, -piece.travel, True)
    after = None if np.isfinite(piece.hi) else left(anchor, piece.travel, True)
    if before and after:
        return before[1], after[1]
    return (before[1], before[0]) if before else after
