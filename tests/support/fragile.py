"""Work that loses its worker; a file of its own, as workers import it and nothing else."""

from __future__ import annotations

import os
import re
import signal
import time
from pathlib import Path

from fcdm_opt.design.study.point import Asked, Row, row


def fragile(asked: Asked) -> Row:
    """Answer a point, unless it ends the process, each in its way."""
    key, _, case, *_ = asked
    if case.get("name") == "segfault":
        os.kill(os.getpid(), signal.SIGSEGV)
    if case.get("name") == "exit":
        os._exit(0)
    if case.get("name") == "once" and not Path(case["file"]).exists():
        Path(case["file"]).touch()
        os._exit(1)
    if case.get("name") == "endless":
        re.match("(a+)+$", "a" * 60 + "b")  # compiled code that no signal reaches
    if case.get("name") == "wrong":
        raise ZeroDivisionError(f"at {key}")
    if case.get("name") == "nap":
        time.sleep(0.03)
    os.write(1, b"printed by a worker\n")
    os.write(2, b"noise of a library\n")
    return {**row(key, "SOLVED"), "process": os.getpid()}


def nothing() -> None:
    """Load nothing."""


def children() -> set[str]:
    """Return the processes that this one has."""
    return {child for task in Path("/proc/self/task").glob("*/children") for child in task.read_text().split()}
