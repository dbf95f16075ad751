"""What workers of a test's cluster do: in a module of its own, as they import it."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path
from typing import Any

from fcdm_opt.design.study.point import evaluate


def dying_once(flag: str, payload: dict[str, Any]) -> list[dict[str, Any]]:
    """Evaluate points; the first process to come here kills itself once it has, before anybody knows."""
    rows = evaluate(payload)
    try:
        Path(flag).unlink()
    except FileNotFoundError:
        return rows
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("unreachable")


def dying_at(fatal: frozenset[str], payload: dict[str, Any]) -> list[dict[str, Any]]:
    """Evaluate points; those of some keys always kill the process."""
    if fatal.intersection(key for key, *_ in payload["points"]):
        os.kill(os.getpid(), signal.SIGKILL)
    return evaluate(payload)


def napping(payload: dict[str, Any]) -> list[dict[str, Any]]:
    """Take some time, and tell who did; what it prints must not reach the terminal."""
    time.sleep(0.03)
    print("printed by a worker", flush=True)
    return [{"key": key, "pid": os.getpid()} for key, *_ in payload["points"]]


def failing(payload: dict[str, Any]) -> list[dict[str, Any]]:
    """Raise what `evaluate` never would."""
    raise ZeroDivisionError(f"in {len(payload['points'])} points")
