"""How the least amount changes with the data, as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.plain import Plain


@dataclass(frozen=True, eq=False, kw_only=True)
class Sensitivity(Plain):
    """First derivatives of the least amount.

    Each is by one datum, all others as they are. Seeds and `length` count as data of their own: with a rule such as
    "centroid" a vertex that moves takes the seed along, which is not in the derivative by the vertex. A nominal
    switching point moves with the geometry, and with it the target pair that a requirement makes of it; a nominal pair
    given as numbers stays, and so does an explicit target.

    Attributes
    ----------
    exists : bool
        Whether the amount is differentiable there; where it is not, the values hold on one side, or of one of several
        equally small motions, and those that differ are nan.
    reasons : tuple of str
        Why it is not.
    target : (2,) array
        By the scales made, per unit of scale.
    tolerance : (2, 2) array or None
        By each relative tolerance, one row a body, minus and plus; 0 where the requirement does not use it, None
        without a requirement.
    nominal : (2,) array
        By the nominal scales, through the target pair that a requirement makes of them.
    limits : dict
        Parameter name -> (by its lower, by its upper limit), amount per unit of the parameter.
    clearance : float
        By the clearance, amount per length.
    keep_out : dict
        Name -> by that keep-out's clearance.
    weights : dict
        Parameter name -> by its weight.
    length : float
        By the length that turns radians into lengths.
    faces : dict
        Label such as "P1V1,V3,V4,V6" -> by the outward shift of the face's plane, amount per length; nan where the
        shift would part a vertex of more than three faces that matters. Keep-outs: "keep-out 'name' V1,V2,V3".
    vertices : dict
        Label such as "P1V6" -> (3,) array by the vertex, world frame as drawn; nan where its move would break a face
        of more than three corners, or a flush contact, that matters: see `faces` for these.
    seeds : dict
        "P1", "P2" -> (3,) array, world frame as drawn.
    multipliers : dict
        Constraint -> multiplier, amount per unit of the constraint.
    residual : float
        Share of the amount's gradient that the constraints leave unbalanced.
    """

    exists: bool
    reasons: tuple[str, ...]
    target: Array
    tolerance: Array | None
    nominal: Array
    limits: Mapping[str, tuple[float, float]]
    clearance: float
    keep_out: Mapping[str, float]
    weights: Mapping[str, float]
    length: float
    faces: Mapping[str, float]
    vertices: Mapping[str, Array]
    seeds: Mapping[str, Array]
    multipliers: Mapping[str, float]
    residual: float
