"""Pairs a second: what a compensation table answers, and a yield counted on it, beside scipy on the same nodes.

    python benchmarks/bench_yield.py [--out DIR] [--seed 3] [--cells 32] [--pairs 1000000] [--rounds 9]

The table has two triangles a cell over [0.98, 1.02]^2, of an amount with a kink on the diagonal, as between the regions
of a map, and two parameters. All contenders get the same nodes and pairs, and run in turns, warm; a rival that takes
longer than a second runs once. "Error": largest over all pairs, relative to the largest amount. Yields include drawing
the sizes, quantiles, both contributions and the yields without either body's tolerance: four look-ups a pair.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import CloughTocher2DInterpolator, LinearNDInterpolator

from fcdm_opt.design.compensation.assembly_yield import assembly_yield
from fcdm_opt.design.compensation.table import Table
from fcdm_opt.design.distributions import Measured, Normal, Uniform
from fcdm_opt.geometry.arrays import Array
from fcdm_opt_benchmarks.record import Row, table
from fcdm_opt_benchmarks.scripts import describe, in_turns, parser, written

LOW, HIGH = 0.98, 1.02
PATIENCE = 1.0  # seconds beyond which a contender runs once
BLOCK = 2**14  # pairs handed over at once in the rows "in blocks": what they give stays in the caches
TARGET = 1e6  # pairs a second


def motion(x: Array, y: Array) -> Array:
    """Return amount and two parameters, (..., 3)."""
    u, v = 50.0 * (x - 1.0), 50.0 * (y - 1.0)
    return np.stack([np.abs(u - v) * (1.0 + 0.3 * u * v) + 0.2 * np.exp(u), np.sin(u), np.cos(v)], axis=-1)


def table_of(cells: int) -> Table:
    """Return the table, two triangles a cell."""
    ends = np.linspace(LOW, HIGH, cells + 1)
    x, y = (corner.ravel() for corner in np.meshgrid(ends[:-1], ends[:-1], indexing="ij"))
    right, upper = (corner.ravel() for corner in np.meshgrid(ends[1:], ends[1:], indexing="ij"))
    a, b, c, d = (np.column_stack(corner) for corner in ((x, y), (right, y), (right, upper), (x, upper)))
    corners = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    nodes = np.concatenate([corners, (corners + np.roll(corners, -1, axis=1)) / 2.0], axis=1)
    return Table(
        corners=corners,
        values=motion(nodes[..., 0], nodes[..., 1]),
        errors=np.zeros((len(corners), 2)),
        regions=np.repeat([0, 1], len(a)),
        names=("TX", "TY"),
    )


def in_blocks(look_up: Callable[[Array, Array], Any], pairs: Array) -> None:
    """Look pairs up block by block, keeping nothing."""
    for start in range(0, pairs.shape[1], BLOCK):
        look_up(*pairs[:, start : start + BLOCK])


def rows(cells: int, count: int, seed: int, rounds: int) -> list[Row]:
    """Time all contenders in turns: pairs a second, median and best; their error where they interpolate."""
    own = table_of(cells)
    nodes = np.concatenate([own.corners, (own.corners + np.roll(own.corners, -1, axis=1)) / 2.0], axis=1)
    points, first = np.unique(nodes.reshape(-1, 2), axis=0, return_index=True)
    values = own.values.reshape(-1, 3)[first]
    pairs = np.random.default_rng(seed).uniform(LOW, HIGH, (2, count))
    along = pairs[:, np.lexsort(pairs[::-1])]
    truth = motion(*pairs)[..., 0]
    error = {"Table.at": np.abs(own.at(*pairs).amount - truth).max()}
    uniform, normal = Uniform(LOW, HIGH), Normal(1.0, 0.01, LOW, HIGH)
    measured = Measured(np.random.default_rng(seed).uniform(LOW, HIGH, 1000))
    contenders: dict[str, Callable[[], Any]] = {
        "Table.at": lambda: own.at(*pairs),
        "Table.at, sorted pairs": lambda: own.at(*along),
        "Table.at, in blocks": lambda: in_blocks(own.at, pairs),
        "Table.at, sorted, in blocks": lambda: in_blocks(own.at, along),
    }
    for sizes in (uniform, normal, measured):
        contenders[f"assembly_yield, {type(sizes).__name__} sizes"] = partial(
            assembly_yield, own, sizes=(sizes, sizes), budget=1.0, count=count, seed=seed
        )
    for rival in (LinearNDInterpolator, CloughTocher2DInterpolator):
        made = rival(points, values)
        contenders[f"scipy {rival.__name__}"] = partial(made, *pairs)
        error[f"scipy {rival.__name__}"] = np.abs(made(*pairs)[..., 0] - truth).max()
    largest = np.abs(truth).max()
    return [
        {"name": name, "median": count / np.median(taken), "best": count / min(taken),
         "error": error[name] / largest if name in error else None}
        for name, taken in in_turns(contenders, rounds, PATIENCE).items()
    ]  # fmt: skip


def text(found: list[Row], cells: int, count: int) -> str:
    """Return the table, in Markdown."""
    lines = []
    for row in found:
        error = "" if row["error"] is None else f"{row['error']:.1e}"
        lines.append([row["name"], f"{row['median'] / 1e6:.2f}", f"{row['best'] / 1e6:.2f}", error])
    slowest = min(row["median"] for row in found if row["name"].startswith("assembly_yield"))
    about = f"{2 * cells**2} triangles, {count} pairs; million pairs a second."
    asked = f"Asked of a yield: {TARGET:g} pairs a second: {'met' if slowest >= TARGET else 'NOT met'}."
    return "\n\n".join([about, table(["", "median", "best", "error"], lines), asked, describe()])


def main(arguments: list[str] | None = None) -> int:
    """Run the benchmark from the command line."""
    options = parser(__doc__, "out/benchmarks", rounds=9)
    options.add_argument("--cells", type=int, default=32, help="along each side of the box (%(default)s)")
    options.add_argument("--pairs", type=int, default=1_000_000)
    given = options.parse_args(arguments)
    found = rows(given.cells, given.pairs, given.seed, given.rounds)
    told = text(found, given.cells, given.pairs)
    written(told, given.out, "yield", **(vars(given) | {"out": None}), rows=found)
    return 0


if __name__ == "__main__":
    sys.exit(main())
