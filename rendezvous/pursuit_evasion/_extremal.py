"""Compiled extremals of one craft, from the end of the game back to its start, with variations.

An extremal takes its craft as far along `nu` as possible by the time of the end. There its costate
is (nu, 0), and backward in time it is the same flow for pursuer and evader: thrust along p_v, where
p is the costate of the pursuer and minus the costate of the evader. Near the end p_v / |p_v| is nu,
and the flow is smooth up to the end.

Wang's slides, "Optimal control", with k = +1 for the pursuer and -1 for the evader: u = k lambda_v
/ |lambda_v|, lambda_r' = (mu / r^3) lambda_v - 3 mu (lambda_v . r) r / r^5 (they omit '. r'),
lambda_v' = -lambda_r; p = k lambda. The costate of the mass, lambda_m' = k |lambda_v| T / m^2 (they
omit k), is not needed: both thrust fully all the time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous._compile import allocation_free, compiled, inlined
from infoset.rendezvous.dormand_prince import STAGES, error_of_step, step_of

R, V, P_R, P_V = 0, 3, 6, 9
"""First rows of position, velocity and both parts of the costate in a state and its variations."""
STATES = 12
"""Number of rows of a state: position, velocity and costate."""
COLUMNS = 9
"""Number of parameters of the variations: end state (6), nu in its plane (2), mass at the end."""
MASS = COLUMNS - 1
"""Column of the derivatives by the mass at the end."""
_SAFETY = 0.9
"""Share of the step that the error estimate allows: that of SciPy's and of Hairer's DOP853."""
_MIN_FACTOR = 0.2
"""Least ratio of a step to the one before: that of SciPy's DOP853."""
_MAX_FACTOR = 6.0
"""Largest ratio of a step to the one before: that of Hairer's DOP853 (SciPy has 10)."""
_MAX_STEPS = 20_000
"""The longest game takes about 2000, 20 a radian at `FINE`: more are needed only near the
centre.
"""
_FIRST_STEP = 0.05
"""Radians of a circular orbit: near the step that `FINE` allows."""
NO_VARIATIONS = np.zeros((0, COLUMNS))
"""Variations without rows: only the state is integrated."""
_Parameters = tuple[Floats, Floats, Floats]
_Vector = tuple[float, float, float]
_Symmetric = tuple[float, float, float, float, float, float]


