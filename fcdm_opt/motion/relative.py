"""How one part of an assembly moves as another sees it: both are carried by motions, one following the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.motions import IDENTITY, Matrix, Motion, Parameter, Step, product


@dataclass(frozen=True)
class Carrying:
    """The motion of one part relative to the part that it follows."""

    motion: Motion
    start: int  # place of its first parameter among those of all
    seeds: tuple[tuple[float, ...], tuple[float, ...]]  # of the part and of what it follows, as drawn

    def transform(self, q: Sequence[Any]) -> Matrix:
        """Return its 4x4 transform at the parameters of all, of any kind of scalars."""
        return self.motion.composed(list(q[self.start : self.start + len(self.motion.parameters)]), *self.seeds)

    def seen_from(self, origin: Array) -> Carrying:
        """Return the same in coordinates with another origin."""
        one, two = (tuple((np.array(seed) - origin).tolist()) for seed in self.seeds)
        return replace(self, motion=self.motion.seen_from(origin), seeds=(one, two))


@dataclass(frozen=True)
class Relative(Step):
    """A part as another sees it, in the parameters of all motions: T_2^-1 T_1, T the product of what carries each."""

    every: tuple[Parameter, ...]  # the parameters of all
    # what carries the part that is seen and the part that sees, from the fixed part on; what they share is left out
    one: tuple[Carrying, ...]
    two: tuple[Carrying, ...]

    @property
    def own_parameters(self) -> tuple[Parameter, ...]:
        """Those of all motions."""
        return self.every

    def own_transform(self, q: list[Any], movable_seed: tuple[Any, ...], static_seed: tuple[Any, ...]) -> Matrix:
        """Carry, and look back; seeds are those of the motions."""
        return product(_inverse(_carried(self.two, q)), _carried(self.one, q))

    def own_seen_from(self, origin: Array) -> Relative:
        """See every motion from there."""
        one, two = (tuple(each.seen_from(origin) for each in own) for own in (self.one, self.two))
        return replace(self, one=one, two=two)

    @cached_property
    def bounded(self) -> bool:
        """Whether every motion shifts: of those that turn no bound is known, what one carries may be anywhere."""
        return all(own.motion.shifts for own in (*self.one, *self.two))

    @property
    def smooth(self) -> bool:
        """As smooth as what it is made of."""
        return all(step.smooth for own in (*self.one, *self.two) for step in own.motion.steps)

    def own_shifts(self, first: bool) -> bool:
        """Where every motion shifts."""
        return self.bounded

    def own_reaches(self, points: Array, seed: Array, turned: bool) -> tuple[float, ...]:
        """Add up what each motion displaces; nothing is known where one turns."""
        reaches = np.full(len(self.every), np.inf)
        if self.bounded:
            reaches[:] = 0.0
            for own in (*self.one, *self.two):
                reaches[own.start : own.start + len(own.motion.parameters)] = own.motion.reaches(points, own.seeds[0])
        return tuple(reaches.tolist())

    def own_words(self, q: list[float], unit: str = "", digits: int = 6) -> str:
        """Parameters in words, those of several parts with commas between, without those that are 0."""
        kept = [(replace(self, every=(own,)), x) for own, x in zip(self.every, q, strict=True) if x]
        words = ", ".join(super(Relative, own).own_words([x], unit, digits) for own, x in kept)
        return words or super().own_words(q, unit, digits)


def _carried(chain: Sequence[Carrying], q: Sequence[Any]) -> Matrix:
    T = IDENTITY
    for own in chain:
        T = product(T, own.transform(q))
    return T


def _inverse(T: Matrix) -> Matrix:
    rows = tuple(
        (T[0][i], T[1][i], T[2][i], -(T[0][i] * T[0][3] + T[1][i] * T[1][3] + T[2][i] * T[2][3])) for i in range(3)
    )
    return (*rows, IDENTITY[3])
