"""Problem files: TOML with the bodies and one or several cases."""

from __future__ import annotations

import os
from pathlib import Path

from fcdm_opt.problem.keys import ProblemFile
from fcdm_opt.problem.problem import Problem


def load_problems(path: str | os.PathLike[str]) -> tuple[Problem, ...]:
    """Return the problems of a file, one for each case.

    Parameters
    ----------
    path : path
        A problem file (TOML).

    Raises
    ------
    InputError
        Names the file, the key, what was found and what is allowed; the first thing that is wrong.
    """
    return ProblemFile.read(path).problems(Problem, Path(path))
