"""Motions: numbers against CasADi, closed forms, finite differences at zero, names, words and bad input."""

from __future__ import annotations

import math
import pickle
from concurrent.futures import ThreadPoolExecutor

import casadi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import generators

from fcdm_opt.errors import InputError
from fcdm_opt.motion.instructions import interpreted
from fcdm_opt.motion.kinematics import CHUNK
from fcdm_opt.motion.motions import AXES, Free, Motion, Rotation, Screw, Translation
from fcdm_opt.motion.own_motion import OwnMotion


def helix(q):
    """Two units along z, and as many radians about it."""
    T, c, s = casadi.SX.eye(4), casadi.cos(2 * q[0]), casadi.sin(2 * q[0])
    T[0, 0], T[0, 1], T[1, 0], T[1, 1], T[2, 3] = c, -s, s, c, 2 * q[0]
    return T


S1, S2 = np.array([0.3, -0.7, 0.2]), np.array([2.1, 0.4, -1.3])
LINE = ((1.0, 2.0, 3.0), (2.0, -1.0, 2.0))
MOTIONS: dict[str, Motion] = {
    "translation": Translation("y"),
    "translation along a vector": Translation((1, 2, -2)),
    "rotation about the seed": Rotation("z"),
    "rotation about the origin": Rotation("-x", "origin"),
    "rotation about a point": Rotation((1, 1, 1), (4, 5, 6)),
    "screw": Screw(),
    "screw with a pitch": Screw("seeds", 0.7),
    "screw without pitch": Screw("seeds", 0.0),
    "screw of infinite pitch": Screw("seeds", math.inf),
    "screw about a line": Screw(LINE, -2.0),
    "free screw about a line": Screw(LINE),
    "translation, then rotation": Translation("z") >> Rotation("z", "origin"),
    "rotation, then translation": Rotation("z", "origin") >> Translation("x"),
    "translation, then screw": Translation("x") >> Screw("seeds", 57.3) >> Rotation("y"),
    "free": Free(),
    "free after a rotation": Rotation("y", "origin") >> Free(),
    "of one's own": OwnMotion(lambda q: helix(q), [("way", "translation")], "helix"),
    "of one's own, then a rotation": OwnMotion(lambda q: helix(q), [("way", "translation")], "helix") >> Rotation("y"),
}
motions = pytest.mark.parametrize("name", MOTIONS)


def symbolic(motion: Motion) -> casadi.Function:
    q, s1, s2 = (casadi.SX.sym(name, count) for name, count in (("q", len(motion.parameters)), ("s1", 3), ("s2", 3)))
    T = motion.symbolic(q, s1, s2)
    return casadi.Function("T", [q, s1, s2], [T, casadi.jacobian(casadi.vec(T), q)], ["q", "s1", "s2"], ["T", "J"])


def about(point, direction, angle, along=0.0) -> np.ndarray:
    """Turn and shift along a line, from the exponential series of the skew matrix: a way of its own."""
    u = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    twist = np.zeros((4, 4))
    twist[:3, :3] = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]]) * angle
    twist[:3, 3] = -twist[:3, :3] @ point + along * u
    T, term = np.eye(4), np.eye(4)
    for k in range(1, 60):
        term = term @ twist / k
        T = T + term
    return T


@motions
def test_zero_parameters_are_the_identity(name):
    motion = MOTIONS[name]
    T = motion.transform(np.zeros(len(motion.parameters)), S1, S2)
    np.testing.assert_allclose(T, np.eye(4), atol=1e-15)


@motions
def test_transforms_are_rigid_and_casadi_agrees(name):
    motion, rng = MOTIONS[name], np.random.default_rng(7)
    function = symbolic(motion)
    for _ in range(20):
        q = rng.uniform(-3, 3, len(motion.parameters))
        s1, s2 = rng.normal(size=(2, 3))
        T = motion.transform(q, s1, s2)
        np.testing.assert_allclose(T[:3, :3] @ T[:3, :3].T, np.eye(3), atol=1e-14)
        assert np.linalg.det(T[:3, :3]) == pytest.approx(1, abs=1e-14)
        np.testing.assert_array_equal(T[3], [0, 0, 0, 1])
        np.testing.assert_allclose(function(q, s1, s2)[0].full(), T, atol=1e-13 * max(1, np.abs(T).max()))


