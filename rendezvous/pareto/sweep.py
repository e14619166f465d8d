"""How the costs of an encounter depend on how long it may take."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.pareto.encounter import Encounter
from rendezvous.pareto.solution import solve_encounter

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class DurationSweep:
    """An encounter at several meeting times.

    Parameters
    ----------
    meeting_s : ndarray, shape (k,)
    points : ndarray, shape (k, f)
        Free values that are best for the group.
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
    """Solve an encounter at several meeting times.

    Parameters
    ----------
    encounter : Encounter
    meeting_s : array_like, shape (k,)
        Each after every craft's start.

    Returns
    -------
    DurationSweep
    """
    times = np.atleast_1d(np.asarray(meeting_s, dtype=np.float64))
    solved = [solve_encounter(replace(encounter, meeting_s=float(each))) for each in times]
    return DurationSweep(
        times,
        np.array([each.point for each in solved]),
        np.array([each.cost_squared() for each in solved]),
        np.array([[cost.ideal_cost_squared for cost in each.costs] for each in solved]),
        np.array([float(each.group_loss()) for each in solved]),
    )
