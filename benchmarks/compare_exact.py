"""Compare the decision curve in floats with exact arithmetic on random pairs of convex parts with integer vertices.

    python benchmarks/compare_exact.py SEED COUNT [--pairs aligned] [--processes 2] [--oracle 0.01] [--json FILE]

Pair k is drawn from (SEED, k) alone, so that a disagreement can be drawn again. Reaches and kinds of seeds (inside, on
a vertex, on a face, anywhere) take turns; `aligned` ones are boxes, prisms and pyramids along the axes, and of
`unions` of such the curve with all regions in floats is compared with that of regions in rational numbers. Ends with 1
if anything disagrees.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import numpy as np

from fcdm_opt_benchmarks.record import table
from fcdm_opt_benchmarks.scripts import chunks, describe, in_pieces

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from cases import Shape, exact
from curve_checks import ODD_BOX, SEED_PAIRS
from oracles import Vec, box_lines, clipped, dot, feature_label, plane_point, root
from strategies import aligned_pair, aligned_union, random_pair

from fcdm_opt.curve import kernels, pruning
from fcdm_opt.curve.decision_curve import DecisionCurve, decision_curve
from fcdm_opt.curve.exact import exact_curve
from fcdm_opt.curve.features import Feature
from fcdm_opt.curve.region import Region
from fcdm_opt.curve.segments import Segment
from fcdm_opt.geometry.bodies import Body

REACHES = (2, 3, 10, 1000)
UNIT = 1e-13  # what is allowed, and the unit of all errors reported
ALIGNED = 4  # reach of aligned parts
CONDITION = 1e3  # of two lines that meet: what the ends of unions' segments may lose
VERTICALS = 4  # values of rho_1 at which rho_2 is compared
CHUNK = 50
SHOWN = 20  # disagreements that are printed

MIDDLE = tuple(float(np.mean(bounds)) for bounds in ODD_BOX)

Line = tuple[Fraction, Fraction, Fraction]


class Boundary(NamedTuple):
    """An exact piece of the boundary in the whole quadrant.

    Vertices that touch, 1-based; line (a, b, c) of a unit normal, rounded far below a float; whether the features leave
    only that normal; homogeneous ends (x, y, w), coprime.
    """

    one: tuple[int, ...]
    two: tuple[int, ...]
    line: Line
    unit: bool
    start: Vec
    end: Vec


class Clipped(NamedTuple):
    """A piece clipped to the box: ends, and the line that meets it at each, the next piece's or a side of the box."""

    piece: Boundary
    ends: tuple[tuple[Fraction, Fraction], tuple[Fraction, Fraction]]
    crossing: tuple[Line, Line]

    @property
    def feature(self) -> Feature:
        """What touches."""
        return Feature.from_label(feature_label(self.piece.one, self.piece.two))


class Reference(NamedTuple):
    """An exact curve: status and segments in the box."""

    status: str
    stretches: list[Clipped]

    @classmethod
    def of(cls, pieces: list[Boundary], side: int) -> Reference:
        """Clip pieces to the box; `side` is that of its middle."""
        stretches = []
        for piece in pieces:
            ends = [piece.start, piece.end]
            for line in box_lines(ODD_BOX):
                ends = clipped(ends, line)
            if len(ends) == 2:
                p, q = (plane_point(end) for end in ends)
                r, s = (_crossing(pieces, piece, end) for end in ends)
                stretches.append(Clipped(piece, (p, q), (r, s)))
        return cls("contact" if stretches else "overlapping" if side < 0 else "apart", stretches)

    def rho2(self, rho1: float) -> Fraction | None:
        """Return the least contact scale in the box."""
        x, found = Fraction(rho1), []
        for stretch in self.stretches:
            a, b, c = stretch.piece.line
            low, high = sorted(end[0] for end in stretch.ends)
            if b and low <= x <= high:
                found.append((c - a * x) / b)
        return min(found, default=None)


def _crossing(pieces: list[Boundary], piece: Boundary, end: Vec) -> Line:
    for other in pieces:
        if other is not piece and end in (other.start, other.end):
            return other.line
    for axis, bounds in enumerate(ODD_BOX):
        for bound in bounds:
            if plane_point(end)[axis] == Fraction(bound):
                return Fraction(1 - axis), Fraction(axis), Fraction(bound)
    raise AssertionError("an end that is neither a corner nor on the border")


