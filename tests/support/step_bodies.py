"""STEP files written and read, and a plate for them."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app

PLATE = np.array([*product((-20.0, 20.0), (-20.0, 20.0), (0.0, 10.0))])
SIDES = [(0, 2, 6, 4), (1, 5, 7, 3), (0, 4, 5, 1), (2, 3, 7, 6), (0, 1, 3, 2), (4, 6, 7, 5)]


def run(*arguments: object) -> Any:
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def read(folder: Path, text: str, **more: Any) -> fo.Body:
    path = folder / "part.step"
    path.write_text(text)
    return fo.Body.from_file(path, unit=more.pop("unit", "mm"), **more)
