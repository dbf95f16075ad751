"""A module of stability cases whose methods fail in every way there is: twice a number is asked."""

from __future__ import annotations

import os
import sys
import time
from typing import Any

from fcdm_opt_benchmarks.stability.case import WRONG_BEYOND, Grade, HardCase

Data = dict[str, Any]
asked: list[float] = []


def cases(quick: bool, seed: int) -> list[HardCase]:
    numbers = {"first": (1.0, 0.1, 1e-300), "second": (5.0,)}
    return [
        HardCase(family, f"twice {x!r}", "doubling", {"x": x}, {"twice": 2 * x, "source": "closed form"})
        for family, own in numbers.items()
        for x in (own[:1] if quick else own)
    ]


def right(data: Data) -> Data:
    return {"twice": 2 * data["x"]}


def hangs(data: Data) -> Data:
    while data["x"] < 5:
        pass
    return right(data)


def waits(data: Data) -> Data:
    """Do nothing beyond the limit, as where other programs have the processor."""
    time.sleep(2.1 if data["x"] < 5 else 0.0)
    return right(data)


def leaves(data: Data) -> Data:
    os._exit(3)


def aborts(data: Data) -> Data:
    os.write(2, b"terminate called\nwhat(): planted\n")
    os.abort()


def prints(data: Data) -> Data:
    print("a banner")
    sys.stdout.flush()
    os.write(1, b'{"answer": {"twice": 0}}\n')
    assert sys.stdin.readline() == ""
    return right(data)


def poisoned(data: Data) -> Data:
    """Die at the second case that one process is asked."""
    asked.append(data["x"])
    if len(asked) > 1:
        os.abort()
    return right(data)


def raises(data: Data) -> Data:
    raise ValueError("singular\nmatrix")


def greedy(data: Data) -> Data:
    return {"twice": len(bytearray(1 << 45))}


def unwell(data: Data) -> Data:
    import a_library_that_nobody_has  # noqa: F401

    return right(data)


METHODS = {
    "right": right,
    "hangs": hangs,
    "waits": waits,
    "leaves": leaves,
    "aborts": aborts,
    "prints": prints,
    "poisoned": poisoned,
    "raises": raises,
    "greedy": greedy,
    "unwell": unwell,
    "nan": lambda data: {"twice": float("nan")},
    "off, by little": lambda data: {"twice": 2 * data["x"] * (1 + 1e-5)},
    "off: by little": lambda data: {"twice": 2 * data["x"] * (1 + 1e-7)},
    "doubts": lambda data: {"twice": 7.0, "flag": "ill-conditioned"},
    "rambles": lambda data: {"thrice": 7.0},
    "unspeakable": lambda data: {"twice": object()},
}
OURS = ("prints", "doubts")


def applies(name: str, case: HardCase) -> bool:
    return name in ("right", "hangs", "poisoned") or case.name in ("twice 1.0", "twice 5.0")


def judged(case: HardCase, answer: Data) -> Grade:
    """A careless judge: nan is not greater than anything."""
    error = abs(answer["twice"] / case.truth["twice"] - 1)
    return Grade("wrong" if error > WRONG_BEYOND else "right", error)
