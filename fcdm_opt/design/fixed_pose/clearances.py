"""Clearance and interference at a fixed pose, over the whole tolerance box and over the sizes actually made."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fcdm_opt.design.contact_gaps import ContactGaps, by_contacts
from fcdm_opt.design.fixed_pose.scene import BodyGaps, Extreme, ScaleGaps, Scales
from fcdm_opt.design.sizes import (
    SCALES,
    Sizes,
    all_sizes,
    box_of,
    by_name,
    drawn_pairs,
    not_counted,
    proportion_interval,
)
from fcdm_opt.design.stack.spread import draws
from fcdm_opt.design.stack.stack_up import stack_up
from fcdm_opt.errors import expected, known_arguments
from fcdm_opt.geometry.arrays import Array, frozen
from fcdm_opt.geometry.bodies import rigid_transform
from fcdm_opt.geometry.units import measured, signed
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.lazy_import import NotebookRepr
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem.arguments import motion_values
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.tolerances import DEFAULT

QUANTILES = (0.0, 0.00135, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 0.99865, 1.0)  # with three deviations to each side
BINS = 50
CONFIDENCE = 0.95


@dataclass(frozen=True, kw_only=True, eq=False)
class EndOfRange(Plain):
    """An extreme gap of the tolerance box."""

    gap: float  # length units; > 0 clearance, < 0 interference
    rho: Array  # the sizes at which it is taken, (2,) or (k,)
    parts: tuple[int, int]  # the part pair that has it, 0-based
    feature: str  # what of body 1 and body 2 faces each other there, 1-based as all labels
    direction: Array  # from body 1 to body 2, world axes, (3,)
    # of these sizes; "rho_1" and "rho_2" are the scales of both bodies, others are deviations from drawn
    names: tuple[str, ...] = SCALES
    between: str = ""  # the feature in words

    def without_rounding(self, most: float) -> EndOfRange:
        """Return the same, touching where the gap is no more than digits leave open."""
        return replace(self, gap=0.0) if 0.0 < abs(self.gap) <= most else self

    @property
    def sizes_text(self) -> str:
        """The sizes in words: deviations that are not zero by their names."""
        if self.names == SCALES:
            return ", ".join(f"{x:.6g}" for x in self.rho)
        texts = [f"{name} {signed(x, 6)}" for name, x in zip(self.names, self.rho.tolist(), strict=True) if x]
        return ", ".join(texts) or "as drawn"

    @classmethod
    def of(cls, scene: BodyGaps | ContactGaps, rows: Any, extreme: Extreme) -> EndOfRange:
        """Return an extreme with the label of its features."""
        gap, rho, parts, direction = extreme
        feature = scene.feature(rows, extreme)
        found = cls(
            gap=gap, rho=frozen(rho), parts=parts, feature=feature.label, direction=frozen(direction), names=scene.names
        )
        return replace(found, between=scene.in_words(feature))


@dataclass(frozen=True, kw_only=True, eq=False)
class Clearances(NotebookRepr, Plain):
    """The gap of all size pairs at one pose.

    The gap is the signed distance of the two bodies, what a gauge measures: the Euclidean distance where they are
    apart, minus the penetration depth of the deepest part pair where they overlap.

    Attributes
    ----------
    transform : (4, 4) array or None
        The pose of body 1; None of an assembly.
    box : (2, 2) or (k, 2) array
        Sizes of the range: (low, high) of rho_1 and of rho_2, or of each of the problem's own sizes.
    least, most : EndOfRange
        The ends of the range over the whole box, exact to rounding but for `doubt`.
    doubt : float
        No gap in the box exceeds the largest by more than this; 0 for convex bodies.
    sizes : (n, 2) or (n, k) array
        The size pairs of the distribution.
    source : str
        Where they come from.
    gaps : (n,) array
        Their gaps.
    interference : float
        Share of the size pairs that overlap by more than `Problem.contact_slack`.
    interference_interval : (low, high)
        Where the share of all production lies with 95 % confidence (Clopper and Pearson), the pairs being a sample.
    quantiles : (q, 2) array
        Shares, and the gap that this share of the pairs does not exceed.
    counts, edges : arrays
        The histogram of the gaps: pairs in each bin, and the ends of the bins.
    unit : str
        Of lengths, "" where the problem names none.
    standing : tuple of str
        Contacts that are closed at all of these sizes, a flange on its plate: not counted in gaps, as in `stack_up`.
    on_true_faces : bool
        Whether gaps are those of the faces that facets stand for.
    claimed : GapClaims
        What is told of the range, which `verify` looks at.
    """

    plain_names = (
        "transform", "box", "least", "most", "doubt", "source", "standing", "count", "interference",
        "interference_interval", "quantiles", "histogram",
    )  # fmt: skip
    plain_kinds: ClassVar[Mapping[str, Any]] = {"count": int, "histogram": Mapping[str, tuple[float, ...]]}

    transform: Array | None
    box: Array
    least: EndOfRange
    most: EndOfRange
    doubt: float
    sizes: Array = field(repr=False)
    source: str
    gaps: Array = field(repr=False)
    interference: float
    interference_interval: tuple[float, float]
    quantiles: Array = field(repr=False)
    counts: Array = field(repr=False)
    edges: Array = field(repr=False)
    unit: str = ""
    standing: tuple[str, ...] = ()
    on_true_faces: bool = False
    claimed: GapClaims | None = field(default=None, repr=False)

    def claims(self, *, proof: bool = False) -> GapClaims:
        """Return what `verify` looks at: the range of the gap at the pose."""
        assert self.claimed is not None
        return self.claimed

    @property
    def range(self) -> tuple[float, float]:
        """The least and the largest gap over the whole box."""
        return self.least.gap, self.most.gap

    def __str__(self) -> str:
        low, high = self.range
        interfere = f"{self.interference:.3%} of {self.source} interfere"
        interfere += ", all of them beyond the tolerances" * (low >= 0.0 < self.interference)
        return "; ".join([gaps_text(low, high, self.unit), interfere, *not_counted(self.standing)])

    def to_dict(self) -> dict[str, Any]:
        """Return plain data, without the single size pairs and gaps."""
        data = {"count": len(self.gaps), "histogram": {"counts": self.counts, "edges": self.edges}}
        return {name: plain(data[name] if name in data else getattr(self, name)) for name in self.plain_names}


@known_arguments
def clearances(
    problem: Problem | Assembly,
    *,
    sizes: Any = None,
    box: Any = None,
    pose: Any = None,
    count: int = 100_000,
    seed: int = 1,
) -> Clearances:
    """Return range and distribution of the gap at a fixed pose, without any re-positioning.

    Asked are bodies and sizes alone: the problem's goal, motion limits and keep-outs play no part. Of an assembly, of
    bodies kept as surfaces and of sizes that turn faces it is the least gap of all contacts as drawn, see `best_pose`.

    Parameters
    ----------
    problem : Problem or Assembly
    sizes : (n, 2) array, or a distribution for each body, optional
        Measured size pairs, or what they are drawn from, independently: `Uniform`, `Normal`, `Measured`. Default: all
        sizes of the box equally likely.
    box : ((low_1, high_1), (low_2, high_2)), optional
        Of the range; default the problem's tolerance, nominal * (1 - minus) to nominal * (1 + plus), or all that
        `sizes` may be where it has none. A problem with sizes of its own and no such tolerance is asked about these,
        distributed as they say; its gap is then that of `stack_up`, the largest separation along a face or two edges,
        of parts at the scales made.
        Of an assembly (low, high), the scales of all its parts.
    pose : mapping of parameter name to number, sequence of parameters, or (4, 4) array, optional
        Where body 1 is: parameters of the problem's motion (length units, radians), or a rigid transform. Default: at
        rest.
    count : int
        Number of draws; a list of pairs is taken as it is.
    seed : int
        Of the draws.

    Raises
    ------
    InputError
        For empty sizes, nan, sizes <= 0, a box that is none, a pose that is no rigid motion.
    """
    expected(problem, (Problem, Assembly), "problem")
    own = by_name(problem, sizes, box)
    at: Callable[..., _Found] = _of_contacts
    if not by_contacts(problem, named=False):
        at = _of_sizes if own else _of_scales
    found = at(problem, sizes, box, pose, partial(_drawn, problem, sizes, count=count, seed=seed, own=own))
    digits = max(DEFAULT.weld * problem.size, found.on_true_faces * sum(body.rounding for body in problem.bodies[:2]))
    inside = int((found.gaps < -max(problem.contact_slack, digits)).sum())
    shares, count = np.array(QUANTILES), len(found.gaps)
    counts, edges = np.histogram(found.gaps, bins=BINS)
    return Clearances(
        transform=None if found.transform is None else frozen(found.transform),
        box=found.claimed.box,
        least=found.least.without_rounding(digits),
        most=found.most.without_rounding(digits),
        doubt=found.doubt,
        sizes=frozen(found.pairs),
        source=found.source,
        gaps=frozen(found.gaps),
        interference=inside / count,
        interference_interval=proportion_interval(inside, count, CONFIDENCE),
        quantiles=frozen(np.column_stack([shares, np.quantile(found.gaps, shares, method="inverted_cdf")])),
        counts=frozen(counts, np.int64),
        edges=frozen(edges),
        unit=problem.unit,
        standing=found.permanent,
        on_true_faces=found.on_true_faces,
        claimed=found.claimed,
    )


class _Found(NamedTuple):
    """What `clearances` tells of one pose, see `Clearances`; `pairs` are its `sizes`."""

    transform: Array | None
    least: EndOfRange
    most: EndOfRange
    pairs: Array
    source: str
    gaps: Array
    claimed: GapClaims
    permanent: tuple[str, ...] = ()
    doubt: float = 0.0
    on_true_faces: bool = False


def _of_contacts(problem: Problem | Assembly, sizes: Any, box: Any, pose: Any, drawn: Any) -> _Found:
    asked, names = all_sizes(problem, sizes, box)
    scene = ContactGaps(problem, asked, names, own=by_name(problem, sizes, box))
    transform = transform_of(problem, pose) if isinstance(problem, Problem) else None
    coordinates = () if transform is not None else [own.name for own in problem.coordinates]
    poses = [transform] if transform is not None else scene.transforms(motion_values(coordinates, pose, "pose"))
    at, (pairs, source) = scene.rows(poses), drawn(asked.box)
    extremes, (first, *others) = scene.extremes(at), scene.claims(poses)
    least, most = (EndOfRange.of(scene, at, end) for end in extremes[:2])
    whole = replace(first, further=others)
    return _Found(transform, least, most, pairs, source, at.gaps(pairs), whole, (), extremes.doubt, not scene.of_facets)


def _of_sizes(problem: Problem, sizes: Any, box: Any, pose: Any, drawn: Any) -> _Found:
    """Return the gaps of a problem's own sizes, as its stack-up tells them."""
    stack = stack_up(problem, pose=(transform := transform_of(problem, pose)))
    touching, names, worst = stack.touching, tuple(stack.names), stack.worst()
    pairs, source = drawn(touching.box)

    def end(gap: float, at: Mapping[str, float]) -> EndOfRange:
        own, row = touching.governing(rho := np.array([*at.values()]))
        feature, direction = touching.feature(own, row), frozen(own.normals[row])
        return EndOfRange(
            gap=gap, rho=frozen(rho), parts=own.parts, feature=feature.label, direction=direction, names=names,
            between=feature.in_words(*touching.bodies),
        )  # fmt: skip

    least, most = end(worst.least, worst.at_least), end(worst.largest, worst.at_largest)
    gaps, exact = stack.gap(pairs), stack.on_true_faces
    return _Found(transform, least, most, pairs, source, gaps, stack.claims(), stack.standing, on_true_faces=exact)


