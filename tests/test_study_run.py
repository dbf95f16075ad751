"""Runs of a study: the same rows however they come about, nothing lost and nothing done twice."""

from __future__ import annotations

import fcntl
import json
import os
import socket
import sqlite3
import subprocess
import sys
import textwrap
import threading
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
from fragile import fragile, nothing

import fcdm_opt as fo
from fcdm_opt.design.question import Question
from fcdm_opt.design.study import plan as plans
from fcdm_opt.design.study import progress
from fcdm_opt.design.study.engines import LocalEngine, OwnProcess
from fcdm_opt.design.study.plan import Plan
from fcdm_opt.design.study.point import Outcome, Payload, evaluate, row
from fcdm_opt.design.study.results import StudyResult
from fcdm_opt.design.study.running import chosen, run_study
from fcdm_opt.design.study.store import FILE, LOCK, Belonging, Met, Store
from fcdm_opt.design.study.study import Study
from fcdm_opt.errors import InputError

EXAMPLE = Path(__file__).parent.parent / "problems" / "example1.toml"
OWNER = Belonging("key", "1.0", {"title": "Pegs"})


def study(**changes: Any) -> Study:
    """Small, with points that are solved, without an answer, no question, and equal to others."""
    values = {
        "tolerance": [0.004, 0.01, 0.02, 1.5, 0.02],
        ("limits.RZ_deg", "goal"): [([-10, 10], "touch"), ([-0.1, 0.1], "beyond")],
    }
    return Study(EXAMPLE, values, cases=["B", "C"], **changes)


def rows(folder: Path) -> dict[int, dict[str, Any]]:
    """Return the row of each point as stored, by number."""
    base = sqlite3.connect(folder / FILE)
    found = base.execute("SELECT number, row FROM points LEFT JOIN results USING (key)").fetchall()
    base.close()
    return {number: text and json.loads(text) for number, text in found}


def timeless(found: dict[int, dict[str, Any]]) -> dict[int, dict[str, Any]]:
    return {number: {name: x for name, x in own.items() if name != "seconds"} for number, own in found.items()}


class Watched(OwnProcess):
    """Notes what it is asked, and stops, as by Ctrl-C, when it was asked for so many points."""

    def __init__(self, *, most: float = np.inf) -> None:
        super().__init__()
        self.asked: list[str] = []
        self._most = most

    def run(self, chunks: Iterable[Payload]) -> Iterator[Outcome]:
        for payload in chunks:
            self.asked += [key for key, *_ in payload["points"]]
            if len(self.asked) > self._most:
                raise KeyboardInterrupt
            yield payload, evaluate(payload)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run in this process that nobody disturbed."""
    folder = tmp_path_factory.mktemp("whole")
    run_study(study(), folder, jobs=1)
    return folder


# --------------------------------------------------------------------------------------------------------------- rows


def test_rows_are_what_solve_and_the_judge_say(whole: Path) -> None:
    found = rows(whole)
    assert list(found) == list(range(len(study()))) == list(range(20))
    statuses = Counter()
    for point in study().points():
        own = found[point.number]
        statuses[own["status"]] += 1
        if own["status"] == "BAD_INPUT":
            with pytest.raises(InputError) as caught:
                point.question.problem()
            assert own["message"] == str(caught.value)
            assert own["usable"] is False
            assert own["amount"] is None
            continue
        solution = fo.solve(point.question.problem())
        assert own["key"] == point.key
        assert (own["status"], own["usable"]) == (solution.status.name, solution.usable)
        assert own["parameters"] == dict(solution.parameters)
        assert own["amount"] == (solution.amount if solution.status.found else None)
        assert (own["lower_bound"], own["pair_gap"]) == (solution.lower_bound, solution.pair_gap)
        assert own["features"] == [feature.label for feature in solution.features]
        assert own["checks_failed"] == [check.name for check in solution.certificate.failed]
        assert sum(own["seconds"].values()) == pytest.approx(2 * own["seconds"]["point"], rel=0.5)
    assert statuses["BAD_INPUT"] == 4  # a tolerance of 150 % makes a body vanish
    assert statuses["SOLVED"] >= 6
    assert len(statuses) >= 3


def test_rows_are_the_same_with_two_processes_and_with_one(whole: Path, tmp_path: Path) -> None:
    run_study(study(), tmp_path, jobs=2)
    assert timeless(rows(tmp_path)) == timeless(rows(whole))


def test_a_point_is_answered_alike_whatever_was_asked_before() -> None:
    points = list(study().points())
    forward, backward = (_payload(order) for order in (points, points[::-1]))
    one, other = evaluate(forward), evaluate(backward)[::-1]
    assert [{**own, "seconds": 0} for own in one] == [{**own, "seconds": 0} for own in other]


def test_an_unexpected_error_is_a_row_with_its_text(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(self: Question) -> None:
        raise ZeroDivisionError("by\n nothing")

    monkeypatch.setattr(Question, "problem", failing)
    point = next(iter(study().points()))
    payload = _payload([point])
    payload["scenes"] = {point.question.scene.key: point.question.scene.text + " "}  # not the one solved last
    (own,) = evaluate(payload)
    assert (own["status"], own["message"], own["usable"]) == ("ERROR", "ZeroDivisionError: by nothing", False)


def _payload(points: list[Any], time_limit: float | None = None) -> Payload:
    scenes = {point.question.scene.key: point.question.scene.text for point in points}
    asked = [[point.key, point.question.scene.key, point.question.case] for point in points]
    return {"certify": False, "effort": "proved", "time_limit": time_limit, "scenes": scenes, "points": asked}


# ------------------------------------------------------------------------------------------------- stopped and resumed


def test_what_an_interrupted_run_stored_is_not_done_again(whole: Path, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        run_study(study(), tmp_path, engine=Watched(most=9))
    stored = {own["key"]: own for own in rows(tmp_path).values() if own}
    assert 0 < len(stored) <= 9
    again = Watched()
    run_study(study(), tmp_path, engine=again)
    keys = {point.key for point in study().points()}
    assert sorted(again.asked) == sorted(keys - stored.keys())  # equal points once, those with a row never
    found = rows(tmp_path)
    assert timeless(found) == timeless(rows(whole))
    assert all(own == stored.get(own["key"], own) for own in found.values())  # times too
    idle = Watched()
    run_study(study(), tmp_path, engine=idle)
    assert idle.asked == []
    assert rows(tmp_path) == found


CHILD = """
    from fcdm_opt.design.study.running import chosen, run_study
    from fcdm_opt.design.study.study import Study
    values = [0.001 + 1e-5 * k for k in range(5000)]
    run_study(Study({problem!r}, {{"tolerance": values}}, cases=["B"]), {out!r}, jobs=2)
