"""The stack-up of a gap: its rows at a pose, worst cases, contributions, yield and the cheapest tolerances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from fcdm_opt.curve.touching_sizes import PairRows, TouchingSizes
from fcdm_opt.curve.true_sizes import widened
from fcdm_opt.design.stack.allocation import Allocation, allocated
from fcdm_opt.design.stack.loops import FIT, Loop, assembly_loop, of_all_faces, pair_loop
from fcdm_opt.design.stack.spread import (
    GapSpread,
    GapYield,
    drawn_from,
    drawn_gaps,
    gap_spread,
    moments,
    spreads,
    worst_rows,
)
from fcdm_opt.errors import InputError, expected, known_arguments
from fcdm_opt.geometry.arrays import Array, numbers
from fcdm_opt.geometry.bodies import Body, rigid_transform
from fcdm_opt.geometry.facet_errors import gaps_off, known_to
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.units import measured, signed
from fcdm_opt.judge.sampled_sizes import GapClaims
from fcdm_opt.lazy_import import imported
from fcdm_opt.plain import Plain, plain
from fcdm_opt.problem.arguments import interval
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.schema import known_sizes
from fcdm_opt.tolerances import DEFAULT


@dataclass(frozen=True, eq=False)
class StackRow(Plain):
    """One row of a stack-up: where this contact decides, gap(p) = gap + sum of coefficient * size.

    Attributes
    ----------
    contact : str
        Label of the contact feature.
    told : str
        The same in words.
    parts : (int, int)
        Which part pair it is of: the gap is the largest of a pair's rows, least over pairs.
    gap : float
        With all sizes as drawn, length units.
    coefficients : mapping of size name to float
        Gap a unit of each size.
    """

    contact: str
    told: str
    parts: tuple[int, int]
    gap: float
    coefficients: Mapping[str, float]


@dataclass(frozen=True, eq=False)
class WorstCase(Plain):
    """The least and the largest gap within the tolerances, exact, and sizes at which they are.

    Attributes
    ----------
    least, largest : float
        Length units; a least gap below 0 is the largest interference.
    at_least, at_largest : mapping of size name to deviation
    least_low, largest_high : float
        The same as far as facets of round faces may be off these, see `StackUp.known_to`: no gap of the true solids is
        beyond them.
    """

    least: float
    at_least: Mapping[str, float]
    largest: float
    at_largest: Mapping[str, float]
    least_low: float
    largest_high: float

    def __str__(self) -> str:
        """Return both in words, with the sizes at which they are."""
        ends = (self.least, self.at_least), (self.largest, self.at_largest)
        named = (", ".join(f"{name} {signed(x)}" for name, x in at.items() if x) or "as drawn" for _, at in ends)
        return "gap from " + " to ".join(f"{signed(gap)} at {at}" for (gap, _), at in zip(ends, named, strict=True))


@dataclass(frozen=True, eq=False)
class SizeShare(Plain):
    """What one size contributes to the gap.

    Attributes
    ----------
    size : str
    coefficient : float
        Gap a unit of the size, on average over all pairs of parts: of a size that moves one contact of two that decide
        as often half of what it moves that.
    half : float
        Half its tolerance.
    worst : float
        Share of what the tolerances take off the gap in the worst case; all add up to 1, or are 0 where no size takes
        more off it than rounding. Where several contacts are as near there, the mean of their shares.
    variance : float
        Share of the variance of the gap over all pairs of parts, whichever contact decides: its Shapley effect, which
        halves what two sizes do together; all add up to 1, or are 0 where it does not vary. Exact where one row
        decides, else drawn.
    """

    size: str
    coefficient: float
    half: float
    worst: float
    variance: float


@dataclass(frozen=True, eq=False)
class RootSumSquare(Plain):
    """The gap of the deciding row as sizes are distributed, taken as normal.

    Attributes
    ----------
    mean, deviation : float
    low, high : float
        Mean minus and plus three deviations.
    share : float
        Of all pairs of parts that a normal distribution has within the limits.
    elsewhere : float
        Share of the pairs of parts in which another row decides: the gap is not this one then, and of solids of
        several parts smaller, so that fewer pairs are within a lower limit than `share`.
    """

    mean: float
    deviation: float
    low: float
    high: float
    share: float
    elsewhere: float


@dataclass(frozen=True, eq=False)
class StackUp:
    """How the gap of two bodies at a pose depends on the sizes of their faces, axes and features.

    Attributes
    ----------
    touching : TouchingSizes
        The rows in arrays, by part pair.
    limits : (float, float)
        Of the gap: what it must lie within.
    unit : str
        Of lengths.
    loop : Loop or None
        Of rows of contacts as drawn: which pair they are of, and what stays closed.
    keep_out : tuple of str
        Keep-outs of the problem, by name: the gap is that of two bodies, whatever these leave free.
    every : StackUp or None
        That of all contacts, of which this is one alone, see `of_contact`: it is what is judged.
    """

    touching: TouchingSizes
    limits: tuple[float, float]
    unit: str = ""
    loop: Loop | None = None
    keep_out: tuple[str, ...] = ()
    every: StackUp | None = None

    def __str__(self) -> str:
        """Return worst cases, the yield of a million pairs drawn, and contributions as tables."""
        return str(imported("show.printing:printed")(imported("show.stacks:print_stack"), self))

    def __repr__(self) -> str:
        """Return sizes and the range of the gap, on one line."""
        ends = " to ".join(signed(gap) for gap in (self._worst.least, self._worst.largest))
        return f"StackUp(gap {measured(ends, self.unit)} over {', '.join(self.names)})"

    @property
    def sizes(self) -> tuple[Size, ...]:
        """The sizes, in order."""
        return (self.loop.sizes if self.loop is not None else ()) or self.touching.sizes

    @property
    def names(self) -> list[str]:
        """Their names."""
        return [size.name for size in self.sizes]

    @cached_property
    def rows(self) -> tuple[StackRow, ...]:
        """The rows that decide the gap somewhere within the tolerances; there are no others."""
        found = []
        for pair in self.touching.pairs:
            for row, (gap, *coefficients) in enumerate(pair.values.tolist()):
                feature = self.touching.feature(pair, row)
                told = feature.in_words(*self.touching.bodies)
                by_name = dict(zip(self.names, coefficients, strict=True))
                found.append(StackRow(feature.label, told, pair.parts, gap, by_name))
        return tuple(found)

    @property
    def contacts(self) -> tuple[str, ...]:
        """The contacts of `rows` in words, each once; `of_contact` takes their numbers, from 1."""
        return tuple(dict.fromkeys(row.told for row in self.rows))

    def of_contact(self, contact: int | str) -> StackUp:
        """Return the stack-up of one contact alone, whatever others leave, by its number in `contacts` or in words.

        Raises `InputError` for what is no contact of it.
        """
        known = self.contacts
        numbered = isinstance(contact, int) and 1 <= contact <= len(known)
        name = known[int(contact) - 1] if numbered else contact
        if name not in known:
            allowed = "; ".join(f"{k} ({own})" for k, own in enumerate(known, 1))
            raise InputError("no such contact", key="contact", found=contact, allowed=allowed)
        rows, pairs = iter(self.rows), list[PairRows]()
        for pair in self.touching.pairs:
            own = np.flatnonzero([next(rows).told == name for _ in pair.values])
            pairs += [pair.some(own)] if len(own) else []
        return replace(self, touching=replace(self.touching, pairs=tuple(pairs), as_drawn=True), every=self)

    @property
    def standing(self) -> tuple[str, ...]:
        """Contacts that are closed at all sizes within the tolerances, a flange on its plate: not counted in gaps."""
        return self.touching.permanent_in_words

    @property
    def is_outside_limits_when_closed(self) -> bool:
        """Whether the limits allow no gap of 0 as contacts have that are closed at all sizes."""
        return bool(self.standing) and not self.limits[0] <= 0.0 <= self.limits[1]

    @property
    def weighted(self) -> tuple[str, ...]:
        """Motions that closed contacts leave free and that the gap depends on: it is that of the least, by weights."""
        return () if self.loop is None else self.loop.weighted

    @property
    def fits(self) -> dict[str, tuple[float, float]]:
        """Least and largest play a side, by words, of contacts as all around a shaft as wide as its bore.

        Of an assembly, whose other contacts motions close. Parts are in the middle of it: what it lets them move is not
        counted.
        """
        fits = () if self.loop is None else self.loop.fits
        return {own.name.removeprefix(FIT): (own.least[0], own.largest[0]) for own in fits if own.least and own.largest}

    @property
    def parts(self) -> tuple[str, ...]:
        """The two parts of an assembly that the gap is of, by name; () of a problem of two parts."""
        return () if self.loop is None else (*filter(None, self.loop.parts),)

    @property
    def on_true_faces(self) -> bool:
        """Whether gaps are those of the faces that facets stand for."""
        drawn = self.loop is not None and self.loop.pair.permanent_faces is not None
        return drawn or any(body.exact is not None for body in self.touching.bodies)

    @property
    def _of_facets(self) -> tuple[Body, ...]:
        return self.touching.bodies if self.loop is None else self.loop.of_facets

    @cached_property
    def off(self) -> tuple[float, float]:
        """Lengths by which gaps of the true solids may be above those of their meshes, and below, at most."""
        second, (out, short) = 0.0 if self.loop is None else self.loop.second_order, gaps_off(self._of_facets)
        return out + second, short + second

    @property
    def known_to(self) -> list[str]:
        """How near gaps are known in words, with the reason; nothing where they are exact."""
        found = known_to(self._of_facets, self.unit)
        if self.loop is not None and self.loop.second_order:
            off = measured(self.loop.second_order, self.unit, 2)
            found.append(f"parts turn, and gaps are of first order in the sizes: up to {off} off at corners of these")
        if self.touching.between > self._rounding:
            off = measured(self.touching.between, self.unit, 2)
            found.append(f"but at the worst cases gaps may be up to {off} smaller: of all directions some have rows")
        return found

    def gap(self, p: Any) -> Any:
        """Return the gap at sizes: deviations by name (0 where none is given), or an array (..., k) in their order.

        By name they are numbers, or arrays that broadcast together: the gaps have their shape. The sign is exact: > 0
        apart, 0 touching, < 0 overlapping. It is the largest separation over the rows, which never exceeds the
        distance. Beyond the tolerances other rows may count: they are found anew.

        Raises
        ------
        InputError
            For names that no size has, what is no number, and sizes at which a body changes its shape.
        """
        if isinstance(p, Mapping):
            known_sizes(p, "sizes", self.names)
            given = [numbers(p.get(name, 0.0), f"sizes.{name}") for name in self.names]
            try:
                told = self.gap(np.stack(np.broadcast_arrays(*given), axis=-1))
            except InputError:
                raise
            except ValueError as reason:
                found = {name: own.shape for name, own in zip(self.names, given, strict=True) if own.ndim}
                raise InputError("arrays that do not broadcast", key="sizes", found=found) from reason
            return told if np.ndim(told) else float(told)
        values = numbers(p, "sizes")
        if values.ndim == 0 or values.shape[-1] != len(self.names) or not np.isfinite(values).all():
            allowed = f"finite numbers, (..., {len(self.names)}): {', '.join(self.names)}"
            raise InputError("not a deviation for each size", key="sizes", found=p, allowed=allowed)
        each, (low, high) = values.reshape(-1, len(self.names)), self.touching.box.T
        if not ((each >= low) & (each <= high)).all():
            ends = np.minimum(each.min(axis=0), low).tolist(), np.maximum(each.max(axis=0), high).tolist()
            wider = [replace(own, tolerance=(a, b)) for own, a, b in zip(self.touching.sizes, *ends, strict=True)]
            return widened(self.touching, wider, least=False).gap(values)
        return self.touching.gap(values)

    @cached_property
    def _worst(self) -> WorstCase:
        (least, low), (largest, high) = self.touching.least(), self.touching.largest()
        least, largest = (0.0 if abs(gap) <= self._rounding else gap for gap in (least, largest))
        named = [dict(zip(self.names, place.tolist(), strict=True)) for place in (low, high)]
        out, short = self.off
        return WorstCase(least, named[0], largest, named[1], least - short, largest + out)

    @property
    def _rounding(self) -> float:
        """How far a gap may be off by the digits of numbers, and on true faces by those of the files."""
        bodies = self.touching.bodies
        of_files = sum(body.rounding for body in bodies) * self.on_true_faces
        return max(DEFAULT.weld * max(body.size for body in bodies), of_files)

    def worst(self) -> WorstCase:
        """Return the least and the largest gap within the tolerances, with sizes at which they are."""
        return self._worst

    @property
    def _is_constant(self) -> bool:
        return self.worst().largest - self.worst().least <= self._rounding

    @cached_property
    def deciding(self) -> Array:
        """The row (1 + k,) that decides the least gap: gap as drawn, then a unit of each size.

        Of several that are as low the one that is lowest three deviations below its mean, else the first by its rates
        in the order of the sizes' names.
        """
        means, deviations = moments(spreads(self.sizes))
        rows = self._worst_rows[0]
        lows = rows[:, 0] + rows[:, 1:] @ means - 3.0 * np.linalg.norm(rows[:, 1:] * deviations, axis=1)
        if self._is_constant:
            lows = np.abs(rows[:, 1:]).sum(axis=1)
        near = rows[lows <= lows.min() + DEFAULT.tie * max(body.size for body in self.touching.bodies)]
        named = sorted(range(len(self.names)), key=self.names.__getitem__)
        return np.asarray(min(near, key=lambda row: tuple(row[1:][named])))

    @property
    def deciding_contact(self) -> str:
        """The contact of that row in words, and how many others have the same one, as opposite walls may."""
        rows = [np.array([row.gap, *row.coefficients.values()]) for row in self.rows]
        alike = (np.allclose(own, self.deciding, rtol=0.0, atol=DEFAULT.tie) for own in rows)
        first, *others = dict.fromkeys(row.told for row, near in zip(self.rows, alike, strict=True) if near)
        return f"{first} (and {len(others)} as near)" if others else first

    @cached_property
    def _worst_rows(self) -> tuple[Array, Array]:
        return worst_rows(self.touching)

    @cached_property
    def _spread(self) -> GapSpread:
        return gap_spread(self._drawn_from, self.deciding)

    @cached_property
    def _drawn_from(self) -> TouchingSizes:
        return drawn_from(self.touching)

    @cached_property
    def contributions(self) -> tuple[SizeShare, ...]:
        """What each size contributes to the gap, largest first."""
        halves, (rows, weights) = np.array([size.half for size in self.sizes]), self._worst_rows
        parts = np.abs(weights @ np.abs(rows[:, 1:])) * halves * (not self._is_constant), self._spread.variances
        worst, variance = (
            own / own.sum() if own.sum() > noise else np.zeros_like(own)
            for own, noise in zip(parts, (self._rounding, self._rounding**2), strict=True)
        )
        found = zip(*map(np.ndarray.tolist, (self._spread.slopes, halves, worst, variance)), strict=True)
        shares = [SizeShare(name, *row) for name, row in zip(self.names, found, strict=True)]
        return tuple(sorted(shares, key=lambda own: (-round(own.worst, 9), own.size)))

    def claims(self, *, proof: bool = False) -> GapClaims:
        """Return what `verify` looks at: the gap at all sizes, by `rows`, and the worst cases; of all contacts."""
        if self.every is not None:
            return self.every.claims()
        parts = np.array([row.parts for row in self.rows])
        heights = np.array([[row.gap, *row.coefficients.values()] for row in self.rows])
        return self._claims([heights[(parts == own).all(axis=1)] for own in np.unique(parts, axis=0)])

    def _claims(self, pairs: Sequence[Array]) -> GapClaims:
        """Return the claims of a gap that is the least over pairs of the largest of their rows."""
        worst = self.worst()
        least = worst.least, np.array([*worst.at_least.values()])
        largest = worst.largest, np.array([*worst.at_largest.values()])

        def told(places: Array) -> Array:
            return np.min([(rows[:, 1:] @ places.T + rows[:, :1]).max(axis=0) for rows in pairs], axis=0)

        if self.loop is not None:
            return self.loop.claims(least, largest, told)
        one, two = (body.of_facets for body in self.touching.bodies)
        return GapClaims(
            bodies=(one, two),
            permanent_faces=self.touching.permanent_faces if self.on_true_faces else None,
            sizes=self.sizes,
            transform=self.touching.transform,
            least=least,
            largest=largest,
            box=self.touching.box,
            told=told,
            within=self.touching.between,
            permanent=[pair.parts for pair in self.touching.permanent],
        )

    def root_sum_square(self) -> RootSumSquare:
        """Return mean and deviation of the deciding row, and the share that is within the limits if it is normal."""
        from scipy.special import ndtr

        means, deviations = moments(spreads(self.sizes))
        mean = float(self.deciding[0] + self.deciding[1:] @ means)
        deviation = float(np.linalg.norm(self.deciding[1:] * deviations))
        low, high = self.limits
        if deviation > 0.0:
            share = float(ndtr((high - mean) / deviation) - ndtr((low - mean) / deviation))
        else:
            share = float(low <= mean <= high)
        ends = mean - 3.0 * deviation, mean + 3.0 * deviation
        return RootSumSquare(mean, deviation, *ends, share, self._spread.elsewhere)

    def yield_(
        self, n: int = 1_000_000, *, seed: int = 1, confidence: float = 0.95, correlation: Any = None
    ) -> GapYield:
        """Return the share of pairs of parts whose gap is within the limits, by drawing sizes; rows alone are asked.

        Parameters
        ----------
        n, seed : int
            How many pairs are drawn, and the start of it.
        confidence : float
            Of the share's interval, by Clopper and Pearson.
        correlation : (k, k) array, optional
            Of the sizes' normal scores (a normal copula); default independent.
        """
        how = {"seed": seed, "confidence": confidence, "correlation": correlation, "off": self.off}
        drawn = replace(drawn_gaps(self._drawn_from, self.limits, n, **how), unit=self.unit)
        if correlation is not None:
            return drawn
        claims = [own._claims([pair.values for pair in own._drawn_from.pairs]) for own in (self, self.every or self)]
        return replace(drawn, claimed=claims[1], counted=claims[0].told)

    def allocate(
        self,
        cost: Mapping[str, Any],
        *,
        share: float | None = None,
        limits: Sequence[float] | None = None,
        widest: float = 4.0,
        cp: float = 1.0,
    ) -> Allocation:
        """Return the cheapest tolerances with which the gap is within its limits.

        Parameters
        ----------
        cost : mapping of size name to cost
            Of a half tolerance t: a number c (c / t), ("1/t", c), ("1/t^2", c), or a table [(t, cost), ...], convex and
            falling, straight between its entries. Sizes without a cost keep their tolerance. Middles are kept.
        share : float, optional
            At least this share of the pairs is to be within, by root-sum-square with t = 3 cp deviations; default all
            of them, in the worst case.
        limits : (float, float), optional
            Default `limits`.
        widest : float
            How many times its tolerance a size's may become at most.
        cp : float
            See `share`.
        """
        between = self.limits if limits is None else interval(limits, "limits")
        return allocated(self.touching, cost, between, share=share, widest=widest, cp=cp)

    def to_dict(self) -> dict[str, Any]:
        """Return plain data: rows, worst case, contributions, root-sum-square."""
        answers = {
            "sizes": [size.to_dict() for size in self.sizes],
            "limits": self.limits,
            "known_to": self.known_to,
            "rows": self.rows,
            "standing": self.standing,
            "weighted": self.weighted,
            "fits": self.fits,
            "worst": self.worst(),
            "contributions": self.contributions,
            "root_sum_square": self.root_sum_square(),
            "widest": {"factor": self.touching.reach[0], "until": self.touching.reach[1]},
            "vanishing": dict(zip(("factor", "face", "at"), self.touching.vanishing, strict=True)),
        }
        told: dict[str, Any] = plain(answers)
        return told


@known_arguments
def stack_up(
    problem: Problem | Assembly, *, limits: Sequence[float] | None = None, pose: Any = None, of: Any = None
) -> StackUp:
    """Return how the gap of a problem's bodies depends on its sizes, at a pose.

    Contacts that are closed whatever the sizes are, as a flange on its plate, say nothing of them: the gap is that of
    all others, and `StackUp.standing` names them. What the problem's goal makes of them plays no part: of contacts that
    it restores together too the gap is the least. Of bodies kept as surfaces, of scales that turn faces, and of round
    parts of many facets whose edges meet otherwise within the tolerances, contacts as drawn are looked at, each along
    its normal.

    Of an assembly it is the gap of two parts, in the sizes of all: the others rest on each other as drawn, all other
    contacts closed by motions. Where these turn it is of first order in the sizes, and `StackUp.known_to` says by how
    much that may be off. Of several such motions the least are taken, by their weights: `StackUp.weighted` names those,
    where the gap depends on which are. A shaft as wide as its bore, which sizes open or close all around, is in its
    middle: `StackUp.fits`.

    Parameters
    ----------
    problem : Problem or Assembly
        With sizes, each with a tolerance. Its bodies count at the scales made, and all sizes within their tolerances,
        whatever it says is made: the gap at sizes is that of parts made so and then scaled.
    limits : (float, float), optional
        Least and largest gap that will do; default the clearance of the problem, or of the two parts, and infinity; any
        gap of a contact of an assembly that motions close.
    pose : (4, 4) array, optional
        Of the movable body; default as drawn.
    of : (name, name), optional
        The two parts of an assembly; by default those of the only contact of goal "clear", or where there is none of
        the only contact that sizes open. Or two plane faces that face each other, as "part:face" or (part, face), of
        two bodies "face" too, the movable one first; `face` as sizes name it. Motions, which only shift, then close all
        contacts as drawn, those of the two parts too; the gap is along the faces' normal.

    Raises
    ------
    InputError
        Where there are no sizes or one has no tolerance, where a scale turns the faces of a contact, where a body of
        several parts changes its shape within the tolerances, which names size and face.
    """
    expected(problem, (Problem, Assembly), "problem")
    keep_out = tuple(own.name for own in problem.keep_out)
    given = None if limits is None else interval(limits, "limits")
    if pose is not None and (of is not None or isinstance(problem, Assembly)):
        what = "parts rest on each other: of an assembly, or between two faces"
        raise InputError(what, key="pose", found=pose, allowed="as drawn")
    if isinstance(problem, Assembly) or of is not None:
        loop = assembly_loop(problem, of)
        relation = problem if isinstance(problem, Problem) else problem.relations[loop.parts]
        least = -np.inf if loop.is_restored else relation.clearance
        return StackUp(loop.touching, given or (least, np.inf), problem.unit, loop, keep_out)
    at = rigid_transform(pose)
    found = of_all_faces(problem, problem.sizes, partial(pair_loop, problem, at), transform=at)
    rows = (found, None) if isinstance(found, TouchingSizes) else (found.touching, found)
    return StackUp(rows[0], given or (problem.clearance, np.inf), problem.unit, rows[1], keep_out)
