"""How the time to load and cut a mesh grows with its faces: trays of rounded pockets, and rings with round sections.

    python benchmarks/bench_loading.py PICTURE.png

CPU seconds of this process, one thread, kernels compiled before; the exponent is of the line fitted in logarithms.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import Any

from fcdm_opt.threads import single

POCKETS, SECTIONS = (3, 5, 9, 16), (16, 27, 50, 86)  # pockets in a row; sides of a ring's section


def arc(count: int, radius: float, start: float, turn: float) -> Any:
    """Return points of an arc, (count, 2)."""
    import numpy as np

    angles = start + turn * np.arange(count) / count
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def solids() -> Iterator[tuple[str, Any]]:
    """Yield the kind of each solid, and the solid."""
    import numpy as np
    from manifold3d import CrossSection, Manifold

    corners = ((2.5, 1.5), (-2.5, 1.5), (-2.5, -1.5), (2.5, -1.5))
    outline = np.vstack([np.add(at, arc(7, 1.5, k * np.pi / 2, np.pi / 2)) for k, at in enumerate(corners)])
    pocket = CrossSection([outline]).extrude(8.0)
    for count in POCKETS:
        tray = Manifold.cube([12.0 + 10.4 * count, 10.0 + 8.0 * count, 10.0])
        for i, j in np.ndindex(count, count):
            tray -= pocket.translate([8.0 + 10.4 * i, 8.0 + 8.0 * j, 4.0])
        yield "tray", tray
    for sides in SECTIONS:
        section = np.add([8.0, 0.0], arc(sides, 2.0, 0.0, 2 * np.pi))
        yield "ring", CrossSection([section]).revolve(2 * sides)


def main() -> None:
    """Measure, print and draw."""
    single()
    import numpy as np
    import trimesh
    from matplotlib import pyplot as plt

    from fcdm_opt import Body

    found: dict[str, list[tuple[int, float]]] = {"tray": [], "ring": []}
    with tempfile.TemporaryDirectory() as folder:
        for kind, solid in solids():
            mesh, path = solid.to_mesh(), Path(folder) / f"{kind}.stl"
            trimesh.Trimesh(np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts), process=False).export(path)
            if not found[kind]:
                Body.from_file(path, unit="mm", decomposition="surface")  # kernels are compiled or loaded
            start = process_time()
            body = Body.from_file(path, unit="mm", decomposition="surface")
            found[kind].append((len(mesh.tri_verts), process_time() - start))
            print(
                f"{kind}: {found[kind][-1][0]} faces, {len(body.parts)} parts, {found[kind][-1][1]:.2f} s", flush=True
            )
    figure, axes = plt.subplots(figsize=(6.0, 4.0), layout="constrained")
    for kind, own in found.items():
        counts, times = np.array(own).T
        exponent = np.polyfit(np.log(counts), np.log(times), 1)[0]
        axes.loglog(counts, times, "o-", label=f"{kind}: grows as the power {exponent:.2f}")
        print(f"{kind}: exponent {exponent:.2f}")
    axes.loglog([3e3, 1e4, 3e4], [1.0, 5.0, 20.0], "k_", markersize=14, label="1, 5 and 20 s")
    axes.set(xlabel="faces of the mesh", ylabel="seconds to load and cut", title="Loading grows with the faces")
    axes.legend(frameon=False)
    figure.savefig(sys.argv[1], dpi=110)


if __name__ == "__main__":
    main()