class Response(NamedTuple):
    """Linear dependence of an end state on nu and the duration, at a guess of the end state.

    The guess plus rho + by_nu dnu + by_time dT is the end state of the extremal to first order.
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
    """Fill the acceleration `g`, its gradient `first` and, if wanted, the gradient of `first` @ p.

    `first` and `second` have shape (3, 3), and `with_second` asks for `second`; with oblateness it
    is written to in any case. `oblateness` is mu J2 R^2 / 2, the axis z: the potential is mu/r +
    oblateness (1/r^3 - 3 z^2/r^5). For a function f of q = r . r the gradient is 2 f' r, its
    gradient 4 f'' r r^T + 2 f' I, and along p 8 f''' s r r^T + 4 f'' (r p^T + p r^T + s I) with s =
    r . p. The oblate part is a power of q less z^2 times a power of q; `_subtract_axial` does the
    latter.
    """
    q = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
    s = r[0] * p[0] + r[1] * p[1] + r[2] * p[2]
    # The three derivatives of f = mu q^(-1/2) by q, and those of oblateness q^(-3/2).
    inverse = 1.0 / q
    f = mu * np.sqrt(inverse)
    f1 = -0.5 * f * inverse
    f2 = -1.5 * f1 * inverse
    f3 = -2.5 * f2 * inverse
    if oblateness != 0.0:
        oblate = oblateness * inverse * np.sqrt(inverse)
        f1 -= 1.5 * oblate * inverse
        f2 += 3.75 * oblate * inverse * inverse
        f3 -= 13.125 * oblate * inverse * inverse * inverse

    for i in range(3):
        g[i] = 2.0 * f1 * r[i]
        for j in range(3):
            first[i, j] = 4.0 * f2 * r[i] * r[j]
        first[i, i] += 2.0 * f1
    if with_second:
        for i in range(3):
            for j in range(3):
                second[i, j] = 8.0 * f3 * s * r[i] * r[j] + 4.0 * f2 * (r[i] * p[j] + p[i] * r[j])
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
    # With the three derivatives by q.
    f = 3.0 * oblateness / (q * q * np.sqrt(q))
    f1 = -2.5 * f / q
    f2 = 8.75 * f / (q * q)
    f3 = -39.375 * f / (q * q * q)
    along = 2.0 * f1 * s

    # The derivatives of f alone, times z^2.
    for i in range(3):
        g[i] -= square * 2.0 * f1 * r[i]
        for j in range(3):
            plain = 4.0 * f2 * r[i] * r[j]
            turned = 8.0 * f3 * s * r[i] * r[j] + 4.0 * f2 * (r[i] * p[j] + p[i] * r[j])
            if i == j:
                plain += 2.0 * f1
                turned += 4.0 * f2 * s
            first[i, j] -= square * plain
            second[i, j] -= square * turned + 2.0 * z * p[2] * plain

    # The derivatives of z^2, and of its products with those of f.
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
    """Fill the rates, in time to go, of the state and of its variations.

    r' = -v, v' = -(g + (T / m) u), p_r' = G p_v and p_v' = p_r, where g is the acceleration of
    gravity, G its gradient, u the direction of p_v and m the mass at the end + flow s. At the end
    of the game p_v is zero, and u is the direction of its rate, p_r, there and beyond (s <= 0).

    The variations follow, with K the gradient of G p_v: dr' = -dv, dv' = -(G dr + (T / m) du),
    dp_r' = G dp_v + K dr, dp_v' = dp_r. The last column also changes the mass by one.

    All values are nondimensional, with shapes as in `flow_back`: y and dy (12,), z and dz (12, 9),
    or (0, 9) without variations. `parameters` are the craft (mu, oblateness, thrust, mass at the
    end, flow) and working arrays for G and K, shape (3, 3).
    """
    craft, gradient, gradient_change = parameters
    thrust = craft[2]
    mass = craft[3] + craft[4] * s
    push = thrust / mass
    with_variations = len(z) > 0
    # The rows of v' hold g until the thrust is added.
    gravity = dy[V:P_R]
    derivatives(
        y[:V], y[P_V:], craft[0], craft[1], gravity, gradient, gradient_change, with_variations
    )

    u_row = P_V if s > 0.0 else P_R
    x0 = y[u_row]
    x1 = y[u_row + 1]
    x2 = y[u_row + 2]
    inverse = 1.0 / np.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    u = (x0 * inverse, x1 * inverse, x2 * inverse)
    for i in range(3):
        dy[R + i] = -y[V + i]
        dy[P_R + i] = (
            gradient[i, 0] * y[P_V] + gradient[i, 1] * y[P_V + 1] + gradient[i, 2] * y[P_V + 2]
        )
        dy[P_V + i] = y[P_R + i]
    for i in range(3):
        dy[V + i] = -dy[V + i] - push * u[i]

    if with_variations:
        _vary(z, u_row, u, push * inverse, gradient, gradient_change, dz)
        # dv' of the mass: the derivative of -(T / m) u by m.
        fall = push / mass
        for i in range(3):
            dz[V + i, MASS] += fall * u[i]


@allocation_free
def _vary(
    z: Floats,
    u_row: int,
    u: _Vector,
    turn: float,
    gradient: Floats,
    gradient_change: Floats,
    dz: Floats,
) -> None:
    """Fill the rates of the variations, see `_rates`, with the mass fixed.

    The variation of u, a unit vector along the vector x in rows `u_row` to `u_row` + 2, is du = (dx
    - (u . dx) u) / |x|, and `turn` is T / (m |x|).
    """
    g = _upper_triangle(gradient)
    k = _upper_triangle(gradient_change)
    for j in range(COLUMNS):
        dr = _vector_at(z, R, j)
        dp_v = _vector_at(z, P_V, j)
        dx = _vector_at(z, u_row, j)
        along = u[0] * dx[0] + u[1] * dx[1] + u[2] * dx[2]

        by_gravity = _product(g, dr)
        by_costate = _add_product(_product(g, dp_v), k, dr)
        for i in range(3):
            dz[R + i, j] = -z[V + i, j]
            dz[V + i, j] = -(by_gravity[i] + turn * (dx[i] - along * u[i]))
            dz[P_R + i, j] = by_costate[i]
            dz[P_V + i, j] = z[P_R + i, j]


@inlined
def _vector_at(z: Floats, row: int, column: int) -> _Vector:
    """Return three rows of a column, from `row` on."""
    return z[row, column], z[row + 1, column], z[row + 2, column]


@inlined
def _upper_triangle(matrix: Floats) -> _Symmetric:
    """Return the entries 00, 01, 02, 11, 12, 22 of a symmetric matrix."""
    return matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[1, 1], matrix[1, 2], matrix[2, 2]


@inlined
def _product(m: _Symmetric, x: _Vector) -> _Vector:
    """Return the product of a symmetric matrix, as its upper triangle, and a vector."""
    m00, m01, m02, m11, m12, m22 = m
    return (
        m00 * x[0] + m01 * x[1] + m02 * x[2],
        m01 * x[0] + m11 * x[1] + m12 * x[2],
        m02 * x[0] + m12 * x[1] + m22 * x[2],
    )


@inlined
def _add_product(start: _Vector, m: _Symmetric, x: _Vector) -> _Vector:
    """Return a vector plus a symmetric matrix, as its upper triangle, times a vector."""
    m00, m01, m02, m11, m12, m22 = m
    return (
        start[0] + m00 * x[0] + m01 * x[1] + m02 * x[2],
        start[1] + m01 * x[0] + m11 * x[1] + m12 * x[2],
        start[2] + m02 * x[0] + m12 * x[1] + m22 * x[2],
    )


_step = step_of(_rates)


@compiled
def flow_back(
    y: Floats, z: Floats, craft: Floats, begin: float, end: float, tolerance: float
) -> bool:
    """Integrate a state and its variations in place, from time to go `begin` to `end`.

    Either time may be the greater. `y`, shape (12,), is (position, velocity, p_r, p_v), and `z`,
    shape (12, 9), contains its derivatives; an array without rows (`NO_VARIATIONS`) means that only
    y is integrated. `craft`, shape (5,), is (mu, oblateness, thrust, mass at the end of the game,
    mass flow). Returns False if the steps are too many or too small, or a number overflows; y and z
    are then those of the last step that was accepted.

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
        # A rounding error of the sum of steps must not leave a step of its size.
        last = step >= left * (1.0 - 1e-12)
        h = sign * (left if last else step)
        _step(s, h, first, y, z, parameters, ky, kz, y_next, z_next)
        error = error_of_step(y, y_next, ky, tolerance, abs(h))
        if not error < np.inf:
            return False

        # The first stage is the same if the step is repeated.
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

        # The estimated error is of order eight. Below 1e-10 its root exceeds the largest factor.
        factor = _MAX_FACTOR if error < 1e-10 else _SAFETY * error**-0.125
        step = abs(h) * min(max(factor, _MIN_FACTOR), _MAX_FACTOR)
        # A step of the rounding of the time, which a state near the centre can need. A span below
        # a thousandth counts as a thousandth; chosen.
        if step < 1e-13 * max(span, 1e-3):
            return False
    return False


