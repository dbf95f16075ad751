"""Who is asked about a contact: our own ways, and the libraries as somebody would use them.

A method takes the data of a case and answers some of these, plain numbers all:

- `state`: 1 apart, 0 touching, -1 overlapping; a claim, judged as it stands;
- `meets`: whether the closed bodies do;
- `gap`: the signed distance, less than zero by the depth where they overlap;
- `rho2`: the least contact scale of body 2 in the box for the given scale of body 1, None where it says there is none;
- `normal`: the direction from body 1 to body 2 where they touch.

A library's coordinates are those of the scaled bodies as drawn, unless the name says otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib import import_module
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from fcdm_opt.geometry.arrays import Array
from fcdm_opt.tolerances import DEFAULT
from fcdm_opt_benchmarks.coal_shapes import coal_hull, coal_requests
from fcdm_opt_benchmarks.library import dataset_script, dense, highs_model, highs_solver
from fcdm_opt_benchmarks.stability.case import WRONG_BEYOND

if TYPE_CHECKING:
    from fcdm_opt.geometry.bodies import Body

Data = Mapping[str, Any]
Answer = dict[str, Any]
MOST_STEPS = 300  # of IPOPT: ten times what it needs where it gets there
HALVINGS = 200  # of a bisection: more than any two floats are apart
BODIES = ("one", "two")
LARGEST = 20_000  # vertices that a general solver is given


class NoAnswerError(Exception):
    """What a method raises where it says itself that it has no answer."""


# ----------------------------------------------------------------------------------------------------------------- ours


def decision_curve(data: Data) -> Answer:
    """Ask the curve of one pair: gap, distance, contact scale, and the direction of the contact that is there."""
    import fcdm_opt as fo

    curve = fo.decision_curve(*_bodies(data), transform=data["transform"], box=data["box"])
    rho = np.array(data["rho"])
    gap = float(curve.gap(rho))
    found = curve.crossings(rho[0])
    answer: Answer = {"state": int(np.sign(gap)), "gap": gap, "rho2": float(found[0]) if found.size else None}
    if gap > 0:
        answer["gap"] = curve.distance(rho)
        if np.isnan(answer["gap"]):  # as documented: the collision library behind it cannot tell
            del answer["gap"]
    place = curve.locate(rho)
    if place is not None:
        normal = place.normal if hasattr(place, "normal") else place.pieces[0].normal
        answer["normal"] = normal.tolist()
    return answer


def decision_curves(data: Data) -> Answer:
    """Ask the batch for one pose: the contact scale from its arrays, the direction of the line there."""
    import fcdm_opt as fo

    rho1, rho2 = data["rho"]
    batch = fo.decision_curves(*_bodies(data), [data["transform"]], box=data["box"])
    ends = batch.vertices[:, :, 0]
    across = np.flatnonzero((ends.min(axis=1) <= rho1) & (rho1 <= ends.max(axis=1)) & (ends[:, 0] != ends[:, 1]))
    answer: Answer = {"rho2": None}
    if not across.size and rho1 in data["box"][0]:
        raise NoAnswerError("stretches are listed, not the single points in which a curve may meet the box's border")
    if across.size:
        (x, y), (u, v) = batch.vertices[across].transpose(1, 2, 0)
        share = (rho1 - x) / (u - x)
        heights = y + share * (v - y)
        best = int(heights.argmin())
        answer["rho2"] = float(heights[best])
        if abs(answer["rho2"] - rho2) <= DEFAULT.nominal * rho2:
            answer["normal"] = batch.normals[across[best]].tolist()
    return answer


def exact_path(data: Data) -> Answer:
    """Ask the rational reference: side, contact scale, direction."""
    from fcdm_opt.curve.exact import exact_curve
    from fcdm_opt.curve.exact.rationals import quotient, rational
    from fcdm_opt_benchmarks.stability.contacts.truth import crossings

    one, two = _bodies(data)
    rho, transform = [rational(x) for x in data["rho"]], np.array(data["transform"])
    curves = [exact_curve(p, q, transform) for p, q in product(one.parts, two.parts)]
    sides = [curve.side(rho) for curve in curves]
    low, high = (rational(x) for x in data["box"][1])
    listed = [y for y in crossings(curves, rho[0]) if low <= y <= high]
    answer: Answer = {"state": min(sides), "rho2": quotient(listed[0].p, listed[0].q) if listed else None}
    touching = curves[int(np.argmin(sides))]
    if touching.pieces and not min(sides):
        best = max(touching.pieces, key=lambda piece: piece.separation((rho[0], rho[1])))
        answer["normal"] = best.normal.tolist()
    return answer


def _bodies(data: Data) -> tuple[Body, Body]:
    import fcdm_opt as fo

    def built(key: str) -> Body:
        own = data[key]
        if own["parts"]:
            return fo.Body.from_parts(own["vertices"], parts=own["parts"], seed=own["seed"], name=key)
        return fo.Body.convex(own["vertices"], seed=own["seed"], name=key)

    return built("one"), built("two")


# -------------------------------------------------------------------------------------------------- collision libraries


def coal_distance(data: Data, tolerance: float | None = None, normalised: bool = False) -> Answer:
    """Ask coal's distance: the least over the part pairs, with its normal."""
    import coal

    scene = _CoalScene(coal, data, normalised)
    scene.scale(*data["rho"])
    request, _ = coal_requests(tolerance)
    least: Answer = {"gap": np.inf}
    for shapes in scene.pairs:
        result = coal.DistanceResult()
        gap = coal.distance(*shapes, request, result) * scene.unit
        if not gap >= least["gap"]:
            least = {"gap": gap, "normal": np.array(result.normal).tolist()}
    return least


