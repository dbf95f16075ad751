"""The least motion under linear conditions some of which are alternatives, best first.

A node keeps some alternatives, and its least motion bounds all below it: the first whose least motion leaves no group
of alternatives unmet has the least of all.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from functools import partial
from itertools import count
from typing import NamedTuple

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.stages import compiled
from fcdm_opt.tolerances import DEFAULT

# Nodes that `nearest_on` looks at, times as many as the most alternatives of one of several groups; those of a single
# one are tried the nearest first. And the length beyond which nothing is of interest.
MOST_NODES, MOST_CHOICES, FARTHEST = 2000, 500_000, 1e6
SOON = 200  # nodes: what they do not settle is mostly impossible


class Rows(NamedTuple):
    """Conditions normals . y >= levels on the weighted parameters, all to be met: (m, k), (m,)."""

    normals: Array
    levels: Array

    def and_also(self, normals: Array, levels: Array) -> Rows:
        """Return these conditions and further ones."""
        return Rows(np.concatenate([self.normals, normals]), np.concatenate([self.levels, levels]))

    @property
    def ends(self) -> tuple[Array, Array]:
        """The least and the largest value of each parameter by the conditions on it alone, (k,) each."""
        rows, which = np.nonzero(self.normals)
        single = np.bincount(rows, minlength=len(self.levels))[rows] == 1
        rows, which = rows[single], which[single]
        steep = self.normals[rows, which]
        ends, rises = self.levels[rows] / steep, steep > 0.0
        low, high = np.full((2, self.normals.shape[1]), np.inf) * np.array([[-1.0], [1.0]])
        np.maximum.at(low, which[rises], ends[rises])
        np.minimum.at(high, which[~rises], ends[~rises])
        return low, high

    def about(self, point: Array, directions: Array | None = None) -> Rows:
        """Return the same conditions on what is added to a point, or on y where directions . y, (k, k), is added."""
        normals = self.normals if directions is None else self.normals @ directions
        return Rows(normals, self.levels - self.normals @ point)


class Choices(NamedTuple):
    """Of each of several groups one alternative is to be met: rows of all alternatives of all groups, in order."""

    # `alternatives` are their first rows, `groups` the first alternatives of the groups
    rows: Rows
    alternatives: Ints
    groups: Ints

    @classmethod
    def of(cls, groups: Sequence[Sequence[Rows]], count: int) -> Choices:
        """Return groups of alternatives in `count` parameters; none of them empty."""
        every = [rows for group in groups for rows in group]
        firsts = np.cumsum([0, *(len(rows.levels) for rows in every)])[:-1]
        starts = np.cumsum([0, *map(len, groups)])[:-1]
        rows = Rows(*map(np.concatenate, zip(Rows(np.empty((0, count)), np.empty(0)), *every, strict=True)))
        return cls(rows, firsts.astype(np.int64), starts.astype(np.int64))

    @classmethod
    def of_single_rows(cls, groups: Sequence[Rows], count: int) -> Choices:
        """Return groups in which each row is an alternative by itself."""
        sizes = np.cumsum([0, *(len(rows.levels) for rows in groups)])
        return cls(cls.of([[rows] for rows in groups], count).rows, np.arange(sizes[-1]), sizes[:-1])

    def and_also(self, *others: Choices) -> Choices:
        """Return these groups and those of others."""
        every = (self, *others)
        rows = Rows(*(np.concatenate([own.rows[k] for own in every]) for k in (0, 1)))
        before = np.cumsum([0, *(len(own.rows.levels) for own in every)])
        firsts = np.concatenate([own.alternatives + n for own, n in zip(every, before, strict=False)])
        before = np.cumsum([0, *(len(own.alternatives) for own in every)])
        return Choices(rows, firsts, np.concatenate([own.groups + n for own, n in zip(every, before, strict=False)]))

    def about(self, point: Array, directions: Array) -> Choices:
        """Return the same groups, see `Rows.about`."""
        return self._replace(rows=self.rows.about(point, directions))

    @property
    def group_of_alternatives(self) -> Ints:
        """The group that each alternative is of."""
        return np.repeat(np.arange(len(self.groups)), np.diff(self.groups, append=len(self.alternatives)))

    def only(self, alternatives: Flags, rows: Flags | None = None) -> Choices:
        """Return these alternatives, of them these rows; of what none of is left, nothing."""
        sizes = np.diff(self.alternatives, append=len(self.rows.levels))
        owner = np.repeat(np.arange(len(sizes)), sizes)
        kept = alternatives[owner] if rows is None else rows & alternatives[owner]
        firsts = np.unique(owner[kept], return_index=True)
        groups = np.unique(self.group_of_alternatives[firsts[0]], return_index=True)[1]
        return Choices(Rows(self.rows.normals[kept], self.rows.levels[kept]), firsts[1], groups)

    def of_rows(self, short: Array) -> tuple[Array, Array]:
        """Return by how much each alternative, and each group's best, is missed where `short` tells it of each row."""
        if not len(self.groups):
            return np.empty(0), np.empty(0)
        of_choices = np.maximum.reduceat(short, self.alternatives)
        return of_choices, np.asarray(np.minimum.reduceat(of_choices, self.groups))

    def met(self, y: Array) -> bool:
        """Tell whether y meets an alternative of each group."""
        return bool(self.of_rows(self.rows.levels - self.rows.normals @ y)[1].max(initial=-np.inf) <= 0.0)


