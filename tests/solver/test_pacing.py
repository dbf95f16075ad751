"""Time limits and signs of life, by clocks that count how often they are looked at."""

from __future__ import annotations

import inspect
import io
import itertools
import json
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from fcdm_opt import (
    Assembly,
    Body,
    Box,
    Cylinder,
    Free,
    Problem,
    Solution,
    Translation,
    cut,
    load_problems,
    pacing,
    solve,
    solve_assembly,
    verify,
)
from fcdm_opt.cli import MODULES, app, helping
from fcdm_opt.design.whatif.budget import budget
from fcdm_opt.errors import InputError
from fcdm_opt.geometry import matching
from fcdm_opt.geometry.matching import matched
from fcdm_opt.geometry.solids import PlacedSolids
from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.problem.solution import Status

EXAMPLE = Path(__file__).parents[2] / "problems" / "example1.toml"
CUBE = np.array(list(itertools.product([0.0, 1.0], repeat=3)))
LOOKS = (1, 2, 3, 5, 8, 13, 21, 40, 80, 200, 600)


def corner() -> list[np.ndarray]:
    """Return three walls that meet in a corner, around the unit cube's lower ones."""
    walls = []
    for k in range(3):
        low, high = np.full(3, -1.0), np.full(3, 2.0)
        high[k] = 0.0
        walls.append(low + CUBE * (high - low))
    return walls


def in_the_corner(motion: Any, **more: Any) -> Problem:
    """A cube in a corner, both larger: the walls' planes through the origin stay, seed there, so it is pushed out."""
    movable, static = Body.convex(CUBE, seed="centroid"), Body.from_parts(corner(), seed=np.zeros(3))
    return Problem(movable, static, target=(1.1, 1.0), goal="clear", motion=motion, **more)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """A second goes by at every look at the clock."""
    ticks = itertools.count()
    monkeypatch.setattr(pacing, "clock", lambda: float(next(ticks)))


ALL = Translation("x") >> Translation("y") >> Translation("z")
ALONE = {"TX": (0.0, 0.0), "TY": (0.0, 0.0), "TZ": (0.0, 0.0)}


@pytest.mark.sampled(9)
@pytest.mark.parametrize("looks", LOOKS)
@pytest.mark.parametrize("motion", [ALL, Free()], ids=["shifts", "free"])
def test_what_time_leaves_is_a_motion_that_is_judged_and_a_bound_that_holds(
    looks: int, motion: Any, counted: None
) -> None:
    least = 0.05 * math.sqrt(3.0)  # half of what the edges grow, off each of the three walls
    found = solve(in_the_corner(motion), time=looks / pacing.SEARCHED)
    assert found.lower_bound <= least * (1.0 + 1e-9)
    if found.status.found:
        assert found.usable is (found.status is not Status.NOT_VERIFIED)
        assert found.usable or "not judged in the time given" in found.certificate.failed[0].note
        assert found.amount >= least * (1.0 - 1e-9)
    else:
        assert (found.status, math.isfinite(found.lower_bound)) == (Status.NOT_FOUND, True)
        assert "time limit" in found.stopped
        assert "allow more time" in found.advice
        assert f"{found.to_dict()['stopped']}"[1:] in found.advice


def test_time_that_does_for_it_changes_nothing(counted: None) -> None:
    problem = in_the_corner(ALL)
    one, two = solve(problem), solve(problem, time=1e9)
    assert (one.amount, one.lower_bound, one.stage) == (two.amount, two.lower_bound, two.stage)
    assert two.stopped == ""
    assert one.amount == pytest.approx(0.05 * math.sqrt(3.0), rel=1e-9)


@pytest.mark.slow
def test_a_share_of_the_looks_finds_motions_and_a_share_none(counted: None) -> None:
    found = [solve(in_the_corner(Free()), time=looks).status.found for looks in LOOKS]
    assert not found[0]
    assert found[-1]