def oracle_reference(one: Shape, two: Shape) -> Reference:
    """Enumerate all facets of the Minkowski difference in integers: tests/support/oracles.py."""
    pair = exact(one, two).pair
    pieces = []
    for piece in pair.pieces:
        facet = piece.facets[0]
        length = pair.unit * root(dot(facet.normal, facet.normal))
        a, b, c = (x / length for x in facet.line)
        pieces.append(Boundary(piece.one, piece.two, (a, b, c), len(piece.facets) == 1, piece.start, piece.end))
    return Reference.of(pieces, pair.side(MIDDLE))


def exact_reference(one: Body, two: Body) -> Reference:
    """Walk the shadow of the contact program in rationals: the package's own exact path."""
    curve = exact_curve(one.parts[0], two.parts[0], np.eye(4))
    pieces = []
    for piece in curve.pieces:
        length = root(sum(int(x) ** 2 for x in piece.exact_normal))
        a, b, c = (Fraction(int(x.p), int(x.q)) / length for x in piece.exact_line)
        spans = [body.parts[0].vertices[list(own)] for body, own in zip((one, two), piece.touching, strict=True)]
        sides = np.vstack([rows[1:] - rows[0] for rows in spans])  # integers: exact, also in the products below
        only = len(sides) > 1 and bool(np.cross(sides[:, None], sides[None]).any())
        ends = [tuple(int(x) for x in end) for end in (piece.exact_start, piece.exact_end)]
        labels = [tuple(k + 1 for k in own) for own in piece.touching]
        pieces.append(Boundary(labels[0], labels[1], (a, b, c), only, ends[0], ends[1]))
    return Reference.of(pieces, curve.side(MIDDLE) if curve.status != "full" else -1)


@dataclass
class Tally:
    """What was compared, and what came of it: counts by name, "path: float", the largest errors in units of 1e-13."""

    counts: Counter[str] = field(default_factory=Counter)
    examples: list[str] = field(default_factory=list)
    worst: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def timed(self, what: str) -> Iterator[None]:
        """Add up seconds."""
        start = time.perf_counter()
        yield
        self.counts[f"seconds: {what}"] += time.perf_counter() - start  # type: ignore[assignment]

    def disagree(self, what: str, where: str) -> None:
        """Count a disagreement, and keep it."""
        self.counts[f"disagreement: {what}"] += 1
        self.examples.append(f"{what}: {where}")

    def error(self, what: str, value: float, allowed: float | None, where: str) -> None:
        """Keep the worst error; more than allowed, or not a number, is a disagreement."""
        self.worst[what] = max(self.worst.get(what, 0.0), value / UNIT)
        if allowed is not None and not value <= allowed * UNIT:
            self.disagree(what, f"{where}: {value / UNIT:.3g}, allowed {allowed:.3g}")

    def add(self, other: Tally) -> None:
        """Join two tallies."""
        self.counts.update(other.counts)
        self.examples += other.examples
        self.worst |= {what: max(self.worst.get(what, 0.0), value) for what, value in other.worst.items()}

    def of(self, kind: str) -> list[tuple[str, float]]:
        """Return names and counts of a kind, the largest first."""
        return [(name, count) for name, count in self.counts.most_common() if name.startswith(f"{kind}: ")]


def compare(curve: DecisionCurve, truth: Reference, tally: Tally, verticals: Iterable[float], where: str) -> None:
    """Compare one curve with its reference."""
    tally.counts["pairs"] += 1
    tally.counts[f"status: {truth.status}"] += 1
    if curve.status != truth.status:
        tally.disagree("status", f"{where}: {curve.status}, exactly {truth.status}")
    found = {segment.feature: segment for segment in curve.segments}
    expected = {stretch.feature: stretch for stretch in truth.stretches}
    tally.counts["segments"] += len(expected)
    if set(found) != set(expected) or len(curve.segments) != len(expected):
        labels = [sorted(feature.label for feature in side) for side in (found, expected)]
        tally.disagree("features", f"{where}: {labels[0]}, exactly {labels[1]}")
        return
    corners = 0
    for feature, stretch in expected.items():
        tally.counts[f"feature: {feature.kind}"] += 1
        _compare_line(found[feature], stretch, tally, where)
        corners += _compare_ends(found[feature], stretch, tally, where)
    tally.counts["breakpoints"] += corners // 2
    if len(curve.switching_points) != corners // 2:
        tally.disagree("switching points", f"{where}: {len(curve.switching_points)}, exactly {corners // 2}")
    for rho1 in verticals:
        _compare_rho2(float(curve.rho2(rho1)), rho1, truth, tally, where)


