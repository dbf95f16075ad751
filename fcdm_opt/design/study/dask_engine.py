"""Chunks of a study on the workers of a Dask scheduler: one that runs elsewhere, or one started here for the study."""

from __future__ import annotations

import asyncio
import logging
import os
import pickle
import signal
import threading
import time
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from functools import cache
from itertools import islice
from queue import Empty, SimpleQueue
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any, NamedTuple, Self

from fcdm_opt.design.study.engines import SINGLE, Work
from fcdm_opt.design.study.point import Outcome, Payload, Row, evaluate, load
from fcdm_opt.errors import InputError

CONNECT, ANSWER, PATIENCE, WATCH = 5.0, 10.0, 60.0, 0.5
"""Seconds: for a scheduler or worker to be reached; for one that was reached to answer; for workers to join where there
is none; between two looks at who is there."""

FOREVER = "52 weeks"

DEEP = 2  # chunks that a worker has at a time: one that is worked out, one that waits for it

LOGGERS = ("distributed", "tornado")
"""Whose log lines (a worker lost, a connection closed) say on the terminal what the rows say already."""

ADDRESS = "the address of a running Dask scheduler, such as tcp://host:8786"


class _Flight(NamedTuple):
    """A chunk that a worker has: its future on the cluster, and its rows where they arrive here."""

    payload: Payload
    future: Any
    landing: Future[list[Row] | None]


def _room(flights: list[_Flight], payload: Payload) -> bool:
    """Tell whether a worker with these chunks may have another one."""
    return not flights or (len(flights) < DEEP and all(len(own["points"]) > 1 for own in (flights[0].payload, payload)))


