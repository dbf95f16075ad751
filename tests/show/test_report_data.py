"""What a report shows, against closed forms, the solutions themselves, and rules of geometry."""

from __future__ import annotations

import itertools
import json
from dataclasses import dataclass, fields, replace
from functools import cache
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from solids import box

import fcdm_opt as fo
from fcdm_opt import pacing
from fcdm_opt.geometry.size import direction, direction_level
from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.problem.problem import Problem
from fcdm_opt.show import solved as solved_module
from fcdm_opt.show import texts
from fcdm_opt.show.printing import printed
from fcdm_opt.show.remarks import not_considered
from fcdm_opt.show.report import gather as gathering
from fcdm_opt.show.report.cases import (
    ANSWERED,
    _sensitivities,
    answered,
    case_report,
    size_rows,
    stack_report,
    stack_reports,
)
from fcdm_opt.show.report.families import FACTORS, LEAST, SHARES, _family, frames_of
from fcdm_opt.show.report.gather import gather, head
from fcdm_opt.show.report.page import assembly_report
from fcdm_opt.show.stacks import BEYOND, print_stack, stack_notes
from fcdm_opt.tolerances import DEFAULT, Tolerances

PROBLEMS = Path(__file__).parents[2] / "problems"
DRAWN = 1e-8  # relative: nine digits are kept of what is drawn


@dataclass(frozen=True)
class Opened:
    """A problem file as the command line reads it."""

    path: Path
    title: str = ""
    note: str = ""
    problems: tuple[fo.Problem, ...] = ()
    error: str | None = None


@cache
def opened(name, *names):
    path = PROBLEMS / f"{name}.toml"
    file = ProblemFile.read(path)
    problems = tuple(problem for problem in file.problems(fo.Problem, path) if not names or problem.name in names)
    return Opened(path, file.title, file.note, problems)


@cache
def gathered(name, *names, certify=False, frames=0.0):
    """Return the payload of a problem file; by default with the least number of frames."""
    return gather([opened(name, *names)], certify=certify, frames=frames)


def of_problem(problem, frames=0.0):
    payload = gather([Opened(Path("own.toml"), problems=(problem,))], certify=False, frames=frames)
    return payload["cases"][0]


def all_frames(case):
    families = (family for family in case["families"].values() if family)
    return [*filter(None, case["poses"].values()), *(frame for family in families for frame in family["frames"])]


def shown(case, frame, k, points):
    """Return points of body k where the viewer puts them."""
    seed = np.array(case["scene"]["objects"][k]["seed"])
    placed = seed + frame["sizes"][k] * (np.array(points) - seed)
    if k == 0 and frame["transform"] is not None:
        T = np.array(frame["transform"]).reshape(4, 4)
        placed = placed @ T[:3, :3].T + T[:3, 3]
    return placed


LID = ("lid", "D flush on the rim", "plug against the wall")
EVERY = (("example1",), ("example2",), ("boxes",), LID, ("bracket_stuck",))


# -------------------------------------------------------------------------------------------------------- as a whole


@pytest.mark.slow
@pytest.mark.parametrize("names", EVERY)
def test_payload_is_plain_json(names):
    payload = gathered(*names)
    assert json.loads(json.dumps(payload, allow_nan=False)) == payload  # no tuples, no nan, texts as keys


def test_the_same_file_gives_the_same_data_but_for_times():
    def timeless(payload):
        kept = {key: value for key, value in payload.items() if key != "made"}
        return {**kept, "cases": [{**case, "seconds": None} for case in payload["cases"]]}

    asked = "boxes", "close the gap"
    assert timeless(gathered(*asked)) == timeless(gather([opened(*asked)], certify=False, frames=0.0))


def test_the_proof_in_a_report_was_weaker_than_that_of_solve_on_a_busy_machine(monkeypatch):
    """A cube 0.1 into one wall and 0.2 into another: turned it is wider, so it is shifted by hypot(0.1, 0.2)."""
    walls = [box([-3.0, -3.0, -1.0], [-0.9, 3.0, 1.0]), box([-3.0, -3.0, -1.0], [3.0, -0.8, 1.0])]
    bodies = fo.Body.convex(box([-1.0] * 3, [1.0] * 3), name="cube"), fo.Body.from_parts(walls, seed=[-2.0] * 3)
    motion = fo.Translation("x") >> fo.Translation("y") >> fo.Rotation("z")
    asked = fo.Problem(*bodies, motion=motion, goal="clear", nominal=(1.0, 1.0), target=(1.0, 1.0))
    ticks = itertools.count(0.0, 1.0)  # a second is over at each look at the clock
    for name in ("stages.branching", "stages.turns", "proof.columns", "pacing"):
        monkeypatch.setattr(f"fcdm_opt.{name}.perf_counter", lambda: next(ticks), raising=False)
    problems = tuple(asked.changed(name=str(k)) for k in range(2))
    cases = gather([Opened(Path("own.toml"), problems=problems)], frames=0.0)["cases"]
    for case in cases:
        assert case["amount"] == pytest.approx(np.hypot(0.1, 0.2), rel=1e-9)
        assert np.hypot(0.1, 0.2) * (1.0 - 1e-4) <= case["lower_bound"] <= case["amount"]
        assert case["lower_bound"] == fo.solve(asked, certify=True).lower_bound


def test_head_of_the_report():
    payload = gathered("example1")
    assert payload["title"] == "Example 1 of the FCDM paper (reconstruction)"
    (file,) = payload["files"]
    assert file["cases"] == [0, 1, 2, 3]
    assert file["file"] == "example1.toml"
    assert len(file["sha256"]) == 64
    assert {"date", "fcdm_opt", "python", "numpy"} <= set(payload["made"])
    own = [[item.name, getattr(DEFAULT, item.name)] for item in fields(Tolerances)]
    assert [row[:2] for row in payload["tolerances"]] == own
    assert all(meaning.endswith(".") for _, _, meaning in payload["tolerances"])


def test_file_that_could_not_be_read_keeps_its_error_and_the_numbers_of_the_others():
    files = [Opened(Path("broken.toml"), error="no such key"), opened("boxes", "close the gap", "slanted")]
    payload = gather(files, certify=False, frames=0.0)
    assert [file["cases"] for file in payload["files"]] == [[], [0, 1]]
    assert payload["files"][0]["error"] == "no such key"
    assert "error" not in payload["files"][1]
    assert [case["file"] for case in payload["cases"]] == [1, 1]


