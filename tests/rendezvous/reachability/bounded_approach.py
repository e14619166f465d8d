"""An approach in low orbit with bounded errors and constraints."""

from __future__ import annotations

import numpy as np

from infoset.rendezvous.reachability import (
    IMPULSE,
    ErrorBounds,
    OutputProblem,
    ReachabilityProblem,
    between_impulses,
    impulsive,
    with_errors,
)
from infoset.rendezvous.relative_motion import ClohessyWiltshire

MOTION = ClohessyWiltshire(0.00113)
PERIODS = 4
BOX = np.repeat([1.0, 0.02], 3)


def approach(speed_m_s: float = 5.0) -> ReachabilityProblem:
    """Four impulses a minute apart from 300 m behind; y is at most 20 m."""
    transition, control = impulsive(MOTION, PERIODS, 60.0)
    return ReachabilityProblem(
        transition,
        control,
        np.array([0.0, -300.0, 0.0, 0.0, 0.0, 0.0]),
        np.repeat([1000.0, speed_m_s], 3),
        np.full(3, 4.0),
        normals=np.eye(6)[1:2],
        offsets=np.full((PERIODS + 1, 1), 20.0),
        between=between_impulses(MOTION, PERIODS, 60.0, 1),
        jump=IMPULSE,
        control_normals=np.array([[0.0, -1.0, 0.0]]),
        control_offsets=np.full((PERIODS, 1), 3.0),
    )


def errors(relative: float = 0.01) -> ErrorBounds:
    return ErrorBounds(
        np.repeat([5.0, 0.01], 3), np.full(3, 1e-3), np.full(3, relative), np.full(3, 0.5)
    )


def problem(speed_m_s: float = 5.0) -> OutputProblem:
    return with_errors(approach(speed_m_s), errors(), np.zeros(6), BOX)
