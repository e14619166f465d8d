"""Random tours and their edges against sampled times and brute force over orders."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import permutations

import numpy as np
import pytest
from scipy.optimize import minimize

from infoset.arrays import Floats
from infoset.rendezvous.multipoint import (
    Meet,
    TimeLimits,
    Tour,
    TourTarget,
    best_order,
    best_times,
)
from infoset.rendezvous.relative_motion import (
    ClohessyWiltshire,
    EllipticOrbit,
    LinearMotion,
    TschaunerHempel,
)

pytestmark = pytest.mark.thorough

Check = Callable[[int], None]

MANY = range(1000, 3000)
RESONANT = (4.493409457909, 11.06652863, 12.2010, 2.0 * np.pi, 4.0 * np.pi, np.pi)
"""Angles at which blocks of the transition matrix are singular."""


def some_tour(
    random: np.random.Generator, count: int, longest_rad: float, *, elliptic: float = 0.2
) -> tuple[Tour, Floats]:
    """A tour and times: gaps from tiny to many revolutions, resonant ones, stays, targets and
    chaser that coincide.
    """
    rate = 10.0 ** random.uniform(-5.0, -2.0)
    motion: LinearMotion = ClohessyWiltshire(rate)
    if random.random() < elliptic:
        motion = TschaunerHempel(
            EllipticOrbit(rate, float(random.choice([0.0, 0.1, 0.5])), random.uniform(0.0, 6.0))
        )
    kind = str(random.choice(["even", "wide", "resonant", "tiny"]))
    gaps = random.uniform(0.2, 2.5, size=count)
    if kind == "wide":
        gaps = 10.0 ** random.uniform(-2.0, np.log10(longest_rad), size=count)
    elif kind == "resonant":
        gaps = random.choice(RESONANT, size=count) * (
            1.0 + random.choice([0.0, 1e-9, 1e-3], size=count)
        )
    elif kind == "tiny":
        gaps[random.integers(count)] = 10.0 ** random.uniform(-5.0, -3.0)
    gaps = np.minimum(gaps, longest_rad / count) / rate
    share = random.choice([0.0, 0.4, 1.0])
    meets = [Meet.RENDEZVOUS if random.random() < share else Meet.FLYBY for _ in range(count)]
    stays = np.array(
        [
            random.choice([0.0, random.uniform(0.0, 1.0)]) / rate * (meet is Meet.RENDEZVOUS)
            for meet in meets
        ]
    )
    targets = tuple(
        TourTarget(str(at), meet, float(stay))
        for at, (meet, stay) in enumerate(zip(meets, stays, strict=True))
    )
    scale = np.array([1.0 / rate] * 3 + [1.0] * 3) * 10.0 ** random.uniform(-2.0, 1.0)
    states = random.normal(size=(count, 6)) * scale
    if count > 1 and random.random() < 0.2:
        states[1] = states[0]
    start = states[0] if random.random() < 0.1 else random.normal(size=6) * scale
    start_s = float(random.choice([0.0, random.uniform(-1.0, 1.0) / rate]))
    tour = Tour(motion, targets, states, start, start_s)
    return tour, start_s + np.cumsum(gaps) + np.concatenate([[0.0], np.cumsum(stays[:-1])])


def times_agree(seed: int) -> None:
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 4))
    tour, times = some_tour(random, count, 8.0, elliptic=0.1)
    stays = tour.dwell_s
    latest = float(times[-1])
    room = latest - tour.start_s - float(stays[:-1].sum())
    minimum = float(random.choice([0.0, 0.9 / count, random.uniform(0.01, 0.3)])) * room / count
    price = 0.0
    if random.random() < 0.4:
        price = tour.fly(range(count), times).cost / room * 10.0 ** random.uniform(-2.0, 1.0)
    limits = TimeLimits(latest, minimum, price)
    found = best_times(tour, range(count), limits)
    gaps = np.diff(np.concatenate([[tour.start_s], found.time_s])) - np.concatenate(
        [[0.0], stays[:-1]]
    )
    floor = max(minimum, 1e-6 * room)
    assert (gaps >= floor * (1.0 - 1e-9)).all()
    assert found.time_s[-1] <= latest + 1e-9 * room
    paid = price * float(found.time_s[-1] - tour.start_s)
    assert found.objective == pytest.approx(found.path.cost + paid, rel=1e-12)

    def objective(shares: Floats) -> float:
        each = floor + (room - count * floor) * shares
        at = tour.start_s + np.cumsum(each) + np.concatenate([[0.0], np.cumsum(stays[:-1])])
        return tour.fly(range(count), at).cost + price * float(at[-1] - tour.start_s)

    # No sample of the simplex of gaps is better, nor a descent from the best of them without
    # derivatives.
    tried = random.dirichlet(np.ones(count + 1), size=60)[:, :count]
    values = [objective(each) for each in tried]
    begin = tried[int(np.argmin(values))]

    def walled(shares: Floats) -> float:
        if (shares < 0.0).any() or shares.sum() > 1.0:
            return 1e3 * (1.0 + float(np.abs(shares).sum())) * min(values)
        return objective(shares)

    polished = minimize(
        walled, begin, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 0.0, "maxfev": 150}
    )
    best = min(float(polished.fun), *values)
    # A chaser that starts on its target pays nothing, up to the rounding of states.
    states = found.path.nodes.arrive
    rounding = 1e-30 * float(
        ((states[:, :3] ** 2).sum(axis=1) / gaps**3 + (states[:, 3:] ** 2).sum(axis=1) / gaps).sum()
    )
    assert found.objective <= best * (1.0 + 1e-6) + rounding


def order_and_times_agree(seed: int) -> None:
    random = np.random.default_rng(seed)
    tour, times = some_tour(random, 3, 8.0, elliptic=0.0)
    latest_s = float(times[-1])
    limits = TimeLimits(latest_s)
    found = best_order(tour, limits)
    room = latest_s - tour.start_s - tour.dwell_s.sum() + tour.dwell_s
    fitting = [order for order in permutations(range(3)) if room[order[-1]] > 0.0]
    assert found.order in fitting
    each = [best_times(tour, order, limits).objective for order in fitting]
    assert found.objective <= min(each) * (1.0 + 1e-6)


CHECKS = [times_agree]


@pytest.mark.parametrize("seed", [1097, 1099, 1428])
def test_best_times_are_in_the_lowest_of_several_valleys(seed: int) -> None:
    # From few starts, the valley of a worse minimum was found: 1.7 to 2.6 times the minimum cost.
    times_agree(seed)


@pytest.mark.parametrize("seed", [2, 65])
def test_orders_whose_stays_do_not_fit_are_left_out(seed: int) -> None:
    # The search failed as a whole.
    order_and_times_agree(seed)


@pytest.mark.parametrize("seed", [3, 15, 18, 76])
def test_order_is_kept_if_its_beginning_ends_in_a_local_minimum(seed: int) -> None:
    # The cost of a beginning at a local minimum of its times bounds nothing.
    order_and_times_agree(seed)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_many_random_tours(
    check: Check, check_seeds: Callable[[Check, Iterable[int]], None]
) -> None:
    check_seeds(check, MANY)


def test_many_orders_with_their_times(check_seeds: Callable[[Check, Iterable[int]], None]) -> None:
    check_seeds(order_and_times_agree, range(100))
