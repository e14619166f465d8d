"""The encounter with a bound on the control: |u| <= u_max at all times, for every craft."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.bounded_control import (
    Arc,
    BoundedFlight,
    BoundTooSmallError,
    least_bound,
    solve_bounded,
)
from infoset.rendezvous.pareto.encounter import Craft, Encounter
from infoset.rendezvous.pareto.solution import EncounterSolution


@dataclass(frozen=True, eq=False)
class BoundedEncounter:
    """The meeting of minimum group loss with |u| <= `max_m_s2`.

    Parameters
    ----------
    max_m_s2 : float
        The bound.
    point : ndarray, shape (f,)
        Free values of the meeting.
    cost_squared : ndarray, shape (n,)
        J_i^2, m^2/s^3.
    flights : tuple of BoundedFlight
        The flights to the meeting.
    """

    max_m_s2: float
    point: Floats
    cost_squared: Floats
    flights: tuple[BoundedFlight, ...]


@dataclass(frozen=True)
class NeededBound:
    """The smallest bound with which a meeting is possible, m/s^2.

    `craft` are the numbers of the craft that need it.
    """

    value_m_s2: float
    craft: tuple[int, ...]


_NEEDS_IT = 1e-3
"""Share of a craft in the direction of the smallest bound above which the craft needs the bound.

The rounding of shares is below 1e-6.
"""


def needed_bound(encounter: Encounter) -> NeededBound:
    """Return the smallest bound with which any meeting of an `encounter` is possible.

    It is never too high, and at most 1e-6 of it too low. Craft of weight 0 count.
    """
    least = least_bound([_arc(encounter, craft, 1.0) for craft in encounter.craft])
    return NeededBound(least.value_m_s2, tuple(np.flatnonzero(least.shares > _NEEDS_IT).tolist()))


def bound_encounter(solution: EncounterSolution, max_m_s2: float) -> BoundedEncounter:
    """Return the meeting of minimum group loss with |u| <= `max_m_s2` for every craft.

    A craft of weight 0 does not count in the choice of the meeting, but must reach it.

    Raises
    ------
    BoundTooSmallError
        If no meeting is possible with the bound, or a craft of weight 0 does not reach the meeting.
    """
    encounter = solution.encounter
    counted = [index for index, craft in enumerate(encounter.craft) if craft.weight > 0.0]
    arcs = [
        _arc(encounter, encounter.craft[index], encounter.craft[index].weight) for index in counted
    ]

    optimum = solve_bounded(arcs, max_m_s2)
    energies = np.empty(len(encounter.craft))
    energies[counted] = optimum.energies
    # The costate of each craft, and the edges of its time on the bound.
    solved = dict(zip(counted, zip(optimum.costates, optimum.edges_s, strict=True), strict=True))

    for index, craft in enumerate(encounter.craft):
        if index in solved:
            continue
        arc = _arc(encounter, craft, 1.0)
        # The meeting is given: no free values, of which `slope` would have the columns.
        to_point = Arc(
            arc.motion,
            arc.start_s,
            arc.end_s,
            arc.missing + arc.slope @ optimum.free,
            arc.slope[:, :0],
        )
        try:
            alone = solve_bounded([to_point], max_m_s2)
        except BoundTooSmallError:
            raise BoundTooSmallError(
                f"the craft {craft.name}, of weight 0, does not reach the meeting of the others "
                f"with at most {max_m_s2:g} m/s^2; it needs "
                f"{least_bound([to_point]).value_m_s2:.6g} m/s^2"
            ) from None
        energies[index] = alone.energies[0]
        solved[index] = (alone.costates[0], alone.edges_s[0])

    flights = tuple(
        BoundedFlight(
            craft.motion,
            craft.start_s,
            encounter.meeting_s,
            craft.state,
            solved[index][0],
            max_m_s2,
            solved[index][1],
        )
        for index, craft in enumerate(encounter.craft)
    )
    return BoundedEncounter(max_m_s2, optimum.free, energies, flights)


def _arc(encounter: Encounter, craft: Craft, weight: float) -> Arc:
    """Return the change of the terminal state by a craft's control, linear in the free values."""
    common = encounter.common
    coasted = craft.motion.transition(craft.start_s, encounter.meeting_s) @ craft.state
    missing = (encounter.base - coasted)[:common]
    return Arc(
        craft.motion,
        craft.start_s,
        encounter.meeting_s,
        missing,
        encounter.opening[:common],
        weight,
    )
