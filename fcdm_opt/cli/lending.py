"""Commands that another distribution brings: found by their entry points when they are used, not before."""

from __future__ import annotations

from importlib.metadata import entry_points
from typing import Any

import typer

from fcdm_opt.cli.helping import Command
from fcdm_opt.errors import InputError

GROUP = "fcdm_opt.commands"
"""Entry points: name of a command -> the function that is the command."""
INSTALL = "needs the package fcdm_opt_benchmarks: pip install -e benchmarks, in a copy of the repository"


class LentCommand(Command):
    """A command of which only the name, a sentence and examples are known until it is used."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        """Return the context of the command itself.

        Raises
        ------
        InputError
            Where it is not installed; while a shell completes words, nothing is completed instead.
        """
        points = entry_points(group=GROUP, name=self.name or "")
        if not points:
            if extra.get("resilient_parsing"):
                return super().make_context(info_name, args, parent, **extra)
            raise InputError(INSTALL, key=self.name)
        alone = typer.Typer(add_completion=False, rich_markup_mode=None)
        alone.command(self.name, cls=Command, epilog=self.epilog)(next(iter(points)).load())
        return typer.main.get_command(alone).make_context(info_name, args, parent, **extra)
