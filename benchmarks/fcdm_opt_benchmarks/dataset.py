"""The data set that lies beside this package, as problems."""

from __future__ import annotations

import json
import math
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from fcdm_opt_benchmarks.library import dataset_script

EXACT = 1e-9
"""Relative: proved intervals that are wider do not tell what is right to a millionth."""


@cache
def scenes() -> list[dict[str, Any]]:
    """Return the scenes that ask for a motion and whose answer is known to `EXACT`."""
    path = Path(dataset_script("answer_fcdm_opt").__file__).with_name("scenes.json")
    every = json.loads(path.read_text(encoding="utf-8"))["scenes"]
    return [own for own in every if own["question"]["goal"] != "scale" and _known(own["answer"])]


def _known(answer: dict[str, Any]) -> bool:
    return "none" in answer or math.isclose(answer["lower"], answer["amount"], rel_tol=EXACT)


def kind(scene: dict[str, Any]) -> str:
    """Return the class of a scene: of hulls in general position, or of parts as engineers draw them."""
    tags = set(scene["tags"])
    if scene["class"] == "generic":
        return "general position"
    if tags & {"sizes", "contacts"}:
        return "sizes of faces, several contacts"
    return "curved meshes" if tags & {"curved", "mesh"} else "unions as drawn"


def plain_problem(scene: dict[str, Any]) -> dict[str, Any]:
    """Return a scene in the keys of a problem file."""
    return tomllib.loads(dataset_script("answer_fcdm_opt").problem(scene))
