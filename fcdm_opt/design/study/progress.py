"""How far a run is: a bar on a terminal, a line now and then elsewhere."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from time import monotonic

PAUSE = 10.0
"""Seconds between two lines."""

SETTLED = 1.0
"""Seconds after which a rate says something."""

REFRESH = 4  # times a second that a bar is drawn

Say = Callable[[str], None]


@dataclass
class Pace:
    """Of `total` points, how many are `done`, how many of these this run `made`, how fast, and when it will end."""

    total: int
    done: int = 0
    made: int = 0
    _start: float = field(default_factory=monotonic)

    def __str__(self) -> str:
        seconds, before = monotonic() - self._start, self.done - self.made
        words = [f"{self.done:,} of {self.total:,} points" + (f" ({before:,} from before)" if before else "")]
        if self.made and seconds > SETTLED:
            words.append(f"{self.made / seconds:.3g} a second")
            if self.done < self.total:
                words.append(f"{_duration((self.total - self.done) * seconds / self.made)} left")
        return ", ".join(words)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


@contextmanager
def shown(total: int, *, progress: bool, say: Say | None) -> Iterator[Callable[[int, int], None]]:
    """Show how far a run is: a bar on a terminal; elsewhere a line now and then, and at the end, however that comes.

    Gives what is to be told `done` and `made`, see `Pace`. Without `say` lines go to standard error if `progress`,
    else nowhere.
    """
    pace = Pace(total)
    if progress and sys.stderr is not None and sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

        columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.description}"))
        with Progress(*columns, console=Console(stderr=True), refresh_per_second=REFRESH) as bar:
            task = bar.add_task(str(pace), total=total)

            def draw(done: int, made: int) -> None:
                pace.done, pace.made = done, made
                bar.update(task, completed=done, description=str(pace))

            yield draw
        return
    if say is None:
        say = partial(print, file=sys.stderr, flush=True) if progress else lambda text: None
    last = monotonic()

    def tell(done: int, made: int) -> None:
        nonlocal last
        pace.done, pace.made = done, made
        if monotonic() - last >= PAUSE:
            last = monotonic()
            say(str(pace))

    try:
        yield tell
    finally:
        say(str(pace))
