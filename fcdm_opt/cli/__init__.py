"""`fcdm-opt`: parses, calls, prints; no mathematics.

Nothing heavy is imported before it is needed: `--help` loads no numerical library.
"""

from __future__ import annotations

import gc
import os
import sys
from typing import Annotated, Any

import typer

from fcdm_opt import process_pool
from fcdm_opt.cli import designing, reporting, solving, starting
from fcdm_opt.cli.helping import Command, LentCommand, Overview

COLLECTED = 100_000, 50, 50
"""Thresholds of the garbage collector, of which a short run over many small objects makes little."""

COMMANDS: dict[str, dict[str, Any]] = {
    "How do I begin?": {
        "init": starting.init_command,
        "schema": starting.schema_command,
        "warmup": starting.warmup_command,
    },
    "How do the parts touch, and what is the smallest motion?": {
        "curve": solving.curve_command,
        "solve": solving.solve_command,
        "range": solving.range_command,
        "report": reporting.report_command,
    },
    "What if sizes, tolerances, motions or shapes were different?": {
        "whatif": designing.whatif_command,
        "map": designing.map_command,
        "pose": designing.pose_command,
        "faces": designing.faces_command,
        "stack": designing.stack_command,
        "study": designing.study_command,
    },
    "How fast and how right is it?": {
        "bench": "Chart speed against accuracy.",
        "stability": "Map where each method fails.",
    },
}
"""By question: the commands that answer it, each with its function.

A sentence in place of a function: the package `fcdm_opt_benchmarks` brings it, see `LentCommand`.
"""

EXAMPLES = """\
fcdm-opt init problems/meshes/keyway_key.off problems/meshes/keyway_shaft.ply
fcdm-opt init peg.stl plate.stl --unit mm --out peg.toml --force
fcdm-opt schema > problem.schema.json
fcdm-opt schema --what study > study.schema.json
fcdm-opt warmup
fcdm-opt curve problems/example1.toml
fcdm-opt curve problems/example1.toml --out out
fcdm-opt solve problems/example1.toml problems/example2.toml
fcdm-opt solve problems/example1.toml --case B --certify --out out
fcdm-opt solve problems/peg_square.toml --case "A at the wall" --json
fcdm-opt solve problems/assemblies/loop_of_four.toml --out out
fcdm-opt range problems/example1.toml --case A
fcdm-opt range problems/example1.toml --case B --direction TZ=1,RZ_deg=2
fcdm-opt report problems/example1.toml --out report.html
fcdm-opt whatif problems/peg_tapered.toml --case A
fcdm-opt whatif problems/peg_tapered.toml --case B --set tolerance=0.02
fcdm-opt whatif problems/peg_tapered.toml --case A --budget 0.1 --compare
fcdm-opt whatif problems/peg_square_tight.toml --conflicts
fcdm-opt map problems/peg_tapered.toml --case A --out out
fcdm-opt map problems/peg_tapered.toml --case A --budget 1 --out out
fcdm-opt pose problems/peg_tapered.toml --case A
fcdm-opt pose problems/peg_tapered.toml --case A --clearance=-inf,0.5
fcdm-opt faces problems/slot_and_key.toml
fcdm-opt stack problems/slot_and_key.toml
fcdm-opt stack problems/slot_and_key.toml --gap 0.04,0.12 --out out
fcdm-opt stack problems/slot_and_key.toml --gap 0.04,0.12 --cost key_width=1
fcdm-opt study problems/studies/tolerance_example1.toml --out out/tolerance
fcdm-opt bench --quick --only contact --out out/bench
fcdm-opt stability --quick --out out/stability
"""
"""What the help of each command ends with; all of them run as they stand."""

app = typer.Typer(
    name="fcdm-opt",
    cls=Overview,
    add_completion=True,
    invoke_without_command=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["--help", "-h"]},
    help="Find the smallest re-positioning of contacting polyhedral parts under size tolerances.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from fcdm_opt.version import __version__

        typer.echo(f"fcdm-opt {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
    debug: Annotated[
        bool, typer.Option("--debug", help="Show the traceback of every error; may stand anywhere in the line.")
    ] = False,
) -> None:
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


for _question, _commands in COMMANDS.items():
    for _name, _command in _commands.items():
        _lines = [line for line in EXAMPLES.splitlines() if line.split(" ")[1] == _name]
        _about: Any = {"epilog": "\n".join(_lines), "rich_help_panel": _question}
        if isinstance(_command, str):
            app.command(_name, cls=LentCommand, help=_command, **_about)(lambda: None)
        else:
            app.command(_name, cls=Command, **_about)(_command)


def main() -> None:
    """Entry point of the command `fcdm-opt`."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed: what is printed goes nowhere, and never into the next file opened
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # names in any script, on terminals of any
            stream.reconfigure(errors="backslashreplace")
    gc.set_threshold(*COLLECTED)
    process_pool.allow()
    app(prog_name="fcdm-opt")
