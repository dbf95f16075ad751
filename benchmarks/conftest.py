"""Options of the benchmarks, and what is written when they are done."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from report import Results


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("curve benchmarks")
    group.addoption("--bench-out", default="out/benchmarks", help="folder for table, plot and JSON (%(default)s)")
    group.addoption("--bench-seed", type=int, default=3, help="seed of all random pairs (%(default)s)")
    group.addoption("--bench-largest", type=int, default=10000, help="leave out larger pairs (%(default)s)")


_RESULTS = pytest.StashKey[Results]()


def pytest_configure(config: pytest.Config) -> None:
    """Keep the results with the session, for the summary at its end."""
    config.stash[_RESULTS] = Results(seed=config.getoption("--bench-seed"))


@pytest.fixture(scope="session")
def results(pytestconfig: pytest.Config) -> Iterator[Results]:
    """Collect results, and write them when all benchmarks are done."""
    made = pytestconfig.stash[_RESULTS]
    yield made
    made.write(Path(pytestconfig.getoption("--bench-out")))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the tables."""
    text = config.stash[_RESULTS].text()
    if text:
        terminalreporter.section("time per curve, and beside coal's distance")
        terminalreporter.write_line(text)
