"""Yields against areas, distribution functions, exact counts and closed forms of the indices."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from size_tables import BOX, squares, table

from fcdm_opt.design.compensation import assembly_yield as module
from fcdm_opt.design.compensation.assembly_yield import assembly_yield
from fcdm_opt.design.compensation.table import MapPoints, Table
from fcdm_opt.design.distributions import Measured, Normal, Uniform
from fcdm_opt.design.sizes import proportion_interval
from fcdm_opt.errors import InputError

(LOW_1, HIGH_1), (LOW_2, HIGH_2) = BOX
WIDTH_1, WIDTH_2 = HIGH_1 - LOW_1, HIGH_2 - LOW_2
WHOLE_BOX = (Uniform(*BOX[0]), Uniform(*BOX[1]))
FEW = 40_000


def share_1(x):
    return (x - LOW_1) / WIDTH_1


def share_2(y):
    return (y - LOW_2) / WIDTH_2


def linear(p, q, **settings):
    """Return a table of the amount p u + q v, with u and v going from 0 to 1 over the box."""
    return table(squares(3), lambda x, y: p * share_1(x) + q * share_2(y), lambda x, y: x - 1.0, **settings)


def near(found, truth, count, sigmas=5.0):
    """Tell whether a share is where draws of that many pairs bring it."""
    return abs(found - truth) <= sigmas * math.sqrt(truth * (1.0 - truth) / count) + 1e-12


@pytest.mark.parametrize(
    ("p", "q", "budget", "area"),
    [
        (1.0, 1.0, 0.5, 0.125),  # a triangle
        (2.0, 1.0, 1.0, 0.25),
        (1.0, 2.0, 2.0, 0.75),  # what a triangle leaves: v <= 1 - u / 2
        (1.0, 0.0, 0.3, 0.3),
        (3.0, 1.0, 3.5, 1.0 - 0.5 * 0.5 * (0.5 / 3.0)),
        (1.0, 1.0, 2.5, 1.0),
    ],
)
def test_the_share_under_a_linear_amount_is_an_area(p, q, budget, area):
    found = assembly_yield(linear(p, q), sizes=WHOLE_BOX, budget=budget, count=FEW, confidence=0.999999)
    assert near(found.share, area, FEW)
    assert found.interval[0] <= area <= found.interval[1]
    assert (found.outside, found.impossible, found.undecided) == (0.0, 0.0, 0.0)
    assert found.share == found.passed / found.count
    assert found.count == FEW


def test_with_one_size_held_at_its_median_the_share_is_a_length():
    found = assembly_yield(linear(1.0, 3.0), sizes=WHOLE_BOX, budget=1.2, count=FEW)
    # u = 1/2: v <= 0.7 / 3; v = 1/2: never
    assert near(found.contributions[0].share_without, 0.7 / 3.0, FEW)
    assert found.contributions[1].share_without == 0.0
    assert [own.body for own in found.contributions] == ["movable", "static"]
    # a skewed distribution, held at its median and not at its mean: v^2 with v <= 1/4 half of the time
    values = LOW_2 + WIDTH_2 * np.array([0.125, 0.25, 1.0])
    skewed = assembly_yield(linear(1.0, 1.0), sizes=(Uniform(*BOX[0]), Measured(values)), budget=1.0, count=FEW)
    assert near(skewed.contributions[1].share_without, 0.75, FEW)


def test_a_truncated_normal_passes_as_its_distribution_function_says():
    mean, deviation = 1.0, 0.01
    sizes = (Normal(mean, deviation, 0.98, 1.03), Uniform(*BOX[1]))

    def below(x):
        return 0.5 * math.erfc(-(x - mean) / (deviation * math.sqrt(2.0)))

    for limit in (0.99, 1.0, 1.02):
        found = assembly_yield(linear(1.0, 0.0), sizes=sizes, budget=share_1(limit), count=FEW)
        assert near(found.share, (below(limit) - below(0.98)) / (below(1.03) - below(0.98)), FEW)
    for share, amount in found.quantiles.items():
        exact = share_1(sizes[0].quantile(share))
        slope = share_1(sizes[0].quantile(min(1.0, share + 1e-3))) - share_1(sizes[0].quantile(share - 1e-3))
        spread = math.sqrt(share * (1 - share) / FEW) * slope / (min(1.0, share + 1e-3) - share + 1e-3)
        assert amount == pytest.approx(exact, abs=6.0 * spread + 1e-12)


def test_indices_of_a_linear_amount_are_shares_of_its_variance():
    found = assembly_yield(linear(3.0, 4.0), sizes=WHOLE_BOX, budget=1.0, count=FEW)
    for own, truth in zip(found.contributions, (9.0 / 25.0, 16.0 / 25.0), strict=True):
        assert abs(own.first_order - truth) <= 5.0 * own.first_order_error
        assert own.total == pytest.approx(own.first_order, abs=1e-10)  # nothing is due to both together
        assert own.total_error == pytest.approx(own.first_order_error, rel=1e-6)
        assert 0.001 < own.total_error < 0.02
    assert sum(own.first_order for own in found.contributions) == pytest.approx(1.0, abs=1e-10)


def test_indices_of_a_product_are_those_of_its_formula():
    product = table(squares(2), lambda x, y: (1.0 + share_1(x)) * (share_2(y) - 0.5))
    found = assembly_yield(product, sizes=WHOLE_BOX, budget=1.0, count=4 * FEW)
    # factors with means 3/2 and 0 and variances 1/12: only the second counts by itself
    squared = 9.0 / 4.0 + 1.0 / 12.0
    truth = [(0.0, 1.0 / 12.0 / squared), (9.0 / 4.0 / squared, 1.0)]
    for own, (first, total) in zip(found.contributions, truth, strict=True):
        assert abs(own.first_order - first) <= 5.0 * own.first_order_error + 1e-12
        assert abs(own.total - total) <= 5.0 * own.total_error + 1e-12
        assert own.first_order_error < 0.01
        assert own.total_error < 0.01
    assert found.contributions[0].first_order + found.contributions[1].total == pytest.approx(1.0, abs=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "amount",
    [
        lambda x, y: (0.5 + share_1(x)) * (0.5 + share_2(y)),
        lambda x, y: 4.0 * share_1(x) + share_2(y),  # nearly all is due to one: hardly any scatter
    ],
)
def test_standard_errors_of_the_indices_are_as_wide_as_the_indices_scatter(amount):
    own = table(squares(2), amount)
    runs = [assembly_yield(own, sizes=WHOLE_BOX, budget=1.0, count=1000, seed=seed) for seed in range(50)]
    for name in ("first_order", "total"):
        indices = np.array([getattr(run.contributions[0], name) for run in runs])
        stated = np.array([getattr(run.contributions[0], f"{name}_error") for run in runs])
        assert indices.std() == pytest.approx(stated.mean(), rel=0.35)  # of 50 runs: 10 % is one sigma


def test_an_amount_that_does_not_vary_has_no_indices():
    found = assembly_yield(linear(0.0, 0.0), sizes=WHOLE_BOX, budget=0.0, count=1000)
    assert all(math.isnan(own.total) and math.isnan(own.first_order) for own in found.contributions)
    assert (found.share, found.interval[1]) == (1.0, 1.0)
    assert set(found.quantiles.values()) == {0.0}
    assert found.to_dict()["contributions"][0]["total"] is None
    assert found.counts.sum() == 1000


def test_measured_pairs_are_counted_exactly_whatever_else_is_asked():
    random = np.random.default_rng(3)
    shares = random.integers(0, 257, (501, 2)) / 256.0  # exact in the table, and in the count
    pairs = np.array([LOW_1, LOW_2]) + shares * np.array([WIDTH_1, WIDTH_2])
    amounts = 2.0 * shares[:, 0] + shares[:, 1]
    found = assembly_yield(linear(2.0, 1.0), sizes=pairs, budget=1.5, count=10, confidence=0.9)
    assert abs(found.passed - (amounts <= 1.5).sum()) <= (np.abs(amounts - 1.5) < 1e-9).sum()
    found = assembly_yield(linear(2.0, 1.0), sizes=pairs.tolist(), budget=1.5 + 1e-9, count=10, confidence=0.9)
    assert (found.passed, found.count) == ((amounts <= 1.5).sum(), 501)
    assert found.interval == proportion_interval(found.passed, 501, 0.9)
    for share, amount in found.quantiles.items():
        exact = np.sort(amounts)[math.ceil(share * 501) - 1]
        assert amount == pytest.approx(exact, abs=1e-12)
    middle = np.median(shares, axis=0)
    held = (2.0 * middle[0] + shares[:, 1] <= 1.5 + 1e-9).mean(), (2.0 * shares[:, 0] + middle[1] <= 1.5 + 1e-9).mean()
    assert tuple(own.share_without for own in found.contributions) == held


def test_contributions_of_measured_pairs_are_those_of_sizes_drawn_one_by_one():
    shares = np.random.default_rng(4).random(400)
    pairs = np.column_stack([LOW_1 + shares * WIDTH_1, LOW_2 + shares * WIDTH_2])  # as large as each other
    paired = assembly_yield(linear(3.0, 4.0), sizes=pairs, budget=1.0, count=FEW)
    apart = assembly_yield(
        linear(3.0, 4.0), sizes=(Measured(pairs[:, 0]), Measured(pairs[:, 1])), budget=1.0, count=FEW
    )
    for one, other in zip(paired.contributions, apart.contributions, strict=True):
        assert (one.first_order, one.total) == (other.first_order, other.total)
        assert abs(one.first_order - (9.0 if one.body == "movable" else 16.0) / 25.0) < 5.0 * one.first_order_error


@pytest.mark.slow
def test_the_interval_holds_the_truth_as_often_as_it_says():
    own = linear(1.0, 1.0)
    truth, held, widths = 1.0 - 0.125, 0, []
    for seed in range(200):
        low, high = assembly_yield(own, sizes=WHOLE_BOX, budget=1.5, count=300, seed=seed, confidence=0.9).interval
        held += low <= truth <= high
        widths.append(high - low)
    assert held >= 165  # 180 are promised; so few come once in 10,000 times
    assert np.mean(widths) == pytest.approx(2.0 * 1.645 * math.sqrt(truth * (1 - truth) / 300), rel=0.15)


def test_pairs_that_the_error_of_the_map_leaves_undecided_widen_the_interval():
    shares = np.linspace(0.0, 1.0, 101)
    pairs = np.column_stack([LOW_1 + shares * WIDTH_1, np.ones(101)])
    found = assembly_yield(linear(1.0, 0.0, errors=(0.0505, 9.0)), sizes=pairs, budget=0.7, count=10)
    # amounts 0, 0.01, ... 1: sure up to 0.64, possible up to 0.75
    assert found.undecided == pytest.approx(11 / 101)
    assert found.interval == (proportion_interval(65, 101, 0.95)[0], proportion_interval(76, 101, 0.95)[1])
    assert found.interval[0] < proportion_interval(70, 101, 0.95)[0]
    assert found.interval[1] > proportion_interval(71, 101, 0.95)[1]
    unknown = linear(1.0, 0.0, errors=(math.nan, math.nan))
    found = assembly_yield(unknown, sizes=pairs, budget=0.7, count=10)
    assert (found.undecided, found.interval) == (1.0, (0.0, 1.0))
    assert math.isnan(found.share)  # 70 of 101 are as near to the budget as nothing is known


@pytest.mark.parametrize("error", [0.0001, 0.0505, 0.6])
def test_a_yield_is_told_as_well_as_it_is_known(error):
    """Of amounts 0, .01, ... 1 and a budget of .7, so many are within the map's error of that: with most of them the
    yield is not known ("100.0% pass, 0.0% to 100.0%"), with some it is a range."""
    shares = np.linspace(0.0, 1.0, 101)
    pairs = np.column_stack([LOW_1 + shares * WIDTH_1, np.ones(101)])
    found = assembly_yield(linear(1.0, 0.0, errors=(error, 9.0)), sizes=pairs, budget=0.7005, count=10)
    surely, possibly = (shares + error <= 0.7005).sum(), (shares - error <= 0.7005).sum()
    undecided, words = (possibly - surely) / 101, str(found)
    assert found.undecided == pytest.approx(undecided)
    low, high = (f"{end:.1%}" for end in found.interval)
    if undecided > 0.5:
        assert words.startswith("how many of 101 pairs pass (a motion of at most 0.7005) is not known; ")
        assert f"; {undecided:.1%} are undecided: the map is not exact enough there" in words
        assert "100.0%" not in words
        assert math.isnan(found.share)
        assert all(math.isnan(own.share_without) for own in found.contributions[1:])
    elif undecided >= 0.01:
        assert words.startswith(f"of 101 pairs (a motion of at most 0.7005) {low} to {high} pass (95 % confidence); ")
    else:
        assert words.startswith("70.3% of 101 pairs pass")


def test_pairs_beyond_the_maps_ends_were_counted_as_failing():
    """Of half of the pairs the map knows nothing: the interval holds both ends; a third of those within fail."""
    full = linear(1.0, 1.0)
    values = full.values.copy()
    values[:6] = np.nan  # the first third of rho_1
    own = Table(corners=full.corners, values=values, errors=full.errors, regions=full.regions, names=full.names)
    wide = (Uniform(LOW_1, HIGH_1 + WIDTH_1), Uniform(*BOX[1]))
    found = assembly_yield(own, sizes=wide, budget=9.0, count=FEW)
    for share, truth in ((found.outside, 1 / 2), (found.impossible, 1 / 6), (found.share, 2 / 3)):
        assert near(share, truth, FEW)
    assert found.undecided == pytest.approx(0.0, abs=1e-12)
    assert near(found.interval[0], 1 / 3, FEW)
    assert near(found.interval[1], 5 / 6, FEW)
    assert found.counts.sum() == found.passed == round(found.share * (1.0 - found.outside) * FEW)
    assert 0.9 < sum(own.first_order for own in found.contributions) < 1.1
    told = str(found)  # of what was a share was hard to tell: "95 % sure", "beyond the map's ends, where they may ..."
    assert " pairs pass (a motion of at most 9); of all such pairs " in told
    assert f"pass (95 % confidence), whether or not the {found.outside:.4%} beyond the map's ends do; " in told
    assert "have no motion" in told
    nowhere = assembly_yield(own, sizes=(Uniform(2.0, 3.0), Uniform(2.0, 3.0)), budget=9.0, count=100)
    assert math.isnan(nowhere.share)
    assert (nowhere.interval, nowhere.outside, nowhere.impossible) == ((0.0, 1.0), 1.0, 0.0)
    assert all(math.isnan(amount) for amount in nowhere.quantiles.values())
    assert nowhere.to_dict()["quantiles"] == dict.fromkeys(["0.5", "0.9", "0.99", "0.999"])


def test_limits_of_parameters_count_too():
    own = linear(1.0, 1.0)
    kept = assembly_yield(own, sizes=WHOLE_BOX, limits={"p1": (-WIDTH_1 / 4.0, math.inf)}, count=FEW)
    assert near(kept.share, 0.75, FEW)
    assert (kept.budget, kept.to_dict()["budget"]) == (math.inf, None)
    both = assembly_yield(own, sizes=WHOLE_BOX, budget=0.5, limits={"p1": (-math.inf, -WIDTH_1 / 4.0)}, count=FEW)
    assert near(both.share, 3.0 / 32.0, FEW)  # u up to 1/4, under v = 1/2 - u
    assert both.limits == {"p1": (-math.inf, -WIDTH_1 / 4.0)}
    assert both.to_dict()["limits"] == {"p1": [None, -WIDTH_1 / 4.0]}
    assert both.contributions[0].share_without == 0.0  # u = 1/2
    assert near(both.contributions[1].share_without, 0.0, FEW)  # v = 1/2: u = 0 is a point


@pytest.mark.slow
@pytest.mark.parametrize("block", [2, 512, 10**6])
def test_neither_pairs_nor_counts_hang_on_the_size_of_a_block(monkeypatch, block):
    own = table(squares(2), lambda x, y: (0.5 + share_1(x)) * (0.25 + share_2(y)), errors=(1e-3, 0.0))
    sizes = (Normal(1.0, 0.01, 0.96, 1.02), WHOLE_BOX[1])
    whole = assembly_yield(own, sizes=sizes, budget=0.5, count=3001, seed=9)
    monkeypatch.setattr(module, "BLOCK", block)
    cut = assembly_yield(own, sizes=sizes, budget=0.5, count=3001, seed=9)
    assert (cut.passed, cut.undecided, cut.outside, cut.quantiles) == (
        whole.passed,
        whole.undecided,
        whole.outside,
        whole.quantiles,
    )
    assert cut.counts.tolist() == whole.counts.tolist()
    for one, other in zip(cut.contributions, whole.contributions, strict=True):
        assert list(vars(one).values())[1:] == pytest.approx(list(vars(other).values())[1:], rel=1e-9)
    assert assembly_yield(own, sizes=sizes, budget=0.5, count=3001, seed=10).passed != whole.passed


def test_amounts_that_digits_hardly_tell_apart_have_a_histogram():
    pairs = np.column_stack([np.nextafter(1.0, [0.0, 1.0, 2.0]), np.ones(3)])
    found = assembly_yield(linear(1.0, 0.0), sizes=pairs, budget=1.0, count=10)
    assert found.counts.sum() == 3
    assert np.all(np.diff(found.amounts) > 0.0)


def test_anything_that_answers_like_a_table_will_do():
    class Slope:
        box, names = BOX, ("TX",)

        def at(self, rho1, rho2):
            x = np.broadcast_to(
                share_1(rho1) + 0.0 * np.asarray(rho2), np.broadcast_shapes(np.shape(rho1), np.shape(rho2))
            )
            return MapPoints(
                parameters=x[..., None],
                amount=x,
                error=0.0 * x,
                displacement_error=0.0 * x,
                region=np.zeros(x.shape, int),
            )

    found = assembly_yield(Slope(), sizes=WHOLE_BOX, budget=0.3, count=FEW)
    assert near(found.share, 0.3, FEW)


def test_a_result_is_plain_data_and_says_in_a_line_what_it_found():
    found = assembly_yield(linear(1.0, 1.0), sizes=WHOLE_BOX, budget=1.5, count=2000)
    plain = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert plain["passed"] == found.passed
    assert plain["interval"] == list(found.interval)
    assert sum(plain["counts"]) == 2000
    assert len(plain["amounts"]) == len(plain["counts"]) + 1
    assert np.all(np.diff(plain["amounts"]) > 0.0)
    assert "of 2000 pairs pass" in str(found)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"budget": None}, "nothing to keep to"),
        ({"budget": None, "limits": {}}, "nothing to keep to"),
        ({"budget": -1.0}, "budget"),
        ({"budget": math.nan}, "budget"),
        ({"budget": "1"}, "budget"),
        ({"limits": {"RZ": (0.0, 1.0)}}, r"limits\.RZ"),
        ({"limits": {"p1": (1.0, 0.0)}}, r"limits\.p1"),
        ({"limits": 3.0}, "limits"),
        ({"count": 0}, "count"),
        ({"count": 1.5}, "count"),
        ({"count": True}, "count"),
        ({"seed": -1}, "seed"),
        ({"confidence": 1.0}, "confidence"),
        ({"confidence": math.nan}, "confidence"),
        ({"sizes": (Uniform(-1.0, 1.0), WHOLE_BOX[1])}, "sizes must be > 0"),
        ({"sizes": (WHOLE_BOX[0],)}, "not 2 distributions"),
        ({"sizes": (WHOLE_BOX[0], 1.0)}, "not 2 distributions"),
        ({"sizes": WHOLE_BOX[0]}, "sizes"),
        ({"sizes": [[1.0, 1.0], [1.0, math.nan]]}, r"sizes\[2\]"),
        ({"sizes": [[1.0, 0.0]]}, r"sizes\[1\]"),
        ({"sizes": [[1.0, 1.0, 1.0]]}, "an \\(n, 2\\) array of measured scales"),
        ({"sizes": np.empty((0, 2))}, "an \\(n, 2\\) array of measured scales"),
        ({"sizes": "sizes.csv"}, "sizes"),
    ],
)
def test_questions_that_make_no_sense_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        assembly_yield(linear(1.0, 1.0), **{"sizes": WHOLE_BOX, "budget": 1.0, "count": 100, **changes})


def test_the_picture_names_the_budget_the_bodies_and_what_fails(tmp_path):
    from fcdm_opt.show.album import Album
    from fcdm_opt.show.maps import yield_figure

    told = []
    album = Album(tmp_path / "pictures", told.append)
    full = linear(1.0, 2.0)
    some = assembly_yield(full, sizes=(Uniform(LOW_1, HIGH_1 + WIDTH_1), WHOLE_BOX[1]), budget=1.25, count=3000)
    none = assembly_yield(full, sizes=[[2.0, 2.0]], limits={"p1": (0.0, 1.0)}, count=10)
    album.add("peg", yield_figure(some, title="peg in a hole"))
    album.add("peg", yield_figure(none))
    assert not album.failed
    assert sorted(path.name for path in (tmp_path / "pictures").iterdir()) == [
        "peg-2.png",
        "peg-2.svg",
        "peg.png",
        "peg.svg",
    ]
    first, second = ((tmp_path / "pictures" / f"{name}.svg").read_text() for name in ("peg", "peg-2"))
    for word in (
        "peg in a hole",
        "budget 1.25",
        "beyond the budget",
        "movable",
        "static",
        f"{some.share:.2%}",
        "beyond the map",
    ):
        assert word in first
    assert "no pair has a motion" in second
    assert "budget" not in second


def test_what_is_no_map_is_refused():
    with pytest.raises(InputError, match="sizes_map: not a map of motions"):
        assembly_yield(None, sizes=WHOLE_BOX, budget=1.0)  # type: ignore[arg-type]


def test_a_budget_in_an_array_without_axes_is_the_number_in_it():
    """What a map says of one point, as `map.at(...).amount`, was refused."""
    own, plain = (assembly_yield(linear(3.0, 4.0), sizes=WHOLE_BOX, budget=x, count=FEW) for x in (np.array(1.0), 1.0))
    assert own.to_dict() == plain.to_dict()
    for wrong in (np.array(True), np.array("1"), np.array([1.0]), np.array(np.nan)):
        with pytest.raises(InputError, match="budget"):
            assembly_yield(linear(3.0, 4.0), sizes=WHOLE_BOX, budget=wrong, count=FEW)
