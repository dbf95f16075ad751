"""What a proof rests on: excluded cells of motions, each with its reason, as plain data that can be checked apart.

Motions are q = y / weights in weighted coordinates y = s v: v on a face of the cube [-1, 1]^k, numbered 2 axis (+1) and
2 axis + 1 (-1) for v_axis = +-1, its other coordinates in a box; s > 0. A *cell* is a box of directions and a stretch
of s. A *column* is a box of directions all of whose motions below its front are excluded; no motion of a closed one is
left at all.
"""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import IntEnum
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.plain import Plain

WITNESS = 16  # numbers of a witness row


class Reason(IntEnum):
    """Why no motion of a cell will do, and what its witness rows hold.

    SHORT: the tracked contact is not where the goal wants it. Row: for "beyond" the scale (0, 1) that falls short, or,
    whatever the sign of the lines' determinant D, 2: D (rho - rho_t) has not the signs asked for, nor their opposites;
    3: D rho has two different signs. Else the line (0, 1, ...; tracked, then besides) that does not pass through the
    target pair.
    LOOSE: a vertex reaches beyond the plane of a tracked feature. Row: feature, body (1, 2), vertex in its part.
    LEFT: a direction keeps the tracked part pair apart at the tracked scales. Row: the direction.
    APART: every part pair of body 1 and body 2 is apart at the target scales. Rows: a direction for each, part by part.
    MEETS: two parts overlap. Row: part of body 1, obstacle, body (1, 2), the vertex of its part at which an edge begins
    that stays inside the other part at a point, the point's place along it at the cell's centre, and slopes of that in
    the cell's variables s and box coordinates, each scaled to [-1, 1]; last, 1 more than the vertex at which it ends:
    0 where it is named by its number in the hull, as earlier versions did. Or with 3 for the body, then 0 and a point
    that moves with body 1, in its axes at the target scale about its moved seed.
    OUTSIDE: a parameter is beyond a limit. Row: the parameter.
    NEAR: a point of body 1 stays nearer to a point of an obstacle than the clearance asked for. Row: part of body 1,
    obstacle, the one point about the moved seed in the axes of body 1 at the target scale, the other about s_2.
    COSTLY: the amount, which is not the weighted one, is at least the bound. Row: empty.
    BEYOND: so it is of all motions further out in the same directions.

    A direction: kind (0: face of body 1, 1: face of body 2, 2: two edges), sign, three vectors and the part pair; the
    vectors are the unit normal in the axes of the face's body, from body 1 to body 2 (for edges the direction of that
    of body 1, then of body 2: n = sign (R e_1) x e_2), and a point of each part about its body's seed.
    """

    OPEN = 0
    SHORT = 1
    LOOSE = 2
    LEFT = 3
    APART = 4
    MEETS = 5
    OUTSIDE = 6
    COSTLY = 7
    NEAR = 8
    BEYOND = 9


def least_lengths(low: Array, high: Array) -> Array:
    """Return the least length of v in boxes of directions, given by their ends, (n, k - 1) each."""
    least = np.maximum(np.maximum(low, -high), 0.0)
    return np.asarray(np.sqrt(1.0 + (least * least).sum(axis=1)))


class ProofData:
    """Base of what a bound rests on: plain data made of arrays, whose `text` says in words what it is."""

    text: str

    def to_dict(self) -> dict[str, Any]:
        """Return plain data: every array packed as text, see `from_dict`."""
        return {name: _packed(value) for name, value in vars(self).items()}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Any:
        """Rebuild from `to_dict`, of either kind; raises `InputError`."""
        try:
            kind: Any = (Multipliers if "motions" in data else Evidence) if cls is ProofData else cls
            return kind(**{item.name: _unpacked(data[item.name]) for item in fields(kind)})
        except (KeyError, TypeError, ValueError, zlib.error) as reason:
            raise InputError("not the plain data of a proof", key="evidence", found=str(reason)) from reason


