"""What the scripts that answer share: each scene in a process of its own, which is ended when it takes too long."""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

LIMIT = 30.0  # seconds a scene
Answer = dict[str, Any]


def options(what: str, *more: str) -> argparse.Namespace:
    """Return the command line's file for answers, the scenes asked for as `scenes`, and flags."""
    asked = argparse.ArgumentParser(description=what)
    asked.add_argument("out", type=Path)
    asked.add_argument("--scenes", type=Path, default=Path(__file__).with_name("scenes.json"))
    asked.add_argument("--only", default="", help="scenes whose name holds this")
    for flag in more:
        asked.add_argument(flag, action="store_true")
    given = asked.parse_args()
    every = json.loads(given.scenes.read_text("utf-8"))["scenes"]
    given.scenes = [scene for scene in every if given.only in scene["name"]]
    return given


def write(out: Path, tool: str, answers: Mapping[str, Answer]) -> None:
    """Write an answers file."""
    out.write_text(json.dumps({"tool": tool, "answers": answers}, indent=1) + "\n", "utf-8")


def asked_each(answer: Callable[[Mapping[str, Any]], Answer], what: str, tool: str) -> None:
    """Ask about each scene, one after the other, and write what is answered, with the seconds that it took."""
    given, answers = options(what), {}
    context = multiprocessing.get_context("fork")
    for scene in given.scenes:
        here, there = context.Pipe(duplex=False)
        process = context.Process(target=_timed, args=(there, answer, scene))
        process.start()
        there.close()
        try:
            answers[scene["name"]] = (
                here.recv() if here.poll(LIMIT) else _nothing(f"no answer within {LIMIT:g} s", LIMIT)
            )
        except EOFError:
            answers[scene["name"]] = _nothing("the process died")
        process.kill()
        process.join()
    write(given.out, tool, answers)


def _nothing(said: str, seconds: float | None = None) -> Answer:
    return {"claim": "unknown", "said": said, **({} if seconds is None else {"seconds": seconds})}


def _timed(there: Any, answer: Callable[[Mapping[str, Any]], Answer], scene: Mapping[str, Any]) -> None:
    start = time.perf_counter()
    try:
        made = answer(scene)
    except Exception as reason:  # whatever a library raises is an answer too
        made = _nothing(f"{type(reason).__name__}: {reason}"[:300])
    there.send({**made, "seconds": time.perf_counter() - start})
