"""How two parts lie as drawn: apart, touching or overlapping, and which contacts are near that."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from fcdm_opt.curve.decision_curve import DEFAULT_BOX, DecisionCurve, decision_curve
from fcdm_opt.curve.segments import Box, Segment, SwitchingPoint
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.tolerances import DEFAULT

DRAWN = (1.0, 1.0)
WIDE: Box = ((0.02, 50.0), (0.02, 50.0))
"""Scales at which a contact is looked for where the usual box has none."""


class Near(NamedTuple):
    """A scale pair at which the parts touch, and what touches there."""

    pair: Array
    contact: Segment | SwitchingPoint

    @property
    def features(self) -> str:
        """Labels of what touches."""
        own = (self.contact.feature,) if isinstance(self.contact, Segment) else self.contact.features
        return " and ".join(feature.label for feature in own)


@dataclass(frozen=True, eq=False)
class Situation:
    """Where two parts are as drawn.

    Attributes
    ----------
    movable, static : Body
    """

    movable: Body
    static: Body

    @cached_property
    def size(self) -> float:
        """Length that relative tolerances refer to."""
        return max(self.movable.size, self.static.size)

    @cached_property
    def gap(self) -> float:
        """Distance where the parts are apart; minus how deep they overlap, of unions at their deepest pair of parts."""
        gap = float(self._usual.gap(DRAWN))
        return float(self._usual.distance(DRAWN)) if gap > 0 else gap

    @cached_property
    def state(self) -> str:
        """Return "touching" where a nominal contact as drawn would be taken for one, else "apart", "overlapping"."""
        if self._usual.locate(DRAWN) is not None or abs(self.gap) <= DEFAULT.snap * self.size:
            return "touching"
        return "apart" if self.gap > 0 else "overlapping"

    @cached_property
    def growth(self) -> float:
        """Common scale of both parts, that nearest to 1, at which they touch (growth distance); nan without one."""
        for curve in (self._usual, self._wide):
            found = [scale for segment in curve.segments for scale in _on_diagonal(segment)]
            if found:
                return min(found, key=lambda scale: abs(scale - 1.0))
        return float("nan")

    @cached_property
    def box(self) -> Box:
        """Scales that a file about these parts should show: the usual ones where a contact is in them."""
        if self.state == "touching" or self._usual.segments:
            return DEFAULT_BOX
        pair = self._wide.nearest(DRAWN)
        if not np.isfinite(pair).all():
            return DEFAULT_BOX
        ends = [(_rounded(0.5 * min(1.0, scale)), _rounded(2.0 * max(1.0, scale))) for scale in pair.tolist()]
        return ends[0], ends[1]

    @cached_property
    def curve(self) -> DecisionCurve:
        """The decision curve in `box`."""
        return self._usual if self.box == DEFAULT_BOX else replace(self._usual, box=self.box)

    @cached_property
    def nearest(self) -> Near | None:
        """The contact whose scale pair is nearest to the parts as drawn."""
        return self._near(self.curve.nearest(DRAWN))

    @cached_property
    def grown(self) -> Near | None:
        """The contact that both parts meet in when they are made larger or smaller alike."""
        return self._near(np.array([self.growth, self.growth]))

    @cached_property
    def normal(self) -> Array:
        """Unit direction in which the parts meet, from the movable part to the static one."""
        for near in (self.nearest, self.grown):
            if near is not None:
                own = near.contact.normal if isinstance(near.contact, Segment) else near.contact.pieces[0].normal
                return np.array(own)
        offset = self.static.seed - self.movable.seed
        length = float(np.linalg.norm(offset))
        return offset / length if length > DEFAULT.seeds * self.size else np.array([0.0, 0.0, 1.0])

    def switching_points(self, most: int) -> list[SwitchingPoint]:
        """Return the switching points in `box` that are nearest to the parts as drawn, by number."""
        listed = sorted(self.curve.switching_points, key=lambda own: float(np.abs(np.log(own.rho)).max()))
        return sorted(listed[:most], key=lambda own: own.index)

    def _near(self, pair: Array) -> Near | None:
        if not np.isfinite(pair).all() or pair.min() <= 0:
            return None
        contact = self.curve.locate(pair)
        return None if contact is None else Near(pair, contact)

    @cached_property
    def _usual(self) -> DecisionCurve:
        return decision_curve(self.movable, self.static)

    @cached_property
    def _wide(self) -> DecisionCurve:
        return replace(self._usual, box=WIDE)


def _on_diagonal(segment: Segment) -> list[float]:
    """Return the scale at which a segment meets rho_1 = rho_2, if it does."""
    a, b, c = segment.line.tolist()
    if abs(a + b) <= DEFAULT.tie * (abs(a) + abs(b)):
        return []
    scale = c / (a + b)
    pair = np.array([scale, scale])
    off = float(np.abs(segment.nearest(pair) - pair).max())
    return [scale] if scale > 0 and off <= DEFAULT.nominal * scale else []


def _rounded(scale: float) -> float:
    """Return a scale with two digits: a border of what is shown need not be finer."""
    return float(f"{scale:.2g}")
