"""Studies on a Dask cluster: the same rows as here, whatever dies; clear errors where there is none, and no noise."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from dask_work import dying_at, dying_once, killing_the_worker
from fragile import children, fragile, nothing

from fcdm_opt.design.study import cluster as clusters
from fcdm_opt.design.study.point import Asked
from fcdm_opt.design.study.processes import Processes
from fcdm_opt.design.study.results import StudyResult
from fcdm_opt.design.study.running import check_engine, run_study, workers
from fcdm_opt.design.study.study import Study
from fcdm_opt.errors import InputError

PROBLEMS = Path(__file__).parents[2] / "problems"


@contextmanager
def made(workers: int, *, processes: bool, **options: Any) -> Iterator[Any]:
    """A cluster that is not ours: of processes, or light, within this one, for what needs no processes."""
    from distributed import LocalCluster

    with (
        clusters._quiet(),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1 if processes else 2,
            processes=processes,
            dashboard_address="127.0.0.1:0",
            protocol="tcp://",
            **options,
        ) as cluster,
    ):
        yield cluster


@pytest.fixture(scope="module")
def cluster() -> Iterator[Any]:
    with made(2, processes=True) as cluster:
        yield cluster


@pytest.fixture(autouse=True)
def _processes_of_this_test() -> Iterator[None]:
    """Start those of workers within this process without loading what no test asks of them, and end them."""
    clusters._processes = Processes(nothing)
    yield
    clusters._processes.close()
    clusters._processes = Processes()


@pytest.fixture(scope="module")
def study() -> Study:
    return Study(PROBLEMS / "example1.toml", {"tolerance": [0.001 * k for k in range(1, 5)]}, cases=["A", "D"])


@pytest.fixture(scope="module")
def expected(study: Study, tmp_path_factory: pytest.TempPathFactory) -> StudyResult:
    """The rows as this very process makes them."""
    return run_study(study, tmp_path_factory.mktemp("here"), jobs=1)


def untimed(result: StudyResult) -> list[str]:
    """All rows to the last bit, without what they took."""
    return [
        json.dumps({name: value for name, value in row.items() if not name.startswith("seconds.")})
        for row in result.rows()
    ]


def points(count: int, name: str = "nap") -> Iterator[Asked]:
    for k in range(count):
        yield f"{k}", "scene", {"name": name}, False, "proved"


@pytest.fixture
def run_with(monkeypatch: pytest.MonkeyPatch) -> Callable[..., StudyResult]:
    """Return `run_study` on Dask with another work."""

    def run(work: Any, *arguments: Any, **named: Any) -> StudyResult:
        monkeypatch.setattr("fcdm_opt.design.study.running.workers", partial(workers, work=work))
        return run_study(*arguments, engine="dask", **named)

    return run


# ----------------------------------------------------------------------------------------------------- lost workers


@pytest.mark.slow
@pytest.mark.parametrize("own", [False, True])
def test_rows_are_the_same_though_a_process_is_killed(
    cluster: Any, study: Study, expected: StudyResult, tmp_path: Path, run_with: Any, own: bool
) -> None:
    flag = tmp_path / "kill"
    flag.touch()
    where = {"jobs": 1} if own else {"scheduler": cluster.scheduler_address}
    result = run_with(partial(dying_once, str(flag)), study, tmp_path / "out", **where)
    assert not flag.exists()  # one process did die
    assert result.counts == {"SOLVED": 4, "PAIR_OVERLAPS": 4} == expected.counts
    assert untimed(result) == untimed(expected)


@pytest.mark.slow
def test_points_that_always_kill_are_rows(
    cluster: Any, study: Study, expected: StudyResult, tmp_path: Path, run_with: Any
) -> None:
    keys = [point.key for point in study.points()]
    work = partial(dying_at, frozenset(keys[3:4]))
    result = run_with(work, study, tmp_path, scheduler=cluster.scheduler_address)
    rows = result.rows()
    assert rows[3]["status"] == "WORKER_LOST"
    assert "twice" in rows[3]["message"]
    found, wanted = untimed(result), untimed(expected)
    assert found[:3] + found[4:] == wanted[:3] + wanted[4:]  # nobody else is blamed


@pytest.mark.slow
def test_a_worker_of_dask_that_is_killed_is_replaced(cluster: Any) -> None:
    with workers("dask", None, cluster.scheduler_address, limit=None, work=fragile) as answers:
        run = answers(points(60))
        rows = [next(run) for _ in range(6)]
        victim = next(iter(cluster.workers.values())).process.process.pid
        os.kill(victim, signal.SIGKILL)
        rows += run
        assert sorted(row["key"] for row in rows) == sorted(point[0] for point in points(60))
        assert {row["status"] for row in rows} == {"SOLVED"}


@pytest.mark.slow
def test_a_study_that_kills_workers_of_dask_again_and_again_ends(study: Study, tmp_path: Path, run_with: Any) -> None:
    keys = [point.key for point in study.points()]
    work = partial(killing_the_worker, frozenset(keys[3:4]))
    impatient = {"scheduler_kwargs": {"allowed_failures": 0}}
    with (
        made(1, processes=True, **impatient) as cluster,
        pytest.raises(InputError, match="lost again and again with the same points"),
    ):
        run_with(work, study, tmp_path, scheduler=cluster.scheduler_address)


def test_dask_works_with_a_clean_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    before = children()
    with workers("dask", 1, None, limit=None, work=fragile) as answers:
        rows = []
        for row in answers(points(40)):
            if not rows:
                os.kill(row["process"], signal.SIGKILL)
            rows.append(row)
        assert {row["status"] for row in rows} == {"SOLVED"}
        assert len(rows) == 40
    assert capfd.readouterr() == ("", "")
    assert children() <= before


def test_an_interrupted_run_leaves_no_process(capfd: pytest.CaptureFixture[str]) -> None:
    def run() -> None:
        with workers("dask", 2, None, limit=None, work=fragile) as answers:
            assert next(answers([*points(2), *points(4, "endless")]))["status"] == "SOLVED"
            raise KeyboardInterrupt

    start, before = time.monotonic(), children()
    with pytest.raises(KeyboardInterrupt):
        run()
    assert time.monotonic() - start < 300
    assert children() <= before
    assert capfd.readouterr() == ("", "")


def test_an_unexpected_error_is_told_as_it_is(cluster: Any) -> None:
    with (
        workers("dask", None, cluster.scheduler_address, limit=None, work=fragile) as answers,
        pytest.raises(ZeroDivisionError, match=r"at \d"),
    ):
        list(answers(points(3, "wrong")))


# ------------------------------------------------------------------------------------------------------- schedulers


def test_an_address_without_a_scheduler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clusters, "CONNECT", 0.5)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        unused = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        start = time.monotonic()
        for address in (unused, "tcp://127.0.0.1:1", "nonsense", "foo://host:1"):
            with pytest.raises(InputError, match=r"scheduler: no Dask scheduler answers there .*tcp://host:8786"):
                workers("dask", None, address, limit=None).__enter__()
        silent.listen()  # takes connections, but never says a word
        with pytest.raises(InputError, match="no Dask scheduler answers there"):
            workers("dask", None, unused, limit=None).__enter__()
        assert time.monotonic() - start < 100  # seconds, not the minutes for which Dask would try


def test_workers_may_join_late_and_the_scheduler_may_go_away(monkeypatch: pytest.MonkeyPatch) -> None:
    def run(cluster: Any) -> None:
        with workers("dask", None, cluster.scheduler_address, limit=None, work=fragile) as answers:
            rows = answers(points(300))
            assert next(rows)["status"] == "SOLVED"  # only now was there a worker
            cluster.close()
            list(rows)

    with made(0, processes=False) as cluster:
        timer = threading.Timer(0.3, cluster.scale, [1])
        timer.start()
        with pytest.raises(InputError, match="scheduler: the scheduler went away"):
            run(cluster)
        timer.join()
    monkeypatch.setattr(clusters, "PATIENCE", 0.1)
    with made(0, processes=False) as cluster, pytest.raises(InputError, match="no worker joined"):
        workers("dask", None, cluster.scheduler_address, limit=None).__enter__()


def test_workers_of_another_version_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with made(1, processes=False) as cluster:
        reason = r"worker .*another version of fcdm_opt; found .*allowed: version 0.0.9"
        with monkeypatch.context() as patch:
            patch.setattr(clusters, "__version__", "0.0.9")
            with pytest.raises(InputError, match=reason):
                workers("dask", None, cluster.scheduler_address, limit=None).__enter__()
        with monkeypatch.context() as patch:
            patch.setattr("fcdm_opt.design.study.running.__version__", "0.0.9")  # as if the workers had joined since
            with (
                pytest.raises(InputError, match=reason),
                workers("dask", None, cluster.scheduler_address, limit=None, work=fragile) as answers,
            ):
                list(answers(points(1)))


# ---------------------------------------------------------------------------------------------------------- arguments


@pytest.mark.parametrize(
    ("jobs", "scheduler", "key"),
    [
        (None, "", "scheduler"),
        (None, 8786, "scheduler"),
        (2, "tcp://host:8786", "jobs"),
        (0, None, "jobs"),
        (True, None, "jobs"),
        (1.5, None, "jobs"),
    ],
)
def test_arguments_that_make_no_sense_are_refused(jobs: Any, scheduler: Any, key: str) -> None:
    with pytest.raises(InputError) as refused:
        check_engine("dask", jobs, scheduler)
    assert refused.value.key == key


def test_a_missing_dask_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"distributed cannot be loaded .*-c constraints.txt -e '\.\[dask\]'"):
        check_engine("dask", None, None)