@motions
def test_value_and_derivative_at_zero_are_finite_and_match_differences(name):
    motion = MOTIONS[name]
    count = len(motion.parameters)
    T, J = (part.full() for part in symbolic(motion)(np.zeros(count), S1, S2))
    np.testing.assert_allclose(T, np.eye(4), atol=1e-15)
    assert np.isfinite(J).all()
    step = 1e-5
    for k, unit in enumerate(np.eye(count)):
        slope = (motion.transform(step * unit, S1, S2) - motion.transform(-step * unit, S1, S2)) / (2 * step)
        np.testing.assert_allclose(J[:, k].reshape(4, 4, order="F"), slope, atol=1e-7 * max(1, np.abs(slope).max()))
        assert np.abs(slope).max() > 0.1


@motions
def test_second_derivatives_at_zero_are_finite(name):
    motion = MOTIONS[name]
    q = casadi.SX.sym("q", len(motion.parameters))
    second = casadi.jacobian(casadi.jacobian(casadi.vec(motion.symbolic(q, S1, S2)), q), q)
    assert np.isfinite(casadi.Function("second", [q], [second])(np.zeros(q.shape[0])).full()).all()


@motions
def test_compiled_motions_agree_with_plain_ones_and_their_rates_with_differences(name):
    motion, rng = MOTIONS[name], np.random.default_rng(3)
    kinematics, count = motion.kinematics(S1, S2), len(motion.parameters)
    assert motion.kinematics(S1, S2) is kinematics
    Q = rng.uniform(-3, 3, (CHUNK + 3, count)) * 10.0 ** rng.uniform(-9, 0, (CHUNK + 3, 1))
    expected = np.array([motion.transform(q, S1, S2) for q in Q])
    scale = np.abs(expected).max()
    np.testing.assert_allclose(kinematics.transforms(Q), expected, atol=1e-15 * scale)
    for q, T in zip(Q[:5], expected, strict=False):
        pose, rates = kinematics.rates(q)
        np.testing.assert_allclose([kinematics.transform(q), pose], [T, T], atol=1e-15 * scale)
        for unit, rate in zip(np.eye(count), rates, strict=True):
            slope = motion.transform(q + 1e-5 * unit, S1, S2) - motion.transform(q - 1e-5 * unit, S1, S2)
            np.testing.assert_allclose(rate, slope / 2e-5, atol=1e-7 * max(1, np.abs(rate).max()))
    kept, _ = kinematics.transform(Q[0]), kinematics.transform(Q[1])
    np.testing.assert_allclose(kept, expected[0], atol=1e-15 * scale)  # later calls leave it


@motions
def test_motions_that_differ_in_numbers_alone_share_what_is_compiled(name):
    """Axes, centres and pitches are arguments: of the same motion seen from elsewhere too."""
    motion, rng = MOTIONS[name], np.random.default_rng(8)
    other = motion.with_numbers((motion.numbers + 0.1 * rng.normal(size=len(motion.numbers))).tolist())
    assert other.pattern == motion.pattern
    assert hash(other.pattern) == hash(motion.pattern)
    np.testing.assert_array_equal(motion.with_numbers(motion.numbers.tolist()).numbers, motion.numbers)
    q = rng.uniform(-1, 1, len(motion.parameters))
    for own in (motion, other, motion):
        expected = own.transform(q, S1, S2)
        np.testing.assert_allclose(own.kinematics(S1, S2).transform(q), expected, atol=1e-15 * np.abs(expected).max())


