"""A sign of life on stderr for what takes longer: what it is at, and how far.

Where stderr is a terminal a line at once and then a bar; elsewhere lines after `PATIENCE`, at ever longer intervals.
"""

from __future__ import annotations

import shutil
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from time import perf_counter
from typing import Any

from fcdm_opt import pacing

PATIENCE = 2.0  # seconds after which a command shows a bar, or says elsewhere that it is at work
CLEARED = "\r\x1b[2K"  # what takes such a line away
REFRESH = 0.1  # seconds between two pictures of the bar
QUIET = 0.3  # seconds without output after which the bar is drawn again below it
LATER = 2.0  # how many times as late each further line comes


@contextmanager
def shown() -> Iterator[None]:
    """Show meanwhile what is being done, as `pacing.at` tells it."""
    if sys.stderr is None:
        yield
        return
    sign = _Sign()
    kept, ended = (sys.stdout, sys.stderr), threading.Event()

    def watch() -> None:
        while not ended.wait(REFRESH):
            with suppress(OSError, ValueError):  # nobody can read it any more
                sign.tick()

    watcher = threading.Thread(target=watch, daemon=True)
    if sign.terminal:
        sys.stdout, sys.stderr = (_Above(stream, sign) if stream is not None else stream for stream in kept)
    with pacing.listening(sign.told):
        if sign.terminal:
            sign.tick()
        watcher.start()
        try:
            yield
        finally:
            ended.set()
            watcher.join()
            sign.hide()
            sys.stdout, sys.stderr = kept


class _Sign:
    """What is shown, or was said last."""

    def __init__(self) -> None:
        self.stream: Any = sys.stderr
        self.terminal = bool(self.stream.isatty())
        self._start = self._begun = perf_counter()
        self._written = self._start - QUIET  # nothing is yet
        self._next = 0.0 if self.terminal else PATIENCE
        self._doing: tuple[str, int, int] = ("loading libraries", 0, 0)
        self._first = 0  # how many pieces were done when this began
        self._bar: Any = None
        self._line, self._width = False, shutil.get_terminal_size().columns - 1 + len(CLEARED)
        self._lock = threading.RLock()

    def told(self, text: str, done: int, total: int) -> None:
        """Take note of what is being done."""
        if text != self._doing[0]:
            self._begun, self._first = perf_counter(), done
        self._doing = text, done, total

    def tick(self) -> None:
        """Show how far it is, if it is time to."""
        now = perf_counter()
        if now - self._start < self._next:
            return
        if self.terminal:
            if now - self._written >= QUIET:
                self._draw(now - self._start >= PATIENCE)
            return
        text, done, total = self._doing
        counted = f" ({done} of {total})" if total else ""
        self._next *= LATER
        self.stream.write(f"still {text}{counted}, after {now - self._start:.0f} s\n")
        self.stream.flush()

    def _draw(self, bar: bool) -> None:
        if not bar:  # whose libraries are not loaded yet
            with self._lock:
                self.stream.write(f"{CLEARED}{self._doing[0]}"[: self._width])
                self.stream.flush()
                self._line = True
            return
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn

        with self._lock:
            text, done, total = self._doing
            if self._bar is None:
                columns = SpinnerColumn(), BarColumn(20), TextColumn("{task.description}", markup=False)
                self._bar = Progress(
                    *columns, console=Console(file=self.stream), transient=True, auto_refresh=False,
                    redirect_stdout=False, redirect_stderr=False,
                )  # fmt: skip
                self._bar.add_task(text, total=None)
                self._bar.start()
            self._clear()
            words = f"{text}, {perf_counter() - self._start:.0f} s"
            spent = perf_counter() - self._begun
            if total and done - self._first > 0:
                words += f", about {spent * (total - done) / (done - self._first):.0f} s more"
            self._bar.update(0, description=words, total=total or None, completed=done)
            self._bar.refresh()

    def _clear(self) -> None:
        if self._line:
            self.stream.write(CLEARED)
            self._line = False

    def hide(self) -> None:
        """Take the bar away, for what is printed or because all is done."""
        with self._lock:
            self._written = perf_counter()
            self._clear()
            if self._bar is not None:
                self._bar.stop()
                self._bar = None


class _Above:
    """A stream whose output stands above the bar: it is taken away first, and comes back later."""

    def __init__(self, stream: Any, sign: _Sign) -> None:
        self._stream, self._sign = stream, sign

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write it where no bar is."""
        self._sign.hide()
        return self._stream.write(text)
