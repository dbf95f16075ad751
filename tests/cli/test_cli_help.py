"""Help, completion, and how commands end: what is said, on which stream, with which code."""

from __future__ import annotations

import json
import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from time import sleep
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from fcdm_opt import pacing
from fcdm_opt.cli import app, helping
from fcdm_opt.cli.guarding import BROKEN_PIPE, INTERNAL, INTERRUPTED, refuse
from fcdm_opt.cli.registry import ROWS as COMMANDS
from fcdm_opt.errors import InputError
from fcdm_opt.show import solved

TOP = Path(__file__).parents[2]
ROWS = {name: own.lines(name) for name, own in COMMANDS.items()}
LINES = [line for lines in ROWS.values() for line in lines.splitlines()]
QUICK = ("init", "schema", "curve", "solve", "range", "whatif", "pose")  # commands whose first example is run
BOXES = "problems/boxes.toml"
LOOP = "problems/assemblies/loop_of_four.toml"
PATIENCE = 300.0  # seconds after which a process is taken to hang


def run(*arguments: object, **more: Any) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False, **more)


def process(*arguments: str, **more: Any) -> subprocess.Popen[str]:
    """Start the command in a process of its own."""
    code = "from fcdm_opt.cli import main; main()"
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **more}
    return subprocess.Popen([sys.executable, "-c", code, *arguments], text=True, cwd=TOP, **streams)


# ----------------------------------------------------------------------------------------------------------------- help


@pytest.mark.parametrize("name", ["", *ROWS])
def test_help_is_plain_narrow_and_ends_with_examples(name: str) -> None:
    result = run(*([name] if name else []), "--help", env={"COLUMNS": "200", "FORCE_COLOR": "1"})
    lines = result.stdout.splitlines()
    assert result.exit_code == 0
    assert max(map(len, lines)) <= 80
    assert "\x1b" not in result.stdout
    assert not re.search(r"[a-z]\.\.\.$", result.stdout, re.MULTILINE)  # not cut off
    if name:
        assert lines[-len(ROWS[name].splitlines()) :] == [f"  {line}" for line in ROWS[name].splitlines()]
    undescribed = [line for line in lines if re.fullmatch(r"  --\S+( [A-Z,=.]+)?", line)]
    assert all(lines[lines.index(line) + 1].startswith("   ") for line in undescribed)


def test_every_command_that_writes_pictures_has_them_for_dark_pages() -> None:
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    options = {name: {option for own in command.params for option in own.opts} for name, command in commands.items()}
    drawing = {"curve", "solve", "range", "study", "map", "faces", "stack"}
    assert {name for name, own in options.items() if "--dark" in own} == drawing
    assert all("--out" in options[name] for name in drawing)


def test_the_overview_names_every_command_and_is_what_a_bare_call_prints() -> None:
    overview = run("--help").stdout
    for name, row in COMMANDS.items():
        assert f"\n{row.question}\n" in overview
        assert re.search(rf"^  {name} ", overview, re.MULTILINE)
    bare = run()
    assert (bare.exit_code, bare.stdout) == (0, overview)
    assert run("-h").stdout == overview


@pytest.mark.parametrize("line", LINES)
def test_every_example_can_be_read(line: str) -> None:
    program, name, *words = shlex.split(line.split(" > ")[0])
    command = typer.main.get_command(app).commands[name]  # type: ignore[attr-defined]
    context = command.make_context(name, [*words])
    assert (program, len(line) <= 78) == ("fcdm-opt", True)
    for file in [word for word in words if word.startswith("problems/")]:
        assert (TOP / file).exists()
    for case in context.params.get("case") or ():
        assert any(f'name = "{case}"' in (TOP / word).read_text() for word in words if word.endswith(".toml"))


@pytest.mark.parametrize("name", QUICK)
def test_the_first_example_of_quick_commands_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "problems").symlink_to(TOP / "problems")
    assert run(*shlex.split(ROWS[name].splitlines()[0].split(" > ")[0])[1:]).exit_code == 0


def test_commands_of_a_package_that_is_missing_stand_in_the_overview_and_say_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("fcdm_opt.cli.helping.entry_points", lambda **_: [])
    overview = run("--help").stdout
    for name in ("bench", "stability"):
        assert re.search(rf"^  {name} ", overview, re.MULTILINE)
        shown = run(name, "--help")
        assert shown.exit_code == 0
        assert "pip install ./benchmarks" in shown.stdout
        assert f"fcdm-opt {name} --quick" in shown.stdout
        for words in (["--quick", "--out", "out"], []):
            result = run(name, *words)
            assert (result.exit_code, result.stdout, result.stderr.count("\n")) == (2, "", 1)
            assert result.stderr.startswith(f"error: {name}: needs the package fcdm_opt_benchmarks: pip install ")
    assert completed("fcdm-opt stability --q", monkeypatch) == []


