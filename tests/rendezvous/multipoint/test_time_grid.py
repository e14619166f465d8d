from __future__ import annotations

import itertools

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.rendezvous.multipoint import (
    Effort,
    Meet,
    TimeLimits,
    Tour,
    TourTarget,
    best_order,
    best_times,
    optimise_times,
    search_grid,
    time_grid,
)
from infoset.rendezvous.relative_motion import (
    ClohessyWiltshire,
    EllipticOrbit,
    LinearMotion,
    TschaunerHempel,
)
from tests.rendezvous.multipoint.every_time import EveryTime

FLYBY, RENDEZVOUS = Meet


def random_tour(
    seed: int, meets: list[Meet], motion: LinearMotion | None = None, dwell_s: float = 0.0
) -> Tour:
    """Targets of random states, of a motion of one radian a second."""
    random = np.random.default_rng(seed)
    states = random.normal(size=(len(meets), 6)) * np.array([0.3, 1.0, 0.3, 0.3, 0.3, 0.3])
    states[:, 4] = -2.0 * states[:, 0]
    targets = tuple(
        TourTarget(str(number), meet, dwell_s if meet is RENDEZVOUS else 0.0)
        for number, meet in enumerate(meets)
    )
    start = np.append(0.2 * random.normal(size=2), np.zeros(4))
    return Tour(motion or ClohessyWiltshire(1.0), targets, states, start)


TWO_FLYBYS = Tour(
    ClohessyWiltshire(0.0001981097250033099),
    (TourTarget("A"), TourTarget("B")),
    np.array(
        [
            [-319.12593, 56.976535, -138.41578, 0.023090731, 0.1264439, -0.0145156],
            [170.37446, -1229.8808, -457.77365, 0.018522883, -0.067505675, -0.012964030],
        ]
    ),
    np.array([-149.27525, 188.63225, 0.0, 0.0, 0.0, 0.0]),
)
LATEST_S, GAP_S = 151431.23337079378, 1514.3
LIMITS = TimeLimits(LATEST_S, GAP_S)
"""Two flybys within 4.8 revolutions. Descents from 48 starting points ended at 6.29e-8 and 7.73e-8
m^2/s^3.
"""


@pytest.mark.parametrize(
    "guess", [None, (60000.0, 120000.0), (105000.0, 151000.0), (GAP_S, 2.0 * GAP_S)]
)
@pytest.mark.parametrize(("order", "lowest"), [((0, 1), 4.634e-8), ((1, 0), 4.949e-8)])
def test_best_times_do_not_depend_on_the_guess(
    order: tuple[int, int], lowest: float, guess: tuple[float, float] | None
) -> None:
    guesses = [] if guess is None else [np.array(guess)]
    found = best_times(TWO_FLYBYS, order, LIMITS, guesses)
    # The lowest known costs, rounded up to four digits; the case has eight.
    assert found.objective <= lowest


def test_order_of_two_flybys_has_the_lower_minimum() -> None:
    found = best_order(TWO_FLYBYS, LIMITS, [np.array([60000.0, 120000.0])])
    assert found.order == (0, 1)
    assert found.objective <= 4.634e-8


