"""What is measured: a method answers questions about a subject, at one of its own accuracy settings."""

from __future__ import annotations

import runpy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array
from fcdm_opt.geometry.bodies import Body

Touching = tuple[tuple[int, ...], tuple[int, ...]]  # 0-based vertices of part 1 and part 2 that carry a contact, sorted
Ask = Callable[[Sequence[Any]], list[Any]]


class Pair(NamedTuple):
    """Two bodies of one convex part each, the subject of questions about contacts and curves."""

    movable: Body
    static: Body


class ContactQuestion(NamedTuple):
    """The least scale of body 2 at which it touches body 1 of scale `rho1`, moved by `transform`."""

    transform: Array
    rho1: float


class ContactAnswer(NamedTuple):
    """The scale of body 2, and what touches where the method tells."""

    rho2: float
    touching: Touching | None = None


class CurveQuestion(NamedTuple):
    """The decision curve in a box, body 1 moved by `transform`."""

    transform: Array
    box: Array


class CurveAnswer(NamedTuple):
    """Scale pairs by increasing rho_1, (k, 2); the curve, or what the method knows of it, is the polyline through them.

    `touching`: what touches along each of its k - 1 pieces, where the method tells.
    """

    points: Array
    touching: tuple[Touching, ...] | None = None


class MotionAnswer(NamedTuple):
    """Motion parameters in order, (k,), and their amount."""

    q: Array
    amount: float


@dataclass(frozen=True)
class Failure:
    """What a method gives where it has no answer: why, in its own words."""

    reason: str


def anything(subject: Any) -> str | None:
    """Take every subject."""
    return None


@dataclass(frozen=True)
class Method:
    """A way to answer questions: one function and one row of a table `METHODS`.

    Attributes
    ----------
    name : str
    family : str
        Whose method it is, "ours" or the library's name: one colour in the pictures.
    settings : mapping
        What the method calls accuracy: label -> value that `prepare` gets, coarse to fine. One label at least.
    prepare : callable
        (subject, setting) -> function from a sequence of questions to the list of their answers, one each, `Failure`
        where there is none. What depends on the subject alone is made here, its time is reported as set-up; what
        depends on a question must not be known before it is asked.
    refuses : callable
        Subject -> why the method is not asked about it, or None.
    """

    name: str
    family: str
    settings: Mapping[str, Any]
    prepare: Callable[[Any, Any], Ask]
    refuses: Callable[[Any], str | None] = anything

    @property
    def ours(self) -> bool:
        """Whether it is the toolkit's own."""
        return self.family == "ours"


def settings(*labels: str) -> dict[str, float]:
    """Return settings that are numbers, by how they are written."""
    return {label: float(label) for label in labels}


def one_by_one(answer: Callable[[Any], Any]) -> Ask:
    """Return the function that answers questions one after the other; what it raises is a `Failure`."""

    def ask(questions: Sequence[Any]) -> list[Any]:
        made = []
        for question in questions:
            try:
                with np.errstate(all="ignore"):
                    made.append(answer(question))
            except Exception as reason:  # a rival library may raise anything: it is counted, not passed on
                made.append(Failure(f"{type(reason).__name__}: {reason}"))
        return made

    return ask


def read_methods(path: Path, known: Mapping[str, Sequence[Method]]) -> dict[str, tuple[Method, ...]]:
    """Return the methods of a Python file, which is run: its `METHODS`, a dict of lists by task.

    Parameters
    ----------
    path : Path
    known : mapping
        Task -> the methods that are there already, whose names are taken.

    Raises
    ------
    InputError
        Names the file, and what is wrong with its methods.
    """
    try:
        found = runpy.run_path(str(path)).get("METHODS")
    except Exception as reason:  # whatever a file may raise
        raise InputError(f"cannot be run: {type(reason).__name__}: {reason}", file=path) from reason
    allowed = f"METHODS = {{task: [Method(...)]}} with tasks among {', '.join(known)}"
    if not isinstance(found, Mapping) or not found or not {*found} <= {*known}:
        told = found if found is None else list(found) if isinstance(found, Mapping) else type(found).__name__
        raise InputError("no methods in the file", file=path, key="METHODS", found=told, allowed=allowed)
    for task, methods in found.items():
        names = [own.name for own in known[task]]
        for own in methods:
            if not isinstance(own, Method) or own.ours or own.name in names:
                allowed = "a Method with a name that none has yet, and a family other than ours"
                raise InputError("unusable method", file=path, key=f"METHODS.{task}", found=own, allowed=allowed)
            names.append(own.name)
    return {task: tuple(methods) for task, methods in found.items()}
