"""`fcdm-opt`: parses, calls, prints; no mathematics.

Nothing heavy is imported before it is needed: `--help` loads no numerical library.
"""

from __future__ import annotations

import gc
import os
import sys
from typing import Annotated, Any

import typer

from fcdm_opt import pacing, process_pool
from fcdm_opt.cli import designing, solving, starting
from fcdm_opt.cli.helping import Command, LentCommand, Overview
from fcdm_opt.cli.registry import ROWS

MODULES = designing, solving, starting

COLLECTED = 100_000, 50, 50
"""Thresholds of the garbage collector, of which a short run over many small objects makes little."""

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


for _name, _row in ROWS.items():
    _about: Any = {"epilog": _row.lines(_name), "rich_help_panel": _row.question}
    if _row.lent:
        app.command(_name, cls=LentCommand, help=_row.lent, **_about)(lambda: None)
    else:
        _module = next(own for own in MODULES if hasattr(own, f"{_name}_command"))
        app.command(_name, cls=Command, **_about)(getattr(_module, f"{_name}_command"))


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
    try:
        with pacing.listening(starting.compile_others_meanwhile):
            app(prog_name="fcdm-opt")
    finally:
        starting.compile_in_background()
