"""`init`, `schema`, `warmup`: a first problem file from two meshes, what such files may hold, and compiled kernels."""

from __future__ import annotations

import json
import operator
import os
import subprocess
import sys
from contextlib import suppress
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, cast

import typer

from fcdm_opt import pacing, process_pool
from fcdm_opt.cli.common import LENGTH, OUTPUT, Time, argument, option
from fcdm_opt.cli.guarding import manner, say
from fcdm_opt.cli.registry import ROWS
from fcdm_opt.errors import InputError, known_word

if TYPE_CHECKING:
    from fcdm_opt.geometry.units import Unit

KINDS = "STL, OBJ, PLY, OFF, GLB or STEP"
SUFFIX = ".toml"
BACKGROUND, NICE = "FCDM_OPT_BACKGROUND", 10
FILE = "File to write. Default: MOVABLE-STATIC.toml here."
UNIT = 'Unit of all lengths: m, cm, mm, um, in or ft. Default: "mm".'
CHORD = "How far triangles may leave curved faces of STEP files at most, in that unit."
KIND = (
    '"problem", "study" or "assembly"; or what a command writes with --json: "result" of solve, "study-result", '
    '"curve", "range", "whatif", "map", "pose", "faces", "stack".'
)


def init_command(
    movable: Annotated[Path, argument("MOVABLE", f"Mesh file of the part that moves: {KINDS}.")],
    static: Annotated[Path, argument("STATIC", "Mesh file of the part at rest, likewise.")],
    out: Annotated[Path | None, option("--out", "TOML", FILE, OUTPUT)] = None,
    unit: Annotated[str | None, option("--unit", "UNIT", UNIT)] = None,
    deviation: Annotated[float | None, option("--deviation", "LENGTH", CHORD, check=LENGTH)] = None,
    force: Annotated[bool, option("--force", None, "Overwrite the file if it is there.", OUTPUT)] = False,
    time: Time = None,
) -> None:
    """Write a commented problem file from two mesh files, as drawn in one frame.

    Looks at where the parts are (apart, touching, overlapping), chooses goal and motion, and solves each case once.
    """
    from fcdm_opt.drafting.draft import draft, own_name, quoted
    from fcdm_opt.moved_files import write

    if movable.exists() and static.exists() and movable.samefile(static):
        allowed = f'two mesh files, or two solids of one by their names, "{static.name}#NAME"'
        raise InputError("both parts are of the same file", key="STATIC", found=str(static), allowed=allowed)
    path = Path(own_name(movable, static, SUFFIX)) if out is None else out
    _check_place(path, (movable, static), force)
    made = draft(movable, static, file=path, unit=cast("Unit | None", unit), deviation=deviation)
    with suppress(OSError):  # what is wrong with it is said when the file is written
        path.parent.mkdir(parents=True, exist_ok=True)
    write(path, made.text)
    say(f"wrote {path}")
    for line in made.summary:
        typer.echo(line)
    typer.echo(f"next: fcdm-opt solve {quoted(path)}")


def schema_command(what: Annotated[str, option("--what", "KIND", KIND)] = "problem") -> None:
    """Print the JSON Schema of a kind of file, or of what a command writes with --json, by which both are checked.

    Save it beside the files and begin each with the line "#:schema problem.schema.json": editors with Even Better
    TOML (taplo) then complete keys, show what they mean, and mark what is wrong.
    """
    from fcdm_opt.design.study.schema import KINDS, json_schema, result_schema

    results = {name + "-result" * (name in KINDS): name for name, row in ROWS.items() if row.answers}
    known_word(what, (*KINDS, *results), "no such kind", key="--what")
    row = ROWS[results[what]] if what in results else None
    schema = result_schema(results[what], row.kinds(), row.about) if row else json_schema(what)
    typer.echo(json.dumps(schema, indent=2, ensure_ascii=False))


def warmup_command(background: Annotated[bool, typer.Option("--background", hidden=True)] = False) -> None:
    """Compile the numerical kernels now and keep them.

    Without it, the first command that needs some has all others compiled in the background, at low priority.
    About three minutes the first time, on two cores; a few seconds where all are kept already.
    """
    from fcdm_opt import compiling
    from fcdm_opt.design import warming

    start = perf_counter()
    if not compiling.compiles_all() and background:
        return
    if background:
        compiling.stay_behind(NICE)
    try:
        with pacing.working_on("warmup"):
            pacing.at("compiling what all commands share, for the first time: about three minutes in all")
            warming.shared()
            groups = _moved, warming.sized
            for done, result in enumerate(process_pool.each(operator.call, groups), 1):
                result()
                pacing.at("compiling", done, len(groups))
    finally:
        compiling.all_kept(note=True)  # or not to be had: nobody tries again
    typer.echo(f"the numerical kernels are compiled and kept for later runs, in {perf_counter() - start:.0f} s")


def compile_others_meanwhile(doing: str, *_: int) -> None:
    """Listen to what is being done: with the first kernel that a command compiles, have all others compiled."""
    compiling = sys.modules.get("fcdm_opt.compiling")
    if compiling is not None and compiling.NOTICE in doing and manner.get().command != "warmup":
        compile_in_background()


@cache
def compile_in_background() -> None:
    """Have another process compile the kernels of all commands, from the first run on that needs some."""
    compiling = sys.modules.get("fcdm_opt.compiling")
    if os.environ.get(BACKGROUND) == "0" or compiling is None or compiling.all_kept():
        return
    place = Path(__file__).parents[2]
    with suppress(OSError):
        subprocess.Popen(
            [sys.executable, "-m", "fcdm_opt", "warmup", "--background"],
            cwd=place,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        say(f"numerical kernels of other commands are now compiled in the background ({BACKGROUND}=0 keeps from that)")


def _moved() -> None:
    from fcdm_opt.design import warming
    from fcdm_opt.show.album import solution_figure

    solution = warming.moved()
    with suppress(InputError):  # pictures are an extra
        solution_figure(solution)


def _check_place(path: Path, meshes: tuple[Path, Path], force: bool) -> None:
    """Refuse to write where something is that should stay."""
    if path.suffix.lower() != SUFFIX:
        raise InputError("not the name of a problem file", key="--out", found=str(path), allowed=f"a name in {SUFFIX}")
    if path.is_dir():
        raise InputError("a folder is there", key="--out", found=str(path), allowed="the name of a file")
    if path.exists() and any(mesh.exists() and path.samefile(mesh) for mesh in meshes):
        raise InputError("this is one of the meshes", key="--out", found=str(path), allowed="another name")
    if (path.exists() or path.is_symlink()) and not force:
        raise InputError("the file is there already", key="--out", found=str(path), allowed="another name, or --force")