def coal_collide(data: Data, tolerance: float | None = None) -> Answer:
    """Ask coal whether the bodies collide, with the normal of the contact that it reports."""
    import coal

    scene = _CoalScene(coal, data)
    return scene.collide(data["rho"], _colliding(tolerance))


def coal_bisection(data: Data, tolerance: float | None = None) -> Answer:
    """Halve the box's range of rho_2 by coal's collide until no float lies between."""
    import coal

    scene, (rho1, _), (low, high) = _CoalScene(coal, data), data["rho"], data["box"][1]
    request = _colliding(tolerance)

    def meets(rho2: float) -> bool:
        return bool(scene.collide((rho1, rho2), request)["meets"])

    below = meets(low)
    if below == meets(high):
        raise NoAnswerError("both ends of the range give the same answer: nothing to halve")
    for _ in range(HALVINGS):
        middle = float(np.sqrt(low) * np.sqrt(high)) if high > 2 * low else (low + high) / 2
        if not low < middle < high:
            break
        low, high = (middle, high) if meets(middle) == below else (low, middle)
    return {"rho2": (low + high) / 2}


class _CoalScene:
    """Both bodies for coal: hulls are built once as drawn, scales only move their points."""

    def __init__(self, coal: Any, data: Data, normalised: bool = False) -> None:
        T = np.array(data["transform"])
        self._coal, self.unit = coal, 1.0
        clouds, seeds = [_drawn(data[key]) for key in BODIES], [np.array(data[key]["seed"]) for key in BODIES]
        offset = T[:3, 3]
        if normalised:  # lengths from the seeds, in units of the larger scaled body
            clouds = [[cloud - seed for cloud in own] for own, seed in zip(clouds, seeds, strict=True)]
            reach = [rho * max(np.abs(x).max() for x in own) for rho, own in zip(data["rho"], clouds, strict=True)]
            self.unit = 2.0 ** np.ceil(np.log2(max(reach)))
            offset = (T[:3, :3] @ seeds[0] + offset - seeds[1]) / self.unit
            seeds = [np.zeros(3), np.zeros(3)]
        self._seeds = seeds
        self._shapes = [[coal_hull(cloud) for cloud in own] for own in clouds]
        self._bases = [[shape.points().copy() for shape in own] for own in self._shapes]
        pose, fixed = coal.Transform3s(T[:3, :3], offset), coal.Transform3s()
        self.pairs = [(one, pose, two, fixed) for one, two in product(*self._shapes)]

    def scale(self, *rho: float) -> None:
        """Move the points to where the scales put them."""
        for factor, seed, shapes, bases in zip(rho, self._seeds, self._shapes, self._bases, strict=True):
            for shape, base in zip(shapes, bases, strict=True):
                shape.points()[:] = (seed + factor * (base - seed)) / self.unit

    def collide(self, rho: Iterable[float], request: Any) -> Answer:
        """Return whether any two parts collide."""
        self.scale(*rho)
        for shapes in self.pairs:
            result = self._coal.CollisionResult()
            if self._coal.collide(*shapes, request, result):
                found = result.numContacts()
                normal = {"normal": np.array(result.getContact(0).normal).tolist()} if found else {}
                return {"meets": True, **normal}
        return {"meets": False}


def manifold_gap(data: Data) -> Answer:
    """Ask manifold3d for the least gap of two solids, 0 where they meet."""
    import manifold3d

    one, two = ([_manifold(manifold3d, cloud) for cloud in own] for own in _clouds(data))
    gap = min(p.min_gap(q, 1e9) for p, q in product(one, two))
    return {"meets": not gap > 0, **({"gap": gap} if gap > 0 else {})}


