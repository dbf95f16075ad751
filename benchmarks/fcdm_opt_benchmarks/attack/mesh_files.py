"""An attack with mesh files that others made: each is mated with parts made from it, and the answers are checked.

    python benchmarks/attack_meshes.py FOLDER [--seconds 60] [--json FILE]

Each file is asked twice, along each axis in turn: to touch a pocket that is its hull made 3 % larger, and to be clear
of a mould of itself with 1 % of room sideways after it came out .2 % larger. A motion is right where manifold3d finds
no overlap after it and, for "touch", no distance; it is least where there is none before it, either way. That parts do
not fit is right where that is so of the motion out of the fit, and on the way there they overlap. Ends with 3 where an
answer is wrong; what was refused, or not answered in time, is listed with the reason.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import manifold3d as m3
import numpy as np
import trimesh

from fcdm_opt_benchmarks.attack.raw_solids import RawSolid, block, depth_at_most, distance
from fcdm_opt_benchmarks.shapes import Array

SUFFIXES = (".stl", ".obj", ".ply", ".off", ".glb")
QUESTIONS = "touch", "clear"
POCKET, OPEN, LARGER, ROOM = 1.03, 0.05, 1.002, 1.01
SLACK = 2e-6  # of the size: what a motion may miss; file's digits and repairs are told by the package and added
SHARES = (0.25, 0.5, 0.75, 0.95)  # of the way, at which nothing may do as well


class MeshOutcome(NamedTuple):
    """One question about one file: `kind` is "right", "wrong", "refused", "late" or "no oracle"."""

    file: str
    question: str
    kind: str
    words: str
    seconds: float


def solid_of(file: Path) -> RawSolid | None:
    """Return a file's surface with equal corners joined, None where that is no closed surface to the library."""
    loaded: Any = trimesh.load(file, force="mesh", process=True)
    if not len(getattr(loaded, "faces", ())):
        return None
    loaded.merge_vertices(merge_tex=True, merge_norm=True)
    loaded.apply_scale(1000.0 if file.suffix.lower() == ".glb" else 1.0)  # in metres
    own = RawSolid(np.array(loaded.vertices), np.array(loaded.faces, dtype=np.int64), loaded.vertices.mean(axis=0))
    solid, shells = own.solid(), own.solid().decompose()
    if len(shells) > 1 and all(shell.volume() > 0.0 for shell in shells):  # they may overlap
        solid = m3.Manifold.batch_boolean(shells, m3.OpType.Add)
    return None if solid.is_empty() or solid.volume() <= 0.0 else RawSolid.of(solid, own.seed)


def pocket(own: RawSolid) -> RawSolid:
    """Return a block with a pocket: the hull of a solid made larger, open above."""
    middle = (own.vertices.min(axis=0) + own.vertices.max(axis=0)) / 2
    hull = RawSolid.of(own.solid().hull(), middle).scaled(POCKET)
    low, high = hull.vertices.min(axis=0), hull.vertices.max(axis=0)
    pad = 0.2 * float((high - low).max())
    top = high[2] - OPEN * (high[2] - low[2])  # where its tip touched the top the block would be no solid
    return RawSolid.of(block(low - pad, [*(high + pad)[:2], top]) - hull.solid(), middle)


def mould(own: RawSolid) -> RawSolid:
    """Return a block, as high as the middle of a solid, from which the solid made wider is cut."""
    low, high = own.vertices.min(axis=0), own.vertices.max(axis=0)
    pad, middle = 0.2 * float((high - low).max()), (low + high) / 2
    wide = own.solid().translate((-middle).tolist()).scale((ROOM, ROOM, 1.0)).translate(middle.tolist())
    return RawSolid.of(block(low - pad, [*(high + pad)[:2], middle[2]]) - wide, middle)


def _asked(file: Path, question: str, axis: int, seconds: float) -> tuple[str, str]:
    """Ask one question and return what the answer is worth."""
    import fcdm_opt as fo

    own = solid_of(file)
    if own is None:
        try:
            fo.Body.from_file(file, unit="mm")
        except fo.InputError as reason:
            return "refused", str(reason)[:300]
        return "no oracle", "read by the package, but no closed surface to the oracle"
    partner, rho = (pocket(own), 1.0) if question == "touch" else (mould(own), LARGER)
    try:
        movable = fo.Body.from_file(file, unit="mm", seed=own.seed)
        static = fo.Body.from_mesh(partner.vertices, partner.triangles, seed=partner.seed)
        problem = fo.Problem(
            movable,
            static,
            target=(rho, 1.0),
            goal="touch" if question == "touch" else "clear",
            motion=fo.Translation("xyz"[axis]),  # type: ignore[arg-type]
            unit="mm",
        )
    except fo.InputError as reason:
        return "refused", str(reason)[:300]
    answer = fo.solve(problem, time=seconds)
    told = sum(max(body.deviation) for body in (movable, static))
    return _worth(own.scaled(rho), partner, answer, np.eye(3)[axis], question, told)


