"""One hypothesis profile for all tests: the same examples on every run, no deadline while kernels compile."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, settings

pytest.register_assert_rewrite("curve_checks")  # checks shared by several files say what differs

settings.register_profile(
    "tests", deadline=None, derandomize=True, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.load_profile("tests")
