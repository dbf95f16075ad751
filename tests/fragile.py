"""Work that loses its worker; a file of its own, as workers import it and nothing else."""

from __future__ import annotations

import os
import re
import signal
from pathlib import Path

from fcdm_opt.design.study.point import Payload, Row, row, within


def fragile(payload: Payload) -> list[Row]:
    """Answer points, but for those that end the process, each in its way."""
    found = []
    for key, _, case in payload["points"]:
        if case.get("name") == "segfault":
            os.kill(os.getpid(), signal.SIGSEGV)
        if case.get("name") == "exit":
            os._exit(0)
        if case.get("name") == "once" and not Path(case["file"]).exists():
            Path(case["file"]).touch()
            os._exit(1)
        if case.get("name") == "endless":
            with within(payload["time_limit"]):
                re.match("(a+)+$", "a" * 60 + "b")  # compiled code that no signal reaches
        os.write(2, b"noise of a library\n")
        found.append({**row(key, "SOLVED"), "process": os.getpid()})
    return found


def nothing(limited: bool) -> None:
    """Load nothing."""
