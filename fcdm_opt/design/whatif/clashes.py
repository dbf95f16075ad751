"""What is found out about a problem without a motion: clashes, relaxations, and trials of other questions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem.solution import Solution, Status


class PlainMotion(Plain):
    """Base of what has a `solution`, whose motion is told with it."""

    solution: Solution | None

    def to_dict(self) -> dict[str, Any]:
        """Return plain data with status, amount and parameters; nan becomes None and infinity "inf"."""
        motion: dict[str, Any] = {"status": None, "usable": False, "amount": None, "parameters": {}}
        if self.solution is not None:
            motion = {name: plain(getattr(self.solution, name)) for name in motion}
        told = super().to_dict()
        return {**told, **motion, **told}


@dataclass(frozen=True, kw_only=True)
class Clash(Plain):
    """A set of constraints with which alone the goal is impossible, while each can be dropped, or made its weaker one.

    Attributes
    ----------
    names : tuple of str
        As `constraints` names them; a keep-out's clearance includes the keep-out. Empty: the motion cannot do it at
        all.
    proved : bool
        Whether it is proved that no motion keeps them; otherwise none was found.
    status : Status
        How the solve with these alone ended.
    """

    names: tuple[str, ...]
    proved: bool
    status: Status


@dataclass(frozen=True, eq=False, kw_only=True)
class LeastRelaxation(PlainMotion):
    """The least relaxation of one constraint, all others kept, that makes the problem solvable.

    Attributes
    ----------
    name : str
    cures : bool
        Whether relaxing or dropping this constraint alone makes the problem solvable.
    by : float
        Least relaxation that does, in `unit`: how far a limit is widened or a clearance reduced; for "whole steps" how
        often the steps are halved. Infinite where only dropping it does, nan where it cures nothing.
    value : float
        The limit or clearance that is left; nan where it is no number.
    unit : "length", "radian", "halvings" or ""
    failing : float
        Largest relaxation that is known not to do; `by` is above it by `Tolerances.requirement`, relative, or what the
        judge lets pass; by more, which `note` tells, where answers in between are neither motions nor proofs.
    impossible : float
        Largest relaxation that is proved not to do; infinite where it is proved that the constraint cures nothing, nan
        where nothing is proved. Close to the least one, proofs take too long.
    solution : Solution or None
        The least motion of the problem so relaxed.
    note : str
        What else there is to say.
    """

    plain_names: ClassVar[tuple[str, ...]] = (
        "name", "cures", "by", "value", "unit", "failing", "impossible", "note",
    )  # fmt: skip

    name: str
    cures: bool
    by: float = math.nan
    value: float = math.nan
    unit: str = ""
    failing: float = 0.0
    impossible: float = math.nan
    solution: Solution | None = None
    note: str = ""

    @property
    def amount(self) -> float:
        """Amount of the motion that it makes possible; nan without."""
        return math.nan if self.solution is None else self.solution.amount

    def __str__(self) -> str:
        if not self.cures:
            return f"{self.name}: cures nothing alone" + (f" ({self.note})" if self.note else "")
        shown = math.degrees if self.unit == "radian" else float
        unit = {"radian": " deg", "halvings": " halvings"}.get(self.unit, "")
        done = "drop it" if math.isinf(self.by) else f"by {shown(self.by):.9g}{unit}"
        done += "" if math.isnan(self.value) else f" to {shown(self.value):.9g}{unit}"
        return f"{self.name}: {done}, amount {self.amount:.6g}" + (f" ({self.note})" if self.note else "")


@dataclass(frozen=True, eq=False, kw_only=True)
class Trial(PlainMotion):
    """Another question that was asked where the motion alone cannot do it.

    Attributes
    ----------
    change : str
        What was changed, with all constraints dropped.
    solution : Solution
    """

    plain_names: ClassVar[tuple[str, ...]] = ("change",)

    change: str
    solution: Solution

    def __str__(self) -> str:
        how = f"amount {self.solution.amount:.6g}" if self.solution.usable else self.solution.status.name
        return f"{self.change}: {how}"
