"""Words of this package, each in a line: README lists `WORDS`; reports show all on hover, and print some."""

from __future__ import annotations

WORDS = {
    "seed": "the datum of a part: the point that stays where it is when the part comes out larger or smaller",
    "requirement": "which corner of the tolerances is asked about: A both parts larger, B movable larger and static "
    "smaller, C the reverse, D both smaller",
    "pair made": "the two parts as they came out, at the sizes asked about",
    "amount": "how far the part is moved: a shift as its length, a turn as the way of a point half a diagonal away",
    "proved": "no smaller motion does: shown by computation with error bounds; with certify checked by separate code, "
    "or the answer says that it is not",
    "beyond": "goal: the contact drawn still holds when both sizes are off by all that is asked; the parts made may "
    "have a gap",
    "clear": "goal: the parts made do not overlap, and keep a clearance where one is asked for",
    "seat": "goal: faces that lie on one another as drawn do so again",
    "tracked contact": "the contact as drawn, followed while the part moves",
    "rho": "size of a part over its size as drawn: 1.02 is 2 % larger; rho_1 the movable part, rho_2 the static one",
    "switching point": "a pair of sizes at which the contact changes from one pair of features to another",
    "F1F2": "what touches: F a face, E an edge, V a corner; 1 of the movable, 2 of the static part; then its corners",
}

EXPLAINED = {
    **WORDS,
    "at": "goal: the contact drawn holds at exactly the sizes made",
    "touch": "goal: the parts made touch, wherever they meet first",
    "fit": "goal: none of several contacts overlaps, and the largest of their gaps is least",
    "published": "a motion that the file gives to compare with, as a paper or a hand calculation has it",
}
"""These, and what the README leaves out."""
