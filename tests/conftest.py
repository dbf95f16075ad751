"""One hypothesis profile for all tests: the same examples on every run, no deadline while kernels compile."""

from __future__ import annotations

import gc
import itertools
import os
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers

from fcdm_opt import pacing
from fcdm_opt.threads import single

single()  # as the command line does
pacing.ADVISED = 60.0, 60.0  # what is advised does not depend on what else the machine does
os.environ["FCDM_OPT_BACKGROUND"] = "0"  # no command compiles what it does not need
os.environ["DASK_DISTRIBUTED__WORKER__MULTIPROCESSING_METHOD"] = "forkserver"  # its workers start in a second less
pytest.register_assert_rewrite("curve_checks")  # checks shared by several files say what differs

# else examples take numbers from the text of whatever modules are loaded by then: others after each change, and in
# each order of the tests
providers.is_local_module_file = lambda path: False

settings.register_profile(
    "tests",
    max_examples=6,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("slow", settings.get_profile("tests"), max_examples=30)
# without compiled kernels everything takes a hundred times as long
settings.register_profile("plain Python", settings.get_profile("tests"), max_examples=5)
PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")

# `pytest -m fast`: under 45 s on two cores with kernels compiled, and something of every package
FAST = {
    "test_batch", "test_bodies", "test_certificate", "test_contact", "test_contact_rows", "test_conversion",
    "test_descent", "test_distributions", "test_documents_complete", "test_expansions", "test_features",
    "test_hard_input", "test_hard_problems", "test_judging", "test_main_path", "test_measure_cli", "test_motion",
    "test_paper_examples", "test_problem", "test_rationals", "test_registry", "test_remarks",
    "test_report_page", "test_schema", "test_solids", "test_solution", "test_study_tables", "test_table", "test_turns",
    "test_typing_mistakes", "test_working",
}  # fmt: skip


# files of few tests that take long: workers begin with them, or one would still be at them when all others are done
LONG = {
    "test_assembly", "test_compensation_map", "test_curve_of_unions", "test_documents", "test_init",
    "test_large_meshes", "test_mesh_error", "test_nonconvex", "test_notebooks", "test_report_browser",
    "test_report_data", "test_round_faces", "test_several_contacts", "test_slow_inputs", "test_study_run",
}  # fmt: skip


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--slow`: without it, slow tests are left out unless they are named."""
    parser.addoption("--slow", action="store_true", help="all tests, with all of their cases and more examples each")


def pytest_configure(config: pytest.Config) -> None:
    """Choose how many examples each test takes."""
    settings.load_profile("plain Python" if PLAIN else "slow" if config.option.slow else "tests")
    config.option.loadscopereorder = False  # files go to workers as they are sorted below


def pytest_sessionstart(session: pytest.Session) -> None:
    """Let each worker import another share of all files first: their asserts are rewritten once, not by each worker.

    What is collected lives to the end: it is not looked at for garbage, now or later.
    """
    config, worker = session.config, getattr(session.config, "workerinput", None)
    if worker:
        gc.disable()
    if worker and config.args_source is config.ArgsSource.TESTPATHS and not config.option.markexpr:
        paths = sorted(Path(__file__).parent.glob("**/test_*.py"))
        for path in paths[int(worker["workerid"].removeprefix("gw")) :: worker["workercount"]]:
            sys.path.insert(0, str(path.parent))
            with suppress(Exception, pytest.skip.Exception):  # what is wrong is told when it is collected
                import_module(path.stem)


def pytest_collection_finish() -> None:
    """Look for garbage among what comes now."""
    gc.freeze()
    gc.enable()


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files without fast tests where these alone are asked for: reading all takes longer than those tests."""
    slow = collection_path.name.startswith("test_") and collection_path.stem not in FAST
    return True if slow and config.option.markexpr == "fast" else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the tests of fast files; leave out slow tests and cases, unless all are asked for or these named.

    Workers are given files that take long first, then those of many tests.
    """
    if hasattr(config, "workerinput"):
        files = Counter(item.path for item in items)
        items.sort(key=lambda item: (item.path.stem not in LONG, -files[item.path]))
    for item in items:
        if item.path.stem in FAST:
            item.add_marker(pytest.mark.fast)
    if config.option.slow or any("::" in name for name in config.args):
        return
    cases = Counter(item.nodeid.partition("[")[0] for item in items)
    known, left = Counter[str](), list[pytest.Item]()
    for item in items:
        test, sampled = item.nodeid.partition("[")[0], item.get_closest_marker("sampled")
        share = sampled.args[0] / cases[test] if sampled else 1.0
        turn = int((known[test] + 1) * share) > int(known[test] * share)
        known[test] += 1
        if not turn or item.get_closest_marker("slow"):
            left.append(item)
    config.hook.pytest_deselected(items=left)
    out = set(left)
    items[:] = [item for item in items if item not in out]


@pytest.fixture
def ticking(monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """Let a second go by at each look at the clock of a proof: it ends after as many cells on any machine."""
    ticks = itertools.count()
    monkeypatch.setattr("fcdm_opt.pacing.perf_counter", lambda: float(next(ticks)))
    return ticks


@pytest.fixture
def coarse_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Begin compensation maps with three places a side in place of five, where a test is not about their samples."""
    monkeypatch.setattr("fcdm_opt.design.compensation.refined_mesh.GRID", (0.0, 0.5091, 1.0))
