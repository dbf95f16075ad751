"""Branch and bound: how small a motion can be at all, and what shows it.

Motions are looked at in weighted coordinates y = weights * q, direction by direction: y = s v, v on a face of the cube
[-1, 1]^k, s > 0. A *column* is a box of directions; its *front* is how far out, from rest, every motion in it is known
not to do. Columns advance by *cells*, stretches of s for which one reason excludes all motions (see `Reason`), are
split where no stretch can be excluded, and are closed for good where the tracked contact is lost, as every motion
further out passes there. The least front is the bound.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from fcdm_opt import pacing
from fcdm_opt.geometry.arrays import Array, Flags, Ints
from fcdm_opt.model.task import Task
from fcdm_opt.problem.amounts import OwnAmount
from fcdm_opt.problem.evidence import WITNESS, Evidence, Reason, least_lengths
from fcdm_opt.proof.exclusion import Exclusion
from fcdm_opt.proof.mean_value import Pieces
from fcdm_opt.tolerances import DEFAULT

REACHES = (4.0, 1.0, 0.25, 0.0625)  # stretches tried at once, in the stride that a column goes by
BATCH = 256  # columns advanced at once, at most
FARTHEST = 10.0  # sizes: see `farthest`
ACROSS = 2.0  # a column this much wider than its last stretch is split
FIRST = {1: 1, 2: 4, 3: 2}  # parts of each range of directions to begin with; 1 for more parameters
STALLED = 1e-8  # stretch, relative to the front: shorter ones are not tried
TURNS, ENDS = 3, 8  # runs, while a search from the least columns at the end of one finds better motions; so many
SLOW, CALLS = 1e-3, 12  # stretch at which a column that holds the bound back is searched, and searches at most


@dataclass(eq=False)
class Columns:
    """Boxes of directions with their fronts."""

    faces: Ints
    low: Array
    high: Array
    front: Array
    stride: Array
    closed: Flags
    stalled: Flags

    @classmethod
    def all(cls, count: int, stride: float) -> Columns:
        """Return columns that hold every direction in `count` parameters."""
        parts = FIRST.get(count, 1)
        ends = np.linspace(-1.0, 1.0, parts + 1)
        boxes = list(product(range(2 * count), *(range(parts) for _ in range(count - 1))))
        faces = np.array([box[0] for box in boxes])
        places = np.array([box[1:] for box in boxes], dtype=np.int64).reshape(len(boxes), count - 1)
        n = len(boxes)
        return cls(
            faces, ends[places], ends[places + 1], np.zeros(n), np.full(n, stride), *np.zeros((2, n), dtype=bool)
        )

    def split(self, rows: Ints, place: Ints) -> None:
        """Halve columns across a direction each."""
        middle = (self.low[rows, place] + self.high[rows, place]) / 2.0
        for name in ("faces", "low", "high", "front", "stride", "closed", "stalled"):
            own = getattr(self, name)
            setattr(self, name, np.concatenate([own, own[rows]]))
        new = np.arange(len(self.faces) - len(rows), len(self.faces))
        self.high[rows, place] = middle
        self.low[new, place] = middle

    def cells(self, rows: Ints, ends: Array) -> Pieces:
        """Return the cells from the fronts of some columns on."""
        boxes, stretches = np.stack([self.low, self.high], axis=1)[rows], np.column_stack([self.front[rows], ends])
        return Pieces.of(self.faces[rows], boxes, stretches)

    @property
    def bounds(self) -> Array:
        """Amount that no motion of each column stays below; infinite where it is closed."""
        return np.where(self.closed, np.inf, self.front * least_lengths(self.low, self.high))


@dataclass(eq=False)
class Record:
    """The excluded cells, collected on the way: faces, ends, reasons, how many witness rows each has, and these."""

    cells: list[tuple[Any, ...]] = field(default_factory=list)
    open: list[float] = field(default_factory=list)  # amounts of cells that were passed, not excluded

    def add(self, cells: Pieces, rows: Ints, codes: Ints, witness: Array) -> None:
        """Keep some of the cells, with as many witness rows as their reason has."""
        kept, codes, witness = cells[rows], codes[rows], witness[rows]
        used = np.where(codes == Reason.APART, witness.shape[1], 1)
        rows_used = np.arange(witness.shape[1]) < used[:, None]
        self.cells.append((kept.faces, kept.low, kept.high, codes, used, witness[rows_used]))

    def evidence(self, columns: Columns, domain: Array) -> Evidence:
        """Return what was collected, and what it leaves."""
        none, ends = np.empty(0, np.int64), np.empty((0, 1 + columns.low.shape[1]))
        every = *self.cells, (none, ends, ends, none, none, np.empty((0, WITNESS)))
        faces, low, high, reasons, counts, witnesses = (np.concatenate(own) for own in zip(*every, strict=True))
        return Evidence(
            limits=domain,
            faces=faces,
            boxes=np.stack([low[:, 1:], high[:, 1:]], axis=1),
            stretches=np.column_stack([low[:, 0], high[:, 0]]),
            reasons=reasons,
            first=np.append(0, np.cumsum(counts)),
            witnesses=witnesses,
            column_faces=columns.faces,
            column_boxes=np.stack([columns.low, columns.high], axis=1),
            fronts=np.where(columns.closed, np.inf, columns.front),
        )


@dataclass(frozen=True, eq=False)
class Proof:
    """What branch and bound found."""

    lower_bound: float  # no motion of an amount below it does, and none at all where that is infinite
    q: Array | None  # one better than that known before, if one came up
    evidence: Evidence


def farthest(task: Task) -> float:
    """Return the amount up to which motions are looked at where none is known to do, whatever their weights."""
    usual = task.motion.weights(task.size / 2.0)
    return FARTHEST * task.size * max(1.0, float((task.weights / usual).max()))


def prove(
    task: Task,
    upper: float,
    *,
    aims: Sequence[tuple[float, int]],
    search: Callable[[Array], Array | None] | None = None,
    checked: bool = True,
) -> Proof:
    """Bound the amount of every motion that does what a task asks.

    `upper` is the amount of a motion that is known to do; infinite if none is. `aims` are relative gaps between the
    bound and `upper` that are enough, the finest first, each while no more than so many cells have been tested.
    `search` takes a motion q near which nothing can be excluded, and returns one there that does, if it finds one.
    `checked`: whether the evidence is to be what its checker knows; else clearances are proved by swollen parts.
    """
    search_ = _Search(task, upper, search)
    scene, record = Exclusion(task, upper, swollen=not checked), Record()
    columns = Columns.all(len(task.weights), search_.enough(aims[0][0]) / 16.0)
    for _ in range(TURNS):
        looked = 0
        for gap, most in aims:
            while looked < most and not pacing.over():
                enough = search_.enough(gap)
                bounds = np.where(columns.stalled, np.inf, columns.bounds)
                waiting = np.flatnonzero(bounds < (enough if task.weighted else farthest(task)))
                if not len(waiting):
                    break
                rows = waiting[np.argsort(bounds[waiting], kind="stable")[:BATCH]]
                looked += _advance(scene, columns, record, rows, enough)
                if pacing.has_listeners():
                    found = f"{search_.upper:.4g}" if np.isfinite(search_.upper) else "none yet"
                    pacing.at(f"proving: at least {bounds.min():.4g}, found {found}")
                search_.improve(columns)
        closed = columns.bounds.min() >= search_.enough(aims[-1][0])
        if closed or pacing.over() or not search_.ahead(columns):
            break
    if not np.isfinite(search_.upper):
        _close_beyond(scene, columns, record)
    bound = min(float(columns.bounds.min()), *([] if task.weighted else [search_.enough(gap), *record.open]), np.inf)
    if isinstance(task.amount_kind, OwnAmount) and not columns.closed.all():
        bound = 0.0  # it may be less further out
    return Proof(bound, search_.q, record.evidence(columns, scene.domain))


@dataclass(eq=False)
class _Search:
    """The best motion known, and searches for a better one where the bound is held back."""

    task: Task
    upper: float
    search: Callable[[Array], Array | None] | None
    q: Array | None = None
    calls: int = 0
    tried: float = np.inf

    def enough(self, gap: float) -> float:
        return (1.0 - gap) * self.upper if np.isfinite(self.upper) else farthest(self.task)

    def improve(self, columns: Columns) -> None:
        """Search from where the least column stands, if it hardly moves any more."""
        if self.search is None or self.calls >= CALLS:
            return
        bounds = columns.bounds
        row = int(bounds.argmin())
        slow = columns.stride[row] < SLOW * columns.front[row]
        if not slow or not bounds[row] < self.upper or columns.stride[row] > 0.1 * self.tried:
            return
        self.calls, self.tried = self.calls + 1, columns.stride[row]
        if self._better(columns, row):
            self.tried = np.inf

    def ahead(self, columns: Columns) -> bool:
        """Search from where the least columns of all stand; tell whether that found something better."""
        bounds = columns.bounds
        rows = np.argsort(bounds, kind="stable")[:ENDS]
        found = [self._better(columns, int(row)) for row in rows if bounds[row] < self.upper]
        return any(found)

    def _better(self, columns: Columns, row: int) -> bool:
        """Search from where a column stands; keep what is better than the best motion known, and tell whether it is."""
        at = np.array([row])
        y = columns.cells(at, columns.front[at] + columns.stride[at]).coordinates(over=False)
        q = np.array([own.middle[0] for own in y]) / self.task.weights
        found = None if self.search is None else self.search(q)
        if found is None or not self.task.amount(found) < self.upper:
            return False
        self.q, self.upper = found, self.task.amount(found)
        return True


def _close_beyond(scene: Exclusion, columns: Columns, record: Record) -> None:
    """Close the columns whose fronts have passed the limits: the stretch beyond may be one for which nothing does."""
    rows = np.flatnonzero(~columns.closed & (columns.front > 0.0))
    if not len(rows):
        return
    cells = columns.cells(rows, 2.0 * columns.front[rows])
    codes, witness = scene.reasons(cells)
    closing = np.flatnonzero(scene.closes[codes])
    record.add(cells, closing, codes, witness)
    columns.closed[rows[closing]] = True


def _advance(scene: Exclusion, columns: Columns, record: Record, rows: Ints, enough: float) -> int:
    """Move the fronts of some columns outwards, or split them, or try shorter stretches next; count the cells."""
    tries, front = len(REACHES), columns.front[rows]
    last = np.full(len(rows), np.inf)
    if scene.task.weighted:
        lengths = least_lengths(columns.low[rows], columns.high[rows])
        last = np.maximum(enough / lengths * (1.0 + DEFAULT.line), front)
    strides = np.minimum(columns.stride[rows], last - front)
    ends = np.minimum(front[:, None] + strides[:, None] * np.array(REACHES), last[:, None])
    cells = columns.cells(np.repeat(rows, tries), ends.ravel())
    codes, witness = scene.reasons(cells, enough, tries)
    closing = scene.closes[codes].reshape(len(rows), tries)
    excluded = (codes != Reason.OPEN).reshape(len(rows), tries)
    closed, some = closing.any(axis=1), excluded.any(axis=1)
    # a shorter stretch may close a column that a longer one only moves on
    best = np.where(closed, closing.argmax(axis=1), excluded.argmax(axis=1))
    kept = np.flatnonzero(some)
    record.add(cells, kept * tries + best[kept], codes, witness)
    reached = np.where(some, ends[np.arange(len(rows)), best], front)
    step = np.where(some, reached - front, strides * REACHES[-1] / 2.0)
    stalled = ~closed & (step < STALLED * np.maximum(front, STALLED * enough))
    if scene.task.weighted:
        columns.stalled[rows[stalled]] = True
    elif stalled.any():  # the amount may be less further out: such a cell is left open, and passed
        passed = columns.cells(rows[stalled], front[stalled] + strides[stalled])
        record.open += scene.amounts(passed, scene.poses(passed)).tolist()
        every, codes = np.arange(len(passed.faces)), np.full(len(passed.faces), int(Reason.COSTLY))
        record.add(passed, every, codes, np.zeros((len(every), 1, WITNESS)))
        reached[stalled] += strides[stalled]
        step[stalled] = strides[stalled]
    columns.closed[rows[closed]] = True
    columns.front[rows], columns.stride[rows] = reached, 2.0 * step
    widths = columns.high[rows] - columns.low[rows]
    if widths.shape[1]:
        widest = widths.argmax(axis=1)
        across = (reached + step) * widths[np.arange(len(rows)), widest]
        wide = ~closed & ~stalled & (across > ACROSS * step)
        columns.stride[rows[wide]] = np.maximum(columns.stride[rows[wide]], across[wide] / 2.0)
        columns.split(rows[wide], widest[wide])
    return len(codes)
