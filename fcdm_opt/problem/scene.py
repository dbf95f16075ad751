"""What is asked, whichever way it is written: what commands about a `Problem` and an `Assembly` have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.size import Size
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.keep_out import KeepOut

if TYPE_CHECKING:
    from fcdm_opt.problem.problem import Problem


class Coordinate(NamedTuple):
    """A parameter of the motions: of two parts by its name, of several as "part.parameter".

    `weight` is in amount per length unit or radian, `limits` are length units or radians, infinite where none is given.
    """

    name: str
    kind: str
    weight: float
    limits: tuple[float, float]


class Scene(ABC):
    """A question about parts, their motions and their sizes: a `Problem` of two parts, or an `Assembly` of several."""

    name: str
    unit: Any
    sizes: tuple[Size, ...]
    made: Any
    keep_out: tuple[KeepOut, ...]
    resolution: Any
    request: Mapping[str, Any]

    @property
    @abstractmethod
    def size(self) -> float:
        """Length that relative tolerances refer to."""

    @property
    @abstractmethod
    def bodies(self) -> tuple[Body, ...]:
        """All bodies, at the sizes made."""

    @property
    @abstractmethod
    def drawn(self) -> Mapping[str, Body]:
        """The parts as drawn, by the names that `sizes` have for them."""

    @property
    @abstractmethod
    def coordinates(self) -> tuple[Coordinate, ...]:
        """The parameters of all motions, in order."""

    @property
    @abstractmethod
    def relations(self) -> tuple[Problem, ...]:
        """What is asked of every two parts that may meet, in the parameters of all motions."""

    @property
    @abstractmethod
    def shifts(self) -> bool:
        """Whether all motions only shift."""

    @property
    @abstractmethod
    def turning_length(self) -> float:
        """Length that turns radians into lengths, of several the least."""

    @property
    @abstractmethod
    def limit_slack(self) -> float:
        """Amount by which the judge lets a limit be passed."""

    @property
    @abstractmethod
    def contact_slack(self) -> float:
        """Gap up to which a pair touches, length units."""

    @property
    @abstractmethod
    def amount_unit(self) -> str:
        """Unit of the amount, "" where none is known."""

    @abstractmethod
    def changed(self, **arguments: Any) -> Self:
        """Return the same question with other arguments."""

    @abstractmethod
    def with_limits(self, name: str, limits: tuple[float, float]) -> Self:
        """Return the same question with other limits of a coordinate."""

    @abstractmethod
    def with_motion(self, motion: Motion) -> tuple[Self, tuple[str, ...]]:
        """Return the same question about another motion, of all parts that move, and what it says no more by that."""

    @abstractmethod
    def deviating(self, share: float) -> Self:
        """Return the same question with a share of the deviation from nominal, or from drawn."""

    @property
    @abstractmethod
    def deviates(self) -> bool:
        """Whether the parts made are off nominal, or off what is drawn."""
