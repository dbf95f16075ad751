"""Compensation maps against closed forms and against solving single pairs of sizes."""

import json
import math
import os
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt import pacing
from fcdm_opt.design.compensation import sampling
from fcdm_opt.design.compensation.compensation_map import CompensationMap, _least, compensation_map
from fcdm_opt.design.compensation.sampling import asked
from fcdm_opt.design.compensation.table import Table
from fcdm_opt.errors import InputError
from fcdm_opt.model.task import Task
from fcdm_opt.show.grids import grids

PROBLEMS = "problems"


def cube(half: float, centre=(0.0, 0.0, 0.0), name: str = "cube") -> fo.Body:
    corners = np.array([[(-1, 1)[k >> axis & 1] for axis in range(3)] for k in range(8)], dtype=float)
    return fo.Body.convex(half * corners + centre, seed=np.array(centre), name=name)


def slab(goal: str = "touch", **more) -> fo.Problem:
    """A probe, a cube of half-width 1 at x = 4, before a slab of half-width 3: the gap is 4 - rho_1 - 3 rho_2."""
    given = {"nominal": (1.0, 1.0), "tolerance": 0.02, "requirement": "A", "motion": fo.Translation("x")}
    return fo.Problem(cube(1.0, (4.0, 0.0, 0.0), "probe"), cube(3.0, name="slab"), **{**given, "goal": goal, **more})


@cache
def slab_map(goal: str) -> CompensationMap:
    return compensation_map(slab(goal))


@cache
def example(name: str, case: int) -> tuple[fo.Problem, CompensationMap]:
    problem = fo.load_problems(f"{PROBLEMS}/{name}.toml")[case]
    return problem, compensation_map(problem)


