"""Kernels: kept code that nothing makes stale, one version of each, plain Python for little work, and what is said."""

from __future__ import annotations

import ast
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from conftest import PLAIN
from documents import ROOT
from numba.core import event

from fcdm_opt import compiling, pacing
from fcdm_opt.cli import starting
from fcdm_opt.compiling import kernel, light, stamp_of, step
from fcdm_opt.curve import kernels

pytestmark = pytest.mark.skipif(PLAIN, reason="nothing is compiled")


@step
def times(x, k):
    return k * x.sum()


@kernel
def total(x, shift):
    return times(x, 1) + times(x, 2) + shift


CALLEE = """
from fcdm_opt.compiling import {kind}
SHARE = {share}
@{kind}
def part(x):
    return {factor} * x + SHARE
"""
CALLER = "from fcdm_opt.compiling import kernel\nfrom callee import part\n@kernel\ndef whole(x):\n    return part(x)\n"
CALL = "import sys; sys.path.insert(0, sys.argv[1]); from caller import whole; print(whole(1.0))"
LOGGED = "import logging; logging.basicConfig(); logging.getLogger('fcdm_opt').setLevel('INFO'); "


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["step"])  # and in the end the other
def test_no_kept_code_outlives_a_change_of_what_it_calls_in_another_file(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "sources"
    folder.mkdir()
    (folder / "caller.py").write_text(CALLER)

    def answer(**said: Any) -> tuple[float, int]:
        (folder / "callee.py").write_text(CALLEE.format(kind=kind, **said))
        done = subprocess.run(
            [sys.executable, "-B", "-c", LOGGED + CALL, str(folder)],
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")},
            capture_output=True,
            text=True,
            check=True,
        )
        return float(done.stdout), done.stderr.count("compiling")

    assert answer(factor=2.0, share=0.0) == (2.0, 1)
    assert answer(factor=2.0, share=0.0) == (2.0, 0)
    assert answer(factor=3.0, share=0.0) == (3.0, 1)
    assert answer(factor=3.0, share=0.5) == (3.5, 1)
    kind = "step" if kind == "kernel" else "kernel"
    assert answer(factor=3.0, share=0.5) == (3.5, 1)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["kernel", "step"])
def test_kept_code_of_what_calls_a_module_that_moved_is_made_anew(tmp_path: Path, kind: str) -> None:
    kept, said = (
        os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")},
        CALLEE.format(kind="{kind}", share=0.0, factor=2.0),
    )
    said = said.replace("{kind}", kind.removeprefix("_"))
    name = "_part" if kind.startswith("_") else "part"
    for module in ("callee", "moved"):
        for file in tmp_path.glob("*.py"):
            file.unlink()
        (tmp_path / f"{module}.py").write_text(said.replace("part", name))
        (tmp_path / "caller.py").write_text(CALLER.replace("part", name).replace("callee", module))
        done = subprocess.run(
            [sys.executable, "-B", "-c", CALL, str(tmp_path)], env=kept, capture_output=True, text=True, check=True
        )
        assert float(done.stdout) == 2.0


@pytest.mark.slow
def test_kept_code_served_only_with_the_very_code_that_it_had_called(tmp_path: Path) -> None:
    """A kernel compiled anew in another process, in another order, has the symbol by which kept code calls it."""
    (tmp_path / "callee.py").write_text(CALLEE.format(kind="kernel", factor=2.0, share=0.0))
    (tmp_path / "caller.py").write_text(CALLER)

    def compiled(asked: str) -> int:
        program = f"{LOGGED}import sys; sys.path.insert(0, sys.argv[1]); {asked}"
        done = subprocess.run(
            [sys.executable, "-c", program, str(tmp_path)],
            env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}, capture_output=True, text=True, check=True,
        )  # fmt: skip
        return done.stderr.count("compiling")

    asked = "from caller import whole; assert whole(1.0) == 2.0"
    assert compiled(asked) == 1
    for file in (tmp_path / "kept").rglob("callee*"):
        file.unlink()
    assert compiled("from callee import part; part(1.0)") == 1
    assert compiled(asked) == 0


def test_a_stamp_tells_what_a_kernel_is_made_from_and_nothing_else() -> None:
    def made(text: str) -> Callable[..., Any]:
        names: dict[str, Any] = {"__name__": "made", "np": np}
        exec(compile(text, "made.py", "exec"), names)
        found: Callable[..., Any] = names["f"]
        return found

    plain = stamp_of(made("def f(x):\n    return x + 1.0\n"))
    assert stamp_of(made('\n\ndef f(x):\n    """Say more."""\n    return x + 1.0\n')) == plain
    for other in ("x + 2.0", "x - 1.0", "np.abs(x) + 1.0"):
        assert stamp_of(made(f"def f(x):\n    return {other}\n")) != plain
    table = stamp_of(made("table = np.zeros(2)\ndef f(x):\n    return x + table[0]\n"))
    assert stamp_of(made("table = np.ones(2)\ndef f(x):\n    return x + table[0]\n")) != table


