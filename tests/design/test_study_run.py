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
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fragile import children, fragile, nothing

import fcdm_opt as fo
from fcdm_opt.design.question import Question
from fcdm_opt.design.study import running
from fcdm_opt.design.study.point import Asked, Row, evaluate, row
from fcdm_opt.design.study.processes import Processes
from fcdm_opt.design.study.results import StudyResult
from fcdm_opt.design.study.running import check_engine, run_study, workers
from fcdm_opt.design.study.store import FILE, LOCK, Store
from fcdm_opt.design.study.study import Study
from fcdm_opt.errors import FcdmError, InputError

EXAMPLE = Path(__file__).parents[2] / "problems" / "example1.toml"
OWNER = ("key", "1.0", {"title": "Pegs"})


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


@pytest.fixture
def watched(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return a run in this process that notes what it asks for, and stops, as by Ctrl-C, after so many points."""

    def run(asked: Study, folder: Path, most: float = np.inf) -> tuple[list[str], StudyResult | None]:
        keys: list[str] = []

        def noted(point: Asked) -> Row:
            keys.append(point[0])
            if len(keys) > most:
                raise KeyboardInterrupt
            return evaluate(point)

        monkeypatch.setattr("fcdm_opt.design.study.running.workers", partial(workers, work=noted))
        try:
            return keys, run_study(asked, folder, jobs=1)
        except KeyboardInterrupt:
            return keys, None

    return run


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
        assert own["features"] == [x.in_words(*solution.problem.bodies[:2]) for x in solution.features]
        assert own["checks_failed"] == [check.name for check in solution.certificate.failed]
        assert sum(own["seconds"].values()) == pytest.approx(2 * own["seconds"]["point"], rel=0.5)
    assert statuses["BAD_INPUT"] == 4  # a tolerance of 150 % makes a body vanish
    assert statuses["SOLVED"] >= 6
    assert len(statuses) >= 3


@pytest.mark.slow
def test_rows_are_the_same_with_two_processes_and_with_one(whole: Path, tmp_path: Path) -> None:
    run_study(study(), tmp_path, jobs=2)
    assert timeless(rows(tmp_path)) == timeless(rows(whole))


@pytest.mark.slow
def test_a_point_is_answered_alike_whatever_was_asked_before() -> None:
    points = [_asked(point) for point in study().points()]
    one, other = list(map(evaluate, points)), list(map(evaluate, points[::-1]))[::-1]
    assert [{**own, "seconds": 0} for own in one] == [{**own, "seconds": 0} for own in other]


def test_an_unexpected_error_is_a_row_with_its_text(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(self: Question) -> None:
        raise ZeroDivisionError("by\n nothing")

    monkeypatch.setattr(Question, "problem", failing)
    own = evaluate(_asked(next(iter(study().points()))))
    assert (own["status"], own["message"], own["usable"]) == ("ERROR", "ZeroDivisionError: by nothing", False)


def _asked(point: Any) -> Asked:
    return point.key, point.question.scene.text, point.question.case, False, "proved"


# ------------------------------------------------------------------------------------------------- stopped and resumed


def test_what_an_interrupted_run_stored_is_not_done_again(whole: Path, tmp_path: Path, watched: Any) -> None:
    asked, result = watched(study(), tmp_path, most=9)
    assert result is None
    stored = {own["key"]: own for own in rows(tmp_path).values() if own}
    assert 0 < len(stored) <= len(asked) == 10
    again, _ = watched(study(), tmp_path)
    keys = {point.key for point in study().points()}
    assert sorted(again) == sorted(keys - stored.keys())  # equal points once, those with a row never
    found = rows(tmp_path)
    assert timeless(found) == timeless(rows(whole))
    assert all(own == stored.get(own["key"], own) for own in found.values())  # times too
    idle, _ = watched(study(), tmp_path)
    assert idle == []
    assert rows(tmp_path) == found


CHILD = """
    from fcdm_opt.design.study.running import run_study
    from fcdm_opt.design.study.study import Study
    values = [0.001 + 1e-5 * k for k in range(5000)]
    run_study(Study({problem!r}, {{"tolerance": values}}, cases=["B"]), {out!r}, jobs=2)
"""


@pytest.mark.slow
def test_a_killed_run_leaves_a_good_store_no_worker_and_no_lock(tmp_path: Path, watched: Any) -> None:
    code = textwrap.dedent(CHILD.format(problem=str(EXAMPLE), out=str(tmp_path)))
    run = subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL, start_new_session=True)
    try:
        _wait(lambda: (tmp_path / FILE).exists() and _count(tmp_path) >= 20)
        assert len(_session(run.pid)) >= 3  # itself and two workers
        with pytest.raises(InputError, match=rf"another run.*process {run.pid}"):
            Store(tmp_path, *OWNER)
    finally:
        run.kill()
        run.wait()
    _wait(lambda: not _session(run.pid))
    count = _count(tmp_path)
    assert 20 <= count < 5000
    values = [0.001 + 1e-5 * k for k in range(5000)]
    same = Study(EXAMPLE, {"tolerance": values}, cases=["B"])
    again, _ = watched(same, tmp_path, most=0)  # the lock went with the process
    stored = {own["key"] for own in rows(tmp_path).values() if own}
    assert len(stored) == count
    assert not stored & set(again)


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


def _wait(condition: Any, seconds: float = 300.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.05)


# -------------------------------------------------------------------------------------------------------- lost workers


NAMES = ["", "", "segfault", "", "once", "exit", "", "endless", *[""] * 12]


def fragiles(names: list[str], mark: Path) -> list[Asked]:
    return [(f"{k}", "scene", {"name": name, "file": str(mark)}, False, "proved") for k, name in enumerate(names)]


@pytest.mark.slow
@pytest.mark.parametrize("jobs", [1, 3])
def test_a_lost_worker_costs_the_one_point_that_loses_it_twice(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], jobs: int
) -> None:
    with workers("joblib", jobs, None, limit=1.0, work=fragile, loaded=nothing) as answers:
        found = {own["key"]: own for own in answers(fragiles(NAMES, tmp_path / "mark"))}
    assert len(found) == len(NAMES)
    assert {key for key, own in found.items() if own["status"] == "WORKER_LOST"} == {"2", "5", "7"}
    assert {own["status"] for own in found.values()} == {"WORKER_LOST", "SOLVED"}
    assert "twice: a crash, or no memory left, or more than 1 s" in found["7"]["message"]
    assert capfd.readouterr() == ("", "")  # what libraries print leads nowhere


def test_no_more_processes_are_started_than_there_are_points(tmp_path: Path) -> None:
    with workers("joblib", 9, None, limit=None, work=fragile, loaded=nothing) as answers:
        found = list(answers(fragiles(["", ""], tmp_path)))
        assert list(answers([])) == []
    assert sorted(own["key"] for own in found) == ["0", "1"]
    assert all(own["process"] != os.getpid() for own in found)


def test_points_are_taken_as_workers_become_free(tmp_path: Path) -> None:
    taken = 0

    def source() -> Iterator[Asked]:
        nonlocal taken
        for point in fragiles(["nap"] * 60, tmp_path):
            taken += 1
            yield point

    with workers("joblib", 2, None, limit=None, work=fragile, loaded=nothing) as answers:
        found = answers(source())
        next(found)
        assert taken < 40  # 9, and those that are done while this process waits for a core
        assert len(list(found)) == 59
    assert taken == 60


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_interrupted_or_failing_run_leaves_no_process(tmp_path: Path, jobs: int) -> None:
    def run(name: str) -> None:
        with workers("joblib", jobs, None, limit=60.0, work=fragile, loaded=nothing) as answers:
            for _ in answers(fragiles(["", "", name, name], tmp_path)):
                if name == "endless":
                    raise KeyboardInterrupt

    for name, error in (("wrong", ZeroDivisionError), ("endless", KeyboardInterrupt)):
        before = children()
        with pytest.raises(error):
            run(name)
        assert children() <= before


def test_processes_that_do_not_start_are_told() -> None:
    with Processes(load=partial(os._exit, 1)) as processes, pytest.raises(FcdmError, match="do not start"):
        processes.answer(fragile, None, fragiles([""], Path())[0])


def test_a_time_limit_takes_a_process_of_its_own(tmp_path: Path) -> None:
    for limit, apart in ((None, False), (5.0, True)):
        with workers("joblib", 1, None, limit=limit, work=fragile, loaded=nothing) as answers:
            (found,) = answers(fragiles([""], tmp_path))
        assert (found["process"] != os.getpid()) is apart


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
        check_engine(*arguments)
    assert caught.value.key == key


# --------------------------------------------------------------------------------------------------------------- store


def test_a_second_run_into_the_same_folder_is_refused(tmp_path: Path) -> None:
    reason = rf"another run is writing.*process {os.getpid()}"
    with Store(tmp_path, *OWNER), pytest.raises(InputError, match=reason):
        Store(tmp_path, *OWNER)
    with Store(tmp_path, *OWNER):
        pass


@pytest.mark.parametrize(
    ("other", "reason"),
    [
        (("other", *OWNER[1:]), "another study.*Pegs"),
        ((OWNER[0], "1.1", OWNER[2]), "another version of fcdm_opt; found '1.0'; allowed: 1.1"),
    ],
)
def test_the_store_of_another_study_or_version_is_refused(tmp_path: Path, other: Any, reason: str) -> None:
    with Store(tmp_path, *OWNER) as store:
        store.write([(0, "a", {"x": 1})], [row("a", "SOLVED")])
    before = (tmp_path / FILE).read_bytes()
    with pytest.raises(InputError, match=reason):
        Store(tmp_path, *other)
    assert (tmp_path / FILE).read_bytes() == before
    with Store(tmp_path, *OWNER) as store:  # and let go of
        assert store.has("a")


def test_files_that_are_no_stores_are_refused_and_kept(tmp_path: Path) -> None:
    path = tmp_path / FILE
    path.write_bytes(b"No database, but somebody's notes. " * 40)
    with pytest.raises(InputError, match="cannot be used: file is not a database"):
        Store(tmp_path, *OWNER)
    assert path.read_bytes().startswith(b"No database")
    path.unlink()
    base = sqlite3.connect(path)
    base.execute("CREATE TABLE recipes (name TEXT)")
    base.commit()
    base.close()
    with pytest.raises(InputError, match=r"not a store of a study.*recipes"):
        Store(tmp_path, *OWNER)
    path.unlink()
    with Store(tmp_path, *OWNER) as store:
        store.write([], [row(f"{k:032}", "SOLVED", "x" * 400) for k in range(200)])
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 9000] = bytes(9000)
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"damaged|malformed"):
        Store(tmp_path, *OWNER)
    path.write_bytes(b"")  # killed between making the file and writing to it
    with Store(tmp_path, *OWNER) as store:
        assert not store.has("a")


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="store cannot be used"):
        Store(tmp_path / "file", *OWNER)
    with pytest.raises(InputError, match="store cannot be used"):
        Store(Path("/proc/1/study"), *OWNER)


def test_a_full_disk_is_told_and_takes_nothing_away(tmp_path: Path) -> None:
    with Store(tmp_path, *OWNER) as store:
        store.write([(0, "a", {})], [row("a", "SOLVED")])
        store._base.execute("PRAGMA max_page_count = 20")
        with pytest.raises(InputError, match="full"):
            store.write([], [row(f"{k}", "SOLVED", "x" * 1000) for k in range(500)])
        assert store.has("a")
        assert not store.has("0")  # all rows of a chunk or none
    with Store(tmp_path, *OWNER) as store:
        store.write([], [row("0", "SOLVED")])
        assert store.has("a")
        assert (tmp_path / LOCK).read_text().strip() == str(os.getpid())


# ------------------------------------------------------------------------------------------------------------ progress


def test_lines_tell_how_far_a_run_is(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(running, "monotonic", lambda: now[0])
    said: list[str] = []
    with running.shown(10000, progress=True, say=said.append) as tell:
        for done in range(1000, 8000, 50):
            now[0] += 0.25
            tell(done, done - 1000)
    assert said[0] == "2,950 of 10,000 points (1,000 from before), 195 a second, 36 s left"
    assert len(said) == 4  # every ten seconds, and at the end
    assert said[-1].startswith("7,950 of 10,000 points")


def test_equal_points_of_a_fresh_folder_are_not_from_before(tmp_path: Path) -> None:
    """The second half repeats the first, of which rows are there when it is met: from this very run."""
    values = [0.001 * k for k in range(1, 7)]
    asked, said = Study(EXAMPLE, {"tolerance": [*values, *values]}, cases=["B"], effort="quick"), list[str]()
    run_study(asked, tmp_path, jobs=1, say=said.append)
    assert said[-1].startswith("12 of 12 points")
    assert "from before" not in said[-1]
    run_study(asked, tmp_path, jobs=1, say=said.append)
    assert said[-1] == "12 of 12 points (12 from before)"


def test_nothing_is_said_unasked(capfd: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    run_study(Study(EXAMPLE, {"tolerance": [0.01]}, cases=["B"]), tmp_path, jobs=1)
    assert capfd.readouterr() == ("", "")


# ------------------------------------------------------------------------------------------------ found by attacking it


@pytest.mark.parametrize("name", [FILE, LOCK])
@pytest.mark.parametrize("replaced", [False, True])
def test_a_store_taken_away_ends_the_run_at_once(tmp_path: Path, name: str, replaced: bool) -> None:
    with Store(tmp_path, *OWNER) as store:
        store.write([(0, "a", {})], [row("a", "SOLVED")])
        (tmp_path / name).rename(tmp_path / "elsewhere")
        if replaced:
            (tmp_path / name).touch()
        with pytest.raises(InputError, match=rf"{name}: (taken away|the store cannot be used)"):
            store.write([], [row("b", "SOLVED")])


def test_a_path_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no path of a folder"):
        Store(tmp_path / "a\0b", *OWNER)


def test_names_that_no_text_can_hold_are_stored(tmp_path: Path) -> None:
    with Store(tmp_path, *OWNER) as store:  # a file name that is not UTF-8, in a message
        store.write([(0, "a", {"x": 1})], [row("a", "BAD_INPUT", "no such file '\udcff'")])
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
        workers("dask", None, address, limit=None).__enter__()
    thread.join(5.0)


def test_another_title_or_budget_is_taken_on_and_nothing_solved_again(tmp_path: Path, watched: Any) -> None:
    values = {"tolerance": [0.004]}
    run_study(Study(EXAMPLE, values, cases=["A"]), tmp_path, jobs=1)
    asked, found = watched(Study(EXAMPLE, values, cases=["A"], title="Later", budget=1.0), tmp_path)
    assert asked == []
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
    with pytest.raises(InputError, match="another version"), Store(tmp_path, *OWNER):
        pass
    assert os.listdir(tmp_path) == [FILE]


def test_a_store_that_is_read_while_a_run_ends_is_put_away_by_the_next(tmp_path: Path) -> None:
    with Store(tmp_path, *OWNER) as store:
        store.write([(0, "a", {})], [row("a", "SOLVED")])
        reader = sqlite3.connect(tmp_path / FILE)
        reader.execute("BEGIN")
        assert reader.execute("SELECT count(*) FROM results").fetchone() == (1,)
    assert (tmp_path / FILE).exists()
    reader.close()
    with Store(tmp_path, *OWNER) as store:
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
    with Store(tmp_path, *OWNER):
        assert (tmp_path / LOCK).read_text().strip() == str(os.getpid())
        with pytest.raises(InputError, match="another run is writing"), Store(tmp_path, *OWNER):
            pass
        assert (tmp_path / LOCK).exists()
    assert taken


def test_what_is_left_beside_a_store_that_was_taken_away_does_no_harm(tmp_path: Path) -> None:
    for rest in ("-wal", "-shm"):
        (tmp_path / (FILE + rest)).write_bytes(b"old" * 20_000)
    with Store(tmp_path, *OWNER) as store:
        store.write([(0, "a", {})], [row("a", "SOLVED")])
    assert rows(tmp_path)[0]["status"] == "SOLVED"