def pairs(found: CompensationMap, count: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(found.box[:, 0], found.box[:, 1], (count, 2))


@pytest.mark.usefixtures("coarse_maps")
def test_touching_a_slab_is_linear_on_both_sides_of_contact():
    found = slab_map("touch")
    rho = pairs(found, 1000, 1)
    gap = 4.0 - rho[:, 0] - 3.0 * rho[:, 1]
    at = found.at(*rho.T)
    assert (np.abs(at.amount - np.abs(gap)) <= at.error).all()
    assert (np.abs(at.parameters[:, 0] + gap) <= at.displacement_error).all()
    assert (at.error <= found.error).all()
    assert [region.kind for region in found.regions] == ["motion"]  # the same faces hold it, gap or overlap
    assert not found.boundaries


@pytest.mark.usefixtures("coarse_maps")
def test_half_of_the_box_needs_no_motion_to_be_clear():
    found = slab_map("clear")
    rho = pairs(found, 1000, 2)
    gap = 4.0 - rho[:, 0] - 3.0 * rho[:, 1]
    at = found.at(*rho.T)
    assert (np.abs(at.amount - np.maximum(-gap, 0.0)) <= at.error).all()
    assert sorted(region.kind for region in found.regions) == ["already satisfied", "motion"]
    assert [region.share for region in found.regions] == pytest.approx([0.5, 0.5], abs=1e-6)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_beyond_a_limit_there_is_no_motion():
    found = compensation_map(slab(limits={"TX": (-0.05, 0.05)}), error=1e-3)
    rho = pairs(found, 1000, 3)
    gap = 4.0 - rho[:, 0] - 3.0 * rho[:, 1]
    at = found.at(*rho.T)
    far = np.abs(np.abs(gap) - 0.05) > 1e-7
    assert (np.isfinite(at.amount) == (np.abs(gap) <= 0.05))[far].all()
    assert "no motion" in {region.kind for region in found.regions}
    edge = [own for own in found.boundaries if "no motion" in {found.regions[k].kind for k in own.regions}]
    for boundary in edge:
        assert np.abs(np.abs(4.0 - boundary.points @ [1.0, 3.0]) - 0.05).max() <= 1e-8


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_map_agrees_with_single_solves_on_example_1():
    problem, found = example("example1_touch", 0)
    assert len(found.regions) == 2
    assert found.reached <= found.error
    rho = pairs(found, 8, 4)
    at, task = found.at(*rho.T), Task.of(problem)
    for k, pair in enumerate(rho):
        solution = fo.solve(asked(problem, pair))
        assert solution.usable
        assert abs(solution.amount - at.amount[k]) <= at.error[k]
        change = task.transform(np.array(list(solution.parameters.values()))) - task.transform(at.parameters[k])
        made = problem.movable.seed + pair[0] * (problem.movable.vertices - problem.movable.seed)
        assert np.linalg.norm(made @ change[:3, :3].T + change[:3, 3], axis=1).max() <= at.displacement_error[k]


@pytest.mark.usefixtures("coarse_maps")
def test_boundaries_of_example_1_are_where_another_feature_holds_the_motion():
    _, found = example("example1_touch", 0)
    assert found.boundaries
    for boundary in found.boundaries:
        assert len({found.regions[k].features for k in boundary.regions}) == 2


@pytest.mark.usefixtures("coarse_maps")
def test_a_map_survives_json_and_csv(tmp_path):
    found = slab_map("clear")
    found.to_json(tmp_path / "map.json")
    again = CompensationMap.read(tmp_path / "map.json")
    assert json.dumps(again.to_dict()) == json.dumps(found.to_dict())
    found.to_csv(tmp_path / "map.csv")
    assert len((tmp_path / "map.csv").read_text().splitlines()) == 1 + len(found.table)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map-regions.csv", "map.csv", "map.json"]
    assert len((tmp_path / "map-regions.csv").read_text().splitlines()) == 1 + len(found.regions)
    with pytest.raises(InputError, match=r"map\.csv: not JSON"):
        CompensationMap.read(tmp_path / "map.csv")
    for wrong in (found.table.to_dict(), {**found.to_dict(), "table": {}}):
        (tmp_path / "map.json").write_text(json.dumps(wrong))
        with pytest.raises(InputError, match=r"map\.json: not (a compensation map|the plain data of a Table)"):
            CompensationMap.read(tmp_path / "map.json")


@pytest.mark.usefixtures("coarse_maps")
def test_no_half_written_file_is_left_and_others_may_read_it(tmp_path, monkeypatch):
    """Written files had the rights of temporary ones: nobody else could read them."""
    found, path = slab_map("clear"), tmp_path / "map.json"
    before = os.umask(0o022)
    try:
        found.to_json(path)
    finally:
        os.umask(before)
    assert path.stat().st_mode & 0o777 == 0o644
    text = path.read_text()

    def full(source, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", full)
    for write in (found.to_json, found.to_csv):
        with pytest.raises(InputError, match="No space left"):
            write(path)
    assert [own.name for own in tmp_path.iterdir()] == ["map.json"]
    assert path.read_text() == text
    with pytest.raises(InputError, match="cannot be written"):
        found.to_json(tmp_path / "none" / "map.json")
    with pytest.raises(InputError, match=r"other\.json"):
        CompensationMap.read(tmp_path / "other.json")


@pytest.mark.usefixtures("coarse_maps")
def test_a_spent_budget_is_told():
    """And where the error is missed most: within the triangle that has it."""
    found = compensation_map(slab(), budget=1, error=1e-9)
    assert found.reached > found.error
    assert "(asked for 1e-09: 1 solves are too few, largest near rho_1 " in str(found)
    at = found.at(*pairs(found, 100, 6).T)
    assert np.isfinite(at.amount).all()
    assert (at.region >= 0).all()
    more = 3 * found.solved // 2  # it was said to be too few, or the time short, with some left
    found = compensation_map(slab(), budget=more, error=1e-9)
    assert found.solved < more
    assert f"(asked for 1e-09: half of {more} solves is for boundaries of regions alone, largest near" in str(found)


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ({"box": ((1.0, 1.0), (0.9, 1.1))}, "box"),
        ({"box": ((-0.1, 1.0), (0.9, 1.1))}, "box"),
        ({"box": ((0.0, 1.0), (0.9, 1.1))}, "box"),
        ({"box": ((0.9, float("nan")), (0.9, 1.1))}, "box"),
        ({"box": (0.9, 1.1)}, "box"),
        ({"box": "wide"}, "box"),
        ({"error": 0.0}, "error"),
        ({"error": float("nan")}, "error"),
        ({"budget": 0}, "budget"),
        ({"jobs": 1.5}, "jobs"),
        ({"seconds": 0.0}, "seconds"),
    ],
)
def test_bad_arguments_are_refused(arguments, key):
    with pytest.raises(InputError, match=key):
        compensation_map(slab(), **arguments)


def test_what_has_no_map_is_refused():
    with pytest.raises(InputError, match="beyond"):
        compensation_map(fo.load_problems(f"{PROBLEMS}/example1.toml")[0])
    with pytest.raises(InputError, match="resolution"):
        compensation_map(slab("clear", resolution=0.01))
    with pytest.raises(InputError, match="box"):
        compensation_map(slab(tolerance=None, requirement=None, target=(1.0, 1.0)))
    with pytest.raises(InputError, match="box"):
        compensation_map(slab(tolerance=0.0))


