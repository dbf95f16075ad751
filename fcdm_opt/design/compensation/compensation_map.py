"""The compensation map: the smallest motion for all sizes in a box, one to six of them, for the shop floor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fcdm_opt import pacing
from fcdm_opt.design.compensation.refined_mesh import SHORTEST, RefinedMesh
from fcdm_opt.design.compensation.sampling import MOTIONLESS, UNDECIDED, ActiveSet, Sampler, asked, covered
from fcdm_opt.design.compensation.size_mesh import Facet
from fcdm_opt.design.compensation.table import MapPoints, Table, amounts_of, box_text, simplices, volumes
from fcdm_opt.errors import InputError, known_arguments
from fcdm_opt.geometry.arrays import Array, Flags, Ints, frozen
from fcdm_opt.geometry.facet_errors import known_to
from fcdm_opt.geometry.units import measured
from fcdm_opt.judge.sampled_sizes import MotionClaims
from fcdm_opt.lazy_import import NotebookRepr
from fcdm_opt.model.true_faces import on_true_faces
from fcdm_opt.moved_files import of_json, read, to_csv, to_json
from fcdm_opt.plain import Plain
from fcdm_opt.problem.arguments import is_real, positive, whole
from fcdm_opt.problem.assembly import Assembly
from fcdm_opt.problem.assembly_file import scene_of
from fcdm_opt.problem.problem import SCALES, Problem
from fcdm_opt.problem.scene import Scene
from fcdm_opt.solver import solve

BUDGET = 20_000
SAMPLED, SEED = 8, 20_011  # sizes at which the judge looks at the motions
SECONDS, LATE = 120.0, "the time given is too short to tell why"
_FORMAT = "fcdm_opt compensation map 1"


@dataclass(frozen=True, kw_only=True, eq=False)
class MapRegion(ActiveSet, Plain):
    """Sizes for which the motion is held by the same constraints, an active set."""

    share: float  # of the box's length, area or volume
    place: Array  # sizes well inside, (k,)
    amounts: tuple[float, float]  # least and largest amount at the table's nodes, length units; nan without a motion


@dataclass(frozen=True, kw_only=True, eq=False)
class Boundary(Plain):
    """Where one region ends and another begins."""

    regions: tuple[int, int]  # numbers of both, from 0
    # sizes on it, (n, k): the one where it is a switching point of a map over one size; of two sizes those of a line,
    # in order; of more all that its surface was found at
    points: Array
    jumps: bool  # whether the motion, or its amount, jumps there


@dataclass(frozen=True, kw_only=True, eq=False)
class CompensationMap(Plain, NotebookRepr):
    """The smallest motion as a function of the sizes made, over a box of sizes.

    Attributes
    ----------
    problem : dict
        The problem or assembly as plain data, None where it cannot be written down (an amount of one's own).
    over : tuple of str
        The k sizes, one to six: "rho_1" and "rho_2", the scales, of an assembly's parts "scales.PART", or names of its
        own sizes; these are deviations from drawn.
    box : (k, 2) array
        Least and largest of each.
    nominal : (k,) array
        Nominal sizes, 0 for deviations.
    table : Table
        Intervals, triangles, tetrahedra, ... that interpolate amount and parameters, with bounds of their errors.
    regions : tuple of MapRegion
        Largest first; `table.regions` counts them from 0.
    boundaries : tuple of Boundary
    error : float
        What amount and motion were asked to be within, length units.
    reached : float
        Largest bound outside the strips and specks in which jumps lie, see `Table.errors` there; above `error` where
        the budget was spent, infinite where the time was over before all of the box was looked at.
    solved : int
        Number of sizes, all of them given, that were solved and judged.
    seconds : float
        Wall time of building.
    stopped : str
        Why `error` is not met, and where it is missed most, in words; nothing where it is met.
    known_to : tuple of str
        How well gaps are known, in words, and why, where facets of round faces or approximate parts leave more open
        than the digits of files: amounts are those of the meshes. Nothing where they are those of the true faces.
    reason : str
        Why no size has a motion, of those in the middle of the box. Nothing where one has, or may have.
    """

    plain_names: ClassVar[tuple[str, ...]] = (
        "format", "problem", "over", "box", "nominal", "error", "reached", "undecided", "solved", "seconds",
        "stopped", "known_to", "reason", "regions", "boundaries", "table",
    )  # fmt: skip
    format: ClassVar[str] = _FORMAT

    problem: Mapping[str, Any] | None
    over: tuple[str, ...]
    box: Array
    nominal: Array
    table: Table
    regions: tuple[MapRegion, ...]
    boundaries: tuple[Boundary, ...]
    error: float
    reached: float
    solved: int
    seconds: float
    known_to: tuple[str, ...] = ()
    stopped: str = ""
    reason: str = ""

    @property
    def without_motion(self) -> bool:
        """Whether it has no motion of any size: there is none, or it is not known."""
        return all(math.isnan(region.amounts[1]) for region in self.regions)

    @property
    def undecided(self) -> float:
        """Share of the box of which the time did not tell whether there is a motion, or which of several."""
        return sum(region.share for region in self.regions if region.kind == UNDECIDED.kind)

    @property
    def unit(self) -> str:
        """Unit of amounts and errors, "" where the problem names none or has an amount of its own."""
        if self.problem is None or isinstance(self.problem["case"][0].get("amount"), Mapping):
            return ""
        tables = self.problem.get("part") or [self.problem["bodies"]["movable"]]
        return str(tables[0].get("unit", ""))

    @property
    def scaled(self) -> Flags:
        """Which of the sizes are scales, > 0; the others are deviations from drawn."""
        return frozen(np.asarray(self.nominal) > 0.0, np.bool_)

    def at(self, *sizes: ArrayLike) -> MapPoints:
        """Return the motion at sizes, an argument each, with bounds of its error, see `Table.at`.

        Raises
        ------
        InputError
            As `Table.at`, and for sizes outside the map's box, of which `self.table.at` says nan and region -1.
        """
        points = self.table.at(*sizes)
        if count := int(np.count_nonzero(points.region < 0)):
            first = np.stack(np.broadcast_arrays(*sizes), axis=-1)[points.region < 0][0].tolist()
            what = f"{count} of {points.region.size} asked are sizes of which the map says nothing"
            allowed = f"{', '.join(self.over)} within {box_text(self.box)}; map.table.at(...) answers others with nan"
            raise InputError(what, key="sizes", found=first, allowed=allowed)
        return replace(points, posed=None if self.problem is None else self._transforms)

    def claims(self, *, proof: bool = False) -> MotionClaims:
        """Return what `verify` looks at: the motions at some sizes of the box.

        Raises
        ------
        InputError
            Where the map does not know what it is a map of.
        """
        shares = np.random.default_rng(SEED).random((SAMPLED, len(self.over)))
        return self.claims_at(self.box[:, 0] + shares * np.ptp(self.box, axis=1))

    def claims_at(self, places: Array) -> MotionClaims:
        """Return the same of the motions at given sizes, (n, k)."""
        points = self.table.at(*places.T)
        return MotionClaims(
            scene=self.scene,
            over=self.over,
            places=places,
            parameters=points.parameters,
            amounts=points.amount,
            errors=np.column_stack([points.error, points.displacement_error]),
            on_true_faces=on_true_faces(self.scene),
        )

    @cached_property
    def scene(self) -> Problem | Assembly:
        """What it is a map of; raises `InputError` where that cannot be written down."""
        if self.problem is None:
            raise InputError("the map knows no problem: its amount is one of your own", key="problem", found=None)
        return scene_of(self.problem)

    def _transforms(self, parameters: Array) -> Array | dict[str, Array]:
        """Return the transforms, (..., 4, 4), of motions, (..., k); of an assembly by part."""
        unknown = np.asarray(np.isnan(parameters).any(axis=-1))[..., None, None]
        posed = {
            part: np.where(unknown, np.nan, own.transforms(parameters).reshape(*parameters.shape[:-1], 4, 4))
            for part, own in self.scene.kinematics.items()
        }
        return posed if isinstance(self.scene, Assembly) else posed["movable"]

    def __str__(self) -> str:
        names = "" if self.over == SCALES else f"{' and '.join(self.over)}, "
        head = f"compensation map over {names}{box_text(self.box)}: "
        if all(region.kind == UNDECIDED.kind for region in self.regions):
            return f"{head}nothing is known of any size: {self.stopped}"
        if self.reason:
            return f"{head}no size has a motion, in the middle of them: {self.reason}"
        return (
            f"{head}{len(self.regions)} "
            f"region{'s' * (len(self.regions) != 1)}, {simplices(len(self.table), len(self.over))}, "
            f"error {self.error_text}, "
            f"{f'{self.undecided:.3%} of the box undecided, ' if self.undecided else ''}"
            f"{self.solved} solves in {self.seconds:.1f} s{''.join(f'; {text}' for text in self.known_to)}"
        )

    @property
    def error_text(self) -> str:
        """The error in words, with what was asked for, and why it is missed."""
        reached = measured(self.reached, self.unit, 3)
        if not math.isfinite(self.reached):
            sizes, unknown = np.abs(volumes(self.table.corners)), np.isnan(self.table.errors).any(axis=1)
            share = sizes[unknown].sum() / sizes.sum()
            reached = f"not known of {f'{share:.0%}' if share > 0.005 else 'less than 1%'} of the box"
        asked = measured(self.error, self.unit, 3)
        return f"{reached} (asked for {': '.join(filter(None, (asked, self.stopped)))})"

    def __repr__(self) -> str:
        """Return what it covers, and how well, on one line."""
        return f"CompensationMap({str(self).removeprefix('compensation map ')})"

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> CompensationMap:
        """Rebuild a map from `to_dict`; raises `InputError` for anything else."""
        if not isinstance(data, Mapping) or data.get("format") != _FORMAT:
            raise InputError("not a compensation map", allowed=f"format = {_FORMAT!r}")
        return super().from_dict({"over": SCALES, "stopped": "", "reason": "", **data})  # keys that older files lack

    def to_json(self, path: str | Path) -> None:
        """Write the whole map as JSON; the file is there as a whole or not at all."""
        to_json(path, self.to_dict())

    @classmethod
    def read(cls, path: str | Path) -> CompensationMap:
        """Read what `to_json` wrote; raises `InputError` naming the file."""
        return read(path, lambda text: cls.from_dict(of_json(text)))

    def to_csv(self, path: str | Path) -> None:
        """Write the table as CSV, see `Table.to_csv`; and beside it the regions, as `<name>-regions.csv`."""
        path = Path(path)
        rows = [
            [number, region.kind, "; ".join(region.features), "; ".join(region.active), region.share, *region.amounts]
            for number, region in enumerate(self.regions)
        ]
        self.table.to_csv(path, *([] if self.over == SCALES else [self.over]))
        columns = ["region", "kind", "features", "active", "share", "least_amount", "largest_amount"]
        to_csv(path.with_name(f"{path.stem}-regions.csv"), [columns, *rows])


@known_arguments
def compensation_map(
    problem: Scene,
    *,
    over: Any = None,
    box: Any = None,
    error: float | None = None,
    budget: int = BUDGET,
    seconds: float = SECONDS,
    jobs: int = 1,
) -> CompensationMap:
    """Work out the smallest motion for all sizes in a box.

    Parameters
    ----------
    problem : Problem or Assembly
        Its requirement or target is replaced by the sizes. Any goal but "beyond".
    over : name, or sequence of names, optional
        One to six of the problem's own sizes, or of the scales of parts: "rho_1" and "rho_2", of an assembly
        "scales.PART". All others stay as they are made. Default: all its sizes; the scales of both bodies where it has
        a tolerance of them or no sizes of its own.
    box : ((low_1, high_1), ...), optional
        Sizes to cover; default: what the problem's tolerance leaves open about its nominal pair, or the tolerances of
        the sizes, as deviations from drawn. Scales of an assembly's parts have no tolerance, and need one.
    error : float, optional
        Length that amount, and displacements of a part that moves, may be off by; default: 1e-4 of the largest amount.
    budget : int
        Number of sizes to be solved for, about; when it is spent the map tells what error it reached.
    seconds : float
        The same of the time; what was reached by then depends on the machine. Sizes of which it is not known by then
        whether there is a motion, or which of several, are a region "undecided"; errors of amounts that were not looked
        at are nan.
    jobs : int
        Processes; more than one pays from about a thousand solves on.

    Returns
    -------
    CompensationMap

    Raises
    ------
    InputError
        For goal "beyond", a resolution, and a box that is none.
    """
    start = perf_counter()
    names, made = covered(problem, box, over)
    for key, value in (("budget", budget), ("jobs", jobs)):
        whole(value, key, "number", 1)
    if error is not None:
        positive(error, "error")
    if not (is_real(seconds) and seconds > 0):
        raise InputError("not a time", key="seconds", found=seconds, allowed="a number > 0")
    with pacing.within(seconds, share=1.0):
        sampler = Sampler(problem, made, budget, jobs, names)
        mesh = RefinedMesh(sampler, error)
        mesh.refine()
        reached, stopped = _largest_error(mesh)
        table, sets = _table(mesh)
        reason = "" if {*sets} - MOTIONLESS else pacing.in_time(_reason, problem, made.mean(axis=1), names, late=LATE)
    return CompensationMap(
        problem=_plain(problem),
        over=names,
        box=frozen(made),
        nominal=frozen([problem.nominal_scales.get(name, 0.0) for name in names]),
        table=table,
        regions=_regions(table, sets),
        boundaries=tuple(_boundaries(mesh, sets)),
        error=float(mesh.error),
        reached=reached,
        solved=len(sampler.known),
        seconds=perf_counter() - start,
        stopped=stopped,
        reason=reason,
        known_to=() if on_true_faces(problem) else tuple(known_to(problem.bodies, problem.unit)),
    )


def _reason(problem: Scene, made: Array, names: Sequence[str]) -> str:
    """Return why some sizes have no motion."""
    solution = solve(asked(problem, made, names), effort="quick")
    return "" if solution.usable else solution.reason or solution.status.words


def _largest_error(mesh: RefinedMesh) -> tuple[float, str]:
    """Return the largest error outside strips and specks; where it is more than asked for, why, and where it is."""
    smooth = [simplex for simplex in mesh.simplices if mesh.size(simplex) > 2.0 * SHORTEST]
    errors = np.nan_to_num([simplex.errors.max() for simplex in smooth], nan=math.inf)
    if not smooth or math.isinf(errors.max()):
        return math.inf, mesh.sampler.short
    worst = int(errors.argmax())
    if errors[worst] <= mesh.error:
        return float(errors[worst]), ""
    centre = mesh.sampler.made(mesh.places(smooth[worst]).mean(axis=0)).tolist()
    where = ", ".join(f"{name} {x:.4g}" for name, x in zip(mesh.sampler.over, centre, strict=True))
    cause = f"{mesh.sampler.short}, " if mesh.sampler.rough else ""
    return float(errors[worst]), f"{cause}largest near {where}"


def _table(mesh: RefinedMesh) -> tuple[Table, list[ActiveSet]]:
    """Return the table and the active sets of its regions, the largest first."""
    places, values, errors, held = zip(*mesh.finished(), strict=True)
    sizes: dict[ActiveSet, float] = {}
    for size, one in zip(np.abs(volumes(np.array(places))).tolist(), held, strict=True):
        sizes[one] = sizes.get(one, 0.0) + size
    sets = sorted(sizes, key=lambda one: (-sizes[one], one))
    nodes = np.array(values)
    weights, ends = mesh.sampler.weights, nodes[:, : len(mesh.sampler.over) + 1, 0]
    np.maximum(ends, 0.0, out=ends)  # rounding where motions begin
    nodes[..., 0] = amounts_of(nodes[..., 1:], nodes[..., 0], weights)
    table = Table(
        corners=mesh.sampler.made(places),
        values=nodes,
        errors=np.array(errors),
        regions=np.array([sets.index(one) for one in held]),
        names=tuple(own.name for own in mesh.sampler.scene.coordinates),
        weights=weights,
    )
    return table, sets


def _regions(table: Table, sets: Sequence[ActiveSet]) -> tuple[MapRegion, ...]:
    sizes = np.abs(volumes(table.corners))
    regions = []
    for number, one in enumerate(sets):
        members = np.flatnonzero(table.regions == number)
        amounts = table.values[members, :, 0]
        finite = amounts[np.isfinite(amounts)]
        ends = (_least(table, members), float(finite.max())) if len(finite) else (math.nan, math.nan)
        place = frozen(table.corners[members[np.argmax(sizes[members])]].mean(axis=0))
        share = float(sizes[members].sum() / sizes.sum())
        regions.append(MapRegion(**vars(one), share=share, place=place, amounts=ends))
    return tuple(regions)


def _least(table: Table, members: Ints) -> float:
    """Return the least amount over some simplices, by the hulls of their nodes' motions: 0 is there."""
    from scipy.optimize import nnls

    values = table.values[members]
    least = max(float(np.nanmin(np.where(np.isfinite(values[..., 0]), values[..., 0], np.nan))), 0.0)
    q, found = values[..., 1:] * np.asarray(table.weights or math.nan), least
    for own in q[np.isfinite(q).all(axis=(1, 2))] if least > 0.0 else ():
        # a hull's point nearest to 0 has the shares that bring (own, 1) nearest to (0, 1)
        rows = np.column_stack([own / least, np.ones(len(own))])
        shares, _ = nnls(rows.T, np.eye(rows.shape[1])[-1])
        if shares.any():  # none where its nodes are all far beyond the least
            found = min(found, float(np.linalg.norm(shares @ own)) / float(shares.sum()))
    return found if found > np.nanmax(table.errors[members, 0], initial=0.0) else 0.0


def _boundaries(mesh: RefinedMesh, sets: Sequence[ActiveSet]) -> list[Boundary]:
    boundaries = []
    for (one, two), facets in mesh.boundaries().items():
        low, high = sorted((sets.index(one), sets.index(two)))
        for jumps in (False, True):
            for piece in _pieces([facet for facet in facets if mesh.jumps(facet) == jumps], mesh.sizes):
                points = mesh.sampler.made([mesh.vertices[k].place for k in piece])
                boundaries.append(Boundary(regions=(low, high), points=frozen(points), jumps=jumps))
    return sorted(boundaries, key=lambda boundary: (boundary.regions, boundary.points[0].tolist()))


def _pieces(facets: Sequence[Facet], sizes: int) -> list[list[int]]:
    """Return the vertices of a boundary by its pieces: single ones of one size, lines of two, else a surface."""
    if sizes == 2:
        return _chains(facets)
    if sizes == 1:
        return [list(facet) for facet in facets]
    return [sorted({own for facet in facets for own in facet})] if facets else []


def _chains(edges: Sequence[Facet]) -> list[list[int]]:
    """Join edges that share ends to chains; where three or more meet, chains end."""
    around: dict[int, list[int]] = {}
    for i, j in edges:
        around.setdefault(i, []).append(j)
        around.setdefault(j, []).append(i)
    open_edges, chains = {frozenset(ends) for ends in edges}, list[list[int]]()
    for start in sorted(around, key=lambda k: (len(around[k]) == 2, k)):  # closed chains last
        for step in around[start]:
            chain = [start, step]
            while frozenset(chain[-2:]) in open_edges:
                open_edges.discard(frozenset(chain[-2:]))
                onward = [k for k in around[chain[-1]] if frozenset((chain[-1], k)) in open_edges]
                if len(around[chain[-1]]) != 2 or not onward:
                    chains.append(chain)
                    break
                chain.append(onward[0])
    return chains


def _plain(problem: Scene) -> dict[str, Any] | None:
    try:
        return problem.to_dict()
    except InputError:
        return None
