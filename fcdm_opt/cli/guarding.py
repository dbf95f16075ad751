"""How a command may end: exit codes, and one line on stderr for whatever stops it.

Nobody sees a traceback who did not ask for it with `--debug`.
"""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from types import FrameType
from typing import Any

import typer

from fcdm_opt import pacing
from fcdm_opt.errors import InputError, internal

SOLVED, NO_MOTION, BAD_INPUT, NOT_VERIFIED, INTERNAL = 0, 1, 2, 3, 4
INTERRUPTED, BROKEN_PIPE = 130, 141  # as a shell reports a program that a signal ended
EXIT_CODES = (
    (SOLVED, "all well"),
    (NO_MOTION, "a case without a motion to use"),
    (BAD_INPUT, "bad input, or a file that cannot be read or written"),
    (NOT_VERIFIED, "a motion that was not verified"),
    (INTERNAL, "a defect of fcdm-opt"),
    (INTERRUPTED, "interrupted"),
)
SCHEMA = 1  # of the JSON documents; another one where a key changes its meaning or goes
SCENE = "bodies", "keep_out", "size"  # of a problem: what several cases share
GRACE, PATIENCE = 0.7, 10.0  # seconds after which a run ends that an interrupt does not get through to; with processes
ending = threading.Event()
"""Set by a run that heard an interrupt and writes what it has: that takes less than `PATIENCE`."""

BEGUN_BY_OTHERS = ("importlib", "_frozen_importlib", "numba", "llvmlite", "casadi", "coal")
"""Modules in whose midst an interrupt ends the run at once: their code is not made to be left there."""


@dataclass(frozen=True)
class Manner:
    """How a run speaks: with tracebacks or without, in JSON or in text, and for which command."""

    debug: bool = False
    as_json: bool = False
    command: str = ""


manner: ContextVar[Manner] = ContextVar("manner", default=Manner())  # noqa: B039 (frozen)


def say(text: str) -> None:
    """Write a line to stderr; one that nobody can read any more is no reason to stop."""
    with suppress(OSError):
        typer.echo(text, err=True)


def document(contents: Mapping[str, Any]) -> str:
    """Return the JSON document of a command: which schema it has, and the version that wrote it, come first."""
    from fcdm_opt.plain import finite
    from fcdm_opt.version import __version__

    scenes: dict[str, dict[str, Any]] = {}
    data = _with_scenes(finite(contents), scenes)
    schema = " ".join(filter(None, ("fcdm_opt", manner.get().command, str(SCHEMA))))
    head: dict[str, Any] = {"schema": schema, "version": __version__}
    head |= {"scenes": [*scenes.values()]} if scenes else {}
    return json.dumps({**head, **data}, indent=2, allow_nan=False)


def _with_scenes(given: Any, scenes: dict[str, dict[str, Any]]) -> Any:
    """Return plain data in which problems name their bodies by the number of a scene, each of which is there once."""
    if isinstance(given, list):
        return [_with_scenes(item, scenes) for item in given]
    if not isinstance(given, dict):
        return given
    if not {"bodies", "case"} <= given.keys():
        return {key: _with_scenes(item, scenes) for key, item in given.items()}
    scene = {key: given[key] for key in SCENE if key in given}
    number = list(scenes).index(key) if (key := json.dumps(scene)) in scenes else len(scenes)
    scenes[key] = scene
    return {"scene": number, **{key: item for key, item in given.items() if key not in SCENE}}


def refuse(reason: Exception, text: str | None = None) -> str:
    """Say in one line why something is refused, and return what was said."""
    shown = " ".join(str(reason if text is None else text).split("\n"))
    if manner.get().debug:
        say("".join(traceback.format_exception(reason)).rstrip())
    pacing.at("")  # nothing is being done any more
    say(f"error: {shown}")
    return shown


def stopped(reason: Exception, text: str | None = None, *, code: int = BAD_INPUT) -> typer.Exit:
    """Say why the whole command is refused, as JSON too where that is asked for; return what ends it."""
    error = refuse(reason, text)
    if manner.get().as_json:
        try:
            typer.echo(document({"error": error}))
            sys.stdout.flush()
        except OSError:  # a full disk may be the very reason
            _silence()
    return typer.Exit(code)


@contextmanager
def guarded() -> Iterator[None]:
    """Turn whatever ends a command into a line on stderr and an exit code."""
    try:
        try:
            with _interruptible():
                yield
        finally:
            if sys.stdout is not None:
                sys.stdout.flush()  # here a broken pipe is still ours to meet
    except InputError as reason:
        raise stopped(reason) from reason
    except pacing.TimeOverError as reason:
        raise stopped(reason, code=NO_MOTION) from reason
    except KeyboardInterrupt as reason:
        say("interrupted")
        raise typer.Exit(INTERRUPTED) from reason
    except SystemExit as reason:
        if isinstance(reason.__context__, BrokenPipeError):  # rich met it first
            raise _unheard() from reason
        raise
    except BrokenPipeError as reason:
        raise _unheard() from reason
    except OSError as reason:
        place = f"{reason.filename}: " if reason.filename else ""
        raise stopped(reason, f"{place}{reason.strerror or reason}") from reason
    except Exception as reason:
        if isinstance(reason, typer.Abort):  # the command line's own
            raise
        raise stopped(internal(reason), code=INTERNAL) from reason


@contextmanager
def _interruptible() -> Iterator[None]:
    """See to it that an interrupt ends the run, even inside a library that returns to Python after minutes only."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    ended = threading.Event()
    ending.clear()

    def watch() -> None:
        while not ended.is_set():
            numbers = os.read(reader, 64)  # written by the signal itself, before Python handles it
            if signal.SIGINT not in numbers or ended.wait(PATIENCE if multiprocessing.active_children() else GRACE):
                continue
            if not (ending.is_set() and ended.wait(PATIENCE)):
                _end()

    watcher = threading.Thread(target=watch, daemon=True)
    before, handler = signal.set_wakeup_fd(writer, warn_on_full_buffer=False), signal.getsignal(signal.SIGINT)
    if handler is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupted)
    watcher.start()
    try:
        yield
    finally:
        ended.set()
        signal.signal(signal.SIGINT, handler)
        signal.set_wakeup_fd(before)
        with suppress(BlockingIOError):  # full: then there is what to read
            os.write(writer, b"\0")  # its end is not told while a process that was begun has a copy
        os.close(writer)
        watcher.join()
        os.close(reader)


def _interrupted(number: int, frame: FrameType | None) -> None:
    """Leave the run where Python can be left; inside other libraries, which may crash or go on, end it."""
    while frame is not None:
        if str(frame.f_globals.get("__name__", "")).partition(".")[0] in BEGUN_BY_OTHERS:
            _end()
        frame = frame.f_back
    raise KeyboardInterrupt


def _end() -> None:
    say("interrupted")
    os._exit(INTERRUPTED)


def _unheard() -> typer.Exit:
    """Return how a command ends whose output nobody reads."""
    _silence()
    return typer.Exit(BROKEN_PIPE)


def _silence() -> None:
    """Send nowhere what is still to be written to stdout."""
    with suppress(OSError, ValueError, AttributeError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