def manifold_boolean(data: Data) -> Answer:
    """Ask manifold3d whether the intersection of two solids has a volume."""
    import manifold3d

    one, two = ([_manifold(manifold3d, cloud) for cloud in own] for own in _clouds(data))
    return {"overlaps": any(not (p ^ q).is_empty() for p, q in product(one, two))}


def mujoco_distance(data: Data) -> Answer:
    """Ask MuJoCo's mj_geomDistance of meshes, the least over the part pairs; its meshes keep single precision."""
    import mujoco

    ones, twos = _clouds(data)
    spec = mujoco.MjSpec()
    for k, cloud in enumerate((*ones, *twos)):
        mesh = spec.add_mesh(name=f"part {k}")
        mesh.uservert = cloud.ravel().tolist()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name)
    model = spec.compile()
    state = mujoco.MjData(model)
    mujoco.mj_kinematics(model, state)
    most = 10.0 * float(np.ptp(np.vstack([*ones, *twos]), axis=0).max())
    pairs = product(range(len(ones)), range(len(ones), len(ones) + len(twos)))
    gaps = [mujoco.mj_geomDistance(model, state, i, j, most, np.zeros(6)) for i, j in pairs]
    return {"gap": float(min(gaps))}


def drake_distance(data: Data) -> Answer:
    """Ask Drake's signed distance of convex geometries, the least over the part pairs, with its normal."""
    geometry, math = import_module("pydrake.geometry"), import_module("pydrake.math")
    shape = dataset_script("answer_drake").shape
    graph = geometry.SceneGraph()
    source, properties = graph.RegisterSource("scene"), geometry.ProximityProperties()
    for role, clouds in zip(BODIES, _clouds(data), strict=True):
        frame = graph.RegisterFrame(source, geometry.GeometryFrame(role)) if role == "one" else graph.world_frame_id()
        for k, cloud in enumerate(clouds):
            own = geometry.GeometryInstance(math.RigidTransform(), shape(cloud), f"{role} {k}")
            own.set_proximity_properties(properties)
            graph.RegisterGeometry(source, frame, own)
    context = graph.CreateDefaultContext()
    if poses := graph.get_source_pose_port(source):
        from pydrake.common.value import Value

        still = geometry.FramePoseVector()
        for frame in graph.model_inspector().GetAllFrameIds():
            if frame != graph.world_frame_id():
                still.set_value(frame, math.RigidTransform())
        poses.FixValue(context, Value(still))
    found = graph.get_query_output_port().Eval(context).ComputeSignedDistancePairwiseClosestPoints()
    least = min(found, key=lambda own: own.distance)
    name = graph.model_inspector().GetName(least.id_A)
    sign = 1.0 if "two" in name else -1.0  # `nhat_BA_W` points to A
    return {"gap": float(least.distance), "normal": (sign * np.array(least.nhat_BA_W)).tolist()}


def _manifold(manifold3d: Any, cloud: Array) -> Any:
    made = manifold3d.Manifold.hull_points(cloud)
    if made.is_empty():
        raise NoAnswerError(f"the hull is empty ({made.status()})")
    return made


def _colliding(tolerance: float | None) -> Any:
    request = coal_requests(tolerance)[1]
    request.enable_contact = True
    return request


def _drawn(body: Mapping[str, Any]) -> list[Array]:
    points = np.array(body["vertices"], dtype=np.float64)
    return [points] if not body["parts"] else [points[own] for own in body["parts"]]


def _clouds(data: Data) -> tuple[list[Array], list[Array]]:
    """Return the points of all parts of both bodies, scaled and moved."""
    T = np.array(data["transform"])
    one, two = (
        [np.array(data[key]["seed"]) + rho * (cloud - np.array(data[key]["seed"])) for cloud in _drawn(data[key])]
        for rho, key in zip(data["rho"], BODIES, strict=True)
    )
    return [cloud @ T[:3, :3].T + T[:3, 3] for cloud in one], two


# ------------------------------------------------------------------------------------------------------ linear programs

# Weights of the vertices that give a common point: P lambda - Q mu = d, sum lambda = rho_1, all of them >= 0. The
# scales rho_2 = sum mu of all common points are an interval; an end of it inside the box is a contact scale.


