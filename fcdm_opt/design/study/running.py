"""The main path of a study: from its file to its results. Start reading here."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from fcdm_opt.design.study.engines import Engine, LocalEngine, OwnProcess
from fcdm_opt.design.study.plan import Plan
from fcdm_opt.design.study.progress import Say, shown
from fcdm_opt.design.study.store import Belonging, Store
from fcdm_opt.errors import InputError

if TYPE_CHECKING:
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.design.study.study import Study


def run_study(
    study: Study | str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    engine: str | Engine = "joblib",
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
    engine : "joblib", "dask" or Engine
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
    from fcdm_opt.design.study.results import StudyResult
    from fcdm_opt.design.study.study import Study

    study = study if isinstance(study, Study) else Study.read(study)
    chosen_engine = chosen(engine, jobs, scheduler, time_limit=study.time_limit)
    with (
        Store(Path(out), Belonging(study.key, study.version, study.to_dict())) as store,
        shown(len(study), progress=progress, say=say) as tell,
        chosen_engine as workers,
    ):
        plan = Plan(study, store, lambda: workers.workers)
        for again, chunks in ((False, plan.chunks), (True, plan.lost)):
            for payload, rows in workers.run(chunks()):
                plan.answered(payload, rows, last=again)
                tell(plan.done, plan.made)
    return StudyResult.read(out)


def chosen(engine: str | Engine, jobs: int | None, scheduler: str | None, *, time_limit: float | None) -> Engine:
    """Return the engine that arguments of `run_study` ask for; with one job and no time limit this process."""
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise InputError("not a number of processes", key="jobs", found=jobs, allowed="1, 2, ...")
    if engine == "dask":
        from fcdm_opt.design.study.dask_engine import DaskEngine

        return DaskEngine(scheduler, jobs=jobs)
    if scheduler is not None:
        raise InputError("only Dask has a scheduler", key="scheduler", found=scheduler, allowed='engine = "dask"')
    if engine == "joblib":
        from joblib import cpu_count

        count = jobs or cpu_count()
        return LocalEngine(count) if count > 1 or time_limit is not None else OwnProcess()
    if isinstance(engine, str) or not hasattr(engine, "run"):
        raise InputError("no such engine", key="engine", found=engine, allowed='"joblib", "dask" or an engine')
    return engine