MIXED = [
    pytest.param([FLYBY, FLYBY, FLYBY], id="flybys"),
    pytest.param([RENDEZVOUS, RENDEZVOUS, RENDEZVOUS], id="rendezvous"),
    pytest.param([FLYBY, RENDEZVOUS, FLYBY, FLYBY], id="mixed"),
]
MOTIONS = [
    pytest.param(ClohessyWiltshire(1.0), id="circle"),
    pytest.param(TschaunerHempel(EllipticOrbit(1.0, 0.3, 1.0)), id="ellipse"),
]


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("meets", MIXED)
@pytest.mark.parametrize("dwell_s", [0.0, 0.4])
@pytest.mark.parametrize("order_is_given", [True, False])
def test_candidates_have_the_costs_of_their_paths(
    meets: list[Meet], motion: LinearMotion, dwell_s: float, order_is_given: bool
) -> None:
    tour = random_tour(1, meets, motion, dwell_s)
    order = range(len(meets)) if order_is_given else None

    found = search_grid(tour, TimeLimits(8.0, 0.1, 1e-3), order)

    assert found.candidates
    for candidate in found.candidates:
        path = tour.fly(candidate.order, candidate.time_s)
        # The quadratics and the paths' band matrix are different orders of the same operations,
        # with condition numbers below 1e6 for gaps of a tenth of a radian.
        assert candidate.objective == pytest.approx(
            path.cost + 1e-3 * candidate.time_s[-1], rel=1e-9
        )


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(seed, marks=pytest.mark.thorough) for seed in (1, 2))]
)
@pytest.mark.parametrize("meets", MIXED[:2])
@pytest.mark.parametrize("dwell_s", [0.0, 0.3])
def test_lowest_candidate_is_the_minimum_on_the_grid_of_three_visits(
    meets: list[Meet], seed: int, dwell_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Few times, so that a flight for each combination takes less than a second.
    monkeypatch.setattr(time_grid, "MIN_TIMES", 7)
    monkeypatch.setattr(time_grid, "TIMES_PER_RADIAN", 0.1)
    tour = random_tour(seed, meets, dwell_s=dwell_s)
    latest_s = 9.0
    gap_s = 0.2
    stays = 2.0 * tour.dwell_s[0]
    steps = np.linspace(0.0, latest_s - 3.0 * gap_s - stays, 7)

    found = search_grid(tour, TimeLimits(latest_s, gap_s))

    assert found.grid.times == 7
    shifts = gap_s * np.arange(1.0, 4.0) + tour.dwell_s[0] * np.arange(3.0)
    costs = [
        tour.fly(order, np.array(times) + shifts).cost
        for order in itertools.permutations(range(3))
        for times in itertools.combinations_with_replacement(steps, 3)
    ]
    assert found.candidates[0].objective == pytest.approx(min(costs), rel=1e-9)


def lowest_of_every_time(tour: Tour, latest_s: float) -> float:
    """The lowest of the minima near the 200 lowest costs of a grid on which nothing is left out."""
    count = len(tour.targets)
    a_revolution = 40 if count == 2 else 20
    every = EveryTime(tour, latest_s, int(a_revolution * latest_s / (2.0 * np.pi)) + 1)
    fly = tour.flyer(range(count))
    limits = TimeLimits(latest_s)
    ends = [
        optimise_times(fly, 0.0, np.zeros(count), limits, [times], effort=Effort.VALLEY).objective
        for times in every.minima(200)
    ]
    return min(ends)


QUICK = [(2, 6.0), (2, 30.0), (3, 12.0)]
LONG = [(count, float(latest)) for count in (2, 3) for latest in np.geomspace(6.0, 60.0, 20)]


@pytest.mark.parametrize(
    ("seed", "count", "latest_s"),
    [
        *(pytest.param(seed, *case) for seed, case in enumerate(QUICK)),
        *(
            pytest.param(100 + seed, *case, marks=pytest.mark.thorough)
            for seed, case in enumerate(LONG)
        ),
        # One quadratic for two times, and one time of the visit before a last rendezvous, missed
        # their minima.
        *(pytest.param(200 + seed, 3, 58.0, marks=pytest.mark.thorough) for seed in range(6)),
    ],
)
def test_best_times_agree_with_a_search_of_every_time(
    seed: int, count: int, latest_s: float
) -> None:
    random = np.random.default_rng(seed)
    meets = [RENDEZVOUS if random.random() < 0.25 else FLYBY for _ in range(count)]
    tour = random_tour(seed, meets)
    found = best_times(tour, range(count), TimeLimits(latest_s))
    assert found.objective <= 1.001 * lowest_of_every_time(tour, latest_s)


ORDERS = [
    (0, 3, 10.0),
    *(pytest.param(seed, 4, 25.0, marks=pytest.mark.thorough) for seed in range(1, 5)),
]


@pytest.mark.parametrize(("seed", "count", "latest_s"), ORDERS)
def test_best_order_is_the_best_of_all_orders_at_their_best_times(
    seed: int, count: int, latest_s: float
) -> None:
    random = np.random.default_rng(seed)
    meets = [RENDEZVOUS if random.random() < 0.3 else FLYBY for _ in range(count)]
    tour = random_tour(seed, meets)
    limits = TimeLimits(latest_s)
    found = best_order(tour, limits)
    each = [
        best_times(tour, order, limits).objective for order in itertools.permutations(range(count))
    ]
    assert found.objective <= min(each) * 1.001


def test_latest_time_follows_from_a_price() -> None:
    tour = random_tour(5, [FLYBY, FLYBY])
    price = 1e-3
    long = best_times(tour, (0, 1), TimeLimits(60.0, price_per_s=price))
    found = best_times(tour, (0, 1), TimeLimits(price_per_s=price), [np.array([3.0, 6.0])])
    # Later than the guess, and before eight times the guess.
    assert 6.0 < long.time_s[-1] < 48.0
    assert found.objective == pytest.approx(long.objective, rel=1e-9)


def test_progress_rises_to_one() -> None:
    shares: list[float] = []
    best_order(random_tour(2, [FLYBY, RENDEZVOUS, FLYBY]), TimeLimits(6.0), progress=shares.append)
    assert shares == sorted(shares)
    assert shares[0] > 0.0
    assert shares[-1] == pytest.approx(1.0, rel=1e-12)


def test_visits_without_room_are_refused() -> None:
    with pytest.raises(ValueError, match="2 visits do not fit before the latest time"):
        best_order(random_tour(2, [FLYBY, RENDEZVOUS]), TimeLimits(6.0, 4.0))


def test_grid_of_many_targets_has_fewer_times() -> None:
    tour = random_tour(3, [RENDEZVOUS] * 9)
    few = time_grid._TimeGrid(tour, TimeLimits(60.0), None)
    many = time_grid._TimeGrid(tour, TimeLimits(60.0), range(9))
    times: list[Floats] = [few._steps_s, many._steps_s]
    assert len(times[0]) < len(times[1]) <= time_grid.MAX_TIMES
