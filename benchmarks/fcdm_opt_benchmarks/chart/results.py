"""What a run of `fcdm-opt bench` writes: one JSON file, one page of tables, and the pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fcdm_opt.show import save
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.chart.bench import TASKS, ahead
from fcdm_opt_benchmarks.chart.figures import COLOURS, TASK_WORDS, chart_figure, overview_figure, panels_of, strongest
from fcdm_opt_benchmarks.cost.growth import exponents
from fcdm_opt_benchmarks.cost.growth_picture import growth_figure
from fcdm_opt_benchmarks.cost.models_picture import models_figure
from fcdm_opt_benchmarks.record import BenchRun, Row, table

SHOWN = ("speed-accuracy", "growth", "models")
"""Pictures for a README: written small too."""

REACHED = 1e-6
"""Relative: a motion this much larger than the least has reached its amount."""


def write(run: BenchRun, folder: Path) -> list[Path]:
    """Write bench.json, bench.md and the pictures of what was measured; return the files."""
    run.write(folder / "bench.json")
    (folder / "bench.md").write_text(text(run) + "\n", encoding="utf-8")
    made = [folder / "bench.json", folder / "bench.md"]
    rows = run.tables["chart"]
    figures = {task: chart_figure(run, task) for task in TASKS if any(row["task"] == task for row in rows)}
    if figures:
        figures = {"speed-accuracy": overview_figure(run), **figures}
    if run.tables["growth"]:
        figures["growth"] = growth_figure(run)
    if run.tables["models"]:
        figures["models"] = models_figure(run)
    for name, figure in figures.items():
        made += save(figure, folder / name, small=name in SHOWN)
    return made


def text(run: BenchRun) -> str:
    """Tell a run in Markdown."""
    parts = ["# Speed against accuracy", run.about, summary(run)]
    if run.tables["chart"]:
        parts += ["## Panels", _panels(run)]
    for task, title in TASKS.items():
        rows = [row for row in run.tables["chart"] if row["task"] == task]
        if rows:
            parts += [f"## {title.capitalize()}", _methods(rows), _each(rows)]
    if run.tables["growth"]:
        parts += ["## Growth of time", _growth(run)]
    if run.tables["models"]:
        parts += ["## What the models cost", _models(run.tables["models"])]
    return "\n\n".join(parts)


def summary(run: BenchRun, *, most: int | None = None) -> str:
    """Say whether our curves are right, and where a rival is as fast and as accurate, in `most` scenes each."""
    lines = []
    for task in TASKS:
        rows = [row for row in run.tables["chart"] if row["task"] == task]
        if not rows:
            continue
        title = TASKS[task].capitalize()
        if all(row["family"] == "ours" for row in rows):
            lines.append(f"- {title}: no rival was asked.")
        elif task == "motion":
            lines += _losses(
                rows, ahead(rows, task, REACHED), most, f"{title}: {{}} reaches our amount faster, not verified"
            )
            judged = ahead(rows, task, REACHED, judged=True)
            lines += _losses(rows, judged, most, f"{title}: {{}} reaches our amount faster, verified by the same judge")
        else:
            lines += _losses(rows, ahead(rows, task), most, f"{title}: {{}} is as fast and as accurate as we are")
        lines += [
            f"  - REFERENCE WRONG in {row['scene']}: {row['method']} ({row['setting']}) has a smaller verified motion."
            for row in rows
            if row.get("below")
        ]
        lines += _added(rows, title)
        ours = [row for row in rows if row["family"] == "ours"]
        lines += [
            f"  - ours ({row['method']}, {row['setting']}) failed in {row['scene']}: {row['failed']} of "
            f"{row['asked']}, {row['misnamed']} misnamed; {row['reason']}."
            for row in ours
            if row["outcome"] not in ("answered", "not asked") or row.get("misnamed")
        ]
    faults = run.tables["faults"]
    checked = run.settings.get("curves_compared")
    if checked:
        word = "none differs" if not faults else f"{len(faults)} DIFFER"
        lines.append(f"- {checked} decision curves of the batch compared with exact ones, feature by feature: {word}.")
        lines += [f"  - {fault}" for fault in faults[:20]]
    return "\n".join(lines)


def _added(rows: Sequence[Row], title: str) -> list[str]:
    """Return a line for each rival that was added to those known: in how many scenes it is right, and how fast."""
    lines, scenes, ours = list[str](), {row["scene"] for row in rows}, _own(rows)
    for method in dict.fromkeys(row["method"] for row in rows if row["family"] not in COLOURS):
        found = _best(rows, method, REACHED)
        within = f"within {REACHED:g} in {len(found)} of {len(scenes)} scenes"
        shared = [found[scene][0] / ours[scene][0] for scene in found if scene in ours]
        times = f": {_medians(found)}, {np.median(shared):.2g} times our time" if shared else ""
        lines.append(f"- {title}: {method} (added) is {within}{times}.")
    return lines


def _panels(run: BenchRun) -> str:
    """Return a line a panel: ours, and the strongest rival that reaches our accuracy, with the ratio of their times.

    The ratio is the median over the scenes that both answer: a rival may leave the hard ones out.
    """
    lines = []
    for task, kind, rows in panels_of(run):
        enough = REACHED if task == "motion" else DEFAULT.nominal
        ours = _own(rows)
        scenes = {row["scene"] for row in rows}
        line = [TASK_WORDS[task], kind, str(len(scenes)), "", "none", "", ""]
        if ours:
            line[3] = _medians(ours)
            rivals = ((method, _best(rows, method, enough)) for method in strongest(rows))
            method, rival = next(((name, found) for name, found in rivals if found), ("", {}))
            shared = [ours[scene][0] / rival[scene][0] for scene in rival if scene in ours]
            if shared:
                line[4:] = [f"{method}, {_medians(rival)}", f"{len(rival)} of {len(scenes)}",
                            f"{np.median(shared):.2g}"]  # fmt: skip
        lines.append(line)
    head = [
        "task",
        "scenes of",
        "number",
        "ours: median, error",
        "strongest rival as accurate",
        "answered",
        "ours / rival there",
    ]
    return table(head, lines, left=2)


Best = dict[str, tuple[float, float]]


def _own(rows: Sequence[Row]) -> Best:
    """Return the seconds and errors of that of our methods which answers most scenes, the fastest of these."""
    own = dict.fromkeys(row["method"] for row in rows if row["family"] == "ours")
    found = [_best(rows, method, math.inf) for method in own]
    return min(filter(None, found), key=lambda best: (-len(best), np.median([x for x, _ in best.values()])), default={})


def _best(rows: Sequence[Row], method: str, most: float) -> Best:
    """Return seconds and error of a method's fastest setting within an error, in each scene where there is one."""
    found: Best = {}
    right = [row for row in rows if row["method"] == method and row["outcome"] == "answered" and row["error"] <= most]
    for row in sorted(right, key=lambda row: -row["seconds"]):
        found[row["scene"]] = row["seconds"], row["error"]
    return found