@dataclass(frozen=True, eq=False, kw_only=True)
class Multipliers(ProofData):
    """Boxes of motions, each with a motion at which multipliers of contacts bound the amount all over it.

    With F the equations of contacts that are restored, and l what balances y at a motion, y = J' l: whatever
    closes the contacts has |y|^2 / 2 = |y|^2 / 2 - l . F(y), which over the box is no less than its derivatives at the
    motion, and bounds of the second ones, say. What excludes a box are multipliers of equations that disagree there.
    So do, of goals "touch" and "clear", what keeps the bodies apart, or one inside the other. They are not kept: any
    do, and the checker finds them anew, see `fcdm_opt.judge.multipliers`.

    Attributes
    ----------
    boxes : (n, 2, k) array
        Lower and upper ends of weighted parameters y; together they fill a box.
    motions : (n, k) array
        y at which a box is looked at; it may lie outside.
    """

    boxes: Array
    motions: Array

    @property
    def text(self) -> str:  # type: ignore[override]
        """What it is made of, in words."""
        count = len(self.boxes)
        return f"multipliers of contacts in {count} box{'es' if count != 1 else ''} of motions"


@dataclass(frozen=True, eq=False, kw_only=True)
class Evidence(ProofData):
    """Excluded cells and what they leave.

    Attributes
    ----------
    limits : (k, 2) array
        Limits of the parameters: the problem's, or narrower where further motions repeat others (turns beyond half a
        revolution) or lead out of reach, for goals that ask for poses alone.
    faces : (n,) ints
        Face of the cube of each cell.
    boxes : (n, 2, k - 1) array
        Lower and upper ends of its directions.
    stretches : (n, 2) array
        Its s.
    reasons : (n,) ints
        See `Reason`.
    first : (n + 1,) ints
        Where its witness rows begin.
    witnesses : (w, 16) array
    column_faces, column_boxes : (c,) ints, (c, 2, k - 1) array
        The columns, which fill all directions.
    fronts : (c,) array
        s below which everything in a column is excluded; infinite where it is closed.
    """

    limits: Array
    faces: Ints
    boxes: Array
    stretches: Array
    reasons: Ints
    first: Ints
    witnesses: Array
    column_faces: Ints
    column_boxes: Array
    fronts: Array

    @property
    def bound(self) -> float:
        """Amount below which no motion is left, by the fronts; infinite where all columns are closed."""
        return float((self.fronts * least_lengths(*self.column_boxes.swapaxes(0, 1))).min(initial=np.inf))

    @property
    def text(self) -> str:  # type: ignore[override]
        """What it is made of, in words."""
        return f"{len(self.reasons)} cells of motions that will not do, in {len(self.fronts)} columns of directions"


@dataclass(frozen=True)
class SharedBound(Plain):
    """What is claimed of contacts that share motions: none of a smaller amount restores them.

    The judge proves it anew, see `fcdm_opt.proof.uniqueness`.

    Attributes
    ----------
    contacts : tuple of (name, name)
        Of which two parts each is.
    bound : float
        Of the weighted amount of the motions that they depend on.
    """

    contacts: tuple[tuple[str, str], ...]
    bound: float


def _packed(values: Array | Ints) -> dict[str, Any]:
    kind = "int64" if np.issubdtype(values.dtype, np.integer) else "float64"
    raw = zlib.compress(np.ascontiguousarray(values, dtype=f"<{'i8' if kind == 'int64' else 'f8'}").tobytes(), 9)
    return {"type": kind, "shape": list(values.shape), "zlib_base64": base64.b64encode(raw).decode("ascii")}


def _unpacked(data: Mapping[str, Any]) -> Any:
    raw = zlib.decompress(base64.b64decode(data["zlib_base64"], validate=True))
    kind = {"int64": "<i8", "float64": "<f8"}[data["type"]]
    values = np.frombuffer(raw, dtype=kind).astype(data["type"]).reshape(data["shape"])
    values.flags.writeable = False
    return values
