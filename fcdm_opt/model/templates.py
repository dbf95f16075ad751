"""CasADi functions that are built once and kept, and the time that building them takes."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache, wraps
from time import perf_counter
from typing import Any

KEPT = 512  # of each function
_SPENT = threading.local()


def building() -> float:
    """Return the seconds that this thread has spent on building templates so far: a clock like `perf_counter`."""
    return float(getattr(_SPENT, "seconds", 0.0))


@contextmanager
def timed() -> Iterator[None]:
    """Count what is done within as the building of a template; what is built within that is not counted twice."""
    before, start = building(), perf_counter()
    yield
    _SPENT.seconds = before + perf_counter() - start


def template(build: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate what builds a CasADi function from hashable arguments: built once for each, with the time counted."""

    @lru_cache(maxsize=KEPT)
    @wraps(build)
    def built(*given: Any) -> Any:
        with timed():
            return build(*given)

    return built