def test_patterns_keep_apart_what_numbers_do_not_tell():
    steps = [Translation("x"), Rotation("x"), Rotation("x", "origin"), Rotation("x", (0.0, 0.0, 0.0)), Free()]
    steps += [Screw(axis, pitch) for axis in ("seeds", ((0, 0, 0), (1, 0, 0))) for pitch in (1.0, "free", math.inf)]
    assert len({step.pattern for step in steps}) == len(steps)
    assert Screw("seeds", -math.inf).pattern != Screw("seeds", math.inf).pattern
    assert Rotation("x").pattern == Rotation((1.0, 2.0, 3.0)).pattern


@motions
def test_motions_survive_a_way_through_pickle(name):
    motion = MOTIONS[name]
    q = np.full(len(motion.parameters), 0.3)
    T = motion.kinematics(S1, S2).transform(q)
    again = pickle.loads(pickle.dumps(motion))
    assert again == motion
    assert hash(again) == hash(motion)
    np.testing.assert_array_equal(again.transform(q, S1, S2), motion.transform(q, S1, S2))
    np.testing.assert_array_equal(again.kinematics(S1, S2).transform(q), T)


def test_compiled_motions_serve_several_threads():
    motion = Free()
    kinematics = motion.kinematics(S1, S2)
    Q = np.random.default_rng(1).uniform(-2, 2, (400, 6))
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(kinematics.transform, Q))
    np.testing.assert_array_equal(found, kinematics.transforms(Q))


def test_free_is_a_turn_by_a_rotation_vector_about_the_seed_and_a_shift():
    rng = np.random.default_rng(5)
    for size in (0.0, 1e-12, 1e-6, 0.1, 0.999, 1.0, 1.001, 3.0, 2 * math.pi, 20.0):
        shift, axis = rng.normal(size=(2, 3))
        vector = size * axis / np.linalg.norm(axis)
        T = Free().transform([*shift, *vector], S1, S2)
        expected = about(S1, axis, size) if size < 7 else about(S1, axis, size - 6 * math.pi)
        expected[:3, 3] += shift
        np.testing.assert_allclose(T, expected, atol=2e-14 * max(1.0, size))


def test_free_bounds_what_it_displaces():
    rng = np.random.default_rng(6)
    points = rng.normal(size=(20, 3))
    reaches = Free().reaches(points, S1)
    turned = (Rotation("x") >> Free()).reaches(points, S1)
    for _ in range(50):
        q = rng.uniform(-2, 2, 7)
        T, U = Free().transform(q[1:], S1, S2), (Rotation("x") >> Free()).transform(q, S1, S2)
        for M, bound in ((T, reaches @ np.abs(q[1:])), (U, turned @ np.abs(q))):
            assert np.linalg.norm(points @ M[:3, :3].T + M[:3, 3] - points, axis=1).max() <= bound


def test_motions_that_only_shift_are_known():
    line = ((0, 0, 0), (1, 2, 3))
    assert (Translation("x") >> Screw(line, math.inf)).shifts
    assert (Screw("seeds", math.inf) >> Translation("x")).shifts
    assert not (Translation("x") >> Screw("seeds", math.inf)).shifts  # its line has changed
    for motion in (Rotation("x"), Free(), Screw(), Screw("seeds", 0.0), MOTIONS["of one's own"]):
        assert not motion.shifts


class Own(float):
    """A scalar of another kind: functions are methods."""

    def sin(self):
        return math.sin(self)

    def cos(self):
        return math.cos(self)


def test_functions_serve_scalars_of_any_kind():
    q = casadi.SX.sym("q")
    function = casadi.Function("helix", [q], [casadi.densify(helix(q))])
    column = interpreted(function, [Own(0.25)])
    expected = MOTIONS["of one's own"].transform([0.25], S1, S2)
    np.testing.assert_allclose([float(x) for x in column], expected.ravel(order="F"), atol=1e-15)
    with pytest.raises(NotImplementedError):
        interpreted(casadi.Function("floor", [q], [casadi.floor(q)]), [Own(0.25)])


