"""Whether two convex parts with moved faces share a point, proved in rationals; and how our rows fare against it.

`python -m fcdm_opt_benchmarks.references.sizes 100000` compares the sign of the gap over sizes with it, on random hulls
and offsets by which edges and corners change.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from fractions import Fraction
from itertools import combinations
from typing import Any

import numpy as np

DEEP = 1e-7  # a point so far inside all faces is inside in rationals too
SHARE = 0.25  # of a hull's size by which its faces are moved at most


def planes(vertices: Any) -> list[tuple[tuple[Fraction, ...], Fraction, float]]:
    """Return the facets of a hull of points: rational normal and level, and the normal's length."""
    from scipy.spatial import ConvexHull

    points = [tuple(map(Fraction, row)) for row in np.asarray(vertices, float).tolist()]
    hull = ConvexHull(vertices)
    found: list[tuple[tuple[Fraction, ...], Fraction, float]] = []
    for (i, j, k), outward in zip(hull.simplices.tolist(), hull.equations[:, :3], strict=True):
        u, v = ([y - x for x, y in zip(points[i], points[m], strict=True)] for m in (j, k))
        n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        if float(sum(float(x) * y for x, y in zip(n, outward, strict=True))) < 0:
            n = (-n[0], -n[1], -n[2])
        level = sum((x * y for x, y in zip(n, points[i], strict=True)), Fraction(0))
        found.append((n, level, float(np.sqrt(float(sum(x * x for x in n))))))
    return found


def meet(rows: list[tuple[tuple[Fraction, ...], Fraction]]) -> bool | None:
    """Tell whether half-spaces n . x <= level share a point, with a proof in rationals; None without one."""
    from scipy.optimize import linprog

    A = np.array([[float(x) for x in n] for n, _ in rows])
    b = np.array([float(level) for _, level in rows])
    lengths = np.linalg.norm(A, axis=1)
    answer = linprog(
        [0.0, 0.0, 0.0, -1.0],
        np.column_stack([A / lengths[:, None], np.ones(len(rows))]),
        b / lengths,
        bounds=[(None, None)] * 3 + [(None, 1.0)],
    )
    point = tuple(map(Fraction, answer.x[:3].tolist()))
    if all(sum((x * y for x, y in zip(n, point, strict=True)), Fraction(0)) <= level for n, level in rows):
        return True
    held = np.argsort(answer.ineqlin.marginals)[:4].tolist()
    for count in (4, 3, 2):
        for chosen in combinations(held, count):
            weights = _kernel([rows[k][0] for k in chosen])
            if weights and sum((w * rows[k][1] for w, k in zip(weights, chosen, strict=True)), Fraction(0)) < 0:
                return False
    return None


def _kernel(normals: list[tuple[Fraction, ...]]) -> list[Fraction]:
    """Return weights > 0 with which the normals add up to zero; none where there are no unique ones."""
    count = len(normals)
    table = [[n[k] for n in normals] for k in range(3)]
    pivots: list[int] = []
    row = 0
    for column in range(count):
        pivot = next((r for r in range(row, 3) if table[r][column] != 0), None)
        if pivot is None:
            continue
        table[row], table[pivot] = table[pivot], table[row]
        table[row] = [x / table[row][column] for x in table[row]]
        for r in range(3):
            if r != row and table[r][column] != 0:
                table[r] = [x - table[r][column] * y for x, y in zip(table[r], table[row], strict=True)]
        pivots.append(column)
        row += 1
        if row == 3:
            break
    free = [column for column in range(count) if column not in pivots]
    if len(free) != 1:
        return []
    weights = [Fraction(0)] * count
    weights[free[0]] = Fraction(1)
    for r, column in enumerate(pivots):
        weights[column] = -table[r][free[0]]
    return weights if all(w > 0 for w in weights) else []


def cases(count: int, seed: int = 1, each: int = 20) -> Iterator[tuple[float, bool | None]]:
    """Yield the gap that our rows give at random offsets of random hulls, and whether the hulls then share a point."""
    import fcdm_opt as fo

    rng = np.random.default_rng(seed)
    done = 0
    while done < count:
        bodies, exact = [], []
        for k in range(2):
            points = rng.normal(size=(rng.integers(4, 9), 3)) + k * rng.normal(size=3)
            bodies.append(fo.Body.convex(points))
            exact.append(planes(points))
        sizes = [
            fo.Size(f"{role} {k}", role, faces=f"F{k + 1}", tolerance=SHARE)
            for role, body in zip(("movable", "static"), bodies, strict=True)
            for k in range(len(body.faces))
        ]
        problem = fo.Problem(*bodies, sizes=sizes, motion=fo.Translation("x"), goal="touch")
        try:
            stack = fo.stack_up(problem)
        except fo.InputError:  # within these tolerances nothing may be left of a thin hull
            continue
        matched = [_matched(body, own) for body, own in zip(bodies, exact, strict=True)]
        for p in rng.uniform(-SHARE, SHARE, (min(each, count - done), len(sizes))):
            values, rows = p.tolist(), []
            for own, order in zip(exact, matched, strict=True):
                for (n, level, length), k in zip(own, order, strict=True):
                    rows.append((n, level + Fraction(values[k]) * Fraction(length)))
                values = values[len(own) :]
            done += 1
            yield float(stack.gap(p)), meet(rows)


def _matched(body: Any, exact: list[tuple[tuple[Fraction, ...], Fraction, float]]) -> list[int]:
    """Return which face of the body each facet is: by the corners that lie on it."""
    found = []
    for n, level, _ in exact:
        on = [
            k + 1
            for k, v in enumerate(body.vertices.tolist())
            if sum((x * Fraction(y) for x, y in zip(n, v, strict=True)), Fraction(0)) == level
        ]
        found.append(body.faces.index(tuple(on)))
    return found


def main() -> None:
    """Compare as many signs as asked for, and print what came of it."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    wrong = unproved = touching = 0
    for gap, together in cases(count):
        unproved += together is None
        touching += together is True
        wrong += together is not None and (gap <= 0.0) != together
    print(f"{count} pairs of sizes: {touching} touch, {wrong} wrong signs, {unproved} without a proof in rationals")
    raise SystemExit(wrong > 0)


if __name__ == "__main__":
    main()
