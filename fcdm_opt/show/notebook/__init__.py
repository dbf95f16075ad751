"""What a notebook shows of a result: a small card of words and numbers, and a picture of the package beside them.

A card is one piece of HTML that depends on nothing: no script, no style sheet, no identifier, nothing from outside.
Notebook viewers drop all of these; what is left even without inline styles can still be read. Words take the colour of
the page, light or dark, and no state is told by colour alone. Equal results give equal bytes. `cards` and
`design_cards` gather what a card says as plain values; the template `card.html` escapes them.
"""

from __future__ import annotations

from fcdm_opt.doors import Shown, upper

CARDS = {
    "Body": "cards:body_card",
    "DecisionCurve": "cards:curve_card",
    "Problem": "cards:problem_card",
    "Solution": "cards:solution_card",
    "Certificate": "cards:certificate_card",
    "CoherentRange": "cards:range_card",
    "WhatIf": "design_cards:whatif_card",
    "AssemblyYield": "design_cards:yield_card",
    "CompensationMap": "design_cards:map_card",
    "BestPose": "design_cards:best_pose_card",
    "Clearances": "design_cards:clearances_card",
    "StudyResult": "design_cards:study_card",
}
"""The function of this package that says what stands on each class's card."""


def card_of(result: Shown) -> str:
    """Return the card of a result."""
    name = next(CARDS[base.__name__] for base in type(result).__mro__ if base.__name__ in CARDS)
    html: str = upper(f"show.notebook.{name}")(result).html
    return html
