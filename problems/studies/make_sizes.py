"""Makes `peg_sizes.csv`, sizes of 400 pairs of pegs and plates as a gauge might tell them: made, not measured.

Pegs scatter by 0.06 mm about 19.80, hole widths by 0.025 mm about 19.98, rounded to a gauge's micrometre.
"""

from pathlib import Path

import numpy as np

COUNT, SEED = 400, 7
PEG, HOLE = (19.80, 0.06), (19.98, 0.025)  # mean and deviation, mm


def table() -> str:
    """Return the file's text."""
    draw = np.random.default_rng(SEED)
    pegs, holes = (draw.normal(mean, deviation, COUNT) for mean, deviation in (PEG, HOLE))
    rows = [f"{peg:.3f},{hole:.3f}\n" for peg, hole in zip(pegs, holes, strict=True)]
    return "peg_width_mm,hole_width_mm\n" + "".join(rows)


if __name__ == "__main__":
    (Path(__file__).parent / "peg_sizes.csv").write_text(table(), encoding="utf-8")
