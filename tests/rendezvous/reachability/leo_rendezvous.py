"""A rendezvous in low Earth orbit with bounded errors, and its motion computed independently."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from infoset.arrays import Floats
from infoset.geometry.zonotope import Zonotope
from infoset.rendezvous.reachability import AffinePlan, OutputProblem, impulsive
from infoset.rendezvous.relative_motion import EllipticOrbit, LinearMotion, TschaunerHempel

GRAVITY = 3.986004418e14
PERIGEE_M = 6778137.0
PERIODS = 12
START_ERROR = np.repeat([20.0, 0.01], 3)
FREE = EllipticOrbit(1e-9)
"""An orbit so slow that motion is straight, to 1e-6 m in the cases of the tests."""


def orbit_of(eccentricity: float = 0.0) -> EllipticOrbit:
    """An orbit that starts at its perigee, 400 km above the equator."""
    return EllipticOrbit.of_size(PERIGEE_M / (1.0 - eccentricity), eccentricity, GRAVITY)


def rendezvous(
    orbit: EllipticOrbit,
    behind_m: float = 1000.0,
    period_s: float = 240.0,
    limit: float = 1.0,
    periods: int = PERIODS,
    error: Floats = START_ERROR,
) -> OutputProblem:
    """Impulses of 1 mm/s error to a point 150 m behind; the position is known to 1 m."""
    transition, control = impulsive(TschaunerHempel(orbit), periods, period_s)
    start = np.array([0.0, -behind_m, 0.0, 0.0, 0.0, 0.0])
    return OutputProblem(
        transition,
        control,
        np.repeat(np.eye(3, 6)[None], periods, axis=0),
        np.repeat(np.eye(3)[None], periods, axis=0),
        Zonotope.box(start - error, start + error),
        np.diag(np.repeat([1.0, 50.0], 3)),
        target=np.array([0.0, -150.0, 0.0, 0.0, 0.0, 0.0]),
        execution_error=np.full(3, 1e-3),
        control_limits=np.full((periods, 3), limit),
    )


def in_space(motion: LinearMotion, start: Floats) -> OutputProblem:
    """Five impulses a minute apart, with errors along all axes; the position is known to 1 m."""
    transition, control = impulsive(motion, 5, 60.0)
    error = np.repeat([20.0, 0.05], 3)
    return OutputProblem(
        transition,
        control,
        np.repeat(np.eye(3, 6)[None], 5, axis=0),
        np.repeat(np.eye(3)[None], 5, axis=0),
        Zonotope.box(start - error, start + error),
        np.diag(np.repeat([1.0, 50.0], 3)),
        execution_error=np.full(3, 1e-3),
        control_limits=np.full((5, 3), 10.0),
    )


def fly(
    plan: AffinePlan, z: Floats, move: Callable[[int, Floats], Floats]
) -> tuple[Floats, Floats]:
    """Return states (T + 1, k, 6) and impulses (T, k, 3) with their errors of k flights.

    `z`, shape (k, 6 + 6 T), are errors of the start, the execution and the measurements as parts of
    their bounds. `move` returns the states at the end of a period from those after its impulse.
    """
    problem = plan.problem
    count = len(z)
    execution, noise = np.split(z[:, 6:].reshape(count, 2 * PERIODS, 3), 2, axis=1)
    states = [problem.centre + START_ERROR * z[:, :6]]
    predicted = np.tile(problem.centre, (count, 1))
    pure = list[Floats]()
    impulses = []
    for t in range(PERIODS):
        pure.append(states[t][:, :3] + noise[:, t] - predicted[:, :3])
        command = plan.nominal[t] + sum(pure[s] @ plan.gains[t, s].T for s in range(t + 1))
        assert (np.abs(command) <= problem.limits[t]).all()
        impulses.append(command + 1e-3 * execution[:, t])
        after = states[t].copy()
        after[:, 3:] += impulses[t]
        states.append(move(t, after))
        predicted[:, 3:] += command
        predicted = predicted @ problem.transition[t].T
    return np.array(states), np.array(impulses)


def hill(rate: float, time_s: float) -> Floats:
    """The textbook's matrix of the Clohessy-Wiltshire equations."""
    s = np.sin(rate * time_s)
    c = np.cos(rate * time_s)
    turned = rate * time_s
    return np.array(
        [
            [4.0 - 3.0 * c, 0.0, 0.0, s / rate, 2.0 * (1.0 - c) / rate, 0.0],
            [
                6.0 * (s - turned),
                1.0,
                0.0,
                -2.0 * (1.0 - c) / rate,
                4.0 * s / rate - 3.0 * time_s,
                0.0,
            ],
            [0.0, 0.0, c, 0.0, 0.0, s / rate],
            [3.0 * rate * s, 0.0, 0.0, c, 2.0 * s, 0.0],
            [-6.0 * rate * (1.0 - c), 0.0, 0.0, -2.0 * s, 4.0 * c - 3.0, 0.0],
            [0.0, 0.0, -rate * s, 0.0, 0.0, c],
        ]
    )


def two_body(orbit: EllipticOrbit, start_s: float, states: Floats, times_s: Floats) -> Floats:
    """Relative states of craft about a central body at some times, shape (s, k, 6).

    `states` have the shape (k, 6). All craft and the target are integrated in inertial axes.
    """
    count = len(states)
    inertial = np.vstack([np.zeros((1, 6)), states])
    frame, spin, target = _frame(orbit, start_s)
    position = target[:3] + inertial[:, :3] @ frame
    velocity = target[3:] + (inertial[:, 3:] + np.cross(spin, inertial[:, :3])) @ frame

    def slope(_time: float, flat: Floats) -> Floats:
        r, v = flat.reshape(2, count + 1, 3)
        pull = -GRAVITY * r / np.linalg.norm(r, axis=1, keepdims=True) ** 3
        return np.concatenate([v.ravel(), pull.ravel()])

    begin = np.concatenate([position.ravel(), velocity.ravel()])
    # Positions of 7e6 m to 1e-12: errors below 1 mm.
    solution = solve_ivp(
        slope, (start_s, times_s[-1]), begin, "DOP853", times_s, rtol=1e-12, atol=1e-6
    )
    relative = []
    for time_s, flat in zip(times_s, solution.y.T, strict=True):
        r, v = flat.reshape(2, count + 1, 3)
        frame, spin, _ = _frame(orbit, float(time_s))
        apart = (r[1:] - r[:1]) @ frame.T
        relative.append(np.hstack([apart, (v[1:] - v[:1]) @ frame.T - np.cross(spin, apart)]))
    return np.array(relative)


def _frame(orbit: EllipticOrbit, time_s: float) -> tuple[Floats, Floats, Floats]:
    """Hill's axes as rows, their rate in these axes, and the target's inertial state."""
    e = orbit.eccentricity
    f = float(orbit.true_anomaly(time_s))
    parameter = PERIGEE_M * (1.0 + e)
    outward = np.array([np.cos(f), np.sin(f), 0.0])
    along = np.array([-np.sin(f), np.cos(f), 0.0])
    radius = parameter / (1.0 + e * np.cos(f))
    speed = np.sqrt(GRAVITY / parameter)
    velocity = speed * (e * np.sin(f) * outward + (1.0 + e * np.cos(f)) * along)
    spin = np.array([0.0, 0.0, np.sqrt(GRAVITY * parameter) / radius**2])
    frame = np.vstack([outward, along, [0.0, 0.0, 1.0]])
    return frame, spin, np.concatenate([radius * outward, velocity])
