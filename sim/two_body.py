"""Two-body motion of a spacecraft and an object, as the motion of the spacecraft and the relative motion.

A pair of states is an array of shape (4, 3): position and velocity of the spacecraft from the attracting body, and of
the object from the spacecraft. Without an attracting body the parameter K is zero, and both move on straight lines.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from infoset.arrays import Floats

TOLERANCE = 1e-12
"""Relative error of a step of the integration."""
SEARCH = 3.0
"""The closest approach is searched for up to this multiple of the time that straight lines take to it."""
NEWTON_STEPS = 20


def propagate(states: Floats, parameter_m3_s2: float, duration_s: float) -> tuple[Floats, Floats]:
    """Return the pair of states after a time, and the transition matrix of the relative state, shape (6, 6).

    The matrix is that of small changes of the object's orbit. A ValueError is raised if the integration fails.
    """
    end = _integrate(states, parameter_m3_s2, duration_s).y[:, -1]
    return end[:12].reshape(4, 3), end[12:].reshape(6, 6)


def closest_approach_s(states: Floats, parameter_m3_s2: float) -> float:
    """Return the time of the closest approach of a pair, s; it is negative if the two recede now.

    A ValueError is raised if there is none within `SEARCH` times the time that straight lines take to theirs.
    """
    relative, velocity = states[2:]
    horizon_s = float(-SEARCH * (relative @ velocity) / (velocity @ velocity))

    def radial(_time: float, state: Floats) -> float:
        return float(state[6:9] @ state[9:12])

    radial.terminal, radial.direction = True, np.sign(horizon_s)  # type: ignore[attr-defined]  # from falling to rising
    times_s = _integrate(states, parameter_m3_s2, horizon_s, radial).t_events[0] if horizon_s else np.zeros(1)
    if not len(times_s):
        raise ValueError(f"the states have no closest approach within {abs(horizon_s) / 86400.0:.4g} d of their epoch")
    time_s = float(times_s[0])
    for _ in range(NEWTON_STEPS):  # r . v = 0
        (own, _, relative, velocity), _ = propagate(states, parameter_m3_s2, time_s)
        rate = velocity @ velocity + relative @ _relative_acceleration(own, relative, parameter_m3_s2)
        step_s = float(-relative @ velocity / rate)
        time_s += step_s
        if abs(step_s) <= 1e-12 * abs(time_s):
            break
    return time_s


def _relative_acceleration(own: Floats, relative: Floats, parameter_m3_s2: float) -> Floats:
    """Return the difference of gravity between object and spacecraft, without the cancellation of its two terms.

    With q = r . (r + 2 R) / R^2, the ratio of the cubes of both distances is (1 + q)^(3/2): Battin's form of Encke's
    method.
    """
    if not parameter_m3_s2:
        return np.zeros(3)
    squared = own @ own
    share = np.expm1(-1.5 * np.log1p(relative @ (relative + 2.0 * own) / squared))
    return np.asarray(-parameter_m3_s2 / squared**1.5 * (relative + share * (relative + own)))


def _integrate(states: Floats, parameter_m3_s2: float, duration_s: float, event: Any = None) -> Any:
    """Integrate a pair of states with the transition matrix of the relative state."""
    from scipy.integrate import solve_ivp  # takes long to load

    def rates(_time: float, state: Floats) -> Floats:
        own, own_velocity, relative, velocity = state[:12].reshape(4, 3)
        transition = state[12:].reshape(6, 6)
        own_acceleration, gradient = np.zeros(3), np.zeros((3, 3))
        if parameter_m3_s2:
            body = own + relative
            own_acceleration = -parameter_m3_s2 * own / (own @ own) ** 1.5
            squared = body @ body
            gradient = parameter_m3_s2 / squared**1.5 * (3.0 * np.outer(body, body) / squared - np.eye(3))
        acceleration = _relative_acceleration(own, relative, parameter_m3_s2)
        changes = transition[3:].ravel(), (gradient @ transition[:3]).ravel()
        return np.concatenate([own_velocity, own_acceleration, velocity, acceleration, *changes])

    # Each vector has the error of its modulus; the transition matrix that of a change of the relative position.
    sizes = np.linalg.norm(states, axis=1)
    scale = np.concatenate([np.repeat(np.where(sizes > 0.0, sizes, 1.0), 3), np.ones(36)])
    start = np.concatenate([states.ravel(), np.eye(6).ravel()])
    span_s, accuracy = (0.0, duration_s), {"rtol": TOLERANCE, "atol": TOLERANCE * scale}
    result = solve_ivp(rates, span_s, start, method="DOP853", events=event, **accuracy)
    if not result.success or not np.isfinite(result.y[:, -1]).all():
        raise ValueError("the motion cannot be integrated: it comes too near the attracting body")
    return result
