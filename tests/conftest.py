"""One hypothesis profile for all tests: the same examples on every run, no deadline while kernels compile."""

from __future__ import annotations

import os

import pytest
from hypothesis import HealthCheck, settings

pytest.register_assert_rewrite("curve_checks")  # checks shared by several files say what differs

settings.register_profile(
    "tests", deadline=None, derandomize=True, database=None, suppress_health_check=[HealthCheck.too_slow]
)
# without compiled kernels everything takes a hundred times as long
settings.register_profile("plain Python", settings.get_profile("tests"), max_examples=5)
PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
settings.load_profile("plain Python" if PLAIN else "tests")