def compare_references(truth: Reference, other: Reference, tally: Tally, where: str) -> None:
    """Compare the two exact references, exactly."""
    tally.counts["checked twice"] += 1
    curves = []
    for reference in (truth, other):
        segments = set()
        for stretch in reference.stretches:
            a, b, c = stretch.piece.line
            top = max(abs(a), abs(b), abs(c))  # the lengths of the normals are rounded, their ratios are not
            line = (a / top, b / top, c / top)
            segments.add((stretch.feature, stretch.piece.unit, line, frozenset(stretch.ends)))
        curves.append(segments)
    if truth.status != other.status or curves[0] != curves[1]:
        tally.disagree("references", f"{where}: {truth.status}, {curves[0] ^ curves[1]}; {other.status}")


def _compare_line(segment: Segment, stretch: Clipped, tally: Tally, where: str) -> None:
    line, (a, b, c) = [Fraction(float(x)) for x in segment.line], stretch.piece.line
    if not stretch.piece.unit:  # several normals give the line: compare it whatever its length
        s, t = root(line[0] ** 2 + line[1] ** 2), root(a * a + b * b)
        line, (a, b, c) = [x / s for x in line], (a / t, b / t, c / t)
    size = max(abs(a), abs(b), abs(c))
    tally.error("line", float(max(abs(x - y) for x, y in zip(line, (a, b, c), strict=True)) / size), 1.0, where)


def _compare_ends(segment: Segment, stretch: Clipped, tally: Tally, where: str) -> int:
    """Compare both ends, in whatever order; return how many are breakpoints."""
    ends = [[Fraction(float(x)) for x in end] for end in (segment.start, segment.end)]
    orders = (ends, ends[::-1])
    errors = [[_distance(p, q) for p, q in zip(order, stretch.ends, strict=True)] for order in orders]
    best = min(errors, key=sum)
    corners = 0
    for error, end, crossing in zip(best, stretch.ends, stretch.crossing, strict=True):
        rows = np.array([[float(x) for x in line[:2]] for line in (stretch.piece.line, crossing)])
        condition = float(np.linalg.cond(rows / np.linalg.norm(rows, axis=1)[:, None]))
        relative = float(error / max(end))
        inside = all(Fraction(low) < x < Fraction(high) for x, (low, high) in zip(end, ODD_BOX, strict=True))
        what = "breakpoint" if inside else "end on the border"
        tally.error(f"{what} over condition", relative / condition, 1.0, where)
        tally.error(what, relative, None, where)
        corners += inside
    return corners


def _distance(p: Iterable[Fraction], q: Iterable[Fraction]) -> Fraction:
    return max(abs(x - y) for x, y in zip(p, q, strict=True))


def _compare_rho2(value: float, rho1: float, truth: Reference, tally: Tally, where: str) -> None:
    expected = truth.rho2(rho1)
    tally.counts["verticals"] += 1
    if (expected is None) != bool(np.isnan(value)):
        tally.disagree("rho2", f"{where}: rho2({rho1!r}) is {value}, exactly {expected and float(expected)}")
    elif expected is not None:
        tally.error("rho2", float(abs(Fraction(value) - expected) / expected), 1.0, f"{where}: rho1 = {rho1!r}")


def run_unions(seed: int, numbers: range, parts: int = 3) -> Tally:
    """Draw some pairs of unions; compare the curves of regions in floats and in rationals."""
    tally = Tally()
    for k in numbers:
        rng = np.random.default_rng([seed, k])
        one, two = (aligned_union(rng, ALIGNED, int(rng.integers(2, parts, endpoint=True))) for _ in range(2))
        bodies = one.body("one"), two.shifted(rng.integers(-9, 9, 3, endpoint=True).tolist()).body("two")
        where = f"unions {k}"
        try:
            with tally.timed("float"):
                curve = decision_curve(*bodies, box=ODD_BOX)
                segments = curve.segments
            with tally.timed("exact"), in_rationals():
                truth = decision_curve(*bodies, box=ODD_BOX)
                expected = truth.segments
            tally.counts["pairs"] += 1
            tally.counts["segments"] += len(expected)
            tally.counts[f"status: {truth.status}"] += 1
            for region in curve.regions:
                tally.counts[f"path: {region.path}"] += 1
            if curve.status != truth.status:
                tally.disagree("status", f"{where}: {curve.status}, exactly {truth.status}")
            labels = [[segment.feature.label for segment in side] for side in (segments, expected)]
            if sorted(labels[0]) != sorted(labels[1]):
                tally.disagree("features", f"{where}: {labels[0]}, exactly {labels[1]}")
                continue
            for own in segments:
                ends = np.array([own.start, own.end])
                same = [other for other in expected if other.feature == own.feature]
                near = [np.abs(ends - [other.start, other.end]).max() for other in same]
                tally.error("ends", float(min(near) / np.abs(ends).max()), CONDITION, where)
        except Exception as reason:
            tally.disagree("exception", f"{where}: {type(reason).__name__}: {reason}")
    return tally


