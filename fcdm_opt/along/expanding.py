"""Kernels that carry expansions (see `expansions`) through a motion's operations and into conditions on a contact."""

from __future__ import annotations

import numpy as np

from fcdm_opt.along.operations import (
    ADD,
    ATAN,
    CONST,
    COS,
    DIV,
    EXP,
    INPUT,
    INV,
    MUL,
    NEG,
    OUTPUT,
    SIN,
    SQ,
    SQRT,
    SUB,
    TAN,
    TANH,
    TWICE,
)  # fmt: skip
from fcdm_opt.compiling import kernel

TURNED, FIXED, CROSSED = 0.0, 1.0, 2.0  # normal of a tracked feature: of a face of body 1, of body 2, of two edges
# forms of a condition: y along a direction fixed, turned with body 1, or the cross product of either with normal k; y
# along normal k; a point of body 1 or 2 along normal k; the determinant; det rho_1, det rho_2; the normal's square
ALONG, ALONG_TURNED, BESIDE, BESIDE_TURNED, NORMAL, OWN, OTHER, DETERMINANT, SCALE_1, SCALE_2, STEEP = range(11)
_ATAN_BEND, _TANH_BEND = 0.65, 0.77  # the most that their second derivatives reach


# ------------------------------------------------------------------------------------------ arithmetic of expansions


@kernel
def _row(A, k):
    return A[k, 0], A[k, 1], A[k, 2], A[k, 3]


@kernel
def _put(A, k, f):
    A[k, 0], A[k, 1], A[k, 2], A[k, 3] = f


@kernel
def _plus(f, g):
    return f[0] + g[0], f[1] + g[1], f[2] + g[2], f[3] + g[3] + np.abs(f[0] + g[0])


@kernel
def _less(f, g):
    return f[0] - g[0], f[1] - g[1], f[2] + g[2], f[3] + g[3] + np.abs(f[0] - g[0])


@kernel
def _by(s, f):
    return s * f[0], s * f[1], np.abs(s) * f[2], np.abs(s) * (f[3] + 2.0 * np.abs(f[0]))


@kernel
def _most(f, h):
    """Return bounds of |f| and |f'| on the span."""
    return np.abs(f[0]) + h * (np.abs(f[1]) + 0.5 * h * f[2]), np.abs(f[1]) + h * f[2]


@kernel
def _product(f, g, h):
    a, b = _most(f, h)
    c, d = _most(g, h)
    x, y = np.abs(f[0]), np.abs(g[0])
    return f[0] * g[0], f[0] * g[1] + f[1] * g[0], a * g[2] + 2.0 * b * d + f[2] * c, x * y + x * g[3] + y * f[3]


@kernel
def _composed(f, h, value, slope, steepest, bend):
    """Return a function of f with given value and slope at f(x0), and bounds of its derivatives on the span."""
    rate = _most(f, h)[1]
    return value, slope * f[1], steepest * f[2] + bend * rate * rate, np.abs(value) + np.abs(slope) * f[3]


@kernel
def _inverse(f, h):
    least = np.abs(f[0]) - h * (np.abs(f[1]) + 0.5 * h * f[2])
    bound = 1.0 / least if least > 0.0 else np.inf
    return _composed(f, h, 1.0 / f[0], -1.0 / (f[0] * f[0]), bound * bound, 2.0 * bound * bound * bound)


@kernel
def _root(f, h):
    least = f[0] - h * (np.abs(f[1]) + 0.5 * h * f[2])
    bound = 1.0 / np.sqrt(least) if least > 0.0 else np.inf
    value = np.sqrt(f[0])
    return _composed(f, h, value, 0.5 / value, 0.5 * bound, 0.25 * bound * bound * bound)


@kernel
def _played(codes, constants, slots, inputs, h):
    """Return expansions of what a tape gives, (12, 4)."""
    work, out = np.zeros((slots, 4)), np.zeros((12, 4))
    for k in range(len(codes)):
        code, place, i, j = codes[k]
        if code == INPUT:
            _put(work, place, _row(inputs, i))
            continue
        if code == CONST:
            _put(work, place, (constants[k], 0.0, 0.0, np.abs(constants[k])))
            continue
        f = _row(work, i)
        if code == OUTPUT:
            _put(out, place, f)
            continue
        if code == ADD:
            f = _plus(f, _row(work, j))
        elif code == SUB:
            f = _less(f, _row(work, j))
        elif code == MUL:
            f = _product(f, _row(work, j), h)
        elif code == SQ:
            f = _product(f, f, h)
        elif code == NEG:
            f = _by(-1.0, f)
        elif code == TWICE:
            f = _by(2.0, f)
        elif code == DIV:
            f = _product(f, _inverse(_row(work, j), h), h)
        elif code == INV:
            f = _inverse(f, h)
        elif code == SQRT:
            f = _root(f, h)
        elif code == SIN:
            f = _composed(f, h, np.sin(f[0]), np.cos(f[0]), 1.0, 1.0)
        elif code == COS:
            f = _composed(f, h, np.cos(f[0]), -np.sin(f[0]), 1.0, 1.0)
        elif code == TAN:
            sine = _composed(f, h, np.sin(f[0]), np.cos(f[0]), 1.0, 1.0)
            f = _product(sine, _inverse(_composed(f, h, np.cos(f[0]), -np.sin(f[0]), 1.0, 1.0), h), h)
        elif code == EXP:
            most = np.exp(f[0] + h * (np.abs(f[1]) + 0.5 * h * f[2]))
            f = _composed(f, h, np.exp(f[0]), np.exp(f[0]), most, most)
        elif code == ATAN:
            f = _composed(f, h, np.arctan(f[0]), 1.0 / (1.0 + f[0] * f[0]), 1.0, _ATAN_BEND)
        elif code == TANH:
            f = _composed(f, h, np.tanh(f[0]), 1.0 - np.tanh(f[0]) ** 2, 1.0, _TANH_BEND)
        _put(work, place, f)
    return out


