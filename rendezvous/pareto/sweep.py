"""The costs of an encounter as functions of the meeting time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.pareto.encounter import Encounter
from rendezvous.pareto.solution import solve_encounter

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class DurationSweep:
    """An encounter at k meeting times.

    Parameters
    ----------
    meeting_s : ndarray, shape (k,)
        Times of the meeting.
    points : ndarray, shape (k, f)
        Free values that minimise the group loss.
    cost_squared, ideal_cost_squared : ndarray, shape (k, n)
        J_i^2 and J_i*^2, m^2/s^3.
    group_loss : ndarray, shape (k,)
        m^2/s^3.
    """

    meeting_s: Floats
    points: Floats
    cost_squared: Floats
    ideal_cost_squared: Floats
    group_loss: Floats


def sweep_meeting_time(encounter: Encounter, meeting_s: ArrayLike) -> DurationSweep:
    """Solve an `encounter` at k meeting times, each after every craft's start."""
    times = np.atleast_1d(np.asarray(meeting_s, dtype=np.float64))
    solutions = [solve_encounter(replace(encounter, meeting_s=float(time))) for time in times]
    return DurationSweep(
        times,
        np.array([solution.point for solution in solutions]),
        np.array([solution.cost_squared() for solution in solutions]),
        np.array([[cost.ideal_cost_squared for cost in solution.costs] for solution in solutions]),
        np.array([float(solution.group_loss()) for solution in solutions]),
    )
