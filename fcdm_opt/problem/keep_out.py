"""Further static bodies that the moved part must keep clear of."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.bodies import Body, ConvexPart
from fcdm_opt.problem import arguments


@dataclass(frozen=True, eq=False, init=False)
class KeepOut:
    """A static body besides the contact partner, at its scale or over a range of scales, and the least gap to it.

    The gap is asked for where the motion ends.

    Parameters
    ----------
    body : Body
        As drawn, world frame.
    scale : float or (low, high)
        Scale about the body's own seed; for a range the gap is kept at every scale in it.
    clearance : float
        Least gap, length units, >= 0; with 0 the part may touch the body but not overlap it.
    name : str, optional
        Name in messages, tables and choices of a case; default that of the body, which takes it over.

    Raises
    ------
    InputError
        Names the argument, what was found and what is allowed.
    """

    body: Body = field(repr=False)
    scale: float | tuple[float, float]
    clearance: float
    name: str

    @known_arguments
    def __init__(self, body: Body, scale: Any = 1.0, *, clearance: float = 0.0, name: str | None = None) -> None:
        if not isinstance(body, Body):
            raise InputError("wrong kind of argument", key="KeepOut.body", found=type(body).__name__, allowed="a Body")
        called = body.name if name is None else name
        if not isinstance(called, str) or not called:
            raise InputError("not a name", key="KeepOut.name", found=name, allowed="a text")
        self.__dict__.update(
            name=called,
            body=body if body.name == called else replace(body, name=called),
            scale=arguments.scale(scale, "KeepOut.scale"),
            clearance=arguments.length(clearance, "KeepOut.clearance"),
        )

    def with_body(self, body: Body) -> KeepOut:
        """Return the same keep-out of another body."""
        return self if body is self.body else KeepOut(body, self.scale, clearance=self.clearance, name=self.name)

    @property
    def ends(self) -> tuple[float, float]:
        """Least and largest scale."""
        low, high = self.scale if isinstance(self.scale, tuple) else (self.scale, self.scale)
        return low, high

    @cached_property
    def obstacles(self) -> tuple[tuple[ConvexPart, float], ...]:
        """Convex parts, each with its scale, that together fill what the body fills at any scale of its range.

        Over a range, a point x of a convex part runs along the straight way from s + low (x - s) to s + high (x - s).
        With s inside the part, the part at the largest scale has them all. Otherwise they fill the hull of both ends:
        a point on the way between two points that belong to r and r' belongs to a scale between r and r'.
        """
        low, high = self.ends
        return tuple(
            (part, high) if low == high or holds_seed(part) else (_swept(part, low, high).parts[0], 1.0)
            for part in self.body.parts
        )

    @cached_property
    def bodies(self) -> tuple[tuple[Body, float], ...]:
        """The body at its scale; over a range a body for each of the `obstacles`."""
        low, high = self.ends
        if low == high or all(map(holds_seed, self.body.parts)):
            return ((self.body, high),)
        return tuple((_swept(part, low, high), 1.0) for part in self.body.parts)


def holds_seed(part: ConvexPart) -> bool:
    """Tell whether the seed lies in the part, so that smaller scales lie within larger ones."""
    return bool((((part.bases - part.seed) * part.normals).sum(axis=1) >= 0).all())


def _swept(part: ConvexPart, low: float, high: float) -> Body:
    """Return the hull of a part at both ends of a range of scales."""
    arms = part.vertices - part.seed
    return Body.convex(part.seed + np.vstack([low * arms, high * arms]), seed=part.seed, name="swept")


def keep_outs(values: Any) -> tuple[KeepOut, ...]:
    """Return checked keep-outs, plain bodies at scale 1 and without clearance; their names are distinct."""
    if not isinstance(values, list | tuple):
        allowed = "a tuple of KeepOut or Body"
        raise InputError("not a sequence", key="keep_out", found=type(values).__name__, allowed=allowed)
    made: dict[str, KeepOut] = {}
    for k, value in enumerate(values, 1):
        if not isinstance(value, Body | KeepOut):
            allowed = "a KeepOut or a Body"
            raise InputError("wrong kind of item", key=f"keep_out[{k}]", found=type(value).__name__, allowed=allowed)
        keep_out = KeepOut(value) if isinstance(value, Body) else value
        if keep_out.name in made:
            what = f"the name is that of keep_out[{list(made).index(keep_out.name) + 1}]"
            allowed = "a name that no other keep-out has: KeepOut(body, name=...)"
            raise InputError(what, key=f"keep_out[{k}].name", found=keep_out.name, allowed=allowed)
        made[keep_out.name] = keep_out
    return tuple(made.values())
