"""One craft's extremals, from the end of the game back to its start, with their variational equations: compiled.

An extremal takes its craft as far along `nu` as possible by the time of the end. There its costate is (nu, 0), and
backward in time it is the same flow for pursuer and evader: thrust along p_v, where p is the costate of the pursuer and
minus the costate of the evader. Near the end p_v / |p_v| is nu, and the flow is smooth up to the end.

Wang's slides, "Optimal control", with k = +1 for the pursuer and -1 for the evader: u = k lambda_v / |lambda_v|,
lambda_r' = (mu / r^3) lambda_v - 3 mu (lambda_v . r) r / r^5 (they omit '. r'), lambda_v' = -lambda_r; p = k lambda.
That of the mass, lambda_m' = k |lambda_v| T / m^2 (they omit k), is not needed: both thrust fully all the time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rendezvous._compile import allocation_free, compiled
from rendezvous.dormand_prince import STAGES, error_of_step, step_of
from rendezvous.pursuit_evasion._gravity import acceleration, derivatives

Floats = NDArray[np.float64]

STATES, COLUMNS = 12, 9
"""Position, velocity and costate; what they are differentiated by: end state (6), nu in its plane (2), end mass."""

_SAFETY, _LEAST_FACTOR, _GREATEST_FACTOR = 0.9, 0.2, 6.0
_MOST_STEPS = 20_000
_FIRST_STEP = 0.05
_NO_VARIATIONS = np.zeros((0, COLUMNS))
_Parameters = tuple[Floats, Floats, Floats]


@allocation_free
def _rates(s: float, y: Floats, z: Floats, parameters: _Parameters, dy: Floats, dz: Floats) -> None:
    """Rates, in time to go, of the state and of its variations.

    `parameters` are the craft (mu, oblateness, thrust, mass at the end, flow) and room for two matrices, (3, 3). At the
    end of the game p_v is zero: there the direction of thrust is that of p_r, which is its rate.
    """
    craft, first, second = parameters
    thrust, mass = craft[2], craft[3] + craft[4] * s
    push = thrust / mass
    derivatives(y[:3], y[9:], craft[0], craft[1], dy[3:6], first, second, len(z) > 0)
    at = 9 if s > 0.0 else 6
    x0, x1, x2 = y[at], y[at + 1], y[at + 2]
    inverse = 1.0 / np.sqrt(x0 * x0 + x1 * x1 + x2 * x2)
    u0, u1, u2 = x0 * inverse, x1 * inverse, x2 * inverse
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
    g00, g01, g02, g11, g12, g22 = first[0, 0], first[0, 1], first[0, 2], first[1, 1], first[1, 2], first[2, 2]
    m00, m01, m02, m11, m12, m22 = second[0, 0], second[0, 1], second[0, 2], second[1, 1], second[1, 2], second[2, 2]
    for j in range(COLUMNS):
        r0, r1, r2 = z[0, j], z[1, j], z[2, j]
        q0, q1, q2 = z[9, j], z[10, j], z[11, j]
        t0, t1, t2 = z[at, j], z[at + 1, j], z[at + 2, j]
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


def flow_back(y: Floats, z: Floats | None, craft: Floats, begin: float, end: float, tolerance: float) -> bool:
    """Integrate a state and its variations from time to go `begin` to `end`, in place; either may be the greater.

    Parameters
    ----------
    y : ndarray, shape (12,)
        Position, velocity, p_r, p_v.
    z : ndarray, shape (12, 9), or None
        Their derivatives; None to integrate y alone.
    craft : ndarray, shape (5,)
        mu, oblateness, thrust, mass at the end of the game, mass flow.
    begin, end : float
        Times to go.
    tolerance : float
        Tolerance of a step's error, relative and absolute, in y.

    Returns
    -------
    bool
        False where the steps are too many or too small, or a number overflows.

    Notes
    -----
    The Dormand-Prince method of order 8 (SciPy's coefficients); the error of y alone controls the steps. A step costs
    12 stages of some 0.3 us, or 0.1 us for y alone.
    """
    if begin == end:
        return True
    return bool(flow_kernel(y, _NO_VARIATIONS if z is None else z, craft, begin, end, tolerance))


@compiled
def flow_kernel(y: Floats, z: Floats, craft: Floats, begin: float, end: float, tolerance: float) -> bool:
    """Integrate as `flow_back` does; z of no rows integrates y alone."""
    ky, kz = np.empty((STAGES, STATES)), np.empty((STAGES, len(z), COLUMNS))
    y_next, z_next = np.empty_like(y), np.empty_like(z)
    parameters = craft, np.empty((3, 3)), np.empty((3, 3))
    span = abs(end - begin)
    sign = 1.0 if end > begin else -1.0
    s, step = begin, min(_FIRST_STEP, span)
    first = 0
    for _ in range(_MOST_STEPS):
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
        factor = _GREATEST_FACTOR if error < 1e-10 else _SAFETY * error**-0.125
        step = abs(h) * min(max(factor, _LEAST_FACTOR), _GREATEST_FACTOR)
        if step < 1e-13 * max(span, 1e-3):
            return False
    return False


def shoot_back(
    end_state: Floats, nu: Floats, plane: Floats, craft: Floats, duration: float, tolerance: float
) -> tuple[Floats, Floats] | None:
    """Return state and costate at the start of the game, shape (12,), and their derivatives, shape (12, 9), or None.

    The derivatives are by end state, by nu along the two directions of `plane`, shape (2, 3), and by the mass at the
    end. `craft` is that of `flow_back`. None stands for a failed propagation.
    """
    y, z = np.zeros(STATES), np.zeros((STATES, COLUMNS))
    y[:6], y[6:9] = end_state, nu
    z[:6, :6] = np.eye(6)
    z[6:9, 6:8] = plane.T
    return (y, z) if flow_back(y, z, craft, 0.0, duration, tolerance) else None


def shoot_state_back(end_state: Floats, nu: Floats, craft: Floats, duration: float, tolerance: float) -> Floats | None:
    """Return state and costate at the start of the game alone, shape (12,), or None; see `shoot_back`."""
    y = np.zeros(STATES)
    y[:6], y[6:9] = end_state, nu
    return y if flow_back(y, None, craft, 0.0, duration, tolerance) else None


def rate(y: Floats, mu: float, oblateness: float, push: float) -> Floats:
    """Return the time derivative of position and velocity, shape (6,), at a state and costate, shape (12,).

    `push` is the acceleration of the thrust.
    """
    out = np.empty(6)
    _rate(y, mu, oblateness, push, out)
    return out


@allocation_free
def _rate(y: Floats, mu: float, oblateness: float, push: float, out: Floats) -> None:
    acceleration(y[:3], mu, oblateness, out[3:])
    size = np.sqrt(y[9] * y[9] + y[10] * y[10] + y[11] * y[11])
    for i in range(3):
        out[i] = y[3 + i]
        if size > 0.0:
            out[3 + i] += push * y[9 + i] / size
