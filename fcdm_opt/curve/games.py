# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Compiled: matrix games, by which mixtures of rows prove bounds."""

from __future__ import annotations

import numpy as np

from fcdm_opt.compiling import kernel, light

ROUNDING = 64.0 * 2.0**-53  # of entries, relative to their spread: they take a few operations


@light
@kernel
def game(W):
    """Return shares of the rows, >= 0, together 1, whose mixture has the largest least entry, by the simplex method."""
    # entries are shifted to lie above 0; then the shares are the multipliers of max sum y, W y <= 1, y >= 0. Stopped
    # early they are still shares: whoever uses them looks at the mixture itself
    m, n = W.shape
    low, high = W.min(), W.max()
    spread = high - low
    shares = np.zeros(m)
    if m == 1 or not 0.0 < spread < np.inf:
        shares[0] = 1.0
        return shares
    table, basis = np.zeros((m + 1, n + m + 1)), np.empty(m, np.int64)
    for k in range(m):
        for c in range(n):
            table[k, c] = (W[k, c] - low) / spread + 1.0
        table[k, n + k], table[k, n + m], basis[k] = 1.0, 1.0, n + k
    table[m, :n] = -1.0
    for turn in range(8 * (m + n)):
        column, steepest = -1, -ROUNDING
        for c in range(n + m):
            if table[m, c] < steepest:
                column, steepest = c, table[m, c]
                if turn > 2 * (m + n):
                    break  # the first one: then nothing goes round in circles
        if column < 0:
            break
        row, ratio = -1, np.inf
        for k in range(m):
            if table[k, column] > ROUNDING and table[k, n + m] / table[k, column] < ratio:
                row, ratio = k, table[k, n + m] / table[k, column]
        if row < 0:
            break
        table[row] /= table[row, column]
        for k in range(m + 1):
            if k != row and table[k, column] != 0.0:
                table[k] -= table[k, column] * table[row]
        basis[row] = column
    for k in range(m):
        shares[k] = max(table[m, n + k], 0.0)
    total = shares.sum()
    if not 0.0 < total < np.inf:
        shares[:] = 0.0
        shares[0] = 1.0
        return shares
    return shares / total
