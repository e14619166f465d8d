"""The best order of visits: branch and bound, order and times together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.multipoint.segments import Flown, NotSettledError, Path, check_times, solve_segments
from rendezvous.multipoint.targets import Meet
from rendezvous.multipoint.times import BestTimes, Effort, NoRoomError, TimeLimits, optimise_times, room_s
from rendezvous.multipoint.tour import SMOOTH, Tour, Visits, nodes_of

Floats = NDArray[np.float64]
Report = Callable[[float], None]

MOST_TARGETS = 9
_MARGIN = 1e-4


@dataclass(frozen=True, eq=False)
class BestOrder:
    """Targets visited in their best order.

    Parameters
    ----------
    order : tuple of int
        Which target first, second and so on.
    path : Path
    objective : float
        Energy, and the price of the time, m^2/s^3.
    nodes : int
        How many beginnings of orders were looked at.
    evaluations : int
        How many paths were computed.
    lost : tuple of tuple of int
        Beginnings of orders that were left out, for no path was found.
    unfit : int
        How many orders do not fit: a stay ends after the next of given times, or stays leave no time for travelling
        before the latest time.
    """

    order: tuple[int, ...]
    path: Path
    objective: float
    nodes: int
    evaluations: int
    lost: tuple[tuple[int, ...], ...] = ()
    unfit: int = 0


def best_order(
    tour: Visits, limits: TimeLimits, guesses: Sequence[Floats] = (), *, progress: Report | None = None
) -> BestOrder:
    """Find the best order and the best times together.

    Parameters
    ----------
    tour : Visits
    limits : TimeLimits
    guesses : sequence of ndarray, shape (n,)
        Times to start from, s, whatever the order, beside those of its own.
    progress : callable or None
        Told the share of orders that are decided.

    Returns
    -------
    BestOrder

    Raises
    ------
    ValueError
        If there are more than 9 targets, or they do not fit before the latest time.
    NotSettledError
        If no order has a path that is found.

    Notes
    -----
    Depth first, the cheapest beginning first. A beginning costs, at its own best times, no more than any order that
    goes on from it: what it costs bounds them all, and warms their start. That holds of global minima. The minima that
    are found are local, so that the order is the best of those found: a beginning is dropped only where more starts
    find no lower minimum, in Kepler's motion with a factor too (`ruggedness`).
    """
    count = _checked_count(tour)
    dwell = tour.dwell_s
    unfit = _orders_without_room(tour.start_s, dwell, limits)
    horizon = limits.latest_s

    def solve(order: tuple[int, ...], warm: Sequence[Floats], careful: bool) -> tuple[float, Flown, int]:
        complete, held, enough = len(order) == count, limits, -np.inf
        if not complete:
            if horizon is not None:
                rest = [each for each in range(count) if each not in order]
                later = dwell[order[-1]] + dwell[rest].sum() - dwell[rest].max() + len(rest) * limits.least_gap_s
                held = TimeLimits(horizon - float(later), limits.least_gap_s, limits.price_per_s)
            if np.isfinite(search.best_objective):
                enough = search.best_objective
        effort = Effort.BOUND if warm else Effort.ORDER
        if careful:
            effort = Effort.RUGGED if tour.ruggedness > SMOOTH else Effort.ORDER
        begins = [*warm, *guesses] if complete else warm
        found = optimise_times(
            tour.flyer(order), tour.start_s, dwell[list(order)], held, begins, effort=effort, enough=enough
        )
        return found.objective, found.flown, found.evaluations

    # Where local minima lie far apart a beginning's is no bound, and is taken for one that much lower.
    slack = tour.ruggedness if tour.ruggedness > SMOOTH else 1.0 / (1.0 - _MARGIN)
    search = _Search(solve, count, progress or (lambda _: None), tour.start_s, horizon, slack, looks_twice=True)
    search.branch((), None)
    best = search.found()
    final = optimise_times(
        tour.flyer(search.best),
        tour.start_s,
        dwell[list(search.best)],
        limits,
        [best.nodes.arrive_s, *guesses],
    )
    evaluations = search.evaluations + final.evaluations
    lost = tuple(search.lost)
    return BestOrder(search.best, final.path, final.objective, search.nodes, evaluations, lost, unfit)


def best_order_of_slots(tour: Visits, time_s: ArrayLike, *, progress: Report | None = None) -> BestOrder:
    """Find the best order where the times of the first, second and so on visit are given.

    Parameters
    ----------
    tour : Visits
    time_s : array_like, shape (n,)
        Increasing.
    progress : callable or None
        Told the share of orders that are decided.

    Returns
    -------
    BestOrder

    Raises
    ------
    ValueError
        If there are more than 9 targets, times do not increase, or no order fits them.
    NotSettledError
        If no order that fits has a path that is found.

    Notes
    -----
    Dynamic programming over (visited, last) where every visit is a rendezvous, for then a leg's cost depends on its two
    ends alone; else branch and bound. Orders in which a stay ends after the next visit do not fit and are left out.
    """
    count, times = _checked_count(tour), np.asarray(time_s, dtype=np.float64)
    if times.shape != (count,):
        raise ValueError(f"{count} visits need {count} times, found {times.size}")
    check_times(tour.start_s, times, times)
    # Whether each target may be visited at each time: its stay must end before the next visit.
    fits = times[:, None] + tour.dwell_s < np.append(times[1:], np.inf)[:, None]
    unfit = factorial(count) - _orders_that_fit(fits)
    if unfit == factorial(count):
        raise ValueError(
            "no order fits the times: in each one a stay ends after the next visit; make times farther apart, or "
            "stays shorter"
        )
    if isinstance(tour, Tour) and all(each.meet is Meet.RENDEZVOUS for each in tour.targets.targets):
        return _by_dynamic_programming(tour, times, fits, unfit)

    def solve(order: tuple[int, ...], _warm: Sequence[Floats], _careful: bool) -> tuple[float, Flown, int]:
        flown = tour.flyer(order)(times[: len(order)])
        return flown.cost, flown, 1

    slack = tour.ruggedness if tour.ruggedness > SMOOTH else 1.0
    search = _Search(
        solve, count, progress or (lambda _: None), tour.start_s, None, slack, looks_twice=False, fits=fits
    )
    search.branch((), None)
    path = search.found().settled()
    lost = tuple(search.lost)
    return BestOrder(search.best, path, path.cost, search.nodes, search.evaluations, lost, unfit)


def best_times(
    tour: Visits,
    order: Sequence[int],
    limits: TimeLimits,
    guesses: Sequence[Floats] = (),
    *,
    progress: Report | None = None,
) -> BestTimes:
    """Find the best times of one order.

    Parameters
    ----------
    tour : Visits
    order : sequence of int
    limits : TimeLimits
    guesses : sequence of ndarray, shape (N,)
        Times to start from, beside those of its own.
    progress : callable or None
        Told the share of starts that are followed.

    Returns
    -------
    BestTimes
    """
    return optimise_times(
        tour.flyer(order),
        tour.start_s,
        tour.dwell_s[list(order)],
        limits,
        guesses,
        progress=progress,
    )


@dataclass
class _Search:
    """Depth first through beginnings of orders."""

    solve: Callable[[tuple[int, ...], Sequence[Floats], bool], tuple[float, Flown, int]]
    count: int
    progress: Report
    start_s: float
    horizon_s: float | None
    slack: float
    looks_twice: bool
    fits: NDArray[np.bool_] | None = None
    best: tuple[int, ...] = ()
    best_path: Flown | None = None
    best_objective: float = np.inf
    nodes: int = 0
    evaluations: int = 0
    decided: int = 0
    lost: list[tuple[int, ...]] = field(default_factory=list)

    def found(self) -> Flown:
        """The path of the best order."""
        if self.best_path is None:
            raise NotSettledError("no order has a path that was found; give visits more time")
        return self.best_path

    def branch(self, beginning: tuple[int, ...], before: Flown | None) -> None:
        """Look at all orders that go on from a beginning."""
        children = []
        for target in (each for each in range(self.count) if each not in beginning):
            order = (*beginning, target)
            if self.fits is not None and not self.fits[len(beginning), target]:
                self._done(order)
                continue
            self.nodes += 1
            try:
                objective, path = self._look(order, self._warm(before), careful=False)
            except NoRoomError:
                self._done(order)
            except NotSettledError:
                self.lost.append(order)
                self._done(order)
            else:
                children.append((objective, order, path))
        for objective, order, path in sorted(children, key=lambda each: each[:2]):
            complete = len(order) == self.count
            lowest, best_path = objective, path
            if self.looks_twice and (complete or objective >= self.slack * self.best_objective):
                # What was found is a local minimum: more starts before an order is taken, or a beginning dropped.
                with suppress(NotSettledError):
                    again, other = self._look(order, [path.nodes.arrive_s], careful=True)
                    if again < objective:
                        lowest, best_path = again, other
            if complete:
                self._done(order)
                if lowest < self.best_objective:
                    self.best, self.best_path, self.best_objective = order, best_path, lowest
            elif lowest < self.slack * self.best_objective:
                self.branch(order, best_path)
            else:
                self._done(order)

    def _look(self, order: tuple[int, ...], warm: Sequence[Floats], careful: bool) -> tuple[float, Flown]:
        objective, path, evaluations = self.solve(order, warm, careful)
        self.evaluations += evaluations
        return objective, path

    def _done(self, order: tuple[int, ...]) -> None:
        self.decided += factorial(self.count - len(order))
        self.progress(self.decided / factorial(self.count))

    def _warm(self, before: Flown | None) -> list[Floats]:
        """Times to start from: those before, drawn together to leave room, and one more gap."""
        if before is None:
            return []
        times = before.nodes.arrive_s
        steps = len(times)
        last = float(times[-1])
        end = last if self.horizon_s is None else self.horizon_s
        shrunk = self.start_s + (times - self.start_s) * steps / (steps + 1.0)
        return [np.append(shrunk, last), np.append(times, 0.5 * (last + end)) if end > last else np.append(shrunk, end)]


def _checked_count(tour: Visits) -> int:
    count = len(tour.targets.targets)
    if count > MOST_TARGETS:
        raise ValueError(
            f"{count} targets have {factorial(count)} orders; a search takes at most {MOST_TARGETS}, with "
            f"{factorial(MOST_TARGETS)}, for each more multiplies what it costs: give the order"
        )
    return count


def _orders_without_room(start_s: float, dwell_s: Floats, limits: TimeLimits) -> int:
    """How many orders do not fit before the latest time, which depends on the last target alone: its stay is free.

    Raises
    ------
    NoRoomError
        If none fits.
    """
    room_s(start_s, np.sort(dwell_s), limits)
    unfit = 0
    for last in range(len(dwell_s)):
        try:
            room_s(start_s, np.append(np.delete(dwell_s, last), dwell_s[last]), limits)
        except NoRoomError:
            unfit += factorial(len(dwell_s) - 1)
    return unfit


def _orders_that_fit(fits: NDArray[np.bool_]) -> int:
    """How many orders use only pairs of places and targets that fit, shape (place, target)."""
    ways = {frozenset[int](): 1}
    for place in fits:
        longer: dict[frozenset[int], int] = {}
        for visited, number in ways.items():
            for target in (each for each in _indices(place) if each not in visited):
                longer[visited | {target}] = longer.get(visited | {target}, 0) + number
        ways = longer
    return sum(ways.values())


def _indices(flags: NDArray[np.bool_]) -> list[int]:
    return [int(each) for each in np.flatnonzero(flags)]


def _by_dynamic_programming(tour: Tour, times: Floats, fits: NDArray[np.bool_], unfit: int) -> BestOrder:
    """Held and Karp's recursion over sets of visited targets."""
    count, targets, dwell = len(times), tour.targets, tour.dwell_s
    found: dict[tuple[frozenset[int], int], tuple[float, tuple[int, ...]]] = {}
    lost: list[tuple[int, ...]] = []
    evaluations = 0

    def leg_cost(start_s: float, start: Floats, target: int, slot: int) -> float:
        """What a leg costs; infinite where no path is found."""
        nonlocal evaluations
        evaluations += 1
        try:
            leg = nodes_of(targets, (target,), times[slot : slot + 1])
            return solve_segments(tour.motion, start_s, start, leg).cost
        except NotSettledError:
            lost.append((target,))
            return np.inf

    for target in _indices(fits[0]):
        found[frozenset([target]), target] = leg_cost(tour.start_s, tour.start_state, target, 0), (target,)
    for slot in range(1, count):
        legs = {}
        for first in _indices(fits[slot - 1]):
            leave_s = float(times[slot - 1] + dwell[first])
            start = targets.states(np.array([first]), np.array([leave_s]))[0]
            for second in (each for each in _indices(fits[slot]) if each != first):
                legs[first, second] = leg_cost(leave_s, start, second, slot)
        longer: dict[tuple[frozenset[int], int], tuple[float, tuple[int, ...]]] = {}
        for (visited, last), (cost, order) in found.items():
            for target in (each for each in _indices(fits[slot]) if each not in visited):
                key, total = (visited | {target}, target), cost + legs[last, target]
                if key not in longer or total < longer[key][0]:
                    longer[key] = total, (*order, target)
        found = longer
    cost, best = min(found.values())
    if not np.isfinite(cost):
        raise NotSettledError("no order has a path that was found; give visits more time")
    path = tour.fly(best, times)
    return BestOrder(best, path, path.cost, len(found), evaluations + 1, tuple(lost), unfit)
