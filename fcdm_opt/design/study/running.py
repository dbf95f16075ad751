"""The main path of a study: from its file to its results. Start reading here."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

from fcdm_opt.design.study.engines import check_engine, workers
from fcdm_opt.design.study.point import BAD_INPUT, Asked, Row, row
from fcdm_opt.design.study.progress import Say, shown
from fcdm_opt.design.study.results import StudyResult
from fcdm_opt.design.study.store import Belonging, Met, Store
from fcdm_opt.design.study.study import Study, StudyPoint

BACKLOG = 1000  # points met that are kept in memory before they are written


def run_study(
    study: Study | str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    engine: str = "joblib",
    jobs: int | None = None,
    scheduler: str | None = None,
    progress: bool = False,
    say: Say | None = None,
) -> StudyResult:
    """Solve and verify every point of a study, or those that an earlier run into the same folder has not.

    The rows are the same whatever the engine, the number of processes and the order, times apart. A run may be killed
    at any moment: what is stored is not worked out again.

    Parameters
    ----------
    study : Study or path
        A study, or its file.
    out : path
        Folder of the store; made where it does not exist.
    engine : "joblib" or "dask"
        Processes of this machine, or workers of a Dask scheduler.
    jobs : int, optional
        How many processes; default: one a core. With 1 "joblib" stays in this process, unless points have a time limit.
    scheduler : str, optional
        Address of a Dask scheduler; default: a cluster on this machine.
    progress : bool
        Show a bar where standard error is a terminal, lines elsewhere.
    say : callable, optional
        Takes these lines.

    Raises
    ------
    InputError
        For a study, folder, store or engine that cannot be used; what is stored by then stays.
    """
    study = study if isinstance(study, Study) else Study.read(study)
    check_engine(engine, jobs, scheduler)
    with (
        Store(Path(out), Belonging(study.key, study.version, study.to_dict())) as store,
        shown(len(study), progress=progress, say=say) as tell,
        workers(engine, jobs, scheduler, limit=study.time_limit) as answers,
    ):
        run = StudyRun(study, store)
        with closing(answers(run.asked())) as rows:
            for answer in rows:
                run.answered(answer)
                tell(run.done, run.made)
    return StudyResult.read(out)


class StudyRun:
    """The way through a study: points are taken from it, in any thread, and it is told what came back.

    Equal points are asked for once, points with a row in the store not at all.

    Parameters
    ----------
    study : Study
    store : Store
        Where rows go.

    Attributes
    ----------
    done : int
        Points of the study that have a row.
    made : int
        Those of them that this run worked out.
    """

    def __init__(self, study: Study, store: Store) -> None:
        self._study, self._store = study, store
        self.done = self.made = 0
        self._met: list[Met] = []
        self._waiting: dict[str, int] = {}  # keys without a row yet, and how many points have them
        self._lock = threading.Lock()

    def asked(self) -> Iterator[Asked]:
        """Yield all points without a row."""
        for point in self._study.points():
            with self._lock:
                wanted = self._meet(point)
            if wanted and point.question is not None:
                question = point.question
                yield point.key, question.scene.text, question.case, self._study.certify, self._study.effort
        with self._lock:
            self._write()

    def answered(self, answer: Row) -> None:
        """Take the row of a point that was asked for."""
        with self._lock:
            self._write(answer)

    def _meet(self, point: StudyPoint) -> bool:
        """Take note of a point; tell whether it is to be worked out."""
        self._met.append(Met(point.number, point.key, point.values))
        if len(self._met) >= BACKLOG:
            self._write()
        if point.key in self._waiting:
            self._waiting[point.key] += 1
            return False
        if self._store.has(point.key):
            self.done += 1
            return False
        self._waiting[point.key] = 1
        if point.question is None:
            self._write(row(point.key, BAD_INPUT, point.error))
        return point.question is not None

    def _write(self, *rows: Row) -> None:
        self._store.write(self._met, rows)
        self._met = []
        made = sum(self._waiting.pop(own["key"]) for own in rows)
        self.done += made
        self.made += made