def test_flags_of_arrays_and_known_numbers_make_no_versions() -> None:
    values = np.arange(4.0)
    frozen = values.copy()
    frozen.flags.writeable = False
    assert [total(x, 0.5) for x in (values, frozen, values, frozen)] == [18.5] * 4
    assert len(total.signatures) == 1
    assert len(times.signatures) <= 1  # none where the code of its caller was kept
    assert total(np.arange(8.0)[::2], 0.5) == 36.5  # not contiguous: served all the same


def test_little_work_is_not_compiled_and_answers_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    compiling._count_runs()
    monkeypatch.setattr(compiling, "_allowance", [compiling.IN_ALL])
    pieces = np.array([[1.0, 0.5, 1.0], [-1.0, 0.25, -3.0]])
    asked = pieces, np.array([0.0, 1.0]), np.array([1.0, 0.0]), (1e-12, 1e-12, 1e-9, 1e-6)
    compiled = kernels.interval(*asked)
    fresh = light(kernel(kernels.interval.py_func))
    fresh.keeps = False
    assert fresh(*asked) == compiled
    assert not fresh.signatures
    assert [type(x) for x in fresh(*asked)] == [float, float]
    fresh.patience = 0.0
    assert fresh(*asked) == compiled
    assert len(fresh.signatures) == 1


@kernel
def counted(x, counts):
    counts[0] += 1.0
    zero = 0.0 * len(x)
    return (1.0 + zero) / zero + x[0]


@kernel
def rooted(x, counts):
    return math.sqrt(-x[0]) + math.exp(1e3 * x[0]) + 0.0 * counts[0]


@kernel
def nested(x, counts):
    counts[0] += 1.0
    return shifted(x) + counts[0]


@kernel
def shifted(x):
    return x[0] + 1.0


def test_plain_python_raised_where_compiled_code_has_an_answer() -> None:
    x, counts = np.ones(2), np.zeros(1)
    for written, wanted in ((rooted, np.nan), (counted, np.inf)):
        made = light(kernel(written.py_func))
        made.keeps = False
        assert np.array_equal(made(x, counts), wanted, equal_nan=True)
    assert counts[0] == 1.0  # what it had written before it was refused is taken back


def test_plain_python_that_takes_longer_than_compiling_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    x, counts = np.ones(2), np.zeros(1)
    monkeypatch.setattr(compiling, "LOOKS", 1)
    made = light(kernel(nested.py_func))
    made.keeps, made.patience = False, 1e-9
    assert (made(x, counts), counts[0], len(made.signatures)) == (3.0, 1.0, 1)
    monkeypatch.setattr(compiling, "_allowance", [compiling.IN_ALL])
    made = light(kernel(nested.py_func))
    made.keeps = False
    compiling.eager()
    assert (made(x, counts), counts[0], len(made.signatures)) == (4.0, 2.0, 1)


@kernel
def doubled(x):
    return 2.0 * x[0]


@kernel
def calling(x):
    return doubled(x) + doubled(x[1:])


def test_what_is_compiled_already_was_counted_and_run_as_plain_python_for_what_calls_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    compiling._count_runs()
    monkeypatch.setattr(compiling, "_allowance", [compiling.IN_ALL])
    x, made = np.array([1.0, 2.0]), light(calling)
    assert doubled(x) == 2.0
    monkeypatch.setattr(doubled, "py_func", None)  # not run any more
    assert made(x) == 6.0
    assert not made.signatures
    assert made.patience == compiling.COMPILING * len(calling.py_func.__code__.co_code)


@kernel
def put(x, values):
    x[1:] = values


def test_no_text_of_an_error_is_compiled_where_an_array_is_written_to_a_place() -> None:
    class Seen(event.Listener):
        def on_start(self, event: Any) -> None:
            names.append(event.data["dispatcher"].py_func.__module__)

        def on_end(self, event: Any) -> None:
            pass

    x, names = np.zeros(3), list[str]()
    put.keeps = False
    with event.install_listener("numba:compile", Seen()):
        put(x, np.ones(2))
    assert x.tolist() == [0.0, 1.0, 1.0]
    assert names
    assert not [name for name in names if "unicode" in name], "two seconds of strings for each first run"
    with pytest.raises(ValueError, match="shapes"):
        put(x, np.ones(3))


