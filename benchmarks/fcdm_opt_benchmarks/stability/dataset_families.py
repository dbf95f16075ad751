"""Families of motion problems from the data set: unions, curved meshes, sizes of faces, several contacts at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from fcdm_opt_benchmarks.dataset import plain_problem, scenes
from fcdm_opt_benchmarks.stability.motion_bodies import Family, Truth
from fcdm_opt_benchmarks.stability.scenes import Plain


def members(belongs: Callable[[set[str]], bool], rng: Any) -> Iterator[tuple[str, Plain, Truth]]:
    """Yield the scenes whose tags belong to a family, as problem files ask them."""
    for own in scenes():
        if own["class"] == "drawn" and belongs(set(own["tags"])):
            yield own["name"], plain_problem(own), own["answer"].get("amount")


def _family(belongs: Callable[[set[str]], bool]) -> Family:
    return partial(members, belongs), "the data set: exact shifts, closed forms"


OF_DATASET: dict[str, Family] = {
    "several contacts at once": _family(lambda tags: "contacts" in tags),
    "sizes of faces": _family(lambda tags: "sizes" in tags),
    "curved meshes": _family(lambda tags: bool(tags & {"curved", "mesh"})),
    "unions as drawn": _family(lambda tags: "union" in tags and not tags & {"contacts", "sizes", "curved", "mesh"}),
}
