"""CasADi functions as texts: what is read gives the same numbers, and what names native code is never loaded."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import casadi
import numpy as np
import pytest
from typer.testing import CliRunner

import fcdm_opt as fo
from fcdm_opt.cli import app
from fcdm_opt.errors import InputError
from fcdm_opt.motion.function_text import ONE, TWO, function_of, text_of
from fcdm_opt.motion.own_motion import OwnMotion
from fcdm_opt.problem.amounts import OwnAmount

X, Y = casadi.SX.sym("x"), casadi.SX.sym("y")
Q = casadi.SX.sym("q", 2)

# a shift of 0.3 sin(q_0) along x, as CasADi 3.7.0 wrote it
OLD = Path(__file__).with_name("casadi_3_7_function.txt")

SOURCE = """
#include <stdio.h>
__attribute__((constructor)) static void mark(void){ FILE* f = fopen("%s", "w"); if (f) fclose(f); }
typedef long long int I; static const I s[] = {1,1,0,1,0};
I f_n_in(void){return 1;} I f_n_out(void){return 1;} const I* f_sparsity_in(I i){return s;}
const I* f_sparsity_out(I i){return s;} int f_work(I*a,I*b,I*c,I*d){*a=1;*b=1;*c=0;*d=0;return 0;}
int f(const double** a,double** r,I* iw,double* w,int m){r[0][0]=a[0][0]*a[0][0];return 0;}
"""

PROBLEM = """
[bodies.movable]
vertices = [[0,0,0],[1,1,2],[1,-1,2],[-1,1,2],[-1,-1,2]]
[bodies.static]
vertices = [[-3,-3,-1],[-3,-3,0],[-3,3,-1],[-3,3,0],[3,-3,-1],[3,-3,0],[3,3,-1],[3,3,0]]
[[case]]
name = "a"
target = [1.02, 0.98]
goal = "touch"
motion = [{motion}]
amount = {amount}
"""


def applied(name):
    """An expression of one operation; those that CasADi writes in another way come out so."""
    code = getattr(casadi, f"OP_{name}")
    return casadi.SX.unary(code, Q[0]) if name in ONE else casadi.SX.binary(code, Q[0], Q[1])


@pytest.mark.parametrize("write", [text_of, casadi.Function.serialize], ids=["own", "CasADi's"])
@pytest.mark.parametrize("name", sorted(ONE + TWO))
def test_every_operation_reads_back_to_the_same_numbers(name, write):
    function = casadi.Function("f", [Q], [casadi.densify(applied(name) + Q[1] / 7)])
    read = function_of(write(function))
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (40, 2))
    np.testing.assert_array_equal([read(p).full() for p in points], [function(p).full() for p in points])


def test_matrices_constants_and_shared_expressions_read_back():
    turn = casadi.SX.eye(4)
    turn[0, 0] = turn[1, 1] = casadi.cos(Q[0])
    turn[0, 3], turn[1, 3], turn[2, 3] = np.inf, 1e300 * casadi.cos(Q[0]), -1
    for made in (turn, casadi.densify(turn)):
        function = casadi.Function("turn", [Q], [made])
        assert function_of(function.serialize()).serialize() == function.serialize()
    dense = casadi.Function("turn", [Q], [casadi.densify(turn)])
    assert text_of(function_of(text_of(dense))) == text_of(dense)
    np.testing.assert_array_equal(function_of(text_of(dense))([0.3, 0]).full(), dense([0.3, 0]).full())


def test_text_of_an_older_casadi_reads():
    T = np.eye(4)
    T[0, 3] = 0.3 * np.sin(0.5)
    np.testing.assert_array_equal(function_of(OLD.read_text().strip())([0.5, 0.0]).full(), T)


def others():
    """Functions that are no list of operations on numbers."""
    mx = casadi.MX.sym("x")
    square, double = casadi.Function("a", [X], [X * X]), casadi.Function("b", [X], [2 * X])
    slope = casadi.Function("jac_d", [X, Y], [2 * X])
    apart = {"never_inline": True}
    inner = casadi.Function("m", [mx], [mx**2], apart)
    return {
        "MX": casadi.Function("m", [mx], [mx**2]),
        "call": casadi.Function("c", [X], [inner(X)]),
        "map": square.map(3),
        "switch": casadi.Function.conditional("s", [square], double),
        "interpolant": casadi.interpolant("i", "linear", [[0, 1, 2]], [0, 1, 4]),
        "root": casadi.rootfinder("r", "newton", {"x": X, "g": X * X - 2}),
        "integrator": casadi.integrator("o", "rk", {"x": X, "ode": -X}),
        "derivative": casadi.Function("d", [X], [X * X], {"custom_jacobian": slope}),
        "options": casadi.Function("d", [X], [X * X], {"forward_options": {"verbose": False}}),
    }


@pytest.mark.parametrize("name", sorted(others()))
def test_what_is_more_than_operations_on_numbers_is_refused_unread(name, monkeypatch):
    text = others()[name].serialize()
    monkeypatch.setattr(casadi.Function, "deserialize", None)  # nobody may ask it
    with pytest.raises(ValueError, match=r"."):
        function_of(text)
    with pytest.raises(InputError, match="not the text of a CasADi function"):
        OwnAmount.from_text(text, ["TX"])
    with pytest.raises(InputError, match="not the text of a CasADi function"):
        OwnMotion.from_text(text, [("TX", "translation")], "own")


def broken():
    good = casadi.Function("f", [Q], [casadi.sin(Q[0]) + Q[1]])
    theirs, ours = good.serialize(), text_of(good)
    compiled = theirs.replace(written("source"), written("linked"))
    assert compiled != theirs
    flat = [theirs[:k] for k in range(0, len(theirs), 14)] + [theirs + "aa", "z" + theirs[1:], compiled]
    rows = json.loads(ours)
    changed = [
        [*rows[:1], 10**9, *rows[2:]],
        [*rows[:2], [10**6, 10**6], *rows[3:]],
        [*rows[:3], [*rows[3], ["CALL", 0, 0]]],
        [*rows[:3], [*rows[3], ["SIN", 0, 99]]],
        [*rows[:3], [*rows[3], ["SIN"]]],
        [*rows[:3], [["OUTPUT", 0, 0]]],
        [*rows[:3], [[None]]],
        [*rows[:3], 5],
        rows[:2],
        [],
    ]
    return [*flat, *map(json.dumps, changed), "[" * 100_000, "", good.serialize({"debug": True})]


def written(text: str) -> str:
    """A text within a text of CasADi's."""
    return "".join(chr(97 + (byte & 15)) + chr(97 + (byte >> 4)) for byte in text.encode())