@pytest.mark.usefixtures("coarse_maps")
def test_the_least_amount_of_a_region_was_that_of_its_nodes() -> None:
    """The sizes as drawn, at which the parts touch, are in one of the regions, which said 7e-4 for 0."""
    found = fo.compensation_map(fo.load_problems("problems/example1_touch.toml")[0])
    assert min(region.amounts[0] for region in found.regions) == 0.0


@pytest.mark.parametrize(("shift", "least"), [(0.0, 0.0), (2.0, math.sqrt(2.0))])
def test_the_least_amount_within_a_triangle_was_that_of_its_nodes(shift: float, least: float) -> None:
    """Motions on (-1, -1), (2.5, -1), (-1, 2) have 0 within; on by 2 both ways (1, 1) is the least."""
    ends = np.array([[-1.0, -1.0], [2.5, -1.0], [-1.0, 2.0]]) + shift
    q = np.concatenate([ends, (ends + np.roll(ends, -1, axis=0)) / 2.0])
    values = np.column_stack([np.linalg.norm(q, axis=1), q])[None]
    table = Table(
        corners=ends[None],
        values=values,
        errors=np.zeros((1, 2)),
        regions=np.zeros(1, int),
        names=("TX", "TY"),
        weights=(1.0, 1.0),
    )
    assert _least(table, np.zeros(1, int)) == pytest.approx(least, abs=1e-12)


def test_the_picture_names_regions_and_corners():
    from fcdm_opt.show.maps import map_figure

    figure = map_figure(slab_map("clear"))
    words = " ".join(text.get_text() for text in (*figure.texts, *figure.axes[0].texts))
    assert "already satisfied" in words
    assert {"A", "B", "C", "D"} <= set(words.split())


def peg(case: int, **changes) -> fo.Problem:
    return fo.load_problems(f"{PROBLEMS}/peg_square.toml")[case].changed(**changes)


@cache
def running() -> CompensationMap:
    limits = {"TX": (-1.0, 1.0), "TY": (-1.0, 1.0)}
    return compensation_map(peg(4, limits=limits), box=((1.01, 1.02), (0.999, 1.0)), error=0.05)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_running_clearance_follows_its_closed_form_and_ends_where_the_hole_is_too_small():
    found = running()
    rho = pairs(found, 1000, 7)
    room = 10.0 * rho[:, 1] - 9.75 * rho[:, 0] - 0.05
    at = found.at(*rho.T)
    assert "no motion" in {region.kind for region in found.regions}
    clear = np.abs(room) > 1e-3
    assert (np.isfinite(at.amount) == (room >= 0))[clear].all()
    good = np.isfinite(at.amount) & (room >= 0)
    shift = np.column_stack([np.minimum(0.0, room - 0.25), np.maximum(0.0, 0.125 - room)])[good]
    assert (np.abs(at.amount[good] - np.hypot(*shift.T)) <= at.error[good]).all()
    assert (np.linalg.norm(at.parameters[good] - shift, axis=1) <= at.displacement_error[good]).all()


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_boundaries_of_the_running_clearance_are_where_the_walls_are():
    found = running()
    for boundary in found.boundaries:
        room = boundary.points @ [-9.75, 10.0] - 0.05
        off = np.abs(np.subtract.outer(room, [0.0, 0.125, 0.25])).min(axis=1)
        assert off.max() <= 1e-6


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
@pytest.mark.parametrize("goal", ["at", "seat"])
def test_map_agrees_with_single_solves_of_goals_at_and_seat(goal):
    problem = peg(0, goal=goal)
    found = compensation_map(problem, box=((0.995, 1.0), (1.0, 1.002)), error=0.02)
    rho = pairs(found, 8, 8)
    at = found.at(*rho.T)
    for k, pair in enumerate(rho):
        solution = fo.solve(asked(problem, pair))
        assert solution.usable == np.isfinite(at.amount[k])
        if solution.usable:
            assert abs(solution.amount - at.amount[k]) <= at.error[k]


@pytest.mark.slow
@pytest.mark.usefixtures("coarse_maps")
def test_two_processes_make_the_same_map():
    box = ((0.995, 1.005), (0.995, 1.005))
    one, two = (compensation_map(slab("clear"), box=box, error=1e-3, jobs=jobs).to_dict() for jobs in (1, 2))
    one["seconds"] = two["seconds"] = 0.0
    assert json.dumps(one) == json.dumps(two)