@pytest.mark.parametrize("looks", LOOKS)
def test_nothing_is_called_impossible_for_lack_of_time(looks: int, counted: None) -> None:
    asked = load_problems(EXAMPLE)[0]
    assert solve(asked, time=looks).status is not Status.INFEASIBLE
    nowhere = solve(in_the_corner(ALL, limits=ALONE), time=looks)  # really so
    assert nowhere.status in (Status.INFEASIBLE, Status.NOT_FOUND)


def test_half_an_answer_was_taken_for_all_that_can_be_had(counted: None) -> None:
    problem = load_problems(EXAMPLE)[0].changed(goal="touch")
    with pacing.within(3.0):
        found = budget(problem, 0.1)
    assert [own.tolerance for own in found.values()] == [0.0] * 4
    assert str(found["A"]) == "A: not known, the time limit was met"
    with pacing.within(3.0):
        assert solve(problem, time=math.inf).stopped


def slow_to_judge(monkeypatch: pytest.MonkeyPatch) -> None:
    """The search takes no time, and each look at the clock while something is judged a second."""
    now, judging = itertools.count(), pacing.judging
    state = [0.0]
    monkeypatch.setattr(pacing, "clock", lambda: state[0])

    @contextmanager
    def slow() -> Iterator[None]:
        with monkeypatch.context() as own, judging():
            own.setattr(pacing, "clock", lambda: float(next(now)))
            try:
                yield
            finally:
                state[0] = float(next(now))

    monkeypatch.setattr(pacing, "judging", slow)


def test_the_judge_looked_at_no_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    """Large parts were judged for minutes after the time given: what is not judged by then is told, and not used."""
    slow_to_judge(monkeypatch)
    problem = in_the_corner(ALL)
    late = solve(problem, time=3.0)
    assert (late.status, late.usable) == (Status.NOT_VERIFIED, False)
    (failed,) = late.certificate.checks
    assert (failed.passed, failed.limit, failed.note) == (False, 3.0, "not judged in the time given, seconds")
    assert late.stopped.startswith("the time limit of 3 s was met while judging")
    assert "was not judged in the time given: allow more time" in late.advice
    assert math.isnan(late.amount_low)
    assert not verify(Solution.from_dict(late.to_dict())).passed
    assert solve(problem, time=1e6).usable
    assert solve(problem).usable
    with pacing.within(3.0), pytest.raises(pacing.TimeOverError, match="while judging"):
        solve(problem)


def test_assemblies_looked_at_no_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    parts = [Body.from_parts(corner(), seed=np.zeros(3), name="walls"), Body.convex(CUBE, seed="centroid", name="cube")]
    contacts = [("cube", "walls")]
    assembly = Assembly(parts, contacts, scales={"cube": 1.1}, motions={"cube": ALL})
    assert solve_assembly(assembly).usable
    slow_to_judge(monkeypatch)
    with pacing.within(20.0), pytest.raises(pacing.TimeOverError, match="while judging the motion"):
        solve_assembly(assembly)


