"""Exponents of growth from rows whose exponents are known, the bodies that are measured, and the picture."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fcdm_opt import decision_curve
from fcdm_opt.errors import FcdmError
from fcdm_opt.geometry.collision import ScaledPair
from fcdm_opt_benchmarks.cost import growth
from fcdm_opt_benchmarks.cost.growth import exponents
from fcdm_opt_benchmarks.cost.growth_picture import growth_figure
from fcdm_opt_benchmarks.method import CurveQuestion, Failure, Method, Pair, one_by_one
from fcdm_opt_benchmarks.record import BenchRun, Load
from fcdm_opt_benchmarks.timing import TimedScene, TimingPlan, measured
from fcdm_opt_benchmarks.union_pairs import FAMILIES, UnionPair, coal_surface


def rows(time, axis="vertices", method="ours", numbers=(8, 16, 100, 1000)):
    return [{"axis": axis, "method": method, "family": "ours", "x": x, "seconds": time(x), "low": 0.9 * time(x),
             "high": 1.2 * time(x), "rounds": 5, "failed": 0} for x in numbers]  # fmt: skip


def test_the_exponent_of_a_power_is_found():
    (found,) = exponents(rows(lambda x: 3e-6 * x**1.5))
    assert found["exponent"] == pytest.approx(1.5, abs=1e-12)
    assert found["error"] == pytest.approx(0.0, abs=1e-12)
    assert found["factor"] == pytest.approx(3e-6, rel=1e-10)
    assert (found["from"], found["to"], found["points"]) == (8, 1000, 4)


def test_the_standard_error_is_that_of_the_slope():
    # by hand: y = log2 t = (0, 3, 3) at x = (0, 1, 2) has slope 3/2, left over (-1/2, 1, -1/2), one degree of freedom
    known = dict(zip((1, 2, 4), (1.0, 8.0, 8.0), strict=True))
    (found,) = exponents(rows(known.__getitem__, numbers=tuple(known)))
    assert found["exponent"] == pytest.approx(1.5, abs=1e-12)
    assert found["error"] == pytest.approx(math.sqrt(1.5 / 1.0 / 2.0), abs=1e-12)


def test_each_method_on_each_axis_has_its_own_exponent():
    data = [*rows(lambda x: x), *rows(lambda x: x**2.0, method="other"), *rows(lambda x: 1.0, axis="parts")]
    found = {(own["axis"], own["method"]): own["exponent"] for own in exponents(data)}
    assert found == pytest.approx({("vertices", "ours"): 1, ("vertices", "other"): 2, ("parts", "ours"): 0}, abs=1e-12)


def test_numbers_without_answers_do_not_count():
    data = rows(lambda x: x**2.0)
    data[1] |= {"seconds": 1e9, "failed": 1}
    data.append({**data[0], "x": 10**6, "seconds": None})
    (found,) = exponents(data)
    assert found["exponent"] == pytest.approx(2.0, abs=1e-12)
    assert found["points"] == 3
    assert exponents(data[:2]) == []  # two points say nothing about their error


# -------------------------------------------------------------------------------------------------------- measuring


def test_a_method_too_slow_is_said_to_be_so_and_not_asked_again(monkeypatch):
    asked = []

    def prepare(subject, setting):
        def answer(question):
            asked.append(subject)
            if subject == 4:
                raise ValueError("four")
            return 2 * question

        return one_by_one(answer)

    def axis(quick, seed):
        scenes = {n: [lambda n=n: TimedScene(str(n), {}, n, lambda k: k)] for n in (1, 2, 4)}
        methods = [Method("quick", "ours", {"default": None}, prepare), Method("slow", "b", {"default": None}, prepare)]
        return growth._GrowthAxis("vertices", scenes, methods, TimingPlan(3, 0.0, 1, 10.0), 10.0)

    monkeypatch.setattr(growth, "_vertices", axis)
    for name in ("_parts", "_parameters"):
        monkeypatch.setattr(
            growth, name, lambda quick, seed: growth._GrowthAxis("none", {}, [], TimingPlan(1, 0.0, 1, 1.0), 1.0)
        )
    said = []
    found = growth.growth(True, 1, said.append)
    assert said == ["growth: 1 vertices", "growth: 2 vertices", "growth: 4 vertices"]
    assert [(row["x"], row["method"], row["failed"], row["rounds"]) for row in found] == [
        (x, name, 4 if x == 4 else 0, 3) for x in (1, 2, 4) for name in ("quick", "slow")
    ]
    assert "four" in found[-1]["reason"]
    asked.clear()
    monkeypatch.setattr(growth, "_vertices", lambda quick, seed: growth.replace(axis(quick, seed), most=-1.0))
    later = growth.growth(True, 1, said.append)[2:]
    assert set(asked) == {1, 2}  # the second is asked once, to be warm
    assert all(row["seconds"] is None and row["reason"].startswith("took") for row in later)
    assert len(later) == 4


def test_a_method_without_its_library_has_no_time():
    """It is not asked: no time of nothing, which no logarithm takes."""

    def prepare(subject, setting):
        raise FcdmError("needs a library")

    method = Method("gone", "b", {"default": None}, prepare)
    axis = growth._GrowthAxis("vertices", {}, [method], TimingPlan(1, 0.0, 1, 1.0), 1.0)
    about = TimedScene("one", {}, None, lambda k: k)
    (own,) = measured(about, [method], axis.plan, np.random.default_rng(0), [])
    row = growth._row(axis, 1, about, own)
    assert (row["seconds"], row["reason"]) == (None, "needs a library")
    assert exponents([row | {"x": x} for x in (1, 2, 4)]) == []


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_unions_are_drawn_with_so_many_parts_a_little_apart(family):
    pair = UnionPair.of(5, family, 4, 2)
    assert [len(body.parts) for body in pair.bodies] == [4, 4]
    np.testing.assert_array_equal(pair.transforms, UnionPair.of(5, family, 4, 2).transforms)
    for T in pair.transforms:
        curve = decision_curve(*pair.bodies, transform=T)
        assert curve.gap((1.0, 1.0)) > 0 > curve.gap((1.7, 1.7))


def test_coal_is_asked_for_the_distance_of_the_same_bodies():
    pair = UnionPair.of(5, "spiky", 3, 2)
    judge, box = ScaledPair(*pair.bodies), np.array(((0.8, 3.0), (0.8, 3.0)))
    found = growth._unions_apart(Pair(*pair.bodies), None)([CurveQuestion(T, box) for T in pair.transforms])
    expected = [judge.signed_distance((1.0, 1.0), T) for T in pair.transforms]
    assert not any(isinstance(own, Failure) for own in found)
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert coal_surface(pair.bodies[0]).num_vertices == sum(len(part.vertices) for part in pair.bodies[0].parts)


# ------------------------------------------------------------------------------------------------------- the picture


def test_the_picture_has_a_line_for_each_method_and_its_exponent():
    data = [
        *rows(lambda x: x**1.5),
        *rows(lambda x: 2.0 * x, method="other"),
        *rows(lambda x: x**0.5, axis="parts"),
        *rows(lambda x: 0.1 * x, axis="parameters", numbers=(1, 2, 3, 6)),
        {"axis": "parts", "method": "late", "family": "b", "x": 9, "seconds": None, "reason": "took 3 s"},
    ]
    run = BenchRun("bench", True, 1, {}, "2026-01-01T00:00", 1.0, Load(None, None), {"growth": data})
    figure = growth_figure(run)
    legends = [[text.get_text() for text in axes.get_legend().get_texts()] for axes in figure.axes]
    assert [len(own) for own in legends] == [2, 1, 1]
    assert "1.50 ± 0.00" in legends[0][0]
    assert "1.00 ± 0.00" in legends[2][0]
    lines = [line for line in figure.axes[0].lines if len(line.get_xdata()) == 4]
    assert {tuple(line.get_ydata()) for line in lines if line.get_linestyle() == "-"} == {
        tuple(x**1.5 for x in (8, 16, 100, 1000)), tuple(2.0 * x for x in (8, 16, 100, 1000)),
    }  # fmt: skip
