"""What a study found, read back: every point a row, the same numbers in every table, no half-written file."""

from __future__ import annotations

import csv
import json
import math
import os
import re
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from fcdm_opt.design.sizes import proportion_interval
from fcdm_opt.design.study.point import BAD_INPUT, Row, row
from fcdm_opt.design.study.results import PENDING, StudyResult
from fcdm_opt.design.study.store import FILE, Store
from fcdm_opt.design.study.variables import shares
from fcdm_opt.errors import InputError
from fcdm_opt.show.report.page import study_page


def definition(vary: dict[str, Any], *, cases: Sequence[str] = (), draws: int | None = None, **own: Any) -> dict:
    """A study's definition as its store keeps it: label (or several keys) -> values, None for what is drawn."""
    entries = [{"key": key.split(" & "), "label": key, "values": values} for key, values in vary.items()]
    axes: dict[str, Any] = {"case": list(cases)} if cases else {}
    axes |= {key: values for key, values in vary.items() if values is not None}
    labels = [*(["case"] if cases else []), *vary]
    if draws:
        axes["draw"] = draws
    return {"title": "a study", "note": "", "budget": None, **own, "labels": labels, "axes": axes, "vary": entries}


def solved(key: str, amount: float, **own: Any) -> Row:
    parameters = {"TZ": -amount, "RZ": amount / 3}
    seconds = {"solve": 0.25, "verify": 0.125, "point": 0.5}
    answer = {"usable": True, "amount": amount, "lower_bound": amount, "parameters": parameters, "rho": [1.1, 0.9]}
    return {**row(key, "SOLVED"), **answer, "pair": [1.1, 0.9], "features": ["V1F2", "E1E2"], "seconds": seconds, **own}


def stored(folder: Path, about: dict, points: Sequence[tuple[str, dict]], rows: Sequence[Row]) -> StudyResult:
    met = [(number, key, values) for number, (key, values) in enumerate(points)]
    with Store(folder, "a key", "0.1.0", about) as store:
        store.write(met, rows)
    return StudyResult.read(folder)


@pytest.fixture
def sweep(tmp_path: Path) -> StudyResult:
    """Two cases over three tolerances: two points share a row, one fails, one has not been met yet."""
    about = definition({"tolerance": [0.01, 0.02, 0.03]}, cases=["A", "B"], budget=0.25)
    values = [{"case": case, "tolerance": tau} for case in "AB" for tau in (0.01, 0.02, 0.03)]
    keys = ["one", "two", "two", "bad", "asked"]
    rows = [solved("one", 0.1), solved("two", 1 / 3), row("bad", BAD_INPUT, "no such tolerance")]
    return stored(tmp_path / "out", about, list(zip(keys, values, strict=False)), rows)


def test_a_grid_had_an_interval_of_confidence_and_angles_no_unit(sweep: StudyResult) -> None:
    """One of four points worked out is within .25: points of a grid are chosen, not drawn."""
    share = sweep.assembly_yield
    assert share is not None
    assert (share.share, share.interval) == (0.25, None)
    page = study_page(sweep)
    assert "(1 of 4)" in str(sweep)
    assert not any(
        "interval" in text for text in (str(sweep), re.sub("<script.*?</script>", "", page, flags=re.DOTALL))
    )
    assert "RZ (radians)" in page
    assert "deviations of sizes by name (made) are in that unit" in page


def test_every_point_is_a_row_in_order(sweep: StudyResult) -> None:
    rows = sweep.rows()
    assert [found["number"] for found in rows] == list(range(6))
    assert [(found["case"], found["tolerance"]) for found in rows] == [(c, t) for c in "AB" for t in (0.01, 0.02, 0.03)]
    assert [found["status"] for found in rows] == ["SOLVED"] * 3 + [BAD_INPUT, PENDING, PENDING]
    assert [found["amount"] for found in rows] == [0.1, 1 / 3, 1 / 3, None, None, None]
    assert rows[1] == {**rows[2], "number": 1, "tolerance": 0.02}
    assert rows[3]["message"] == "no such tolerance"
    assert len({tuple(found) for found in rows}) == 1
    names = list(rows[0])
    assert names.index("TZ") + 1 == names.index("RZ")  # in the order of the motion
    assert (rows[0]["RZ"], rows[0]["rho_2"], rows[0]["features"]) == (0.1 / 3, 0.9, "V1F2; E1E2")
    assert sweep.counts == {"SOLVED": 3, "PENDING": 2, "BAD_INPUT": 1}
    assert not sweep.complete
    assert sweep.seconds == {"solve": 0.5, "verify": 0.25, "point": 1.0}  # rows, not points: shared work counts once


