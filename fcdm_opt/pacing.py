"""Long work: what it is at, how far it has come, and until when it may go on.

Whoever works says `at(...)` where something begins that may take long, and asks in its loops: `over()` where it has
something to keep, `check()` where it has nothing yet. Whoever shows progress listens, whoever has little time says
`within(...)`. Both are known to the context that they are set in, so nothing is handed down.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from time import perf_counter
from typing import Any, NamedTuple, TypeVar

from fcdm_opt.errors import FcdmError, InputError, internal

_spared = [0.0]


def clock() -> float:
    """Return the time that limits count, in seconds: all but that of compiling, which is done once and kept."""
    return perf_counter() - _spared[0]


def exclude_time(seconds: float) -> None:
    """Do not count so many seconds that went by."""
    _spared[0] += seconds


SEARCHED = 0.85  # share of the time given that searching may take: what was found is still to be judged and shown
JUDGED = 1.1  # the same of searching and judging
ADVISED = 4.0, 10.0  # seconds, at least and at most, for all that is asked only to advise where there is no motion


class TimeOverError(FcdmError):
    """Raised where the time given is over and nothing is there yet to go on with."""

    def __init__(self, text: str = "") -> None:  # the text of one that another process raised
        self.limit, doing = _limit.get().seconds, _doing.get()
        self.why = f"the {'usual ' * _limit.get().usual}time limit of {self.limit:g} s was met"
        super().__init__(text or f"{self.why}{f' while {doing}' if doing else ''}")


def failure(reason: Exception) -> tuple[str, InputError]:
    """Return why a case has no answer, "late", "input" or "internal", and what is to be said of it."""
    if isinstance(reason, TimeOverError):
        return "late", InputError(f"left out: {reason}; allow more time").with_traceback(reason.__traceback__)
    met = internal(reason)
    return "input" if met is reason else "internal", met


class _Given(NamedTuple):
    """Until when may be searched, of how many seconds that is a share, and until when what was found may be judged.

    `kept`: what is done has something to keep, and is not to be ended by `check`. `usual`: nobody gave it.
    """

    end: float
    seconds: float
    last: float
    kept: bool = False
    usual: bool = False


Found = TypeVar("Found")
Other = TypeVar("Other")
Listener = Callable[[str, int, int], None]
"""Takes what is being done, how many of its pieces are done, and how many there are; 0 where nobody knows."""

_limit: ContextVar[_Given] = ContextVar("limit", default=_Given(math.inf, math.inf, math.inf))  # noqa: B039 (immutable)
_looks: ContextVar[list[float]] = ContextVar("looks", default=[math.inf])  # noqa: B039 (counted down where it is set)
_doing: ContextVar[str] = ContextVar("doing", default="")
_on: ContextVar[str] = ContextVar("on", default="")
_whole: ContextVar[str] = ContextVar("whole", default="")
_listeners: list[Listener] = []  # of the process: work may go on in several threads


def at(text: str, done: int = 0, total: int = 0) -> None:
    """Say what is done from here on, in words that may follow "still", and how far it is where that is known."""
    text = ": ".join(filter(None, (_whole.get(), text)))
    if not over():  # then it stays what the time was over at
        _doing.set(text)
    on = _on.get()
    for listener in _listeners:
        listener(f"{text} ({on})" if on else text, done, total)


class _Override:
    """A context in which a variable has another value."""

    __slots__ = ("_token", "_value", "_variable")

    def __init__(self, variable: ContextVar[Any], value: Any) -> None:
        self._variable, self._value = variable, value

    def __enter__(self) -> None:
        self._token = self._variable.set(self._value)

    def __exit__(self, *_: object) -> None:
        self._variable.reset(self._token)


def working_on(what: str) -> _Override:
    """Put this before whatever is said to be done meanwhile."""
    return _Override(_on, what)


def part_of(whole: str) -> _Override:
    """Say of whatever is said to be done meanwhile that it is a piece of this: "mapping: judging the motion found"."""
    return _Override(_whole, whole)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Tell somebody meanwhile what is being done."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)


def unheard() -> None:
    """Tell nobody any more: those who listen do so in the process that this one is a copy of."""
    _listeners.clear()


def has_listeners() -> bool:
    """Whether anybody listens."""
    return bool(_listeners)


def check_time(seconds: float | None, key: str) -> None:
    """Refuse what is no time limit; None is none."""
    real = isinstance(seconds, int | float) and not isinstance(seconds, bool)
    if seconds is not None and not (real and seconds > 0.0):
        raise InputError("not a time", key=key, found=seconds, allowed="a number of seconds > 0")


def within(seconds: float | None, share: float = SEARCHED) -> _Override:
    """Let what is done meanwhile search no longer than a share of so many seconds; None, or what is longer: as it is.

    Raises `InputError` for what is no time.
    """
    return _Override(_limit, _limit_within(seconds, share, "time"))


def begin(seconds: float | None, *, share: float = SEARCHED, key: str = "time", usual: bool = False) -> None:
    """Set such a limit from here to the end of the enclosing one; a `usual` one is told to be that."""
    _limit.set(_limit_within(seconds, share, key)._replace(usual=usual))


def _limit_within(seconds: float | None, share: float, key: str) -> _Given:
    check_time(seconds, key)
    known = _limit.get()
    if seconds is None:
        return known
    now = clock()
    last = min(known.last, now + max(share, JUDGED) * seconds)
    return min(known, _Given(now + share * seconds, seconds, last))._replace(last=last, kept=False)


def sharing(share: float) -> _Override:
    """Let what is done meanwhile take this share of the time that is left."""
    now, known = clock(), _limit.get()
    end, last = (now + share * (end - now) for end in (known.end, known.last))
    return _Override(_limit, known._replace(end=end, last=last, kept=False))


def judging() -> _Override:
    """Let what is done meanwhile take what is left of the time given and a little more: what was found is judged."""
    known = _limit.get()
    return _Override(_limit, known._replace(end=known.last))


def telling() -> _Override:
    """Let what was found be told meanwhile whatever the time is: `check` passes, `over` leaves out what may be."""
    known = _limit.get()
    return _Override(_limit, known._replace(end=known.last, kept=True))


def in_time(work: Callable[..., Found], *arguments: Any, late: Other) -> Found | Other:
    """Return what work finds; `late` where the time is over by then, even while what was found is told."""
    with _Override(_limit, _limit.get()._replace(kept=False)):
        try:
            check()
            return work(*arguments)
        except TimeOverError:
            return late


def looking(count: int) -> _Override:
    """Let what is done meanwhile ask so often whether the time is over, and then it is: alike on any machine."""
    return _Override(_looks, [float(count)])


def unlimited() -> _Override:
    """Take as long as it takes meanwhile: for what is short, and is to be done whenever there is an answer."""
    return _Override(_limit, _Given(math.inf, math.inf, math.inf))


def remaining() -> float:
    """Return the seconds that are left, infinitely many where no limit is set."""
    end = _limit.get().end
    return end - clock() if end < math.inf else math.inf


def given() -> float:
    """Return the seconds that the limit was given as, infinitely many where none is set."""
    return _limit.get().seconds


def limited() -> bool:
    """Tell whether a time is given."""
    return _limit.get().end < math.inf


def over() -> bool:
    """Tell whether the time given is over."""
    end, looks = _limit.get().end, _looks.get()
    looks[0] -= 1.0
    return looks[0] < 0.0 or (end < math.inf and clock() >= end)


def stopped() -> str:
    """Return in words at what the time given was over; nothing where it is not."""
    return str(TimeOverError()) if over() else ""


def check() -> None:
    """Raise `TimeOverError` where the time given is over."""
    if over() and not _limit.get().kept:
        raise TimeOverError
