"""One craft's extremals, from the end of the game back to its start, with their variational
equations: compiled.

An extremal takes its craft as far along `nu` as possible by the time of the end. There its costate
is (nu, 0), and backward in time it is the same flow for pursuer and evader: thrust along p_v, where
p is the costate of the pursuer and minus the costate of the evader. Near the end p_v / |p_v| is nu,
and the flow is smooth up to the end.

Wang's slides, "Optimal control", with k = +1 for the pursuer and -1 for the evader: u = k lambda_v
/ |lambda_v|, lambda_r' = (mu / r^3) lambda_v - 3 mu (lambda_v . r) r / r^5 (they omit '. r'),
lambda_v' = -lambda_r; p = k lambda. That of the mass, lambda_m' = k |lambda_v| T / m^2 (they omit
k), is not needed: both thrust fully all the time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._compile import allocation_free, compiled
from infoset.rendezvous.dormand_prince import STAGES, error_of_step, step_of

STATES, COLUMNS = 12, 9
"""Position, velocity and costate; what they are differentiated by: end state (6), nu in its plane
(2), end mass.
"""
_SAFETY, _MIN_FACTOR, _MAX_FACTOR = 0.9, 0.2, 6.0
_MAX_STEPS = 20_000
_FIRST_STEP = 0.05
NO_VARIATIONS = np.zeros((0, COLUMNS))
_Parameters = tuple[Floats, Floats, Floats]


class Response(NamedTuple):
    """Linear dependence of an end state at a guess of it: rho + by_nu dnu + by_time dT leads to the
    true one.

    `rho`, shape (6,), is Newton's correction of the guess; `by_nu`, shape (6, 2), and `by_time`,
    shape (6,), are the derivatives along two directions across nu and by the duration. `regular`
    says that there is no conjugate point: the map from end states near by to start states preserves
    orientation. `inverse`, shape (6, 6), is the inverse of the derivative of the start state by the
    end state, `costate`, shape (6,), p_r and p_v at the start, and `residual` the maximum component
    of the error of the start state: infinite if the guess cannot be propagated, or the map is
    singular.
    """

    rho: Floats
    by_nu: Floats
    by_time: Floats
    regular: bool
    inverse: Floats
    costate: Floats
    residual: float


@allocation_free
def derivatives(
    r: Floats,
    p: Floats,
    mu: float,
    oblateness: float,
    g: Floats,
    first: Floats,
    second: Floats,
    with_second: bool,
) -> None:
    """Put the acceleration, its gradient (3, 3) and, if wanted, the gradient of gradient times `p`
    (3, 3) into arrays.

    `oblateness` is mu J2 R^2 / 2, the axis z: the potential is mu/r + oblateness (1/r^3 - 3
    z^2/r^5). For a function f of q = r . r the gradient is 2 f' r, its gradient 4 f'' r r^T + 2 f'
    I, and along p 8 f''' s r r^T + 4 f'' (r p^T + p r^T + s I) with s = r . p. The oblate part is a
    power of q, less z^2 times one.
    """
    q = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    s = r[0] * p[0] + r[1] * p[1] + r[2] * p[2]
    inverse = 1.0 / q
    f = mu * np.sqrt(inverse)
    f1 = -0.5 * f * inverse
    f2 = -1.5 * f1 * inverse
    f4 = -2.5 * f2 * inverse
    if oblateness != 0.0:
        f3 = oblateness * inverse * np.sqrt(inverse)
        f1 -= 1.5 * f3 * inverse
        f2 += 3.75 * f3 * inverse * inverse
        f4 -= 13.125 * f3 * inverse * inverse * inverse
    for i in range(3):
        g[i] = 2.0 * f1 * r[i]
        for j in range(3):
            first[i, j] = 4.0 * f2 * r[i] * r[j]
        first[i, i] += 2.0 * f1
    if with_second:
        for i in range(3):
            for j in range(3):
                second[i, j] = 8.0 * f4 * s * r[i] * r[j] + 4.0 * f2 * (r[i] * p[j] + p[i] * r[j])
            second[i, i] += 4.0 * f2 * s
    if oblateness != 0.0:
        _subtract_axial(r, p, s, q, oblateness, g, first, second)


@allocation_free
def _subtract_axial(
    r: Floats,
    p: Floats,
    s: float,
    q: float,
    oblateness: float,
    g: Floats,
    first: Floats,
    second: Floats,
) -> None:
    """Subtract the derivatives of z^2 f, f = 3 oblateness q^(-5/2)."""
    z = r[2]
    square = r[2] * r[2]
    f = 3.0 * oblateness / (q * q * np.sqrt(q))
    f1 = -2.5 * f / q
    f2 = 8.75 * f / (q * q)
    f4 = -39.375 * f / (q * q * q)
    along = 2.0 * f1 * s
    for i in range(3):
        g[i] -= square * 2.0 * f1 * r[i]
        for j in range(3):
            plain = 4.0 * f2 * r[i] * r[j]
            turned = 8.0 * f4 * s * r[i] * r[j] + 4.0 * f2 * (r[i] * p[j] + p[i] * r[j])
            if i == j:
                plain += 2.0 * f1
                turned += 4.0 * f2 * s
            first[i, j] -= square * plain
            second[i, j] -= square * turned + 2.0 * z * p[2] * plain
    g[2] -= 2.0 * z * f
    first[2, 2] -= 2.0 * f
    second[2, 2] -= 2.0 * along
    for i in range(3):
        toward = 2.0 * f1 * r[i]
        turned = 4.0 * f2 * s * r[i] + 2.0 * f1 * p[i]
        first[2, i] -= 2.0 * z * toward
        first[i, 2] -= 2.0 * z * toward
        second[2, i] -= 2.0 * z * turned + 2.0 * p[2] * toward
        second[i, 2] -= 2.0 * z * turned + 2.0 * p[2] * toward


@allocation_free
def _rates(s: float, y: Floats, z: Floats, parameters: _Parameters, dy: Floats, dz: Floats) -> None:
    """Rates, in time to go, of the state and of its variations.

    `parameters` are the craft (mu, oblateness, thrust, mass at the end, flow) and room for two
    matrices, (3, 3). At the end of the game p_v is zero: there the direction of thrust is that of
    p_r, which is its rate.
    """
    craft, first, second = parameters
    thrust = craft[2]
    mass = craft[3] + craft[4] * s
    push = thrust / mass
    derivatives(y[:3], y[9:], craft[0], craft[1], dy[3:6], first, second, len(z) > 0)
    at = 9 if s > 0.0 else 6
    x0 = y[at]
    x1 = y[at + 1]
    x2 = y[at + 2]
    inverse = 1.0 / np.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    u0 = x0 * inverse
    u1 = x1 * inverse
    u2 = x2 * inverse
    for i in range(3):
        dy[i] = -y[3 + i]
        dy[6 + i] = first[i, 0] * y[9] + first[i, 1] * y[10] + first[i, 2] * y[11]
        dy[9 + i] = y[6 + i]
    dy[3] = -dy[3] - push * u0
    dy[4] = -dy[4] - push * u1
    dy[5] = -dy[5] - push * u2
    if len(z) == 0:
        return
    turn = push * inverse
    g00 = first[0, 0]
    g01 = first[0, 1]
    g02 = first[0, 2]
    g11 = first[1, 1]
    g12 = first[1, 2]
    g22 = first[2, 2]
    m00 = second[0, 0]
    m01 = second[0, 1]
    m02 = second[0, 2]
    m11 = second[1, 1]
    m12 = second[1, 2]
    m22 = second[2, 2]
    for j in range(COLUMNS):
        r0 = z[0, j]
        r1 = z[1, j]
        r2 = z[2, j]
        q0 = z[9, j]
        q1 = z[10, j]
        q2 = z[11, j]
        t0 = z[at, j]
        t1 = z[at + 1, j]
        t2 = z[at + 2, j]
        along = u0 * t0 + u1 * t1 + u2 * t2
        dz[0, j] = -z[3, j]
        dz[1, j] = -z[4, j]
        dz[2, j] = -z[5, j]
        dz[3, j] = -(g00 * r0 + g01 * r1 + g02 * r2 + turn * (t0 - along * u0))
        dz[4, j] = -(g01 * r0 + g11 * r1 + g12 * r2 + turn * (t1 - along * u1))
        dz[5, j] = -(g02 * r0 + g12 * r1 + g22 * r2 + turn * (t2 - along * u2))
        dz[6, j] = g00 * q0 + g01 * q1 + g02 * q2 + m00 * r0 + m01 * r1 + m02 * r2
        dz[7, j] = g01 * q0 + g11 * q1 + g12 * q2 + m01 * r0 + m11 * r1 + m12 * r2
        dz[8, j] = g02 * q0 + g12 * q1 + g22 * q2 + m02 * r0 + m12 * r1 + m22 * r2
        dz[9, j] = z[6, j]
        dz[10, j] = z[7, j]
        dz[11, j] = z[8, j]
    fall = push / mass
    dz[3, COLUMNS - 1] += fall * u0
    dz[4, COLUMNS - 1] += fall * u1
    dz[5, COLUMNS - 1] += fall * u2


_step = step_of(_rates)


@compiled
def flow_back(
    y: Floats, z: Floats, craft: Floats, begin: float, end: float, tolerance: float
) -> bool:
    """Integrate a state and its variations from time to go `begin` to `end`, in place; either may
    be the greater.

    `y`, shape (12,), is (position, velocity, p_r, p_v), and `z`, shape (12, 9), contains its
    derivatives; one of no rows (`NO_VARIATIONS`) integrates y alone. `craft`, shape (5,), is (mu,
    oblateness, thrust, mass at the end of the game, mass flow). Returns False where the steps are
    too many or too small, or a number overflows.

    The `tolerance` of a step's error, relative and absolute, applies to y alone. A step costs 12
    stages of some 0.3 us, or 0.1 us for y alone.
    """
    if begin == end:
        return True
    ky = np.empty((STAGES, STATES))
    kz = np.empty((STAGES, len(z), COLUMNS))
    y_next = np.empty_like(y)
    z_next = np.empty_like(z)
    parameters = craft, np.empty((3, 3)), np.empty((3, 3))
    span = abs(end - begin)
    sign = 1.0 if end > begin else -1.0
    s = begin
    step = min(_FIRST_STEP, span)
    first = 0
    for _ in range(_MAX_STEPS):
        left = abs(end - s)
        last = step >= left * (1.0 - 1e-12)
        h = sign * (left if last else step)
        _step(s, h, first, y, z, parameters, ky, kz, y_next, z_next)
        error = error_of_step(y, y_next, ky, tolerance, abs(h))
        if not error < np.inf:
            return False
        first = 1
        if error < 1.0:
            for i in range(STATES):
                y[i] = y_next[i]
            for i in range(len(z)):
                for j in range(COLUMNS):
                    z[i, j] = z_next[i, j]
            if last:
                return True
            s += h
            first = 0
        factor = _MAX_FACTOR if error < 1e-10 else _SAFETY * error**-0.125
        step = abs(h) * min(max(factor, _MIN_FACTOR), _MAX_FACTOR)
        if step < 1e-13 * max(span, 1e-3):
            return False
    return False


def end_of(state: Floats, nu: Floats) -> Floats:
    """Return state and costate at the end of an extremal, shape (12,)."""
    return np.concatenate([state, nu, np.zeros(3)])


@compiled
def rate(y: Floats, mu: float, oblateness: float, push: float) -> Floats:
    """Return the time derivative of position and velocity, shape (6,), at a state and costate,
    shape (12,).

    `push` is the acceleration of the thrust.
    """
    out = np.empty(6)
    gradient = np.empty((3, 3))
    unused = np.zeros((3, 3))
    derivatives(y[:3], y[9:], mu, oblateness, out[3:], gradient, unused, False)
    size = np.sqrt(y[9] * y[9] + y[10] * y[10] + y[11] * y[11])
    for i in range(3):
        out[i] = y[3 + i]
        if size > 0.0:
            out[3 + i] += push * y[9 + i] / size
    return out


@compiled
def respond(
    start: Floats,
    craft: Floats,
    end_state: Floats,
    nu: Floats,
    plane: Floats,
    duration: float,
    tolerance: float,
) -> Response:
    """Return the response of one side at a guess of its end state; `plane`, shape (2, 3), are the
    directions across nu.

    `start`, shape (6,), is the state at the start of the game, and `craft` that of `flow_back`.
    """
    y = np.zeros(STATES)
    z = np.zeros((STATES, COLUMNS))
    for i in range(6):
        y[i] = end_state[i]
        z[i, i] = 1.0
    for i in range(3):
        y[6 + i] = nu[i]
        z[6 + i, 6] = plane[0, i]
        z[6 + i, 7] = plane[1, i]
    is_propagated = flow_back(y, z, craft, 0.0, duration, tolerance)

    by_end = z[:6, :6].copy()
    inverse = np.zeros((6, 6))
    determinant = invert(by_end, inverse) if is_propagated else 0.0
    # A longer game starts further back, and ends with less mass.
    later = rate(y, craft[0], craft[1], craft[2] / (craft[3] + craft[4] * duration))
    rho = np.zeros(6)
    by_nu = np.zeros((6, 2))
    by_time = np.zeros(6)
    for i in range(6):
        for j in range(6):
            rho[i] += inverse[i, j] * (start[j] - y[j])
            by_nu[i, 0] -= inverse[i, j] * z[j, 6]
            by_nu[i, 1] -= inverse[i, j] * z[j, 7]
            by_time[i] += inverse[i, j] * (later[j] + craft[4] * z[j, 8])
    residual = np.abs(start - y[:6]).max() if determinant != 0.0 else np.inf
    return Response(rho, by_nu, by_time, determinant > 0.0, inverse, y[6:].copy(), residual)


@compiled
def invert(matrix: Floats, inverse: Floats) -> float:
    """Fill the inverse of a matrix, shape (n, n), and return its determinant; 0 if it is singular
    or not finite.

    Gauss and Jordan's elimination with partial pivoting; the matrix is overwritten.
    """
    count = len(matrix)
    determinant = 1.0
    for i in range(count):
        for j in range(count):
            inverse[i, j] = 1.0 if i == j else 0.0

    for column in range(count):
        pivot = column
        for i in range(column + 1, count):
            if abs(matrix[i, column]) > abs(matrix[pivot, column]):
                pivot = i
        size = matrix[pivot, column]
        if not 0.0 < abs(size) < np.inf:
            return 0.0
        determinant *= size if pivot == column else -size

        for j in range(count):
            matrix[column, j], matrix[pivot, j] = matrix[pivot, j], matrix[column, j]
            inverse[column, j], inverse[pivot, j] = inverse[pivot, j], inverse[column, j]
        for j in range(count):
            matrix[column, j] /= size
            inverse[column, j] /= size
        for i in range(count):
            factor = matrix[i, column]
            if i != column and factor != 0.0:
                for j in range(count):
                    matrix[i, j] -= factor * matrix[column, j]
                    inverse[i, j] -= factor * inverse[column, j]
    return determinant