def test_case_that_is_refused_is_told_and_the_others_go_on(monkeypatch):
    def refusing(problem, **arguments):
        if problem.name == "slanted":
            raise fo.InputError("no such thing", key="motion", found="x", allowed="y")
        return fo.solve(problem, **arguments)

    monkeypatch.setattr(solved_module, "solve", refusing)
    said = []
    file = opened("boxes", "close the gap", "slanted", "both made larger")
    payload = gather([file], certify=False, refuse=said.append, frames=0.0)
    assert [case["name"] for case in payload["cases"]] == ["close the gap", "both made larger"]
    assert "slanted" in payload["files"][0]["error"]
    assert "no such thing" in payload["files"][0]["error"]
    assert payload["matrices"][0]["cells"]["A"]["case"] == 1
    assert ["no such thing" in str(reason) for reason in said] == [True]


# --------------------------------------------------------------------------------------------------------- families


def gap_of_boxes(rho, shift=0.0):
    """Return the gap of the two boxes of boxes.toml, the cube shifted towards the plate."""
    return 1.25 - rho[0] / 2 - rho[1] / 4 - shift


def test_on_a_busy_machine_sliders_had_fewer_frames(monkeypatch):
    """Where a second is over at each look at the clock there are the same frames."""
    quiet = gathered("boxes", "both made larger")["cases"][0]["families"]["tolerance"]
    ticks = itertools.count(0.0, 1.0)
    monkeypatch.setattr(pacing, "perf_counter", lambda: next(ticks))
    busy = gather([opened("boxes", "both made larger")], certify=False, frames=0.0)["cases"][0]["families"]["tolerance"]
    assert len(quiet["values"]) == LEAST
    assert busy == quiet


def test_a_search_for_a_frame_without_end_is_given_up_after_so_many_looks(monkeypatch):
    monkeypatch.setattr("fcdm_opt.show.report.families.LOOKS", 12)
    monkeypatch.setattr("fcdm_opt.show.report.families.LEAST_LOOKS", 12)
    (case,) = gather([opened("boxes", "both made larger")], certify=False, frames=0.0)["cases"]
    family = case["families"]["tolerance"]
    assert family["values"] == [0.0, 1.0]
    assert family["note"].startswith("+3 %, +6 % and more left out")


def test_a_search_for_a_frame_went_on_without_end_while_the_report_was_drawn(monkeypatch):
    """What is told is not ended by the time, and so the searches in it were not: for 300 s, of a taper."""

    def endless(problem, **_):
        for _ in range(100_000):
            pacing.check()
        pytest.fail("the search was not ended")

    monkeypatch.setattr("fcdm_opt.show.report.families.solve", endless)
    (case,) = gather([opened("boxes", "both made larger")], certify=False, frames=0.0)["cases"]
    assert case["families"]["tolerance"]["values"] == [1.0]


def test_a_search_without_end_at_no_tolerance_left_out_all_larger_ones():
    """What takes long there says nothing of the other side of what is asked."""

    def frame(value):
        if value < 0.5:
            raise pacing.TimeOverError
        return {"value": value}

    found = _family(frame, FACTORS, 1.0, "{:g}".format, "")
    assert found["values"] == [value for value in FACTORS if value >= 0.5]
    assert found["note"] == "0.4 and less left out: the search for an answer there is too long"


def test_tolerance_family_of_boxes_is_the_closed_form():
    (case,) = gathered("boxes", "both made larger", frames=1.0)["cases"]
    family = case["families"]["tolerance"]
    assert family["values"] == list(FACTORS)
    assert family["values"][family["start"]] == 1.0
    assert family["shown"][family["start"]] == "+2 %, +4 %"
    for factor, frame in zip(family["values"], family["frames"], strict=True):
        target = 1.5 * (1 + 0.02 * factor), 2.0 * (1 + 0.04 * factor)
        np.testing.assert_allclose(frame["target"], target, rtol=DRAWN)
        assert frame["sizes"] == frame["target"]
        assert frame["amount"] == pytest.approx(0.035 * factor, rel=DRAWN, abs=1e-12)
        assert frame["transform"][3] == pytest.approx(-0.035 * factor, rel=DRAWN, abs=1e-12)
        assert frame["pair_state"] == "touching"
        assert frame["usable"] is True


def test_target_family_goes_straight_from_the_nominal_pair():
    (case,) = gathered("boxes", "undo an overlap", frames=1.0)["cases"]
    family = case["families"]["tolerance"]
    assert family["values"] == list(FACTORS)
    for factor, frame in zip(family["values"], family["frames"], strict=True):
        np.testing.assert_allclose(frame["target"], [1 + factor, 1 + factor], rtol=DRAWN)
        assert frame["transform"][3] == pytest.approx(gap_of_boxes(frame["target"]), rel=DRAWN, abs=1e-12)


def test_motion_family_of_boxes_is_the_closed_form():
    (case,) = gathered("boxes", "both made larger", frames=1.0)["cases"]
    family = case["families"]["motion"]
    assert family["values"] == list(SHARES)
    assert family["shown"][family["start"]] == "100 %"
    for share, frame in zip(family["values"], family["frames"], strict=True):
        shift = -0.035 * share
        assert frame["transform"][3] == pytest.approx(shift, rel=DRAWN, abs=1e-12)
        assert frame["pair_gap"] == pytest.approx(gap_of_boxes(case["pair"], shift), rel=1e-6, abs=1e-12)
        assert frame["parameters"] == [f"{shift + 0.0:.6g}"]  # 0, not -0
        for x1, y1, x2, y2, *_ in frame["curve"]:
            assert gap_of_boxes((x1, y1), shift) == pytest.approx(0.0, abs=1e-7)
            assert gap_of_boxes((x2, y2), shift) == pytest.approx(0.0, abs=1e-7)


def test_tolerance_family_of_the_peg_is_the_closed_form():
    (case,) = gathered("peg_square", "C at the wall")["cases"]
    family = case["families"]["tolerance"]
    assert len(family["values"]) == LEAST
    for factor, frame in zip(family["values"], family["frames"], strict=True):
        first, second = 1 - 0.01 * factor, 1 + 0.01 * factor
        shift = 10 * second - 9.75 * first - 0.25
        assert frame["transform"][3] == pytest.approx(shift, rel=DRAWN, abs=1e-12)
        np.testing.assert_allclose([x for x, _, _ in frame["contacts"]], 10 * second, rtol=DRAWN)