class Nearest(NamedTuple):
    """The y nearest to a point, None where there is none, or none was found before the search was left."""

    # `rows` are those that it was sought under; `chosen` are the alternatives kept by group
    y: Array | None
    rows: Rows
    chosen: dict[int, int]
    complete: bool = True


class _Branch:
    """Nodes that add to rows one of further ones, of different ways to meet a group, from alternative `first` on."""

    def __init__(
        self, rows: Rows, further: Rows, centre: Array, chosen: dict[int, int], group: int, first: int
    ) -> None:
        self.rows, self.further, self.chosen, self.group, self.first = rows, further, chosen, group, first
        self.before = Rows(further.normals[:0], further.levels[:0])  # what those returned before leave
        arranged = compiled.arranged(*rows, *further, centre)
        self._arranged, self._done = (*arranged, np.argsort(np.maximum(arranged[3], 0.0), kind="stable")), 0
        self._found, self._lengths = np.empty_like(further.normals), np.full(len(further.levels), np.inf)

    def next(self) -> tuple[float, int, Array] | None:
        """Return length, number and x of the node left whose y = x + centre is the nearest; None without any."""
        k, self._done = compiled.next_nearest(*self._arranged, self._done, self._found, self._lengths)
        if k < 0:
            return None
        length, self._lengths[k] = float(self._lengths[k]), np.inf
        return length, k, self._found[k]


def nearest(
    choices: Choices,
    start: Rows,
    centre: Array,
    *,
    slack: float,
    nodes: int,
    most: float = np.inf,
    rather_few: bool = False,
) -> Nearest:
    """Return the y nearest to `centre` that meets some rows, not none, and one alternative of every group.

    Up to `slack` a group counts as met. The search is left after so many nodes, and only what is nearer than `most`
    is of interest. The group to meet next is the one missed by most, where `rather_few` of the fewest alternatives:
    what is impossible is so after fewer nodes.
    """
    (normals, levels), firsts, groups = choices
    number, heap, lasts = count(), list[tuple[float, int, int, Array, _Branch]](), [*groups[1:].tolist(), len(firsts)]
    single = np.diff(firsts, append=len(levels)) == 1
    kept = np.full(len(groups), -1)  # the alternative of each group, -1 where any will do

    def push(branch: _Branch) -> None:
        """Add the nearest node of a branch that is left."""
        if (found := branch.next()) is not None and found[0] < most:
            heapq.heappush(heap, (found[0], next(number), *found[1:], branch))

    rows, further = Rows(start.normals[1:], start.levels[1:]), Rows(start.normals[:1], start.levels[:1])
    push(_Branch(rows, further, centre, {}, -1, 0))
    for _ in range(nodes):
        if not heap or pacing.over():
            break
        _, _, k, x, branch = heapq.heappop(heap)
        y, chosen = x + centre, branch.chosen
        if branch.group >= 0:
            chosen = {**chosen, branch.group: branch.first + k}
        normal, level = branch.further.normals[k : k + 1], branch.further.levels[k : k + 1]
        rows = branch.rows.and_also(normal, level).and_also(*branch.before)
        if branch.group >= 0 and branch.group not in branch.chosen and single[branch.first + k]:
            branch.before = branch.before.and_also(-normal, -level)
        for own, alternative in chosen.items():
            kept[own] = alternative
        group, missed = compiled.group_to_meet(normals, levels, firsts, groups, kept, y, slack, rather_few)
        if missed <= slack:
            return Nearest(y, rows, chosen)
        first, last = (chosen[group], chosen[group] + 1) if group in chosen else (int(groups[group]), lasts[group])
        places = compiled.furthest_rows(normals, levels, firsts, first, last, y)
        for own in chosen:
            kept[own] = -1
        push(branch)
        push(_Branch(rows, Rows(normals[places], levels[places]), centre, chosen, group, first))
    return Nearest(None, Rows(normals[:0], levels[:0]), {}, not heap)


