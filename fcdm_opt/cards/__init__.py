"""What a notebook shows of a result: a small card of words, numbers and lines in the plane of scales.

A card is one piece of HTML that depends on nothing: no script, no style sheet, no identifier, nothing from outside.
Notebook viewers drop all of these; what is left even without inline styles can still be read. Text takes the colour of
the page, light or dark, and no state is told by colour alone. Equal results give equal bytes, and every text that
comes from a user is escaped by the pieces below, which are all that make `Html`.
"""

from fcdm_opt.cards.pictures import Area, Line, Mark, Point, drawing, plane
from fcdm_opt.cards.words import Html, card, counted, floored, listing, number, numbers, rows, sentence, table

__all__ = [
    "Area",
    "Html",
    "Line",
    "Mark",
    "Point",
    "card",
    "counted",
    "drawing",
    "floored",
    "listing",
    "number",
    "numbers",
    "plane",
    "rows",
    "sentence",
    "table",
]
