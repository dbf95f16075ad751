"""How numbers, texts and motions are written into a problem file."""

from __future__ import annotations

import json
import shlex
from pathlib import Path

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.motion.motions import Motion
from fcdm_opt.problem.entries import STEPS

WIDTH = 110
FILTERS = ("motion", "pairs", "point", "scales", "short", "shown", "sizes", "text")  # of the template
LONGEST = 100  # signs of a contact's label: that of a round face names hundreds of vertices


def motion(motion: Motion) -> str:
    """Return a motion as a problem file has it."""
    steps = [STEPS[type(step)].plain(step) for step in motion.steps]
    names = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
    words = []
    for step in steps:
        for key in ("translation", "rotation"):
            if isinstance(step.get(key), list):
                step[key] = names.get(tuple(step[key]), step[key])
        words.append("{ " + ", ".join(f"{key} = {value(own)}" for key, own in step.items()) + " }")
    return f"[{', '.join(words)}]"


def value(value: object) -> str:
    """Return a value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    return text(value) if isinstance(value, str) else f"[{', '.join(map(repr, value))}]"  # type: ignore[call-overload]


def axis(axis: str | tuple[float, ...]) -> str:
    """Return an axis as a problem file has it."""
    return text(axis) if isinstance(axis, str) else f"[{', '.join(map(repr, axis))}]"


def pairs(box: tuple[tuple[float, float], tuple[float, float]]) -> str:
    """Return a box as TOML has it."""
    return f"[{', '.join(f'[{low!r}, {high!r}]' for low, high in box)}]"


def point(point: Array, digits: int = 9) -> str:
    """Return a point as TOML has it, in so many digits."""
    return f"[{', '.join(repr(float(f'{x:.{digits}g}') + 0.0) for x in point.tolist())}]"


def scales(pair: Array) -> str:
    """Return a scale pair as TOML has it."""
    return f"[{', '.join(f'{x:.12g}' if x != int(x) else f'{x:.1f}' for x in pair.tolist())}]"


def table(motion: Motion, length: str, angle: str) -> str:
    """Return a table with an entry for each parameter of a motion."""
    entries = (f"{own}_deg = {angle}" if kind == "rotation" else f"{own} = {length}" for own, kind in motion.parameters)
    return f"{{ {', '.join(entries)} }}"


def sizes(pair: Array) -> str:
    """Return a scale pair to be read."""
    return ", ".join(f"{x:.6g}" for x in pair.tolist())


def about(length: float) -> float:
    """Return a length with one digit."""
    return float(f"{length:.1g}")


def text(text: str) -> str:
    """Return a text as TOML has it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


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
