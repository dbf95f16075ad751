"""Write `fcdm-opt`'s answers to the data set: problem files in, its JSON documents out; nothing of it is imported.

    python answer_fcdm_opt.py answers.json [--certify] [--only WORD]

A scene becomes one problem file; all are solved by one run of the command `fcdm-opt solve --json`, scales by
`fcdm-opt curve --json`.
"""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import asking

WIDE = [[0.1, 9.0], [0.1, 9.0]]
AXES = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}


def toml(value: Any) -> str:
    """Return a value as TOML writes it in one line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml(own)}" for key, own in value.items()) + " }"
    return f"[{', '.join(map(toml, value))}]" if isinstance(value, list | tuple) else json.dumps(value)


def problem(scene: Mapping[str, Any]) -> str:
    """Return the problem file of a scene."""
    question, sizes = scene["question"], scene.get("sizes", {})
    lines = [f"title = {toml(scene['name'])}"]
    for role in ("movable", "static"):
        parts = sizes[role] if role in sizes else scene[role]["parts"]
        corners = [point for part in parts for point in part]
        lines += [f"[bodies.{role}]", f"seed = {toml(scene[role]['seed'])}", f"vertices = {toml(corners)}"]
        if len(parts) > 1:
            firsts = [sum(map(len, parts[:k])) for k in range(len(parts) + 1)]
            labels = [list(range(a + 1, b + 1)) for a, b in pairwise(firsts)]
            lines.append(f"parts = {toml(labels)}")
    for own in sizes.get("list", ()):
        lines += ["[[size]]", *(f"{key} = {toml(own[key])}" for key in ("name", "body", "faces", "each", "tolerance"))]
    case: dict[str, Any] = {"name": "case", "box": WIDE, "goal": question["goal"]}
    case["target"] = scene["scale"]
    if sizes:
        case["made"] = {own["name"]: own["made"] for own in sizes["list"]}
    if question["goal"] != "scale":
        case |= {"motion": [_step(step) for step in question["motion"]], "length": question["length"]}
    else:
        case |= {"motion": [{"translation": "x"}], "goal": "touch"}
    if question["goal"] == "locate":
        case |= {"goal": "at", "contacts": "all", "path": "free"}
    if question.get("clearance"):
        case["clearance"] = question["clearance"]
    if question.get("limits"):
        names = _names(question["motion"])
        ends = zip(names, question["limits"], strict=True)
        case["limits"] = {name + "_rad" * (name[0] in "Rs"): own for name, own in ends if own is not None}
    return "\n".join([*lines, "[[case]]", *(f"{key} = {toml(value)}" for key, value in case.items())]) + "\n"


def _step(step: Mapping[str, Any]) -> Mapping[str, Any]:
    if "screw" in step:
        return {"screw": step["screw"], "pitch_per_rad": step["pitch"]}
    return {key: AXES.get(tuple(own), own) if key in ("translation", "rotation") else own for key, own in step.items()}


def _names(motion: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the names of parameters, for motions in which none occurs twice."""
    found: list[str] = []
    for step in motion:
        if "free" in step:
            found += ["TX", "TY", "TZ", "RX", "RY", "RZ"]
        elif "screw" in step:
            found.append("screw_angle")
        else:
            key = "translation" if "translation" in step else "rotation"
            found.append(("T" if key == "translation" else "R") + AXES.get(tuple(step[key]), "").upper())
    return found


def answer(case: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a case of the JSON document says."""
    if "status" not in case:
        return {"claim": "unknown", "said": str(case)[:300]}
    made: dict[str, Any] = {"claim": "unknown", "said": case["status"], "seconds": sum(case["seconds"].values())}
    if case["lower_bound"] is not None and math.isfinite(float(case["lower_bound"])):
        made["lower_bound"] = case["lower_bound"]
    # the data set asks for a motion, not for one that stays in the fit as drawn
    if case["usable"] or (case["status"] == "OUTSIDE_FIT" and case["certificate"]["passed"]):
        proved = case["gap"] is not None and case["gap"] <= 1e-3
        made |= {"claim": "least" if proved else "motion", "motion": list(case["parameters"].values())}
    elif case["status"] == "INFEASIBLE":
        made["claim"] = "none"
    return made


def scale(case: Mapping[str, Any], rho1: float) -> dict[str, Any]:
    """Return the scale of body 2 on the decision curve at one of body 1."""
    for segment in case["segments"]:
        a, b, c = segment["line"]
        ends = sorted((segment["start"][0], segment["end"][0]))
        if ends[0] <= rho1 <= ends[1]:
            return {"claim": "motion", "scale": (c - a * rho1) / b}
    return {"claim": "unknown", "said": "no segment there"}


def document(command: str, files: Sequence[Path], *options: str) -> list[Mapping[str, Any]]:
    """Return what `fcdm-opt` says of some files; the command of this Python's environment goes before the path's."""
    beside = shutil.which("fcdm-opt", path=str(Path(sys.executable).parent))
    asked = [beside or "fcdm-opt", command, *map(str, files), "--json", *options]
    made = json.loads(subprocess.run(asked, stdout=subprocess.PIPE, check=False).stdout)
    files_said: list[Mapping[str, Any]] = made["files"]
    return files_said


def main() -> None:
    """Ask, and write the answers."""
    given = asking.options("Answer the data set with fcdm-opt.", "--certify")
    answers: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        for command, options in (("solve", ["--certify"] * given.certify), ("curve", [])):
            own = [scene for scene in given.scenes if (scene["question"]["goal"] == "scale") == (command == "curve")]
            files = [Path(folder, f"{command}{k}.toml") for k in range(len(own))]
            for path, scene in zip(files, own, strict=True):
                path.write_text(problem(scene), "utf-8")
            for scene, said in zip(own, document(command, files, *options) if own else (), strict=True):
                if command == "curve":
                    answers[scene["name"]] = scale(said["curves"][0], scene["question"]["rho1"])
                else:
                    answers[scene["name"]] = answer(said["cases"][0]) if said.get("cases") else answer(said)
    asking.write(given.out, "fcdm-opt solve" + " --certify" * given.certify, answers)


if __name__ == "__main__":
    main()
