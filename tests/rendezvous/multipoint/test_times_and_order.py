from __future__ import annotations

import itertools

import numpy as np
import pytest

from infoset.rendezvous.multipoint import (
    Meet,
    NotSettledError,
    TimeLimits,
    Tour,
    TourTarget,
    best_order,
    best_order_of_slots,
    best_times,
)
from infoset.rendezvous.relative_motion import ClohessyWiltshire
from tests.rendezvous.multipoint.conftest import Make


def by_brute_force(tour: Tour, limits: TimeLimits) -> float:
    count = len(tour.targets)
    return min(
        best_times(tour, order, limits).objective for order in itertools.permutations(range(count))
    )


def random_tour(seed: int, count: int, share: float) -> Tour:
    random = np.random.default_rng(seed)
    motion = ClohessyWiltshire(1.1e-3)
    targets = tuple(
        TourTarget(str(index), Meet.RENDEZVOUS if random.random() < share else Meet.FLYBY)
        for index in range(count)
    )
    states = random.normal(size=(count, 6)) * np.array([300.0, 3000.0, 150.0, 0.1, 0.3, 0.1])
    states[:, 4] = -2.0 * 1.1e-3 * states[:, 0]
    return Tour(motion, targets, states, np.zeros(6))


LARGE = [
    pytest.param(*case, marks=pytest.mark.thorough)
    for case in ((0, 4), (1, 4), (2, 5), (3, 5), (4, 6))
]


@pytest.mark.parametrize(("seed", "count"), [(0, 3), (1, 3), (2, 3), *LARGE])
def test_branch_and_bound_agrees_with_brute_force(seed: int, count: int) -> None:
    tour = random_tour(seed, count, 0.3)
    limits = TimeLimits(latest_s=1500.0 * count)
    found = best_order(tour, limits)
    assert found.objective <= by_brute_force(tour, limits) * (1.0 + 1e-7)
    assert sorted(found.order) == [*range(count)]


@pytest.mark.parametrize("count", [2, 5])
@pytest.mark.parametrize("share", [0.0, 0.4, 1.0])
def test_orders_of_slots_agree_with_brute_force(count: int, share: float) -> None:
    tour = random_tour(10 + count, count, share)
    slots = 1200.0 * np.arange(1.0, count + 1.0)
    found = best_order_of_slots(tour, slots)
    costs = {order: tour.fly(order, slots).cost for order in itertools.permutations(range(count))}
    assert found.objective == pytest.approx(min(costs.values()), rel=1e-12)
    assert costs[found.order] == pytest.approx(min(costs.values()), rel=1e-12)


def with_a_stay(meet_all: Meet) -> Tour:
    """Five satellites of a train, one of which is visited for longer than most slots leave."""
    motion = ClohessyWiltshire(1.10e-3)
    states = np.array(
        [
            [120.0, 1500.0, 40.0, 0.02, -0.264, 0.03],
            [-90.0, 3000.0, 0.0, -0.04, 0.198, -0.06],
            [0.0, 6000.0, -60.0, 0.0, 0.0, 0.05],
            [60.0, 9000.0, 100.0, 0.0, -0.132, 0.0],
            [-30.0, 12000.0, 20.0, 0.01, 0.066, -0.02],
        ]
    )
    meets = [meet_all, meet_all, Meet.RENDEZVOUS, meet_all, Meet.RENDEZVOUS]
    stays = [0.0, 0.0, 2000.0, 0.0, 0.0]
    targets = tuple(
        TourTarget(name, meet, stay)
        for name, meet, stay in zip(
            ["alpha", "charlie", "bravo", "delta", "echo"], meets, stays, strict=True
        )
    )
    return Tour(motion, targets, states, np.array([0.0, -400.0, 0.0, 0.0, 0.0, 0.0]))


@pytest.mark.parametrize("meet", list(Meet))
def test_orders_that_do_not_fit_the_slots_are_left_out(meet: Meet) -> None:
    # The search failed as a whole where one order did not fit.
    tour = with_a_stay(meet)
    slots = np.array([1500.0, 3000.0, 4500.0, 7000.0, 10000.0])
    found = best_order_of_slots(tour, slots)
    fitting = {}
    for order in itertools.permutations(range(5)):
        if order.index(2) == 4 or slots[order.index(2) + 1] > slots[order.index(2)] + 2000.0:
            fitting[order] = tour.fly(order, slots).cost
    assert len(fitting) == 72
    assert found.objective == pytest.approx(min(fitting.values()), rel=1e-12)
    assert fitting[found.order] == pytest.approx(min(fitting.values()), rel=1e-12)
    if meet is Meet.FLYBY:
        assert found.objective == pytest.approx(0.065082, rel=1e-5)  # an independent search