def moving(q):
    T = casadi.SX.eye(4)
    T[0, 3] = q[0]
    return T


@pytest.mark.parametrize(
    ("function", "parameters", "found"),
    [
        (3, [("t", "translation")], "not a function"),
        (lambda q: casadi.SX.eye(3), [("t", "translation")], r"SX \(3, 3\)"),
        (lambda q: 2 * casadi.SX.eye(4), [("t", "translation")], "not the identity at zero"),
        (
            lambda q: moving(q) + casadi.diag(casadi.vertcat(q, 0, 0, 0)),
            [("t", "translation")],
            "not a rigid motion at t",
        ),
        (lambda q: moving(q + 1), [("t", "translation")], "not the identity at zero"),
        (lambda q: moving(q * casadi.SX.sym("other")), [("t", "translation")], "found 'other'"),
        (lambda q: moving(casadi.sqrt(q * q * q)), [("t", "translation")], "derivative at zero"),
        (lambda q: 1 / 0, [("t", "translation")], "ZeroDivisionError"),
        (lambda q: q[5], [("t", "translation")], "fails on 1 CasADi symbols"),
        (moving, [], "unusable parameters"),
        (moving, 3, "unusable parameters"),
        (moving, [("t", "length")], "unusable parameters"),
        (moving, [("t", "translation"), ("t", "rotation")], "unusable parameters"),
    ],
)
def test_bad_own_motions_are_refused(function, parameters, found):
    with pytest.raises(InputError, match=found):
        OwnMotion(function, parameters)


def test_own_motions_that_differ_are_not_the_same():
    one, same, other = (OwnMotion(f, [("t", "translation")]) for f in (moving, moving, lambda q: moving(2 * q)))
    assert one == same
    assert one != other
    with pytest.raises(InputError, match="not the text of a CasADi function"):
        OwnMotion.from_text("text", [("t", "translation")], "name")


@given(generators, st.sampled_from(sorted(AXES)))
def test_rotation_in_closed_form_about_each_centre(rng, axis):
    angle = rng.uniform(-4, 4)
    point = tuple(rng.normal(size=3))
    for centre, through in (("seed", S1), ("origin", np.zeros(3)), (point, point)):
        T = Rotation(axis, centre).transform([angle], S1, S2)
        np.testing.assert_allclose(T, about(through, AXES[axis], angle), atol=1e-12)


def test_quarter_turns_follow_the_right_hand():
    for axis, start, end in (("x", "y", "z"), ("y", "z", "x"), ("z", "x", "y"), ("-z", "y", "x")):
        T = Rotation(axis, "origin").transform([math.pi / 2], S1, S2)
        np.testing.assert_allclose(T[:3, :3] @ AXES[start], AXES[end], atol=1e-15)


def test_half_turn_about_x_through_a_centre_mirrors_y_and_z_there():
    c = np.array([5.0, -2.0, 0.5])
    T = Rotation("x", tuple(c)).transform([math.pi], S1, S2)
    np.testing.assert_allclose(T[:3, :3], np.diag([1, -1, -1]), atol=1e-15)
    np.testing.assert_allclose(T[:3, 3], [0, 2 * c[1], 2 * c[2]], atol=1e-14)


def test_translation_goes_its_length_along_the_direction_whatever_its_norm():
    T = Translation((0, 3, 4)).transform([10.0], S1, S2)
    np.testing.assert_allclose(T, [[1, 0, 0, 0], [0, 1, 0, 6], [0, 0, 1, 8], [0, 0, 0, 1]], atol=1e-15)
    np.testing.assert_array_equal(Translation("-y").transform([2.0], S1, S2)[:3, 3], [0, -2, 0])