def _medians(best: Best) -> str:
    seconds, error = np.median(np.array(list(best.values())), axis=0).tolist()
    return f"{seconds:.2g} s, {error:.1g}"


def _losses(rows: Sequence[Row], found: Sequence[Row], most: int | None, sentence: str) -> list[str]:
    """Say in how many scenes a rival is ahead, and which one is most so in each."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    lost = {scene: rivals for scene in scenes if (rivals := [row for row in found if row["scene"] == scene])}
    where = f", in {len(lost)} of {len(scenes)} scenes:" if lost else "."
    lines = [f"- {sentence.format('a rival' if lost else 'no rival')}{where}"]
    for scene, rivals in list(lost.items())[:most]:
        best = min(rivals, key=lambda row: row["seconds"])
        lines.append(
            f"  - {scene}: {best['method']} ({best['setting']}), {best['seconds']:.2g} s, error {best['error']:.1g}; "
            f"{best['ratio']:.2g} times as fast as ours ({best['beaten']})"
        )
    if most is not None and len(lost) > most:
        lines.append(f"  - and {len(lost) - most} more, see bench.md")
    return lines


def _methods(rows: Sequence[Row]) -> str:
    """Return medians over the scenes, one line a method and setting."""
    lines = []
    for method, setting in dict.fromkeys((row["method"], row["setting"]) for row in rows):
        mine = [row for row in rows if (row["method"], row["setting"]) == (method, setting)]
        asked = [row for row in mine if row["outcome"] != "not asked"]
        if not asked:
            lines.append([method, setting, "not asked", *[""] * 6, mine[0]["reason"]])
            continue
        errors = [row["error"] for row in asked if row.get("error") is not None]
        times = np.percentile([row["seconds"] for row in asked], (50, 25, 75))
        failed, count = sum(row["failed"] for row in asked), sum(row["asked"] for row in asked)
        reasons = [row["reason"] for row in asked if row["failed"] and row["reason"]]
        setup = np.median([row["setup"] + row["late_setup"] for row in asked])
        lines.append(
            [
                *(method, setting, f"{len(asked)} of {len(mine)}"),
                *(f"{x:.3g}" for x in times),
                f"{setup:.3g}",
                f"{np.median(errors):.2g}" if errors else "",
                f"{max(row['worst'] for row in asked if row.get('worst') is not None):.2g}" if errors else "",
                f"{failed} of {count}" + (f": {reasons[0][:80]}" if reasons else ""),
            ]
        )
    head = ["method", "setting", "scenes", "median s", "quartile s", "quartile s", "set-up s"]
    return table([*head, "median error", "worst error", "failed"], lines, left=2)


def _each(rows: Sequence[Row]) -> str:
    """Return each method's fastest setting that is right to 1e-9 in a scene, or with none its most accurate one."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    lines = []
    for method in methods:
        line = [method]
        for scene in scenes:
            mine = [row for row in rows if (row["method"], row["scene"]) == (method, scene)]
            good = [row for row in mine if row["outcome"] == "answered"]
            near = [row for row in good if row["error"] <= DEFAULT.nominal]
            best = (
                min(near, key=lambda row: row["seconds"])
                if near
                else min(good, key=lambda row: row["error"], default=None)
            )
            word = "not asked" if all(row["outcome"] == "not asked" for row in mine) else "failed"
            line.append(word if best is None else f"{best['seconds']:.2g} s, {best['error']:.1g}")
        lines.append(line)
    said = "Time and median error, of each method's fastest setting within 1e-9, or else its most accurate one:"
    return f"{said}\n\n{table(['', *scenes], lines)}"


