"""Which sizes are spoken of: a box, measured ones, or what distributions give.

The scales (rho_1, rho_2) of both bodies, or some of the problem's own sizes, as deviations from drawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fcdm_opt.design.distributions import Distribution
from fcdm_opt.errors import InputError, closest
from fcdm_opt.geometry.arrays import Array, Flags, frozen, numbers
from fcdm_opt.geometry.size import Size
from fcdm_opt.plain import Plain
from fcdm_opt.problem import arguments
from fcdm_opt.problem.problem import SCALES as SCALES  # as those that speak of pairs know it
from fcdm_opt.problem.problem import Problem
from fcdm_opt.problem.scene import Scene

MOST_OVER = 6  # sizes of a map: with each more it takes several times as many solves
MOST = 10**7  # draws at most, all kept in memory: more tell nothing new


@dataclass(frozen=True, eq=False)
class Sizes(Plain):
    """All size pairs of a box, or those of a list."""

    box: Array  # (low, high) of rho_1 and of rho_2, (2, 2); that of the list where there is one
    _: KW_ONLY
    pairs: Array | None = None  # the list, (n, 2)

    @classmethod
    def of(cls, sizes: Any) -> Sizes:
        """Return the size pairs of a list, each once, or all that two distributions can give."""
        given = sources(sizes)
        if isinstance(given, tuple):
            return cls(frozen([source.range for source in given]))
        rows = np.unique(given, axis=0)
        return cls(frozen(np.column_stack([rows.min(axis=0), rows.max(axis=0)])), pairs=frozen(rows))

    @cached_property
    def corners(self) -> Array:
        """The corners of the box, (c, 2), each once; the list itself where there is one."""
        if self.pairs is not None:
            return self.pairs
        (a, b), (c, d) = self.box
        return frozen(np.unique([(x, y) for x in (a, b) for y in (c, d)], axis=0))

    @property
    def middle(self) -> Array:
        """Middle of the box, (2,)."""
        return np.asarray(self.box.mean(axis=1))

    @property
    def half(self) -> Array:
        """Half its widths, (2,)."""
        return np.asarray((self.box[:, 1] - self.box[:, 0]) / 2.0)


def tolerance_box(problem: Scene) -> Array:
    """Return the scales that a problem's tolerance allows, (2, 2): nominal * (1 - minus) to nominal * (1 + plus).

    Raises `InputError` if it has none (it was given a target, or is an assembly), or one of 100 % and more.
    """
    if not isinstance(problem, Problem) or problem.tolerance is None:
        allowed = (
            "a problem with a tolerance, a box ((low_1, high_1), (low_2, high_2)), or sizes; "
            "on the command line --box LOW1,HIGH1,LOW2,HIGH2 or --sizes CSV"
        )
        what = "there is no tolerance of the scales, so no box of sizes follows from it"
        raise InputError(what, key="box", allowed=allowed)
    ends = problem.nominal_pair[:, None] * (1.0 + problem.tolerance * np.array([-1.0, 1.0]))
    return size_box(ends, "tolerance")


def chosen_sizes(scene: Scene, over: Any) -> tuple[str, ...]:
    """Return the names of the sizes, or scales, that a map is over: one, or a sequence."""
    # by default all sizes, where there are some and no tolerance of the scales; else all scales
    own, scales = tuple(size.name for size in scene.sizes), tuple(scene.nominal_scales)
    asked = (own if by_name(scene) else scales) if over is None else (over,) if isinstance(over, str) else over
    found = tuple(arguments.items(asked))
    if not 1 <= len({*found}) == len(found) <= MOST_OVER or not {*found} <= {*own, *scales}:
        allowed = f"one to {MOST_OVER} of {', '.join((*own, *scales))}"
        unknown = next((name for name in found if isinstance(name, str) and name not in (*own, *scales)), None)
        hint = f": no {unknown!r}{closest(unknown, (*own, *scales))}" if unknown else ""
        hint = ": one is given twice" if not hint and len({*found}) < len(found) else hint
        raise InputError(f"not one to {MOST_OVER} sizes or scales{hint}", key="over", found=over, allowed=allowed)
    return found


def box_over(scene: Scene, names: Sequence[str], box: Any = None) -> Array:
    """Return the box of some sizes or scales, (k, 2): the one given, or what their tolerances leave open."""
    if box is not None:
        return size_box(box, "box", positive=[name in scene.nominal_scales for name in names])
    own = {size.name: size for size in scene.sizes}
    scales = {} if {*names} <= {*own} else dict(zip(scene.nominal_scales, tolerance_box(scene), strict=True))
    return frozen([scales[name] if name in scales else tolerance_boxes([own[name]])[0] for name in names])


def by_name(scene: Scene, sizes: Any = None, box: Any = None) -> bool:
    """Tell whether a scene is asked about its own sizes, not about scales."""
    return bool(scene.sizes) and getattr(scene, "tolerance", None) is None and sizes is None and box is None


def tolerance_boxes(sizes: Sequence[Size]) -> Array:
    """Return the tolerances of sizes, (k, 2): least and largest deviation from drawn."""
    for size in sizes:
        if size.tolerance is None:
            allowed = "tolerance = 0.05, or a box"
            raise InputError("a size without tolerance", key=f"size '{size.name}'.tolerance", allowed=allowed)
    return frozen([size.tolerance for size in sizes])


def size_box(value: Any, key: str, *, positive: bool | Sequence[bool] | Flags = True) -> Array:
    """Return a box of sizes, > 0 unless they are deviations; a range may be a single size."""
    ends, scales = numbers(value, key), _each(positive)
    ends = ends[None] if ends.shape == (2,) and len(scales) == 1 else ends
    pairs = ", ".join(f"(low_{k}, high_{k})" for k in range(1, len(scales) + 1))
    allowed = f"({pairs}) with {'0 < ' * bool(scales.any())}low <= high, finite"
    if ends.shape != (len(scales), 2) or not np.isfinite(ends).all():
        raise InputError("unusable box of sizes", key=key, found=value, allowed=allowed)
    if not (ends[scales] > 0).all():
        raise InputError("a size in the box is not positive", key=key, found=ends.tolist(), allowed=allowed)
    if not (ends[:, 0] <= ends[:, 1]).all():
        raise InputError("empty box of sizes", key=key, found=ends.tolist(), allowed=allowed)
    return frozen(ends)


def _each(positive: bool | Sequence[bool] | Flags) -> Flags:
    """Return which sizes are scales, > 0, of both where one flag is given."""
    return np.broadcast_to(positive, 2) if np.ndim(positive) == 0 else np.asarray(positive, dtype=bool)


def sources(value: Any, *, positive: bool | Sequence[bool] | Flags = True) -> tuple[Distribution, ...] | Array:
    """Return a distribution for each of k sizes, or a list of them, (n, k), n > 0, all finite."""
    # sizes are > 0 unless they are deviations; there are two unless a flag is given for each
    scales = _each(positive)
    count = len(scales)
    what = "scales > 0" if scales.all() else "deviations" if not scales.any() else "scales > 0 and deviations"
    each = "body" if scales.all() else "size"
    allowed = f"an (n, {count}) array of measured {what}, or a distribution for each {each}"
    if isinstance(value, list | tuple) and any(isinstance(item, Distribution) for item in value):
        if len(value) != count or not all(isinstance(item, Distribution) for item in value):
            raise InputError(f"not {count} distributions", key="sizes", found=value, allowed=allowed)
        for source, scale in zip(value, scales.tolist(), strict=True):
            if scale and not source.range[0] > 0.0:
                raise InputError("sizes must be > 0", key="sizes", found=source)
        return tuple(value)
    pairs = numbers(value, "sizes")
    pairs = pairs[:, None] if pairs.ndim == 1 == count else pairs
    if pairs.size == 0:
        raise InputError("no sizes", key="sizes", found=value, allowed=allowed)
    if pairs.ndim != 2 or pairs.shape[1] != count:
        raise InputError(f"not rows of {count} sizes", key="sizes", found=f"shape {pairs.shape}", allowed=allowed)
    bad = np.flatnonzero(~(np.isfinite(pairs) & ((pairs > 0) | ~scales)).all(axis=1))
    if bad.size:
        what = f"a size is not a {'positive' if scales.any() else 'finite'} number"
        raise InputError(what, key=f"sizes[{bad[0] + 1}]", found=pairs[bad[0]].tolist(), allowed=allowed)
    return frozen(pairs)


def box_of(problem: Problem, sizes: Any, box: Any) -> Array:
    """Return the box that is spoken of: the one given, the problem's tolerance, or all that the sizes may be."""
    if box is not None:
        return size_box(box, "box")
    return tolerance_box(problem) if problem.tolerance is not None or sizes is None else Sizes.of(sizes).box