def test_screw_along_the_seeds_turns_about_and_shifts_along_their_line():
    d = S2 - S1
    T = Screw().transform([0.4, 1.1], S1, S2)
    np.testing.assert_allclose(T, about(S1, d, 1.1, 0.4), atol=1e-13)
    np.testing.assert_allclose(T[:3, :3] @ S1 + T[:3, 3], S1 + 0.4 * d / np.linalg.norm(d), atol=1e-14)
    np.testing.assert_allclose(T[:3, :3] @ S2 + T[:3, 3], S2 + 0.4 * d / np.linalg.norm(d), atol=1e-14)


@pytest.mark.parametrize("axis", ["seeds", LINE])
def test_screws_of_zero_infinite_and_other_pitch_are_special_cases_of_the_free_one(axis):
    free = Screw(axis)
    for pitch, expected in ((0.0, [0.0, 0.6]), (2.5, [1.5, 0.6]), (-2.5, [-1.5, 0.6]), (math.inf, [0.6, 0.0]),
                            (-math.inf, [-0.6, 0.0])):  # fmt: skip
        np.testing.assert_allclose(
            Screw(axis, pitch).transform([0.6], S1, S2), free.transform(expected, S1, S2), atol=1e-15
        )


def test_screw_about_a_line_in_closed_form():
    point, direction = LINE
    np.testing.assert_allclose(
        Screw(LINE, 0.5).transform([1.3], S1, S2), about(point, direction, 1.3, 0.65), atol=1e-12
    )


def test_screw_of_the_paper_has_a_pitch_of_one_length_a_degree():
    T = Screw("seeds", 180 / math.pi).transform([math.radians(-0.0054)], S1, S2)
    shift = (T[:3, :3] @ S1 + T[:3, 3] - S1) @ (S2 - S1) / np.linalg.norm(S2 - S1)
    assert shift == pytest.approx(-0.0054, rel=1e-12)


def test_steps_act_one_after_the_other_in_the_world_frame():
    first, second = Translation("x"), Rotation("z", "origin")
    A, B = first.transform([2.0], S1, S2), second.transform([0.5], S1, S2)
    np.testing.assert_allclose((first >> second).transform([2.0, 0.5], S1, S2), B @ A, atol=1e-15)
    np.testing.assert_allclose((second >> first).transform([0.5, 2.0], S1, S2), A @ B, atol=1e-15)
    assert np.abs(A @ B - B @ A).max() > 0.5


def test_centre_seed_is_the_seed_as_already_moved():
    T, moved = (Translation("x") >> Rotation("z")).transform([2.0, 0.5], S1, S2), S1 + np.array([2, 0, 0])
    expected = about(moved, (0, 0, 1), 0.5) @ Translation("x").transform([2.0], S1, S2)
    np.testing.assert_allclose(T, expected, atol=1e-14)
    np.testing.assert_allclose(T[:3, :3] @ S1 + T[:3, 3], moved, atol=1e-15)


def test_screw_axis_runs_from_the_seed_as_already_moved():
    T = (Translation("y") >> Screw("seeds", 0.3)).transform([1.5, 0.8], S1, S2)
    start = S1 + np.array([0, 1.5, 0])
    expected = about(start, S2 - start, 0.8, 0.24) @ Translation("y").transform([1.5], S1, S2)
    np.testing.assert_allclose(T, expected, atol=1e-13)


def test_sequences_associate_and_keep_their_steps():
    a, b, c = Translation("x"), Rotation("y"), Screw("seeds", 1.0)
    assert ((a >> b) >> c).steps == (a >> (b >> c)).steps == (a, b, c)
    q = [0.3, 0.4, 0.5]
    np.testing.assert_array_equal(((a >> b) >> c).transform(q, S1, S2), (a >> (b >> c)).transform(q, S1, S2))