def nearest_on(slopes: Array, levels: Array, limits: Rows, choices: Choices) -> tuple[Array | None, bool]:
    """Return the least z with slopes . z = levels, within limits, that meets an alternative of each group.

    None where there is none: the equations disagree, or nothing of what they leave meets the rest; and whether that is
    so, or the search was left.
    """
    centre = np.asarray(np.linalg.lstsq(slopes, levels, rcond=DEFAULT.nominal)[0], dtype=np.float64)
    if np.abs(slopes @ centre - levels).max(initial=0.0) > DEFAULT.touch:
        return None, True
    _, sizes, vectors = np.linalg.svd(slopes)
    free = vectors[int((sizes > DEFAULT.nominal * sizes.max(initial=0.0)).sum()) :]  # rows span the null space
    start, flat = _across(limits, centre, free)
    if (start.levels[flat] > DEFAULT.touch).any():
        return None, True
    start = Rows(start.normals[~flat], start.levels[~flat])
    beyond = bool((start.levels > 0.0).any())
    if not (len(choices.groups) or beyond):
        return centre, True
    remaining = _seen(choices, limits, centre, free)
    if remaining is None:
        return None, True
    if not len(free) or not (len(remaining.groups) or beyond):
        return centre, True
    start = start.and_also(-np.eye(1, len(free)), np.array([-FARTHEST]))
    sizes = np.diff(remaining.groups, append=len(remaining.alternatives))
    nodes = min(MOST_NODES, MOST_CHOICES // int(sizes.max())) if len(sizes) > 1 else MOST_NODES
    asked = partial(nearest, remaining, start, np.zeros(len(free)), slack=DEFAULT.cut, most=FARTHEST)
    for few, tried in ((False, min(SOON, nodes)), (True, nodes)):
        least = asked(nodes=tried, rather_few=few)
        if least.complete:
            break
    return (None, least.complete) if least.y is None else (centre + least.y @ free, True)


def _seen(choices: Choices, limits: Rows, centre: Array, free: Array) -> Choices | None:
    """Return choices over z as choices over the null space, without what always holds; None where one never does."""
    # by all z that limits of one parameter each leave, too
    rows, flat = _across(choices.rows, centre, free)
    normals, levels = choices.rows
    low, high = limits.ends
    rises, flat_in = normals > 0.0, normals == 0.0
    ends = (np.where(flat_in, 0.0, np.where(rises, *own)) for own in ((low, high), (high, low)))
    least, most = ((normals * own).sum(axis=1) for own in ends)
    missed = (flat & (rows.levels > DEFAULT.touch)) | (most < levels - DEFAULT.touch)
    open_rows = ~flat & (least < levels)
    # of alternatives whether one never holds, and whether one always does
    (never, never_all), (held, _) = (choices.of_rows(own.astype(np.float64)) for own in (missed, open_rows | missed))
    if (never_all > 0.0).any():
        return None
    group = choices.group_of_alternatives
    always = np.unique(group[(never == 0.0) & (held == 0.0)])
    return choices._replace(rows=rows).only((never == 0.0) & ~np.isin(group, always), open_rows)


def _across(rows: Rows, centre: Array, free: Array) -> tuple[Rows, Flags]:
    """Return rows over z as rows over the null space, and which of them no move in it changes."""
    normals = rows.normals @ free.T
    return Rows(normals, rows.about(centre).levels), np.asarray(np.linalg.norm(normals, axis=1) <= DEFAULT.nominal)
