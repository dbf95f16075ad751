"""What workers of a test's cluster do: in a module of its own, as they import it."""

from __future__ import annotations

import os
import signal
from pathlib import Path

from fcdm_opt.design.study.point import Asked, Row, evaluate


def dying_once(flag: str, asked: Asked) -> Row:
    """Evaluate a point; the first process to come here kills itself once it has, before anybody knows."""
    row = evaluate(asked)
    try:
        Path(flag).unlink()
    except FileNotFoundError:
        return row
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("unreachable")


def dying_at(fatal: frozenset[str], asked: Asked) -> Row:
    """Evaluate a point; those of some keys always kill the process."""
    if asked[0] in fatal:
        os.kill(os.getpid(), signal.SIGKILL)
    return evaluate(asked)


def killing_the_worker(fatal: frozenset[str], asked: Asked) -> Row:
    """Answer a point; those of some keys always kill the process of Dask's own, too."""
    if asked[0] in fatal:
        os.kill(os.getppid(), signal.SIGKILL)
    return evaluate(asked)
