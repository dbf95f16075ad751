"""What a card holds, as plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fcdm_opt.show.notebook.pictures import Picture
from fcdm_opt.show.rendering import rendered

Fact = tuple[str, ...]  # name, value, and a unit or remark where there is one
Rows = tuple[Sequence[str], Sequence[Sequence[object]]]

LISTED = 12
"""Lines of a list or table that are shown; how many more there are is said."""


@dataclass(frozen=True)
class Card:
    """A card, from its top to its bottom; texts are plain.

    Attributes
    ----------
    title : str
    said : str
        A sentence below it.
    facts : sequence of (name, value) or (name, value, unit)
        Those without a value are left out.
    tables : sequence of (heads, lines)
    lists : dict
        Lines by the name of their list.
    state : str
        In a badge beside the title, with a sign before it that tells the mood.
    mood : {"good", "bad", "mind", ""}
    picture : Picture, optional
        Beside all that, or below it where the page is narrow.
    most : int
        Lines of a list or table that are shown.
    """

    title: str
    said: str = ""
    facts: Sequence[Fact] = ()
    tables: Sequence[Rows] = ()
    lists: Mapping[str, Sequence[str]] = field(default_factory=dict)
    state: str = ""
    mood: str = ""
    picture: Picture | None = None
    most: int = LISTED

    @property
    def html(self) -> str:
        """The card as one line of HTML."""
        card = {**vars(self), "facts": [fact for fact in self.facts if fact[1]]}
        return "".join(map(str.strip, rendered("card.html", card=card).split("\n")))