def test_all_tables_hold_the_same_numbers(sweep: StudyResult, tmp_path: Path) -> None:
    import pandas

    rows, frame = sweep.rows(), sweep.frame()
    sweep.to_csv(tmp_path / "study.csv")
    sweep.to_parquet(tmp_path / "study.parquet")
    with (tmp_path / "study.csv").open(newline="", encoding="utf-8") as file:
        texts = list(csv.DictReader(file))
    assert len(texts) == len(rows) == len(frame)
    pandas.testing.assert_frame_equal(pandas.read_parquet(tmp_path / "study.parquet"), frame)
    for name in rows[0]:
        told = ["" if found[name] is None else str(found[name]) for found in rows]
        assert [text["RZ (rad)" if name == "RZ" else name] for text in texts] == told
        if frame[name].dtype == float:
            np.testing.assert_array_equal(frame[name], [math.nan if r[name] is None else r[name] for r in rows])
    assert frame["amount"].dtype == frame["tolerance"].dtype == float


def test_a_dataset_has_the_axes_of_the_study(sweep: StudyResult) -> None:
    data = sweep.dataset()
    assert dict(data.sizes) == {"case": 2, "tolerance": 3}
    assert float(data["amount"].sel({"case": "A", "tolerance": 0.03})) == 1 / 3
    assert str(data["status"].sel({"case": "B", "tolerance": 0.01}).item()) == BAD_INPUT
    for found in sweep.rows():
        own = data.sel({"case": found["case"], "tolerance": found["tolerance"]})
        np.testing.assert_equal(float(own["TZ"]), math.nan if found["TZ"] is None else found["TZ"])
        assert int(own["number"]) == found["number"]
    assert (data.attrs["title"], data.attrs["version"]) == ("a study", "0.1.0")


def test_what_varies_together_is_a_column_a_key(tmp_path: Path) -> None:
    about = definition({"requirement & goal": [["A", "touch"], ["B", "at"]], "target[1]": None}, draws=2)
    points = [
        (f"k{k}", {"requirement & goal": pair, "target[1]": drawn})
        for k, (pair, drawn) in enumerate(
            (pair, drawn) for pair in (["A", "touch"], ["B", "at"]) for drawn in (1.5, 1.6)
        )
    ]
    result = stored(tmp_path, about, points[:3], [solved("k0", 0.5)])
    assert result.axes == {"requirement & goal": (("A", "touch"), ("B", "at")), "draw": (0, 1)}
    rows = result.rows()
    assert [(r["requirement"], r["goal"], r["draw"]) for r in rows] == [
        ("A", "touch", 0), ("A", "touch", 1), ("B", "at", 0), ("B", "at", 1),
    ]  # fmt: skip
    assert [r["target[1]"] for r in rows] == [1.5, 1.6, 1.5, None]  # what is drawn is not known before it is met
    data = result.dataset()
    assert dict(data.sizes) == {"requirement & goal": 2, "draw": 2}
    assert data["goal"].values.tolist() == ["touch", "at"]
    np.testing.assert_array_equal(data["target[1]"], [[1.5, 1.6], [1.5, math.nan]])


def test_columns_hold_values_of_one_kind(tmp_path: Path) -> None:
    import pandas

    mixed: list[Any] = ["drawn", 3, [1.0, 1.1], None]
    about = definition({"nominal": mixed, "status": [1, 2]})
    result = stored(tmp_path, about, [], [])
    rows = result.rows()
    assert [r["nominal"] for r in rows[::2]] == ["drawn", "3", "[1.0, 1.1]", None]
    assert [r["status (varied)"] for r in rows] == [1, 2] * 4
    assert {r["status"] for r in rows} == {PENDING}
    assert result.dataset().sizes["status (varied)"] == 2
    result.to_parquet(tmp_path / "mixed.parquet")
    again = pandas.read_parquet(tmp_path / "mixed.parquet")
    assert again["nominal"].tolist()[:6] == ["drawn", "drawn", "3", "3", "[1.0, 1.1]", "[1.0, 1.1]"]
    assert again["amount"].dtype == float  # of nothing but nan


def test_a_study_of_one_point_has_no_axes(tmp_path: Path) -> None:
    result = stored(tmp_path, definition({}), [("k", {})], [solved("k", 0.5)])
    assert result.axes == {}
    assert float(result.dataset()["amount"]) == 0.5
    assert "1 points: 1 SOLVED" in str(result)


# ---------------------------------------------------------------------------------------------------------------- yield