def end_of(state: Floats, nu: Floats) -> Floats:
    """Return state and costate at the end of an extremal, shape (12,)."""
    return np.concatenate([state, nu, np.zeros(3)])


@compiled
def rate(y: Floats, mu: float, oblateness: float, push: float) -> Floats:
    """Return the time derivative of position and velocity, shape (6,).

    `y`, shape (12,), is a state and, in its last three rows, the direction of the thrust, of any
    length: p_v of an extremal, or the direction of a steered craft. Zero means no thrust. Rows 6 to
    8 are not used. `push` is the acceleration of the thrust.
    """
    out = np.empty(6)
    gradient = np.empty((3, 3))
    # With oblateness it is written to, though its values have no meaning.
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
    """Return the response of one side at a guess of its end state.

    `start`, shape (6,), is the state at the start of the game, `craft` is described in `flow_back`,
    and the rows of `plane`, shape (2, 3), are the directions across nu.
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
            by_time[i] += inverse[i, j] * (later[j] + craft[4] * z[j, MASS])

    residual = np.abs(start - y[:6]).max() if determinant != 0.0 else np.inf
    return Response(rho, by_nu, by_time, determinant > 0.0, inverse, y[6:].copy(), residual)


@compiled
def invert(matrix: Floats, inverse: Floats) -> float:
    """Fill the inverse of a matrix, shape (n, n), and return its determinant.

    The determinant is 0 if the matrix is singular or not finite, and `inverse` then has no meaning.
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
