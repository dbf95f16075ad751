"""Studies on a Dask cluster: the same rows as here, whatever dies; clear errors where there is none, and no noise."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from dask_work import dying_at, dying_once, failing, napping

from fcdm_opt.design.study import dask_engine
from fcdm_opt.design.study.dask_engine import DaskEngine
from fcdm_opt.design.study.results import StudyResult
from fcdm_opt.design.study.running import run_study
from fcdm_opt.design.study.study import Study
from fcdm_opt.errors import InputError

PROBLEMS = Path(__file__).parent.parent / "problems"


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Address of a local cluster of three processes."""
    with DaskEngine(jobs=3) as engine:
        assert engine.workers == 3
        yield engine.address


@contextmanager
def threads(workers: int) -> Iterator[Any]:
    """A cluster within this process: light, for what needs no processes."""
    from distributed import LocalCluster

    with (
        dask_engine._quiet(),
        LocalCluster(
            n_workers=workers, threads_per_worker=2, processes=False, dashboard_address="127.0.0.1:0", protocol="tcp://"
        ) as made,
    ):
        yield made


@pytest.fixture(scope="module")
def study() -> Study:
    return Study(PROBLEMS / "example1.toml", {"tolerance": [0.001 * k for k in range(1, 9)]}, cases=["A", "D"])


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


def payloads(count: int, points: int = 1) -> Iterator[dict[str, Any]]:
    for k in range(count):
        own = [[f"{k}.{j}", "scene", {}] for j in range(points)]
        yield {"certify": False, "time_limit": None, "scenes": {}, "points": own}


def named(outcomes: list[Any]) -> list[str]:
    return sorted(payload["points"][0][0] for payload, _ in outcomes)


# ----------------------------------------------------------------------------------------------------- lost workers


def test_rows_are_the_same_though_a_worker_is_killed(
    cluster: str, study: Study, expected: StudyResult, tmp_path: Path
) -> None:
    flag = tmp_path / "kill"
    flag.touch()
    result = run_study(study, tmp_path / "out", engine=DaskEngine(cluster, work=partial(dying_once, str(flag))))
    assert not flag.exists()  # one process did die
    assert result.counts == {"SOLVED": 8, "PAIR_OVERLAPS": 8} == expected.counts
    assert untimed(result) == untimed(expected)


def test_points_that_always_kill_are_rows(cluster: str, study: Study, expected: StudyResult, tmp_path: Path) -> None:
    keys = [point.key for point in study.points()]
    engine = DaskEngine(cluster, work=partial(dying_at, frozenset(keys[3:5])))
    result = run_study(study, tmp_path, engine=engine)
    statuses = [row["status"] for row in result.rows()]
    assert statuses[3:5] == ["WORKER_LOST"] * 2
    assert "twice" in result.rows()[3]["message"]
    found, wanted = untimed(result), untimed(expected)
    assert found[:3] + found[5:] == wanted[:3] + wanted[5:]  # nobody else is blamed


def test_a_worker_killed_from_outside_is_replaced(cluster: str) -> None:
    with DaskEngine(cluster, work=napping) as engine:
        run = engine.run(payloads(60, points=2))
        outcomes = [next(run) for _ in range(6)]
        victim = outcomes[-1][1][0]["pid"]
        os.kill(victim, signal.SIGKILL)
        outcomes += run
        lost = [payload for payload, rows in outcomes if rows is None]
        assert named(outcomes) == named(list(zip(payloads(60), range(60), strict=True)))
        assert len(lost) <= 1  # what only waited there was done elsewhere
        outcomes = list(engine.run(payloads(60)))
        assert all(rows for _, rows in outcomes)
        assert victim not in {rows[0]["pid"] for _, rows in outcomes}


