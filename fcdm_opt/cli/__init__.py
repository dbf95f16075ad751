"""`fcdm-opt`: parses, calls, prints; no mathematics.

Nothing heavy is imported before it is needed: `--help` loads no numerical library.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Annotated, Any, ClassVar

import typer

from fcdm_opt.cli import designing, reporting, solving, starting
from fcdm_opt.cli.helping import Command, Overview
from fcdm_opt.cli.lending import LentCommand

COMMANDS: dict[str, tuple[tuple[str, Callable[..., Any] | str, str], ...]] = {
    "How do I begin?": (
        (
            "init",
            starting.init_command,
            "fcdm-opt init problems/meshes/keyway_key.off problems/meshes/keyway_shaft.ply\n"
            "fcdm-opt init peg.stl plate.stl --unit mm --out peg.toml --force",
        ),
        (
            "schema",
            starting.schema_command,
            "fcdm-opt schema > problem.schema.json\nfcdm-opt schema --what study > study.schema.json",
        ),
    ),
    "How do the parts touch, and what is the smallest motion?": (
        (
            "curve",
            solving.curve_command,
            "fcdm-opt curve problems/example1.toml\nfcdm-opt curve problems/example1.toml --out out",
        ),
        (
            "solve",
            solving.solve_command,
            "fcdm-opt solve problems/example1.toml problems/example2.toml\n"
            "fcdm-opt solve problems/example1.toml --case B --certify --out out\n"
            'fcdm-opt solve problems/peg_square.toml --case "A at the wall" --json',
        ),
        (
            "range",
            solving.range_command,
            "fcdm-opt range problems/example1.toml --case A\n"
            "fcdm-opt range problems/example1.toml --case B --direction TZ=1,RZ_deg=2",
        ),
        (
            "report",
            reporting.report_command,
            "fcdm-opt report problems/example1.toml --out report.html",
        ),
    ),
    "What if sizes, tolerances, motions or shapes were different?": (
        (
            "whatif",
            designing.whatif_command,
            "fcdm-opt whatif problems/peg_tapered.toml --case A\n"
            "fcdm-opt whatif problems/peg_tapered.toml --case B --set tolerance=0.02\n"
            "fcdm-opt whatif problems/peg_tapered.toml --case A --budget 0.1 --compare\n"
            "fcdm-opt whatif problems/peg_square_tight.toml --conflicts",
        ),
        (
            "map",
            designing.map_command,
            "fcdm-opt map problems/peg_tapered.toml --case A --out out\n"
            "fcdm-opt map problems/peg_tapered.toml --case A --budget 1 --out out",
        ),
        (
            "pose",
            designing.pose_command,
            "fcdm-opt pose problems/peg_tapered.toml --case A\n"
            "fcdm-opt pose problems/peg_tapered.toml --case A --clearance=-inf,0.5",
        ),
        (
            "study",
            designing.study_command,
            "fcdm-opt study problems/studies/tolerance_example1.toml --out out/tolerance",
        ),
    ),
    "How fast and how right is it?": (
        (
            "bench",
            "Chart speed against accuracy.",
            "fcdm-opt bench --quick --only contact --out out/bench",
        ),
        (
            "stability",
            "Map where each method fails.",
            "fcdm-opt stability --quick --out out/stability",
        ),
    ),
}
"""By question: a command's name, its function, and examples that run as they stand, one a line.

A sentence in place of a function: the package `fcdm_opt_benchmarks` brings it, see `LentCommand`.
"""


class _Commands(Overview):
    """The commands of the table above."""

    questions: ClassVar = {question: [row[0] for row in rows] for question, rows in COMMANDS.items()}


app = typer.Typer(
    name="fcdm-opt",
    cls=_Commands,
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


for _rows in COMMANDS.values():
    for _name, _command, _examples in _rows:
        if isinstance(_command, str):
            app.command(_name, cls=LentCommand, help=_command, epilog=_examples)(lambda: None)
        else:
            app.command(_name, cls=Command, epilog=_examples)(_command)


def main() -> None:
    """Entry point of the command `fcdm-opt`."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed: what is printed goes nowhere, and never into the next file opened
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # names in any script, on terminals of any
            stream.reconfigure(errors="backslashreplace")
    app(prog_name="fcdm-opt")
