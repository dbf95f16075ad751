"""How faces of bodies move with sizes: plane ones outward, round ones with their surface."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.bodies import Body
from fcdm_opt.geometry.facet_errors import round_surfaces
from fcdm_opt.geometry.size import Size
from fcdm_opt.geometry.tessellation import RoundFaces, Swept
from fcdm_opt.tolerances import DEFAULT


class MovesOfFaces(NamedTuple):
    """How the true faces of a body answer to k sizes.

    Attributes
    ----------
    seed : (3,) array
    lengths : (faces, k) array
        How far the true face that each row of `Body.faces` stands for moves outward a unit of each size.
    shifts : (faces, 3, k) array
        How it is shifted besides.
    turns : (k, 3, 3) array
        Scales: a point X moves by U (X - s) a unit of each.
    """

    seed: Array
    lengths: Array
    shifts: Array
    turns: Array

    @classmethod
    def of(
        cls, facets: Body, sizes: Sequence[Size], offsets: Array | None = None, turns: Array | None = None
    ) -> MovesOfFaces:
        """Return them; raises `InputError` for a size that makes something else of a round face.

        By default faces move by all of what sizes say; `offsets` (faces, k) and `turns` where some of them count as
        scales.
        """
        offsets = offsets_of_faces(facets, sizes) if offsets is None else offsets
        turns = np.array([size.directions() for size in sizes]).reshape(-1, 3, 3) if turns is None else turns
        lengths, shifts = offsets.copy(), np.zeros((len(offsets), 3, len(sizes)))
        for _, rows in round_surfaces(facets):
            for k, size in enumerate(sizes):
                moved = _moved_surface(facets, rows, offsets[:, k])
                if moved is None:
                    raise InputError(
                        f"a round face of body '{facets.name}' would no longer be one",
                        key=f"size '{size.name}'.faces", found=size.faces, allowed="all of it",
                    )  # fmt: skip
                lengths[list(rows), k], shifts[list(rows), :, k] = moved[0], moved[1:]
        return cls(facets.seed, lengths, shifts, turns)

    def at(self, point: Array, rows: Sequence[int], normals: Array) -> Array:
        """Return how a point moves a unit of each size with the faces of some rows that meet there, (3, k)."""
        own = list(rows)
        off = self.lengths[own] + np.einsum("fx,fxk->fk", normals, self.shifts[own])
        along = self.shifts[own[0]] if len(own) == 1 else 0.0 * self.shifts[own[0]]
        move = along + np.linalg.lstsq(normals, off - normals @ along)[0]
        return np.asarray(move + np.einsum("kyx,x->yk", self.turns, point - self.seed), float)


def offsets_of_faces(body: Body, sizes: Sequence[Size]) -> Array:
    """Return how far each face of the body moves outward a unit of each size, (faces, k)."""
    return np.column_stack([*(size.offsets(body) for size in sizes), np.zeros(len(body.faces))])[:, :-1]


def rows_moved(body: Body, made: Body, offsets: Array) -> Ints | None:
    """Return which face of a body each of a body made of it is, (faces,): where labels changed, by its plane moved."""
    if made.faces == body.faces:
        return np.arange(len(body.faces))
    (normals, points), (own, places) = body.face_planes, made.face_planes
    levels = (normals * points).sum(axis=1) + offsets
    off = 1.0 - own @ normals.T + np.abs((own * places).sum(axis=1)[:, None] - levels) / body.size
    rows = off.argmin(axis=1)
    return None if off[np.arange(len(rows)), rows].max(initial=0.0) > DEFAULT.nominal else rows


def moved_surfaces(body: Body, offsets: Array) -> RoundFaces | None:
    """Return the round surfaces of a body with faces moved outward, (faces,): each has the radius that goes with them.

    Faces of one surface may be moved by one length, or shifted besides; None where they are moved otherwise.
    """
    found = list[tuple[Swept, tuple[int, ...]]]()
    for surface, rows in round_surfaces(body):
        moved = _moved_surface(body, rows, offsets)
        if moved is None:
            return None
        found.append((surface.offset(side_of(body, surface, rows[0]) * float(moved[0]), moved[1:]), rows))
    return tuple(found)


def _moved_surface(body: Body, rows: Sequence[int], offsets: Array) -> Array | None:
    """Return by what length a round face is moved outward, and how it is shifted besides, (4,); None of other moves."""
    own, normals = offsets[list(rows)], body.face_planes[0][list(rows)]
    if np.ptp(own) <= DEFAULT.nominal * body.size:
        return np.array([own[0], 0.0, 0.0, 0.0])
    columns = np.column_stack([np.ones(len(rows)), normals])
    answer = np.asarray(np.linalg.lstsq(columns, own)[0], float)
    return answer if np.abs(columns @ answer - own).max() <= DEFAULT.nominal * body.size else None


def side_of(body: Body, surface: Swept, row: int) -> float:
    """Return 1 where a round face has its material inside, as a shaft, and -1 of a bore."""
    corners, owners = body.face_triangles
    looks = surface.misses(corners[owners == row][:1].mean(axis=1))[1][0]
    return math.copysign(1.0, looks @ body.face_planes[0][row])
