"""What is asked, whichever way it is written: what commands about a `Problem` and an `Assembly` have in common."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import islice
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.resizing import at_scale
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import UnitOrNone
from fcdm_opt.motion.motions import Kind, Motion
from fcdm_opt.problem.keep_out import KeepOut
from fcdm_opt.tolerances import DEFAULT

if TYPE_CHECKING:
    from fcdm_opt.problem.assembly import Assembly
    from fcdm_opt.problem.problem import Problem


class Coordinate(NamedTuple):
    """A parameter of the motions: of two parts by its name, of several as "part.parameter"."""

    name: str
    kind: Kind
    weight: float  # amount per length unit or radian
    limits: tuple[float, float]  # length units or radians, infinite where none is given


def lengths_of(*bodies: Body) -> dict[str, float]:
    """Return `size` and `contact_slack` of bodies: relative to the smallest, and no less than rounding at the largest.

    The latter in the gap up to which two of them touch.
    """
    sizes = [body.size for body in bodies]
    return {"size": max(sizes), "contact_slack": max(DEFAULT.touch * min(sizes), DEFAULT.tie * max(sizes))}


class AnyScene:
    """A question about parts, their motions and their sizes: a `Problem` of two parts, or an `Assembly` of several.

    Further members that both have say there what they are: relations, kinematics, changed, with_motion and so on.
    """

    name: str
    unit: UnitOrNone
    drawn: Mapping[str, Body]  # the parts as drawn, by the names that `sizes` have for them
    motions: Mapping[str, Motion]  # of the parts that move, by the same names
    scales_made: Mapping[str, float]  # of the parts made, by the same names
    size: float  # length that relative tolerances refer to: the largest box diagonal of a part as drawn
    contact_slack: float  # gap up to which a pair touches, length units
    limit_slack: float  # amount by which the judge lets a limit be passed
    lengths: Mapping[str, float]  # that turn their radians into lengths
    coordinates: tuple[Coordinate, ...]  # the parameters of all motions, in order
    amount: Any
    sizes: tuple[Size, ...]
    made: Any
    keep_out: tuple[KeepOut, ...]
    resolution: Any
    request: Mapping[str, Any]

    def __eq__(self: Any, other: object) -> bool:
        """Tell whether another question asks the same, of the same bodies and the same parts of these."""
        if self is other or not isinstance(other, type(self)) or self._key_data != other._key_data:
            return self is other
        try:
            return self.to_dict() == other.to_dict()
        except (FcdmError, TypeError):  # of a motion of its own there are no plain data
            return False

    def __hash__(self) -> int:
        return hash(self._key_data)

    @property
    def _key_data(self) -> str:
        """What is quickly compared of a question, and what it has worked out that its plain data do not say."""
        return repr((self.name, self.coordinates, *self.scales_made.items(), *sorted((self.made or {}).items())))

    @property
    def bodies(self: Any) -> tuple[Body, ...]:
        """All bodies of the question, at the sizes made: its parts, and those of the keep-outs."""
        return (*self.bodies_made.values(), *(keep_out.body for keep_out in self.keep_out))

    @property
    def at_scales(self) -> dict[str, Body]:
        """The parts as drawn but scaled as those made: of which answers about all sizes are."""
        return {part: at_scale(body, self.scales_made[part]) for part, body in self.drawn.items()}

    @property
    def moving(self) -> tuple[str, ...]:
        """The parts with a motion, by the same names."""
        return tuple(self.motions)

    @property
    def shifts(self) -> bool:
        """Whether all motions only shift."""
        return all(motion.shifts for motion in self.motions.values())

    @property
    def turning_length(self) -> float:
        """Length that turns radians into lengths, of several the least."""
        return min(self.lengths.values())

    @property
    def amount_unit(self) -> str:
        """Unit of the amount: `unit`, and "" for an amount of one's own, which need not be a length."""
        return self.unit if isinstance(self.amount, str) else ""

    def by_part(self, values: Iterable[float]) -> dict[str, list[float]]:
        """Return values of the parameters of all motions, in order, as those of each part that moves."""
        each = iter(values)
        return {part: [*islice(each, len(motion.names))] for part, motion in self.motions.items()}

    def motion_texts(self, values: Iterable[float]) -> dict[str, str]:
        """Return a motion in words, by the parts that move."""
        own = self.by_part(values)
        return {part: motion.describe(own[part], unit=self.unit) for part, motion in self.motions.items()}

    def scales_at(self: Any, values: Mapping[str, float]) -> dict[str, float]:
        """Return the scales of the parts, by their names, where some sizes and scales have values: others as made."""
        named = zip(self.nominal_scales, self.scales_made.items(), strict=True)
        return {part: values.get(name, scale) for name, (part, scale) in named}

    def dimensions_at(self: Any, size: Size, values: Mapping[str, float]) -> dict[str, float]:
        """Return what a size measures where some sizes and scales have values, others as made: `Size.dimensions`."""
        made = {own: values.get(own.name, (self.made or {}).get(own.name, 0.0)) for own in self.sizes}
        scale = self.scales_at(values)[size.body]
        return {face: scale * x for face, x in size.dimensions(self.drawn[size.body], made).items()}


if TYPE_CHECKING:
    Scene: TypeAlias = Problem | Assembly  # of which a check of types knows all that both have
else:
    Scene = AnyScene