class DaskEngine:
    """Works out chunks on the workers of a Dask scheduler.

    The engine says which worker has which chunk, one of which is worked out at a time, whatever the number of threads;
    a second one waits there, so that no worker waits for messages. Where a worker is lost, the first one is reported
    and the other one goes elsewhere. As the first one may have been finished just then, points that are asked for alone
    are alone on their worker: they are never blamed for what another one did.

    Parameters
    ----------
    scheduler : str, optional
        Address of a scheduler, such as "tcp://host:8786". Without it an own cluster of processes on this machine is
        started, and ended on leaving.
    jobs : int, optional
        Processes of an own cluster; default: one a core.
    work : callable, optional
        Rows from a payload; a function of a module, which workers import.

    Attributes
    ----------
    address : str
        Of the scheduler, once entered: others may join it.

    Raises
    ------
    InputError
        Where Dask is not installed; on entering, where the scheduler does not answer or has no workers, or a worker has
        another version of fcdm_opt.
    """

    def __init__(self, scheduler: str | None = None, *, jobs: int | None = None, work: Work | None = None) -> None:
        if scheduler is not None and not (isinstance(scheduler, str) and scheduler.strip()):
            raise InputError("not an address", key="scheduler", found=scheduler, allowed=ADDRESS)
        if scheduler is not None and jobs is not None:
            raise InputError("the workers are those of the scheduler", key="jobs", found=jobs, allowed="no number")
        if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
            raise InputError("not a number of processes", key="jobs", found=jobs, allowed="1, 2, ...")
        _import_dask()
        self._scheduler, self._jobs, self._work = scheduler, jobs, work or _load_and_evaluate
        self._known: tuple[str, ...] = ()

    def __enter__(self) -> Self:
        from fcdm_opt import __version__

        self._version = __version__
        with ExitStack() as stack:
            stack.enter_context(_quiet())
            self.address = self._scheduler or stack.enter_context(_own_cluster(self._jobs))
            self._client = stack.enter_context(_connected(self.address))
            self._workers()
            self._check_versions()
            self._open = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, reason: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.__exit__(kind, reason, trace)

    @property
    def workers(self) -> int:
        """How many workers there were when last asked, which is at each chunk."""
        return len(self._known)

    def run(self, chunks: Iterable[Payload]) -> Iterator[Outcome]:
        """Yield each chunk with its rows, see `Engine`; workers that join meanwhile get chunks too.

        Raises
        ------
        InputError
            Where the scheduler or all workers are gone for good, or a worker has another version.
        """
        source = iter(chunks)
        waiting: deque[Payload] = deque()
        under_way: dict[str, list[_Flight]] = {}  # by the worker's address, in the order they were given to it
        landed: SimpleQueue[None] = SimpleQueue()
        try:
            while True:
                for worker in self._workers() * DEEP:  # each gets one before any gets a second one
                    flights = under_way.setdefault(worker, [])
                    if not waiting:
                        waiting.extend(islice(source, 1))
                    if waiting and _room(flights, waiting[0]):
                        flights.append(self._submit(waiting.popleft(), worker, landed))
                if not any(under_way.values()):
                    return
                with suppress(Empty):
                    landed.get(timeout=WATCH)
                there = self._addresses()
                for worker in list(under_way):
                    flights = under_way[worker]
                    while flights and (flights[0].landing.done() or worker not in there):
                        flight = flights.pop(0)
                        rows = self._landed(flight)
                        if rows is None:
                            self._drop(flight, *flights)
                            waiting.extendleft(other.payload for other in flights)  # had only waited there
                            flights.clear()
                        yield flight.payload, rows
                    if not flights:
                        del under_way[worker]
        finally:
            self._drop(*(flight for flights in under_way.values() for flight in flights))

    def _submit(self, payload: Payload, worker: str, landed: SimpleQueue[None]) -> _Flight:
        """Give a worker a chunk; `landed` is told when it is done."""
        future = self._client.submit(
            _solve_chunk,
            self._work,
            pickle.dumps(payload),  # opaque, as Dask walks through plain data in search of its own keys
            self._version,
            pure=False,
            workers=[worker],
            allow_other_workers=False,
        )
        landing = asyncio.run_coroutine_threadsafe(self._rows(future), self._client.loop.asyncio_loop)
        landing.add_done_callback(lambda _: landed.put(None))
        return _Flight(payload, future, landing)

    async def _rows(self, future: Any) -> list[Row] | None:
        """Wait for the rows of a chunk (on the client's own loop); None where its worker was lost."""
        from distributed import KilledWorker

        try:
            rows: list[Row] = pickle.loads(await self._client.gather(future, asynchronous=True))
        except KilledWorker:
            return None
        return rows

    def _landed(self, flight: _Flight) -> list[Row] | None:
        """Return the rows of a chunk that ended, None where its worker was lost."""
        if not flight.landing.done():
            return None
        try:
            return flight.landing.result()
        except (CancelledError, OSError) as reason:
            raise self._gone() from reason

    def _drop(self, *flights: _Flight) -> None:
        with suppress(Exception):  # a scheduler that is gone has nothing to cancel
            self._client.cancel([flight.future for flight in flights], callback_timeout=ANSWER)

    def _addresses(self) -> tuple[str, ...]:
        """Addresses of the workers that the scheduler has now."""
        if self._client.status != "running":
            raise self._gone()
        try:
            self._known = tuple(self._client.nthreads(callback_timeout=ANSWER))
        except (OSError, RuntimeError, ValueError) as reason:
            raise self._gone() from reason
        return self._known

    def _workers(self) -> tuple[str, ...]:
        """Addresses of the workers, waiting for one where there is none."""
        end = time.monotonic() + PATIENCE
        while not (found := self._addresses()):
            if time.monotonic() > end:
                raise InputError(
                    f"no worker joined within {PATIENCE:g} s; what is finished is stored",
                    key="scheduler",
                    found=self.address,
                    allowed="a scheduler with workers",
                )
            time.sleep(WATCH)
        return found

    def _check_versions(self) -> None:
        """Ask every worker for its version; those that join later are asked with each chunk."""
        from importlib.metadata import version

        # A function of the standard library: a worker without fcdm_opt could not load one of ours.
        found = self._client.run(version, "fcdm_opt", on_error="return")
        for worker, own in found.items():
            if isinstance(own, OSError):
                continue  # lost meanwhile
            if own != self._version:
                raise _other_version(worker, "none" if isinstance(own, Exception) else own, self._version)

    def _gone(self) -> InputError:
        return InputError(
            "the scheduler went away or dropped the work; what is finished is stored: run again to go on",
            key="scheduler",
            found=self.address,
        )


