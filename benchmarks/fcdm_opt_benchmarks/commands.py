"""`bench` and `stability`: the charts of speed against accuracy, and the map of where methods fail."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Annotated

import typer

from fcdm_opt.cli.common import Seed, option, written
from fcdm_opt.cli.guarding import NOT_VERIFIED, SOLVED, say
from fcdm_opt.errors import InputError

if TYPE_CHECKING:
    from fcdm_opt_benchmarks.method import Method
    from fcdm_opt_benchmarks.record import BenchRun

WRITTEN = "Write results, tables and pictures into this folder."
LISTED = 3  # scenes in which a rival is ahead

Quick = Annotated[bool, typer.Option("--quick", help="Take the short form.")]
Ours = Annotated[
    bool,
    typer.Option("--ours", help="Ask our own methods alone: whether they are right, without rivals."),
]
Compare = Annotated[
    Path | None, typer.Option("--compare", metavar="OLD", help="Tell what changed since this earlier results file.")
]


def bench_command(
    out: Annotated[Path, option("--out", "DIR", WRITTEN, check=written())],
    quick: Quick = False,
    ours: Ours = False,
    seed: Seed = 1,
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="PART", help="contact, curve, motion, growth or models; may be repeated."),
    ] = None,
    method: Annotated[
        list[Path] | None,
        typer.Option("--method", metavar="FILE.py", help="Add the rivals in its METHODS; may be repeated."),
    ] = None,
    compare: Compare = None,
) -> None:
    """Chart speed against accuracy: every method at several settings, against exact references.

    The quick form takes about two minutes, the full form nearly an hour. A rival of your own is a file that defines
    METHODS = {"contact": [Method(...)]}, for "contact", "curve" or "motion".
    """
    from fcdm_opt_benchmarks import contacts, curves, motions
    from fcdm_opt_benchmarks.chart import bench, results
    from fcdm_opt_benchmarks.method import read_methods

    known = {"contact": contacts.METHODS, "curve": curves.METHODS, "motion": motions.METHODS}
    rivals: dict[str, tuple[Method, ...]] = {}
    for path in method or ():
        taken = {task: (*own, *rivals.get(task, ())) for task, own in known.items()}
        for task, own in read_methods(path, taken).items():
            rivals[task] = (*rivals.get(task, ()), *own)
    if ours and rivals:
        raise InputError("rivals are not asked with --ours", key="--method", found=str(method[0] if method else ""))
    old = _earlier(compare, "bench", out)
    run = bench.bench(quick=quick, seed=seed, only=only or bench.PARTS, rivals=rivals, ours=ours, say=say)
    _recorded(run, old, out, partial(results.write, run))
    typer.echo(results.summary(run, most=LISTED))
    raise typer.Exit(NOT_VERIFIED if bench.wrong(run) else SOLVED)


def stability_command(
    out: Annotated[
        Path | None,
        option("--out", "DIR", "Write results, tables, the map and failing inputs there.", check=written()),
    ] = None,
    quick: Quick = False,
    ours: Ours = False,
    seed: Seed = 1,
    replay: Annotated[
        Path | None, typer.Option("--replay", metavar="FILE", help="Show a saved failing input alone, asked again.")
    ] = None,
    compare: Compare = None,
) -> None:
    """Map where each method fails: families of hard cases, every method in a process of its own.

    The quick form takes about a minute, the full form about twenty.
    """
    from fcdm_opt_benchmarks.stability.failures import replay as asked_again
    from fcdm_opt_benchmarks.stability.grid import grid

    if (out is None) == (replay is None):
        given = "neither" if out is None else "both"
        allowed = "--out DIR for a run, or --replay FILE for one saved input"
        raise InputError("what to do is not given once", key="--out", found=given, allowed=allowed)
    if replay is not None:
        again = asked_again(replay)
        typer.echo(again.text)
        raise typer.Exit(SOLVED if again.now.outcome == "right" else NOT_VERIFIED)
    assert out is not None
    old = _earlier(compare, "stability", out)
    found = grid(quick=quick, seed=seed, ours=ours, say=say)
    _recorded(found.run, old, out, found.write)
    typer.echo(found.text)
    raise typer.Exit(NOT_VERIFIED if found.faults else SOLVED)


def _earlier(path: Path | None, command: str, out: Path) -> BenchRun | None:
    """Return the run that a new one is compared with; what cannot be compared or written is refused beforehand."""
    from fcdm_opt_benchmarks.record import BenchRun

    try:
        out.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=out):
            pass
    except OSError as reason:
        raise InputError(f"cannot be written ({reason.strerror})", key="--out", found=str(out)) from reason
    old = None if path is None else BenchRun.read(path)
    if old is not None and old.command != command:
        raise InputError("a run of another command", key="--compare", found=old.command, allowed=command)
    return old


def _recorded(run: BenchRun, old: BenchRun | None, out: Path, write: Callable[[Path], list[Path]]) -> None:
    """Write what a run found, and what changed since an earlier one."""
    from fcdm_opt_benchmarks.comparing import compared

    try:
        for path in write(out):
            say(f"wrote {path}")
        if old is not None:
            (out / "changes.md").write_text(compared(old, run).text + "\n", encoding="utf-8")
            typer.echo(compared(old, run).text)
    except OSError as reason:
        raise InputError(f"cannot be written ({reason.strerror})", key="--out", found=str(out)) from reason
