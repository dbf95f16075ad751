"""How numbers, texts and motions are written into a problem file."""

from __future__ import annotations

import json
import math
import shlex
from pathlib import Path
from typing import Any

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.entries import plain_step

LONGEST = 100  # signs of a contact's label: that of a round face names hundreds of vertices


def motion(motion: Motion) -> str:
    """Return a motion as a problem file has it."""
    names = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
    words = []
    for step in motion.steps:
        entry = plain_step(step)
        for key in ("translation", "rotation"):
            if isinstance(entry.get(key), list):
                entry[key] = names.get(tuple(entry[key]), entry[key])
        if "pitch_per_rad" in entry:
            entry["pitch_per_deg"] = float(f"{math.radians(entry.pop('pitch_per_rad')):.12g}")
        words.append("{ " + ", ".join(f"{key} = {toml(value)}" for key, value in entry.items()) + " }")
    return f"[{', '.join(words)}]"


def toml(value: Any) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return f"[{', '.join(map(toml, value))}]" if isinstance(value, list | tuple) else repr(value)


def point(point: Array, digits: int = 9) -> str:
    """Return a point, or a scale pair, as TOML has it, in so many digits."""
    return toml([float(f"{x:.{digits}g}") + 0.0 for x in point.tolist()])


def table(motion: Motion, length: str, angle: str) -> str:
    """Return a table with an entry for each parameter of a motion."""
    entries = [(f"{name}_deg", angle) if kind == "rotation" else (name, length) for name, kind in motion.parameters]
    return "{ " + ", ".join(f"{name} = {value}" for name, value in entries) + " }"


def sizes(pair: Array) -> str:
    """Return a scale pair to be read."""
    return ", ".join(f"{x:.6g}" for x in pair.tolist())


def quoted(path: str | Path) -> str:
    """Return a path as a shell takes it: in quotes where needed, and never for an option."""
    text = str(path)
    return shlex.quote(f"./{text}" if text.startswith("-") else text)


def short(label: str) -> str:
    """Return a contact's label, its middle left out where it is very long."""
    half = LONGEST // 2
    return label if len(label) <= LONGEST else f"{label[:half]} ... {label[-half:]}"


def shown(text: str) -> str:
    """Return a text for a comment: in one line, without control characters."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)