"""


def test_a_killed_run_leaves_a_good_store_no_worker_and_no_lock(tmp_path: Path) -> None:
    code = textwrap.dedent(CHILD.format(problem=str(EXAMPLE), out=str(tmp_path)))
    run = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        _wait(lambda: (tmp_path / FILE).exists() and _count(tmp_path) >= 20)
        assert len(_session(run.pid)) >= 3  # itself and two workers
        with pytest.raises(InputError, match=rf"another run.*process {run.pid}"):
            Store(tmp_path, OWNER)
    finally:
        run.kill()
        run.wait()
    _wait(lambda: not _session(run.pid))
    count = _count(tmp_path)
    assert 20 <= count < 5000
    values = [0.001 + 1e-5 * k for k in range(5000)]
    same = Study(EXAMPLE, {"tolerance": values}, cases=["B"])
    again = Watched(most=0)
    with pytest.raises(KeyboardInterrupt):  # the lock went with the process
        run_study(same, tmp_path, engine=again)
    stored = {own["key"] for own in rows(tmp_path).values() if own}
    assert len(stored) == count
    assert not stored & set(again.asked)


def _count(folder: Path) -> int:
    base = sqlite3.connect(f"file:{folder / FILE}?mode=ro", uri=True)
    try:
        return int(base.execute("SELECT count(*) FROM results").fetchone()[0])
    except sqlite3.OperationalError:
        return 0  # no table yet
    finally:
        base.close()


def _session(leader: int) -> list[str]:
    """Return the names of the processes of a session that have not ended."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, own = entry.read_text().rpartition(")")[2].split()[:4]
        except (OSError, ValueError):
            continue
        if int(own) == leader and state != "Z":
            found.append(entry.parent.name)
    return found