def _growth(run: BenchRun) -> str:
    rows = run.tables["growth"]
    fits = [
        [
            *(own["axis"], own["method"], f"{own['exponent']:.2f} +- {own['error']:.2f}"),
            f"{own['from']:g} to {own['to']:g}",
        ]
        for own in exponents(rows)
    ]
    each = [
        [
            row["axis"],
            f"{row['x']:g}",
            row["method"],
            f"{row['seconds']:.3g}",
            f"{row['low']:.3g}",
            f"{row['high']:.3g}",
        ]
        for row in rows
        if row.get("seconds") is not None
    ]
    return "\n\n".join([
        table(["time grows with", "method", "exponent", "fitted over"], fits, left=2),
        table(["axis", "number", "method", "median s", "quartile s", "quartile s"], each),
    ])  # fmt: skip


def _models(rows: Sequence[Row]) -> str:
    lines = []
    for row in rows:
        counts = [f"{row[kept]} of {row[total]}" if row.get(kept) is not None else ""
                  for kept, total in (("part_pairs", "part_pairs_total"), ("features", "features_total"))]  # fmt: skip
        numbers = ["" if row.get(key) is None else f"{row[key]:.6g}" for key in ("variables", "constraints")]
        time, amount = ("" if row.get(key) is None else f"{row[key]:.6g}" for key in ("seconds", "amount"))
        said = row.get("reason") or ("verified" if row.get("verified") else "not verified")
        lines.append([row["scene"], row["model"], row.get("stage") or "", *numbers, *counts, time, amount, said])
    head = ["scene", "model", "stage used", "variables", "constraints", "part pairs", "features", "s", "amount", ""]
    return table(head, lines, left=3)
