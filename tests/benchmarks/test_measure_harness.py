"""The harness that times methods: planted defects must be found."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fcdm_opt.curve import kernels
from fcdm_opt.errors import InputError
from fcdm_opt_benchmarks import timing
from fcdm_opt_benchmarks.chart import bench, results
from fcdm_opt_benchmarks.chart.figures import BAND, COLOURS, Look, chart_figure, overview_figure, strongest
from fcdm_opt_benchmarks.comparing import compared
from fcdm_opt_benchmarks.method import Failure, Method
from fcdm_opt_benchmarks.record import BenchRun, Load, Watch, table
from fcdm_opt_benchmarks.timing import TimedScene, TimingPlan, measured, warmed

PLAN = TimingPlan(rounds=6, call=0.0, most=3, patience=10.0)


def scene(name="squares", subject=None):
    """Questions 0, 1, 2, ...: which square is it?"""
    return TimedScene(name, {"vertices": 8}, subject, lambda k: k)


def method(prepare, name="a method", family="a library", settings=None):
    return Method(name, family, settings or {"default": None}, prepare)


def squares(subject, setting):
    return lambda questions: [k * k for k in questions]


def run_of(*methods, plan=PLAN, yardstick=None, about=None):
    return measured(about or scene(), methods, plan, np.random.default_rng(0), [] if yardstick is None else yardstick)


@pytest.fixture
def now(monkeypatch):
    """The time that the harness reads, in seconds; no time goes by but what is added here."""
    now = [0.0]
    monkeypatch.setattr(timing, "perf_counter", lambda: now[0])
    return now


# -------------------------------------------------------------------------------------------- planted: set-up not timed


def test_a_rival_that_puts_its_setup_off_is_found_out(now):
    """Its preparation is empty and its first answer pays for it: the row must carry that time as set-up."""

    def lazy(subject, setting):
        made = []

        def ask(questions):
            if not made:
                now[0] += 0.05
                made.append(True)
            return squares(subject, setting)(questions)

        return ask

    def honest(subject, setting):
        now[0] += 0.05
        return squares(subject, setting)

    late, own = run_of(method(lazy, "late"), method(honest, "honest"))
    assert (late.setup, late.late_setup) == (0.0, pytest.approx(0.05))
    assert (own.setup, own.late_setup) == (pytest.approx(0.05), 0.0)
    row = bench.row(task_of([late.method]), scene(), late)
    assert row["setup"] + row["late_setup"] == pytest.approx(0.05)
    assert "set-up at the first question" in row["reason"]


def test_what_a_rival_remembers_from_the_warming_up_is_of_another_subject(now):
    """Set-up hidden in the untimed warm-up does not help: every subject is set up within the measurement."""
    known = {}

    def hiding(subject, setting):
        if subject not in known:
            now[0] += 0.03
            known[subject] = True
        return squares(subject, setting)

    rival = method(hiding)
    warmed([scene(subject="warming up")], [rival])
    (own,) = run_of(rival, about=scene(subject="measured"))
    assert own.setup == pytest.approx(0.03)


def test_no_question_is_asked_twice_of_a_method_and_all_get_the_same():
    asked = {"one": [], "two": []}

    def keeping(name):
        return method(lambda subject, setting: lambda questions: [asked[name].append(k) or k for k in questions], name)

    run_of(keeping("one"), keeping("two"))
    for questions in asked.values():
        assert len(questions) == len(set(questions))
        assert questions == list(range(len(questions)))


def test_methods_take_turns_in_changing_order():
    order = []

    def noting(name):
        return method(lambda subject, setting: lambda questions: [order.append(name) or k for k in questions[:1]], name)

    run_of(noting("a"), noting("b"), noting("c"), plan=replace(PLAN, most=1))
    rounds = [tuple(order[k : k + 3]) for k in range(3, len(order), 3)]
    assert all(sorted(own) == ["a", "b", "c"] for own in rounds)
    assert len(rounds) == PLAN.rounds
    assert len(set(rounds)) > 1


def test_a_slow_method_sits_out_when_its_time_is_spent(now):
    def slow(subject, setting):
        def ask(questions):
            now[0] += 0.03
            return questions

        return ask

    own, other = run_of(method(slow, "slow"), method(squares, "quick"), plan=replace(PLAN, patience=0.05))
    assert len(own.seconds) <= 2
    assert len(other.seconds) == PLAN.rounds


def test_what_a_call_costs_by_itself_is_shared_by_a_whole_calls_questions(now):
    """A batch that takes 300 us a call and 5 us a question seemed to take 28 us: its first calls were of few."""

    def batch(subject, setting):
        def ask(questions):
            now[0] += 300e-6 + 5e-6 * len(questions)
            return questions

        return ask

    plan = TimingPlan(rounds=4, call=2e-3, most=200, patience=0.08)
    (own,) = run_of(method(batch), plan=plan)
    assert own.seconds == pytest.approx([6.5e-6] * 4)
    assert own.first == pytest.approx(305e-6)
    assert len(own.answers) <= plan.questions


@pytest.mark.parametrize("most", [1, 2, 3, 4, 5, 7, 16, 100])
def test_no_more_questions_are_asked_than_a_plan_says(now, most):
    """Poses of unions are drawn beforehand: pacing asked for one more than there were."""
    rng = np.random.default_rng(most)

    def uneven(subject, setting):
        def ask(questions):
            now[0] += 1e-3 * rng.random() ** 4 + 1e-6 * len(questions)
            return questions

        return ask

    plan = TimingPlan(rounds=3, call=1e-3, most=most, patience=10.0)
    for _ in range(20):
        (own,) = run_of(method(uneven), plan=plan)
        assert len(own.answers) <= plan.questions


# ------------------------------------------------------------------------------------------------------ what goes wrong


def raising(subject, setting):
    def ask(questions):
        raise ValueError("no such thing")

    return ask


def short(subject, setting):
    return lambda questions: [k * k for k in questions[1:]]


def not_prepared(subject, setting):
    raise OSError("library is not there")


@pytest.mark.parametrize(
    ("prepare", "word"), [(raising, "no such thing"), (short, "0 answers to 1"), (not_prepared, "not there")]
)
def test_failures_are_counted_and_drawn_not_dropped(prepare, word):
    task = task_of([method(squares, "ours", "ours"), method(prepare)])
    rows = bench.charted(task, np.random.default_rng(0), [], lambda text: None)
    failed = rows[1]
    assert failed["outcome"] == "failed"
    assert word in failed["reason"]
    assert failed["failed"] == failed["asked"] > 0
    (axes,) = chart_figure(run(chart=rows), "curve").axes
    drawn = [
        line
        for line in axes.lines
        if ((BAND[0] < np.asarray(line.get_ydata())) & (np.asarray(line.get_ydata()) < BAND[1])).all()
    ]
    assert len(drawn) == 1


def boxes_of(texts):
    return [text.get_window_extent() for text in texts if text.get_text() and text.get_visible()]


def test_no_name_in_a_panel_stands_on_another():
    """Names of methods, and numbers of failed answers, stood on each other where methods took about as long."""
    rows = [
        row(f"rival {k}", f"f{k}", 10.0 ** (-2 + 0.03 * k), 1e-9, parameters=1, asked=40, failed=k, outcome="partly")
        | {"task": "motion"}
        for k in range(8)
    ]
    rows += [row(f"own {k}", "ours", 1e-2, 1e-9, task="motion", parameters=1) for k in range(3)]
    figure = overview_figure(run(chart=rows))
    figure.canvas.draw()
    boxes = boxes_of(figure.axes[0].texts)
    assert len(boxes) >= 5  # ours, and the strongest rivals
    assert not any(one.overlaps(two) for k, one in enumerate(boxes) for two in boxes[:k])


def test_the_strongest_rival_had_no_name_in_a_crowded_panel():
    """It stands between ours and a rival with many settings, at the left edge, as a simplex does on small hulls."""
    rows = [row("growth simplex + Newton", "growth distance", 1e-5, 1e-16, task="contact")]
    rows += [
        row(own, "ours", *at, task="contact")
        for own, at in {
            "kernel": (1e-3, 0.0),
            "decision_curves": (4e-6, 3e-17),
            "decision_curve": (6e-5, 1e-16),
        }.items()
    ]
    rows += [
        row("coal distance + Newton", "coal", 1.4e-5 * 1.2**k, 10.0 ** (-2 * k), task="contact", setting=str(k))
        for k in range(1, 9)
    ]
    rows += [row(f"rival {k}", "HiGHS", 3e-5 * 1.3**k, 10.0**-k, task="contact", setting=str(k)) for k in range(2, 16)]
    (texts,) = [axes.texts for axes in overview_figure(run(chart=rows)).axes if axes.get_title()]
    assert "growth simplex + Newton" in {text.get_text() for text in texts}


def test_a_method_looks_the_same_in_all_panels():
    """Its colour was that of its rank in a panel."""
    other = [row("SLSQP", "scipy", 1e-3, 1e-9, task=task, parameters=1) for task in ("contact", "motion")]
    first = [row("coal bisection", "coal", 1e-4, 1e-9, task="contact"), row("fcdm_opt", "ours", 1e-5, 1e-12)]
    figure = overview_figure(run(chart=[*other, *first]))
    looks = [
        (line.get_color(), line.get_marker())
        for axes in figure.axes
        for line in axes.lines
        if line.get_xdata()[0] == 1e-3 and line.get_marker() != "None"
    ]
    assert len(looks) == 2
    assert len(set(looks)) == 1
    (key,) = figure.legends
    assert {text.get_text() for text in key.get_texts()} == {"SLSQP", "coal bisection", "ours: fcdm_opt"}


def test_refused_methods_keep_their_row_and_reason():
    task = task_of([replace(method(squares), refuses=lambda subject: "too many vertices")])
    (row,) = bench.charted(task, np.random.default_rng(0), [], lambda text: None)
    assert (row["outcome"], row["reason"]) == ("not asked", "too many vertices")


def task_of(methods, name="curve"):
    def worth(about, k, answer):
        return bench.Worth(abs(answer - k * k) / max(k * k, 1), misnamed=answer != k * k)

    return bench.ChartTask(name, methods, [scene()], worth, PLAN, lambda about: 4)


def test_errors_are_those_of_the_answers_to_the_same_questions():
    def off(subject, setting):
        return lambda questions: [k * k * (1 + setting) if k % 2 else Failure("even") for k in questions]

    rows = bench.charted(
        task_of([method(off, settings={"loose": 1e-3, "tight": 1e-9})]), np.random.default_rng(0), [], lambda text: None
    )
    assert [row["error"] for row in rows] == pytest.approx([1e-3, 1e-9], rel=1e-6)
    assert [row["failed"] for row in rows] == [2, 2]
    assert [row["outcome"] for row in rows] == ["partly"] * 2
    assert [row["misnamed"] for row in rows] == [2, 2]


# ------------------------------------------------------------------------------------------------- who is ahead of whom


def row(method, family, seconds, error, **more):
    made = {"task": "curve", "scene": "one", "vertices": 8, "method": method, "family": family, "setting": "default",
            "outcome": "answered", "asked": 5, "failed": 0, "misnamed": 0, "reason": "", "seconds": seconds,
            "low": 0.9 * seconds, "high": 1.1 * seconds, "rounds": 5, "setup": 0.1, "first": seconds, "late_setup": 0.0,
            "error": error, "error_low": error, "error_high": error, "worst": error}  # fmt: skip
    return made | more


def test_a_rival_left_of_and_below_ours_is_found():
    ours = row("kernel", "ours", 1e-5, 1e-15)
    faster, better, both = (row(name, "coal", *own) for name, own in
                            {"faster": (1e-6, 1e-3), "better": (1e-3, 0.0), "both": (1e-6, 1e-16)}.items())  # fmt: skip
    elsewhere = row("elsewhere", "coal", 1e-7, 0.0, scene="two")
    found = bench.ahead([ours, faster, better, both, elsewhere], "curve", 0.0)
    assert [own["method"] for own in found] == ["both"]
    assert bench.ahead([ours, faster], "curve", 1e-2)  # an amount reached to a hundredth, ten times as fast


def test_a_rival_pays_for_the_judge_where_that_is_asked():
    ours, rival = row("solve", "ours", 2e-3, 1e-12), row("search", "coal", 1.5e-3, 1e-9, judging=1e-3)
    assert bench.ahead([ours, rival], "curve", 1e-6)
    assert not bench.ahead([ours, rival], "curve", 1e-6, judged=True)


def test_a_motion_less_than_the_reference_is_a_fault_of_ours():
    below = row("search", "coal", 1e-3, 1e-5, below=1, task="motion", parameters=1)
    assert bench.wrong(run(chart=[below], faults=[]))
    assert "REFERENCE WRONG" in results.summary(run(chart=[below], faults=[]))
    assert not bench.wrong(run(chart=[below | {"below": 0}], faults=[]))


def test_a_rival_that_is_added_was_named_nowhere():
    """Beside ours and a known one that is better, and in its own colour."""
    known = [row("kernel", "ours", 1e-5, 1e-15), row("search", "coal", 2e-5, 1e-12)]
    found = run(chart=[*known, row("mine", "own", 4e-5, 1e-7), row("coarse", "own", 1e-6, 1e-2)], faults=[])
    told = results.summary(found)
    assert "mine (added) is within 1e-06 in 1 of 1 scenes: 4e-05 s, 1e-07, 4 times our time." in told
    assert "coarse (added) is within 1e-06 in 0 of 1 scenes." in told
    figure = overview_figure(found)
    assert {"mine", "coarse"} <= {text.get_text() for axes in figure.axes for text in axes.texts}
    assert Look.of("mine", "own").colour not in COLOURS.values()


# ------------------------------------------------------------------------------------------------- files and comparison


def run(seconds=1.0, **tables):
    return BenchRun("bench", True, 1, {"rounds": 3}, "2026-11-22T01:00:00+00:00", seconds, Load(0.0, 0.1), tables)


def test_a_run_is_read_as_it_was_written(tmp_path):
    before = run(chart=[row("kernel", "ours", 1e-5, 1e-15, worst=float("nan"))])
    before.write(tmp_path / "run.json")
    after = BenchRun.read(tmp_path / "run.json")
    assert after.tables["chart"][0]["worst"] is None
    assert after.tables["chart"][0]["seconds"] == 1e-5
    assert (after.machine, after.versions, after.load) == (before.machine, before.versions, before.load)
    assert {"python", "fcdm_opt", "numpy", "coal", "casadi"} <= after.versions.keys()


@pytest.mark.parametrize(
    ("change", "key"),
    [({"schema": 99}, "schema"), ({"tables": [1]}, "tables"), ({"tables": {"chart": [1]}}, "tables.chart"),
     ({"load": {"x": 1}}, "load"), ({"seed": "one"}, "seed")],
)  # fmt: skip
def test_a_file_that_is_no_run_is_refused_with_its_key(tmp_path, change, key):
    path = tmp_path / "run.json"
    run(chart=[]).write(path)
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=rf"run\.json: {key}"):
        BenchRun.read(path)


@pytest.mark.parametrize("text", [None, "", "[]", "{", "\x00"])
def test_a_file_that_is_no_json_object_is_refused(tmp_path, text):
    path = tmp_path / "run.json"
    if text is not None:
        path.write_text(text)
    with pytest.raises(InputError, match=r"run\.json"):
        BenchRun.read(path)


def test_a_slower_machine_is_no_change_and_a_slower_method_is():
    names = ("kernel", "exact path", "batch", "bisection", "linear program")
    old = run(chart=[row(name, "ours", 1e-5, 1e-15) for name in names])
    slower = run(chart=[row(name, "ours", 3e-5, 1e-15) for name in names])
    assert compared(old, slower).changes == []
    assert compared(old, slower).pace == pytest.approx(3.0)
    changed = [row(name, "ours", 3e-5, 1e-15) for name in names]
    changed[1] = row("exact path", "ours", 9e-5, 1e-15)
    changed[2] |= {"error": 1e-9}
    changed[3] |= {"outcome": "failed"}
    del changed[4]
    found = {(c.row.split(", ")[-2], c.column) for c in compared(old, run(chart=changed)).changes}
    assert found == {("exact path", "seconds"), ("batch", "error"), ("bisection", "outcome"), ("linear program", "row")}
    assert "exact path" in compared(old, run(chart=changed)).text


def test_every_new_fault_is_told():
    fault = {"vertices": 8, "shape": "round", "segment": 1, "what": "feature", "found": None, "exact": None}
    faults = [fault | {"pose": pose} for pose in (3, 7)]
    changes = compared(run(faults=faults[:1]), run(faults=faults)).changes
    assert [(change.table, change.new, "7" in change.row) for change in changes] == [("faults", "is new", True)]


def test_a_bar_in_a_cell_is_no_new_column():
    assert table(["method", "reason"], [["a", "x | y"]]).splitlines() == [
        "| method | reason |", "| --- | ---: |", r"| a | x \| y |"]  # fmt: skip


def test_runs_of_different_commands_are_not_compared():
    with pytest.raises(InputError, match="another command"):
        compared(replace(run(), command="stability"), run())


def test_what_other_programs_take_is_seen():
    """A process that is not ours keeps one core busy."""
    if not Path("/proc/stat").exists():
        pytest.skip("this system does not tell")
    watch = Watch()
    burner = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        time.sleep(1.0)
        load = watch.load([1.0, 1.5, 1.2])
    finally:
        burner.kill()
        burner.wait()
    assert load.others is not None
    assert load.others > 0.5 / (run().machine["cores"] or 1)
    assert load.yardstick == 1.5
    assert "Other programs took" in load.sentence


def test_the_overview_has_a_panel_for_each_task_and_class_of_scenes():
    own = [("a", "ours", 1e-3, 1e-12), ("b", "coal", 1e-2, 1e-6)]
    rows = [row(*each, task=task, parameters=1) for task in ("contact", "curve", "motion") for each in own]
    rows += [row(*each, task="contact", shape="aligned") for each in own]
    rows += [row(*each, task="motion", motion="of the data set", shape="curved meshes") for each in own]
    figure = overview_figure(run(chart=rows))
    titles = [axes.get_title() for axes in figure.axes if axes.get_visible()]
    assert len(titles) == 5
    assert sum("aligned hulls" in title for title in titles) == sum("curved meshes" in title for title in titles) == 1
    assert all(len(axes.lines) >= 2 for axes in figure.axes if axes.get_visible())
    assert all({text.get_text() for text in axes.texts} >= {"a", "b"} for axes in figure.axes if axes.get_visible())


def test_the_strongest_rival_answers_all_then_is_near_then_fast():
    rows = [row("ours", "ours", 1e-3, 1e-12), row("far", "coal", 1e-6, 1e-2), row("slow", "coal", 1e-1, 1e-9),
            row("fast", "coal", 1e-2, 1e-8), row("fails", "coal", 1e-5, 1e-9, outcome="failed")]  # fmt: skip
    assert strongest(rows)[:2] == ["fast", "slow"]


def test_a_rival_that_leaves_hard_scenes_out_is_compared_where_it_answers():
    """Half as fast as ours in the easy scene; its median seemed ten times as fast as ours over both."""
    rows = [row("us", "ours", 1e-3, 1e-12, scene="easy"), row("us", "ours", 4e-2, 1e-12, scene="hard"),
            row("it", "coal", 2e-3, 1e-12, scene="easy"),
            row("it", "coal", 1e-5, 1e-12, scene="hard", outcome="failed")]  # fmt: skip
    made = run(chart=rows, faults=[], growth=[], models=[])
    (line,) = [line for line in results.text(made).splitlines() if line.startswith("| the whole curve |")]
    assert [cell.strip() for cell in line.strip("|").split("|")][3:] == [
        "0.021 s, 1e-12", "it, 0.002 s, 1e-12", "1 of 2", "0.5"
    ]  # fmt: skip


# --------------------------------------------------------------------------------- planted: a kernel wrong now and then


@pytest.mark.slow
def test_a_kernel_that_names_a_wrong_feature_once_in_hundreds_is_caught(monkeypatch):
    """The compiled walk itself is made to lie about one feature in 400; the run must say so and be called wrong."""
    true, calls = kernels.walk_many, []

    def lying(*arguments):
        states, ties, counts, sites, lines, ends = true(*arguments)
        sites = sites.copy()
        for row in range(len(calls) % 400, len(sites), 400):
            kind, i, j = sites[row]
            sites[row] = kind, (i + 1) % 4, j
        calls.append(len(sites))
        return states, ties, counts, sites, lines, ends

    assert bench.curve_faults(10, 1) == (40, [])
    monkeypatch.setattr(kernels, "walk_many", lying)
    compared, faults = bench.curve_faults(100, 1)
    assert compared == 400
    assert faults
    assert {fault["what"] for fault in faults} == {"feature"}
    assert bench.wrong(run(chart=[], faults=faults))
    assert "DIFFER" in results.summary(replace(run(chart=[], faults=faults), settings={"curves_compared": compared}))