@pytest.mark.slow
@pytest.mark.parametrize(("count", "limit"), [(0, 1.0), (26, 1.0), (60, 0.03), (130, 1.0)])
def test_a_map_that_was_cut_off_counted_what_it_did_not_resolve_as_failed(monkeypatch, count, limit):
    """A yield of 37.5 % (37.4 to 37.6 %) was told where half of all pairs pass."""
    solved, looks = sampling.sample_at, iter(range(count))

    def cut_off(*asked):
        if next(looks, None) is None:
            raise pacing.TimeOverError
        return solved(*asked)

    monkeypatch.setattr(sampling, "sample_at", cut_off)
    found = compensation_map(slab("clear", limits={"TX": (-limit, limit)}), error=1e-6)
    rho = pairs(found, 4000, 5)
    short = np.maximum(rho[:, 0] + 3.0 * rho[:, 1] - 4.0, 0.0)
    at = found.at(*rho.T)
    known = ~at.undecided & (np.abs(short - limit) > 1e-7)
    assert ((short <= limit) == np.isfinite(at.amount))[known].all()
    assert (np.isnan(at.error) | ~known | ~np.isfinite(at.amount) | (np.abs(short - at.amount) <= at.error)).all()
    for budget in (0.0, 0.02, 0.5):
        told = fo.assembly_yield(found, sizes=rho, budget=budget)
        assert told.interval[0] <= (short <= min(budget, limit)).mean() <= told.interval[1]
        assert np.isnan(told.contributions[0].share_without) <= (told.undecided > 0.0)
    kinds = {region.kind for region in found.regions}
    assert (
        ("undecided" in kinds)
        == (found.undecided > 0.0)
        == ("undecided" in str(found) or "nothing is known" in str(found))
    )
    assert found.undecided == pytest.approx(at.undecided.mean(), abs=0.05)
    assert (count >= 26) <= (found.undecided < 1.0)
    if count == 0:
        assert (found.undecided, found.reached) == (1.0, np.inf)
        assert {cell for grid in grids(found, slab()) for row in grid.cells for cell in row} == {"?"}


@pytest.mark.slow
def test_a_pair_that_took_long_left_no_time_for_the_others(monkeypatch):
    """That of the box's lower corner goes on for as long as it may."""
    solved, now = sampling.sample_at, [0.0]
    monkeypatch.setattr(pacing, "clock", lambda: now[0])

    def unequal(problem, pair, over):
        while max(pair) < 0.981:
            pacing.check()
            now[0] += 0.1
        return solved(problem, pair, over)

    monkeypatch.setattr(sampling, "sample_at", unequal)
    assert 0.0 < compensation_map(slab("touch"), seconds=10.0).undecided <= 1 / 7


def test_no_look_is_begun_when_the_time_is_over(monkeypatch):
    """`seconds=10` took 141 s: all that a wave asks for was solved, and what finishes it."""
    solved, now = sampling.sample_at, [0.0]
    monkeypatch.setattr(pacing, "clock", lambda: now[0])

    def slow(*asked):
        assert now[0] < 10.0
        now[0] += 0.1
        return solved(*asked)

    monkeypatch.setattr(sampling, "sample_at", slow)
    problem = fo.load_problems(f"{PROBLEMS}/example1_touch.toml")[0]
    found = compensation_map(problem, seconds=10.0, error=1e-9)
    assert 60 <= found.solved <= 100
    assert found.reached > found.error
    assert (found.at(*pairs(found, 100, 9).T).region >= 0).all()


def test_time_that_is_up_is_told():
    problem = fo.load_problems(f"{PROBLEMS}/example1_touch.toml")[0]
    found = compensation_map(problem, seconds=1e-3, error=1e-9)
    assert found.reached > found.error
    assert found.stopped == "85% of the time given, 0.001 s, is short"  # the rest finishes it
    assert (found.at(*pairs(found, 100, 9).T).region >= 0).all()


@pytest.mark.usefixtures("coarse_maps")
def test_transforms_of_a_map_are_those_of_its_motions():
    """Of the probe before a slab: a shift by the gap that 4 - rho_1 - 3 rho_2 leaves."""
    found = slab_map("touch")
    rho = np.array([[1.01, 0.99], [1.0, 1.01]])
    at = found.at(*rho.T)
    assert at.transforms.shape == (2, 4, 4)
    moved = np.tile(np.eye(4), (2, 1, 1))
    moved[:, 0, 3] = at.parameters[:, 0]
    np.testing.assert_allclose(at.transforms, moved, atol=1e-14)
    assert CompensationMap.from_dict(found.to_dict()).at(1.01, 0.99).transforms.shape == (4, 4)
    with pytest.raises(InputError, match="knows the transforms"):
        found.table.at(1.0, 1.0).transforms  # noqa: B018
    assert str(at).splitlines()[1].startswith("TX ")
    with pytest.raises(InputError, match=r"1 of 2 asked are sizes .* found \[9.0, 9.0\]"):  # was nan without a word
        found.at([1.0, 9.0], [1.0, 9.0])
    assert str(found.table.at(9.0, 9.0)) == "outside the sizes that the map is of"


