"""The best order of visits, and their best times: on a grid of times, or by branch and bound."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Flags, Floats
from infoset.rendezvous.multipoint.segments import NotSettledError, Path, check_times
from infoset.rendezvous.multipoint.time_grid import search_grid
from infoset.rendezvous.multipoint.times import (
    BestTimes,
    Effort,
    Grid,
    NoRoomError,
    TimeLimits,
    TimeSearch,
    optimise_times,
)
from infoset.rendezvous.multipoint.tour import SMOOTH, Tour, Visits

Report = Callable[[float], None]

MAX_TARGETS = 9
"""Largest number of targets whose orders are searched: 362 880 orders, some 10 s on the grid."""
_MAX_ORDERS = 8
"""Number of orders of the grid of all orders that are searched again.

The best of 24 orders was the first to fifth in 8 cases.
"""
_MAX_DESCENTS = 24
"""Number of candidates that are followed.

In 106 random cases one of the first 13 candidates led to the best minimum.
"""
_MAX_POLISHED = 3
"""Number of minima of the best order that are followed to the last digits.

Nearly equal minima may change places.
"""
_GRID_SHARE = 0.7
"""Share of the grid of all orders in the progress; chosen: only the bar depends on it."""


class OrderSearch(NamedTuple):
    """Extent of a search of all orders on a grid of times."""

    grid: Grid
    orders: int
    """Number of the best orders on the grid, which were searched again; zero if it has none."""


@dataclass(frozen=True, eq=False)
class BestOrder:
    """Targets visited in their best `order`, first to last.

    `objective` is the energy plus the price of the time, m^2/s^3, without the price for given
    times. The search examined `nodes` partial orders, on a grid sets of visited targets with the
    last of them, and computed `evaluations` paths; partial orders in `lost` were skipped because no
    path was found. `time_search` is the last search for the times; None if they were given.
    `order_search` is the search of all orders on a grid; None if the order was given, or found by
    branch and bound.
    """

    order: tuple[int, ...]
    path: Path
    objective: float
    nodes: int
    evaluations: int
    lost: tuple[tuple[int, ...], ...] = ()
    time_search: TimeSearch | None = None
    order_search: OrderSearch | None = None


def best_order(
    tour: Visits,
    limits: TimeLimits,
    guesses: Sequence[Floats] = (),
    *,
    progress: Report | None = None,
) -> BestOrder:
    """Find the best order of up to 9 targets of a `tour`, and the best times, within `limits`.

    `guesses` are additional initial times, s, of any order; `progress` is called with the share of
    the search.

    In linear motion, all orders are compared on a grid of times (`search_grid`); the best ones are
    searched again on a grid as fine as that of `best_times`, and descents begin at the best
    candidates of all of them. The result is the best order found: an order whose minimum is much
    lower than its costs on the grid could be missed.

    Under the gravity of one point, the search is depth first and starts with the cheapest partial
    order. The cost of a partial order at its best times is a lower bound of the cost of all orders
    that begin with it, and its times are their initial times. This holds for global minima. The
    computed minima are local, so the result is the best order found: a partial order is discarded
    only if more starts find no lower minimum, and a factor is applied.

    Raises
    ------
    ValueError
        If there are more than 9 targets, or there is neither a latest time nor a guess.
    NotSettledError
        If no order fits before the latest time, or no path is found for any order.
    """
    count = _checked_count(tour)
    if isinstance(tour, Tour):
        return _best_order_on_grid(tour, limits, guesses, progress or _ignore)
    dwell = tour.dwell_s
    horizon = limits.latest_s

    def solve(order: tuple[int, ...], warm: Sequence[Floats], careful: bool) -> tuple[float, Path]:
        # The objective and the path of an order, which may be partial; `warm` are times to start
        # from.
        complete = len(order) == count
        held = limits
        enough = -np.inf
        if not complete:
            if horizon is not None:
                # The least time of the other visits, of which the last one (the longest stay, so
                # that this is a bound for every order of them) ends the path without a stay.
                rest = [target for target in range(count) if target not in order]
                later = (
                    dwell[order[-1]]
                    + dwell[rest].sum()
                    - dwell[rest].max()
                    + len(rest) * limits.min_gap_s
                )
                held = TimeLimits(horizon - float(later), limits.min_gap_s, limits.price_per_s)
            # A partial order below this cost is continued in any case: its minimum is not needed.
            if np.isfinite(search.best_objective):
                enough = search.best_objective
        effort = Effort.BOUND if warm and not careful else Effort.RUGGED
        begins = list(warm)
        if complete or horizon is None:
            # Without a latest time, the search of a partial order needs times too: the first ones.
            begins += [guess[: len(order)] for guess in guesses]
        times = optimise_times(
            tour.flyer(order),
            tour.start_s,
            dwell[list(order)],
            held,
            begins,
            effort=effort,
            enough=enough,
        )
        search.evaluations += times.evaluations
        return times.objective, times.path

    # A local minimum of a partial order is no bound; divided by the ruggedness, it is used as one.
    search = _OrderSearch(
        solve, count, progress, tour.start_s, horizon, tour.ruggedness, looks_twice=True
    )
    best = search.run()
    final = best_times(tour, search.best, limits, [best.nodes.arrive_s, *guesses])
    evaluations = search.evaluations + final.evaluations
    lost = tuple(search.lost)
    return BestOrder(
        search.best, final.path, final.objective, search.nodes, evaluations, lost, final.search
    )


def best_order_of_slots(
    tour: Visits, time_s: ArrayLike, *, progress: Report | None = None
) -> BestOrder:
    """Find the best order of up to 9 targets of a `tour` for increasing times of the visits.

    `progress` is called with the share of orders decided.

    Branch and bound. Orders in which a stay ends at the next visit or later do not fit and are left
    out.

    Raises
    ------
    ValueError
        If there are more than 9 targets, or times do not increase.
    NotSettledError
        If no order fits the times, or no path is found for any order.
    """
    count = _checked_count(tour)
    times = np.asarray(time_s, dtype=np.float64)
    if times.shape != (count,):
        raise ValueError(f"{count} visits need {count} times, found {times.size}")
    check_times(tour.start_s, times, times)
    # Whether each target may be visited at each time: its stay must end before the next visit.
    fits = times[:, None] + tour.dwell_s < np.append(times[1:], np.inf)[:, None]

    def solve(
        order: tuple[int, ...], _warm: Sequence[Floats], _careful: bool
    ) -> tuple[float, Path]:
        path = tour.flyer(order)(times[: len(order)])
        search.evaluations += 1
        return path.cost, path

    # In linear motion the path of given times is unique, and the cost of a partial order is a bound
    # of those that begin with it.
    slack = tour.ruggedness if tour.ruggedness > SMOOTH else 1.0
    search = _OrderSearch(
        solve, count, progress, tour.start_s, None, slack, looks_twice=False, fits=fits
    )
    path = search.run()
    return BestOrder(
        search.best, path, path.cost, search.nodes, search.evaluations, tuple(search.lost)
    )


def best_times(
    tour: Visits,
    order: Sequence[int],
    limits: TimeLimits,
    guesses: Sequence[Floats] = (),
    *,
    progress: Report | None = None,
) -> BestTimes:
    """Find the best times of one `order` of a `tour`.

    The arguments `limits`, `guesses` and `progress` are described in `best_order`. In linear
    motion, descents begin at the best candidates of a grid of times (`search_grid`).
    """
    if isinstance(tour, Tour):
        bounded = _bounded(tour, order, limits, guesses)
        report = progress or _ignore
        return _best_on_grids(tour, [tuple(order)], limits, bounded, guesses, report)[1]
    dwell = tour.dwell_s[list(order)]
    return optimise_times(
        tour.flyer(order), tour.start_s, dwell, limits, guesses, progress=progress
    )


def _ignore(_share: float) -> None:
    """Report no progress."""


def _best_order_on_grid(
    tour: Tour, limits: TimeLimits, guesses: Sequence[Floats], report: Report
) -> BestOrder:
    """Find the best order and its times in linear motion."""
    # If any order fits, one with the longest stay at the end does.
    fitting = np.argsort(tour.dwell_s, kind="stable").tolist()
    bounded = _bounded(tour, fitting, limits, guesses)

    coarse = search_grid(tour, bounded, progress=lambda share: report(_GRID_SHARE * share))
    orders = list(dict.fromkeys(candidate.order for candidate in coarse.candidates))[:_MAX_ORDERS]

    def report_rest(share: float) -> None:
        report(_GRID_SHARE + (1.0 - _GRID_SHARE) * share)

    # If the grid has no candidate, an order that fits is tried.
    order, best = _best_on_grids(
        tour, orders or [tuple(fitting)], limits, bounded, guesses, report_rest
    )
    count = len(tour.targets)
    order_search = OrderSearch(coarse.grid, len(orders))
    return BestOrder(
        order,
        best.path,
        best.objective,
        count * 2 ** (count - 1),  # sets of targets with one of them as the last
        best.evaluations,
        time_search=best.search,
        order_search=order_search,
    )


def _best_on_grids(
    tour: Tour,
    orders: Sequence[tuple[int, ...]],
    limits: TimeLimits,
    bounded: TimeLimits,
    guesses: Sequence[Floats],
    report: Report,
) -> tuple[tuple[int, ...], BestTimes]:
    """Find the best of some `orders` and its times, from candidates on grids.

    The grids end at the latest time of `bounded`.
    """
    grids = [search_grid(tour, bounded, order) for order in orders]
    candidates = [candidate for grid in grids for candidate in grid.candidates]
    candidates.sort(key=lambda candidate: candidate.objective)

    def descend(order: tuple[int, ...], starts: Sequence[Floats], effort: Effort) -> BestTimes:
        dwell = tour.dwell_s[list(order)]
        return optimise_times(tour.flyer(order), tour.start_s, dwell, limits, starts, effort=effort)

    followed = candidates[:_MAX_DESCENTS]
    minima: list[tuple[tuple[int, ...], BestTimes]] = []
    for index, candidate in enumerate(followed):
        with suppress(NotSettledError):
            minima.append(
                (candidate.order, descend(candidate.order, [candidate.time_s], Effort.VALLEY))
            )
        report((index + 1) / len(followed))
    minima.sort(key=lambda minimum: minimum[1].objective)

    # Without a minimum the last descents start from guesses and from even gaps.
    chosen = minima[0][0] if minima else orders[0]
    starts = [times.time_s for order, times in minima if order == chosen][:_MAX_POLISHED]
    best = descend(chosen, [*starts, *guesses], Effort.LAST)
    evaluations = best.evaluations + sum(times.evaluations for _, times in minima)
    # The grids of all orders have as many times, and end at the same time.
    search = TimeSearch(len(candidates), len(followed), grids[0].grid)
    return chosen, replace(best, evaluations=evaluations, search=search)


def _bounded(
    tour: Tour, order: Sequence[int], limits: TimeLimits, guesses: Sequence[Floats]
) -> TimeLimits:
    """Return limits with a latest time.

    Without one, it is a time after which the price of time alone costs more than the visits of an
    `order` that end before. Tried are one, two, four and eight times the duration of the longest
    guess; if the price does not cost more after the last, that one is taken.

    Raises
    ------
    ValueError
        If there is no latest time and no guess.
    """
    if limits.latest_s is not None:
        return limits
    scale = max((float(guess[-1]) - tour.start_s for guess in guesses), default=0.0)
    if scale <= 0.0:
        raise ValueError("with the last time free, times to start from are needed")

    lengths = scale * np.array([1.0, 2.0, 4.0, 8.0])
    for length in lengths:
        bounded = replace(limits, latest_s=tour.start_s + float(length))
        with suppress(NoRoomError):
            candidates = search_grid(tour, bounded, order).candidates
            if candidates and candidates[0].objective <= limits.price_per_s * length:
                break
    return bounded


@dataclass
class _OrderSearch:
    """A depth-first search through partial orders.

    `solve` returns objective and path of an order, from initial times, with more starts if its last
    argument is true. `fits`, shape (place, target), is None if every target fits every place.
    """

    solve: Callable[[tuple[int, ...], Sequence[Floats], bool], tuple[float, Path]]
    count: int
    progress: Report | None
    start_s: float
    horizon_s: float | None
    slack: float
    looks_twice: bool
    fits: Flags | None = None
    best: tuple[int, ...] = ()
    best_path: Path | None = None
    best_objective: float = np.inf
    nodes: int = 0
    evaluations: int = 0
    decided: int = 0
    lost: list[tuple[int, ...]] = field(default_factory=list)

    def run(self) -> Path:
        self._branch((), None)
        if self.best_path is None:
            raise NotSettledError(
                "no order fits, or no path was found for any order; give visits more time"
            )
        return self.best_path

    def _branch(self, beginning: tuple[int, ...], before: Path | None) -> None:
        """Examine all orders that begin with a partial order."""
        children = []
        for target in (target for target in range(self.count) if target not in beginning):
            order = (*beginning, target)
            if self.fits is not None and not self.fits[len(beginning), target]:
                self._done(order)
                continue
            self.nodes += 1
            try:
                objective, path = self.solve(order, self._warm(before), False)
            except NoRoomError:
                self._done(order)
            except NotSettledError:
                self.lost.append(order)
                self._done(order)
            else:
                children.append((objective, order, path))

        # Of equal objectives, the lower order is first: paths cannot be compared.
        for objective, order, path in sorted(children, key=lambda child: child[:2]):
            complete = len(order) == self.count
            lowest = objective
            best_path = path
            if self.looks_twice and (complete or objective >= self.slack * self.best_objective):
                # This is a local minimum: try more starts before an order is accepted, or a partial
                # order is dropped.
                with suppress(NotSettledError):
                    again, other = self.solve(order, [path.nodes.arrive_s], True)
                    if again < objective:
                        lowest = again
                        best_path = other
            if complete:
                self._done(order)
                if lowest < self.best_objective:
                    self.best = order
                    self.best_path = best_path
                    self.best_objective = lowest
            elif lowest < self.slack * self.best_objective:
                self._branch(order, best_path)
            else:
                self._done(order)

    def _done(self, order: tuple[int, ...]) -> None:
        self.decided += factorial(self.count - len(order))
        if self.progress is not None:
            self.progress(self.decided / factorial(self.count))

    def _warm(self, before: Path | None) -> list[Floats]:
        """Return two sets of initial times of one more visit than `before`; none without a path.

        The first has the earlier visits contracted, and the new one at their old end. The second
        has the new one halfway to the horizon; if no time is left before it, it is like the first.
        """
        if before is None:
            return []
        times = before.nodes.arrive_s
        steps = len(times)
        last = float(times[-1])
        end = last if self.horizon_s is None else self.horizon_s
        shrunk = self.start_s + (times - self.start_s) * steps / (steps + 1.0)
        later = np.append(shrunk, end)
        if end > last:
            later = np.append(times, 0.5 * (last + end))
        return [np.append(shrunk, last), later]


def _checked_count(tour: Visits) -> int:
    count = len(tour.targets)
    if count > MAX_TARGETS:
        raise ValueError(
            f"{count} targets have {factorial(count)} orders; a search takes at most "
            f"{MAX_TARGETS}, with {factorial(MAX_TARGETS)}, and each further target multiplies the "
            "cost: give the order"
        )
    return count
