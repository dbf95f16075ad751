"""Steps of compiled code on vectors of three numbers each."""

from fcdm_opt.compiling import step


@step
def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@step
def _cross(u, v):
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@step
def _minus(u, v):
    return u[0] - v[0], u[1] - v[1], u[2] - v[2]


@step
def _plus(u, s, v):
    """Return u + s v."""
    return u[0] + s * v[0], u[1] + s * v[1], u[2] + s * v[2]