@pytest.mark.slow
def test_cells_beside_a_jump_told_a_motion_between_two_that_do() -> None:
    """Of a map that was cut off: a peg is shifted to either wall, and by half of both it would touch neither."""
    problem = fo.load_problems(f"{PROBLEMS}/peg_square.toml")[0]
    found = fo.compensation_map(problem, budget=40)
    (grid, *_) = grids(found, problem, lines=5)
    places = np.meshgrid(*(np.linspace(*ends, 5) for ends in found.box), indexing="ij")
    near, cells = 0.1 * float(np.nanmax(found.at(*places).amount)), np.array(grid.cells)
    assert (cells == "?").any()
    for a, b, cell in zip(*(own[(cells != "?") & (cells != "-")].tolist() for own in (*places, cells)), strict=True):
        least = fo.solve(problem.changed(requirement=None, tolerance=None, target=(a, b)), effort="quick")
        assert abs(float(cell)) == pytest.approx(abs(least.parameters[grid.name]), abs=near)


@pytest.mark.parametrize("pin", [fo.Cylinder(5, 20, facets=16, name="pin"), fo.Box((10, 10, 10), centre=(0, 0, 5))])
def test_a_map_that_ends_where_the_parts_touch_as_drawn_had_no_known_error(pin):
    """A floor lower by up to 0.1: the part goes down by as much, whatever its width is, and not at all at the end."""
    base, faces = fo.Box((40, 40, 10), centre=(0, 0, -5), name="base"), ["-x", "+x"]
    sizes = [
        fo.Size(
            "wide", "movable", faces=faces if len(pin.faces) == 6 else ["cylinder radius 5"], each=0.5, tolerance=0.1
        ),
        fo.Size("floor", "static", faces=["+z"], tolerance=(-0.1, 0.0)),
    ]
    asked = fo.Problem(pin, base, motion=fo.Translation("z"), sizes=sizes, made={}, goal="touch")
    found = compensation_map(asked, seconds=600.0)
    assert found.reached < 1e-7
    assert found.solved <= (240 if len(pin.faces) == 6 else 30)  # 388 and 67 before
    assert found.undecided == 0
    places = np.random.default_rng(1).uniform([-0.1, -0.1], [0.1, 0.0], (20, 2))
    assert found.at(*places.T).amount == pytest.approx(-places[:, 1], abs=1e-9)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("axes", ["y", "xy"])
def test_a_centred_pin_went_either_way_from_size_to_size(axes):
    """Half of the play, .02 and half of what the bore is wider, either way: the map was off by .125, its points not."""
    bore = fo.cut(fo.Cylinder(14, 20), fo.Cylinder(6, 24, base=(0, 0, -2)))
    sizes = [fo.Size("bore", "static", faces="bore radius 6", each=-0.5, tolerance=(0, 0.018))]
    motion = fo.Translation("y") if axes == "y" else fo.Translation("x") >> fo.Translation("y")
    pin = fo.Cylinder(5.98, 30, base=(0, 0, -5))
    found = compensation_map(fo.Problem(pin, bore, sizes=sizes, made={}, goal="touch", motion=motion), seconds=60.0)
    places = np.linspace(0.0, 0.018, 10)
    assert found.at(places).amount == pytest.approx(0.02 + places / 2, abs=1e-9)
    assert found.reached < 1e-6


def test_the_error_of_a_map_cut_short_was_not_known_without_a_word_of_where() -> None:
    """A cube set down on a table: the amount is linear in both scales, so that few triangles do."""
    cube, table = fo.Box((2, 2, 2), centre=(0, 0, 1.5), name="cube"), fo.Box((6, 6, 2), centre=(0, 0, -1), name="table")
    asked = fo.Problem(cube, table, tolerance=0.02, requirement="A", goal="touch", motion=fo.Translation("z"))
    found = fo.compensation_map(asked)
    errors = found.table.errors.copy()
    count = len(errors)
    errors[: count // 2] = np.nan
    areas = [abs(np.linalg.det(np.diff(own, axis=0))) for own in np.asarray(found.table.corners)]
    share = sum(areas[: count // 2]) / sum(areas)
    short = replace(found, reached=math.inf, table=replace(found.table, errors=errors), stopped="no time")
    assert f"not known of {share:.0%} of the box" in short.error_text
