"""Round faces that end at flats: shafts with one or two, in their bores, and pegs in slots, by closed forms."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

import fcdm_opt as fo
from fcdm_opt.geometry.patches import nearest_on_faces, true_faces
from fcdm_opt.geometry.true_distance import FacesApart, PoseDerivatives
from fcdm_opt.judge.true_faces import gap_of_true_faces

BORE, FLAT_OF_BORE, SHAFT, FLAT = 6.0, 5.05, 5.99, 5.0
HALF = math.sqrt(SHAFT**2 - FLAT**2)  # width of the flat of the shaft
SLOT, PEG, HALF_SLOT, HALF_PEG = 4.0, 3.98, 4.01, 4.0


def flatted(radius: float, flat: float, low: float, high: float, *, flats: int) -> fo.Body:
    """A cylinder about z with a flat that faces +x, or another one that faces -x too."""
    sides = [fo.Box((20, 40, 80), centre=(side * (flat + 10), 0, 20)) for side in (1, -1)[:flats]]
    return fo.cut(fo.Cylinder(radius, high - low, base=(0, 0, low)), *sides, name="shaft")


def rounded_at_ends(radius: float, half: float, low: float, high: float) -> fo.Body:
    ends = (fo.Cylinder(radius, high - low, base=(x, 0, low)) for x in (-half, half))
    middle = fo.Box((2 * half, 2 * radius, high - low), centre=(0, 0, (low + high) / 2))
    return fo.joined(middle, *ends, name="peg")


def around(core: fo.Body) -> fo.Body:
    return fo.cut(fo.Cylinder(16, 16, base=(0, 0, 12)), core, name="hub")


@cache
def parts(kind: str) -> tuple[fo.Body, fo.Body]:
    """The shaft, or peg, and its hub."""
    if kind == "slot":
        return rounded_at_ends(PEG, HALF_PEG, 0, 40), around(rounded_at_ends(SLOT, HALF_SLOT, 11, 29))
    flats = {"D": 1, "two flats": 2}[kind]
    core = flatted(BORE, FLAT_OF_BORE, 11, 29, flats=flats)
    return flatted(SHAFT, FLAT, 0, 40, flats=flats), around(core)


def shifted(body: fo.Body, shift) -> fo.Body:
    return body.moved(pose(shift))


def pose(shift) -> np.ndarray:
    found = np.eye(4)
    found[: len(shift), 3] = shift
    return found


def to_circle(point: tuple[float, float], u: np.ndarray, radius: float, centre: tuple[float, float] = (0, 0)) -> float:
    """Return how far a point within a circle goes along a unit vector until it is on it."""
    off = np.subtract(point, centre)
    return float(-off @ u + math.sqrt((off @ u) ** 2 + radius**2 - off @ off))


@pytest.mark.parametrize("off", [-0.0053, -0.0119, -0.012, -0.042])
def test_the_edge_of_a_flat_is_as_near_its_bore_as_it_is_to_the_circle(off: float) -> None:
    """Beyond the flat of a bore nothing was told of its edge; the judge took points where the shaft's round ends."""
    faces = [true_faces(body) for body in parts("D")[::-1]]
    truth = BORE - math.hypot(FLAT - off, HALF)
    assert nearest_on_faces(faces, (1.0, 1.0), pose([off]), 0.1)[0].gap == pytest.approx(truth, abs=1e-12)
    assert gap_of_true_faces(faces, (1.0, 1.0), pose([off]), 0.1) == pytest.approx(truth, abs=1e-12)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("kind", "at", "angle", "moves"),
    [
        ("D", (0, 0), 0.0, "hub"),
        ("D", (0.00376, 0.00495), 180.0, "shaft"),
        ("D", (0.00177, 0.00138), 0.0, "hub"),
        ("D", (0.0, 0.0), 20.0, "shaft"),
        ("two flats", (0.00293, -0.00387), 0.0, "shaft"),
        ("two flats", (0.001, 0.002), 180.0, "hub"),
        ("two flats", (0.0, 0.003), 75.0, "shaft"),
        ("slot", (0.00382, 0.00152), 90.0, "shaft"),
        ("slot", (0.0, -0.003), 28.0, "hub"),
    ],
)
def test_a_flatted_shaft_touches_its_bore(kind: str, at: tuple[float, float], angle: float, moves: str) -> None:
    """Edges of flats reach the cylinder, what is round of the shaft does where it is, and flats reach flats."""
    u = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
    if kind == "slot":
        ends = ((at[0] + HALF_PEG, at[1], HALF_SLOT), (at[0] - HALF_PEG, at[1], -HALF_SLOT))
        met = [(to_circle((x, y), u, SLOT - PEG, (centre, 0)), x, y, centre) for x, y, centre in ends]
        far = [s for s, x, y, centre in met if abs(x + s * u[0]) >= abs(centre)]  # else it is in the straight part
        far += [(SLOT - PEG - math.copysign(at[1], at[1] * u[1])) / abs(u[1])]
    else:
        flats = (1, -1)[: 1 if kind == "D" else 2]
        edges = [(at[0] + x * FLAT, at[1] + y * HALF) for x in flats for y in (1, -1)]
        far = [to_circle(edge, u, BORE) for edge in edges]
        far += [(FLAT_OF_BORE - FLAT - side * at[0]) / (side * u[0]) for side in flats if side * u[0] > 1e-9]
        s = to_circle(at, u, BORE - SHAFT)
        met = (np.add(at, s * u) / (BORE - SHAFT)).tolist()
        far += [s] if all(side * SHAFT * met[0] <= FLAT for side in flats) else []
    shaft, hub = parts(kind)
    movable, static, sign = (
        (shifted(shaft, at), hub, 1) if moves == "shaft" else (shifted(hub, np.negative(at)), shaft, -1)
    )
    motion = fo.Translation((*(sign * u), 0.0))
    asked = fo.Problem(movable, static, target=(1, 1), goal="touch", motion=motion, limits={"T": (0, 1)})
    solution = fo.solve(asked)
    assert solution.usable
    assert solution.amount == pytest.approx(min(far), abs=1e-9)
    assert solution.amount_low == pytest.approx(min(far), rel=2e-3)
    assert not solution.doubt


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("clearance", "off"), [(0.0, -0.012), (0.008, -0.005), (0.004, -0.02)])
@pytest.mark.parametrize("flats", [1, 2])
def test_a_hub_is_cleared_of_the_edge_of_a_flat(clearance: float, off: float, flats: int) -> None:
    """It was moved 300 times as far, or no motion was found to leave the clearance that the middle has."""
    shaft, hub = parts("D" if flats == 1 else "two flats")
    asked = fo.Problem(shifted(hub, [off]), shaft, target=(1, 1), goal="clear", motion=fo.Translation("x"))
    solution = fo.solve(asked.changed(clearance=clearance))
    truth = -off - (math.sqrt((BORE - clearance) ** 2 - HALF**2) - FLAT)
    assert solution.usable
    assert solution.parameters["TX"] == pytest.approx(truth, abs=1e-9)
    assert solution.amount_low == pytest.approx(truth, rel=1e-3)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("limits", [(-1.2, 0.0), (0.0, 1.2)])
