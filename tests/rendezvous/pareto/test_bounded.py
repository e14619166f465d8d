"""Encounters with a bound on the control."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.rendezvous.bounded_control import Arc, BoundTooSmallError, solve_bounded
from infoset.rendezvous.pareto import (
    Component,
    Craft,
    Encounter,
    Meeting,
    bound_encounter,
    needed_bound,
    peak_control,
    solve_encounter,
    total_impulse,
)
from infoset.rendezvous.relative_motion import ClohessyWiltshire

MOTION = ClohessyWiltshire(0.001176)
# The published example, in Hill's axes.
STATES = np.array(
    [
        [60.0, 0.0, 80.0, -4.1115, 1.2328, 0.0369],
        [-50.0, -40.0, 60.0, 7.6229, 9.0613, 0.065],
        [-80.0, 10.0, -30.0, -7.2583, 4.9545, -0.0841],
    ]
)
CRAFT = tuple(Craft(name, state, MOTION) for name, state in zip("abc", STATES, strict=True))
ENCOUNTER = Encounter(CRAFT, 30.0, (Component.X, Component.Z), np.zeros(6))


def total_cost(x_z_m: Floats, bound: float) -> float:
    """Sum of the costs with a bound, each craft alone, at a given meeting."""
    meeting = np.array([x_z_m[0], 0.0, x_z_m[1], 0.0, 0.0, 0.0])
    missing = [meeting - MOTION.transition(0.0, 30.0) @ state for state in STATES]
    return sum(
        float(solve_bounded([Arc(MOTION, 0.0, 30.0, each, np.zeros((6, 0)))], bound).energies[0])
        for each in missing
    )


@pytest.mark.parametrize("bound", [1.4, 1.1, 0.93])
def test_bounded_meeting_costs_less_than_those_around_it(bound: float) -> None:
    found = bound_encounter(solve_encounter(ENCOUNTER), bound)

    least = float(found.cost_squared.sum())
    assert total_cost(found.point, bound) == pytest.approx(least, rel=1e-9)
    for turn in np.linspace(0.0, 2.0 * np.pi, 9)[:-1]:
        beside = found.point + 0.3 * np.array([np.cos(turn), np.sin(turn)])
        assert total_cost(beside, bound) > least


def test_flights_within_the_bound_reach_the_meeting() -> None:
    found = bound_encounter(solve_encounter(ENCOUNTER), 1.0)

    for flight, cost in zip(found.flights, found.cost_squared, strict=True):
        end = flight.state(np.array([30.0]))[0]
        np.testing.assert_allclose(end[[0, 2]], found.point, atol=1e-8)
        np.testing.assert_allclose(end[[1, 3, 4, 5]], 0.0, atol=1e-8)
        assert peak_control(flight) <= 1.0 + 1e-9
        # Cauchy and Schwarz: the impulse is at most the cost times the root of the duration.
        assert total_impulse(flight) <= np.sqrt(cost * 30.0)


def test_bound_above_the_peak_changes_nothing() -> None:
    solution = solve_encounter(ENCOUNTER)
    peak = max(peak_control(solution.plan(index)) for index in range(3))

    found = bound_encounter(solution, 1.0001 * peak)

    np.testing.assert_allclose(found.point, solution.point, rtol=1e-9)
    np.testing.assert_allclose(found.cost_squared, solution.cost_squared(), rtol=1e-9)


def test_needed_bound_is_the_smallest_peak_of_any_meeting() -> None:
    needed = needed_bound(ENCOUNTER)

    # The first craft has a margin; the other two decide, and their meeting is possible just above
    # the bound.
    assert needed.craft == (1, 2)
    bound_encounter(solve_encounter(ENCOUNTER), 1.001 * needed.value_m_s2)
    with pytest.raises(BoundTooSmallError):
        bound_encounter(solve_encounter(ENCOUNTER), 0.999 * needed.value_m_s2)


def test_craft_of_weight_zero_must_reach_the_meeting_of_the_others() -> None:
    without = replace(ENCOUNTER, craft=(CRAFT[0], CRAFT[1], replace(CRAFT[2], weight=0.0)))
    pair = solve_encounter(replace(ENCOUNTER, craft=CRAFT[:2]))
    with pytest.raises(
        BoundTooSmallError, match="the craft c, of weight 0, does not reach the meeting"
    ):
        bound_encounter(solve_encounter(without), 1.0)

    found = bound_encounter(solve_encounter(without), 1.25)

    # The first two fly as if they were alone.
    alone = bound_encounter(pair, 1.25)
    np.testing.assert_allclose(found.point, alone.point, rtol=1e-12)
    np.testing.assert_allclose(found.cost_squared[:2], alone.cost_squared, rtol=1e-12)
    assert peak_control(found.flights[2]) == pytest.approx(1.25, rel=1e-9)


def test_late_starts_and_an_intercept() -> None:
    craft = (replace(CRAFT[0], start_s=5.0), CRAFT[1], CRAFT[2])
    free = (Component.X, Component.Z)
    encounter = Encounter(craft, 30.0, free, np.zeros(6), Meeting.INTERCEPT)
    solution = solve_encounter(encounter)
    peak = max(peak_control(solution.plan(index)) for index in range(3))
    bound = 0.5 * (peak + needed_bound(encounter).value_m_s2)

    found = bound_encounter(solution, bound)

    for flight in found.flights:
        end = flight.state(np.array([30.0]))[0]
        np.testing.assert_allclose(end[:3], [found.point[0], 0.0, found.point[1]], atol=1e-8)
        assert peak_control(flight) <= bound * (1.0 + 1e-9)
    assert (found.cost_squared.sum() > solution.cost_squared().sum() * (1.0 - 1e-12)).all()
