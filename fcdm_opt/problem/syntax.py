"""Reading TOML, and what is wrong with a text that is none, in words: a key given twice, a decimal comma."""

from __future__ import annotations

import re
import tomllib
from typing import Any

_PLACE = re.compile(r"\(at line (\d+), column (\d+)\)")
_END = "(at end of document)"
_KEY = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")
_TABLE = re.compile(r"\[.*\]\s*(#.*)?$")  # at the very left: further right it is a line of a list
_COMMA = re.compile(r"(?<![\w.,])[+-]?\d+,\d+(?![\w.])")
_SEVERAL = re.compile(r"Cannot declare \('(case|contact|keep_out|part|size|vary)',\) twice")
_TWICE = ("Cannot overwrite a value", "Cannot mutate immutable namespace")

LEVELS = 64  # of a dotted key: far more than any key has; the parser's time grows with their square, to minutes
_TEXTS = re.compile(r'''"""(?:\\.|[^\\])*?"""|\'{3}.*?\'{3}|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+'|(#[^\n]*+)''', re.DOTALL)
_DEEP = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{LEVELS}}}")


def parsed(text: str) -> dict[str, Any]:
    """Return the contents of a TOML text; raises as `tomllib.loads`, and `ValueError` for a key of too many levels."""
    deep = _DEEP.search(_TEXTS.sub(lambda found: "" if found[1] else "x" + "\n" * found[0].count("\n"), text))
    if deep is not None:
        line = deep.string.count("\n", 0, deep.start()) + 1
        raise ValueError(f"a key of more than {LEVELS} levels (at line {line})")
    return tomllib.loads(text)


def mistake(text: str, reason: tomllib.TOMLDecodeError) -> str:
    """Return what is wrong with a text that cannot be read as TOML, and where; as `tomllib` says it, if that tells."""
    said = str(reason)
    lines = text.replace("\r\n", "\n").split("\n")
    place = _PLACE.search(said)
    if table := _SEVERAL.search(said):
        return f"{said}: each {table[1]} begins with [[{table[1]}]], in two brackets"
    if place is None and _END not in said:
        return said
    number, column = (int(place[1]), int(place[2])) if place else (len(lines), 1)
    if said.startswith(_TWICE):
        return _twice(lines, number) or said
    line = lines[number - 1]
    for comma in _COMMA.finditer(line) if place else ():
        if comma.start() < column and not line[comma.end() : column - 1].strip():
            meant = comma[0].replace(",", ".")
            return f"{comma[0]} is written {meant}, with a decimal point, not a comma {place[0] if place else ''}"
    return said


def _twice(lines: list[str], number: int) -> str:
    """Return that a key is given twice in one table, "" where no such key is seen; the second ends in that line."""
    found: list[tuple[str, int]] = []
    for k in range(number, 0, -1):
        key = _KEY.match(lines[k - 1])
        if key is not None:
            found.append((re.sub(r"\s*\.\s*", ".", key[1]), k))
            if len(found) > 1 and found[-1][0] == found[0][0]:
                name, second = found[0]
                return f"{name} is given twice: line {second}, and before in line {k}; put a # before one of them"
        elif found and _TABLE.match(lines[k - 1]):
            break
    return ""