def test_limits_lie_within_one_another(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(pacing, "clock", lambda: now[0])
    with pacing.within(10.0, share=1.0):
        with pacing.within(100.0, share=1.0):
            assert pacing.remaining() == 10.0
        with pacing.sharing(0.25), pacing.judging():
            assert pacing.remaining() == pytest.approx(2.5 * pacing.JUDGED)
        with pacing.within(1.0, share=1.0), pacing.judging():
            assert pacing.remaining() == pytest.approx(pacing.JUDGED)
        with pacing.within(100.0, share=1.0), pacing.judging():
            assert pacing.remaining() == pytest.approx(10.0 * pacing.JUDGED)
        with pacing.sharing(0.25):
            assert pacing.remaining() == 2.5
            now[0] = 2.5
            assert pacing.over()
        assert not pacing.over()
        now[0] = 10.0
        with pytest.raises(pacing.TimeOverError), pacing.within(None):
            pacing.check()
        with pacing.unlimited():
            pacing.check()
        with pacing.telling():
            assert not pacing.over()  # what was found is told in a little more
            now[0] = 11.0
            assert pacing.over()
            pacing.check()
            with pytest.raises(pacing.TimeOverError), pacing.within(1.0):
                pacing.check()
    pacing.check()
    assert pacing.remaining() == math.inf


def test_what_may_be_left_out_went_on_once_it_had_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is told is not to be ended; the curve in a frame of a report may be, and is."""
    now = [0.0]
    monkeypatch.setattr(pacing, "clock", lambda: now[0])

    def work(looks: int) -> str:
        for _ in range(looks):
            pacing.check()
            now[0] += 1.0
        return "done"

    with pacing.within(10.0, share=1.0), pacing.telling():
        assert pacing.in_time(work, 5, late="late") == "done"
        assert pacing.in_time(work, 20, late="late") == "late"
        assert now[0] == pytest.approx(11.0)  # a tenth more is for what is told
        assert work(3) == "done"
        assert pacing.in_time(work, 0, late="late") == "late"


@pytest.mark.parametrize("time", [0, -1.0, math.nan, "5", True])
def test_what_is_no_time_is_refused(time: Any) -> None:
    with pytest.raises(InputError, match="time: not a time"):
        solve(in_the_corner(ALL), time=time)


def test_a_command_without_time_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    run, read = CliRunner(), ProblemFile.problems
    unread = run.invoke(app, ["solve", str(EXAMPLE), "--time", "1e-9", "--json"])
    assert unread.exit_code == 1
    assert "time limit of 1e-09 s was met" in json.loads(unread.stdout)["error"]

    def in_time(*asked: Any, **how: Any) -> Any:
        with pacing.unlimited():
            return read(*asked, **how)

    monkeypatch.setattr(ProblemFile, "problems", in_time)
    none = run.invoke(app, ["solve", str(EXAMPLE), "--time", "1e-9", "--json"])
    assert none.exit_code == 1
    (file,) = json.loads(none.stdout)["files"]
    assert [each["status"] for each in file["cases"]] == ["NOT_FOUND"] * len(file["cases"])
    assert all("time limit of 1e-09 s was met" in each["stopped"] for each in file["cases"])
    told = run.invoke(app, ["whatif", str(EXAMPLE), "--drop", "--time", "1e-9"])
    assert (told.exit_code, "time limit of 1e-09 s was met" in told.stderr) == (1, True)
    refused = run.invoke(app, ["solve", str(EXAMPLE), "--time", "-1"])
    assert (refused.exit_code, "--time: not a time" in refused.stderr) == (2, True)
    assert pacing.remaining() == math.inf


def test_a_report_drew_cases_when_its_time_was_over(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Each page took its second of drawing whatever was left: what is not begun by then is left out, and said."""
    read, out = ProblemFile.problems, tmp_path / "r.html"

    def in_time(*asked: Any, **how: Any) -> Any:
        with pacing.unlimited():
            return read(*asked, **how)

    monkeypatch.setattr(ProblemFile, "problems", in_time)
    cases = ["close the gap", "slanted", "both made larger"]
    chosen = itertools.chain(*(("--case", name) for name in cases))
    asked = ["report", str(EXAMPLE.parent / "boxes.toml"), *chosen, "--time", "1e-9", "--out", str(out)]
    told = CliRunner().invoke(app, asked)
    assert (told.exit_code, out.exists()) == (1, True)
    for name in cases[1:]:
        assert f"case '{name}': left out: the time limit of 1e-09 s was met" in told.stderr
        assert f"case &#39;{name}&#39;: left out" in out.read_text()
    assert f"case '{cases[0]}': left out" not in told.stderr


def test_pose_range_and_stack_had_no_time_limit() -> None:
    asked = [own for each in MODULES for name, own in vars(each).items() if name.endswith("_command")]
    without = [own.__name__ for own in asked if "time" not in inspect.signature(own).parameters]
    assert without == ["schema_command", "warmup_command"]


def test_init_went_on_where_the_time_was_over_before_it_knew_the_parts(tmp_path: Path) -> None:
    meshes, out = EXAMPLE.parent / "meshes", tmp_path / "p.toml"
    files = [str(meshes / name) for name in ("keyway_key.off", "keyway_shaft.ply")]
    told = CliRunner().invoke(app, ["init", *files, "--out", str(out), "--time", "1e-9"])
    assert (told.exit_code, out.exists()) == (1, False)
    assert "time limit of 1e-09 s was met" in told.stderr


def test_the_same_walls_were_matched_for_each_case_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = (replace(Body.convex(CUBE + k, seed="centroid"), rounding=1e-7) for k in (0.0, 1.0))
    first = matched((one, two))
    monkeypatch.setattr(matching, "_incidences", lambda *_: pytest.fail("asked again"))
    assert all(a is b for a, b in zip(matched((one, two)), first, strict=True))


def test_a_depth_took_its_time_whatever_was_left(monkeypatch: pytest.MonkeyPatch) -> None:
    cubes = Body.convex(CUBE, seed="centroid"), Body.convex(CUBE + np.array([0.0, 0.0, 0.75]), seed="centroid")
    whole = PlacedSolids(*cubes, np.ones(2), np.eye(4)).depth
    assert whole == pytest.approx(0.25)  # on one face, and no shorter way out
    monkeypatch.setattr(PlacedSolids, "_deepest", lambda *_: pytest.fail("searched on"))
    with pacing.within(1e-9), pacing.telling():
        assert 0.0 < PlacedSolids(*cubes, np.ones(2), np.eye(4)).depth <= whole


# ------------------------------------------------------------------------------------------------------ signs of life


class Terminal(io.StringIO):
    """A stream that says that it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_bar_stands_below_what_is_printed_and_leaves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    out, err = Terminal(), Terminal()
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", err)
    monkeypatch.setenv("TERM", "xterm")
    sign = helping._Sign()
    sign.tick()
    assert err.getvalue().endswith("loading libraries")  # at once, as text
    sign.update("cutting the lid", 3, 7)
    sign._start -= helping.PATIENCE
    sign.tick()
    assert "cutting the lid" in err.getvalue()
    assert sign._bar.tasks[0].completed == 3
    above = helping._Above(out, sign)
    above.write("a table\n")
    assert sign._bar is None
    assert err.getvalue().endswith("\x1b[2K") or "\x1b[?25h" in err.getvalue()  # taken away, the cursor there again
    assert out.getvalue() == "a table\n"


def test_without_a_terminal_a_line_now_and_then(monkeypatch: pytest.MonkeyPatch) -> None:
    err, now = io.StringIO(), [0.0]
    monkeypatch.setattr(sys, "stderr", err)
    monkeypatch.setattr(helping, "perf_counter", lambda: now[0])
    sign = helping._Sign()
    for second in range(21):
        now[0] = float(second)
        sign.update("proving", second, 0)
        sign.tick()
    assert err.getvalue().splitlines() == [f"still proving, after {t} s" for t in (5, 10, 20)]


def test_work_is_named_with_what_it_is_for() -> None:
    told: list[tuple[str, int, int]] = []
    with pacing.listening(lambda *what: told.append(what)), pacing.working_on("case A"):
        assert pacing.has_listeners()
        pacing.at("searching", 1, 2)
        with pacing.part_of("mapping"):  # whose pieces alone were told
            pacing.at("judging")
    assert told == [("searching (case A)", 1, 2), ("mapping: judging (case A)", 0, 0)]
    assert not pacing.has_listeners()


@pytest.mark.sampled(1)
@pytest.mark.parametrize("looks", [100, 160, 250])
def test_a_motion_that_was_found_in_time_was_thrown_away(looks: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """A pin beside its bore: where the search for points of true faces was cut off no motion was found at all."""
    pin = Cylinder(9.9, 30, base=(0.2, 0.1, -5), facets=32)
    plate = cut(Box((40, 40, 20), centre=(0, 0, 10)), Cylinder(10.0, 22, base=(0, 0, -1)))
    both = Translation("x") >> Translation("y")
    problem, ticks = Problem(pin, plate, target=(1, 1), goal="clear", motion=both), itertools.count()
    monkeypatch.setattr(pacing, "clock", lambda: next(ticks) / looks)
    solution = solve(problem, time=1.0)
    assert solution.status.found
    assert "the time limit of 1 s was met" in solution.stopped
    assert solution.amount == pytest.approx(math.hypot(0.2, 0.1) - 0.1, rel=0.01)
