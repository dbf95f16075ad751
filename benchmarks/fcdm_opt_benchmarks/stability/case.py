"""A hard case, what a method says of it, and what that is worth: plain data, so that it can be sent and saved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

WRONG_BEYOND = 1e-6  # relative: an answer off by more, given without a word, is silently wrong
Outcome = Literal["right", "flagged", "wrong", "hung", "crashed"]


@dataclass(frozen=True)
class HardCase:
    """One input of the stability map.

    Attributes
    ----------
    family : str
        Row of the map.
    name : str
        Tells it from the others of its family; name and family stay the same from run to run.
    question : "contact", "body", "program" or "motion"
        What is asked: the module of `stability` that knows methods and truth.
    data : mapping
        Everything that a method is given; plain JSON.
    truth : mapping
        The right answer, from exact arithmetic, a closed form or an invariance; plain JSON. `source` says which.
    """

    family: str
    name: str
    question: str
    data: Mapping[str, Any]
    truth: Mapping[str, Any]


@dataclass(frozen=True)
class Grade:
    """What an answer is worth.

    Attributes
    ----------
    outcome : "right", "flagged", "wrong", "hung" or "crashed"
        Flagged: the method says itself that it has no answer, or none to rely on. Wrong: silently.
    error : float or None
        Largest relative error, where there is a number to compare.
    reason : str
        What the method said, or what is wrong.
    """

    outcome: Outcome
    error: float | None = None
    reason: str = ""