def _wait(condition: Any, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


# -------------------------------------------------------------------------------------------------------- lost workers


def test_a_lost_worker_costs_the_one_point_that_loses_it_twice(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    names = ["", "", "segfault", "", "once", "exit", "", "endless", *[""] * 12]
    asked = [[f"{k}", "scene", {"name": name, "file": str(tmp_path / "mark")}] for k, name in enumerate(names)]
    common = {"certify": False, "effort": "proved", "time_limit": 0.3, "scenes": {}}
    store = Store(tmp_path / "out", OWNER)
    with store, LocalEngine(2, work=fragile, load=nothing) as engine:
        plan = Plan(_Listed(asked), store, lambda: 2)
        plan._waiting = {key: 1 for key, *_ in asked}
        for last, chunks in (
            (False, ({**common, "points": asked[k : k + 4]} for k in range(0, len(asked), 4))),
            (True, plan.lost()),
        ):
            for payload, found in engine.run(chunks):
                plan.answered(payload, found, last=last)
    base = sqlite3.connect(tmp_path / "out" / FILE)
    statuses = dict(base.execute("SELECT key, status FROM results").fetchall())
    base.close()
    lost = {key for key, status in statuses.items() if status == "WORKER_LOST"}
    assert len(statuses) == len(asked)
    assert lost == {"2", "5", "7"}
    assert set(statuses.values()) == {"WORKER_LOST", "SOLVED"}
    assert plan.made == len(asked)
    assert "noise" not in capfd.readouterr().err


def test_no_more_processes_are_started_than_there_are_chunks() -> None:
    point = ["key", "scene", {}]
    with LocalEngine(9, work=fragile, load=nothing) as engine:
        found = list(engine.run({"time_limit": None, "points": [point]} for _ in range(2)))
        assert len(engine._pool) == 2
        found += engine.run(iter(()))
    assert [[own["key"] for own in rows] for _, rows in found] == [["key"], ["key"]]


class _Listed:
    """A study of points that are no questions."""

    certify, effort, time_limit = False, "proved", None

    def __init__(self, points: list[Any]) -> None:
        self._points = points

    def __len__(self) -> int:
        return len(self._points)

    def points(self) -> Iterator[Any]:
        return iter(self._points)


def test_a_time_limit_takes_a_process_of_its_own() -> None:
    assert isinstance(chosen("joblib", 1, None, time_limit=None), OwnProcess)
    assert isinstance(chosen("joblib", 1, None, time_limit=5.0), LocalEngine)
    assert chosen("joblib", 3, None, time_limit=None).workers == 3


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        (("slurm", None, None), "engine"),
        (("joblib", 0, None), "jobs"),
        (("joblib", True, None), "jobs"),
        (("joblib", 2.0, None), "jobs"),
        (("joblib", 1, "tcp://host:8786"), "scheduler"),
    ],
)
def test_arguments_that_fit_no_engine_are_refused(arguments: Any, key: str) -> None:
    with pytest.raises(InputError) as caught:
        chosen(*arguments, time_limit=None)
    assert caught.value.key == key


# -------------------------------------------------------------------------------------------------------------- chunks


class _Costing:
    """An engine whose points cost what they are said to, with so many workers; it solves nothing."""

    def __init__(self, seconds: float, workers: int) -> None:
        self.workers, self._seconds = workers, seconds
        self.sizes: list[int] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *reason: object) -> None:
        pass

    def run(self, chunks: Iterable[Payload]) -> Iterator[Outcome]:
        for payload in chunks:
            self.sizes.append(len(payload["points"]))
            yield payload, [row(key, "SOLVED", seconds=self._seconds) for key, *_ in payload["points"]]


@pytest.mark.parametrize(("cost", "workers"), [(0.002, 2), (0.002, 16), (0.05, 4), (3.0, 2)])
def test_chunks_follow_the_cost_of_a_point_and_shrink_at_the_end(tmp_path: Path, cost: float, workers: int) -> None:
    engine = _Costing(cost, workers)
    asked = Study(EXAMPLE, {"tolerance": np.linspace(0.001, 0.05, 1500).tolist()}, cases=["B"])
    run_study(asked, tmp_path, engine=engine)
    sizes = engine.sizes
    assert sum(sizes) == 1500
    assert sizes[0] == 1
    assert max(sizes) <= max(1, np.ceil(plans.CHUNK / cost))
    assert all(after <= plans.GROWTH * max(sizes[: k + 1]) for k, after in enumerate(sizes[1:]))
    left = 1500 - np.cumsum(sizes)
    least = max(1.0, np.ceil(plans.LEAST / cost))
    most = np.maximum(least, np.ceil((left + sizes) / plans.SHARE / workers))
    assert (sizes <= most).all()
    if cost * 1500 > plans.CHUNK * workers * 4:
        assert max(sizes) >= min(1500, plans.CHUNK / cost) * 0.9


