"""Families of motion problems from the data set: unions, curved meshes, sizes of faces, several contacts at once."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

from fcdm_opt_benchmarks.library import dataset_script
from fcdm_opt_benchmarks.stability.motion_bodies import Family, Truth
from fcdm_opt_benchmarks.stability.scenes import Plain

EXACT = 1e-9  # relative: proved intervals that are wider do not tell what is right to a millionth


@cache
def scenes() -> list[Any]:
    """Return the scenes of the data set that ask for a motion and whose answer is known well enough."""
    path = Path(dataset_script("answer_fcdm_opt").__file__).with_name("scenes.json")
    every = json.loads(path.read_text(encoding="utf-8"))["scenes"]
    return [own for own in every if own["question"]["goal"] != "scale" and _known(own["answer"])]


def _known(answer: Plain) -> bool:
    return "none" in answer or math.isclose(answer["lower"], answer["amount"], rel_tol=EXACT)


def members(belongs: Callable[[set[str]], bool], rng: Any) -> Iterator[tuple[str, Plain, Truth]]:
    """Yield the scenes whose tags belong to a family, as problem files ask them."""
    for own in scenes():
        if own["class"] == "drawn" and belongs(set(own["tags"])):
            asked = tomllib.loads(dataset_script("answer_fcdm_opt").problem(own))
            yield own["name"], asked, own["answer"].get("amount")


def _family(belongs: Callable[[set[str]], bool]) -> Family:
    return partial(members, belongs), "the data set: exact shifts, closed forms"


OF_DATASET: dict[str, Family] = {
    "several contacts at once": _family(lambda tags: "contacts" in tags),
    "sizes of faces": _family(lambda tags: "sizes" in tags),
    "curved meshes": _family(lambda tags: bool(tags & {"curved", "mesh"})),
    "unions as drawn": _family(lambda tags: "union" in tags and not tags & {"contacts", "sizes", "curved", "mesh"}),
}
