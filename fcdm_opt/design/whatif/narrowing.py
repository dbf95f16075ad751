"""Narrows in where something ends to hold."""

from __future__ import annotations

from collections.abc import Callable, Iterable

Guesses = Callable[[float, float], Iterable[float]]


def narrowed(
    holds: Callable[[float], bool],
    low: float,
    high: float,
    done: Callable[[float, float], bool],
    guesses: Guesses = lambda low, high: (),
) -> tuple[float, float]:
    """Return a narrower bracket of a place where something ends to hold, by guesses and a bisection in turns.

    Parameters
    ----------
    holds : callable
        Whether it holds at a place.
    low, high : float
        Where it is known to hold, and not to.
    done : callable
        Whether a bracket is narrow enough.
    guesses : callable
        Places worth a look in a bracket; those outside it are passed over.
    """
    while not done(low, high):
        for guess in (*guesses(low, high), None):
            place = (low + high) / 2.0 if guess is None else guess
            if low < place < high and not done(low, high):
                low, high = (place, high) if holds(place) else (low, place)
    return low, high
