"""Distributions of sizes: quantiles against other formulas and exact counts; CSV files that are refused."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from fcdm_opt.design.distributions import Measured, Normal, Uniform, read_columns
from fcdm_opt.errors import InputError

SHARES = np.concatenate([[0.0, 1e-300, 1e-18, 1e-9], np.linspace(0.001, 0.999, 41), [1.0 - 2.0**-53, 1.0]])


@pytest.mark.parametrize(
    ("mean", "deviation", "low", "high"),
    [
        (1.0, 0.01, 0.98, 1.02),
        (1.0, 0.01, 0.985, 1.04),
        (0.0, 1.0, -9.0, 9.0),
        (0.0, 1.0, 5.0, 9.0),
        (0.0, 1.0, -30.0, -29.9),
        (0.0, 1.0, 36.0, 37.0),
        (1.0, 100.0, 0.9, 1.1),
    ],
)
def test_a_truncated_normal_has_the_quantiles_of_another_formula_far_out_in_its_tails_too(mean, deviation, low, high):
    from scipy.stats import truncnorm

    drawn = Normal(mean, deviation, low, high)
    truth = truncnorm.ppf(SHARES, (low - mean) / deviation, (high - mean) / deviation, mean, deviation)
    found = drawn.quantile(SHARES)
    np.testing.assert_allclose(found, truth, rtol=1e-12, atol=1e-12 * (high - low))
    assert (np.diff(found) >= 0.0).all()
    assert drawn.range == (low, high)
    assert (found[0], found[-1]) == pytest.approx((low, high), rel=1e-14)
    assert ((found >= low) & (found <= high)).all()


def test_a_normal_mirrored_at_its_mean_is_mirrored():
    shares = np.arange(1, 64) / 64.0
    one, other = Normal(0.0, 1.0, -1.0, 6.0), Normal(0.0, 1.0, -6.0, 1.0)
    np.testing.assert_array_equal(one.quantile(shares), -other.quantile(1.0 - shares))


def test_draws_of_a_normal_have_the_moments_of_its_density():
    drawn = Normal(1.0, 0.01, 0.99, 1.03)
    middle = (np.arange(200_000) + 0.5) / 200_000
    values = drawn.quantile(middle)
    grid = np.linspace(0.99, 1.03, 200_001)
    density = np.exp(-(((grid - 1.0) / 0.01) ** 2) / 2.0)
    mean = np.trapezoid(density * grid, grid) / np.trapezoid(density, grid)
    assert values.mean() == pytest.approx(mean, rel=1e-9)


def test_a_uniform_is_linear_and_ends_exactly():
    drawn = Uniform(0.1, 0.3)
    assert drawn.quantile([0.0, 1.0]).tolist() == [0.1, 0.3]
    np.testing.assert_allclose(drawn.quantile(SHARES), 0.1 + 0.2 * SHARES, rtol=1e-15)
    assert drawn.quantile(0.5).shape == ()
    assert drawn.quantile(np.zeros((2, 3))).shape == (2, 3)


def test_measured_values_are_drawn_at_the_steps_of_their_distribution():
    random = np.random.default_rng(5)
    for count in range(1, 60):
        values = random.integers(1, 30, count) / 8.0
        drawn = Measured(values)
        steps = np.arange(count + 1) / count
        # at a step the lower value, whatever the quotient was rounded to
        expected = np.sort(values)[np.maximum(np.arange(count + 1) - 1, 0)]
        np.testing.assert_array_equal(drawn.quantile(steps), expected)
        for share in random.random(20):
            least = min(x for x in values if Fraction(int((values <= x).sum()), count) >= Fraction(share))
            assert drawn.quantile(share) == least


def test_measured_values_are_kept_as_they_are():
    given = np.array([1.5, 1.25, 1.75])
    drawn = Measured(given)
    given[:] = 0.0
    assert drawn.values.tolist() == [1.25, 1.5, 1.75]
    assert drawn.range == (1.25, 1.75)
    assert drawn == Measured([1.75, 1.5, 1.25])
    assert hash(drawn) == hash(Measured([1.75, 1.5, 1.25]))
    assert drawn != Measured([1.75, 1.5])
    with pytest.raises(ValueError, match="read-only"):
        drawn.values[0] = 2.0


def test_plain_data_names_what_it_is():
    assert Uniform(1, 2).to_dict() == {"uniform": {"low": 1.0, "high": 2.0}}
    assert Normal(0, 1, -1, 2).to_dict() == {"normal": {"mean": 0.0, "deviation": 1.0, "low": -1.0, "high": 2.0}}
    assert Measured([2, 1]).to_dict() == {"measured": {"values": [1.0, 2.0]}}


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: Uniform(1.0, 1.0), "empty range"),
        (lambda: Uniform(2.0, 1.0), "empty range"),
        (lambda: Uniform(float("nan"), 1.0), "uniform.low"),
        (lambda: Uniform(0.0, "1"), "uniform.high"),
        (lambda: Uniform(0.0, float("inf")), "uniform.high"),
        (lambda: Normal(1.0, 0.0, 0.9, 1.1), "normal.deviation"),
        (lambda: Normal(1.0, -0.1, 0.9, 1.1), "normal.deviation"),
        (lambda: Normal(float("nan"), 0.1, 0.9, 1.1), "normal.mean"),
        (lambda: Normal(1.0, 0.1, 1.1, 0.9), "empty range"),
        (lambda: Normal(0.0, 1.0, 40.0, 41.0), "37 deviations"),
        (lambda: Normal(0.0, 1.0, -41.0, -40.0), "37 deviations"),
        (lambda: Measured([]), "at least one"),
        (lambda: Measured([1.0, float("nan")]), "finite"),
        (lambda: Measured([[1.0]]), "measured"),
        (lambda: Measured(["a"]), "measured"),
        (lambda: Uniform(1.0, 2.0).quantile(1.5), "between 0 and 1"),
        (lambda: Normal(1.0, 0.1, 0.9, 1.1).quantile(float("nan")), "between 0 and 1"),
        (lambda: Measured([1.0]).quantile(-0.1), "between 0 and 1"),
        (lambda: Uniform(1.0, 2.0).quantile("half"), "u: expected"),
        (lambda: Measured([1.0]).quantile(10**400), "u: expected"),
        (lambda: Measured.from_csv(None, "peg"), "cannot be read"),  # type: ignore[arg-type]
    ],
)
def test_what_makes_no_distribution_is_refused(make, word):
    with pytest.raises(InputError, match=word):
        make()


def written(directory: Path, content: str | bytes) -> Path:
    path = directory / "sizes.csv"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def test_columns_of_a_file_are_read_in_the_order_asked_for_and_divided_by_their_nominal_sizes(tmp_path):
    path = written(tmp_path, '\ufeffid, peg ,"hole, inner"\r\n"a",10.01, 20.5\r\n\r\nb,9.99,"1.95e1"\r\n,,\r\n')
    found = read_columns(path, ["hole, inner", "peg"], [20.0, 10.0])
    np.testing.assert_array_equal(found, [[20.5 / 20.0, 10.01 / 10.0], [19.5 / 20.0, 9.99 / 10.0]])
    assert Measured.from_csv(path, "peg", 10.0) == Measured([10.01 / 10.0, 9.99 / 10.0])
    assert Measured.from_csv(path, "peg").range == (9.99, 10.01)


def test_blank_lines_before_the_names_are_skipped_and_rows_still_counted_from_the_first_line(tmp_path):
    path = written(tmp_path, "\n , \r\npeg\n1.5\n")
    np.testing.assert_array_equal(read_columns(path, ["peg"]), [[1.5]])
    with pytest.raises(InputError, match=r"row 5.*nan"):
        read_columns(written(tmp_path, "\n,\npeg\n1.5\nnan\n"), ["peg"])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", ["no such column", "'peg'"]),
        ("peg\n", ["no row of numbers"]),
        ("hole\n1\n", ["'peg'", "'hole'"]),
        ("peg,peg\n1,1\n", ["twice", "'peg'"]),
        ("peg;hole\n1;2\n", ["separated by commas"]),
        ("peg\n1\nnan\n", ["row 3", "'peg'", "nan"]),
        ("peg\n1\ninf\n", ["row 3", "'peg'", "inf"]),
        ("peg,hole\n1,1\n,1\n", ["row 3", "'peg'", "nothing"]),
        ("peg,hole\n1\n", ["row 2", "1 cells"]),
        ("peg\n1,01\n", ["row 2", "2 cells", "points"]),
        ("peg\n1\nten\n", ["row 3", "'ten'"]),
        ("peg\n1_0\n", ["row 2", "1_0"]),
        ("peg\n0\n", ["row 2", "number > 0"]),
        ("peg\n-1\n", ["row 2", "'-1'"]),
        ('peg\n"1\n', ["CSV"]),
        (b"peg\n\xff\n", ["UTF-8"]),
    ],
)
def test_a_file_that_is_no_table_of_sizes_is_refused_with_the_place(tmp_path, content, words):
    path = written(tmp_path, content)
    with pytest.raises(InputError) as caught:
        Measured.from_csv(path, "peg")
    for word in [path.name, *words]:
        assert word in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.csv"):
        Measured.from_csv(tmp_path / "none.csv", "peg")
    with pytest.raises(InputError, match="cannot be read"):
        Measured.from_csv("a\0b.csv", "peg")


@pytest.mark.parametrize("nominal", [0.0, -1.0, float("nan"), "1"])
def test_a_nominal_size_is_a_number_above_zero(tmp_path, nominal):
    with pytest.raises(InputError, match="nominal"):
        Measured.from_csv(written(tmp_path, "peg\n1\n"), "peg", nominal)


@pytest.mark.parametrize(("columns", "nominals"), [("peg", None), ([], None), ([1], None), (["peg"], [1.0, 2.0])])
def test_columns_are_a_list_of_names_with_a_nominal_size_each(tmp_path, columns, nominals):
    with pytest.raises(InputError, match=r"columns|nominals"):
        read_columns(written(tmp_path, "peg\n1\n"), columns, nominals)