# ----------------------------------------------------------------------------------------------------------- completion


def completed(line: str, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    words = shlex.split(line + " x")[:-1] + ([""] if line.endswith(" ") else [])
    env = {"_FCDM_OPT_COMPLETE": "complete_bash", "COMP_WORDS": line, "COMP_CWORD": str(len(words) - 1)}
    monkeypatch.chdir(TOP)
    result = CliRunner().invoke(app, [], prog_name="fcdm-opt", env=env)
    assert result.exit_code == 0
    return [word for word in result.stdout.splitlines() if word]


def test_the_shell_completes_commands_options_files_and_cases(monkeypatch: pytest.MonkeyPatch) -> None:
    assert completed("fcdm-opt s", monkeypatch) == ["schema", "solve", "stack", "study", "stability"]
    assert completed("fcdm-opt solve --ce", monkeypatch) == ["--certify"]
    assert completed(f"fcdm-opt solve {BOXES} --case u", monkeypatch) == [
        "undo an overlap",
        "undo an overlap with play",
    ]
    assert completed("fcdm-opt solve problems/example1", monkeypatch) == [
        "problems/example1.toml",
        "problems/example1_touch.toml",
    ]
    assert completed("fcdm-opt solve prob", monkeypatch) == []  # a folder: the shell's own completion
    assert completed("fcdm-opt solve none.toml --case ", monkeypatch) == []
    script = run(prog_name="fcdm-opt", env={"_FCDM_OPT_COMPLETE": "source_bash"}).stdout
    assert "complete -o default -F _fcdm_opt_completion fcdm-opt" in script


# --------------------------------------------------------------------------------------------------------------- errors


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("solv x.toml", "error: solv: no such command, did you mean 'solve'?"),
        ("zzz x.toml", "error: zzz: no such command; allowed: init,"),
        ("budget x.toml", "error: budget: no such command; an option: fcdm-opt whatif --budget"),
        ("solve x.toml --certfy", "error: --certfy: no such option, did you mean '--certify'?"),
        ("solve --jsn x.toml", "error: --jsn: no such option, did you mean '--json'?"),
        ("init --jsonn a b", "error: --jsonn: no such option; see"),  # dashes alone made '--version' near
        ("solve", "error: FILE: missing; allowed: Problem files (TOML); see fcdm-opt solve --help"),
        ("map x.toml --out o --jobs many", "error: --jobs: "),
        (f"map {BOXES} --box 1,2,3 --out /proc/none", "error: --box: not pairs of numbers; found '1,2,3'; allowed: "),
        ("stability", "error: --out: what to do is not given once; found 'neither'; allowed: "),
        (f"solve {BOXES} --case nope", "error: --case: no such case; found 'nope'; allowed: close the gap,"),
        ("stack x.toml --of base", "error: --of: not two parts; found 'base'; allowed: "),  # it was a TypeError
        ("study x.toml --out o --engine foo", "error: --engine: no such word; found 'foo'; allowed: joblib, dask"),
        (f"stack {LOOP} --of base,kay", "error: --of: no such part, did you mean 'key'?; found 'kay'; allowed: base,"),
        ("solve problems", "error: problems: the file cannot be read; found 'Is a directory'; allowed: "),
    ],
)
def test_errors_are_one_line_and_valid_json_where_that_is_asked_for(
    line: str, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(TOP)
    result = run(*line.split(" "))
    assert (result.exit_code, result.stdout) == (2, "")
    assert result.stderr.startswith(words)
    assert result.stderr.count("\n") == 1
    asked = run(*line.split(" "), "--json")
    assert asked.exit_code == 2
    document = json.loads(asked.stdout)
    assert (document if "error" in document else document["files"][0])["error"]


@pytest.mark.parametrize("command", ["curve", "solve", "range", "map"])
def test_a_folder_was_left_where_no_file_could_be_read(command: str, tmp_path: Path) -> None:
    result = run(command, tmp_path / "none.toml", "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert not (tmp_path / "out").exists()


def test_a_defect_is_one_line_and_a_traceback_only_with_debug(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("planted\nhere")

    monkeypatch.chdir(TOP)
    monkeypatch.setattr(solved, "solved_case", broken)
    result = run("solve", BOXES)
    assert result.exit_code == INTERNAL
    assert ": internal: ZeroDivisionError: planted here; please report" in result.stderr
    assert result.stderr.count("\n") == 1
    told = json.loads(run("solve", BOXES, "--json").stdout)["files"][0]["cases"]
    assert all("internal" in case["error"] for case in told)
    for line in (["--debug", "solve", BOXES], ["solve", BOXES, "--debug"]):
        shown = run(*line)
        assert shown.exit_code == INTERNAL
        assert "Traceback" in shown.stderr
    assert "Traceback" in run("solve", "none.toml", "--debug").stderr
    assert "Traceback" not in run("solve", "none.toml").stderr


def test_a_defect_in_one_case_took_the_answers_of_the_others(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """`solve` printed nothing, `report` wrote no file."""
    answered = solved.solved_case

    def broken(problem: Any, **how: Any) -> Any:
        if problem.name in ("slanted", "key 2 % too large"):
            raise ZeroDivisionError("planted here")
        return answered(problem, **how)

    monkeypatch.chdir(TOP)
    monkeypatch.setattr(solved, "solved_case", broken)
    monkeypatch.setattr("fcdm_opt.show.report.gather.solved_case", broken)
    result = run("solve", BOXES)
    place = "problems/boxes.toml:{}: case 'slanted'"
    (said,) = [line for line in result.stderr.splitlines() if line.startswith("error: ")]
    assert re.sub(r":\d+:", ":{}:", said).startswith(f"error: {place}: internal: ZeroDivisionError: planted here;")
    assert (result.exit_code, "both made larger" in result.stdout) == (INTERNAL, True)
    for name, other in (("boxes", "both made larger"), ("assemblies/loop_of_four", "made unlike")):
        out = tmp_path / "report.html"
        result = run("report", f"problems/{name}.toml", "--no-certify", "--out", str(out))
        assert (result.exit_code, "internal: ZeroDivisionError" in result.stderr) == (INTERNAL, True)
        text = out.read_text(encoding="utf-8")
        assert "internal: ZeroDivisionError: planted here" in text
        assert other in text


def test_an_interrupt_is_one_word(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        signal.raise_signal(signal.SIGINT)

    monkeypatch.chdir(TOP)
    monkeypatch.setattr(solved, "solved_case", interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
    result = run("solve", BOXES)
    signal.signal(signal.SIGINT, before)
    # on a cold start it says before what it is at, every few seconds
    said = [line for line in result.stderr.splitlines() if not line.startswith("still ")]
    assert (result.exit_code, said) == (INTERRUPTED, ["interrupted"])


def test_a_report_that_was_interrupted_left_no_page(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The case that was done is there, and the page says which is missing."""
    answered, count = solved.solved_case, [0]

    def once(*asked: Any, **how: Any) -> Any:
        count[0] += 1
        if count[0] > 1:
            signal.raise_signal(signal.SIGINT)
        return answered(*asked, **how)

    monkeypatch.chdir(TOP)
    monkeypatch.setattr(solved, "solved_case", once)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    result = run("report", "problems/assemblies/loop_of_four.toml", "--no-certify", "--out", str(tmp_path / "r.html"))
    signal.signal(signal.SIGINT, before)
    assert result.exit_code == INTERRUPTED
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert re.findall(r'<article id="case-\d+"', page) == ['<article id="case-0"']
    assert "case &#39;key 2 % too large&#39;: left out: interrupted." in page


@pytest.mark.slow
@pytest.mark.parametrize("library", ["numpy.exceptions", "numba.core.types", "scipy.sparse"])
def test_an_interrupt_while_libraries_load_ends_a_command_without_a_traceback(library: str) -> None:
    """It was swallowed by some of them, and others crashed."""
    asked = ["solve", "--certify", str(TOP / "problems/dovetail.toml")]
    command = [sys.executable, "-X", "importtime", "-m", "fcdm_opt", *asked]
    begun = subprocess.Popen(
        command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )  # fmt: skip
    assert begun.stderr is not None
    assert any(line.split()[-1:] == [library] for line in iter(begun.stderr.readline, ""))
    begun.send_signal(signal.SIGINT)
    said = begun.communicate(timeout=PATIENCE)[1]
    assert begun.returncode in (INTERRUPTED, -signal.SIGINT)
    assert "Traceback" not in said


def test_an_interrupt_was_not_heard_while_a_library_was_busy() -> None:
    """CoACD cuts a mesh for minutes without returning to Python; here a wait in C that signals do not end."""
    busy = """if True:
        import ctypes, os, signal, threading
        from fcdm_opt.cli import guarding
        guarding.GRACE = 0.2
        signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background job ignores it
        lock, mutex = ctypes.CDLL(None).pthread_mutex_lock, ctypes.create_string_buffer(64)
        with guarding.guarded():
            threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
            lock(mutex), lock(mutex)  # the second waits for ever
        """
    done = subprocess.run([sys.executable, "-c", busy], text=True, capture_output=True, timeout=PATIENCE, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (INTERRUPTED, "", "interrupted\n")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are no copies here")
def test_a_command_that_failed_beside_a_process_that_it_began_hung() -> None:
    """That had a copy of the pipe by which interrupts are heard, which was read until all copies were closed."""
    failing = """if True:
        import os, time, typer
        from fcdm_opt.cli import guarding
        try:
            with guarding.guarded():
                if not (child := os.fork()):
                    time.sleep(1000.0)
                raise ValueError("as an example")
        except typer.Exit as end:
            os.kill(child, 9)
            os._exit(end.exit_code)
        """
    run = [sys.executable, "-c", failing]
    done = subprocess.run(run, text=True, capture_output=True, timeout=PATIENCE, check=False)
    assert done.returncode == INTERNAL
    assert done.stderr.startswith("error: internal: ValueError: as an example")


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_was_a_traceback_where_json_is_asked_for() -> None:
    with open("/dev/full", "w") as full:
        done = process("solve", "none.toml", "--json", stdout=full)
        _, errors = done.communicate(timeout=PATIENCE)
    assert done.returncode == 2
    assert errors.splitlines()[-1] == "error: No space left on device"
    assert "Traceback" not in errors


@pytest.mark.slow
def test_a_reader_that_leaves_is_no_error() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = process("schema", stdout=writer)
    os.close(writer)
    _, errors = done.communicate(timeout=PATIENCE)
    told = [line for line in errors.splitlines() if not line.startswith("still ")]  # what a slow machine says meanwhile
    assert (done.returncode, told) == (BROKEN_PIPE, [])


# ---------------------------------------------------------------------------------------------------------------- range


def test_a_range_along_several_parameters_takes_the_motion_found(tmp_path: Path) -> None:
    """It was refused without --direction; a cube touches a table, and the motion found lifts it straight up."""
    path = tmp_path / "p.toml"
    path.write_text("""
        [bodies.movable]
        vertices = [[-1, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0], [-1, -1, 2], [1, -1, 2], [-1, 1, 2], [1, 1, 2]]
        [bodies.static]
        vertices = [[-9, -9, -2], [9, -9, -2], [-9, 9, -2], [9, 9, -2], [-9, -9, 0], [9, -9, 0], [-9, 9, 0], [9, 9, 0]]
        [[case]]
        name = "a"
        motion = [{ translation = "z" }, { translation = "x" }]
        requirement = "A"
        tolerance = 0.02
        """)
    result = run("range", path, "--json")
    assert result.exit_code == 0
    assert "no --direction given; along the motion found, TZ 0.04 + TX" in result.stderr
    (case,) = json.loads(result.stdout)["files"][0]["cases"]
    assert case["direction"]["TZ"] == pytest.approx(0.04)
    path.write_text(
        path.read_text().replace('requirement = "A"', "target = [1.0, 1.0]").replace("tolerance = 0.02", "")
    )
    refused = run("range", path)
    assert refused.exit_code == 2
    assert "solved without any motion; found 'none'; allowed: NAME=VALUE,... as TZ=1,TX=1" in refused.stderr


def test_a_range_of_an_assembly_passed_a_third_part_and_a_keep_out_without_a_word(tmp_path: Path) -> None:
    """A cube slides on a plate through a post, a part that it has no contact with, and then through a keep-out."""
    part = '[[part]]\nname = "{}"\nvertices = {}\n'
    boxes = {"plate": (-9, 9, -9, 9, -1, 0), "cube": (-1, 1, -1, 1, 0, 2), "post": (3, 4, -2, 2, 0.5, 9)}
    text = "".join(part.format(name, corners(*ends)) for name, ends in boxes.items())
    text = text.replace('name = "cube"', 'name = "cube"\nmotion = [{ translation = "x" }, { translation = "z" }]')
    text += f'[[keep_out]]\nname = "rib"\nvertices = {corners(6, 7, -2, 2, 0.5, 9)}\n'
    path = tmp_path / "a.toml"
    path.write_text(text + '[[contact]]\nparts = ["cube", "plate"]\n[[case]]\nname = "as drawn"\n')
    result = run("range", path, "--direction", "cube.TX=1")
    assert result.exit_code == 0
    said = flat(result.stdout)
    assert "- as made, cube - post: apart up to cube.TX 2, overlapping up to cube.TX 5, apart beyond" in said
    assert "- as made, cube - rib: apart up to cube.TX 5, overlapping up to cube.TX 8, apart beyond" in said


def corners(*ends: float) -> list[list[float]]:
    x, y, z = ends[:2], ends[2:4], ends[4:]
    return [[a, b, c] for a in x for b in y for c in z]


def flat(text: str) -> str:
    return " ".join(text.split())


def test_what_is_still_done_stood_after_the_error(monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    monkeypatch.setattr(helping, "ELSEWHERE", 0.15)
    monkeypatch.setattr(helping, "REFRESH", 0.01)
    with helping.shown():
        pacing.at("looking how the parts lie")
        refuse(InputError("wrong"))
        sleep(0.4)
    assert capsys.readouterr().err == "error: wrong\n"
