"""What the models are counted to cost: by hand, for every stage, and in the table of the benchmark."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from ordinary import box, problems

from fcdm_opt import Body, KeepOut, Problem, Rotation, Solution, Status, Translation, solve
from fcdm_opt.errors import InputError
from fcdm_opt.solver import STAGES
from fcdm_opt_benchmarks.cost import models
from fcdm_opt_benchmarks.cost.models_picture import STYLES, models_figure
from fcdm_opt_benchmarks.cost.scenes import QUICK, names, overlapping, scene
from fcdm_opt_benchmarks.record import BenchRun, Load

X, Y, RZ = Translation("x"), Translation("y"), Rotation("z")
KEYS = {"variables", "constraints", *(f"{name}_{word}" for name in models.COUNTS for word in ("kept", "total"))}
PAIR = 6 * 8 + 8 * 6 + 12 * 12  # of boxes: faces with vertices, and edges with edges


CUBE, WALL = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), "cube"), box((1, -4, -4), (2, 4, 4), "wall")
POST = box((-1.1, -0.5, -0.5), (-0.7, 0.5, 0.5), "post")


def problem(goal="touch", **more):
    more = {"motion": X, "target": (1.2, 1.0), "nominal": "drawn", "goal": goal} | more
    return Problem(CUBE, WALL, **more)


# ------------------------------------------------------------------------------------------------- counted by hand


def counts(solution):
    named = ("variables", "constraints", "part_pairs_kept", "features_kept", "features_total")
    return tuple(solution.modelled[name] for name in named)


def test_one_shift_is_one_unknown_and_one_gap_of_twelve_faces():
    solution = solve(problem())
    assert solution.amount == pytest.approx(0.4, abs=1e-12)
    assert solution.stage.startswith("1:")
    assert counts(solution) == (1, 1, 1, 12, PAIR)  # no edges of parallel boxes cross in the Gauss map


def test_nothing_to_do_is_modelled_by_nothing():
    solution = solve(problem("clear"))
    assert solution.status is Status.ALREADY_SATISFIED
    assert counts(solution) == (0, 0, 0, 0, PAIR)


def test_a_contact_line_is_brought_to_the_target_by_one_equation():
    solution = solve(problem("at", nominal=(2.0, 1.0), target=(2.04, 1.0)))
    assert solution.stage.startswith("1:")
    assert solution.amount == pytest.approx(0.02, abs=1e-12)
    assert counts(solution) == (1, 1, 1, 1, PAIR)


def test_shifts_in_a_plane_keep_the_directions_of_the_pair_that_decides():
    solution = solve(problem("clear", motion=X >> Y, target=(2.2, 1.0)))
    assert solution.amount == pytest.approx(0.1, abs=1e-12)
    assert counts(solution) == (2, 1, 1, 12, PAIR)  # the faces of the wall and those of the cube


def test_the_full_model_has_all_planes_and_vertices():
    solution = solve(problem("clear", motion=X >> Y, target=(2.2, 1.0), keep_out=(POST,)), model="full")
    # two parameters and a plane of three numbers for each pair; a row for each vertex of either part
    assert counts(solution) == (2 + 2 * 3, 2 * 16, 2, 2 * PAIR, 2 * PAIR)
    assert solution.modelled["keep_outs_kept"] == solution.modelled["keep_outs_total"] == 1


def test_what_is_kept_of_a_grid_of_parts_is_the_pair_in_the_way():
    rows = Body.from_parts([box((1, y, -1), (2, y + 1, 1)).vertices for y in range(-3, 3)], seed=(1.5, 0.5, 0.0))
    asked = Problem(CUBE, rows, motion=X, target=(1.0, 1.0), nominal="drawn", goal="touch")
    solution = solve(asked)
    assert solution.amount == pytest.approx(0.5, abs=1e-12)
    assert solution.modelled["part_pairs_total"] == 6
    assert solution.modelled["part_pairs_kept"] < 6
    assert solution.modelled["features_total"] == 6 * PAIR


# ---------------------------------------------------------------------------------------------------- every stage

ASKED = {
    "nothing": problem("clear"),
    "shift": problem(),
    "two shifts": problem("clear", motion=X >> Y, target=(2.2, 1.0)),
    "turned": problem(motion=RZ, target=(1.55, 1.0)),
    "shift and turn": problem(motion=X >> RZ, target=(1.2, 1.1)),
    "on the line": problem("at", nominal=(2.0, 1.0), target=(2.04, 1.0)),
    "among keep-outs": problem(
        "clear", motion=X >> Y, target=(2.2, 1.0), keep_out=(POST, KeepOut(POST, clearance=0.1, name="spaced"))
    ),
    "largest displacement": problem(motion=X >> RZ, target=(1.2, 1.1), amount="displacement"),
    "whole steps": problem("clear", motion=X >> Y, target=(2.2, 1.0), resolution=0.03),
    "no motion": problem("clear", motion=X, target=(2.2, 1.0), limits={"TX": (0.0, 0.01)}),
    "coherent up to the motion and no further": problems("example1")["B"].changed(tolerance=0.04),
    "several contacts": problem("at", nominal=(2.0, 1.0), target=(2.04, 1.0), contacts="all"),
    "turns about all axes": problem(motion=X >> Y >> Translation("z") >> RZ, target=(1.2, 1.1), weights={"RZ": 1.0}),
}


SLOW = {(name, "branch and bound") for name in ("shift and turn", "largest displacement")}
SLOW |= {("coherent up to the motion and no further", model) for model in ("nlp", "full")}


@pytest.fixture(scope="module")
def solved() -> dict[tuple[str, str], Solution]:
    found = {}
    for name, asked in ASKED.items():
        for model in ("auto", *STAGES):
            if (name, model) in SLOW:
                continue
            try:
                found[name, model] = solve(asked, model=model)
            except InputError:
                continue
    return found


def test_every_stage_has_a_mark_of_its_own():
    assert {*STAGES, "auto"} == set(STYLES)


@pytest.mark.slow
def test_every_stage_settles_something(solved):
    assert {model for _, model in solved} == {"auto", *STAGES}


def test_all_stages_count_by_the_same_names(solved):
    for case, solution in solved.items():
        assert set(solution.modelled) == KEYS, case
        for name in models.COUNTS:
            assert 0 <= solution.modelled[f"{name}_kept"] <= solution.modelled[f"{name}_total"], (case, name)


def test_totals_are_of_the_scene_not_of_the_stage(solved):
    totals = {}
    for (name, _), solution in solved.items():
        totals.setdefault(name, set()).add(tuple(solution.modelled[f"{own}_total"] for own in models.COUNTS))
    assert {len(own) for own in totals.values()} == {1}
    assert totals["among keep-outs"] == {(3, 3 * PAIR, 2)}


def test_what_moves_is_modelled_by_something(solved):
    for case, solution in solved.items():
        if solution.usable and solution.amount > 0:
            assert solution.modelled["variables"] >= 1, case
            assert solution.modelled["part_pairs_kept"] >= 1, case
            assert solution.modelled["constraints"] >= 1, case
            assert solution.modelled["features_kept"] >= 1, case


def test_counts_come_back_from_plain_data(solved):
    solution = solved["two shifts", "auto"]
    assert Solution.from_dict(solution.to_dict()).modelled == solution.modelled


def test_no_stage_finds_a_smaller_verified_motion_than_auto(solved):
    compared = 0
    for (name, _), solution in solved.items():
        least = solved[name, "auto"]
        if solution.usable and name != "whole steps":
            compared += 1
            assert solution.amount >= least.amount * (1 - 1e-7) - 1e-12, name
    assert compared > 30


# ------------------------------------------------------------------------------------------------------- the table


def test_a_solve_gives_a_plain_row():
    row = models.cost(problem(), "straight")
    assert row["outcome"] == "settled"
    assert row["verified"] is True
    assert (row["variables"], row["constraints"], row["part_pairs"], row["features_total"]) == (1, 1, 1, PAIR)
    assert row["seconds"] >= row["solve"] + row["verify"] > 0
    refused = models.cost(problem(), "translations")
    assert refused["outcome"] == "refused"
    assert "does not settle" in refused["reason"]
    assert models.cost(ASKED["no motion"], "auto")["outcome"] == "no motion"


def test_an_unknown_model_is_no_refusal():
    with pytest.raises(InputError, match="unknown model"):
        models.cost(problem(), "guess")


def test_scenes_are_drawn_again_by_name_and_seed():
    assert set(QUICK) <= set(names(quick=False))
    assert len(set(names(quick=False))) == len(names(quick=False))
    one = scene("hull 12, 2 parameters", 3)
    scene.cache_clear()
    two = scene("hull 12, 2 parameters", 3)
    assert one is not two
    np.testing.assert_array_equal(one.movable.vertices, two.movable.vertices)
    np.testing.assert_array_equal(one.target, two.target)
    with pytest.raises(InputError, match="no such scene"):
        scene("hull 13", 0)


def test_hulls_of_a_scene_were_made_two_percent_larger_than_fits():
    asked = overlapping(CUBE, WALL, 1)
    # half widths 1/2 and 1/2 about x = 0 and 1.5: they touch at scales whose sum is 3
    assert asked.target == pytest.approx((1.53, 1.53), abs=1e-9)
    assert solve(asked).amount == pytest.approx(0.03, abs=1e-9)


class Apart:
    """Answers in place of the worker: amounts and times by model."""

    def __init__(self, **answers):
        self.answers, self.asked = answers, Counter()

    def cost(self, drawn, model):
        self.asked[model] += 1
        seconds, amount, verified = self.answers.get(model, (None, None, None))
        if seconds is None:
            return {"outcome": "refused", "reason": "not its own", "seconds": 0.0}
        seconds *= 100.0 if self.asked[model] == 1 else 1.0
        return {"outcome": "settled", "amount": amount, "verified": verified, "seconds": seconds, "build": seconds,
                "solve": 0.0, "prove": 0.0, "verify": 0.0}  # fmt: skip


def test_models_take_turns_and_another_amount_is_told():
    apart = Apart(auto=(0.01, 1.0, True), descent=(0.001, 1.25, True), nlp=(0.001, 0.5, False), full=(2.0, 1.0, True))
    rows = {row["model"]: row for row in models._compared(apart, "hull 12, 2 parameters", 3, rounds=4)}
    assert apart.asked == Counter(dict.fromkeys(models.MODELS, 1)) + Counter(auto=3, descent=3, nlp=3)  # not the slow
    assert rows["descent"]["seconds"] == 0.001  # the first round, which compiles, does not count
    assert rows["descent"]["build"] == pytest.approx(0.1)
    assert rows["descent"]["rounds"] == 3
    assert rows["full"]["seconds"] == 200.0
    assert [row["model"] for row in models.differing(list(rows.values()))] == ["descent"]
    assert rows["descent"]["difference"] == 0.25
    assert "difference" not in rows["nlp"]  # the judge did not pass it: it is no least amount
    assert rows["shift"]["reason"] == "not its own"


def test_the_picture_draws_what_was_settled_and_says_what_was_not():
    settled = {"stage": "", "variables": 1, "constraints": 1, "part_pairs": 1, "part_pairs_total": 4, "features": 1,
               "features_total": 9, "seconds": 0.1, "amount": 1.0}  # fmt: skip
    rows = [
        {"scene": "one", "model": "auto", "outcome": "settled", "verified": True, **settled},
        {"scene": "one", "model": "nlp", "outcome": "settled", "verified": False, **settled},
        {"scene": "one", "model": "full", "outcome": "over", "reason": "over 2 s", "seconds": 2.0},
        {"scene": "two", "model": "shift", "outcome": "refused", "reason": "no", "seconds": 0.0},
        {"scene": "two", "model": "auto", "outcome": "settled", "verified": True,
         **settled | dict.fromkeys(("variables", "constraints", "part_pairs", "features"), 0)},
    ]  # fmt: skip
    run = BenchRun("bench", True, 1, {}, "2026-01-01T00:00", 1.0, Load(None, None), {"models": rows})
    figure = models_figure(run)
    assert len(figure.axes) == 4
    for axes in figure.axes:
        drawn = [len(marks.get_offsets()) for marks in axes.collections]
        assert sum(drawn) == 3
    assert [label.get_text() for label in figure.axes[0].get_yticklabels()] == ["one", "two"]
    assert len(figure.axes[1].texts) == 1  # the arrow of what ran over
    assert "3 solves" in figure.texts[-1].get_text()
    assert "1 forced" in figure.texts[-1].get_text()
