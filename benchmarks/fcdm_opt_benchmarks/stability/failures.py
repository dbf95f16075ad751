"""Saved failures: one file holds a case, its truth and what one method said, and can be asked again.

The file is one JSON object: `case` (family, name, question, data, truth), `module`, `method`, `answer` and `verdict`
(outcome, error, reason), `seconds`. Numbers read back to the last digit; those that JSON does not have are the strings
"inf", "-inf" and "nan".
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from fcdm_opt.errors import InputError
from fcdm_opt_benchmarks.record import json_of
from fcdm_opt_benchmarks.stability.case import Grade, HardCase
from fcdm_opt_benchmarks.stability.run import LIMITS, MODULES, NOT_RUN, Result, asked_alone

FOLDER = "failures"
LONGEST_NAME = 100  # characters of a file's name, before what makes it unique
SHOWN = 2000  # characters of a text that replay shows
NON_FINITE = {"inf": math.inf, "-inf": -math.inf, "nan": math.nan}


@dataclass(frozen=True)
class Replay:
    """A failure asked again: what came then, and what comes now."""

    then: Result
    now: Result

    @property
    def text(self) -> str:
        """Input, truth, and both answers, to be read."""
        case = self.now.case
        lines = [
            f"{case.question}: {case.family}: {case.name}",
            f"method: {self.now.method}" + (" (ours)" if self.now.ours else ""),
            "input:",
            *(f"  {key}: {_shown(value)}" for key, value in case.data.items()),
            "truth:",
            *(f"  {key}: {_shown(value)}" for key, value in case.truth.items()),
        ]
        for when, result in (("then", self.then), ("now", self.now)):
            row = result.row
            off = "" if row["error"] is None else f", relative error {row['error']:.3g}"
            why = f": {row['reason']}" if row["reason"] else ""
            lines += [f"{when}: {row['outcome']}{off}{why}", f"  answer: {_shown(result.answer)}"]
        return "\n".join(lines)


def file_name(result: Result) -> str:
    """Return the name of a result's file: readable, safe on every system, unique, and the same from run to run."""
    own = (result.case.question, result.case.family, result.case.name, result.method)
    readable = "--".join(re.sub(r"[^a-z0-9]+", "-", text.lower()).strip("-") for text in own)[:LONGEST_NAME]
    return f"{readable}-{sha256(json.dumps(own).encode()).hexdigest()[:8]}.json"


def save(results: Iterable[Result], out: Path) -> list[Path]:
    """Write every result that is not right, one file each; those that were not run have nothing to show.

    Parameters
    ----------
    results : iterable of Result
    out : path
        They go to its folder `failures`, made where it is missing; files of an earlier run there are removed.

    Returns
    -------
    list of Path
    """
    folder = out / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*-" + 8 * "[0-9a-f]" + ".json"):
        old.unlink()
    files = []
    for result in results:
        if result.outcome in ("right", NOT_RUN):
            continue
        data = {
            "case": asdict(result.case),
            "module": result.module,
            "method": result.method,
            "answer": result.answer,
            "verdict": asdict(result.verdict) if result.verdict else None,
            "seconds": result.seconds,
        }
        path = folder / file_name(result)
        path.write_text(json.dumps(_encoded(data), allow_nan=False) + "\n", encoding="utf-8")
        files.append(path)
    return files


def replay(path: Path, *, limit: float = LIMITS[False], modules: Sequence[str] = MODULES) -> Replay:
    """Ask the method of a saved failure the same case again, alone.

    Parameters
    ----------
    path : path
        A file that `save` wrote.
    limit : float
        Seconds.
    modules : sequence of str
        Modules of cases that files may name.

    Raises
    ------
    InputError
        For a file that is none.
    """
    then = _read(path, modules)
    now = asked_alone(then.module, then.method, then.case, limit=limit)
    return Replay(then, now)


def _read(path: Path, modules: Sequence[str]) -> Result:
    from importlib import import_module

    data = json_of(path)
    try:
        case, verdict = HardCase(**data["case"]), Grade(**data["verdict"])
        case = replace(case, data=_decoded(case.data), truth=_decoded(case.truth))
        verdict = replace(verdict, error=_decoded(verdict.error))
        module, method, seconds = (data[key] for key in ("module", "method", "seconds"))
        answer = _decoded(data["answer"])
    except (KeyError, TypeError, RecursionError) as reason:
        raise InputError(f"not a saved failure: {type(reason).__name__} {reason}", file=path) from reason
    words = {"case.family": case.family, "case.name": case.name, "case.question": case.question, "method": method}
    words |= {"module": module, "verdict.outcome": verdict.outcome, "verdict.reason": verdict.reason}
    objects = {"case.data": case.data, "case.truth": case.truth}
    numbers = {"seconds": seconds} | ({} if verdict.error is None else {"verdict.error": verdict.error})
    for kind, values in ((str, words), (dict, objects), (int | float, numbers)):
        for key, value in values.items():
            if not isinstance(value, kind):
                raise InputError("of a wrong kind", file=path, key=key, found=value, allowed=_KINDS[kind])
    if module not in modules:
        raise InputError("unknown module", file=path, key="module", found=module, allowed=", ".join(modules))
    home = import_module(module)
    if method not in home.METHODS:
        raise InputError("unknown method", file=path, key="method", found=method, allowed=", ".join(home.METHODS))
    return Result(case, module, method, method in home.OURS, verdict, answer, seconds)


_KINDS: dict[Any, str] = {str: "a text", dict: "an object", int | float: "a number"}


def _encoded(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, dict):
        return {key: _encoded(own) for key, own in value.items()}
    return [_encoded(own) for own in value] if isinstance(value, list | tuple) else value


def _decoded(value: Any) -> Any:
    if isinstance(value, str):
        return NON_FINITE.get(value, value)
    if isinstance(value, dict):
        return {key: _decoded(own) for key, own in value.items()}
    return [_decoded(own) for own in value] if isinstance(value, list) else value


def _shown(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]} ... ({len(text)} characters in all)"
