"""Mesh files: what was written comes back, in the unit asked for; what is wrong with a file is said with its name."""

from __future__ import annotations

import itertools
import os
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from solids import FAMILIES, random_solid
from strategies import random_rotation

import fcdm_opt as fo
from fcdm_opt.curve.decision_curve import decision_curve
from fcdm_opt.errors import InputError
from fcdm_opt.geometry.files import NANOMETRES, drawn_mesh, mesh_formats
from fcdm_opt.geometry.mesh import checked_mesh
from fcdm_opt.geometry.solids import contains
from fcdm_opt.geometry.surface import Surface
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.step_files import cylinder, polyhedron

CUBE = np.array(list(itertools.product([0.0, 1.0], repeat=3)))
QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
TRIANGLES = np.array([(a, b, c) for p, q, r, s in QUADS for a, b, c in ((p, q, r), (p, r, s))])
BOX = CUBE * [1, 2, 3]
TURN = Rotation.from_rotvec([0.3, 0.5, 0.7]).as_matrix()
# an L: its ends are not convex, so that fans would be wrong
L_ENDS = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
L_POINTS = np.array([(x, y, z) for z in (0.0, 1.0) for x, y in np.roll(L_ENDS, 2, axis=0)])
L_FACES = [tuple(range(6))[::-1], tuple(range(6, 12)), *((k, (k + 1) % 6, (k + 1) % 6 + 6, k + 6) for k in range(6))]


def read_mesh(path, **options):
    """Return vertices and faces of a mesh file."""
    return drawn_mesh(path, **options)[:2]


def obj(points, faces, corner=str):
    rows = [f"v {' '.join(map(repr, x))}" for x in np.array(points).tolist()]
    return "\n".join([*rows, *("f " + " ".join(corner(v + 1) for v in face) for face in faces)]) + "\n"


def off(points, faces):
    rows = [" ".join(map(repr, x)) for x in np.array(points).tolist()]
    return "\n".join(
        ["OFF", f"{len(points)} {len(faces)} 0", *rows, *(f"{len(f)} {' '.join(map(str, f))}" for f in faces)]
    )


