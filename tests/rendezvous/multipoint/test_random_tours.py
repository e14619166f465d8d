"""Random tours and their edges against least squares over controls, grids of times and brute force over orders."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import pairwise, permutations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import minimize, minimize_scalar

from rendezvous.multipoint import (
    DriftingTargets,
    Meet,
    NotSettledError,
    Path,
    Target,
    TimeLimits,
    Tour,
    best_order,
    best_order_of_slots,
    best_times,
)
from rendezvous.piecewise import max_control
from rendezvous.relative_motion import ClohessyWiltshire, EllipticOrbit, LinearMotion, TschaunerHempel

pytestmark = pytest.mark.thorough

Floats = NDArray[np.float64]
Check = Callable[[int], None]

FEW = range(8)
MANY = range(1000, 3000)
"""Seeds in the default suite, and in the slow one."""
RESONANT = (4.493409457909, 11.06652863, 12.2010, 2.0 * np.pi, 4.0 * np.pi, np.pi)
"""Angles at which blocks of the transition matrix are singular."""


def some_tour(
    random: np.random.Generator, count: int, longest_rad: float, *, elliptic: float = 0.2
) -> tuple[Tour, Floats]:
    """A tour and times: gaps from tiny to many revolutions, resonant ones, stays, targets and chaser that coincide."""
    rate = 10.0 ** random.uniform(-5.0, -2.0)
    motion: LinearMotion = ClohessyWiltshire(rate)
    if random.random() < elliptic:
        motion = TschaunerHempel(EllipticOrbit(rate, float(random.choice([0.0, 0.1, 0.5])), random.uniform(0.0, 6.0)))
    kind = str(random.choice(["even", "wide", "resonant", "tiny"]))
    gaps = random.uniform(0.2, 2.5, size=count)
    if kind == "wide":
        gaps = 10.0 ** random.uniform(-2.0, np.log10(longest_rad), size=count)
    elif kind == "resonant":
        gaps = random.choice(RESONANT, size=count) * (1.0 + random.choice([0.0, 1e-9, 1e-3], size=count))
    elif kind == "tiny":
        gaps[random.integers(count)] = 10.0 ** random.uniform(-5.0, -3.0)
    gaps = np.minimum(gaps, longest_rad / count) / rate
    share = random.choice([0.0, 0.4, 1.0])
    meets = [Meet.RENDEZVOUS if random.random() < share else Meet.FLYBY for _ in range(count)]
    stays = np.array(
        [random.choice([0.0, random.uniform(0.0, 1.0)]) / rate * (meet is Meet.RENDEZVOUS) for meet in meets]
    )
    targets = tuple(
        Target(str(at), meet, float(stay)) for at, (meet, stay) in enumerate(zip(meets, stays, strict=True))
    )
    scale = np.array([1.0 / rate] * 3 + [1.0] * 3) * 10.0 ** random.uniform(-2.0, 1.0)
    states = random.normal(size=(count, 6)) * scale
    if count > 1 and random.random() < 0.2:
        states[1] = states[0]
    start = states[0] if random.random() < 0.1 else random.normal(size=6) * scale
    start_s = float(random.choice([0.0, random.uniform(-1.0, 1.0) / rate]))
    tour = Tour(motion, DriftingTargets(targets, motion, states), start, start_s)
    return tour, start_s + np.cumsum(gaps) + np.concatenate([[0.0], np.cumsum(stays[:-1])])


def transitions(motion: LinearMotion, times: Floats) -> Floats:
    """Phi(t, t_0) at rising times by DOP853, in states divided by (T, T, T, 1, 1, 1)."""
    duration = float(times[-1] - times[0])
    scale = np.array([duration] * 3 + [1.0] * 3)

    def rates(share: float, values: Floats) -> Floats:
        matrix = motion.dynamics(times[0] + share * duration) * (scale / scale[:, None]) * duration
        return np.asarray((matrix @ values.reshape(6, 6)).ravel())

    shares = (times - times[0]) / duration
    shares[-1] = 1.0
    found = solve_ivp(
        rates, (0.0, 1.0), np.eye(6).ravel(), method="DOP853", rtol=1e-13, atol=1e-14, t_eval=shares, max_step=0.25
    )
    return np.asarray(found.y.T.reshape(-1, 6, 6))


def least_squares(tour: Tour, times: Floats) -> tuple[float, float]:
    """The minimum cost over controls at Gauss points, stretch by stretch between rendezvous, and its doubt."""
    places, weights = np.polynomial.legendre.leggauss(10)
    targets, cost, doubt = tour.targets, 0.0, 0.0
    begin_s, begin, first = tour.start_s, tour.start_state, 0
    for last, target in enumerate(targets.targets):
        if target.meet is Meet.FLYBY and last < len(times) - 1:
            continue
        stops = np.concatenate([[begin_s], times[first : last + 1]])
        duration = float(stops[-1] - begin_s)
        grids, shares = [], []
        for low, high in pairwise(stops):
            turned = tour.motion.breaks(float(low), float(high))
            edges = np.unique(np.concatenate([turned, 0.5 * (turned[1:] + turned[:-1])]))
            half = 0.5 * np.diff(edges)
            grids.append((edges[:-1, None] + half[:, None] * (1.0 + places)).ravel())
            shares.append((half[:, None] * weights).ravel() / duration)
        nodes, share = np.concatenate(grids), np.concatenate(shares)
        everything = np.unique(np.concatenate([stops, nodes]))
        phi = transitions(tour.motion, everything)
        scale = np.array([duration] * 3 + [1.0] * 3)
        inverse = np.linalg.inv(phi[np.searchsorted(everything, nodes)])[:, :, 3:] * np.sqrt(share)[:, None, None]
        rows, right = [], []
        for place in range(first, last + 1):
            wanted = 6 if targets.targets[place].meet is Meet.RENDEZVOUS else 3
            here = phi[np.searchsorted(everything, times[place])]
            effect = np.where((nodes < times[place])[:, None, None], here @ inverse, 0.0)
            goal = targets.states(np.array([place]), times[place : place + 1])[0] / scale - here @ (begin / scale)
            rows.append(effect.transpose(1, 0, 2).reshape(6, -1)[:wanted])
            right.append(goal[:wanted])
        system, goals = np.concatenate(rows), np.concatenate(right)
        size = np.linalg.norm(system, axis=1)
        system, goals = system / size[:, None], goals / size
        found = np.linalg.lstsq(system, goals, rcond=1e-15)[0]
        values = np.linalg.svd(system, compute_uv=False)
        cost += 0.5 * float(found @ found) / duration
        # What rounding and integration of the goals leave, through the minimum singular value.
        wrong = 1e-12 * float(np.abs(begin / scale).max() * np.abs(phi).max() / size.min() + np.abs(goals).max())
        doubt += float(np.sqrt(2.0 * cost * duration) * wrong / values[-1] + (wrong / values[-1]) ** 2) / duration
        leave = times[last] + target.dwell_s
        begin_s, first = float(leave), last + 1
        begin = targets.states(np.array([last]), np.array([leave]))[0]
    return cost, doubt


def the_path_agrees(seed: int) -> None:
    random = np.random.default_rng(seed)
    tour, times = some_tour(random, int(random.integers(1, 6)), 30.0)
    path = tour.fly(range(len(times)), times)
    cost, doubt = least_squares(tour, times)
    assert path.cost == pytest.approx(cost, rel=1e-7, abs=10.0 * doubt)


def the_peak_agrees(seed: int) -> None:
    random = np.random.default_rng(seed)
    tour, times = some_tour(random, int(random.integers(1, 4)), 1000.0)
    path = tour.fly(range(len(times)), times)
    found = max_control(path.control, path.breaks())
    top = sampled_peak(path)
    rounding = 1e-14 * float(np.abs(times).max() / (times - path.starts_s).min())
    assert found == pytest.approx(top, rel=1e-8 + rounding)
    assert found >= top * (1.0 - 1e-9 - rounding)


def sampled_peak(path: Path) -> float:
    """The maximum of many samples of each leg, searched for around the maximum of them."""
    top = 0.0
    for start, end in zip(path.starts_s, path.nodes.arrive_s, strict=True):
        times = np.linspace(start, end, 3001)
        if isinstance(path.motion, TschaunerHempel):  # more of them near the periapsis
            orbit = path.motion.orbit
            first, last = (float(each) for each in orbit.eccentric_anomaly(np.array([start, end])))
            times = orbit.time_of_eccentric(np.linspace(first, last, 6001))
            times[0] = start
        times[-1] = np.nextafter(end, start)  # at the end itself the next leg begins
        sizes = np.linalg.norm(path.control(times), axis=1)
        top = max(top, float(sizes.max()))
        inside = np.pad(sizes, 1, constant_values=-1.0)
        humps = np.flatnonzero((inside[1:-1] >= inside[:-2]) & (inside[1:-1] >= inside[2:]))
        for at in humps[np.argsort(sizes[humps])[-30:]]:
            low, high = times[max(at - 1, 0)], times[min(at + 1, len(times) - 1)]
            found = minimize_scalar(
                lambda time: -float(np.linalg.norm(path.control(np.array([time])))),
                bounds=(low, high),
                options={"xatol": 1e-9 * (high - low)},
            )
            top = max(top, -float(found.fun))
    return top


def slots_agree(seed: int) -> None:
    random = np.random.default_rng(seed)
    tour, times = some_tour(random, int(random.choice([1, 2, 3, 4, 4, 5])), 12.0, elliptic=0.05)
    if random.random() < 0.5:  # nearer to each other, so that stays do not fit everywhere
        times = tour.start_s + (times - tour.start_s) * random.uniform(0.3, 1.0)
    costs: dict[tuple[int, ...], float] = {}
    unfit = 0
    stays = tour.dwell_s
    for order in permutations(range(len(times))):
        leave = times[:-1] + stays[list(order[:-1])]
        if (times[1:] <= leave).any():
            unfit += 1
            continue
        try:
            costs[order] = tour.fly(order, times).cost
        except NotSettledError:
            continue
    if not costs:
        with pytest.raises(ValueError, match=r"no order (fits|has a path)"):
            best_order_of_slots(tour, times)
        return
    found = best_order_of_slots(tour, times)
    assert found.unfit == unfit
    assert found.objective == pytest.approx(min(costs.values()), rel=1e-9)
    assert costs[found.order] == pytest.approx(min(costs.values()), rel=1e-9)


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
    gaps = np.diff(np.concatenate([[tour.start_s], found.time_s])) - np.concatenate([[0.0], stays[:-1]])
    floor = max(minimum, 1e-6 * room)
    assert (gaps >= floor * (1.0 - 1e-9)).all()
    assert found.time_s[-1] <= latest + 1e-9 * room
    paid = price * float(found.time_s[-1] - tour.start_s)
    assert found.objective == pytest.approx(found.path.cost + paid, rel=1e-12)

    def objective(shares: Floats) -> float:
        each = floor + (room - count * floor) * shares
        at = tour.start_s + np.cumsum(each) + np.concatenate([[0.0], np.cumsum(stays[:-1])])
        return tour.fly(range(count), at).cost + price * float(at[-1] - tour.start_s)

    # No sample of the simplex of gaps is better, nor a descent from the best of them without derivatives.
    tried = random.dirichlet(np.ones(count + 1), size=60)[:, :count]
    values = [objective(each) for each in tried]
    begin = tried[int(np.argmin(values))]

    def walled(shares: Floats) -> float:
        if (shares < 0.0).any() or shares.sum() > 1.0:
            return 1e3 * (1.0 + float(np.abs(shares).sum())) * min(values)
        return objective(shares)

    polished = minimize(walled, begin, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 0.0, "maxfev": 150})
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
    assert found.unfit == 6 - len(fitting)
    assert found.order in fitting
    each = [best_times(tour, order, limits).objective for order in fitting]
    assert found.objective <= min(each) * (1.0 + 1e-6)


CHECKS = [the_path_agrees, the_peak_agrees, slots_agree, times_agree]


@pytest.mark.parametrize("seed", FEW)
@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_random_tours(check: Check, seed: int) -> None:
    check(seed)


@pytest.mark.parametrize("seed", [1097, 1099, 1428])
def test_times_in_the_lowest_of_several_valleys(seed: int) -> None:
    # From few starts, the valley of a worse minimum was found: 1.7 to 2.6 times the minimum cost.
    times_agree(seed)


@pytest.mark.parametrize("seed", [2, 65])
def test_orders_whose_stays_do_not_fit_are_left_out(seed: int) -> None:
    # The search failed as a whole.
    order_and_times_agree(seed)


@pytest.mark.parametrize("seed", [3, 15, 18, 76])
def test_an_order_is_not_dropped_for_a_local_minimum_of_its_beginning(seed: int) -> None:
    # The cost of a beginning at a local minimum of its times bounds nothing.
    order_and_times_agree(seed)


@pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
def test_many_random_tours(check: Check, check_seeds: Callable[[Check, Iterable[int]], None]) -> None:
    check_seeds(check, MANY)


def test_many_orders_with_their_times(check_seeds: Callable[[Check, Iterable[int]], None]) -> None:
    check_seeds(order_and_times_agree, range(100))