@contextmanager
def in_rationals() -> Iterator[None]:
    """Settle all regions of part pairs in rational numbers."""
    walked = pruning.pair_region
    pruning._regions.cache_clear()
    pruning.pair_region = lambda one, two, transform, parts=(0, 0): Region(  # type: ignore[assignment]
        one, two, transform, parts, kernels.UNDECIDED, None
    )
    try:
        yield
    finally:
        pruning.pair_region = walked
        pruning._regions.cache_clear()


def run(seed: int, numbers: range, oracle: float, pairs: str) -> Tally:
    """Draw and compare some pairs; a share of them with both references."""
    if pairs == "unions":
        return run_unions(seed, numbers)
    tally, step = Tally(), max(1, round(1 / oracle)) if oracle > 0 else sys.maxsize
    for k in numbers:
        rng = np.random.default_rng([seed, k])
        reach, seeds = REACHES[k % len(REACHES)], SEED_PAIRS[k // len(REACHES) % len(SEED_PAIRS)]
        if pairs == "generic":
            reach, seeds = REACHES[-1], SEED_PAIRS[0]
        elif pairs == "aligned":
            reach = ALIGNED
        one, two = (aligned_pair if pairs == "aligned" else random_pair)(rng, reach, seeds)
        verticals = rng.uniform(*ODD_BOX[0], VERTICALS).tolist()
        where = f"pair {k} (reach {reach}, seeds {seeds[0]} and {seeds[1]})"
        bodies = one.body("one"), two.body("two")
        try:
            with tally.timed("exact"):
                truth = exact_reference(*bodies)
            if k % step == 0:
                with tally.timed("oracle"):
                    compare_references(truth, oracle_reference(one, two), tally, where)
            with tally.timed("float"):
                curve = decision_curve(*bodies, box=ODD_BOX)
                tally.counts[f"path: {curve.regions[0].path}"] += 1
            compare(curve, truth, tally, verticals, where)
        except Exception as reason:  # whatever it is, it is a disagreement, and the run goes on
            tally.disagree("exception", f"{where}: {type(reason).__name__}: {reason}")
    return tally


def report(tally: Tally, seed: int, seconds: float) -> str:
    """Tell the results in Markdown."""
    pairs, segments, breakpoints, verticals, twice = (
        f"{tally.counts[key]:,}" for key in ("pairs", "segments", "breakpoints", "verticals", "checked twice")
    )
    wrong = tally.of("disagreement")
    lines = [
        f"Seed {seed}: {pairs} pairs, {segments} segments, {breakpoints} breakpoints and {verticals} values of rho2 "
        f"compared, {twice} pairs with both exact references, in {seconds:.0f} s. {describe()}",
        f"Disagreements: {sum(count for _, count in wrong)}"
        + "".join(f"; {what.partition(': ')[2]}: {count}" for what, count in wrong),
        table(["relative error", "worst, times 1e-13"], [[k, f"{v:.3g}"] for k, v in sorted(tally.worst.items())]),
        table(
            ["", "pairs"],
            [[k, f"{v:,} ({100 * v / tally.counts['pairs']:.3g} %)"] for k, v in tally.of("path")]
            + [[k, f"{v:,}"] for k, v in tally.of("status")],
        ),
        table(["", "in all"], [[k, f"{v:.1f}"] for k, v in tally.of("seconds")]),
        table(["", "segments"], [[k, f"{v:,}"] for k, v in tally.of("feature")]),
        *[f"- {example}" for example in tally.examples[:SHOWN]],
    ]
    return "\n\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    """Run the comparison from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("seed", type=int)
    parser.add_argument("count", type=int)
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--oracle", type=float, default=0.01, help="share of pairs beside tests/support/oracles.py")
    parser.add_argument(
        "--pairs",
        choices=("random", "generic", "aligned", "unions"),
        default="random",
        help="random hulls; generic: large coordinates and seeds inside only; parts along the axes; unions of such",
    )
    parser.add_argument("--json", type=Path, help="write all counts there")
    given = parser.parse_args(arguments)
    start = time.perf_counter()
    tally = Tally()
    pieces = [(given.seed, chunk, given.oracle, given.pairs) for chunk in chunks(given.count, CHUNK)]
    for found in in_pieces(run, pieces, given.processes):
        tally.add(found)
    print(report(tally, given.seed, time.perf_counter() - start))
    if given.json is not None:
        given.json.write_text(json.dumps(vars(tally), indent=1) + "\n")
    return 1 if tally.examples or tally.counts["pairs"] != given.count else 0


if __name__ == "__main__":
    sys.exit(main())