def linear_program(data: Data, solver: Callable[..., float | None], **settings: Any) -> Answer:
    """Solve for the least, then for the largest rho_2 at which the bodies meet; the first one in the box it is."""
    (P,), (Q,) = ([cloud - np.array(data[key]["seed"]) for cloud in _drawn(data[key])] for key in BODIES)
    T = np.array(data["transform"])
    P = P @ T[:3, :3].T
    d = np.array(data["two"]["seed"]) - (T[:3, :3] @ data["one"]["seed"] + T[:3, 3])
    A = np.vstack([np.hstack([P.T, -Q.T]), np.repeat([1.0, 0.0], [len(P), len(Q)])])
    b = np.append(d, data["rho"][0])
    low, high = data["box"][1]
    for sign in (1.0, -1.0):
        least = solver(A, b, sign * np.repeat([0.0, 1.0], [len(P), len(Q)]), **settings)
        if least is None:
            return {"rho2": None}
        if low * (1 - WRONG_BEYOND) <= sign * least <= high * (1 + WRONG_BEYOND):
            return {"rho2": sign * least}
    return {"rho2": None}


def highs(A: Array, b: Array, c: Array, **settings: Any) -> float | None:
    """Minimise c.x by HiGHS; None where it is infeasible, -inf where it has no end."""
    import highspy

    solver = highs_solver(**settings)
    # a warning: coefficients were too small or too large for it
    if solver.passModel(highs_model(dense(A), c, (b, b))) != highspy.HighsStatus.kOk:
        raise NoAnswerError("HiGHS does not take the model as it is")
    solver.run()
    status, known = solver.getModelStatus(), highspy.HighsModelStatus
    if status == known.kInfeasible:
        return None
    if status in (known.kUnbounded, known.kUnboundedOrInfeasible):
        return -np.inf
    if status != known.kOptimal:
        raise NoAnswerError(solver.modelStatusToString(status))
    return float(solver.getInfo().objective_function_value)


def clarabel(A: Array, b: Array, c: Array) -> float | None:
    """Minimise c.x by Clarabel."""
    library: Any = import_module("clarabel")
    from scipy import sparse

    rows, columns = A.shape
    settings = library.DefaultSettings()
    settings.verbose = False
    solver = library.DefaultSolver(
        sparse.csc_matrix((columns, columns)), c, sparse.csc_matrix(np.vstack([A, -np.eye(columns)])),
        np.append(b, np.zeros(columns)), [library.ZeroConeT(rows), library.NonnegativeConeT(columns)], settings,
    )  # fmt: skip
    solution = solver.solve()
    status = str(solution.status)
    if status == "PrimalInfeasible":
        return None
    if status == "DualInfeasible":
        return -np.inf
    if status != "Solved":
        raise NoAnswerError(status)
    return float(solution.obj_val)


def ipopt(A: Array, b: Array, c: Array) -> float | None:
    """Minimise c.x by IPOPT through CasADi."""
    import casadi

    x = casadi.SX.sym("x", A.shape[1])
    options: dict[str, Any] = {
        "ipopt.print_level": 0,
        "ipopt.sb": "yes",
        "ipopt.max_iter": MOST_STEPS,
        "print_time": False,
    }
    solver = casadi.nlpsol(
        "contact", "ipopt", {"x": x, "f": casadi.dot(casadi.DM(c), x), "g": casadi.DM(A) @ x}, options
    )
    found = solver(x0=1.0 / A.shape[1], lbx=0.0, lbg=b, ubg=b)
    status = solver.stats()["return_status"]
    if status == "Infeasible_Problem_Detected":
        return None
    if status == "Diverging_Iterates":
        return -np.inf
    if status != "Solve_Succeeded":
        raise NoAnswerError(status)
    return float(found["f"])


# ---------------------------------------------------------------------------------------------------------------- table

TIGHT = DEFAULT.judge_gjk
METHODS: dict[str, Callable[[Data], Answer]] = {
    "decision_curve": decision_curve,
    "decision_curves": decision_curves,
    "exact path": exact_path,
    "coal distance": coal_distance,
    "coal distance 1e-12": partial(coal_distance, tolerance=TIGHT),
    "coal distance 1e-12, unit size": partial(coal_distance, tolerance=TIGHT, normalised=True),
    "coal collide": coal_collide,
    "coal collide 1e-12": partial(coal_collide, tolerance=TIGHT),
    "coal bisection": coal_bisection,
    "coal bisection 1e-12": partial(coal_bisection, tolerance=TIGHT),
    "manifold3d gap": manifold_gap,
    "manifold3d intersection": manifold_boolean,
    "MuJoCo distance": mujoco_distance,
    "Drake distance": drake_distance,
    "HiGHS": partial(linear_program, solver=highs),
    "HiGHS 1e-10": partial(linear_program, solver=highs, tolerance=1e-10),
    "Clarabel": partial(linear_program, solver=clarabel),
    "CasADi IPOPT": partial(linear_program, solver=ipopt),
}
OURS = ("decision_curve", "decision_curves", "exact path")
PROGRAMS = ("HiGHS", "HiGHS 1e-10", "Clarabel", "CasADi IPOPT")
