"""Reading TOML, and what is wrong with a text that is none, in words: a key given twice, a decimal comma."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fcdm_opt.errors import InputError

_KEY = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")
_TABLE = re.compile(r"\[.*\]\s*(#.*)?$")  # at the very left: further right it is a line of a list
_COMMA = re.compile(r"(?<![\w.,])[+-]?\d+,\d+(?![\w.])")
_HEAD = re.compile(r"\s*\[\[?\s*([^\]]+?)\s*\]")
TABLES = "case", "contact", "keep_out", "part", "size", "vary"  # of which a file may have several
_TWICE = ("Cannot declare", "Cannot overwrite a value", "Cannot mutate immutable namespace")
_ALLOWED = {
    "Invalid value": '"text" in quotes, a number as 0.5, true, false, [a list] or { KEY = VALUE }',
    "Invalid statement": "KEY = VALUE, [TABLE], [[TABLE]], or a # before what is none",
    "Expected '='": "KEY = VALUE; a key of several words in quotes",
    "Expected newline": "one KEY = VALUE a line, numbers as 0.5, a # before what is none",
    "Expected ']": "[TABLE] or [[TABLE]], a name of several words in quotes",
    "Invalid initial": "a key of letters, digits, - and _, or in quotes; no comma after the last one",
    "Unclosed array": "a comma between two items, ] after the last",
    "Unclosed inline": "a comma between two keys, } after the last, all in one line",
    **dict.fromkeys(
        ("Illegal character '\\n'", "Unterminated", 'Expected "'), "a quote at the end of the text, in its line"
    ),
    **dict.fromkeys(("Unescaped", "Invalid hex"), "\\\\ for each \\, or the text in single quotes"),
}
"""What is allowed in place of what `tomllib` names so."""

LONG = 60  # letters of a line that are shown before a mistake
LEVELS = 64  # of a dotted key: far more than any key has; the parser's time grows with their square, to minutes
_TEXTS = re.compile(r'''"""(?:\\.|[^\\])*?"""|\'{3}.*?\'{3}|"(?:\\.|[^"\\\n])*+"|'[^'\n]*+'|(#[^\n]*+)''', re.DOTALL)
_DEEP = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{LEVELS}}}")


def parsed(text: str) -> dict[str, Any]:
    """Return the contents of a TOML text; raises `InputError` with its line for what is no TOML, or too deep."""
    deep = _DEEP.search(_TEXTS.sub(lambda found: "" if found[1] else "x" + "\n" * found[0].count("\n"), text))
    if deep is not None:
        raise InputError(f"a key of more than {LEVELS} levels", line=deep.string.count("\n", 0, deep.start()) + 1)
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as reason:
        raise _mistake(text, str(reason)) from reason


def contents(path: Path, most: float = math.inf) -> dict[str, Any]:
    """Return the contents of a TOML file; none where it cannot be read, or has more than `most` bytes."""
    try:
        return parsed(path.read_text(encoding="utf-8-sig")) if path.is_file() and path.stat().st_size <= most else {}
    except (OSError, ValueError, RecursionError):
        return {}


def names(data: Mapping[str, Any], kind: str) -> list[str]:
    """Return the names of the tables of a kind, as "case"."""
    tables = data.get(kind, ())
    found = [own.get("name") for own in tables if isinstance(own, dict)] if isinstance(tables, list) else []
    return list(dict.fromkeys(name for name in found if isinstance(name, str)))


def is_assembly(data: Mapping[str, Any]) -> bool:
    """Tell whether the contents of a file are those of an assembly."""
    return "part" in data and "bodies" not in data


def _mistake(text: str, message: str) -> InputError:
    """Return what is wrong with a text that cannot be read as TOML, of which `tomllib` has a message."""
    lines = text.replace("\r\n", "\n").rstrip().split("\n")
    message, _, place = message.partition(" (at ")
    numbers = [int(number) for number in re.findall(r"\d+", place)]
    number, column = numbers if numbers else (len(lines), len(lines[-1]) + 1)  # at the end of the document
    line = lines[min(number, len(lines)) - 1]
    what = message[:1].lower() + message[1:]
    allowed = next((own for key, own in _ALLOWED.items() if message.startswith(key)), "")
    if message.startswith(_TWICE) and (table := _HEAD.match(line)):
        name, what = table[1], f"[{table[1]}] is given twice"
        allowed = f"[[{name}]], in two brackets, before each" if name in TABLES else "all its keys in one table"
    elif message.startswith(_TWICE) and (twice := _twice(lines, number)):
        name, number, before = twice
        line, what, allowed = lines[number - 1], f"{name} is given twice, before in line {before}", "a # before one"
    for comma in _COMMA.finditer(line) if numbers else ():
        if comma.start() < column and not line[comma.end() : column - 1].strip():
            what = f"{comma[0]} is written {comma[0].replace(',', '.')}, with a decimal point, not a comma"
            allowed = ""
    found = line[max(0, column - LONG) :]
    return InputError(f"not valid TOML: {what}", line=number, found=found.strip(), allowed=allowed)


def _twice(lines: list[str], number: int) -> tuple[str, int, int] | None:
    """Return the key given twice in one table, the second time ending in that line, and both lines; None unseen."""
    found: list[tuple[str, int]] = []
    for k in range(number, 0, -1):
        key = _KEY.match(lines[k - 1])
        if key is not None:
            found.append((re.sub(r"\s*\.\s*", ".", key[1]), k))
            if len(found) > 1 and found[-1][0] == found[0][0]:
                name, second = found[0]
                return name, second, k
        elif found and _TABLE.match(lines[k - 1]):
            break
    return None
