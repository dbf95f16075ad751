"""Which points of a study are still to be worked out, in chunks whose size follows what points cost."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from fcdm_opt.design.study.point import BAD_INPUT, WORKER_LOST, Payload, Row, row
from fcdm_opt.design.study.store import Met, Store

if TYPE_CHECKING:
    from fcdm_opt.design.study.study import Point, Study

CHUNK = 0.2
"""Seconds of work a chunk: little is lost in a kill, and a hundred times what sending and storing it takes."""

LEAST = 0.02
"""Seconds of work below which chunks do not shrink near the end."""

SHARE = 2.0
"""A chunk is at most this share of what a worker has left to do, so that all end together."""

GROWTH = 4
"""A chunk has at most this many times the points of the largest one that came back."""

RECENT = 8  # chunks that the cost of a point is measured over
BACKLOG = 1000  # points met that are kept in memory before they are written


class Plan:
    """The way through a study: chunks are taken from it, and it is told what came back.

    Equal points are asked for once, points with a row in the store not at all.

    Parameters
    ----------
    study : Study
    store : Store
        Where rows go.
    workers : callable
        Gives the number of workers.

    Attributes
    ----------
    done : int
        Points of the study that have a row.
    made : int
        Those of them that this run worked out.
    """

    def __init__(self, study: Study, store: Store, workers: Callable[[], int]) -> None:
        self._study, self._store, self._workers = study, store, workers
        self._total = len(study)
        self._seen = self.done = self.made = 0
        self._met: list[Met] = []
        self._waiting: dict[str, int] = {}  # keys without a row yet, and how many points have them
        self._lost: list[Payload] = []
        self._costs: deque[tuple[float, int]] = deque(maxlen=RECENT)
        self._largest = 0

    def chunks(self) -> Iterator[Payload]:
        """Yield all points without a row, in chunks."""
        batch: list[Point] = []
        for point in self._study.points():
            if self._meet(point):
                batch.append(point)
                if len(batch) >= self._size():
                    yield self._payload(batch)
                    batch = []
        if batch:
            yield self._payload(batch)
        self._write([])

    def lost(self) -> Iterator[Payload]:
        """Yield the points of all chunks that were lost, one by one."""
        asked, self._lost = self._lost, []
        for payload in asked:
            yield from ({**payload, "points": [point]} for point in payload["points"])

    def answered(self, payload: Payload, rows: list[Row] | None, *, last: bool) -> None:
        """Take what came back of a chunk.

        Parameters
        ----------
        payload : dict
        rows : list of dict or None
            None where its worker was lost: its points will be asked for again.
        last : bool
            Whether they have been already: then each becomes a row that says so.
        """
        if rows is None and not last:
            self._lost.append(payload)
            return
        if rows is None:
            limit = payload["time_limit"]
            reasons = "a crash, or no memory left" + (f", or more than {limit:g} s" if limit else "")
            message = f"The process that worked on it ended, twice: {reasons}."
            rows = [row(key, WORKER_LOST, message) for key, *_ in payload["points"]]
        else:
            self._costs.append((sum(own["seconds"]["point"] for own in rows), len(rows)))
            self._largest = max(self._largest, len(rows))
        self._write(rows)

    def _meet(self, point: Point) -> bool:
        """Take note of a point; tell whether it is to be worked out."""
        self._seen += 1
        self._met.append(Met(point.number, point.key, point.values))
        if len(self._met) >= BACKLOG:
            self._write([])
        if point.key in self._waiting:
            self._waiting[point.key] += 1
            return False
        if self._store.has(point.key):
            self.done += 1
            return False
        self._waiting[point.key] = 1
        if point.question is None:
            self._write([row(point.key, BAD_INPUT, point.error)])
            return False
        return True

    def _write(self, rows: list[Row]) -> None:
        self._store.write(self._met, rows)
        self._met = []
        made = sum(self._waiting.pop(own["key"]) for own in rows)
        self.done += made
        self.made += made

    def _size(self) -> float:
        """Return how many points the next chunk should have."""
        if not self._costs:
            return 1
        seconds, points = map(sum, zip(*self._costs, strict=True))
        a_second = points / max(seconds, 1e-9)
        left = (self._total - self._seen) / (SHARE * max(self._workers(), 1))
        return min(CHUNK * a_second, max(LEAST * a_second, left), GROWTH * self._largest)

    def _payload(self, batch: list[Point]) -> Payload:
        scenes: dict[str, str] = {}
        points: list[list[Any]] = []
        for point in batch:
            assert point.question is not None
            scene = point.question.scene
            scenes[scene.key] = scene.text
            points.append([point.key, scene.key, point.question.case])
        return {
            "certify": self._study.certify,
            "effort": self._study.effort,
            "time_limit": self._study.time_limit,
            "scenes": scenes,
            "points": points,
        }