def ply(points, faces):
    head = f"ply\nformat ascii 1.0\nelement vertex {len(points)}\n" + "".join(f"property double {c}\n" for c in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = [" ".join(map(repr, x)) for x in np.array(points).tolist()]
    return head + "\n".join([*rows, *(f"{len(face)} {' '.join(map(str, face))}" for face in faces)]) + "\n"


def binary_ply(points, faces, kind="double"):
    size = len(faces[0])
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
    head += "".join(f"property {kind} {c}\n" for c in "xyz")
    head += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    points = np.array(points, "<f8" if kind == "double" else "<f4").tobytes()
    return head.encode() + points + b"".join(struct.pack(f"<B{size}i", size, *face) for face in faces)


def stl(points, triangles):
    data = b"made for a test".ljust(80) + struct.pack("<I", len(triangles))
    for row in triangles:
        data += struct.pack("<12fH", 0, 0, 0, *np.array(points)[list(row)].ravel(), 0)
    return data


def text_stl(points, triangles):
    text = "solid part\n"
    for row in triangles:
        corners = "".join(f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in np.array(points)[list(row)].tolist())
        text += f"facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n"
    return text + "endsolid part\n"


def glb(points, triangles):
    return trimesh.Trimesh(points, triangles, process=False).export(file_type="glb")


def written(folder: Path, name: str, data: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


SINGLE = 1e-7  # what single precision keeps
WAYS = {
    "binary.stl": (lambda points: stl(points, TRIANGLES), SINGLE),
    "text.stl": (lambda points: text_stl(points, TRIANGLES), 0),
    "text.STL": (lambda points: text_stl(points, TRIANGLES).replace("\n", "\r\n"), 0),
    "box.obj": (lambda points: obj(points, QUADS), 0),
    "box.off": (lambda points: off(points, QUADS), 0),
    "text.ply": (lambda points: ply(points, QUADS), 0),
    "double.ply": (lambda points: binary_ply(points, QUADS), 0),
    "single.ply": (lambda points: binary_ply(points, TRIANGLES, "float"), SINGLE),
}


@pytest.mark.parametrize("name", WAYS)
@pytest.mark.parametrize("size", [1.0, 1e-8, 1e8])
@pytest.mark.parametrize(("unit", "file_unit", "factor"), [("mm", None, 1), ("mm", "in", 25.4), ("m", "um", 1e-6)])
def test_a_box_comes_back_with_its_eight_corners(tmp_path, name, size, unit, file_unit, factor):
    make, slack = WAYS[name]
    points, faces = read_mesh(written(tmp_path, name, make(BOX * size)), unit=unit, file_unit=file_unit)
    mesh = checked_mesh(points, faces)
    assert mesh.repairs == ()
    assert len(mesh.vertices) == 8
    there, back = (np.array(sorted(rows)) for rows in ((BOX * size * factor).tolist(), mesh.vertices.tolist()))
    np.testing.assert_allclose(back, there, rtol=max(slack, 1e-15))
    np.testing.assert_allclose(mesh.volume, 6 * (size * factor) ** 3, rtol=max(4 * slack, 1e-14))


@pytest.mark.parametrize(("name", "make"), [("L.obj", obj), ("L.off", off), ("L.ply", ply)])
def test_polygons_and_numbers_are_those_of_the_file(tmp_path, name, make):
    points, faces = read_mesh(written(tmp_path, name, make(L_POINTS, L_FACES)), unit="mm")
    np.testing.assert_array_equal(points, L_POINTS)
    assert list(map(tuple, faces)) == L_FACES
    assert checked_mesh(points, faces).exact_volume == 3


def test_obj_files_with_textures_objects_and_backward_numbers(tmp_path):
    text = "# two boxes\nmtllib nowhere.mtl\no one\n" + obj(BOX, QUADS, lambda v: f"{v}/1/2").replace(
        "f ", "s off\nf ", 1
    )
    text += "g two\nvn 0 0 1\nvt 0 0\nusemtl red\n"
    text += obj(BOX + 10, [], str) + "".join("f " + " ".join(f"{v - 8}//1" for v in q) + "\n" for q in QUADS)
    points, faces = read_mesh(
        written(tmp_path, "two.obj", text.replace("v 0.0 0.0 0.0\n", "v 0.0 0.0 \\\n 0.0 1.0\n")), unit="mm"
    )
    assert faces == [*QUADS, *(tuple(v + 8 for v in q) for q in QUADS)]
    assert checked_mesh(points, faces).volume == pytest.approx(12)


def test_off_files_with_comments_and_colours(tmp_path):
    rows = off(BOX, QUADS).splitlines()
    rows = [
        "COFF # coloured",
        "",
        rows[1],
        *(f"{row} 1 0 0 1" for row in rows[2:10]),
        "# faces",
        *(f"{r} 255 0 0" for r in rows[10:]),
    ]
    points, faces = read_mesh(written(tmp_path, "box.off", "\n".join(rows)), unit="mm")
    np.testing.assert_array_equal(points, BOX)
    assert faces == QUADS


@pytest.mark.parametrize("suffix", ["stl", "obj", "off"])
def test_a_body_could_not_be_written(tmp_path, suffix):
    """Digit for digit; of a union whose surface is not known each part, which are one solid again."""
    points = np.array([(x, y, z) for x in (0.1, 1 / 3) for y in (0.0, 1.0) for z in (-1e-7, 2.0)])
    body = fo.Body.convex(points, name="block")
    body.to_file(tmp_path / f"block.{suffix}")
    again = fo.Body.from_file(tmp_path / f"block.{suffix}", unit="mm")
    assert sorted(map(tuple, again.vertices.tolist())) == sorted(map(tuple, points.tolist()))
    halves = fo.Body.from_parts([points, points + np.array([1 / 3 - 0.1, 0.0, 0.0])], name="halves")
    halves.to_file(tmp_path / f"halves.{suffix}")
    assert len(fo.Body.from_file(tmp_path / f"halves.{suffix}", unit="mm").corners) == 8
    with pytest.raises(InputError, match="no kind of file that is written"):
        body.to_file(tmp_path / "block.step")


def test_a_text_file_of_two_solids(tmp_path):
    text = text_stl(BOX, TRIANGLES) + text_stl(BOX + 10, TRIANGLES)
    mesh = checked_mesh(*read_mesh(written(tmp_path, "two.stl", text), unit="mm"))
    assert (len(mesh.vertices), mesh.exact_volume) == (16, 12)


# ------------------------------------------------------------------------------------------------------- GLB and STEP


@pytest.mark.parametrize("unit", NANOMETRES)
def test_glb_files_are_in_metres(tmp_path, unit):
    path = written(tmp_path, "box.glb", glb(BOX, TRIANGLES))
    mesh = checked_mesh(*read_mesh(path, unit=unit))
    np.testing.assert_allclose(
        np.ptp(mesh.vertices, axis=0), np.array([1, 2, 3]) * (1e9 / NANOMETRES[unit]), rtol=1e-15
    )


def test_meshes_of_a_glb_scene_are_where_the_scene_places_them(tmp_path):
    box, scene = trimesh.Trimesh(BOX, TRIANGLES, process=False), trimesh.Scene()
    turn = random_rotation(np.random.default_rng(0))
    for k, name in enumerate("abc"):
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = turn * (k + 1), [20.0 * k, 0, 0]
        scene.add_geometry(box, node_name=name, geom_name="box", transform=pose)
    mesh = checked_mesh(*read_mesh(written(tmp_path, "three.glb", scene.export(file_type="glb")), unit="m"))
    assert len(mesh.vertices) == 24
    np.testing.assert_allclose(mesh.volume, 6 * (1 + 8 + 27), rtol=1e-12)
    wanted = np.vstack([BOX @ turn.T * (k + 1) + [20.0 * k, 0, 0] for k in range(3)])
    off_by = np.linalg.norm(mesh.vertices[:, None] - wanted, axis=2).min(axis=0)
    assert off_by.max() < 1e-6


@pytest.mark.parametrize(("unit", "drawn"), [*zip(NANOMETRES, itertools.cycle(["cm", "mm", "in", "m"]), strict=False)])
def test_step_files_name_their_unit_and_plane_faces_are_exact(tmp_path, drawn, unit):
    """cascadio's single precision would be off by 1e-8."""
    turn = random_rotation(np.random.default_rng(4))
    points = (L_POINTS + 0.1) @ turn.T * 7.3 + [1, 2, 3]
    vertices, faces = read_mesh(written(tmp_path, "L.step", polyhedron(points, L_FACES, drawn)), unit=unit)
    mesh = checked_mesh(vertices, faces)
    assert len(mesh.vertices) == 12
    wanted = points * (NANOMETRES[drawn] / NANOMETRES[unit])
    off_by = np.linalg.norm(mesh.vertices[:, None] - wanted, axis=2).min(axis=0)
    assert off_by.max() < 1e-14 * np.abs(wanted).max()
    np.testing.assert_allclose(mesh.volume, 3 * (7.3 * NANOMETRES[drawn] / NANOMETRES[unit]) ** 3, rtol=1e-13)


@pytest.mark.parametrize("radius", [0.01, 1.0, 1000.0])
def test_curved_faces_of_step_files_are_cut_into_triangles(tmp_path, radius):
    axes = random_rotation(np.random.default_rng(7))
    mesh = checked_mesh(*read_mesh(written(tmp_path, "c.stp", cylinder(radius, 2 * radius, axes)), unit="mm"))
    level = mesh.vertices @ axes[:, 2]
    np.testing.assert_allclose(level, np.where(level > radius, 2 * radius, 0), atol=1e-14 * radius)
    off_axis = np.linalg.norm(mesh.vertices - level[:, None] * axes[:, 2], axis=1)
    np.testing.assert_allclose(off_axis, radius, rtol=3e-7)
    assert np.sinc(DEFAULT.tessellation_turn / np.pi) < mesh.volume / (2 * np.pi * radius**3) < 1


def test_without_cascadio_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "cascadio", None)
    path = written(tmp_path, "L.step", polyhedron(L_POINTS, L_FACES, "mm"))
    with pytest.raises(InputError, match=r"pip install -c constraints.txt -e '\.\[step\]'") as caught:
        read_mesh(path, unit="mm")
    assert caught.value.what.startswith("reading a STEP file needs the extra step: cascadio cannot be loaded (")
    assert isinstance(caught.value.__cause__, ImportError)
    assert caught.value.file == path


def test_a_library_prints_nothing_about_a_file_that_it_cannot_read(tmp_path, capfd):
    """OpenCASCADE reports errors on standard output, where a program's result may be."""
    text = GOOD_STEP.replace("CLOSED_SHELL", "OPENED", 1).replace("ENDSEC;\nEND", "#7=;\nENDSEC;\nEND")
    with pytest.raises(InputError, match=r"STEP file|no faces"):
        read_mesh(written(tmp_path, "bad.step", text), unit="mm")
    assert capfd.readouterr() == ("", "")


# ---------------------------------------------------------------------------------------------- digits that are too few


@pytest.mark.parametrize("family", FAMILIES)
def test_faces_of_turned_solids_are_plane_again_after_single_precision(tmp_path, family):
    """A binary STL file has folds of 1e-8 in every slanted face; moved within its digits, it has the faces drawn."""
    rng = np.random.default_rng([0, 8])
    solid = random_solid(rng, family, False)
    points = solid.vertices @ Rotation.from_rotvec(rng.uniform(0.3, 1, 3)).as_matrix().T + rng.uniform(-5, 5, 3)
    path = written(tmp_path, "part.stl", stl(points, solid.triangles))
    vertices, faces, remarks, *_ = drawn_mesh(path, unit="mm")
    size = np.abs(points).max()
    order = np.linalg.norm(vertices[:, None] - points, axis=2).argmin(axis=1)
    moved = np.abs(vertices - points[order]).max() / size
    assert 0 < moved < 2e-6
    assert len(remarks) == 1
    assert "to make plane faces plane" in remarks[0]
    mesh = checked_mesh(vertices, faces)
    assert plane_faces(mesh) == plane_faces(checked_mesh(solid.vertices, solid.triangles))
    rounded = np.array(points, np.float32).astype(float)
    assert plane_faces(checked_mesh(rounded, solid.triangles)) > plane_faces(mesh)


def plane_faces(mesh):
    """How many faces there are when neighbouring triangles are one face where they lie in one plane."""
    local = (mesh.vertices - mesh.vertices.mean(axis=0)) / np.abs(mesh.vertices).max()
    rows = mesh.triangles.tolist()
    beside = {(row[k - 1], row[k]): t for t, row in enumerate(rows) for k in range(3)}
    owner = list(range(len(rows)))

    def root(t):
        return t if owner[t] == t else root(owner[t])

    for (p, q), t in beside.items():
        other = beside[q, p]
        a, b, c = local[rows[t]]
        normal = np.cross(b - a, c - a)
        if np.abs((local[rows[other]] - a) @ normal).max() < 1e-12 * np.linalg.norm(normal):
            owner[root(t)] = root(other)
    return len({root(t) for t in owner})


def test_a_prism_in_a_binary_file_is_one_part_and_keeps_its_faces(tmp_path):
    angles = 2 * np.pi * np.arange(7) / 7
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.array([(*xy, z) for z in (0.0, 2.0) for xy in ring]) @ TURN.T + 3
    sides = [((k, (k + 1) % 7, k + 7), ((k + 1) % 7, (k + 1) % 7 + 7, k + 7)) for k in range(7)]
    ends = [((0, k + 1, k), (7, k + 7, k + 8)) for k in range(1, 6)]
    path = written(tmp_path, "prism.stl", stl(points, [t for both in (*sides, *ends) for t in both]))
    body = fo.Body.from_file(path, unit="mm")
    assert len(body.parts) == 1
    assert sorted(map(len, body.faces)) == [4] * 7 + [7] * 2
    assert any("to make plane faces plane" in note for note in body.notes)


def test_polygons_of_six_decimals_are_plane_and_more_bent_ones_are_refused(tmp_path):
    points = L_POINTS @ TURN.T + 0.2
    path = written(tmp_path, "L.obj", obj(points.round(6), L_FACES))
    vertices, faces, remarks, *_ = drawn_mesh(path, unit="mm")
    assert 0 < np.abs(vertices - points).max() < 5e-6
    assert len(remarks) == 1
    np.testing.assert_allclose(checked_mesh(vertices, faces).volume, 3, rtol=1e-5)
    path = written(tmp_path, "L.obj", obj(points.round(4), L_FACES))
    with pytest.raises(InputError, match="corners lie in no plane"):
        checked_mesh(*read_mesh(path, unit="mm"))


def test_an_edge_whose_ends_rounding_made_one_divides_nothing_by_zero():
    points = np.array([(0, 0, 0), (1, 0, 0), (1, 0, 0), (0, 1, 0)], float)
    surface = Surface(
        points, np.array([(0, 1, 3)]), np.zeros(1, int), ((0, 1, 3),), np.array([(0, 1), (1, 2)]), np.empty((0, 2)), ()
    )
    on, within = surface.along_edges(np.array([(0.5, 0, 0), (1, 0, 0)]))
    np.testing.assert_array_equal(on, [(True, False), (True, True)])
    np.testing.assert_array_equal(within, on)


@pytest.mark.parametrize("name", [name for name in WAYS if name != "text.STL"])
def test_vertices_of_plane_faces_are_not_touched(tmp_path, name):
    make, slack = WAYS[name]
    points = np.array(BOX + 0.1, np.float32 if slack else float).astype(float)
    vertices, _, remarks, *_ = drawn_mesh(written(tmp_path, name, make(points)), unit="mm")
    assert remarks == ()
    drawn = np.round(BOX + 0.1, 9)  # single precision is read as the decimals that it was made of
    assert {tuple(x) for x in vertices.tolist()} == {tuple(x) for x in drawn.tolist()}


@pytest.mark.parametrize("turn", [np.eye(3), TURN])
def test_the_finest_step_in_a_file_of_all_digits_is_not_flattened(tmp_path, turn):
    step = 1e-9
    outline = [(0, 0), (1, 0), (1, 1), (0.5, 1), (0.5, 1 + step), (0, 1 + step)]
    points = np.array([(x, y, z) for z in (0.0, 1.0) for x, y in outline]) @ turn.T
    vertices, _, remarks, *_ = drawn_mesh(written(tmp_path, "step.obj", obj(points, L_FACES)), unit="mm")
    np.testing.assert_array_equal(vertices, points)
    assert remarks == ()


def test_a_low_step_in_a_binary_file_is_not_flattened(tmp_path):
    step = 1e-5
    outline = [(0, 0), (1, 0), (1, 1), (0.5, 1), (0.5, 1 + step), (0, 1 + step)]
    points = np.array([(x, y, z) for z in (0.0, 1.0) for x, y in outline]) @ TURN.T
    mesh = checked_mesh(points, L_FACES)
    vertices, faces = read_mesh(written(tmp_path, "step.stl", stl(points, mesh.triangles)), unit="mm")
    assert plane_faces(checked_mesh(vertices, faces)) == 8


# ------------------------------------------------------------------------------------------------ several solids a file

ENDS = BOX, BOX + np.array([1, 0, 0])  # face on face


def _two(kind):
    """Return two boxes as a file of a kind has them, and what it calls them."""
    if kind == "stl":
        return stl(np.concatenate(ENDS), np.concatenate([TRIANGLES, TRIANGLES + 8])), ("1", "2")
    if kind == "off":
        return off(np.concatenate(ENDS), [tuple(x) for x in np.concatenate([TRIANGLES, TRIANGLES + 8])]), ("1", "2")
    if kind == "obj":
        return _objects(), ("left", "right")
    left, right = (trimesh.Trimesh(own, TRIANGLES) for own in ENDS)
    return trimesh.Scene({"right": right, "left": left}).export(file_type="glb"), ("left", "right")


def _objects():
    text = ""
    for k, (name, points) in enumerate(zip(("left", "right"), ENDS, strict=True)):
        rows = obj(points, [tuple(v + 8 * k for v in face) for face in QUADS])
        text += f"o {name}\n{rows}"
    return text


@pytest.mark.parametrize("kind", ["stl", "off", "obj", "glb"])
def test_solids_face_on_face_in_one_file_are_one_body_or_each_by_name(tmp_path, kind):
    """They were refused: "faces 12 and 15 cross"; and nothing told how many a file holds."""
    content, names = _two(kind)
    path, unit = written(tmp_path, f"two.{kind}", content), "m" if kind == "glb" else "mm"
    whole = fo.Body.from_file(path, unit=unit)
    assert whole.size == pytest.approx(np.sqrt(4 + 4 + 9))
    assert sum(part.volume_and_centroid[0] for part in whole.parts) == pytest.approx(12.0)
    (told,) = (note for note in whole.notes if "one alone" in note)
    orders = [f"solids {one} and {two}; one alone is 'two.{kind}#{one}'" for one, two in (names, names[::-1])]
    assert told in [f"2 solids in the file, taken as one body: {order}" for order in orders]
    for name, points in zip(names, ENDS, strict=True):
        body = fo.Body.from_file(f"{path}#{name}", unit=unit)
        assert body.name == (f"two-{name}" if name.isdecimal() else name)
        assert {tuple(x) for x in body.vertices.tolist()} == {tuple(x) for x in points.tolist()}
    with pytest.raises(InputError, match=f"no such solid in the file; found 'lid'; allowed: .*{names[0]}"):
        fo.Body.from_file(f"{path}#lid", unit=unit)


def _drive(phase: float) -> bytes:
    """Return a shaft, its hub and a collar beside it, turned in space, in single precision: walls are a digit apart."""
    turn = Rotation.random(random_state=3).as_matrix()
    hub, collar = trimesh.creation.annulus(10, 20, 20, sections=16), trimesh.creation.annulus(10, 14, 5, sections=16)
    hub.apply_transform(trimesh.transformations.rotation_matrix(phase, (0, 0, 1)))
    collar.apply_translation((0, 0, 12.5))
    named = {"shaft": trimesh.creation.cylinder(10, 40, sections=12), "hub": hub, "collar": collar}
    for own in named.values():
        own.vertices = own.vertices @ turn.T
    return trimesh.Scene(named).export(file_type="glb")


@pytest.mark.slow
@pytest.mark.parametrize("phase", [0.0, 0.1])
def test_parts_of_an_assembly_whose_facets_cross_are_one_body(tmp_path, phase):
    """They were refused: "faces 259 and 1043 cross", of a shaft with its key and hub as a STEP file has them."""
    path = written(tmp_path, "drive.glb", _drive(phase))
    alone = [fo.Body.from_file(f"{path}#{name}", unit="m") for name in ("shaft", "hub", "collar")]
    whole = fo.Body.from_file(path, unit="m")
    assert "closed surfaces made one solid" in whole.notes[0]
    assert any("3 solids in the file, taken as one body" in note for note in whole.notes)
    points = np.random.default_rng(5).uniform(-25, 25, (400, 3))
    held = [contains(own, points) for own in alone]
    assert 40 < np.any(held, axis=0).sum() < 360
    assert (contains(whole, points) == np.any(held, axis=0)).all()
    cube = fo.Body.convex(BOX + np.array([15.0, 17.0, 14.0]))
    gaps = [float(decision_curve(cube, own).gap((1, 1))) for own in alone]
    assert float(decision_curve(cube, whole).gap((1, 1))) == pytest.approx(min(gaps), abs=1e-6)


def test_a_cavity_is_no_solid_of_its_own(tmp_path):
    ball = trimesh.creation.box((0.5, 0.5, 0.5))
    points = np.concatenate([BOX, np.array(ball.vertices) + np.array([0.5, 1, 1.5])])
    path = written(tmp_path, "room.stl", stl(points, np.concatenate([TRIANGLES, np.array(ball.faces)[:, ::-1] + 8])))
    body = fo.Body.from_file(path, unit="mm")
    assert not any("solids" in note for note in body.notes)
    assert sum(part.volume_and_centroid[0] for part in body.parts) == pytest.approx(6 - 0.125)
    assert len(fo.Body.from_file(f"{path}#1", unit="mm").corners) == 16


def test_a_problem_file_names_one_solid_of_a_mesh_file(tmp_path):
    written(tmp_path, "two.stl", _two("stl")[0])
    path = tmp_path / "p.toml"
    path.write_text(
        '[bodies.movable]\nfile = "two.stl#1"\nunit = "mm"\n[bodies.static]\nfile = "two.stl#2"\nunit = "mm"\n'
        '[[case]]\nname = "a"\ntarget = [1.01, 1.0]\nmotion = [{ translation = "x" }]\ngoal = "clear"\n'
    )
    (problem,) = fo.load_problems(path)
    assert fo.solve(problem).amount == pytest.approx(0.005)  # half of the width grows by that


# ---------------------------------------------------------------------------------------------------------- bad files


def test_a_pipe_named_as_a_mesh_is_refused_not_waited_for(tmp_path):
    """Nobody writes to it: reading would not end."""
    path = tmp_path / "part.stl"
    os.mkfifo(path)
    with pytest.raises(InputError, match="not a regular file"):
        drawn_mesh(path, unit="mm")


GOOD_STL, GOOD_GLB = stl(BOX, TRIANGLES), glb(BOX, TRIANGLES)
NO_GLB = b"glTF" + struct.pack("<II", 2, 48) + struct.pack("<I", 28) + b'JSON{"asset":{"version":"2.0"}} '
GOOD_STEP = polyhedron(L_POINTS, L_FACES, "mm")
BAD_FILES = {
    "empty.stl": (b"", "empty"),
    "blank.obj": (b" \n\n", "empty"),
    "short.stl": (GOOD_STL[:-10], "not a complete STL file: 674 bytes where its header promises 684"),
    "header.stl": (b"\0" * 40, "not a complete STL file: 40 bytes"),
    "none.stl": (GOOD_STL[:80] + b"\0\0\0\0", "no faces"),
    "cut.stl": (text_stl(BOX, TRIANGLES)[:300], "without 'endsolid'"),
    "prose.stl": ("This is no mesh.", "neither binary nor text"),
    "word.stl": (text_stl(BOX, TRIANGLES).replace("vertex 1.0", "vertex one", 1), "not a complete STL file"),
    "corner.stl": (text_stl(BOX, TRIANGLES).replace("vertex 0.0 0.0 0.0\n", "", 1), "not a complete STL file"),
    "quads.stl": (text_stl(BOX, QUADS), "not a complete STL file"),
    "binary.obj": (GOOD_STL, "not a complete OBJ file: not text"),
    "points.obj": (obj(BOX, []), "no faces"),
    "word.obj": (obj(BOX, QUADS).replace("v 1.0", "v one", 1), "line 5: 'v one"),
    "flat.obj": ("v 1 2\nf 1 1 1\n", "line 1: 'v 1 2'"),
    "row.obj": (obj(BOX, [*QUADS, (0, 1, 8)]), "a face names vertex 9 of 8"),
    "zero.obj": (obj(BOX, [(0, 1, -1)]), "line 9: 'f 1 2 0'"),
    "short.off": (off(BOX, QUADS)[:-9], "not a complete OFF file"),
    "row.off": (off(BOX, [*QUADS, (0, 1, 8)]), "line 17: '3 0 1 8'"),
    "head.off": (off(BOX, QUADS)[4:], "it begins with"),
    "counts.off": ("OFF\n", "not a complete OFF file"),
    "short.ply": (binary_ply(BOX, QUADS)[:-3], "not a complete PLY file"),
    "text.ply": (ply(BOX, QUADS)[:-30], "not a complete PLY file"),
    "points.ply": (ply(BOX, []), "no faces"),
    "head.ply": (ply(BOX, QUADS)[5:], "not a complete PLY file"),
    "short.glb": (GOOD_GLB[:-200], "not a complete GLB file"),
    "text.glb": ("{}", "not a complete GLB file"),
    "none.glb": (NO_GLB, "no faces"),
    "text.step": ("solid", "does not begin with 'ISO-10303-21'"),
    "short.step": (GOOD_STEP[: len(GOOD_STEP) // 2], "ends without 'END-ISO-10303-21'"),
    "none.step": (GOOD_STEP[: GOOD_STEP.index("#1=")] + "ENDSEC;\nEND-ISO-10303-21;\n", "STEP file|no faces"),
    "box.dae": (b"<collada/>", "unknown kind of file; found '.dae'; allowed: .stl, .obj"),
    "box": (GOOD_STL, "unknown kind of file"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_bad_files_are_refused_by_name(tmp_path, name):
    data, message = BAD_FILES[name]
    with pytest.raises(InputError, match=message) as caught:
        read_mesh(written(tmp_path, name, data), unit="mm")
    assert str(caught.value).startswith(str(tmp_path / name))


def test_every_prefix_of_a_file_is_refused_or_is_another_mesh(tmp_path):
    """Nothing but an InputError, wherever a file was cut off."""
    whole = {"b.stl": GOOD_STL, "t.stl": text_stl(BOX, TRIANGLES), "b.glb": GOOD_GLB, "b.ply": binary_ply(BOX, QUADS)}
    whole |= {"t.ply": ply(BOX, QUADS), "t.off": off(BOX, QUADS), "t.obj": obj(BOX, QUADS)}
    for name, data in whole.items():
        data = data.encode() if isinstance(data, str) else data
        passed = 0
        for end in range(0, len(data) - 1, 23):
            path = written(tmp_path, name, data[:end])
            try:
                checked_mesh(*read_mesh(path, unit="mm"))
            except InputError:
                continue
            passed += 1
        assert passed == 0, name


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"unit": "furlong"}, "unit: unknown unit; found 'furlong'; allowed: m, cm, mm, um, in, ft"),
        ({"unit": "mm", "file_unit": "MM"}, "file_unit: unknown unit"),
        ({"unit": None}, "unit: unknown unit"),
    ],
)
def test_units_are_explicit(tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        read_mesh(written(tmp_path, "box.stl", GOOD_STL), **options)


@pytest.mark.parametrize(("name", "data"), [("box.glb", GOOD_GLB), ("L.step", GOOD_STEP)])
def test_a_file_that_names_its_unit_takes_no_other(tmp_path, name, data):
    with pytest.raises(InputError, match=r"file_unit: a \w+ file says itself .*found 'mm'"):
        read_mesh(written(tmp_path, name, data), unit="mm", file_unit="mm")


def test_missing_files_and_directories(tmp_path):
    for path in (tmp_path / "none.stl", tmp_path / "folder.obj"):
        if path.suffix == ".obj":
            path.mkdir()
        with pytest.raises(InputError, match=f"no such file in {tmp_path}|cannot be read: Is a directory") as caught:
            read_mesh(path, unit="mm")
        assert str(path) in str(caught.value)


def test_formats_are_those_of_the_issue():
    assert set(mesh_formats) == {".stl", ".obj", ".ply", ".off", ".glb", ".step", ".stp"}


# ------------------------------------------------------------------------------------------------------------- bodies


def test_body_from_file(tmp_path):
    path = written(tmp_path, "lid.obj", obj(L_POINTS, L_FACES))
    body = fo.Body.from_file(path, unit="mm", file_unit="cm", seed=(1, 2, 3))
    assert body.name == "lid"
    same = fo.Body.from_mesh(10 * L_POINTS, L_FACES, seed=(1, 2, 3))
    np.testing.assert_array_equal(body.vertices, same.vertices)
    np.testing.assert_array_equal(body.seed, [1, 2, 3])
    assert body.faces == same.faces
    assert len(body.parts) == len(same.parts) > 1
    other = fo.Body.from_file(str(path), unit="mm", name="cover")
    assert other.name == "cover"
    np.testing.assert_allclose(other.seed, checked_mesh(L_POINTS, L_FACES).centroid, rtol=1e-14)


def test_errors_of_a_body_name_the_file_too(tmp_path):
    path = written(tmp_path, "lid.obj", obj(BOX, QUADS[:5]))
    with pytest.raises(InputError, match="body 'lid': the surface is not closed") as caught:
        fo.Body.from_file(path, unit="mm")
    assert str(caught.value).startswith(str(path))


def test_import_stays_light():
    script = (
        "import sys, fcdm_opt; fcdm_opt.Body; print([m for m in ('trimesh', 'cascadio', 'flint') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_body_whose_vertices_were_moved_says_by_how_much_in_its_deviation(tmp_path):
    """It said (0, 0) beside notes that vertices were moved: made plane from single precision, or made one."""
    points = L_POINTS @ TURN.T + 3
    mesh = checked_mesh(points, L_FACES)
    single = points.astype(np.float32).astype(float)
    for unit, length in (("mm", 1.0), ("um", 1000.0)):
        path = written(tmp_path, "L.stl", stl(points, mesh.triangles))
        body = fo.Body.from_file(path, unit=unit, file_unit="mm")
        assert any("vertices moved" in note for note in body.notes)
        vertices, _ = read_mesh(path, unit=unit, file_unit="mm")
        off = np.linalg.norm(vertices[:, None] / length - single, axis=2).min(axis=1).max() * length
        assert off > 0
        np.testing.assert_allclose(body.deviation, (off, off), rtol=1e-6)
    step = 2.0**-42
    twice = np.vstack([BOX, BOX[0] + (step, 0, 0)])
    corner = int(np.flatnonzero((TRIANGLES == 0).any(axis=1))[0])
    triangles = [np.where(own == 0, 8, own) if k == corner else own for k, own in enumerate(TRIANGLES)]
    body = fo.Body.from_mesh(twice, np.array(triangles))
    assert any("made one" in note for note in body.notes)
    assert body.deviation == (step, step)
    assert fo.Body.from_mesh(BOX, TRIANGLES).deviation == (0.0, 0.0)


@pytest.mark.parametrize("half", [4.997, 4.992, 4.991])
def test_a_clearance_that_a_drawing_just_has_was_missing_in_files_of_single_precision(tmp_path, half):
    """A key in a slot of 10, both in binary STL: 4.997 is 4.99700022 there, and .003 was not left at its side."""
    bodies = []
    slot = trimesh.util.concatenate(
        [trimesh.creation.box(bounds=[(5 * s - 5, -9, -5), (5 * s + 5, 9, 5)]) for s in (-2, 2)]
        + [trimesh.creation.box(bounds=[(-15, -9, -9), (15, 9, -5)])]
    )
    for name, mesh in (("key", trimesh.creation.box(bounds=[(-half, -8, -4), (half, 8, 8)])), ("slot", slot)):
        mesh.export(tmp_path / f"{name}.stl")
        bodies.append(fo.Body.from_file(tmp_path / f"{name}.stl", unit="mm"))
    problem = fo.Problem(*bodies, motion=fo.Translation("x"), goal="clear", clearance=round(5 - half, 6), target=(1, 1))
    assert fo.solve(problem).status.name == "ALREADY_SATISFIED"