def test_asymmetrical_tolerances_are_all_multiplied_by_one_factor():
    (problem,) = opened("boxes", "both made larger").problems
    case = of_problem(problem.changed(tolerance=((0.01, 0.02), (0.03, 0.04)), requirement="C"))
    family = case["families"]["tolerance"]
    targets = [[1.5 * (1 - 0.01 * factor), 2.0 * (1 + 0.04 * factor)] for factor in family["values"]]
    np.testing.assert_allclose([frame["target"] for frame in family["frames"]], targets, rtol=DRAWN)
    np.testing.assert_allclose(case["tolerance_box"], [[1.485, 1.53], [1.94, 2.08]], rtol=DRAWN)


def test_factors_that_would_leave_no_body_are_left_out():
    (problem,) = opened("boxes", "both made larger").problems
    case = of_problem(problem.changed(tolerance=0.7, requirement="D"), frames=1.0)
    family = case["families"]["tolerance"]
    assert family["values"] == [factor for factor in FACTORS if 0.7 * factor < 1]
    assert "at 1.5 times" in family["note"]


@pytest.mark.parametrize("name", ["example1", pytest.param("example2", marks=pytest.mark.slow)])
def test_frames_as_asked_are_the_solution(name):
    for problem, case in zip(opened(name).problems, gathered(name)["cases"], strict=True):
        solution = fo.solve(problem)
        assert case["amount"] == pytest.approx(solution.amount, rel=1e-9)
        corrected = {**case["poses"]["corrected"], "note": ""}
        for family in case["families"].values():
            assert family["values"][family["start"]] == 1.0
            assert family["frames"][family["start"]] == corrected
        np.testing.assert_allclose(corrected["transform"], solution.transform.ravel(), rtol=DRAWN, atol=1e-12)
        np.testing.assert_allclose(corrected["rho"], solution.rho, rtol=DRAWN)
        assert corrected["status"] == solution.status.name
        assert corrected["usable"] is solution.usable
        rest = case["families"]["motion"]["frames"][0]
        assert rest["curve"] == case["poses"]["rescaled"]["curve"]
        assert rest["pair_gap"] == pytest.approx(case["poses"]["rescaled"]["pair_gap"], rel=1e-6)
        np.testing.assert_allclose(rest["rho"], case["nominal"], rtol=DRAWN)


def test_the_least_family_has_its_ends_and_the_case_as_asked_and_says_so():
    case = gathered("example1")["cases"][0]
    for family, values in ((case["families"]["tolerance"], FACTORS), (case["families"]["motion"], SHARES)):
        assert len(family["values"]) == LEAST
        assert family["values"] == sorted(family["values"])
        assert {values[0], 1.0, values[-1]} <= set(family["values"])
        assert f"{LEAST} of {len(values)} values: more take long, of many corners" in family["note"]
    late = of_problem(opened("example1", "A").problems[0], frames=-1.0)["families"]["motion"]
    assert late["note"] == f"1 of {len(SHARES)} values: the time given is nearly over"


def test_shares_beyond_the_limits_are_marked():
    (problem,) = opened("boxes", "close the gap").problems
    case = of_problem(problem.changed(limits={"TX": (-1.0, 0.6)}), frames=1.0)
    family = case["families"]["motion"]  # TX = 1/2
    marked = [share for share, frame in zip(family["values"], family["frames"], strict=True) if frame["note"]]
    assert marked == [share for share in SHARES if share * 0.5 > 0.6 + 1e-9]
    assert family["frames"][-1]["note"] == "beyond the limits of TX"


def test_no_family_where_nothing_changes():
    case = gathered("boxes", "already clear")["cases"][0]
    assert case["families"] == {"tolerance": None, "motion": None}


def test_case_without_motion_tells_from_which_size_on_there_is_none():
    (case,) = gathered("bracket_stuck", frames=1.0)["cases"]
    assert (case["status"], case["usable"], case["amount"]) == ("INFEASIBLE", False, None)
    assert case["poses"]["corrected"] is case["poses"]["tracked"] is case["families"]["motion"] is None
    assert case["sensitivities"] is None
    assert case["certificate"]["passed"] is False
    family = case["families"]["tolerance"]
    for factor, frame in zip(family["values"], family["frames"], strict=True):
        fits = 32 - 30 * (1 + 0.06 * factor) >= 1.0  # between two ribs, at 0.5 from both
        assert (frame["status"] == "SOLVED") is fits
        assert (frame["transform"] is not None) is fits


# ------------------------------------------------------------------------------------------------------------- scenes


def test_where_parts_overlap_that_no_motion_parts_is_drawn():
    """Cubes side by side, one 10 % larger: 0.05 of it is in the other; the sizes drawn were shown, and no overlap."""
    corners = (list(itertools.product((x, x + 1.0), (0.0, 1.0), (0.0, 1.0))) for x in (0.0, 1.0))
    one, two = (fo.Body.convex(own, seed="box") for own in corners)
    held = fo.Problem(one, two, target=(1.1, 1.0), motion=fo.Translation("x"), goal="touch", limits={"TX": (0, 1e-3)})
    case = of_problem(held)
    assert case["amount"] is None
    panel = case["poses"]["rescaled"]  # it said: amount 0, status -
    assert (panel["amount"], panel["status"]) == (None, "impossible")
    assert "impossible with this motion" in panel["note"]
    corners = np.reshape(case["poses"]["rescaled"]["overlap"], (-1, 3, 3))
    assert np.linalg.det(corners).sum() / 6.0 == pytest.approx(0.05, rel=1e-9)  # times 1 x 1, as large as the other is
    assert np.ptp(corners.reshape(-1, 3), axis=0) == pytest.approx([0.05, 1.0, 1.0])
    assert "where they overlap" in [text for *_, text in case["picture"]["key"]]
    assert "overlap, cut open" in case["picture"]["insets"][0]


@pytest.mark.sampled(1)
@pytest.mark.parametrize("names", [("example1",), ("example2",), LID])
def test_points_are_shown_where_scaling_and_moving_the_bodies_puts_them(names):
    for problem, case in zip(opened(*names).problems, gathered(*names)["cases"], strict=True):
        for frame in all_frames(case):
            for k, body in enumerate((problem.movable, problem.static)):
                moved = body.scaled(frame["sizes"][k])
                if k == 0 and frame["transform"] is not None:
                    T = np.array(frame["transform"]).reshape(4, 4)
                    moved = moved.moved(T)
                points = shown(case, frame, k, case["scene"]["objects"][k]["points"])
                away = np.linalg.norm(points[:, None] - moved.vertices[None], axis=2).min(axis=1)
                assert away.max() <= 10 * DRAWN * problem.size


def area_and_volume(item):
    corners = np.array(item["points"])[np.array(item["triangles"])]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
    return np.linalg.norm(normals, axis=1).sum(), (normals * corners[:, 0]).sum() / 3


