"""The Pareto set, choices from it, coalitions, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import trapezoid

from infoset.rendezvous.pareto import (
    Component,
    Core,
    Craft,
    Encounter,
    EncounterSolution,
    analyse_coalitions,
    distances,
    nearest_to,
    pareto_set,
    peak_control,
    simplex_weights,
    solve_encounter,
    total_impulse,
)
from infoset.rendezvous.relative_motion import ClohessyWiltshire

POSITION = (Component.X, Component.Y, Component.Z)


def some(
    seed: int,
    count: int,
    free: tuple[Component, ...] = POSITION,
    *,
    own_starts: bool = False,
    **changes: object,
) -> EncounterSolution:
    random = np.random.default_rng(seed)
    motion = ClohessyWiltshire(1.13e-3)
    scale = np.array([300.0] * 3 + [1.0] * 3)
    craft = tuple(
        Craft(
            str(each),
            random.normal(size=6) * scale,
            motion,
            float(random.uniform(0.5, 2.0)),
            float(random.uniform(0.0, 200.0)) if own_starts else 0.0,
        )
        for each in range(count)
    )
    return solve_encounter(replace(Encounter(craft, 600.0, free, np.zeros(6)), **changes))  # type: ignore[arg-type]


SEEDS = st.integers(0, 2**32 - 1)


@given(SEEDS, st.integers(2, 5), st.booleans())
@settings(max_examples=20, deadline=None)
def test_no_meeting_dominates_the_pareto_set(seed: int, count: int, own_starts: bool) -> None:
    solution = some(seed, count, own_starts=own_starts)
    random = np.random.default_rng(seed)
    found = pareto_set(solution, simplex_weights(count, 20))
    spread = float(np.ptp(solution.ideals, axis=0).max())
    elsewhere = solution.excess(found[:, None] + random.normal(size=(len(found), 50, 3)) * spread)
    excess = solution.excess(found)
    assert not (excess[:, None] - elsewhere > 1e-9 * excess.max()).all(axis=-1).any()


def test_the_front_of_two_in_closed_form() -> None:
    solution = some(1, 2)
    between = float(distances(solution)[0, 1])
    excess = solution.excess(pareto_set(solution, simplex_weights(2, 101)))
    np.testing.assert_allclose(np.sqrt(excess).sum(axis=1), between, rtol=1e-12)


@given(SEEDS, st.integers(2, 5), st.booleans())
@settings(max_examples=30, deadline=None)
def test_the_nearest_meeting_of_one_matrix(seed: int, count: int, own_starts: bool) -> None:
    free = (
        POSITION[:1] if own_starts else POSITION
    )  # the M of one component are multiples of each other
    solution = some(seed, count, free, own_starts=own_starts)
    random = np.random.default_rng(seed)
    root = solution.costs[0].root
    ideals = solution.ideals
    preferred = ideals.mean(axis=0) + 2.0 * random.normal(size=len(free)) * np.ptp(ideals, axis=0)
    points, target, near = (
        each @ root.T for each in (ideals, preferred, nearest_to(solution, preferred))
    )
    # The plane through the nearest point, across the way to the target, has the hull behind it.
    assert ((points - near) @ (target - near)).max() <= 1e-9 * np.abs(points - target).max() ** 2


@given(SEEDS, st.integers(1, 5), st.booleans())
@settings(max_examples=15, deadline=None)
def test_coalitions_are_superadditive_and_shares_add_up(
    seed: int, count: int, own_starts: bool
) -> None:
    solution = some(seed, count, own_starts=own_starts)
    found = analyse_coalitions(solution)
    worth = {each.members: each.excess for each in found.coalitions}
    size = worth[tuple(range(count))]
    assert size == pytest.approx(float(solution.group_loss()), rel=1e-9, abs=1e-12)
    for (one, first), (other, second) in product(worth.items(), worth.items()):
        if not set(one) & set(other):
            assert worth[tuple(sorted(one + other))] >= first + second - 1e-10 * size
    assert found.shapley.sum() == pytest.approx(size, rel=1e-10, abs=1e-12)
    assert found.transfers.sum() == pytest.approx(0.0, abs=1e-10 * (1.0 + size))
    assert (found.core is Core.ZERO) == (count == 1)
    assert found.core.reason
    # The Shapley value as it is defined: mean of what each adds over all orders of joining.
    added = np.zeros(count)
    orders = list(permutations(range(count)))
    for order in orders:
        for place, member in enumerate(order):
            joined = tuple(sorted(order[: place + 1]))
            before = tuple(sorted(order[:place]))
            added[member] += (worth[joined] - worth.get(before, 0.0)) / len(orders)
    np.testing.assert_allclose(found.shapley, added, rtol=1e-9, atol=1e-12)


def test_peak_and_impulse_of_a_flight() -> None:
    plan = some(6, 2).plan(0)
    times = np.linspace(0.0, 600.0, 200_001)
    sizes = np.linalg.norm(plan.control(times), axis=1)
    assert peak_control(plan) == pytest.approx(sizes.max(), rel=1e-9)
    assert total_impulse(plan) == pytest.approx(trapezoid(sizes, times), rel=1e-8)
