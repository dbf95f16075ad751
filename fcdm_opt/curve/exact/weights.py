"""The weights behind a contact: which vertices can carry one, and which do at one scale pair.

Along a piece of the curve, or at a corner of it, the linear program has many solutions. A vertex belongs to the
smallest face that touches there iff some solution puts weight on it (strict complementarity). So solutions that do are
looked for, among the columns that the contact line is tight at.

At a scale pair inside the polygon one solution is enough, a mixture of those at the polygon's vertices. It proves
overlap if its vertices span space, which a few weights of vertices that do are mixed in for.
"""

from __future__ import annotations

from collections.abc import Sequence

from flint import fmpq, fmpz

from fcdm_opt.curve.exact.rationals import ONE, ZERO, Vector, affine_rank, cross, dot, dot4, scaled
from fcdm_opt.curve.exact.shadow import Edge, Shadow, Vertex
from fcdm_opt.curve.exact.simplex import Basis

# ------------------------------------------------------------------------------------------------------ what can touch


def touching_along(edge: Edge) -> set[int]:
    """Return the columns that carry weight in some solution along an edge."""
    return _touching([edge.start.basis, edge.end.basis, edge.basis], edge.tight)


def touching_at_end(edge: Edge) -> set[int]:
    """Return the columns that carry weight in some solution at the vertex in which an edge ends."""
    basis = edge.end.basis
    kind, column = basis.program.kind, basis.program.column
    fixed = [  # columns that leave z as it is
        j
        for j in edge.tight
        if j in basis.basic
        or all(dot4(row, column(j)) == (basis.det if kind(j) == own else 0) for own, row in enumerate(basis.sums))
    ]
    return _touching([basis], fixed)


def _touching(bases: Sequence[Basis], tight: Sequence[int]) -> set[int]:
    """Return the columns that carry weight in some solution that uses tight columns only; those of the last are."""
    last = bases[-1].program.total - 1
    carrying = {j for basis in bases for j in basis.carrying}
    while True:
        carrying |= _filled(bases[-1], carrying, tight)
        rest = [j for j in tight if j not in carrying and j != last]
        more = _loaded(bases[-1], set(rest), tight) if rest else set()
        if not more:
            return carrying
        carrying |= more


def _filled(basis: Basis, carrying: set[int], tight: Sequence[int]) -> set[int]:
    """Return the faces that columns of theirs span all of: a point inside a face is a mean of all its vertices."""
    filled: set[int] = set()
    column = basis.program.column
    for kind in (0, 1):
        face = [j for j in tight if basis.program.kind(j) == kind]
        own = [j for j in face if j in carrying]
        if own and len(own) < len(face):
            spans = [affine_rank([column(j)[:3] for j in some]) for some in (own, face)]
            if spans[0] == spans[1]:
                filled.update(face)
    return filled


def _loaded(basis: Basis, wanted: set[int], tight: Sequence[int]) -> set[int]:
    """Return the columns of a solution that puts weight on one of `wanted`, none if there is no such solution."""
    column, basis = basis.program.column, basis.restarted()
    while True:
        h = [ZERO] * 4
        for j, row in zip(basis.basic, basis.rows, strict=True):
            if j in wanted:
                h = [u + v for u, v in zip(h, row, strict=True)]
        gains = [((basis.det if j in wanted else ZERO) - dot4(h, column(j)), j) for j in tight if j not in basis.basic]
        gain, entering = max(gains, default=(ZERO, -1))
        if not gain > 0:
            return set()
        basis = basis.pivoted(entering)
        carrying = set(basis.carrying)
        if carrying & wanted:
            return carrying


# ------------------------------------------------------------------------------------------------- what does, at a pair


def witness(shadow: Shadow, rho: tuple[fmpq, fmpq]) -> tuple[dict[int, fmpq], dict[int, fmpq]]:
    """Return weights of both parts' vertices that give a common point at a scale pair of the polygon.

    Parameters
    ----------
    shadow : Shadow
    rho : two fmpq

    Returns
    -------
    one, two : dict
        Vertices -> positive weights, adding up to the scale pair; of vertices that span space if it is inside.
    """
    program, vertices = shadow.program, shadow.vertices
    z: Sequence[fmpz | fmpq] = program.point(rho)
    mixed: dict[int, fmpq] = {}
    if len(vertices) > 2:
        centre = _centre(shadow)
        middle = [ZERO, ZERO, ZERO]
        for j, load in centre.items():
            middle[program.kind(j)] += load
        # as much of the centre as leaves the rest on the polygon's boundary
        share = min(fmpq(dot(edge.levels, z), dot(edge.levels, middle)) for edge in shadow.edges)
        z = [x - share * y for x, y in zip(z, middle, strict=True)]
        mixed = {j: share * load for j, load in centre.items() if share > 0 and load > 0}
    for basis, factor in _mixture(vertices, z):
        for j, load in basis.weights.items():
            if load:
                mixed[j] = mixed.get(j, fmpq(0)) + factor * load
    tau = mixed.pop(program.total - 1)
    e1, e2, e3 = program.units
    n = program.counts[0]
    one = {j: load / tau * scaled(ONE, e3 - e1) for j, load in mixed.items() if j < n}
    two = {j - n: load / tau * scaled(ONE, e3 - e2) for j, load in mixed.items() if j >= n}
    return one, two


def _centre(shadow: Shadow) -> dict[int, fmpz]:
    """Return the weights of a point inside the polygon, of columns that span space."""
    vertices = shadow.vertices
    centre = dict(shadow.start.inner)
    for vertex in vertices[:: max(1, len(vertices) // 3)][:3]:
        for j, load in vertex.basis.weights.items():
            centre[j] = centre.get(j, ZERO) + load
    return centre


def _mixture(vertices: Sequence[Vertex], z: Sequence[fmpz | fmpq]) -> list[tuple[Basis, fmpq]]:
    """Return non-negative multiples of vertices' solutions that add up to a point of the polygon's boundary."""
    if not any(z):
        return []
    for k, first in enumerate(vertices):
        second = vertices[(k + 1) % len(vertices)]
        factors = _combination(first.point, second.point, z)
        if factors is not None:
            return [
                (vertex.basis, factor * fmpq(sum(vertex.point, ZERO)) / fmpq(sum(vertex.basis.point, ZERO)))
                for vertex, factor in zip((first, second), factors, strict=True)
                if factor
            ]
    raise AssertionError("the scale pair is not on the polygon's boundary")


def _combination(u: Vector, v: Vector, z: Sequence[fmpz | fmpq]) -> tuple[fmpq, fmpq] | None:
    """Return non-negative factors of two homogeneous points that give a third, None if there are none."""
    normal = cross(u, v)
    if not any(normal):
        k = next(k for k in range(3) if u[k])
        factor = fmpq(z[k]) / u[k]
        return (factor, fmpq(0)) if all(factor * x == y for x, y in zip(u, z, strict=True)) else None
    if dot(normal, z):
        return None
    i = next(i for i in range(3) if normal[i])
    j, k = (i + 1) % 3, (i + 2) % 3
    p = fmpq(z[j] * v[k] - z[k] * v[j]) / normal[i]
    q = fmpq(u[j] * z[k] - u[k] * z[j]) / normal[i]
    return (p, q) if p >= 0 and q >= 0 else None