def test_triangles_are_the_outer_surface_without_cuts():
    movable, static = gathered("boxes", "close the gap")["cases"][0]["scene"]["objects"]
    np.testing.assert_allclose(area_and_volume(movable), [6.0, 1.0], rtol=DRAWN)
    np.testing.assert_allclose(area_and_volume(static), [2 * 16 + 4 * 2, 8.0], rtol=DRAWN)
    _, ell = gathered("example2")["cases"][0]["scene"]["objects"]  # a prism of two parts, 1.2 high
    base, border = 4.0 * 1.812 + 2.6 * 0.894, 2 * (4.0 + 2.706)
    np.testing.assert_allclose(area_and_volume(ell), [2 * base + 1.2 * border, 1.2 * base], rtol=DRAWN)
    assert len(ell["edges"]) == 18
    assert len(ell["points"]) == 12


def test_keep_outs_are_in_the_scene_at_their_largest_scale():
    (problem,) = opened("bracket", "past the ribs as made").problems
    case = of_problem(problem)
    assert [item["body"] for item in case["scene"]["objects"]] == [0, 1, 2]
    assert [body["role"] for body in case["bodies"]] == ["movable", "static", "keep-out"]
    assert max(x for x, _, _ in case["scene"]["objects"][2]["points"]) == pytest.approx(1.02 * 18)
    assert case["bodies"][2]["notes"][0] == "scale 0.98 to 1.02, clearance 0.5 mm"


def off(kind, points, triangles, place):
    """Return how far a place is off a vertex or an edge's segment, or off the plane of a face's triangle it is in."""
    if kind == "V":
        return np.linalg.norm(place - points[0])
    if kind == "E":
        start, way = points[0], points[1] - points[0]
        share = np.clip((place - start) @ way / (way @ way), 0.0, 1.0)
        return np.linalg.norm(place - start - share * way)
    found = [np.inf]
    for a, b, c in points[triangles]:
        normal = np.cross(b - a, c - a)
        twice = np.linalg.norm(normal)
        sides = ((a, b), (b, c), (c, a))
        shares = [np.cross(end - start, place - start) @ normal / twice**2 for start, end in sides]
        if min(shares) > -DRAWN:
            found.append(abs((place - a) @ normal) / twice)
    return min(found)


@pytest.mark.sampled(1)
@pytest.mark.parametrize("names", [("example1",), ("example2",), ("boxes",), LID])
def test_contacts_are_on_both_bodies_and_only_where_they_touch(names):
    touching = 0
    for case in gathered(*names)["cases"]:
        slack = 1e-7 * case["scene"]["size"]
        for frame in all_frames(case):
            assert bool(frame["contacts"]) == bool(frame["contact"]) == (frame["pair_state"] == "touching")
            assert len(frame["contacts"]) == len(frame["contact"])
            touching += len(frame["contacts"])
            for place, feature in zip(frame["contacts"], frame["contact"], strict=True):
                for shape in case["feature_shapes"][feature]["shapes"]:
                    points = shown(case, frame, shape["body"], shape["points"])
                    assert off(shape["kind"], points, shape["triangles"], np.array(place)) <= slack
    assert touching > len(gathered(*names)["cases"])


def test_features_of_frames_are_those_of_the_solutions():
    for names in (("boxes",), LID):
        for problem, case in zip(opened(*names).problems, gathered(*names)["cases"], strict=True):
            if problem.goal != "touch":
                continue
            labels = [case["feature_shapes"][k]["label"] for k in case["poses"]["corrected"]["contact"]]
            assert set(labels) == set(case["features"]) == {feature.label for feature in fo.solve(problem).features}
            assert [case["feature_shapes"][k]["label"] for k in case["tracked_shapes"]] == case["features"]


def test_published_motions_are_measured_as_the_found_ones_are():
    (problem,) = opened("boxes", "slanted").problems
    for amount, found in (("weighted", 6.0), ("displacement", 2.0)):
        asked = problem.changed(amount=amount, published=[2.0], weights={"T": 3.0})
        assert solved_module.solved_case(asked, certify=False).published_amount == pytest.approx(found)


def test_tracked_pose_touches_where_the_parts_made_do_not():
    case = gathered("example1")["cases"][0]
    assert case["poses"]["corrected"]["pair_state"] == "apart"
    tracked = case["poses"]["tracked"]
    assert tracked["pair_state"] == "touching"
    assert tracked["sizes"] == tracked["rho"] == case["poses"]["corrected"]["rho"]


# ------------------------------------------------------------------------------------------------------------- curves


def test_curve_reaches_over_box_and_window_with_the_numbers_of_the_box():
    problem = opened("example1").problems[0].changed(box=((1.2, 1.28), (1.2, 1.22)), nominal=1)
    case = of_problem(problem)
    (low_1, high_1), (low_2, high_2) = case["axes"]["window"]
    assert high_1 > 1.28
    assert high_2 > 1.22
    ends = np.array([row[:4] for row in case["poses"]["nominal"]["curve"]]).reshape(-1, 2)
    assert ends[:, 0].max() == pytest.approx(high_1, rel=DRAWN)
    assert (ends >= np.minimum([low_1, low_2], 1.2) * (1 - DRAWN)).all()
    assert [name for *_, name in case["poses"]["nominal"]["switching"]] == ["SW1"]
    beyond = of_problem(problem.changed(box=((1.2, 1.28), (1.2, 1.2146)), nominal=1, tolerance=0.5, requirement="B"))
    names = {tuple(rho): name for *rho, name in beyond["poses"]["nominal"]["switching"]}
    inside = {rho: name for rho, name in names.items() if 1.2 <= rho[0] <= 1.28 and 1.2 <= rho[1] <= 1.2146}
    assert list(inside.values()) == ["SW1"]
    assert {name for rho, name in names.items() if rho not in inside} == {""}


def test_segments_name_their_features():
    for problem, case in zip(opened("example2").problems, gathered("example2")["cases"], strict=True):
        rows = case["poses"]["nominal"]["curve"]
        for segment, (*ends, label, snug) in zip(problem.curve.segments, rows, strict=True):
            np.testing.assert_allclose(ends, [*segment.start, *segment.end], rtol=DRAWN)
            assert case["labels"][label] == segment.feature.label
            assert snug == int(segment.snug)


# ------------------------------------------------------------------------------------------------------------- tables