def test_parameters_are_named_by_kind_and_axis_and_repeats_are_numbered():
    motion = Translation("x") >> Rotation("x") >> Translation("x") >> Rotation("-z", "origin") >> Translation("x")
    assert [tuple(p) for p in motion.parameters] == [
        ("TX", "translation"), ("RX", "rotation"), ("TX_2", "translation"), ("R-Z", "rotation"), ("TX_3", "translation")
    ]  # fmt: skip
    kinds = [[p.kind for p in Screw("seeds", pitch).parameters] for pitch in ("free", 1.0, math.inf)]
    assert kinds == [["translation", "rotation"], ["rotation"], ["translation"]]
    double = Screw() >> Screw()
    assert len({p.name for p in double.parameters}) == 4


def test_names_stay_apart_where_a_numbered_name_could_be_an_axis_of_its_own():
    motion = Translation((1, 0, 0)) >> Translation((0, 1, 0)) >> Rotation((1, 1, 0)) >> Rotation((0, 1, 1))
    assert len({p.name for p in motion.parameters}) == 4


def test_weights_turn_radians_into_lengths():
    np.testing.assert_array_equal((Translation("x") >> Rotation("x")).weights(3.0), [1, 3])
    np.testing.assert_array_equal(Screw().weights(3.0), [1, 3])
    np.testing.assert_array_equal(Screw("seeds", 4.0).weights(3.0), [5])
    np.testing.assert_array_equal(Screw("seeds", 0.0).weights(3.0), [3])
    np.testing.assert_array_equal(Screw("seeds", -math.inf).weights(3.0), [1])


def test_describe_gives_lengths_and_degrees():
    motion = Translation("z") >> Rotation("z", "origin")
    assert motion.describe([0.25, math.radians(7.0191)]) == "TZ 0.25 + RZ 7.0191 deg"
    assert Screw("seeds", 180 / math.pi).describe([math.radians(-0.0054)]) == "Screw -0.0054, -0.0054 deg"
    assert Translation("y").describe([-0.0193]) == "TY -0.0193"


@pytest.mark.parametrize("gap", [0.0, 1e-15])
def test_coincident_seeds_define_no_screw_axis(gap):
    with pytest.raises(InputError, match="coincide"):
        Screw("seeds", 1.0).transform([0.1], S1, S1 + np.array([gap, 0, 0]))


def test_seeds_that_coincide_at_the_origin_define_no_screw_axis():
    with pytest.raises(InputError, match="coincide"):
        Screw("seeds", 1.0).transform([0.1], np.zeros(3), np.zeros(3))


def test_a_step_that_brings_the_seed_onto_the_other_leaves_no_screw_axis():
    motion = Translation(tuple(S2 - S1)) >> Screw()
    with pytest.raises(InputError, match="coincide"):
        motion.transform([float(np.linalg.norm(S2 - S1)), 0.1, 0.1], S1, S2)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Translation("w"), "unknown axis"),
        (lambda: Translation((0, 0, 0)), "zero"),
        (lambda: Translation((1, 0)), "three"),
        (lambda: Translation((1, 0, math.nan)), "finite"),
        (lambda: Translation((1, 0, math.inf)), "finite"),
        (lambda: Translation(3.0), "three numbers"),
        (lambda: Rotation("Z"), "unknown axis"),
        (lambda: Rotation("z", "centroid"), "unknown centre"),
        (lambda: Rotation("z", (1, 2)), "three"),
        (lambda: Rotation("z", (1, 2, math.nan)), "finite"),
        (lambda: Screw("z", 0.5), r"a screw is about a line.*\(body.seed, \(0.0, 0.0, 1.0\)\)"),
        (lambda: Screw((1, 2, 3)), "line"),
        (lambda: Screw(((0, 0, 0), (0, 0, 0))), "zero"),
        (lambda: Screw("seeds", "loose"), "unknown pitch"),
        (lambda: Screw("seeds", math.nan), "not a number"),
    ],
)
def test_bad_motions_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize("q", [[], [1.0], [1.0, 2.0, 3.0]])
def test_the_number_of_parameters_must_fit(q):
    with pytest.raises(InputError, match="number of motion parameters"):
        (Translation("z") >> Rotation("z")).transform(q, S1, S2)
