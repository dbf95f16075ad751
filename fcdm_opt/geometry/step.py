"""STEP files through cascadio, whose triangles come in single precision: plane faces are made exact again."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from fcdm_opt.errors import InputError
from fcdm_opt.geometry.arrays import Array, Ints
from fcdm_opt.geometry.files import scene
from fcdm_opt.geometry.flattening import onto_planes
from fcdm_opt.tolerances import DEFAULT


def read_step(data: bytes) -> list[tuple[Array, Ints]]:
    """Return vertices, in metres, and triangles of the solids in a STEP file.

    Raises
    ------
    InputError
        Without cascadio; says what to install.
    ValueError
        For a file that is not complete.
    """
    try:
        import cascadio
    except ImportError as reason:
        raise InputError("STEP files need cascadio: pip install 'fcdm_opt[step]'", found=str(reason)) from reason
    if not data.lstrip().startswith(b"ISO-10303-21"):
        raise ValueError("it does not begin with 'ISO-10303-21'")
    if b"END-ISO-10303-21" not in data:
        raise ValueError("it ends without 'END-ISO-10303-21'")
    with _messages_to_stderr():
        glb = cascadio.load(
            data,
            tol_linear=DEFAULT.tessellation,
            tol_angular=DEFAULT.tessellation_turn,
            tol_relative=True,
            use_parallel=False,
            include_brep=True,
            brep_types={"plane"},
        )
    if not glb:
        raise ValueError("no shape can be made of it")
    return [(_sharpened(mesh) @ T[:3, :3].T + T[:3, 3], mesh.faces) for mesh, T in scene(glb)]


def _sharpened(mesh: Any) -> Array:
    """Return vertices of a mesh moved, within single precision, onto the planes of the faces around them."""
    vertices = np.array(mesh.vertices)
    planes = mesh.metadata.get("cascadio", {}).get("brep_primitives", [])
    owner = mesh.face_attributes.get("brep_index")
    if owner is None or not any(planes):
        return vertices
    slack = 8 * float(np.finfo(np.float32).eps) * np.abs(vertices).max(initial=0.0)
    distinct, same = np.unique(vertices, axis=0, return_inverse=True)
    known = np.array([k < len(planes) and planes[k] is not None for k in owner.tolist()])
    pairs = np.column_stack([same.reshape(-1)[mesh.faces[known]].ravel(), np.repeat(owner[known], 3)])
    corner, plane = np.unique(pairs, axis=0).T
    normals, origins = (np.array([getattr(planes[k], name) for k in plane.tolist()]) for name in ("normal", "origin"))
    misses = ((origins - distinct[corner]) * normals).sum(axis=1)
    near = np.abs(misses) <= slack
    moved = onto_planes(distinct, corner[near], normals[near], misses[near])
    far = np.abs(moved - distinct).max(axis=1) > slack / DEFAULT.sharp
    moved[far] = distinct[far]
    return moved[same.reshape(-1)]


@contextmanager
def _messages_to_stderr() -> Iterator[None]:
    """Send what the library prints to the error stream: standard output may be a program's result."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        os.dup2(2, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