PAPER = {
    "example1": {
        "A": "Screw -0.0054, -0.0054 deg",
        "B": "TZ 0.25 + RZ 7.0191 deg",
        "C": "TZ -0.1178 + RZ -6 deg",
        "D": "Screw 0.0051, 0.0051 deg",
    },
    "example2": {
        "A": "TY -0.0337 + RZ 2 deg",
        "B": "TY -0.0193",
        "C": "TY 0.0193",
        "D": "TY 0.0313 + RZ -2 deg",
    },
}  # Tables 1 and 2 of the paper


@pytest.mark.parametrize("name", list(PAPER))
def test_table_is_laid_out_as_the_papers(name):
    payload = gathered(name)
    (table,) = payload["matrices"]
    assert (table["file"], table["title"], table["tolerance"]) == (0, "cases A, B, C, D", "2 %")
    for row, sign_2 in zip(("AC", "BD"), (1.0, -1.0), strict=True):
        for letter, sign_1 in zip(row, (1.0, -1.0), strict=True):
            cell = table["cells"][letter]
            case = payload["cases"][cell["case"]]
            assert case["signs"] == [sign_1, sign_2]
            assert (cell["motion"], cell["amount"], cell["status"]) == (case["motion"], case["amount"], case["status"])
            assert cell["published"] == PAPER[name][letter]
            assert cell["usable"] is True
    assert all(case["quadrant"] for case in payload["cases"])


@pytest.mark.slow
def test_a_case_whose_goal_is_the_files_was_said_to_be_none_of_the_file():
    """Of the lid, A, B and C write the goal that D has by default."""
    (table,) = gathered("lid")["matrices"]
    assert [table["cells"][letter]["case"] for letter in "ABCD"] == [0, 1, 2, 3]


def test_requirements_that_a_file_leaves_out_are_solved_and_marked():
    payload = gathered("boxes")
    (table,) = payload["matrices"]  # cases with an explicit target have none
    shifts = {"A": -0.035, "B": 0.005, "C": -0.005, "D": 0.035}  # of (0.75 * 0.02, 0.5 * 0.04), by their signs
    assert table["tolerance"] == "rho_1 2 %, rho_2 4 %"
    for letter, shift in shifts.items():
        cell = table["cells"][letter]
        assert cell["motion"] == f"TX {shift:g}"
        assert cell["amount"] == pytest.approx(abs(shift), rel=1e-9)
        assert (cell["case"] is None) is (letter != "A")
        assert ("case both made larger" in cell["note"]) is (letter != "A")
    assert payload["cases"][table["cells"]["A"]["case"]]["name"] == "both made larger"


def test_two_cases_of_one_requirement_have_two_tables():
    (problem,) = opened("boxes", "both made larger").problems
    other = problem.changed(motion=fo.Translation("y") >> fo.Translation("x"), published=None)
    first, second = gather([Opened(Path("own.toml"), problems=(problem, other))], certify=False, frames=0.0)["matrices"]
    assert (first["cells"]["A"]["case"], second["cells"]["A"]["case"]) == (0, 1)
    assert second["cells"]["D"]["motion"] == "TX 0.035"


def test_a_bound_that_is_the_amount_is_shown_as_it_is():
    told = answered(fo.solve(opened("boxes", "slanted").problems[0]))
    assert told["least"] == {"text": f"{told['amount']:.4g}", "near": "exact"}
    assert set(told) == set(ANSWERED)


# ------------------------------------------------------------------------------------------------- grounds and limits


def test_proof_is_told_with_whether_it_was_checked():
    (case,) = gathered("boxes", "close the gap", certify=True)["cases"]
    assert case["evidence"]["checked"] is True
    assert case["evidence"]["bound"] <= case["amount"] == pytest.approx(0.5, rel=1e-9)
    assert any(check["name"].startswith("proof") for check in case["certificate"]["checks"])
    assert gathered("boxes", "close the gap")["cases"][0]["evidence"] is None


def test_a_proof_that_nothing_does_was_said_not_to_be_checked():
    """A page said "impossible (proved)", and below it "checked again: no"."""
    (case,) = gathered("bracket_stuck", certify=True)["cases"]
    assert case["status"] == "INFEASIBLE"
    assert case["evidence"]["checked"] is True
    assert case["evidence"]["covers"] == "yes, by separate code: no motion at all does"
    assert case["certificate"]["passed"] is True
    assert all(check["name"].startswith("proof") for check in case["certificate"]["checks"])


def test_values_were_said_to_hold_to_one_side_where_there_are_none():
    """A peg midway between two walls goes to either: derivatives of one; of as many as are nan none is told."""
    slot = fo.Body.from_parts([[*product(x, (-9, 9), (-9, 9))] for x in ((-9, -4), (4, 9))])
    peg = fo.Body.convex([*product((-3, 3), (-4, 4), (-4, 4))])
    found = fo.solve(fo.Problem(peg, slot, target=(1, 1), goal="touch", motion=fo.Translation("x")))
    assert _sensitivities(found)["text"].startswith("the values hold to one side only")
    none = {key: np.nan * own for key, own in vars(found.sensitivity).items() if isinstance(own, np.ndarray)}
    none |= {"weights": {"TX": np.nan}, "faces": {}, "vertices": {}, "seeds": {}}
    told = _sensitivities(found.changed(sensitivity=replace(found.sensitivity, **none)))
    assert (told["bars"], told["most"]) == ([], None)
    assert told["text"].startswith("no derivatives: another motion is as small; ")
    still = fo.solve(found.problem.changed(goal="clear"))
    assert _sensitivities(still)["text"] == "nothing nearby changes the amount"


def test_sensitivities_are_the_derivatives_of_the_closed_form():
    (case,) = gathered("boxes", "both made larger", frames=1.0)["cases"]
    bars = {bar["name"]: bar["value"] for bar in case["sensitivities"]["bars"]}
    first, second = case["pair"]
    assert bars[f"overall size of {case['bodies'][0]['name']}"] == pytest.approx(0.01 * first / 2, rel=1e-6)
    assert bars[f"overall size of {case['bodies'][1]['name']}"] == pytest.approx(0.01 * second / 4, rel=1e-6)