# ---------------------------------------------------------------------------------------------------------- on a worker

_one_at_a_time = threading.Lock()


def _solve_chunk(work: Work, data: bytes, version: str) -> bytes:
    """Work out a chunk: rows from a payload, both pickled."""
    from fcdm_opt import __version__

    if __version__ != version:
        from distributed import get_worker

        raise _other_version(get_worker().address, __version__, version)
    with _one_at_a_time:  # compiled functions keep their work space: no two threads may solve in one process
        return pickle.dumps(work(pickle.loads(data)))


def _load_and_evaluate(payload: Payload) -> list[Row]:
    _load(payload["time_limit"] is not None)
    return evaluate(payload)


_load = cache(load)  # once a process


def dask_setup(_: Any) -> None:
    """Make a process of an own cluster quiet, and leave keyboard interrupts to its parent; Dask's own name."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    null = os.open(os.devnull, os.O_RDWR)
    for stream in (0, 1, 2):
        os.dup2(null, stream)
    os.close(null)


def _other_version(worker: str, found: str, wanted: str) -> InputError:
    return InputError(
        "a worker has another version of fcdm_opt", key=f"worker {worker}", found=found, allowed=f"version {wanted}"
    )


# ----------------------------------------------------------------------------------------------- schedulers and clients


def _import_dask() -> None:
    """Import Dask, or say what to install."""
    try:
        import distributed  # noqa: F401
    except ImportError as reason:
        raise InputError(
            f"Dask cannot be loaded ({reason}); install it with pip install 'fcdm_opt[dask]'",
            key="engine",
            found="dask",
        ) from reason


@contextmanager
def _quiet() -> Iterator[None]:
    """Keep Dask's log lines, and its advice on large tasks, off the terminal."""
    import dask

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
def _own_cluster(jobs: int | None) -> Iterator[str]:
    """Start a scheduler and single-threaded workers as processes; gives the address."""
    import dask
    from distributed import LocalCluster
    from joblib import cpu_count

    settings = {
        "distributed.deploy.lost-worker-timeout": FOREVER,  # else one that is just being restarted is given up
        "distributed.comm.timeouts.connect": CONNECT,  # this long a lost worker is asked for rows that it had finished
    }
    # Dask leaves files of its own beside where it runs; these go with the cluster.
    with TemporaryDirectory(prefix="fcdm_opt-dask-", ignore_cleanup_errors=True) as scratch, dask.config.set(settings):
        try:
            cluster = LocalCluster(
                n_workers=jobs or cpu_count(),
                threads_per_worker=1,
                processes=True,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",  # None would be Dask's usual port, which others may have
                memory_limit=0,
                silence_logs=logging.CRITICAL + 1,
                local_directory=scratch,
                env=SINGLE,
                preload=[__name__],
                scheduler_kwargs={"allowed_failures": 0, "dashboard": False},
            )
        except (RuntimeError, OSError) as reason:
            raise InputError(
                f"the processes of a local cluster do not start ({reason}); in a script, run studies below "
                "'if __name__ == \"__main__\":', as each process loads the script",
                key="engine",
                found="dask",
            ) from reason
        with cluster:
            yield cluster.scheduler_address


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    """Connect to a scheduler; gives the client."""
    from distributed import Client, rpc

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
        raise InputError(
            f"no Dask scheduler answers there ({str(reason) or type(reason).__name__})",
            key="scheduler",
            found=address,
            allowed=ADDRESS,
        ) from reason
    try:
        yield client
    finally:
        with suppress(Exception):  # a scheduler that is gone cannot be told goodbye
            client.close(timeout=CONNECT)