def test_all_that_a_kernel_of_the_package_reads_is_told_apart() -> None:
    """No stamp holds an address: it would be another one in every process."""
    for made in list(compiling._ALL):
        said = compiling._read(made.py_func.__code__, made.py_func, [])
        assert " at 0x" not in repr(said), made


@pytest.mark.slow
def test_compiling_in_a_library_call_prints_nothing(tmp_path: Path) -> None:
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(kind="step", factor=2.0, share=0.0))
    done = subprocess.run(
        [sys.executable, "-B", "-c", CALL, str(tmp_path)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert (done.stdout, done.stderr) == ("2.0\n", "")
    assert list(tmp_path.rglob("*.nbc"))


@pytest.mark.slow
def test_a_first_run_compiled_for_most_of_a_minute_what_small_bodies_need_for_seconds(tmp_path: Path) -> None:
    problem = Path(__file__).parents[2] / "problems" / "example1_touch.toml"
    done = subprocess.run(
        [sys.executable, "-c", "from fcdm_opt.cli import main; main()", "solve", "--certify", str(problem)],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "smallest possible (proved)" in done.stdout
    assert "compiling" not in done.stderr
    assert not list(tmp_path.rglob("*.nbc"))
    (note,) = tmp_path.rglob("seconds-of-plain-python")
    assert 0.0 < sum(map(float, note.read_text().split())) < compiling.IN_ALL


def test_whoever_asked_again_and_again_never_got_compiled_code(tmp_path: Path) -> None:
    program = f"""
from fcdm_opt import compiling
compiling._kept_in(compiling.NOTE).write_text("{compiling.IN_RUNS / 2}\\n" * 2)
compiling._count_runs()
print(compiling._allowance[0])
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout == "0.0\n"


@pytest.mark.skipif(sys.platform != "linux", reason="no processes beside")
def test_two_processes_beside_each_other_both_compiled_one_kernel(tmp_path: Path) -> None:
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(kind="kernel", factor=2.0, share=0.0))
    program = CALL.replace("print(whole(1.0))", "from fcdm_opt import process_pool; process_pool.allow(); ")
    done = subprocess.run(
        [
            sys.executable, "-c", f"{LOGGED}{program}print([x() for x in process_pool.each(whole, (1.0, 1.0))])",
            str(tmp_path),
        ],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert (done.stdout, done.stderr.count("compiling")) == ("[2.0, 2.0]\n", 1)


@pytest.mark.skipif(sys.platform != "linux", reason="no processes beside")
def test_a_command_waited_for_what_the_background_compiled_at_low_priority(tmp_path: Path) -> None:
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(kind="kernel", factor=2.0, share=0.0))
    behind = "from fcdm_opt import compiling; compiling.stay_behind(1)\n"
    holding = "with compiling._locked(whole): print(flush=True); input()"
    program, env = CALL.replace("print(whole(1.0))", ""), os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    with subprocess.Popen(
        [sys.executable, "-c", behind + program + "\n" + holding, str(tmp_path)],
        env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    ) as holds:  # fmt: skip
        assert holds.stdout
        holds.stdout.readline()
        try:
            line = [sys.executable, "-c", CALL, str(tmp_path)]
            done = subprocess.run(line, env=env, capture_output=True, text=True, check=True, timeout=60.0)
        finally:
            holds.communicate("\n")
    assert done.stdout == "2.0\n"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="no processes beside")
def test_plain_python_of_processes_beside_was_never_noted_so_that_asking_again_never_got_compiled_code(
    tmp_path: Path,
) -> None:
    program = """
import numpy as np
from fcdm_opt import compiling, process_pool
from fcdm_opt.curve.kernels import interval
compiling.NOTED = 0.0
def ask(k):
    return interval(np.array([[1.0, 0.5, 1.0 + k]]), np.zeros(2), np.ones(2), (1e-12, 1e-12, 1e-9, 1e-6))
process_pool.allow()
print(len({answer() for answer in process_pool.each(ask, (0, 1))}))
print(len(compiling._kept_in(compiling.NOTE).read_text().split()))
"""
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.split() == ["2", "2"] or len(os.sched_getaffinity(0)) == 1


def test_processes_that_compile_at_once_do_not_mix_versions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each sees the index as it was before the other wrote: a version is lost then, and never another's code taken."""
    files = compiling._Versions(str(tmp_path), "f-1.py311", "stamp")
    keys = [((kind,), ("machine",), ("code", "")) for kind in ("float64", "int64")]
    with monkeypatch.context() as patch:
        patch.setattr(files, "_load_index", dict)
        for key in keys:
            files.save(key, f"code for {key[0]}")
    assert [files.load(key) for key in keys] in (
        [None, "code for ('int64',)"],
        ["code for ('float64',)", "code for ('int64',)"],
    )
    files.save(keys[0], "code for ('float64',)")
    assert [files.load(key) for key in keys] == ["code for ('float64',)", "code for ('int64',)"]


@pytest.mark.slow
def test_rivals_in_the_charts_ran_as_plain_python() -> None:
    """A kernel whose name starts with an underscore gets no entry from Python: nothing there may call one."""
    called = set[str]()
    files = [path for folder in ("fcdm_opt", "benchmarks") for path in (ROOT / folder).rglob("*.py")]
    for path in files:
        if not re.search(r"^@(kernel|step)\b", path.read_text(), re.MULTILINE):
            continue
        tree = ast.parse(path.read_text())
        functions = [node for node in tree.body if isinstance(node, ast.FunctionDef)]
        marks = {node: {ast.unparse(each) for each in node.decorator_list} for node in functions}
        compiled = [node for node in functions if marks[node] & {"kernel", "step"}]
        inner = {node.name for node in compiled if node.name.startswith("_")}
        within = {id(call) for node in compiled for call in ast.walk(node)}
        for call in ast.walk(tree):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and id(call) not in within:
                called |= {f"{path.name}: {call.func.id}"} if call.func.id in inner else set()
    assert len(files) > 200
    assert not called


def test_a_library_call_that_compiles_for_seconds_said_nothing(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Once, and not where somebody listens, as on the command line."""
    clock = iter(range(1000))
    monkeypatch.setattr(compiling, "perf_counter", lambda: 0.9 * next(clock))
    monkeypatch.setattr(compiling, "_ALL", {None: None})
    monkeypatch.setattr(compiling._Progress, "_tell", lambda self: None)
    compiled = SimpleNamespace(data={"dispatcher": None})
    for listening, notes in ((nullcontext(), 1), (pacing.listening(lambda *told: None), 0)):
        caplog.clear()
        progress = compiling._Progress()
        with listening:
            for _ in range(6):
                progress.on_start(compiled)
                progress.on_end(compiled)
        assert [own.message for own in caplog.records] == [f"{compiling.NOTICE}; {compiling.ALL_AT_ONCE}"] * notes


def test_163_kernels_told_a_user_nothing() -> None:
    told = list[str]()
    with pacing.listening(lambda text, *_: told.append(text)):
        compiling._Progress()._tell()
    assert told == [compiling.NOTICE]
    assert not any(sign.isdigit() for sign in compiling.NOTICE)
    assert "warmup" not in compiling.NOTICE, "the command that compiles them all tells this too"


def test_kernels_of_other_commands_are_compiled_in_the_background_by_one_process_and_not_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    begun: list[list[str]] = []
    monkeypatch.setattr(compiling, "_kept_in", lambda name: tmp_path / name)
    monkeypatch.setattr(starting.subprocess, "Popen", lambda line, **_: begun.append(line))

    def count_of_next_run(doing: str = f"solving: {compiling.NOTICE} (case A)") -> int:
        starting.compile_in_background.cache_clear()
        for _ in range(2):
            starting.compile_others_meanwhile(doing, 0, 0)
        return len(begun)

    assert count_of_next_run() == 0, f"{starting.BACKGROUND} keeps from that"
    monkeypatch.delenv(starting.BACKGROUND)
    assert count_of_next_run("loading libraries") == 0
    assert count_of_next_run() == 1, "once a run, with its first kernel"
    assert begun == [[sys.executable, "-m", "fcdm_opt", "warmup", "--background"]]
    assert starting.BACKGROUND in capsys.readouterr().err
    compiling.all_kept(note=True)
    assert count_of_next_run() == 1
    monkeypatch.setattr(compiling, "version", "other than what is noted")
    assert count_of_next_run() == 2


def test_a_second_process_in_the_background_ends_at_once(tmp_path: Path) -> None:
    first = "from fcdm_opt import compiling; assert compiling.compiles_all(); print(flush=True); input()"
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    with subprocess.Popen(
        [sys.executable, "-c", first], env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as holds:
        assert holds.stdout
        holds.stdout.readline()
        line = [sys.executable, "-m", "fcdm_opt", "warmup", "--background"]
        done = subprocess.run(line, env=env, capture_output=True, text=True, check=True)
        holds.communicate("\n")
    assert done.stdout == "", "it says how long it took where it compiled"
    assert not list(tmp_path.rglob("*.nbc")), "compiled by two at a time"
