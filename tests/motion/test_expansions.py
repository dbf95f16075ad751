"""Numbers along a ray: what expansions promise, function by function, and the same conditions in balls."""

from __future__ import annotations

import casadi
import flint
import numpy as np
import pytest

from fcdm_opt.along import conditions as forms
from fcdm_opt.along.conditions import Conditions, Ray, TrackedPair
from fcdm_opt.along.expansions import ROUNDING, Expansion
from fcdm_opt.motion.instructions import SCALARS, Instructions
from fcdm_opt.motion.motions import Free, Rotation, Screw, Translation

FUNCTIONS = {
    "polynomial": lambda x: (x - 0.3) * (x + 1.7) - 2.0 * x * x,
    "quotient": lambda x: (1.0 + x) / (3.0 - x * x),
    "sqrt": lambda x: casadi.sqrt(2.5 + x),
    "waves": lambda x: casadi.sin(3.0 * x) * casadi.cos(x * x),
    "tan": lambda x: casadi.tan(0.5 * x),
    "exp": lambda x: casadi.exp(-x) + casadi.exp(x) / 3.0,
    "bounded": lambda x: casadi.tanh(2.0 * x) - casadi.atan(5.0 * x),
}
MOTIONS = {
    "turn": Rotation("z", (0.3, -0.2, 0.1)),
    "sequence": Translation("x") >> Rotation((1.0, 1.0, 1.0)) >> Rotation("y", "origin"),
    "screw": Screw("seeds", 0.5),
    "free": Free(),
}


def expanded(function, x: float, span: float) -> np.ndarray:
    """Return value, slope, bend and terms of a function of an expansion."""
    at = casadi.SX.sym("at", 2)
    fields = function(Expansion.variable(at[0], at[1])).fields
    return casadi.Function("expanded", [at], [casadi.vertcat(*fields)])([x, span]).full().ravel()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_a_function_stays_within_its_second_order_bound(name):
    symbol = casadi.SX.sym("x")
    exact = casadi.Function("f", [symbol], [FUNCTIONS[name](symbol)])
    instructions, rng = Instructions.of(exact), np.random.default_rng(5)
    bounded = 0
    for _ in range(30):
        x, span = float(rng.uniform(-1.0, 1.0)), float(10.0 ** rng.uniform(-4, 0))
        value, slope, bend, terms = expanded(lambda at: instructions.carried_out(SCALARS, [at])[0][0], x, span)
        assert value == pytest.approx(float(exact(x)), rel=1e-12, abs=1e-14)
        bounded += np.isfinite(bend)
        for step in rng.uniform(0.0, span, 8):
            off = float(exact(x + step)) - value - slope * step
            assert not abs(off) > 0.5 * bend * step**2 * (1.0 + 1e-9) + 8.0 * ROUNDING * (terms + 1.0)
    assert bounded > 20


def test_what_is_not_defined_is_not_bounded():
    undefined = [
        lambda x: 1.0 / (x - 1.0),  # passes a pole
        lambda x: (x - 1.0).sqrt(),
        lambda x: (x - 0.5).sqrt(),
        lambda x: 1.0 / (x - 0.5),
        lambda x: (1e3 * x).exp(),
    ]
    assert not any(np.isfinite(expanded(function, 0.5, 2.0)).all() for function in undefined)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("tracked", range(3))
def test_conditions_are_the_same_numbers_in_floats_and_in_balls(name, tracked):
    motion, rng = MOTIONS[name], np.random.default_rng([7, tracked])
    seeds = rng.normal(size=(2, 3))
    ray = Ray.of(motion, rng.normal(size=len(motion.parameters)), *seeds)
    lines = np.column_stack([rng.permutation([forms.TURNED, forms.FIXED, forms.CROSSED])[:tracked],
                             rng.normal(size=(tracked, 12))])  # fmt: skip
    pair = TrackedPair(lines, np.array([1.1, 0.9]), -1.0)
    kinds = [forms.ALONG, forms.ALONG_TURNED, forms.DETERMINANT, forms.SCALE_1, forms.SCALE_2]
    if tracked:
        kinds += [forms.ACROSS, forms.ACROSS_TURNED, forms.NORMAL, forms.OWN, forms.OTHER, forms.STEEP]
    some = [Conditions.of(kind, k, v=rng.normal(size=3), w=rng.normal(size=3), m=rng.normal(size=3), sign=-0.5)
            for kind in kinds for k in range(max(tracked, 1))
            if kind not in (forms.ACROSS, forms.ACROSS_TURNED) or lines[k, 0] == forms.CROSSED]  # fmt: skip
    some.append(Conditions.of(forms.ALONG, **dict(zip("vwm", rng.normal(size=(3, 3)), strict=True)), radii=(0.2, 0.3)))
    together = Conditions.joined(some)
    x, span = 0.37, 0.05
    found = ray.stretch(x, span, pair).expanded(together)
    ahead = ray.stretch(x + span, 0.0, pair).expanded(together)[:, 0]
    off = np.abs(ahead - found[:, 0] - found[:, 1] * span)
    assert (off <= 0.5 * found[:, 2] * span**2 + ROUNDING * found[:, 3]).all()
    for k, row in enumerate(found):
        exact = ray.exactly(flint.arb(x), pair, together.chosen([k]))
        assert float(exact) == pytest.approx(row[0], rel=1e-13, abs=ROUNDING * row[3])
