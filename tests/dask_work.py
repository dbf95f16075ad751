"""What workers of a test's cluster do: in a module of its own, as they import it."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from fcdm_opt.design.study.point import evaluate

FATAL, DYING, SLOW = "fatal", "dying", "slow"


def work(payload: dict[str, Any]) -> list[dict[str, Any]]:
    """Evaluate points; kill this very process where a point's key says so: always, or where a file does not say when."""
    for key, *_ in payload["points"]:
        if key.startswith(FATAL):
            os.kill(os.getpid(), signal.SIGKILL)
        if key.startswith(DYING):
            once = Path(key.removeprefix(DYING))
            if not once.exists():
                once.touch()
                os.kill(os.getpid(), signal.SIGKILL)
    return [{"key": key, "pid": os.getpid(), "seconds": {"point": 0.01}} for key, *_ in payload["points"]]


def solve(payload: dict[str, Any]) -> list[dict[str, Any]]:
    """Evaluate points; the first process to come here kills itself once it has, before anybody knows."""
    rows = evaluate(payload)
    flag = Path(os.environ.get("FCDM_OPT_TEST_KILL", "/nowhere/at/all"))
    if flag.exists():
        try:
            flag.unlink()
        except FileNotFoundError:
            return rows  # another one was first
        os.kill(os.getpid(), signal.SIGKILL)
    return rows


def idle(payload: dict[str, Any]) -> list[dict[str, Any]]:
    """Take some time."""
    time.sleep(0.05)
    return [{"key": key, "pid": os.getpid(), "seconds": {"point": 0.05}} for key, *_ in payload["points"]]
