"""A place in plain tables: `limits.RZ_deg`, `target[1]`, `made."peg width"`, `bodies.movable.vertices[5][3]`.

Items count from 1. A key that has more than letters may stand in quotes, and must where it has a point or a bracket.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Mapping
from functools import lru_cache
from typing import Any

from fcdm_opt.errors import InputError, closest

Place = tuple[str | int, ...]  # keys of tables, and rows of lists from 0
_BARE = r"""[^.\[\]\s"']+(?: [^.\[\]\s"']+)*+"""
_PART = rf"""("[^"]+"|'[^']+'|{_BARE})((?:\[[1-9][0-9]{{0,8}}\])*)"""
_SPELLED = re.compile(rf"{_PART}(?:\.{_PART})*")
LONGEST, DEEPEST = 300, 20  # characters, and keys and items below each other: more than any problem has


@lru_cache(maxsize=1024)
def parse(text: str) -> Place:
    """Return the place that a text names; raises `InputError` where it names none."""
    if not isinstance(text, str) or len(text) > LONGEST or not _SPELLED.fullmatch(text):
        allowed = 'keys with points between and items counted from 1: "limits.RZ_deg", "target[1]"'
        raise InputError("not a place in a problem", found=text, allowed=allowed)
    place: list[str | int] = []
    for key, rows in re.findall(_PART, text):
        place += [key.strip("\"'"), *(int(row) - 1 for row in re.findall("[0-9]+", rows))]
    if len(place) > DEEPEST:
        raise InputError("no problem is that deep", found=text, allowed=f"{DEEPEST} keys and items below each other")
    return tuple(place)


def written(place: Iterable[str | int]) -> str:
    """Return a place as text."""
    keys = (f"[{item + 1}]" if isinstance(item, int) else f".{_key(item)}" for item in place)
    return "".join(keys).removeprefix(".")


def _key(text: str) -> str:
    if re.fullmatch(rf"{_BARE}|'[^']+'", text):  # as it may stand, or in quotes already
        return text
    return f"'{text}'" if '"' in text else f'"{text}"'


def put(
    tables: Any,
    place: Place,
    value: Any,
    *,
    dropped: Callable[[str], Iterable[str]] = lambda key: (),
    kept: Container[Place] = (),
) -> Any:
    """Return a copy of tables with a value at a place; what lies beside the place is shared, not copied.

    Tables on the way that are not there are made, items of lists are not; the value None takes the key away. `dropped`
    tells which keys of the same table each key of the place excludes, and `kept` are places that are not dropped for
    all that. Raises `InputError` that names the place where the way to it ends.
    """

    def changed(tables: Any, k: int) -> Any:
        item, last = place[k], k + 1 == len(place)
        check_item(tables, place, k)
        if isinstance(item, int):
            rows = list(tables)
            rows[item] = value if last else changed(rows[item], k + 1)
            return rows
        excluded = {key for key in dropped(item) if (*place[:k], key) not in kept}
        table = {key: inner for key, inner in tables.items() if key not in excluded}
        if not last:
            if item not in table and isinstance(place[k + 1], int):
                key, what = written(place[: k + 1]), "an item of it is asked for, and the problem does not give it"
                known = ", ".join(map(str, tables)) or "nothing"
                allowed = f'{known}; or the whole value, with "{key}" as the key'
                raise InputError(f"{what}{closest(str(item), tables)}", key=key, allowed=allowed)
            table[item] = changed(table.get(item, {}), k + 1)
        elif value is None:
            table.pop(item, None)
        else:
            table[item] = value
        return table

    return changed(tables, 0)


def overlap(one: Place, two: Place) -> bool:
    """Tell whether one place lies inside the other, or is the same."""
    shorter = min(len(one), len(two))
    return one[:shorter] == two[:shorter]


def check_item(value: Any, place: Place, k: int) -> None:
    """Refuse the k-th item of a place where the value that stands before it cannot have it."""
    item = place[k]
    if isinstance(item, str):
        if not isinstance(value, Mapping):
            allowed = "a table: name = value in braces, in the case or as a value of its own"
            raise InputError("there is no table here", key=written(place[:k]), found=value, allowed=allowed)
    elif not isinstance(value, list | tuple):
        raise InputError("there is no list here", key=written(place[:k]), found=value, allowed="a place without [..]")
    elif item >= len(value):
        raise InputError("no such item", key=written(place[: k + 1]), allowed=f"1 to {len(value)}")