def worst_sizes(problem: Problem, sizes: Any, box: Any) -> Sizes:
    """Return the size pairs among which the worst is looked for.

    `sizes` is a list, (n, 2), or a distribution for each body: then all that they can give; or there is a `box`,
    (2, 2), in their place; default the problem's tolerance. Raises `InputError` where both are given, and for what is
    no size.
    """
    if sizes is None:
        return Sizes(box_of(problem, None, box))
    if box is not None:
        raise InputError("give a box or sizes, not both", key="sizes", allowed="one of them")
    return Sizes.of(sizes)


def all_sizes(scene: Scene, sizes: Any, box: Any) -> tuple[Sizes, tuple[str, ...]]:
    """Return all sizes that are spoken of, and their names: scales of both bodies or of all parts, or a scene's own."""
    if by_name(scene, sizes, box):
        return Sizes(tolerance_boxes(scene.sizes)), tuple(size.name for size in scene.sizes)
    if isinstance(scene, Problem):
        return worst_sizes(scene, sizes, box), SCALES
    parts = tuple(scene.drawn)
    if box is None:
        what = "scales of an assembly's parts have no tolerance, so no box of sizes follows from them"
        raise InputError(what, key="box", found=sizes, allowed="(low, high), the scales of all parts; or sizes by name")
    return Sizes(frozen(np.tile(size_box([box, box], "box")[0], (len(parts), 1)))), parts


