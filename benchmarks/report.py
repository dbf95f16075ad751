"""Results of a benchmark run: table, plot and JSON, with what is needed to repeat it."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from fcdm_opt_benchmarks.record import machine, table, versions


@dataclass(frozen=True)
class Timing:
    """Times of one contender at one size, microseconds a curve (or a coal call); coal's distance timed beside it.

    `ratio` is the median over the rounds of (time in the round / coal's time just before it).
    """

    name: str
    kind: str
    family: str
    vertices: int
    median: float
    least: float
    coal_median: float
    coal_least: float
    ratio: float
    target: float | None

    @classmethod
    def of(
        cls, labels: tuple[str, str, str, int], own: Sequence[float], coal: Sequence[float], target: float | None
    ) -> Timing:
        """From seconds a curve and seconds a call of coal, round by round; labels: the first four attributes."""
        mine, beside = 1e6 * np.array(own), 1e6 * np.array(coal)
        values = np.median(mine), mine.min(), np.median(beside), beside.min(), np.median(mine / beside)
        return cls(*labels, *(float(value) for value in values), target)

    @property
    def ratio_of_least(self) -> float:
        """Least time over coal's least time."""
        return self.least / self.coal_least


@dataclass
class Results:
    """Collects what the benchmarks of one run find."""

    seed: int
    timings: list[Timing] = field(default_factory=list)
    signs: list[dict[str, Any]] = field(default_factory=list)
    segments: dict[str, dict[int, float]] = field(default_factory=dict)
    started: str = field(default_factory=lambda: time.strftime("%Y-%m-%d %H:%M:%S"))

    def text(self) -> str:
        """All tables, in Markdown."""
        parts = []
        if self.timings:
            parts.append(self._timings())
        if self.segments:
            for family, means in self.segments.items():
                counts = ", ".join(f"{vertices}: {count:.1f}" for vertices, count in sorted(means.items()))
                parts.append(f"Mean number of segments in the box, {family} hulls, by vertices: {counts}.")
        parts += [self._growth(family) for family in dict.fromkeys(t.family for t in self.timings)]
        if self.signs:
            parts.append(self._signs())
        return "\n\n".join(parts)

    def _timings(self) -> str:
        rows = []
        for t in sorted(self.timings, key=lambda t: (t.kind != "coal", t.kind != "curve", t.name)):
            asked = "" if t.target is None else f"{t.target:g}: {'met' if t.ratio <= t.target else 'NOT met'}"
            times = [f"{x:.4g}" for x in (t.median, t.least, t.coal_median, t.coal_least, t.ratio, t.ratio_of_least)]
            rows.append([t.name, t.family, str(t.vertices), *times, asked])
        head = ["", "hulls", "vertices", "median us", "least us", "coal median us", "coal least us"]
        return table([*head, "ratio", "ratio of least", "asked"], rows)

    def _growth(self, family: str) -> str:
        """Growth of the time with the number of vertices: the exponent between neighbouring sizes."""
        mine = [t for t in self.timings if t.name == "kernel" and t.family == family]
        found = sorted((t.vertices, t.median) for t in mine)
        steps = [f"{n} to {m}: {np.log(t / s) / np.log(m / n):.2f}" for (n, s), (m, t) in pairwise(found)]
        what = "Exponent of growth of `kernel` with the vertices (1: linear)"
        return f"{what}, {family} hulls: {', '.join(steps) or 'not measured'}."

    def _signs(self) -> str:
        names = list(self.signs[0]["right"])
        rows = [
            [row["pairs"], f"{row['opening']:g}", str(row["cases"])]
            + [f"{100 * row['right'][name] / row['cases']:.4g} %" for name in names]
            for row in self.signs
        ]
        return "Right signs at touch\n\n" + table(["pairs", "relative opening", "cases", *names], rows)

    def write(self, folder: Path) -> None:
        """Write results.json, results.md and time_per_curve.png."""
        folder.mkdir(parents=True, exist_ok=True)
        data = {
            "seed": self.seed,
            "started": self.started,
            "machine": machine(),
            "versions": versions(),
            "timings": [asdict(timing) for timing in self.timings],
            "segments": self.segments,
            "signs": self.signs,
        }
        (folder / "results.json").write_text(json.dumps(data, indent=1) + "\n")
        head = f"Seed {self.seed}, {self.started}. {describe()}"
        (folder / "results.md").write_text(f"{head}\n\n{self.text()}\n")
        if self.timings:
            self._plot(folder / "time_per_curve.png")

    def _plot(self, path: Path) -> None:
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot as plt

        styles = {"coal": (":", "o"), "curve": ("-", "s"), "rival": ("--", "^")}
        figure, axes = plt.subplots(figsize=(9, 6), layout="constrained")
        axes.set_prop_cycle(color=plt.get_cmap("tab20").colors)
        for name, kind, family in dict.fromkeys((t.name, t.kind, t.family) for t in self.timings):
            mine = sorted((t for t in self.timings if (t.name, t.family) == (name, family)), key=lambda t: t.vertices)
            line, marker = styles[kind]
            label = name if family == "round" else f"{name}, {family} hulls"
            axes.loglog([t.vertices for t in mine], [t.median for t in mine], line, marker=marker, ms=4, label=label)
        axes.set(xlabel="vertices of each hull", ylabel="median time per curve (coal: per call), microseconds")
        axes.grid(visible=True, which="major", alpha=0.4)
        axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1, 1))
        figure.savefig(path, dpi=150)
        plt.close(figure)


def describe() -> str:
    """Tell machine and versions in one sentence."""
    own = machine()
    packages = ", ".join(f"{name} {number}" for name, number in versions().items())
    return f"{own['processor']}, {own['cores']} cores, {own['system']}; {packages}."
