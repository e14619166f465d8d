"""The best order of visits: branch and bound, order and times together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import factorial

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Flags, Floats
from infoset.rendezvous.multipoint.segments import NotSettledError, Path, check_times
from infoset.rendezvous.multipoint.times import (
    BestTimes,
    Effort,
    NoRoomError,
    TimeLimits,
    TimeSearch,
    optimise_times,
)
from infoset.rendezvous.multipoint.tour import SMOOTH, Visits

Report = Callable[[float], None]

MAX_TARGETS = 9
_MARGIN = 1e-4


@dataclass(frozen=True, eq=False)
class BestOrder:
    """Targets visited in their best `order`, first to last.

    `objective` is the energy plus the price of the time, m^2/s^3. The search examined `nodes` partial orders and
    computed `evaluations` paths; partial orders in `lost` were skipped because no path was found. `time_search` is the
    last search for the times of the `order`; None if they were given.
    """

    order: tuple[int, ...]
    path: Path
    objective: float
    nodes: int
    evaluations: int
    lost: tuple[tuple[int, ...], ...] = ()
    time_search: TimeSearch | None = None


def best_order(
    tour: Visits, limits: TimeLimits, guesses: Sequence[Floats] = (), *, progress: Report | None = None
) -> BestOrder:
    """Find the best order of up to 9 targets of a `tour`, and the best times, within `limits`.

    `guesses` are additional initial times, s, of any order; `progress` is called with the share of orders decided.

    The search is depth first and starts with the cheapest partial order. The cost of a partial order at its best times
    is a lower bound of the cost of all orders that begin with it, and its times are their initial times. This holds for
    global minima. The computed minima are local, so the result is the best order found: a partial order is discarded
    only if more starts find no lower minimum, and for Kepler's motion a factor is applied (`ruggedness`).

    Raises
    ------
    ValueError
        If there are more than 9 targets.
    NotSettledError
        If no order fits before the latest time, or no path is found for any order.
    """
    count = _checked_count(tour)
    dwell = tour.dwell_s
    horizon = limits.latest_s

    def solve(order: tuple[int, ...], warm: Sequence[Floats], careful: bool) -> tuple[float, Path]:
        complete, held, enough = len(order) == count, limits, -np.inf
        if not complete:
            if horizon is not None:
                rest = [target for target in range(count) if target not in order]
                later = dwell[order[-1]] + dwell[rest].sum() - dwell[rest].max() + len(rest) * limits.min_gap_s
                held = TimeLimits(horizon - float(later), limits.min_gap_s, limits.price_per_s)
            if np.isfinite(search.best_objective):
                enough = search.best_objective
        effort = Effort.BOUND if warm else Effort.ORDER
        if careful:
            effort = Effort.RUGGED if tour.ruggedness > SMOOTH else Effort.ORDER
        begins = [*warm, *guesses] if complete else warm
        times = optimise_times(
            tour.flyer(order), tour.start_s, dwell[list(order)], held, begins, effort=effort, enough=enough
        )
        search.evaluations += times.evaluations
        return times.objective, times.path

    # A local minimum of a partial order is no bound; divided by the slack, it is used as one.
    slack = tour.ruggedness if tour.ruggedness > SMOOTH else 1.0 / (1.0 - _MARGIN)
    search = _Search(solve, count, progress, tour.start_s, horizon, slack, looks_twice=True)
    best = search.run()
    final = best_times(tour, search.best, limits, [best.nodes.arrive_s, *guesses])
    evaluations = search.evaluations + final.evaluations
    lost = tuple(search.lost)
    return BestOrder(search.best, final.path, final.objective, search.nodes, evaluations, lost, final.search)


def best_order_of_slots(tour: Visits, time_s: ArrayLike, *, progress: Report | None = None) -> BestOrder:
    """Find the best order of up to 9 targets of a `tour` for increasing times of the visits.

    `progress` is called with the share of orders decided.

    Branch and bound. Orders in which a stay ends after the next visit do not fit and are left out.

    Raises
    ------
    ValueError
        If there are more than 9 targets, or times do not increase.
    NotSettledError
        If no order fits the times, or no path is found for any order.
    """
    count, times = _checked_count(tour), np.asarray(time_s, dtype=np.float64)
    if times.shape != (count,):
        raise ValueError(f"{count} visits need {count} times, found {times.size}")
    check_times(tour.start_s, times, times)
    # Whether each target may be visited at each time: its stay must end before the next visit.
    fits = times[:, None] + tour.dwell_s < np.append(times[1:], np.inf)[:, None]

    def solve(order: tuple[int, ...], _warm: Sequence[Floats], _careful: bool) -> tuple[float, Path]:
        path = tour.flyer(order)(times[: len(order)])
        search.evaluations += 1
        return path.cost, path

    slack = tour.ruggedness if tour.ruggedness > SMOOTH else 1.0
    search = _Search(solve, count, progress, tour.start_s, None, slack, looks_twice=False, fits=fits)
    path = search.run()
    return BestOrder(search.best, path, path.cost, search.nodes, search.evaluations, tuple(search.lost))


def best_times(
    tour: Visits,
    order: Sequence[int],
    limits: TimeLimits,
    guesses: Sequence[Floats] = (),
    *,
    progress: Report | None = None,
) -> BestTimes:
    """Find the best times of one `order` of a `tour`; `limits`, `guesses` and `progress` as for `optimise_times`."""
    dwell = tour.dwell_s[list(order)]
    return optimise_times(tour.flyer(order), tour.start_s, dwell, limits, guesses, progress=progress)


@dataclass
class _Search:
    """A depth-first search through partial orders."""

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
            raise NotSettledError("no order fits, or no path was found for any order; give visits more time")
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
        for objective, order, path in sorted(children, key=lambda child: child[:2]):
            complete = len(order) == self.count
            lowest, best_path = objective, path
            if self.looks_twice and (complete or objective >= self.slack * self.best_objective):
                # This is a local minimum: try more starts before an order is accepted, or a partial order is dropped.
                with suppress(NotSettledError):
                    again, other = self.solve(order, [path.nodes.arrive_s], True)
                    if again < objective:
                        lowest, best_path = again, other
            if complete:
                self._done(order)
                if lowest < self.best_objective:
                    self.best, self.best_path, self.best_objective = order, best_path, lowest
            elif lowest < self.slack * self.best_objective:
                self._branch(order, best_path)
            else:
                self._done(order)

    def _done(self, order: tuple[int, ...]) -> None:
        self.decided += factorial(self.count - len(order))
        if self.progress is not None:
            self.progress(self.decided / factorial(self.count))

    def _warm(self, before: Path | None) -> list[Floats]:
        """Return initial times: those of the previous visits, contracted, and one more gap."""
        if before is None:
            return []
        times = before.nodes.arrive_s
        steps = len(times)
        last = float(times[-1])
        end = last if self.horizon_s is None else self.horizon_s
        shrunk = self.start_s + (times - self.start_s) * steps / (steps + 1.0)
        return [np.append(shrunk, last), np.append(times, 0.5 * (last + end)) if end > last else np.append(shrunk, end)]


def _checked_count(tour: Visits) -> int:
    count = len(tour.targets)
    if count > MAX_TARGETS:
        raise ValueError(
            f"{count} targets have {factorial(count)} orders; a search takes at most {MAX_TARGETS}, with "
            f"{factorial(MAX_TARGETS)}, and each further target multiplies the cost: give the order"
        )
    return count
