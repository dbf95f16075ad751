"""Where points are worked out: joblib hands them out, to threads that have a process each, or to Dask's workers."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from typing import Any

from fcdm_opt.design.study.point import Asked, Row, evaluate, load
from fcdm_opt.design.study.processes import Processes, Work
from fcdm_opt.errors import InputError

ENGINES = ("joblib", "dask")

Answers = Callable[[Iterable[Asked]], Generator[Row]]


def check_engine(engine: str, jobs: int | None, scheduler: str | None) -> None:
    """Refuse arguments of `run_study` that fit no engine."""
    if engine not in ENGINES:
        raise InputError("no such engine", key="engine", found=engine, allowed='"joblib" or "dask"')
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise InputError("not a number of processes", key="jobs", found=jobs, allowed="1, 2, ...")
    if scheduler is not None and engine != "dask":
        raise InputError("only Dask has a scheduler", key="scheduler", found=scheduler, allowed='engine = "dask"')
    if scheduler is not None and not (isinstance(scheduler, str) and scheduler.strip()):
        raise InputError("not an address", key="scheduler", found=scheduler, allowed='"tcp://host:8786"')
    if scheduler is not None and jobs is not None:
        raise InputError("the workers are those of the scheduler", key="jobs", found=jobs, allowed="no number")
    if engine == "dask":
        try:
            import distributed  # noqa: F401
        except ImportError as reason:
            what = f"Dask cannot be loaded ({reason}); install it with pip install 'fcdm_opt[dask]'"
            raise InputError(what, key="engine", found="dask") from reason


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
    """Start workers, or join them, and end them afterwards.

    Parameters
    ----------
    engine, jobs, scheduler
        As of `run_study`, checked.
    limit : float or None
        Seconds a point, which take a process of its own.
    work : callable
        Row from a point; a function of a module.
    loaded : callable
        What a process does first.

    Yields
    ------
    callable
        Gives the rows of points, in any order. Points are taken as workers become free, in any thread.
    """
    from joblib import Parallel, cpu_count, delayed

    with ExitStack() as stack:
        answer: Work
        if engine == "dask":
            from fcdm_opt.design.study.cluster import answer_on_worker, joined
            from fcdm_opt.version import __version__

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
            rows: Generator[Row] = parallel(delayed(answer)(point) for point in asked)
            return rows

        yield answers
