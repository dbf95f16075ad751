"""Which part pairs of two unions matter in a cell of scale pairs, compiled: see `pruning`.

A cell is (low, high) of rho_1, then of rho_2. Parts' vertices are from their seeds, those of all parts of a body one
after the other with the first place of each and the number of all.
"""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, light, step


@light
@kernel
def pair_depths(lines, firsts, lasts, codes, cell, slack):
    """Return how deep pairs overlap at least in a cell, (k,); -inf where a line keeps them more than `slack` apart."""
    # lines (a, b, c) of pair p are those from `firsts[p]` to `lasts[p]`
    x, y, u, v = _middle(cell)
    depths = np.empty(len(codes))
    for k in range(len(codes)):
        deepest, least = np.inf, np.inf
        for m in range(firsts[codes[k]], lasts[codes[k]]):
            a, b = lines[m, 0], lines[m, 1]
            level, spread = a * x + b * y - lines[m, 2], np.abs(a) * u + np.abs(b) * v
            deepest, least = min(deepest, level + spread), min(least, level - spread)
        depths[k] = -np.inf if deepest < -slack else least
    return depths


@light
@kernel
def pairs_further(rows, R, vertices1, starts1, vertices2, starts2, codes, own, cell, slack, line):
    """Tell which pairs are further on than one along a row of it that crosses a cell, and which end with it, (2, k).

    Parameters: rows (n, a, b, c) of the pair's region; the rotation of body 1; of either body its vertices and where
    each part's begin; pairs i n_2 + j; the place of the one among them; by how much a pair is further on, `line`.
    """
    x0, x1, y0, y1 = cell[0], cell[1], cell[2], cell[3]
    n1, n2 = len(starts1) - 1, len(starts2) - 1
    told = np.zeros((2, len(codes)), np.bool_)
    here, there = np.empty(n1), np.empty(n2)
    for m in range(len(rows)):
        a, b = rows[m, 3], rows[m, 4]
        if min(a * x0, a * x1) + min(b * y0, b * y1) - rows[m, 5] > slack:
            continue
        n = rows[m, 0], rows[m, 1], rows[m, 2]
        back = (
            n[0] * R[0, 0] + n[1] * R[1, 0] + n[2] * R[2, 0],
            n[0] * R[0, 1] + n[1] * R[1, 1] + n[2] * R[2, 1],
            n[0] * R[0, 2] + n[1] * R[1, 2] + n[2] * R[2, 2],
        )
        for i in range(n1):
            here[i] = _highest_of(vertices1, starts1[i], starts1[i + 1], back)
        for j in range(n2):
            there[j] = _highest_of(vertices2, starts2[j], starts2[j + 1], (-n[0], -n[1], -n[2]))
        one, two = here[codes[own] // n2], there[codes[own] % n2]
        for k in range(len(codes)):
            p, q = here[codes[k] // n2] - one, there[codes[k] % n2] - two
            most = max(p * x0, p * x1) + max(q * y0, q * y1)
            told[0, k] |= most > line
            told[1, k] |= most > -slack
    for k in range(len(codes)):
        told[1, k] &= not told[0, k]
    return told


@step
def _middle(cell):
    """Return the middle of a cell and half its extents."""
    x0, x1, y0, y1 = cell[0], cell[1], cell[2], cell[3]
    return 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0), 0.5 * (y1 - y0)


@step
def _highest_of(vertices, first, last, n):
    """Return the largest product of n with some vertices."""
    height = -np.inf
    for k in range(first, last):
        height = max(height, vertices[k, 0] * n[0] + vertices[k, 1] * n[1] + vertices[k, 2] * n[2])
    return height
