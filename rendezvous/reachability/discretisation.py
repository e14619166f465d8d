"""From relative motion about an orbit to a system in discrete time."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from rendezvous.relative_motion import ORBITAL, ConstantMotion, EllipticOrbit, TschaunerHempel

Floats = NDArray[np.float64]


class MotionModel(Enum):
    """Whether A(t) stays as it is at t = 0, or follows the ellipse."""

    FROZEN = "frozen"
    TIME_VARYING = "time-varying"


def motion_of(orbit: EllipticOrbit, model: MotionModel) -> ConstantMotion | TschaunerHempel:
    """Return the linear motion about an orbit, in axes x against the motion, y outward.

    Parameters
    ----------
    orbit : EllipticOrbit
    model : MotionModel

    Returns
    -------
    ConstantMotion or TschaunerHempel

    Notes
    -----
    Equation (2) of Shorikov and Goranov (2021); their numbers are of the frozen model.
    """
    return orbit.frozen(0.0, ORBITAL) if model is MotionModel.FROZEN else TschaunerHempel(orbit, ORBITAL)


def discretised(
    motion: ConstantMotion | TschaunerHempel, periods: int, period_s: float, acceleration_m_s2: float
) -> tuple[Floats, Floats]:
    """Return A(t) and B(t) of x(t + 1) = A(t) x(t) + B(t) u(t), exact for controls held over a period.

    Parameters
    ----------
    motion : ConstantMotion or TschaunerHempel
    periods : int
    period_s : float
    acceleration_m_s2 : float
        Of a unit control.

    Returns
    -------
    transition : ndarray, shape (periods, 6, 6)
        Of states in m and m/s.
    control : ndarray, shape (periods, 6, 3)
        m and m/s a unit control.

    Raises
    ------
    ValueError
        If there is no period.

    Notes
    -----
    Equation (3). A block exponential for the frozen model, closed forms and quadrature for the other.
    """
    if periods < 1:
        raise ValueError("T = 0: there must be at least one period")
    starts = period_s * np.arange(periods if isinstance(motion, TschaunerHempel) else 1)
    transition = motion.transition(starts, starts + period_s)
    control = acceleration_m_s2 * motion.held_input(starts, starts + period_s)
    return _repeated(transition, periods), _repeated(control, periods)


def between_periods(
    motion: ConstantMotion | TschaunerHempel,
    periods: int,
    period_s: float,
    acceleration_m_s2: float,
    instants: int,
) -> Floats:
    """Return the matrices that give states between the periods: x = matrix (x(t), u(t)).

    Parameters
    ----------
    motion : ConstantMotion or TschaunerHempel
    periods : int
    period_s : float
    acceleration_m_s2 : float
    instants : int
        How many within a period, evenly spread.

    Returns
    -------
    ndarray, shape (periods, instants, 6, 9)
    """
    if isinstance(motion, ConstantMotion):
        step_s = period_s / (instants + 1)
        step = motion.transition(0.0, step_s)
        found = [np.hstack([step, acceleration_m_s2 * motion.held_input(0.0, step_s)])]
        for _ in range(instants - 1):
            found.append(step @ found[-1])
            found[-1][:, 6:] += found[0][:, 6:]
        return _repeated(np.array(found)[None], periods)
    starts = period_s * np.arange(periods)[:, None]
    ends = starts + period_s * np.arange(1, instants + 1) / (instants + 1)
    moved, held = motion.transition(starts, ends), motion.held_input(starts, ends)
    return np.concatenate([moved, acceleration_m_s2 * held], axis=-1)


def _repeated(matrices: Floats, periods: int) -> Floats:
    """All periods are alike where A is constant, and then one of them was computed."""
    return np.repeat(matrices, periods, axis=0) if len(matrices) < periods else matrices
