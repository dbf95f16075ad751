"""The main path of a study: from its file to its results. Start reading here."""

from __future__ import annotations

import os
import sys
import threading
import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from time import monotonic
from typing import Any, Literal, get_args

from fcdm_opt import pacing
from fcdm_opt.design.study.point import BAD_INPUT, Asked, Row, evaluate, load, row
from fcdm_opt.design.study.processes import Processes, Work
from fcdm_opt.design.study.results import StudyResult
from fcdm_opt.design.study.store import Store
from fcdm_opt.design.study.study import Study, StudyPoint
from fcdm_opt.errors import InputError, known_arguments, known_word
from fcdm_opt.lazy_import import extra
from fcdm_opt.version import __version__

Engine = Literal["joblib", "dask"]
ENGINES = get_args(Engine)
PAUSE = 10.0  # seconds between two lines
SETTLED = 1.0  # seconds after which a rate says something
REFRESH = 4  # times a second that a bar is drawn

Say = Callable[[str], None]

Answers = Callable[[Iterable[Asked]], Generator[Row]]

BACKLOG = 1000  # points met that are kept in memory before they are written


@known_arguments
def run_study(
    study: Study | str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    engine: Engine = "joblib",
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
    check_engine(engine, jobs, scheduler)
    study = study if isinstance(study, Study) else Study.read(study)
    with (
        Store(Path(out), study.key, __version__, study.to_dict()) as store,
        pacing.part_of("solving points"),
        shown(len(study), progress=progress, say=say) as tell,
        workers(engine, jobs, scheduler, limit=study.time_limit) as answers,
    ):
        run = StudyRun(study, store)
        end = pacing.clock() + pacing.remaining()
        with pacing.unlimited(), closing(answers(run.asked())) as rows:  # what is begun is brought to its end
            for answer in rows:
                run.answered(answer)
                tell(run.done, run.made)
                if pacing.clock() >= end:
                    break
        tell(run.done, run.made)  # equal ones among the last, too
    return StudyResult.read(out)


class StudyRun:
    """The way through a study: points are taken from it, in any thread, and it is told what came back.

    Equal points are asked for once, points with a row in the store not at all. `done` points have a row; of `made` this
    run worked it out, of the others an earlier one.
    """

    def __init__(self, study: Study, store: Store) -> None:
        self._study, self._store = study, store
        self.done = self.made = 0
        self._own = set[str]()  # keys of the rows that this run worked out
        self._met: list[tuple[int, str, dict[str, Any]]] = []
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
        self._met.append((point.number, point.key, point.values))
        if len(self._met) >= BACKLOG:
            self._write()
        if point.key in self._waiting:
            self._waiting[point.key] += 1
            return False
        if self._store.has(point.key):
            self.done += 1
            self.made += point.key in self._own
            return False
        self._waiting[point.key] = 1
        if point.question is None:
            self._write(row(point.key, BAD_INPUT, point.error))
        return point.question is not None

    def _write(self, *rows: Row) -> None:
        self._store.write(self._met, rows)
        self._met = []
        made = sum(self._waiting.pop(answer["key"]) for answer in rows)
        self._own.update(answer["key"] for answer in rows)
        self.done += made
        self.made += made


def check_engine(engine: str, jobs: int | None, scheduler: str | None) -> None:
    """Refuse arguments of `run_study` that fit no engine."""
    known_word(engine, ENGINES, "no such engine", key="engine")
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise InputError("not a number of processes", key="jobs", found=jobs, allowed="1, 2, ...")
    if scheduler is not None and engine != "dask":
        raise InputError("only Dask has a scheduler", key="scheduler", found=scheduler, allowed='the engine "dask"')
    if scheduler is not None and not (isinstance(scheduler, str) and scheduler.strip()):
        raise InputError("not an address", key="scheduler", found=scheduler, allowed='"tcp://host:8786"')
    if scheduler is not None and jobs is not None:
        raise InputError("the workers are those of the scheduler", key="jobs", found=jobs, allowed="no number")
    if engine == "dask":
        extra("distributed", "dask", key="engine", found="dask")


@contextmanager
def workers(
    engine: str,
    jobs: int | None,
    scheduler: str | None,
    *,
    limit: float | None,
    work: Work = evaluate,
    loaded: Callable[[], None] = load,
) -> Iterator[Answers]:
    """Start workers, or join them, and end them afterwards; gives what makes rows of points, in any order.

    Points are taken as workers become free, in any thread. `limit` are seconds a point, which take a process of its
    own; `work`, a function of a module, makes a row of a point; `loaded` is what a process does first.
    """
    from joblib import Parallel, cpu_count, delayed

    with ExitStack() as stack:
        answer: Work
        if engine == "dask":
            from fcdm_opt.design.study.cluster import answer_on_worker, joined

            backend: Any = stack.enter_context(joined(scheduler, jobs))
            answer = partial(answer_on_worker, __version__, work, limit)
        else:
            backend, jobs = "threading", jobs or cpu_count()
            processes = stack.enter_context(Processes(loaded))
            answer = work if jobs == 1 and limit is None else partial(processes.answer, work, limit)

        def answers(asked: Iterable[Asked]) -> Generator[Row]:
            # joblib says so where not all rows are taken, as after an error
            warnings.filterwarnings("ignore", message=".* adjusting the input task iterator")
            parallel = Parallel(jobs, backend=backend, return_as="generator_unordered")
            return parallel(delayed(answer)(point) for point in asked)

        yield answers


def pace(total: int, done: int, made: int, seconds: float) -> str:
    """Return in words how many points are `done`, how fast this run `made` its own, and when it will end."""
    before = done - made
    words = [f"{done:,} of {total:,} points" + (f" ({before:,} from before)" if before else "")]
    if made and seconds > SETTLED:
        words.append(f"{made / seconds:.3g} a second")
        if done < total:
            words.append(f"{_duration((total - done) * seconds / made)} left")
    return ", ".join(words)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


@contextmanager
def shown(total: int, *, progress: bool, say: Say | None) -> Iterator[Callable[[int, int], None]]:
    """Show how far a run is: a bar on a terminal; elsewhere a line now and then, and at the end, however that comes.

    Gives what is to be told `done` and `made`, see `pace`. Without `say` lines go to standard error if `progress`,
    else nowhere.
    """
    start = monotonic()
    if progress and sys.stderr is not None and sys.stderr.isatty():
        if pacing.has_listeners():
            yield lambda done, made: pacing.at("", done, total)
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"))
        with Progress(*columns, console=Console(stderr=True), refresh_per_second=REFRESH) as bar:
            task = bar.add_task(pace(total, 0, 0, 0.0), total=total)
            yield lambda done, made: bar.update(
                task, completed=done, description=pace(total, done, made, monotonic() - start)
            )
        return
    if say is None:
        say = partial(print, file=sys.stderr, flush=True) if progress else lambda text: None
    last, known = start, (0, 0)

    def tell(done: int, made: int) -> None:
        nonlocal last, known
        known = done, made
        pacing.at("", done, total)
        if monotonic() - last >= PAUSE:
            last = monotonic()
            say(pace(total, *known, last - start))

    try:
        yield tell
    finally:
        say(pace(total, *known, monotonic() - start))