def test_what_was_left_out_is_true_of_the_problem():
    (plain,) = opened("boxes", "close the gap").problems

    def told(problem):
        return " ".join(not_considered(fo.solve(problem)))

    assert "No keep-out counts here" in told(plain)
    assert "stand for" not in told(plain)
    assert "No limits are set for TX." in told(plain)
    assert "steps of a machine" in told(plain)
    assert "No limits" not in told(plain.changed(limits={"TX": (0.0, 1.0)}))
    assert "steps of a machine" not in told(plain.changed(resolution=0.125))
    near = plain.changed(goal="at", nominal=(1.5, 2.0 + 1e-7), target=(1.6, 2.0))
    assert "closed to the decision curve" in told(near)
    rib = fo.Body.convex(plain.movable.vertices + np.array([0.0, 9.0, 0.0]), name="rib")
    assert "not on the way: rib." in told(plain.changed(keep_out=(rib,)))
    beyond = told(opened("example1").problems[0])
    assert 'pair "any"' in beyond
    assert 'path "coherent"' in beyond
    assert 'path "free"' in told(opened("example1").problems[0].changed(path="free"))
    drawn = told(opened("slot_and_key").problems[0])  # as drawn, by nothing uniform, and not "one pair of sizes"
    assert "Only the parts as drawn were solved" in drawn
    assert "uniform" not in drawn
    assert "The parts are taken as drawn" in told(plain.changed(target=(1.0, 1.0)))


def test_deviation_of_approximated_parts_is_told():
    (plain,) = opened("boxes", "close the gap").problems
    rough = fo.Body.from_parts(
        plain.static.vertices, parts=[range(8)], seed=plain.static.seed, name="rough", deviation=(0.25, 0.125)
    )
    told = not_considered(fo.solve(plain.changed(static=rough)))
    (sentence,) = [text for text in told if "stand for" in text]
    assert sentence.startswith("The convex parts of rough stick out")
    assert "at most 0.25 and" in sentence
    assert "at most 0.125:" in sentence


def test_meshes_are_named_with_their_checksums():
    import hashlib

    path = PROBLEMS / "peg_square.toml"
    (file,) = gather([Opened(path, "", "", ())])["files"]
    assert [mesh["file"] for mesh in file["meshes"]] == ["meshes/square_peg.stl", "meshes/square_plate.stl"]
    for mesh in file["meshes"]:
        assert mesh["sha256"] == hashlib.sha256((PROBLEMS / mesh["file"]).read_bytes()).hexdigest()


def test_sizes_tolerances_and_their_stack_up_are_told():
    """A report said nothing of them; the gap of the key is 0.0325 to 0.0955 by hand."""
    (case,) = gathered("slot_and_key", "low foot, deep slot")["cases"]
    keys = "name", "body", "drawn", "made", "off", "low", "high", "beyond"
    assert [tuple(size[key] for key in keys) for size in case["sizes"]] == [
        ("key_width", "key", "10", "10", "", "-0.036", "0", False),
        ("key_foot", "key", "8 to face back", "7.99 to face back", "-0.01", "-0.02", "+0.02", False),
        ("slot_width", "slot", "10.125", "10.125", "", "0", "+0.03", False),
        ("slot_position", "slot", "\u2013", "\u2013", "", "-0.03", "+0.03", False),
        ("slot_depth", "slot", "8 to face back", "8.04 to face back", "+0.04", "-0.05", "+0.05", False),
    ]
    assert case["off_drawn"] == "key_foot -0.01 mm, slot_depth +0.04 mm"
    assert [worst["gap"] for worst in case["stack"]["worst"]] == pytest.approx([0.0325, 0.0955])
    assert sum(own["worst"] for own in case["stack"]["shares"]) == pytest.approx(1.0)
    assert case["stack"]["shares"][0]["size"] == "slot_position"
    assert gathered("boxes", "both made larger")["cases"][0]["stack"] is None


def test_rounding_was_shown_as_a_place_and_as_a_gap():
    """A bore whose axis is off the origin by what a turn leaves, and a gap of 0 between digits of single precision."""
    hole = fo.Cylinder(4.0, 20, base=(9.97e-15, 5.0, -10))
    plate = fo.cut(fo.Box((40, 40, 10), name="plate"), hole, name="plate")
    place = fo.Size("place", "static", faces="bore radius 4", along="x", tolerance=0.02)
    pin = fo.Cylinder(3.9, 30, base=(0, 5, -15), name="pin")
    (row,) = size_rows(fo.Problem(pin, plate, sizes=[place], motion=fo.Translation("x"), goal="clear"))
    assert (row["drawn"], row["made"]) == ("at 0", "at 0")
    assert direction_level(np.array([0.0, 0.0, 1.0]), np.array([1.0, 2.0, 9.97e-15])) == "z = 0"
    assert direction(np.array([0.6, 0.8, 1e-16])) == "(0.6, 0.8, 0)"
    assert direction_level(np.array([0.6, 0.8, 0.0]), np.array([8e-16, -6e-16, 3.0])).endswith(" . X = 0")
    assert texts.shown(9.97e-15) == texts.shown(0.0) == "0"


def test_limits_by_root_sum_square_beyond_the_worst_case_were_told():
    """A peg of 6 in a slot of 6.2: with a flank off by x, uniform, the gap is min(.1, .1 - x), never above .1."""
    slot = fo.Body.from_parts([[*product(x, (-9, 9), (-9, 9))] for x in ((-9, -3.1), (3.1, 9))])
    peg = fo.Body.convex([*product((-3, 3), (-4, 4), (-4, 4))])
    flank = {"through": (3, 0, 0)}
    size = fo.Size("flank", "movable", faces=flank, tolerance=0.05, distribution={"uniform": {}})
    asked = fo.Problem(peg, slot, sizes=[size], goal="clear", motion=fo.Translation("x"))
    told = stack_report(asked)
    assert [worst["gap"] for worst in told["worst"]] == pytest.approx([0.05, 0.1])
    assert told["spread"]["what"] == "99.73 % of pairs drawn"
    assert told["spread"]["ends"] == pytest.approx([0.05 + 0.1 * 0.00135, 0.1], abs=1e-4)
    assert told["beyond"] == [False, False]
    assert not any("root sum square" in note for note in told["notes"])
    normal = stack_report(asked.changed(sizes=[replace(size, distribution={"normal": {"cp": 0.5}})]))
    assert normal["beyond"] == [True, False]  # a size of which 13 % are beyond its tolerance
    assert BEYOND in normal["notes"]