def drawn_pairs(
    sizes: Any, box: Any, count: int, seed: int, *, positive: bool | Sequence[bool] | Flags = True
) -> tuple[Array, str]:
    """Return sizes, (n, k), and what they are: a list itself, else `count` independent draws.

    `sizes` is a list, (n, k), a distribution for each size, or None: all sizes of the box, (k, 2), equally likely.
    `positive`, once or for each size, tells whether they are scales, > 0; else deviations.
    """
    given = None if sizes is None else sources(sizes, positive=positive)
    if isinstance(given, np.ndarray):
        return given, f"{len(given)} measured pairs"
    count = arguments.whole(count, "count", "number of draws", 1, MOST)
    u = np.random.default_rng(arguments.whole(seed, "seed", "seed", 0)).random((count, len(given or box)))
    if given is None:
        return box[:, 0] + u * (box[:, 1] - box[:, 0]), f"{count} pairs of sizes drawn evenly from the box"
    drawn = np.column_stack([source.quantile(u[:, k]) for k, source in enumerate(given)])
    return drawn, f"{count} {'pairs ' * (len(given) == 2)}drawn from {' and '.join(map(str, given))}"


def proportion_interval(passed: int, count: int, confidence: float, *, independent: bool = True) -> tuple[float, float]:
    """Return Clopper and Pearson's interval of a share of which `passed` of `count` draws are known.

    Of a Latin hypercube, whose draws are not independent, that of one independent draw less: the share varies no more
    (A. B. Owen, Monte Carlo variance of scrambled net quadrature, SIAM J. Numer. Anal. 34, 1997, section 3).
    """
    from scipy.special import betaincinv

    of = count - (not independent)
    within, tail = passed * of / count, (1.0 - confidence) / 2.0
    low = betaincinv(within, of - within + 1.0, tail) if passed and of else 0.0
    high = betaincinv(within + 1.0, of - within, 1.0 - tail) if passed < count and of else 1.0
    return float(low), float(high)


def not_counted(permanent: Sequence[str], but: str = "and not counted") -> list[str]:
    """Return in words that contacts are not counted, or what else follows from them, [] where all are."""
    return [f"closed at all these sizes, {but}: {'; '.join(permanent)}"] if permanent else []


def beyond_tolerances(scene: Scene) -> list[str]:
    """Return which sizes made are outside of their tolerances, in a sentence: a slip of a digit looks like that."""
    found = []
    for size in scene.sizes if scene.made else ():
        off = scene.made[size.name]
        if size.is_beyond(off):
            low, high = (size.deviation_text(end, "") for end in size.tolerance or ())
            found.append(f"{size.name} {size.deviation_text(off, scene.unit)} ({low} to {high})")
    return [f"made beyond the tolerance: {', '.join(found)}"] if found else []
