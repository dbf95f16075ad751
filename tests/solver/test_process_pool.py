"""Work in processes beside this one: results in order, what it raises, and nothing left when nobody waits."""

import os
import time

import pytest

from fcdm_opt import process_pool
from fcdm_opt.errors import FcdmError, InputError

pytestmark = pytest.mark.fast


@pytest.fixture(autouse=True)
def two_cores(monkeypatch):
    monkeypatch.setattr(process_pool, "cores", lambda most: min(2, most))


def test_a_library_copies_no_process_of_others(monkeypatch):
    monkeypatch.undo()
    monkeypatch.setattr(process_pool, "_allowed", [])
    assert {result() for result in process_pool.each(lambda _: os.getpid(), range(3))} == {os.getpid()}


@pytest.fixture
def files(tmp_path):
    for name, size in (("small", process_pool.WORTH), ("large", 2 * process_pool.WORTH)):
        (tmp_path / name).write_bytes(bytes(size))
    return tmp_path / "small", tmp_path / "large"


@pytest.mark.parametrize("way", [1, -1])
def test_the_smaller_of_two_files_is_read_beside(files, way):
    here, beside_ = os.getpid(), lambda path: (path.name, os.getpid())
    found = process_pool.both(beside_, files[::way], files[::way])
    assert [name for name, _ in found] == ["small", "large"][::way]
    assert {name for name, own in found if own == here} == {"large"}


@pytest.mark.parametrize("way", [1, -1])
def test_of_two_errors_the_first_is_raised(files, way):
    def work(path):
        raise InputError("broken", file=path.name)

    with pytest.raises(InputError, match=f"{files[::way][0].name}: broken"):
        process_pool.both(work, files[::way], files[::way])
    with pytest.raises(InputError, match="large: broken"):
        process_pool.both(lambda path: work(path) if path.name == "large" else 1, files[::way], files[::way])
    assert not [own for own in process_pool.multiprocessing.active_children() if not own.name.startswith("Loky")]


def test_results_come_in_order_whatever_ends_first():
    def work(number):
        time.sleep(0.05 * (5 - number))
        return number, os.getpid()

    found = [result() for result in process_pool.each(work, range(5))]
    assert [number for number, _ in found] == list(range(5))
    assert len({pid for _, pid in found} | {os.getpid()}) == 6


def test_a_single_piece_of_work_is_done_here():
    (result,) = process_pool.each(lambda _: os.getpid(), [0])
    assert result() == os.getpid()


def test_what_work_raises_is_raised_where_its_result_is_asked_for():
    def work(number):
        if number == 1:
            raise InputError("no such thing", key="tolerance", found=7, allowed="less")
        return "x" * 10**6  # more than a pipe holds

    first, second, third = process_pool.each(work, range(3))
    assert len(first()) == len(third()) == 10**6
    with pytest.raises(InputError, match="tolerance: no such thing; found 7; allowed: less") as caught:
        second()
    assert (caught.value.key, caught.value.found) == ("tolerance", 7)
    assert "in work" in str(caught.value.__cause__)


def test_a_process_that_dies_is_told():
    def work(number):
        if number:
            os._exit(3)
        return number

    first, second = process_pool.each(work, range(2))
    assert first() == 0
    with pytest.raises(FcdmError, match="ended with code 3"):
        second()


def test_work_that_nobody_waits_for_any_more_is_ended(tmp_path):
    def work(number):
        if number:
            (tmp_path / "begun").touch()
            time.sleep(60.0)
            (tmp_path / "ended").touch()
        while not (tmp_path / "begun").exists():
            time.sleep(0.01)
        return os.getpid()

    results = process_pool.each(work, range(2))
    next(results)()
    results.close()
    assert not [own for own in process_pool.multiprocessing.active_children() if not own.name.startswith("Loky")]
    assert not (tmp_path / "ended").exists()