@pytest.mark.parametrize("within", [0, 3, 17, 20])
def test_yield_has_the_exact_interval(within: int, tmp_path: Path) -> None:
    about = definition({"tolerance": None}, draws=21, budget=0.25)
    rows = [solved(f"k{k}", 0.25 if k < within else 0.2500001) for k in range(19)]
    rows.append(solved("k19", 0.1, usable=within == 20) if within in (0, 20) else row("k19", "NOT_FOUND"))
    result = stored(tmp_path, about, [(f"k{k}", {"tolerance": k / 7}) for k in range(20)], rows)
    found = result.assembly_yield
    assert found is not None
    assert (found.share, found.within, found.of, found.budget) == (within / 20, within, 20, 0.25)  # one is pending
    expected = binomtest(within, 20).proportion_ci(0.95, "exact")
    np.testing.assert_allclose(found.interval, (expected.low, expected.high), rtol=1e-9)
    assert f"{found.share:.2%} within 0.25 ({within} of 20" in str(result)
    assert result.to_dict()["assembly_yield"]["interval"] == list(found.interval)


def test_the_interval_of_a_latin_hypercube_was_that_of_independent_draws(tmp_path: Path) -> None:
    """Sums of two sizes below 0.7: 24.5 % of them, which at least 95 % of all intervals have."""
    held = 0
    for seed in range(400):
        within = int((shares("latin hypercube", 20, 2, seed=seed).sum(axis=0) < 0.7).sum())
        low, high = proportion_interval(within, 20, 0.95, independent=False)
        held += low <= 0.7**2 / 2 <= high
        least, most = binomtest(within, 20).proportion_ci(0.95, "exact")
        assert (low, high) == (max(0.0, min(low, least)), max(high, most))
    assert held >= 0.95 * 400
    about = definition({"tolerance": None}, draws=20, budget=0.25) | {"sampling": "latin hypercube"}
    rows = [solved(f"k{k}", 0.25 if k < 10 else 0.26) for k in range(20)]
    result = stored(tmp_path, about, [(f"k{k}", {"tolerance": k / 7}) for k in range(20)], rows)
    assert result.assembly_yield.interval == proportion_interval(10, 20, 0.95, independent=False)
    assert sum(result.assembly_yield.interval) == pytest.approx(1.0, abs=1e-12)


def test_without_a_budget_there_is_no_yield(tmp_path: Path) -> None:
    result = stored(tmp_path, definition({"tolerance": [0.1]}), [("k", {"tolerance": 0.1})], [solved("k", 0.5)])
    assert result.assembly_yield is None
    assert "yield" not in str(result)


def test_plain_data_is_strict_json(tmp_path: Path) -> None:
    infeasible = {**row("k", "INFEASIBLE"), "lower_bound": math.inf}
    result = stored(tmp_path, definition({"tolerance": [0.1]}), [("k", {"tolerance": 0.1})], [infeasible])
    told = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert told["rows"][0]["lower_bound"] == "inf"
    assert told["rows"] == [{**found, "lower_bound": "inf"} for found in result.rows()]
    assert result.frame()["lower_bound"].tolist() == [math.inf]
    assert (told["counts"], told["version"]) == ({"INFEASIBLE": 1}, "0.1.0")


