"""`fcdm-opt`: parses, calls, prints; no mathematics.

Nothing heavy is imported before it is needed: `--help` loads no numerical library.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from fcdm_opt.cli import designing, measuring, solving

app = typer.Typer(
    name="fcdm-opt",
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    help="Smallest re-positioning of contacting polyhedral parts under size tolerances.",
    epilog="Exit codes: 0 all well, 1 a case without a motion, 2 bad input, 3 a motion that was not verified.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        import fcdm_opt

        typer.echo(f"fcdm-opt {fcdm_opt.__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


for _name, _command in (
    ("curve", solving.curve_command),
    ("solve", solving.solve_command),
    ("range", solving.range_command),
    ("study", designing.study_command),
    ("whatif", designing.whatif_command),
    ("map", designing.map_command),
    ("pose", designing.pose_command),
    ("bench", measuring.bench_command),
    ("stability", measuring.stability_command),
):
    app.command(_name)(_command)


def main() -> None:
    """Entry point of the command `fcdm-opt`."""
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # closed: what is printed goes nowhere, and never into the next file opened
            setattr(sys, name, open(os.devnull, "w"))  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # names in any script, on terminals of any
            stream.reconfigure(errors="backslashreplace")
    app(prog_name="fcdm-opt")