def test_texts_cut_off_or_changed_are_refused():
    for text in broken():
        with pytest.raises(ValueError, match=r"."):
            function_of(text)


def test_text_of_any_bytes_is_refused_or_gives_a_function():
    """Whatever single byte is changed: an error that says so, or a function of numbers."""
    text = casadi.Function("f", [Q], [casadi.sin(Q[0]) + Q[1]]).serialize()
    rng = np.random.default_rng(0)
    for place in rng.integers(0, len(text) // 2, 400):
        other = "".join(chr(97 + k) for k in rng.integers(0, 16, 2))
        try:
            read = function_of(text[: 2 * place] + other + text[2 * place + 2 :])
        except ValueError:
            continue
        assert read.class_name() == "SXFunction"


@pytest.mark.skipif(not (shutil.which("cc") and sys.platform == "linux"), reason="no compiler to make a library with")
def test_no_library_is_loaded_that_a_problem_file_or_a_solution_names(tmp_path):
    """A library whose loading leaves a mark: named by the text of an amount, of a motion, and of a stored solution."""
    mark, library = tmp_path / "mark", tmp_path / "e.so"
    (tmp_path / "e.c").write_text(SOURCE % mark)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, tmp_path / "e.c"], check=True)
    made = f"import casadi; print(casadi.external('f', {str(library)!r}).serialize())"
    text = subprocess.run([sys.executable, "-c", made], capture_output=True, text=True, check=True).stdout.strip()
    assert mark.exists()
    mark.unlink()
    plain = '{ translation = "z" }'
    own = f'{{ casadi = {json.dumps(text)}, parameters = [["TZ", "translation"]] }}'
    for motion, amount in ((plain, f"{{ casadi = {json.dumps(text)} }}"), (own, '"weighted"')):
        file = tmp_path / "p.toml"
        file.write_text(PROBLEM.format(motion=motion, amount=amount))
        result = CliRunner().invoke(app, ["solve", str(file)])
        assert result.exit_code == 2, result.stderr
        assert "not the text of a CasADi function" in result.stderr
        assert "External" in result.stderr
        assert "internal" not in result.stderr
        with pytest.raises(InputError, match="External"):
            fo.load_problems(file)
    file.write_text(PROBLEM.format(motion=plain, amount='"weighted"'))
    stored = fo.solve(fo.load_problems(file)[0]).to_dict()
    stored["problem"]["case"][0]["amount"] = {"casadi": text}
    with pytest.raises(InputError, match="External"):
        fo.Solution.from_dict(stored)
    assert not mark.exists()