def test_the_report_of_an_assembly_had_the_stack_up_of_contacts_that_motions_close():
    """A lid on a wall and a block in the box under it: 1 between them, less what the sizes take, is what it is for."""
    parts = {
        "box": fo.Body.from_parts([[*product((-9, 9), (-9, 9), (-2, 0))], [*product((5, 9), (-9, 9), (0, 6))]]),
        "block": fo.Box((4, 4, 5), centre=(0, 0, 2.5)),
        "lid": fo.Box((18, 18, 1), centre=(0, 0, 6.5)),
    }
    between = [("block", "box"), ("lid", "box"), {"parts": ("lid", "block"), "goal": "clear"}]
    floor = fo.Size("floor", "box", faces={"through": (0, 0, 0)}, tolerance=0.02)
    height = fo.Size("height", "block", faces="+z", tolerance=0.03)
    motions = dict.fromkeys(("block", "lid"), fo.Translation("z"))
    asked = fo.Assembly(parts, between, [floor, height], motions, unit="mm")
    told = {own["of"]: [worst["gap"] for worst in own["worst"]] for own in stack_reports(asked)}
    assert [*told] == ["lid and block"]
    assert told["lid and block"] == pytest.approx([1.0 - 0.05, 1.0 + 0.05])
    found = fo.stack_up(asked)  # by the same rule
    assert (found.parts, found.limits, found.worst().least) == (("lid", "block"), (0.0, np.inf), pytest.approx(0.95))
    assert "gap of lid and block at rest" in str(found)
    resting = fo.Assembly(parts, between[:2], [height, replace(floor, body="block", faces="-z")], motions, unit="mm")
    (told,) = stack_reports(resting)  # no clearance is asked: of what touches, motions close all there is
    assert (told["of"], told["yield"], told["worst"][0]["gap"]) == ("block and box", None, pytest.approx(-0.02))
    assert any("motions close this contact" in note for note in told["notes"])
    assert "% of" not in str(fo.stack_up(resting)).replace("99.73 % of", "").partition("size")[0]
    both = [*between, {"parts": ("lid", "box"), "goal": "clear"}]
    both = [between[0], both[-1], between[2]]
    with pytest.raises(fo.InputError, match="lid - box, lid - block"):
        fo.stack_up(fo.Assembly(parts, both, [floor, height], motions, follows={"lid": "box"}))


def test_a_report_that_was_interrupted_left_no_page(monkeypatch):
    """What is done is kept, and all that is missing said; an interrupt before that ends the run."""
    done = []

    def report(problem, *_, **__):
        if len(done) == 1:
            raise KeyboardInterrupt
        done.append(problem.name)
        return {"name": problem.name}

    monkeypatch.setattr(gathering, "case_report", report)
    path = PROBLEMS / "boxes.toml"
    file = ProblemFile.read(path)
    problems = tuple(file.problems(Problem, path))
    opened = SimpleNamespace(path=path, title="", note="", problems=problems, error=None)
    found = gather([opened], certify=False)
    assert [case["name"] for case in found["cases"]] == [problems[0].name]
    assert found["interrupted"]
    missing = found["files"][0]["error"].splitlines()
    assert [own.endswith(f"case '{each.name}': left out: interrupted") for own, each in
            zip(missing, problems[1:], strict=True)] == [True] * (len(problems) - 1)  # fmt: skip
    with pytest.raises(KeyboardInterrupt):
        gather([opened], certify=False)


def test_the_gap_that_a_contact_keeps_was_called_apart_and_no_more():
    """A slide of 5.95 under a cover at 6.1: .15 apart, of which .01 is required; on its base it touches."""
    parts = {
        "base": fo.Box((40, 20, 10), centre=(0, 0, -5)),
        "slide": fo.Box((16, 12, 6), centre=(0, 0, 3)),
        "cover": fo.Box((24, 16, 4), centre=(0, 0, 8.1)),
    }
    between = [("slide", "base"), {"parts": ("cover", "slide"), "goal": "clear", "clearance": 0.01}]
    height = fo.Size("height", "slide", faces="+z", tolerance=0.05)
    motions = dict.fromkeys(("slide", "cover"), fo.Translation("z"))
    asked = fo.Assembly(parts, between, [height], motions, unit="mm", made={"height": -0.05})
    told = assembly_report(fo.solve(asked))
    assert [row[3] for row in told["contacts"]] == ["touching", "apart 0.15 mm, at least 0.01 mm required"]
    (stack,) = told["stacks"]
    assert stack["of"] == "cover and slide"
    assert stack["between"] == ""
    assert stack["yield"]["limits"] == "of at least 0.01 mm"
    assert stack["yield"]["what"] == "fit without a further motion"  # no share of scrap: motions close the others
    assert stack["yield"]["share"] == "100.0000%"  # of .05 to .15
    assert stack["yield"]["of"] == "of 1,000,000 pairs drawn"  # as `stack` draws
    assert len(told["picture"]["insets"]) == 2  # the contact, and the gap


def test_where_parts_do_not_fit_it_was_told_what_matters_most():
    """A key of 6.2 in a blind slot of 6 has no motion to use, whose amount could depend on anything."""
    slot = fo.Body.from_parts([[*product(x, (-9, 9), (-9, 9))] for x in ((-9, -3), (3, 9))])
    key = fo.Body.convex([*product((-3, 3), (-4, 4), (-4, 4))], name="key")
    width = fo.Size("width", "movable", faces=["-x", "+x"], each=0.5, tolerance=0.1)
    motion = fo.Translation("x") >> fo.Translation("z")
    asked = fo.Problem(key, slot, sizes=[width], made={"width": 0.2}, goal="clear", motion=motion)
    solution = fo.solve(asked)
    assert (solution.status.name, solution.usable) == ("OUTSIDE_FIT", False)
    assert _sensitivities(solution) is None


def test_a_goal_to_be_clear_is_told_with_its_clearance():
    (case,) = gathered("lid", "room for a seal")["cases"]
    assert case["wanted"] == "clear by 0.1 mm"
    assert gathered(*LID)["cases"][0]["wanted"] == "seat"


def test_what_matters_most_was_told_beyond_where_its_rate_holds():
    """A block .03 in a wall that may be .12 farther: the amount falls by .03, not by .12; of scales it is "about"."""
    block = fo.Box((10, 8, 6), centre=(0.03, 0, 3), name="block")
    wall = fo.Box((4, 20, 20), centre=(7, 0, 3), name="wall")
    place = fo.Size("place", "static", faces="-x", each=-1.0, tolerance=0.12)
    problem = fo.Problem(block, wall, sizes=[place], goal="clear", motion=fo.Translation("x"), target=(1, 1))
    most = _sensitivities(fo.solve(problem))["most"]
    assert (most["name"], most["unit"], most["value"]) == ("place of wall", "at +0.12", pytest.approx(-0.03))
    assert not most["about"]
    assert _sensitivities(fo.solve(problem.changed(sizes=[])))["most"]["about"]