def _of_scales(problem: Problem, sizes: Any, box: Any, pose: Any, drawn: Any) -> _Found:
    """Return the gaps of all scales of two bodies."""
    transform, whole = transform_of(problem, pose), box_of(problem, sizes, box)
    pairs, source = drawn(whole)
    facets = problem.of_facets
    scene, at, extremes, true = ScaleGaps.of(facets.movable, facets.static, transform, whole)
    ends = frozen(np.column_stack([pairs.min(axis=0), pairs.max(axis=0)]))
    wider = Scales(scene.movable, scene.static, Sizes(ends), scene.apart)
    wider.permanent, wider.behind = scene.permanent, scene.behind
    least, most = (EndOfRange.of(scene, at, end) for end in extremes[:2])
    claimed = GapClaims(
        bodies=(problem.movable, problem.static),
        sizes=(),
        transform=transform,
        least=(least.gap, least.rho),
        largest=(most.gap, most.rho),
        box=scene.sizes.box,
        permanent=tuple(scene.permanent),
        permanent_faces=None if true is None else true.faces_of(scene.permanent.values()) | true.permanent,
    )
    gaps, permanent = wider.rows(at.pose).gaps(pairs), scene.permanent_in_words
    return _Found(transform, least, most, pairs, source, gaps, claimed, permanent, extremes.doubt, true is not None)


def _drawn(scene: Problem | Assembly, sizes: Any, box: Array, *, count: int, seed: int, own: bool) -> tuple[Array, str]:
    """Return sizes of the distribution, (n, k), and where they come from."""
    if own:
        return draws(scene.sizes, count, seed), f"{count} pairs drawn as the sizes are distributed"
    return drawn_pairs(sizes, box, count, seed)


def gaps_text(least: float, most: float, unit: str) -> str:
    """Return a range of gaps in words: "gaps from 0.2 mm interference to 0.3 mm clearance"."""
    kinds = ("clearance", "interference")
    return f"gaps from {' to '.join(f'{measured(abs(gap), unit, 4)} {kinds[gap < 0]}' for gap in (least, most))}"


def transform_of(problem: Problem, pose: Any) -> Array:
    """Return the transform of a pose: at rest, by motion parameters, or as given; raises `InputError`."""
    if pose is None:
        return rigid_transform(None)
    if np.ndim(pose) == 2:
        return rigid_transform(pose, key="pose")
    q = motion_values(problem.motion.names, pose, "pose")
    return problem.motion.transform(q, problem.movable.seed, problem.static.seed)
