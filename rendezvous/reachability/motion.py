"""Motion about an elliptic orbit: a linear system in discrete time, and the nonlinear motion."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.relative_motion import (
    EllipticOrbit,
    HeldMotion,
    LinearMotion,
    TimeVaryingMotion,
    TschaunerHempel,
)

_RELATIVE = 1e-12
"""Relative error of a step of the integrator, near the smallest that DOP853 accepts in doubles."""
_ABSOLUTE = 1e-9
"""Absolute error of a step of the integrator, m, m/s and rad (true anomaly).

It is the greater part of the tolerance of components below 1000, thus of the velocities and of the
anomaly, and below the printed digits of a miss.
"""


class MotionModel(Enum):
    """Matrix of the linear model: A(0) at all times (frozen), or A(t) of the elliptic orbit."""

    FROZEN = "frozen"
    TIME_VARYING = "time-varying"


def motion_of(orbit: EllipticOrbit, model: MotionModel) -> HeldMotion:
    """Return the linear motion about an `orbit` by a `model`, in Hill's axes.

    Equation (2) of Shorikov and Goranov (2021), who use the frozen model.
    """
    if model is MotionModel.FROZEN:
        return TimeVaryingMotion(lambda times: orbit.dynamics(np.zeros_like(times)))
    return TschaunerHempel(orbit)


def discretised(
    motion: HeldMotion, periods: int, period_s: float, acceleration_m_s2: float
) -> tuple[Floats, Floats]:
    """Return A(t) and B(t) of x(t + 1) = A(t) x(t) + B(t) u(t).

    The matrices are exact for controls that are held over each period; equation (3) of Shorikov and
    Goranov (2021). States are in m and m/s. A(t), shape (periods, 6, 6), and B(t), shape (periods,
    6, 3), are matrices of the `motion`; a unit control is an acceleration of `acceleration_m_s2`.
    """
    starts = period_s * np.arange(periods)
    segment = motion.segment(starts, starts + period_s)
    return segment.transition, acceleration_m_s2 * segment.held


IMPULSE = np.vstack([np.zeros((3, 3)), np.eye(3)])
"""Immediate effect of an impulse, m/s, on a state."""


def impulsive(motion: LinearMotion, periods: int, period_s: float) -> tuple[Floats, Floats]:
    """Return A(t) and B(t) = A(t) (0; 1), of impulses in m/s at the starts of the periods.

    `motion`, `periods`, `period_s` and the shapes of the matrices are as in `discretised`.
    """
    starts = period_s * np.arange(periods)
    transition = motion.transition(starts, starts + period_s)
    return transition, transition @ IMPULSE


def between_impulses(motion: LinearMotion, periods: int, period_s: float, instants: int) -> Floats:
    """Return what `between_periods` does, for impulses in m/s at the starts of the periods."""
    starts = period_s * np.arange(periods)[:, None]
    since_start = period_s * np.arange(1, instants + 1) / (instants + 1)
    transition = motion.transition(starts, starts + since_start)
    return np.concatenate([transition, transition @ IMPULSE], axis=-1)


def between_periods(
    motion: HeldMotion, periods: int, period_s: float, acceleration_m_s2: float, instants: int
) -> Floats:
    """Return the matrices of states within periods, as functions of (x(t), u(t)).

    `motion`, `periods`, `period_s` and `acceleration_m_s2` are as in `discretised`; `instants` is
    the number of evenly spaced times within each period, without its ends. The shape is (periods,
    instants, 6, 9).
    """
    starts = period_s * np.arange(periods)[:, None]
    since_start = period_s * np.arange(1, instants + 1) / (instants + 1)
    segment = motion.segment(starts, starts + since_start)
    return np.concatenate([segment.transition, acceleration_m_s2 * segment.held], axis=-1)


@dataclass(frozen=True)
class NonlinearMotion:
    """Relative motion in a central field, in Hill's axes (see `relative_motion`).

    Equations (1) of Shorikov and Goranov (2021), whose x is -y here and whose y is x, with w^2 r^4
    / p = mu, integrated by DOP853 (`_RELATIVE`, `_ABSOLUTE`). The passive craft is on the `orbit`.
    """

    orbit: EllipticOrbit
    semi_major_axis_m: float

    def paths(
        self, start_s: float, states: ArrayLike, accelerations: ArrayLike, times_s: ArrayLike
    ) -> Floats:
        """Return the states at `times_s`, shape (k, s, 6), of motion under constant accelerations.

        Initial `states` have shape (k, 6), in m and m/s; `accelerations`, in the rotating axes,
        shape (k, 3), m/s^2; `times_s`, shape (s,), rise and are not before `start_s`.

        Raises
        ------
        ArithmeticError
            If a path cannot be integrated, for example because it passes too near the centre.
        """
        initial = np.atleast_2d(np.asarray(states, float))
        push = np.atleast_2d(np.asarray(accelerations, float))
        times = np.asarray(times_s, dtype=float)
        count = len(initial)
        e = self.orbit.eccentricity
        k2 = self.orbit.semi_latus_rate_rad_s
        parameter = self.semi_major_axis_m * (1.0 - e * e)
        gravity = k2 * k2 * parameter**3
        # The integrator returns no states for an empty interval.
        if times[-1] == start_s:
            return np.repeat(initial[:, None, :], len(times), axis=1)

        def slope(_time: float, flat: Floats) -> Floats:
            """Rates of (true anomaly, states of all paths, by component).

            `push` is the acceleration, m/s^2; k2 = (mu / p^3)^(1/2), so that w = k2 rho^2.
            """
            anomaly = flat[0]
            x, y, z, vx, vy, vz = flat[1:].reshape(6, count)
            rho = 1.0 + e * np.cos(anomaly)
            r = parameter / rho
            w = k2 * rho * rho
            w_dot = -2.0 * k2 * k2 * e * np.sin(anomaly) * rho**3
            pull = gravity / ((r + x) ** 2 + y * y + z * z) ** 1.5

            result = np.empty(1 + 6 * count)
            result[0] = w
            rates = result[1:].reshape(6, count)
            rates[:3] = vx, vy, vz
            rates[3] = (
                2.0 * w * vy + w * w * x + w_dot * y + gravity / r**2 - pull * (r + x) + push[:, 0]
            )
            rates[4] = -2.0 * w * vx + w * w * y - w_dot * x - pull * y + push[:, 1]
            rates[5] = -pull * z + push[:, 2]
            return result

        begin = np.concatenate([[float(self.orbit.true_anomaly(start_s))], initial.T.ravel()])
        solution = solve_ivp(
            slope,
            (start_s, times[-1]),
            begin,
            method="DOP853",
            t_eval=times,
            rtol=_RELATIVE,
            atol=_ABSOLUTE,
        )
        if not solution.success:
            raise ArithmeticError(f"the motion could not be integrated: {solution.message}")
        # Without the true anomaly.
        return np.asarray(solution.y[1:].reshape(6, count, len(times)).transpose(1, 2, 0))

    def fly(
        self, start: ArrayLike, accelerations: ArrayLike, period_s: float, points: int = 1
    ) -> Floats:
        """Return the states of craft that hold an acceleration during each period.

        All start in the state `start`, shape (6,), at t = 0; `accelerations` have shape (k, T, 3),
        in m/s^2. The result, shape (k, T points + 1, 6), contains the start and `points` evenly
        spaced times of each period, the last one at its end. `ArithmeticError` is raised as in
        `paths`.
        """
        push = np.asarray(accelerations, dtype=float)
        state = np.broadcast_to(np.asarray(start, dtype=float), (len(push), 6))
        legs = [state[:, None, :]]
        for t in range(push.shape[1]):
            times = period_s * (t + np.arange(1, points + 1) / points)
            leg = self.paths(period_s * t, state, push[:, t], times)
            legs.append(leg)
            state = leg[:, -1]
        return np.concatenate(legs, axis=1)

    def coast(
        self, start: ArrayLike, impulses: ArrayLike, period_s: float, points: int = 1
    ) -> Floats:
        """Return the states of craft that coast after an impulse at the start of each period.

        As `fly`, for `impulses` in m/s. The result, shape (k, T (points + 1) + 1, 6), contains the
        start, and for each period the state just after the impulse and the `points` times.
        """
        changes = np.asarray(impulses, dtype=float)
        state = np.broadcast_to(np.asarray(start, dtype=float), (len(changes), 6))
        legs = [state[:, None, :]]
        for t in range(changes.shape[1]):
            after = state + changes[:, t] @ IMPULSE.T
            times = period_s * (t + np.arange(1, points + 1) / points)
            leg = self.paths(period_s * t, after, np.zeros((len(changes), 3)), times)
            legs += [after[:, None, :], leg]
            state = leg[:, -1]
        return np.concatenate(legs, axis=1)