def test_what_matters_most_was_told_where_nothing_fits():
    """A key .18 in the left wall of a slot with .1 to either; .2 more is .18 too wide: no amount is 'about' right."""
    slot = fo.cut(fo.Box((30, 30, 10), centre=(0, 0, 5)), fo.Box((10.2, 40, 10), centre=(0, 0, 10)), name="slot")
    key = fo.Box((10, 8, 6), centre=(0, 0, 8.5), name="key")
    size = fo.Size("width", "movable", faces=["-x"], tolerance=(0.1, 0.5))
    limits = {"TX": (-0.3, 0.5)}
    motion = fo.Translation("x")
    problem = fo.Problem(
        key, slot, sizes=[size], made={"width": 0.18}, goal="clear", motion=motion, limits=limits, unit="mm"
    )
    case = case_report(problem, solved_module.SolvedCase(fo.solve(problem)), name="c", frames=-1.0)
    assert case["amount"] == pytest.approx(0.08)
    assert (case["sensitivities"]["most"]["value"], case["sensitivities"]["most"]["outcome"]) == (None, "does not fit")
    assert case["limits"] == "limits TX from -0.3 to 0.5 mm"
    # within a tolerance of .3 about drawn: .12 off the other way it needs no shift of .08
    most = _sensitivities(fo.solve(problem.changed(sizes=[replace(size, tolerance=0.3)])))["most"]
    assert (most["unit"], most["value"]) == ("at -0.12 mm in place of +0.18 mm", pytest.approx(-0.08))


def test_what_matters_most_is_a_size():
    (case,) = gathered("slot_and_key", "low foot, deep slot")["cases"]
    most = case["sensitivities"]["most"]
    told = "slot_depth of slot", "at -0.01 mm in place of +0.04 mm"  # .05 off is the end of its tolerance
    assert (most["name"], most["unit"], most["value"]) == (*told, pytest.approx(-0.05))


def test_the_share_of_other_contacts_was_told_as_that_of_parts_that_fit_with_their_clearance() -> None:
    """A block on its floor, which leaves no clearance, .1 before a wall: "fit without a motion: 100 %"."""
    floor = fo.Body.from_parts([[*product((-9, 9), (-9, 9), (-9, 0))], [*product((4, 9), (-9, 9), (0, 6))]])
    block = fo.Body.convex([*product((-4, 3.9), (-4, 4), (0, 4))])
    place = fo.Size("place", "static", faces={"through": (4, 0, 2)}, tolerance=0.03)
    how = {"sizes": [place], "goal": "clear", "clearance": 0.06, "made": {}}
    asked = fo.Problem(block, floor, motion=fo.Translation("z"), **how)
    told = stack_report(asked)
    assert told["yield"]["what"] == "all but closed contacts"
    assert told["notes"][0].startswith("closed at all these sizes, and not counted, though with them no pair is within")
    text = printed(lambda found: print_stack(found, found.yield_(1000)), fo.stack_up(asked))
    assert "of all but closed contacts, gap of at least 0.06: 100.0000%" in " ".join(text.split())


def test_the_report_left_out_what_stack_says_beside_its_numbers(tmp_path):
    """A block on a floor before a wall: the floor is always closed; sizes that are comments, and turned scales."""
    name = "slot_and_key.toml"
    text = (PROBLEMS / name).read_text().replace("meshes/", f"{PROBLEMS}/meshes/")
    (tmp_path / name).write_text(text.replace("[[size]]", "#[[size]]"))
    assert head(Opened(tmp_path / name, "", "", ()))["sizes_left"].startswith("5 are there, commented out")
    assert head(opened("slot_and_key", "as drawn"))["sizes_left"] == ""
    floor = fo.Body.from_parts([[*product((-9, 9), (-9, 9), (-9, 0))], [*product((4, 9), (-9, 9), (0, 6))]])
    block = fo.Body.convex([*product((-4, 3.9), (-4, 4), (0, 4))])
    place = fo.Size("place", "static", faces={"through": (4, 0, 2)}, tolerance=0.03)
    asked = fo.Problem(block, floor, sizes=[place], goal="clear", motion=fo.Translation("x"))
    (told,) = stack_report(asked)["notes"]
    assert told == stack_notes(fo.stack_up(asked))[0]
    assert "closed at all these sizes, and not counted" in told
    post = fo.KeepOut(fo.Body.convex([*product((-6, -5), (-4, 4), (0, 4))], name="post"))
    kept = stack_report(asked.changed(keep_out=[post]))  # it had none: the gap of the two is what it is without
    assert kept == stack_report(asked) | {"notes": [told, kept["notes"][1]]}
    assert kept["worst"][0]["gap"] == pytest.approx(0.1 - 0.03, abs=1e-14)
    assert kept["yield"]["what"] == "clear without a motion"  # of goal "touch" no pair fits without one
    assert kept["between"] == "right face of body, face 7 (facing -x) of body"
    assert "keep-outs (post) have no part in it" in kept["notes"][1]
    turned = fo.Size("shrinkage", "movable", scale=(1, 1, 0), tolerance=0.01)
    tilted = block.moved([[0.8, -0.6, 0, 0], [0.6, 0.8, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    (told,) = stack_report(fo.Problem(tilted, floor, sizes=[turned], motion=fo.Translation("x")))["notes"]
    assert told.startswith("no stack-up: ")


def test_the_load_of_the_machine_decided_how_many_places_a_slider_has():
    """3, 6 and 21 of 21 were seen for one file: it is the problem that decides."""
    (problem,) = opened("boxes", "both made larger").problems
    assert [frames_of(problem, cases) for cases in (1, 4, 8)] == [1.0, 1.0, 0.5]
    families = gather([opened("boxes", "both made larger")], certify=False)["cases"][0]["families"]
    assert [families[name]["values"] for name in ("tolerance", "motion")] == [list(FACTORS), list(SHARES)]


def test_a_stack_up_of_true_faces_is_not_said_to_come_near_them() -> None:
    plate = fo.cut(fo.Box((40, 40, 10)), fo.Cylinder(4.0, 20, base=(0, 0, -10)), name="plate")
    pin = fo.Cylinder(3.9, 30, base=(0, 0, -15), name="pin")
    size = fo.Size("bore", "static", faces="bore radius 4", each=-0.5, tolerance=0.02)
    asked = fo.Problem(pin, plate, sizes=[size], motion=fo.Translation("x"), goal="clear", target=(1, 1))
    found = stack_report(asked)
    assert found["worst"][0]["gap"] == pytest.approx(0.1 - 0.01, abs=1e-9)  # of the radius, with the true faces
    assert not [note for note in found["notes"] if "true parts" in note]
