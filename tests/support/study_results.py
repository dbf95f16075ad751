"""Results of a study without any solve."""

from __future__ import annotations

from typing import Any

from fcdm_opt.design.study.point import row
from fcdm_opt.design.study.results import StudyResult

TAUS = [0.01, 0.02, 0.03, 0.04]


def result(cases: list[str], *, title: str = "a study", pending: int = 0, **own: Any) -> StudyResult:
    """Amounts 10 k + 100 tau for case k; the last tolerance of the last case has no motion."""
    answers, points = {}, []
    for k, name in enumerate(cases):
        for tau in TAUS:
            key = f"{k} {tau}"
            amount = 10.0 * k + 100.0 * tau
            lost = k == len(cases) - 1 and tau == TAUS[-1]
            answers[key] = (
                row(key, "INFEASIBLE", "Proved impossible")
                if lost
                else {**row(key, "SOLVED"), "usable": True, "amount": amount, "parameters": {"TZ": -amount}}
            )
            points.append((key, {"case": name, "tolerance": tau}))
    for key, _ in points[len(points) - pending :]:
        answers.pop(key)
    definition = {
        "title": title,
        "note": "one\n\ntwo",
        "axes": {"case": cases, "tolerance": TAUS},
        "labels": ["case", "tolerance"],
        "vary": [{"key": ["tolerance"], "label": "tolerance"}],
        **own,
    }
    return StudyResult(definition=definition, study="5" * 64, version="0.0", points=tuple(points), answers=answers)