def test_an_engine_works_with_a_clean_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    with DaskEngine(jobs=1, work=napping) as engine:
        outcomes = []
        for payload, rows in engine.run(payloads(4)):
            if not outcomes:
                os.kill(rows[0]["pid"], signal.SIGKILL)
            outcomes.append((payload, rows))
        assert len(outcomes) == 4
        assert all(len(rows or [0]) == 1 for _, rows in outcomes)
    assert capfd.readouterr() == ("", "")


def test_chunks_are_taken_as_workers_become_free(cluster: str) -> None:
    taken = 0

    def source() -> Iterator[dict[str, Any]]:
        nonlocal taken
        for payload in payloads(30, points=2):
            taken += 1
            yield payload

    with DaskEngine(cluster, work=napping) as engine:
        for done, _ in enumerate(engine.run(source())):
            assert taken <= done + 1 + dask_engine.DEEP * max(engine.workers, 3)
        assert list(engine.run([])) == []
    assert taken == 30


def test_an_unexpected_error_is_told_as_it_is(cluster: str) -> None:
    with DaskEngine(cluster, work=failing) as engine, pytest.raises(ZeroDivisionError, match="in 2 points"):
        list(engine.run(payloads(3, points=2)))


# ------------------------------------------------------------------------------------------------------- schedulers


def test_an_address_without_a_scheduler_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dask_engine, "CONNECT", 0.5)
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        unused = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        start = time.monotonic()
        for address in (unused, "tcp://127.0.0.1:1", "nonsense", "foo://host:1"):
            with pytest.raises(InputError, match=r"scheduler: no Dask scheduler answers there .*tcp://host:8786"):
                DaskEngine(address).__enter__()
        silent.listen()  # takes connections, but never says a word
        with pytest.raises(InputError, match="no Dask scheduler answers there"):
            DaskEngine(unused).__enter__()
        assert time.monotonic() - start < 20  # seconds, not the minutes for which Dask would try


def test_workers_may_join_late_and_the_scheduler_may_go_away(monkeypatch: pytest.MonkeyPatch) -> None:
    with threads(0) as made:
        timer = threading.Timer(0.3, made.scale, [2])
        timer.start()
        with DaskEngine(made.scheduler_address, work=napping) as engine:
            assert engine.workers >= 1  # only now
            run = engine.run(payloads(200))
            assert next(run)[1]
            made.close()
            with pytest.raises(InputError, match="scheduler: the scheduler went away"):
                list(run)
        timer.join()
    monkeypatch.setattr(dask_engine, "PATIENCE", 0.1)
    with threads(0) as made, pytest.raises(InputError, match="no worker joined"):
        DaskEngine(made.scheduler_address).__enter__()


def test_workers_of_another_version_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    with threads(1) as made:
        with monkeypatch.context() as patch:
            patch.setattr("fcdm_opt.__version__", "0.0.9")
            with pytest.raises(
                InputError, match=r"worker .*another version of fcdm_opt; found .*allowed: version 0.0.9"
            ):
                DaskEngine(made.scheduler_address).__enter__()
        with DaskEngine(made.scheduler_address, work=napping) as engine:
            engine._version = "0.0.9"  # as if the workers had joined since
            with pytest.raises(InputError, match=r"another version of fcdm_opt"):
                list(engine.run(payloads(1)))


# ---------------------------------------------------------------------------------------------------------- arguments


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"scheduler": ""}, "scheduler"),
        ({"scheduler": 8786}, "scheduler"),
        ({"scheduler": "tcp://host:8786", "jobs": 2}, "jobs"),
        ({"jobs": 0}, "jobs"),
        ({"jobs": True}, "jobs"),
        ({"jobs": 1.5}, "jobs"),
    ],
)
def test_arguments_that_make_no_sense_are_refused(arguments: dict[str, Any], key: str) -> None:
    with pytest.raises(InputError) as refused:
        DaskEngine(**arguments)
    assert refused.value.key == key


def test_a_missing_dask_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"Dask cannot be loaded .*pip install 'fcdm_opt\[dask\]'"):
        DaskEngine()