# ---------------------------------------------------------------------------------------------------------------- files


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_failing_write_leaves_no_file_and_no_damage(
    ending: str, sweep: StudyResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pandas

    folder = tmp_path / "tables"
    folder.mkdir()
    write = getattr(sweep, f"to_{ending}")
    write(folder / "good")
    good = (folder / "good").read_bytes()

    def full(path: Path) -> None:
        path.write_bytes(good[:50])
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", lambda path, *_, **__: full(path))
        patch.setattr(pandas.DataFrame, "to_parquet", lambda _, path, **__: full(path))
        with pytest.raises(InputError, match="cannot be written; found 'No space left"):
            write(folder / "good")
    with pytest.raises(InputError, match="cannot be written"):
        write(folder / "missing" / "table")
    with monkeypatch.context() as patch:
        patch.setattr("os.replace", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
        with pytest.raises(KeyboardInterrupt):
            write(folder / "other")
    assert os.listdir(folder) == ["good"]
    assert (folder / "good").read_bytes() == good


@pytest.mark.parametrize(
    ("call", "missing"),
    [("frame", "pandas"), ("dataset", "xarray"), ("dataset", "pandas"), ("to_parquet", "pyarrow")],
)
def test_a_missing_extra_says_what_to_install(
    call: str, missing: str, sweep: StudyResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, missing, None)
    arguments = [tmp_path / "table"] if call.startswith("to_") else []
    told = rf"(xarray|{missing}) cannot be loaded .*-c constraints.txt -e '\.\[tables\]'"
    with pytest.raises(InputError, match=told):
        getattr(sweep, call)(*arguments)
    sweep.to_csv(tmp_path / "table.csv")  # needs none of them
    assert sorted(os.listdir(tmp_path)) == ["out", "table.csv"]


def damaged(path: Path) -> Iterator[tuple[str, Any]]:
    import sqlite3

    def change(text: str) -> Any:
        def run() -> None:
            with sqlite3.connect(path) as base:
                base.execute(text)
            base.close()

        return run

    yield "no study has been run", path.unlink
    yield "not a store of a study", lambda: path.write_bytes(b"no data base at all" * 100)
    yield "laid out in another way", change("UPDATE meta SET value = '99' WHERE name = 'schema'")
    yield "not a store of a study", change("DELETE FROM meta WHERE name = 'definition'")
    yield "not a store of a study", change("UPDATE results SET row = '{'")
    yield "not a store of a study", change("DROP TABLE points")


@pytest.mark.parametrize("k", range(6))
def test_what_is_no_store_is_refused(k: int, sweep: StudyResult, tmp_path: Path) -> None:
    path = tmp_path / "out" / FILE
    what, damage = list(damaged(path))[k]
    damage()
    with pytest.raises(InputError, match=what) as refused:
        StudyResult.read(tmp_path / "out")
    assert str(refused.value.file).startswith(str(tmp_path / "out"))


def test_a_store_can_be_read_while_it_is_written(tmp_path: Path) -> None:
    about = definition({"tolerance": [0.1, 0.2]})
    with Store(tmp_path, "a key", "0.1.0", about) as store:
        assert StudyResult.read(tmp_path).counts == {PENDING: 2}
        store.write([(0, "k", {"tolerance": 0.1})], [solved("k", 0.5)])
        before = StudyResult.read(tmp_path)
        store.write([(1, "l", {"tolerance": 0.2})], [solved("l", 0.7)])
        assert before.counts == {"SOLVED": 1, PENDING: 1}
        assert StudyResult.read(tmp_path).counts == {"SOLVED": 2}


def test_a_store_can_be_read_where_nothing_can_be_written(sweep: StudyResult, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    folder.chmod(0o555)
    try:
        assert StudyResult.read(folder).rows() == sweep.rows()
    finally:
        folder.chmod(0o755)


@pytest.mark.parametrize(
    "labels",
    [("TZ", "seconds.point"), ("amount", "amount (varied)"), ("amount (varied)", "amount"), ("goal & TZ", "goal")],
)
def test_no_column_takes_the_place_of_another(labels: tuple[str, str], tmp_path: Path) -> None:
    values: list[list[Any]] = [[1.5, 2.5] if "&" not in label else [["at", 1.5], ["touch", 2.5]] for label in labels]
    about = definition(dict(zip(labels, values, strict=True)))
    points = [
        (f"k{k}{m}", dict(zip(labels, (one, two), strict=True)))
        for k, one in enumerate(values[0])
        for m, two in enumerate(values[1])
    ]
    result = stored(tmp_path, about, points, [solved(key, 0.5) for key, _ in points])
    for found, (_, given) in zip(result.rows(), points, strict=True):
        assert (found["amount"], found["TZ"], found["seconds.point"]) == (0.5, -0.5, 0.5)
        wanted = [own for value in given.values() for own in (value if isinstance(value, list) else [value])]
        assert list(found.values())[1 : 1 + len(wanted)] == wanted
    data = result.dataset()
    assert list(data.sizes.values()) == [2, 2]
    assert data["amount"].values.tolist() == [[0.5, 0.5], [0.5, 0.5]]


def test_whole_numbers_that_no_column_holds_are_text(tmp_path: Path) -> None:
    import pandas

    result = stored(tmp_path, definition({"tolerance": [0.5, 10**20]}), [], [])
    assert [r["tolerance"] for r in result.rows()] == ["0.5", str(10**20)]
    result.to_parquet(tmp_path / "study.parquet")
    assert pandas.read_parquet(tmp_path / "study.parquet")["tolerance"].tolist() == ["0.5", str(10**20)]


@pytest.mark.parametrize("path", ["", ".", "a\0b"])
def test_what_is_no_file_is_not_written(path: str, sweep: StudyResult) -> None:
    for write in (sweep.to_csv, sweep.to_parquet):
        with pytest.raises(InputError, match=r"no file|cannot be written"):
            write(path)


def test_no_file_takes_the_place_of_a_device(sweep: StudyResult, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="no file, and none is put in its place"):
        sweep.to_csv(tmp_path / "pipe")
    assert (tmp_path / "pipe").is_fifo()
    assert sorted(os.listdir(tmp_path)) == ["out", "pipe"]
