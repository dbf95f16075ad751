"""What is imported when asked for: what packages above a result's own work out, and libraries that are extras."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from fcdm_opt.errors import InputError


def imported(place: str) -> Any:
    """Return what stands at "package.module:name" of fcdm_opt."""
    module, name = place.split(":")
    return getattr(import_module(f"fcdm_opt.{module}"), name)


INSTALL = ".venv/bin/pip install -c constraints.txt -e '.[{}]'"  # how README has what is needed installed


def extra(module: str, of: str, *, key: str | None = None, found: Any = None, needing: str = "") -> Any:
    """Import a library that is installed with an extra of this project, `of` `project.optional-dependencies`.

    Raises `InputError`, which says what to install, where it cannot be loaded. `key` and `found` are what asked for it,
    as `InputError` says it; `needing` is what needs it, in words, "" where the key tells.
    """
    try:
        return import_module(module)
    except ImportError as reason:
        name = module.partition(".")[0]
        done = INSTALL.format(of)
        what = f"{needing}needs the extra {of}: {name} cannot be loaded ({reason}); in this project's folder, {done}"
        raise InputError(what, key=key, found=found) from reason


class NotebookRepr:
    """Base of the results that notebooks show as a card, see `fcdm_opt.show.cards`."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return a card for a notebook."""
        return imported("show.cards:card_of")(self)
