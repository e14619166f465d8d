"""A rendezvous with bounded errors: its goal and its constraints for all errors."""

from __future__ import annotations

import numpy as np
import pytest

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


def test_goal_is_the_box_and_free_components_do_not_count() -> None:
    free = with_errors(approach(), errors(), np.zeros(6), np.repeat([2.0, np.inf], 3))

    np.testing.assert_array_equal(free.goal, 0.5 * np.eye(3, 6))


def test_state_after_an_impulse_has_the_execution_error_too() -> None:
    rows = problem().path
    assert rows is not None
    after = (rows.times == 0) & (rows.states[:, 4] == 1.0) & (rows.controls[:, 1] == 1.0)

    # 5 m/s less 1 mm/s and 1 % of 4 m/s.
    assert rows.upper[after] == pytest.approx([5.0 - 1e-3 - 0.04])
    assert rows.lower[after] == pytest.approx([-5.0 + 1e-3 + 0.04])