def _worth(own: RawSolid, partner: RawSolid, answer: Any, axis: Array, question: str, told: float) -> tuple[str, str]:
    words = f"{answer.status.name} {answer.amount:.6g}, bound {answer.lower_bound:.6g}"
    slack = SLACK * float(np.ptp(partner.vertices, axis=0).max()) + 2.0 * told

    def at(shift: float) -> RawSolid:
        T = np.eye(4)
        T[:3, 3] = shift * axis
        return own.moved(T)

    if answer.status.name == "NOT_VERIFIED":
        failed = "; ".join(f"{check.name} ({check.value:.3g})" for check in answer.certificate.failed)
        return "refused", f"{words}: {failed}"
    if answer.transform is None or not (answer.usable or answer.status.name == "OUTSIDE_FIT"):
        return "refused", words
    shift = float(answer.transform[:3, 3] @ axis)
    if not depth_at_most(at(shift), partner, slack):
        return "wrong", f"{words}: the parts overlap"
    if question == "touch" and distance(at(shift), partner, 10 * slack) > slack:
        return "wrong", f"{words}: the parts are apart"
    if abs(shift) > 100 * slack:
        for share in (*SHARES, *(-x for x in SHARES)):
            met = _met(at(share * shift), partner, question, slack)
            if met:
                return "wrong", f"{words}: a motion of {share * shift:.6g} does"
    if not answer.usable and all(depth_at_most(at(share * shift), partner, slack) for share in SHARES):
        return "wrong", f"{words}: nothing is in the way"
    return "right", words


def _met(own: RawSolid, partner: RawSolid, question: str, slack: float) -> bool:
    """Tell beyond doubt whether a smaller motion does what is asked: overlap by rounding counts as none."""
    overlaps = not depth_at_most(own, partner, 0.0)
    return not overlaps and (question == "clear" or distance(own, partner, 10 * slack) <= 0.0)


def _answered(work: Callable[..., Any], arguments: tuple[Any, ...], seconds: float) -> tuple[str, str]:
    """Return what a process of its own answers, "late" after so many seconds."""
    queue: Any = multiprocessing.get_context("fork").Queue()

    def run() -> None:
        try:
            queue.put(work(*arguments))
        except Exception as reason:  # the run goes on
            queue.put(("wrong", f"{type(reason).__name__}: {reason}"[:300]))

    process = multiprocessing.get_context("fork").Process(target=run, daemon=True)
    process.start()
    try:
        found: tuple[str, str] = queue.get(timeout=seconds)
        return found
    except Exception:
        return "late", f"no answer in {seconds:g} s"
    finally:
        process.kill()
        process.join()


def outcomes(files: list[Path], seconds: float) -> Iterator[MeshOutcome]:
    """Yield what each file's questions came to."""
    with tempfile.TemporaryDirectory() as folder:  # libraries and kernels are loaded once, before processes copy this
        cut = Path(folder) / "ball.stl"
        trimesh.creation.icosphere(1).export(cut)
        for question in QUESTIONS:
            _asked(cut, question, 2, seconds)
    for number, file in enumerate(files):
        for question in QUESTIONS:
            axis = number % 3 if question == "touch" else 2
            start = time.perf_counter()
            kind, words = _answered(_asked, (file, question, axis, seconds / 2), seconds)
            yield MeshOutcome(file.name, f"{question} {'xyz'[axis]}", kind, words, time.perf_counter() - start)


def main(arguments: list[str] | None = None) -> int:
    """Run the attack from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0, help="of each question, reading included")
    parser.add_argument("--json", type=Path, help="write every outcome there")
    given = parser.parse_args(arguments)
    files = sorted(file for file in given.folder.rglob("*") if file.suffix.lower() in SUFFIXES)
    found = []
    for own in outcomes(files, given.seconds):
        found.append(own)
        print(f"{own.kind:9} {own.seconds:6.1f} s  {own.file}, {own.question}: {own.words}", flush=True)
        if given.json is not None:
            given.json.write_text(json.dumps([line._asdict() for line in found], indent=1) + "\n")
    counts = {kind: sum(own.kind == kind for own in found) for kind in sorted({own.kind for own in found})}
    print(f"{len(files)} files, {len(found)} questions: " + ", ".join(f"{n} {kind}" for kind, n in counts.items()))
    return 3 if counts.get("wrong") else 0