@pytest.mark.parametrize("first", ["pin", "plate"])
def test_what_limits_leave_is_seen_from_either_part(limits: tuple[float, float], first: str) -> None:
    """A pin with a play of 1 in its bore: of a plate that moves to one side alone 1.1 was shown."""
    plate = fo.cut(fo.Box((14, 14, 4), centre=(0, 0, 2)), fo.Cylinder(6.0, 10, base=(0, 0, -2), facets=16))
    bodies = {"pin": fo.Cylinder(5.0, 6, base=(0, 0, -1), facets=16), "plate": plate}
    faces = [true_faces(bodies[first]), *(true_faces(own) for name, own in bodies.items() if name != first)]
    along = np.zeros((1, 3, 4))
    along[0, 0, 3] = 1.0
    rates = PoseDerivatives(along, np.zeros((1, 1, 3, 4)), np.array([limits]))
    assert FacesApart(faces, 20_000).least_amount(rates, 1.2, 1.1) <= 1.0
    assert FacesApart(faces).least_amount(rates, 1.01, 0.999) == 0.999


def test_a_ball_over_an_end_between_a_chord_and_the_rim_touched_the_rim_alone() -> None:
    """Facets of 16 end .96 short of the rim; the ball stands over the end there, .5 above it."""
    end = fo.Cylinder(50.0, 10.0, base=(0, 0, -10), facets=16)
    at = 49.7 * np.array([math.cos(math.pi / 16), math.sin(math.pi / 16)])
    ball = shifted(fo.Sphere(2.0, facets=16), [*at, 2.5])
    found = nearest_on_faces([true_faces(ball), true_faces(end)], (1.0, 1.0), np.eye(4), 1.0)
    assert min((own.gap for own in found), default=np.inf) == pytest.approx(0.5, abs=1e-12)


def test_a_pin_in_the_wall_of_a_blind_bore_was_taken_to_stand_beside_its_floor() -> None:
    """It is .02 in the wall, .005 above the floor: this ends at the wall, whatever its facets fall short by."""
    block = fo.cut(fo.Box((30, 30, 30)), fo.Cylinder(6.0, 20.0, facets=16), name="block")
    pin = fo.Cylinder(5.9, 4.0, base=(0, 0, 0.005), facets=24)
    angle = 0.1
    shift = 0.12 * np.array([math.cos(angle), math.sin(angle)])
    tilted = pose([*shift, 0.0])
    tilted[:3, :3] = [[math.cos(1e-3), 0, -math.sin(1e-3)], [0, 1, 0], [math.sin(1e-3), 0, math.cos(1e-3)]]
    faces = [true_faces(pin), true_faces(block)]
    judged = gap_of_true_faces(faces, (1.0, 1.0), tilted, 0.1)
    assert judged < -0.015
    assert nearest_on_faces(faces, (1.0, 1.0), tilted, 0.1)[0].gap == pytest.approx(judged, abs=1e-7)