# --------------------------------------------------------------------------------------------------------------- store


def test_a_second_run_into_the_same_folder_is_refused(tmp_path: Path) -> None:
    reason = rf"another run is writing.*process {os.getpid()}"
    with Store(tmp_path, OWNER), pytest.raises(InputError, match=reason):
        Store(tmp_path, OWNER)
    with Store(tmp_path, OWNER):
        pass


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (OWNER._replace(study="other"), "another study.*Pegs"),
        (OWNER._replace(version="1.1"), "another version of fcdm_opt; found '1.0'; allowed: 1.1"),
    ],
)
def test_the_store_of_another_study_or_version_is_refused(tmp_path: Path, other: Belonging, reason: str) -> None:
    with Store(tmp_path, OWNER) as store:
        store.write([Met(0, "a", {"x": 1})], [row("a", "SOLVED")])
    before = (tmp_path / FILE).read_bytes()
    with pytest.raises(InputError, match=reason):
        Store(tmp_path, other)
    assert (tmp_path / FILE).read_bytes() == before
    with Store(tmp_path, OWNER) as store:  # and let go of
        assert store.has("a")


def test_files_that_are_no_stores_are_refused_and_kept(tmp_path: Path) -> None:
    path = tmp_path / FILE
    path.write_bytes(b"No database, but somebody's notes. " * 40)
    with pytest.raises(InputError, match="cannot be used: file is not a database"):
        Store(tmp_path, OWNER)
    assert path.read_bytes().startswith(b"No database")
    path.unlink()
    base = sqlite3.connect(path)
    base.execute("CREATE TABLE recipes (name TEXT)")
    base.commit()
    base.close()
    with pytest.raises(InputError, match=r"not a store of a study.*recipes"):
        Store(tmp_path, OWNER)
    path.unlink()
    with Store(tmp_path, OWNER) as store:
        store.write([], [row(f"{k:032}", "SOLVED", "x" * 400) for k in range(200)])
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 9000] = bytes(9000)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"damaged|malformed"):
        Store(tmp_path, OWNER)
    path.write_bytes(b"")  # killed between making the file and writing to it
    with Store(tmp_path, OWNER) as store:
        assert not store.has("a")


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="store cannot be used"):
        Store(tmp_path / "file", OWNER)
    with pytest.raises(InputError, match="store cannot be used"):
        Store(Path("/proc/1/study"), OWNER)


def test_a_full_disk_is_told_and_takes_nothing_away(tmp_path: Path) -> None:
    with Store(tmp_path, OWNER) as store:
        store.write([Met(0, "a", {})], [row("a", "SOLVED")])
        store._base.execute("PRAGMA max_page_count = 20")
        with pytest.raises(InputError, match="full"):
            store.write([], [row(f"{k}", "SOLVED", "x" * 1000) for k in range(500)])
        assert store.has("a")
        assert not store.has("0")  # all rows of a chunk or none
    with Store(tmp_path, OWNER) as store:
        store.write([], [row("0", "SOLVED")])
        assert store.has("a")
        assert (tmp_path / LOCK).read_text().strip() == str(os.getpid())


# ------------------------------------------------------------------------------------------------------------ progress


def test_lines_tell_how_far_a_run_is(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress.Pace, "__init__", _at(now, progress.Pace.__init__))
    said: list[str] = []
    with progress.shown(10000, progress=True, say=said.append) as tell:
        for done in range(1000, 8000, 50):
            now[0] += 0.25
            tell(done, done - 1000)
    assert said[0] == "2,950 of 10,000 points (1,000 from before), 195 a second, 36 s left"
    assert len(said) == 4  # every ten seconds, and at the end
    assert said[-1].startswith("7,950 of 10,000 points")


def _at(now: list[float], made: Any) -> Any:
    def init(self: progress.Pace, total: int) -> None:
        made(self, total)
        self._start = now[0]

    return init


