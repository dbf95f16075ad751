"""Dask as joblib's backend: the workers of a scheduler that runs elsewhere, or of one in this process."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from importlib.metadata import version
from tempfile import TemporaryDirectory
from typing import Any

import dask
from distributed import Client, KilledWorker, LocalCluster, get_worker, rpc
from joblib import cpu_count
from joblib._dask import DaskDistributedBackend

from fcdm_opt.design.study.point import Asked, Row
from fcdm_opt.design.study.processes import Processes, Work
from fcdm_opt.errors import InputError
from fcdm_opt.version import __version__

CONNECT, PATIENCE = 5.0, 60.0  # seconds: for a scheduler to be reached; for workers to join where there is none
ADDRESS = "the address of a running Dask scheduler, such as tcp://host:8786"

LOGGERS = ("distributed", "tornado")
"""Whose log lines (a worker lost, a connection closed) say on the terminal what the rows say already."""

_processes = Processes()  # of a worker: they end when there is nothing to do


def answer_on_worker(version: str, work: Work, limit: float | None, asked: Asked) -> Row:
    """Return the row of a point, on a worker; `version` is that of who asks."""
    if __version__ != version:
        raise _other_version(get_worker().address, __version__, version)
    return _processes.answer(work, limit, asked)


@contextmanager
def joined(scheduler: str | None, jobs: int | None) -> Iterator[DaskDistributedBackend]:
    """Give a backend for joblib, of the scheduler at an address, or of a cluster of this process that ends afterwards.

    Refuses a scheduler that does not answer, has no workers, or is lost meanwhile, and workers of another version.
    """
    with ExitStack() as stack:
        stack.enter_context(_quiet())
        address = scheduler or stack.enter_context(own_cluster(jobs))
        client = stack.enter_context(_connected(address))
        backend = _Backend(client=client, wait_for_workers_timeout=PATIENCE)
        try:
            backend.effective_n_jobs(-1)
        except TimeoutError as reason:
            what = f"no worker joined within {PATIENCE:g} s"
            raise InputError(what, key="scheduler", found=address, allowed="a scheduler with workers") from reason
        # A function of the standard library: a worker without fcdm_opt could not load one of ours. Workers that join
        # later are asked with each point.
        for worker, there in client.run(version, "fcdm_opt", on_error="return").items():
            if there != __version__ and not isinstance(there, OSError):  # of a worker that was lost meanwhile
                raise _other_version(worker, "none" if isinstance(there, Exception) else there, __version__)
        try:
            yield backend
        except CancelledError as reason:
            what = "the scheduler went away or dropped the work; what is finished is stored: run again to go on"
            raise InputError(what, key="scheduler", found=address) from reason
        except KilledWorker as reason:
            what = "workers were lost again and again with the same points, perhaps for want of memory"
            raise InputError(f"{what}; what is finished is stored", key="scheduler", found=address) from reason


class _Backend(DaskDistributedBackend):
    """joblib's, which would wait for ever for a task that Dask gives up, and work itself where there is one worker."""

    def effective_n_jobs(self, n_jobs: int) -> int:
        return max(2, super().effective_n_jobs(n_jobs))

    def submit(self, func: Any, callback: Callable[[Any], None] | None = None) -> Any:
        job = super().submit(func, callback)
        if callback is not None:
            job.add_done_callback(lambda done: callback(done.exception()) if done.exception() else None)
        return job


def _other_version(worker: str, found: str, wanted: str) -> InputError:
    what = "a worker has another version of fcdm_opt"
    return InputError(what, key=f"worker {worker}", found=found, allowed=f"version {wanted}")


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's log lines, and its advice on large tasks, off the terminal."""
    known = [name for name in logging.root.manager.loggerDict if name.split(".")[0] in LOGGERS]
    loggers = [logging.getLogger(name) for name in {*known, *LOGGERS}]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        with dask.config.set({"distributed.admin.large-graph-warning-threshold": "1 TB"}):
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def own_cluster(jobs: int | None) -> Iterator[str]:
    """Start a scheduler and a worker in this process, whose threads have a process each; gives the address."""
    global _processes
    # Dask leaves files of its own beside where it runs; these go with the cluster.
    with (
        TemporaryDirectory(prefix="fcdm_opt-dask-", ignore_cleanup_errors=True) as scratch,
        LocalCluster(
            n_workers=1,
            threads_per_worker=jobs or cpu_count(),
            processes=False,
            protocol="tcp://",
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # None would be Dask's usual port, which others may have
            memory_limit=0,
            silence_logs=logging.CRITICAL + 1,
            local_directory=scratch,
            scheduler_kwargs={"dashboard": False},
        ) as cluster,
    ):
        try:
            yield cluster.scheduler_address
        finally:
            _processes.close()  # else Dask would wait for what they do
            _processes = Processes()


@contextmanager
def _connected(address: str) -> Iterator[Client]:

    async def knock() -> None:
        async with rpc(address, timeout=CONNECT) as there:
            kind = (await there.identity())["type"]
        if kind != "Scheduler":
            raise ValueError(f"a {kind} does")

    try:
        # A client that finds nobody keeps trying, and complains. In a thread, as notebooks have a loop of their own.
        with ThreadPoolExecutor(1) as thread:
            thread.submit(asyncio.run, asyncio.wait_for(knock(), CONNECT)).result()
        client = Client(address, timeout=CONNECT, set_as_default=False, name="fcdm_opt")
    except Exception as reason:  # whatever else listens there may answer anything
        what = f"no Dask scheduler answers there ({str(reason) or type(reason).__name__})"
        raise InputError(what, key="scheduler", found=address, allowed=ADDRESS) from reason
    try:
        yield client
    finally:
        with suppress(Exception):  # a scheduler that is gone cannot be told goodbye
            client.close(timeout=CONNECT)
