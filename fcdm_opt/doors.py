"""The one door upwards: what a result offers that packages above its own work out, found by name when asked for."""

from __future__ import annotations

from importlib import import_module
from typing import Any


def upper(place: str) -> Any:
    """Return what stands at "package.module:name" of fcdm_opt."""
    module, name = place.split(":")
    return getattr(import_module(f"fcdm_opt.{module}"), name)


class Shown:
    """Base of the results that notebooks show as a card, see `fcdm_opt.show.cards`."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        """Return a card for a notebook."""
        made: str = upper("show.cards:card_of")(self)
        return made