def test_nothing_is_said_unasked(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run_study(Study(EXAMPLE, {"tolerance": [0.01]}, cases=["B"]), tmp_path, jobs=1)
    assert capfd.readouterr() == ("", "")


# ------------------------------------------------------------------------------------------------ found by attacking it


@pytest.mark.parametrize("name", [FILE, LOCK])
@pytest.mark.parametrize("replaced", [False, True])
def test_a_store_taken_away_ends_the_run_at_once(tmp_path: Path, name: str, replaced: bool) -> None:
    with Store(tmp_path, OWNER) as store:
        store.write([Met(0, "a", {})], [row("a", "SOLVED")])
        (tmp_path / name).rename(tmp_path / "elsewhere")
        if replaced:
            (tmp_path / name).touch()
        with pytest.raises(InputError, match=rf"{name}: (taken away|the store cannot be used)"):
            store.write([], [row("b", "SOLVED")])


def test_a_path_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no path of a folder"):
        Store(tmp_path / "a\0b", OWNER)


def test_names_that_no_text_can_hold_are_stored(tmp_path: Path) -> None:
    with Store(tmp_path, OWNER) as store:  # a file name that is not UTF-8, in a message
        store.write([Met(0, "a", {"x": 1})], [row("a", "BAD_INPUT", "no such file '\udcff'")])
    assert rows(tmp_path)[0]["message"] == "no such file '?'"


def test_what_listens_there_and_is_no_scheduler_is_refused() -> None:
    listener = socket.create_server(("127.0.0.1", 0))

    def answer() -> None:
        connection, _ = listener.accept()
        with connection:
            connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")  # read as a length: three exabytes
            connection.recv(10_000)

    thread = threading.Thread(target=answer, daemon=True)
    thread.start()
    address = f"tcp://127.0.0.1:{listener.getsockname()[1]}"
    with listener, pytest.raises(InputError, match="no Dask scheduler answers there"):
        chosen("dask", None, address, time_limit=None).__enter__()
    thread.join(5.0)


def test_another_title_or_budget_is_taken_on_and_nothing_solved_again(tmp_path: Path) -> None:
    values = {"tolerance": [0.004]}
    run_study(Study(EXAMPLE, values, cases=["A"]), tmp_path, engine=Watched())
    engine = Watched()
    found = run_study(Study(EXAMPLE, values, cases=["A"], title="Later", budget=1.0), tmp_path, engine=engine)
    assert engine.asked == []
    assert found.definition["title"] == "Later"
    assert found.assembly_yield.of == 1


def test_a_finished_study_leaves_nothing_beside_its_store(tmp_path: Path) -> None:
    """Lock and SQLite's files stayed: those of reading a store that is ready for writers were made at the very end."""
    asked = Study(EXAMPLE, {"tolerance": [0.004]}, cases=["A"], budget=1.0)
    for _ in range(2):  # the second run goes on with a store that was put away
        run_study(asked, tmp_path, jobs=1)
        assert os.listdir(tmp_path) == [FILE]
        assert StudyResult.read(tmp_path).assembly_yield.of == 1
        assert os.listdir(tmp_path) == [FILE]
    with pytest.raises(InputError, match="another version"), Store(tmp_path, OWNER):
        pass
    assert os.listdir(tmp_path) == [FILE]


def test_a_store_that_is_read_while_a_run_ends_is_put_away_by_the_next(tmp_path: Path) -> None:
    with Store(tmp_path, OWNER) as store:
        store.write([Met(0, "a", {})], [row("a", "SOLVED")])
        reader = sqlite3.connect(tmp_path / FILE)
        reader.execute("BEGIN")
        assert reader.execute("SELECT count(*) FROM results").fetchone() == (1,)
    assert (tmp_path / FILE).exists()
    reader.close()
    with Store(tmp_path, OWNER) as store:
        assert store.has("a")
    assert os.listdir(tmp_path) == [FILE]


def test_a_lock_that_a_run_took_away_as_it_ended_is_not_held_instead_of_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two runs would have written: each with the lock of another file of that name."""
    flock, taken = fcntl.flock, []

    def late(file: Any, how: int) -> None:
        if not taken:
            taken.append((tmp_path / LOCK).unlink())
        flock(file, how)

    monkeypatch.setattr(fcntl, "flock", late)
    with Store(tmp_path, OWNER):
        assert (tmp_path / LOCK).read_text().strip() == str(os.getpid())
        with pytest.raises(InputError, match="another run is writing"), Store(tmp_path, OWNER):
            pass
        assert (tmp_path / LOCK).exists()
    assert taken


def test_what_is_left_beside_a_store_that_was_taken_away_does_no_harm(tmp_path: Path) -> None:
    for rest in ("-wal", "-shm"):
        (tmp_path / (FILE + rest)).write_bytes(b"old" * 20_000)
    with Store(tmp_path, OWNER) as store:
        store.write([Met(0, "a", {})], [row("a", "SOLVED")])
    assert rows(tmp_path)[0]["status"] == "SOLVED"