# -------------------------------------------------------------------------------------------------------- conditions


@kernel
def _dot3(A, i, B, j, h):
    f = _product(_row(A, i), _row(B, j), h)
    f = _plus(f, _product(_row(A, i + 1), _row(B, j + 1), h))
    return _plus(f, _product(_row(A, i + 2), _row(B, j + 2), h))


@kernel
def _fixed(A, i, u, j):
    """Return the product of an expanded vector with a fixed one."""
    return _plus(_plus(_by(u[j], _row(A, i)), _by(u[j + 1], _row(A, i + 1))), _by(u[j + 2], _row(A, i + 2)))


@kernel
def _turn(pose, u, j, out):
    """Fill `out` with R u."""
    for i in range(3):
        _put(out, i, _fixed(pose, 3 * i, u, j))


@kernel
def _cross3(A, i, B, j, out, k, h):
    for c in range(3):
        p, q = (c + 1) % 3, (c + 2) % 3
        forth, back = _product(_row(A, i + p), _row(B, j + q), h), _product(_row(A, i + q), _row(B, j + p), h)
        _put(out, k + c, _less(forth, back))


@kernel
def _constant(u, j, out):
    for c in range(3):
        _put(out, c, (u[j + c], 0.0, 0.0, np.abs(u[j + c])))


@kernel
def _line(pose, line, normals, k, h):
    """Fill normal k of a tracked feature; return its a, b and c."""
    first, other = np.empty((3, 4)), np.empty((3, 4))
    if line[0] == TURNED:
        _turn(pose, line, 1, first)
        normals[3 * k : 3 * k + 3] = first
        level = line[1] * line[7] + line[2] * line[8] + line[3] * line[9]
        one = level, 0.0, 0.0, np.abs(level)
    else:
        if line[0] == FIXED:
            _constant(line, 4, first)
            normals[3 * k : 3 * k + 3] = first
        else:
            _turn(pose, line, 1, first)
            _constant(line, 4, other)
            _cross3(first, 0, other, 0, normals, 3 * k, h)
        _turn(pose, line, 7, first)
        one = _dot3(normals, 3 * k, first, 0, h)
    return one, _by(-1.0, _fixed(normals, 3 * k, line, 10)), _dot3(normals, 3 * k, pose, 9, h)


@kernel
def _minor(f, g, p, q, h):
    return _less(_product(f, g, h), _product(p, q, h))


@kernel
def expand(codes, constants, slots, inputs, h, lines, pair, sign, forms, rows):
    """Return expansions of conditions (n, 4) and of R and d (12, 4) over a span h, and the scale pair."""
    pose = _played(codes, constants, slots, inputs, h)
    normals = np.zeros((6, 4))
    one, zero = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)
    det, num1, num2 = one, _by(pair[0], one), _by(pair[1], one)
    if len(lines) > 0:
        a, b, c = _line(pose, lines[0], normals, 0, h)
        if len(lines) == 1:
            det = _plus(_product(a, a, h), _product(b, b, h))
            off = _less(_less(c, _by(pair[0], a)), _by(pair[1], b))
            num1 = _plus(_by(pair[0], det), _product(off, a, h))
            num2 = _plus(_by(pair[1], det), _product(off, b, h))
        else:
            d, e, f = _line(pose, lines[1], normals, 1, h)
            det = _by(sign, _minor(a, e, b, d, h))
            num1, num2 = _by(sign, _minor(c, e, b, f, h)), _by(sign, _minor(a, f, c, d, h))
    found = np.empty((len(rows), 4))
    y, way, first = np.empty((3, 4)), np.empty((3, 4)), np.empty((3, 4))
    shift = np.empty((3, 4))
    for i in range(3):
        _put(shift, i, _product(det, _row(pose, 9 + i), h))
    for r in range(len(rows)):
        row, form, k = rows[r], forms[r, 0], forms[r, 1]
        value = zero
        if form <= NORMAL:
            _turn(pose, row, 0, first)
            for i in range(3):
                ahead = _plus(_row(shift, i), _by(row[3 + i], num2))
                _put(y, i, _less(ahead, _product(num1, _row(first, i), h)))
            if form == ALONG:
                value = _fixed(y, 0, row, 6)
            elif form == ALONG_TURNED:
                _turn(pose, row, 6, way)
                value = _dot3(y, 0, way, 0, h)
            elif form == NORMAL:
                value = _dot3(y, 0, normals, 3 * k, h)
            else:
                if form == BESIDE:
                    _constant(row, 6, first)
                else:
                    _turn(pose, row, 6, first)
                _cross3(first, 0, normals, 3 * k, way, 0, h)
                value = _dot3(y, 0, way, 0, h)
        elif form == OWN:
            _turn(pose, row, 0, first)
            value = _dot3(normals, 3 * k, first, 0, h)
        elif form == OTHER:
            value = _fixed(normals, 3 * k, row, 3)
        elif form == DETERMINANT:
            value = det
        elif form == SCALE_1:
            value = num1
        elif form == SCALE_2:
            value = num2
        elif form == STEEP:
            value = _dot3(normals, 3 * k, normals, 3 * k, h)
        value = _by(row[9], value)
        if row[10] != 0.0 or row[11] != 0.0:
            value = _less(value, _plus(_by(row[10], num1), _by(row[11], num2)))
        _put(found, r, value)
    return found, pose, np.array([num1[0] / det[0], num2[0] / det[0]])
