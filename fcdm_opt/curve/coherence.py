"""Whether a claimed contact is the real one: what separates the parts, what else overlaps, what sticks out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from fcdm_opt.curve import kernels
from fcdm_opt.curve.contact import near_pairs
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.tolerances import DEFAULT


@dataclass(frozen=True, eq=False)
class Tracked:
    """A feature of the tracked contact at some pose."""

    parts: tuple[int, int]  # parts, site: part pair, and facet of the Minkowski difference
    site: tuple[int, int, int]
    normal: Array  # normal, line: (3,): unit direction from body 1 to body 2; (a, b, c)
    line: Array

    @classmethod
    def at(
        cls, movable: Body, static: Body, pose: Array, parts: tuple[int, int], site: tuple[int, int, int], sign: float
    ) -> Tracked:
        """Return the feature at a pose; `sign` orients an edge pair's normal as it was at the nominal contact."""
        one, two = movable.parts[parts[0]], static.parts[parts[1]]
        row = kernels.tracked_row(*one.packed, *two.packed, pose, np.array(site), sign)
        return cls(parts, site, row[:3], row[3:])


class Fault(NamedTuple):
    """One reason why a claimed contact is not real.

    "apart": `site` of the part pair separates it; "overlapping": the part pair overlaps although `site` is its best
    separating direction; "unsupported": `vertex` of `body` reaches beyond the plane of the tracked feature `site`.
    The excess is a length.
    """

    kind: Literal["apart", "overlapping", "unsupported"]
    parts: tuple[int, int]
    site: tuple[int, int, int]
    normal: Array
    excess: float
    body: int = 0
    vertex: int = -1

    @property
    def key(self) -> tuple[object, ...]:
        """What identifies the fault, whatever its size."""
        return (self.kind, self.parts, self.site, self.body, self.vertex)

    def kept(self, pair: str) -> str:
        """Return what motions without the fault keep, in words; `pair` names its part pair."""
        if self.kind == "unsupported":
            return f"a vertex of body {self.body}, part {self.parts[self.body - 1] + 1}, behind the tracked feature"
        return f"{pair} stays {'apart' if self.kind == 'overlapping' else 'in contact'} on the way"


def contact_faults(
    movable: Body, static: Body, pose: Array, rho: Array, tracked: Sequence[Tracked], slack: float
) -> list[Fault]:
    """Return why the tracked features are not the real contact at a scale pair, worst first; empty if they are.

    A contact that has moved over a seam into another part pair, on the same plane, is still the same contact.

    The features are those at this pose, (12,), see `kernels`; the scale pair, (2,), is on their lines. `slack` is a
    length below which nothing is a fault.
    """
    faults = [fault for feature in tracked for fault in _unsupported(movable, static, pose, rho, feature, slack)]
    touching = {feature.parts for feature in tracked}
    apart: list[Fault] = []
    flat: list[Array] = []  # directions in which other part pairs touch
    for (i, j), sites, rows, separations in near_pairs(movable, static, pose, rho, slack, touching):
        best = int(np.argmax(separations))
        widest = float(separations[best])
        kind, i_site, j_site = (int(x) for x in sites[best])
        if (i, j) not in touching:
            if not -widest <= slack:
                faults.append(Fault("overlapping", (i, j), (kind, i_site, j_site), rows[best, :3], -widest))
            elif widest <= slack:
                flat += list(rows[separations >= -slack, :3])
        elif not widest <= slack:
            apart.append(Fault("apart", (i, j), (kind, i_site, j_site), rows[best, :3], widest))
    for fault in apart:
        own = [feature.normal for feature in tracked if feature.parts == fault.parts]
        if not all(any(n @ other > 1.0 - DEFAULT.nominal for other in flat) for n in own):
            faults.append(fault)
    return sorted(faults, key=lambda fault: -fault.excess)


def overlaps_between(
    movable: Body,
    static: Body,
    ends: tuple[tuple[Array, Array], tuple[Array, Array]],
    touching: set[tuple[int, int]],
    slack: float,
) -> list[float] | None:
    """Return where on the way of a shift parts overlap that are not said to touch, from its end back.

    `ends`, a relative pose and scale pair each, are those at positions 0 and 1; between them both change in proportion,
    and nothing turns. `touching` are the part pairs that touch at both; `slack` is a length by which parts may overlap.

    Positions from 1 to 0, one within each stretch of overlap; None where a touching pair is apart at an end.
    """
    (start, before), (pose, rho) = ends
    shift, growth = pose[9:] - start[9:], rho - before
    radii = [np.linalg.norm(body.vertices - body.seed, axis=1).max() for body in (movable, static)]
    near = slack + np.linalg.norm(shift) + np.abs(growth) @ radii
    found = []
    bounds = kernels.pair_bounds(*movable.packed, *static.packed, start, before)
    for i, j in sorted(touching.union(map(tuple, np.argwhere(bounds <= near).tolist()))):
        rows = kernels.facet_rows(*movable.parts[i].packed, *static.parts[j].packed, start)[1]
        first = rows[:, 5] - rows[:, 3:5] @ before
        slopes = rows[:, :3] @ shift - rows[:, 3:5] @ growth
        if (i, j) in touching:
            if max(first.max(), (first + slopes).max()) > slack:
                return None
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            crossed = -(first + slack) / slopes
        low = crossed[slopes < 0].max(initial=0.0)
        high = crossed[slopes > 0].min(initial=1.0)
        if low < high and (first[slopes == 0] < -slack).all():
            found.append(float(low + high) / 2.0)
    return sorted(found, reverse=True)


def _unsupported(movable: Body, static: Body, pose: Array, rho: Array, feature: Tracked, slack: float) -> list[Fault]:
    faults = []
    for body, heights in enumerate(heights_beyond(movable, static, pose, rho, feature), 1):
        vertex = int(np.argmax(heights))
        excess = float(heights[vertex])
        if not excess <= slack:
            faults.append(Fault("unsupported", feature.parts, feature.site, feature.normal, excess, body, vertex))
    return faults


def heights_beyond(movable: Body, static: Body, pose: Array, rho: Array, feature: Tracked) -> Iterator[Array]:
    """Yield how far the vertices of either part of a tracked feature reach beyond its plane at a scale pair, (n,)."""
    n, parts = feature.normal, (movable.parts[feature.parts[0]], static.parts[feature.parts[1]])
    for part, out, level, scale in zip(parts, (n @ pose[:9].reshape(3, 3), -n), feature.line, rho, strict=False):
        yield ((part.vertices - part.seed) @ out - level) * scale