@pytest.mark.parametrize("seed", range(4))
def test_visits_that_just_fit_are_not_refused_for_rounding(seed: int) -> None:
    random = np.random.default_rng(seed)
    motion = ClohessyWiltshire(1.1e-3)
    stays = random.uniform(10.0, 900.0, size=3)
    gap = float(random.uniform(10.0, 900.0))
    start_s = float(random.uniform(-1e5, 0.0))
    targets = tuple(
        TourTarget(str(at), Meet.RENDEZVOUS, float(stay)) for at, stay in enumerate(stays)
    )
    tour = Tour(motion, targets, random.normal(size=(3, 6)), random.normal(size=6), start_s)
    order = tuple(
        int(each) for each in np.argsort(stays)
    )  # the longest stay last: the only ones that fit
    times = start_s + np.cumsum(np.full(3, gap)) + np.append(0.0, np.cumsum(stays[list(order)])[:2])
    found = best_order(tour, TimeLimits(float(times[-1]), gap))
    swapped = (order[1], order[0], order[2])
    middle = (
        start_s + np.cumsum(np.full(3, gap)) + np.append(0.0, np.cumsum(stays[list(swapped)])[:2])
    )
    minimum = min(tour.fly(order, times).cost, tour.fly(swapped, middle).cost)
    assert found.objective == pytest.approx(minimum, rel=1e-7)


def test_a_price_counts_from_the_start() -> None:
    # A start before t = 0 made the objective negative, whose logarithm was minimised.
    motion = ClohessyWiltshire(1e-3)
    start_s = -5000.0
    state = np.array([[100.0, 0.0, 0.0, 0.0, 0.0, 0.0]])
    tour = Tour(motion, (TourTarget("T"),), state, np.zeros(6), start_s)
    limits = TimeLimits(0.0, price_per_s=1e-8)
    found = best_times(tour, (0,), limits)
    times = np.linspace(start_s + 10.0, 0.0, 2000)
    values = [tour.fly((0,), [each]).cost + 1e-8 * (each - start_s) for each in times]
    assert found.objective <= min(values)
    assert found.objective == pytest.approx(min(values), rel=1e-4)


def test_times_are_best_where_gaps_differ_by_orders_of_magnitude() -> None:
    # One scale for all gaps stopped short: 7.64e15 m^2/s^3 for 5.05e15.
    motion = ClohessyWiltshire(0.0001160954816406749)
    stays = (0.0, 0.0, 1668.0, 2202.0)
    targets = tuple(TourTarget(str(at), Meet.RENDEZVOUS, stay) for at, stay in enumerate(stays))
    states = np.array(
        [
            [-8445.0, 1719.0, -67260.0, 0.9361, 3.103, 2.776],
            [-85010.0, -149600.0, 16320.0, -6.633, -14.62, -0.3373],
            [-16320.0, -29660.0, 71540.0, 6.708, 10.97, 24.29],
            [-15920.0, 54100.0, 90570.0, -1.975, -4.053, 16.37],
        ]
    )
    start = np.array([-73820.0, 82590.0, -16610.0, 0.8657, 1.785, 9.601])
    price = 3.024e12
    tour = Tour(motion, targets, states, start)
    guess = np.array([17230.0, 31560.0, 31560.1489, 45030.0])
    found = best_times(tour, range(4), TimeLimits(price_per_s=price), [guess])
    gaps = np.diff(np.concatenate([[0.0], found.time_s])) - np.array([0.0, *stays[:3]])
    slope = np.cumsum((found.path.time_gradient + price * np.array([0.0, 0.0, 0.0, 1.0]))[::-1])[
        ::-1
    ]
    assert (gaps > 0.05).all()
    assert (np.abs(slope * gaps) <= 1e-4 * found.objective).all()


def test_times_that_are_not_a_minimum_are_refused(
    tours: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("infoset.rendezvous.multipoint.times._descend", lambda _, begin, *__: begin)
    monkeypatch.setattr("infoset.rendezvous.multipoint.times._polish", lambda _, best, *__: best)
    with pytest.raises(NotSettledError, match="are no minimum"):
        best_times(tours(3), (0, 1, 2), TimeLimits(latest_s=4000.0))
