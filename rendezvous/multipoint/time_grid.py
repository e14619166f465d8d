"""Orders and times of visits on a grid of times: dynamic programming over sets of targets."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import comb
from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Flags, Floats, Shorts
from infoset.rendezvous.multipoint._cost_to_come import (
    DECIDED,
    TARGET,
    CostToCome,
    Kept,
    Legs,
    extend,
    write_quadratics,
)
from infoset.rendezvous.multipoint.times import MIN_SHARE, Grid, TimeLimits, room_s
from infoset.rendezvous.multipoint.tour import Meet, Tour

TIMES_PER_RADIAN = 4.0
"""Times of the grid in a radian, 25 in a revolution: the lowest cost on the grid is then mostly
within 5 % of the minimum near it."""
MIN_TIMES = 32
"""Smallest number of times. Chosen: also over a small angle the cost changes much from nearly no
gap to long gaps."""
MAX_TIMES = 400
"""Largest number of times for a given order: the legs between them take 70 MB in a time-varying
motion."""
MAX_ORDER_TIMES = 72
"""Largest number of times for all orders. Chosen: the best orders of this grid are searched again,
each on a finer grid."""
MAX_TRIPLES = 1e8
"""Largest number of compared sequences of three times, which take 60 to 100 ns each: at most 10 s.

The grid of nine targets then has 40 times.
"""
APART_RAD = 1.5
"""Turn of the motion, about a quarter of a revolution, by which the deciding times of two kept ways
differ at least (`extend`): minima of the cost are half a revolution apart or more."""
RANKS = 4
"""Number of quadratics that are kept for two times of a given order.

With one, the valley of the minimum was lost in 1 of 90 cases.
"""
START = -1
"""Number of the chaser's coasting orbit among the targets; as an index of states, the last one."""
_NONE = -2
"""Number in place of a target where there is no visit."""


class Candidate(NamedTuple):
    """An order and times, s, whose objective, m^2/s^3, is the lowest near them on the grid."""

    order: tuple[int, ...]
    time_s: Floats
    objective: float


class GridSearch(NamedTuple):
    """A grid of times, and its candidates, the cheapest first."""

    grid: Grid
    candidates: list[Candidate]


class _Departure(NamedTuple):
    """Legs from the last of a set of visited targets, and states of all bodies at their ends."""

    legs: Legs
    states: Floats
    """Shape (n + 1, G, 6); the last are those of the chaser if it coasts."""


def search_grid(
    tour: Tour,
    limits: TimeLimits,
    order: Sequence[int] | None = None,
    *,
    progress: Callable[[float], None] | None = None,
) -> GridSearch:
    """Search times before the latest one of `limits`, and all orders or a given one, on a grid.

    Each gap between visits is the minimum gap and a number of steps. `limits` must have a latest
    time, for the arrival at the last target. `progress` is called with the share that is done.

    Raises
    ------
    NoRoomError
        If the visits do not fit before the latest time.

    Notes
    -----
    Held and Karp, "A dynamic programming approach to sequencing problems", J. SIAM 10 (1962)
    196-210. A state is a set of visited targets, the last of them, and the times of the last two
    visits. The cost to come is a quadratic of the velocity at the last one, see `_cost_to_come`; of
    all ways to a state, that with the lowest minimum is kept. After a rendezvous the time of the
    last visit is enough. The minimum on the grid is therefore found for up to three visits, and for
    more if no two flybys follow each other; otherwise a way with a higher minimum could continue
    better. Of a given order, the best four ways are kept that differ by a quarter of a revolution.
    """
    return _TimeGrid(tour, limits, order).search(progress)


class _TimeGrid:
    """A grid of times, and the ways to all sets of targets whose visits end at its times."""

    def __init__(self, tour: Tour, limits: TimeLimits, order: Sequence[int] | None) -> None:
        assert limits.latest_s is not None
        self._tour = tour
        self._limits = limits
        self._order = order
        self._latest_s = limits.latest_s
        stays = np.sort(tour.dwell_s) if order is None else tour.dwell_s[list(order)]
        self._count = len(stays)
        self._ranks = 1 if order is None else RANKS
        room = room_s(tour.start_s, stays, limits)
        self._min_gap_s = max(limits.min_gap_s, MIN_SHARE * room)
        # A sum of gaps at their minimum may exceed the room by rounding.
        spare_s = max(room - self._count * self._min_gap_s, 0.0)

        # Between two of its breaks the motion turns by about a radian.
        radians = len(tour.motion.breaks(tour.start_s, self._latest_s)) - 1
        enough = max(MIN_TIMES, int(np.ceil(TIMES_PER_RADIAN * radians)))
        size = min(enough, self._most_times())
        self._steps_s = np.linspace(0.0, spare_s, size)
        self._apart = max(1, int(APART_RAD * size / radians))
        self._back: dict[tuple[int, int], Shorts] = {}
        self._departures: dict[float, _Departure] = {}

    def search(self, progress: Callable[[float], None] | None) -> GridSearch:
        """Return the candidates by dynamic programming, the cheapest first.

        A level has the ways through one number of targets: by the set of these targets, as the bits
        of a number, and by the last of them.
        """
        level = {0: {START: self._start()}}
        done = 0
        total = sum(self._pairs(visits) for visits in range(1, self._count + 1))
        for _ in range(self._count):
            following: dict[int, dict[int, CostToCome]] = {}
            for visited, before in level.items():
                departure = self._departure(visited)
                for last in self._next(visited):
                    after = visited | 1 << last
                    visits = self._visit(before, last, departure, after.bit_count() == self._count)
                    following.setdefault(after, {})[last] = visits
                    self._back[after, last] = visits.back
                    done += len(before)
                    if progress is not None:
                        progress(done / total)
            level = following
            self._departures.clear()

        ((complete, ends),) = level.items()
        candidates = sorted(self._candidates(complete, ends), key=lambda each: each.objective)
        return GridSearch(Grid(len(self._steps_s), self._latest_s), candidates)

    def _pairs(self, visits: int) -> int:
        """Return the number of pairs of a set of so many targets and its last two."""
        if self._order is not None:
            return 1
        return comb(self._count, visits) * visits * max(visits - 1, 1)

    def _most_times(self) -> int:
        """Return the largest number of times with at most `MAX_TRIPLES` sequences of three times.

        It is at most `MAX_TIMES`, or `MAX_ORDER_TIMES` for all orders. Two visits have no such
        sequences.
        """
        # Before the third visit one way leads to each pair of times: the other ranks are empty.
        passes = sum(
            self._pairs(visits) * (self._ranks if visits > 3 else 1)
            for visits in range(3, self._count + 1)
        )
        # Of G times, about G^3 / 6 sequences of three increase.
        most = MAX_TIMES if self._order is not None else MAX_ORDER_TIMES
        return most if passes == 0 else min(most, int(np.cbrt(6.0 * MAX_TRIPLES / passes)))

    def _next(self, visited: int) -> list[int]:
        if self._order is not None:
            return [self._order[visited.bit_count()]]
        return [target for target in range(self._count) if not visited >> target & 1]

    def _start(self) -> CostToCome:
        """Return the chaser on its coasting orbit, at the first time of the grid."""
        size = len(self._steps_s)
        cost = np.full((1, size), np.inf)
        cost[0, 0] = 0.0
        back = np.full((1, size, 4), _NONE, dtype=np.int16)
        return CostToCome(cost, np.zeros((1, size, 3)), np.zeros((1, size, 3, 3)), back)

    def _leave_s(self, visited: int) -> float:
        """Return the earliest time at which the chaser leaves the last of a set of targets."""
        stays = sum(
            float(stay) for target, stay in enumerate(self._tour.dwell_s) if visited >> target & 1
        )
        return self._tour.start_s + visited.bit_count() * self._min_gap_s + stays

    def _arrive_s(self, visited: int) -> Floats:
        """Return the times of arrivals after a set of visited targets."""
        return self._leave_s(visited) + self._min_gap_s + self._steps_s

    def _departure(self, visited: int) -> _Departure:
        """Return legs and states for visits after a set; stored for sets with equal times."""
        leave_s = self._leave_s(visited)
        if leave_s not in self._departures:
            self._departures[leave_s] = self._departure_at(
                leave_s + self._steps_s, self._arrive_s(visited)
            )
        return self._departures[leave_s]

    def _departure_at(self, leave: Floats, arrive: Floats) -> _Departure:
        """Return the legs between times, and the states at their ends.

        Long legs of a time-varying motion are composed of short ones.
        """
        motion = self._tour.motion
        size = len(leave)
        if motion.stationary:
            segment = motion.segment(leave[0], arrive)
            legs = Legs(
                np.ascontiguousarray(segment.transition[None, :, :, 3:]), segment.gramian[None]
            )
            return _Departure(legs, self._states(motion.transition(np.zeros(size), arrive)))

        first = motion.segment(leave, arrive)
        step = motion.segment(arrive[:-1], arrive[1:])
        legs = Legs(np.zeros((size, size, 6, 3)), np.zeros((size, size, 6, 6)))
        response = first.transition[:, :, 3:]
        gramian = first.gramian
        legs.response[:, 0] = response
        legs.gramian[:, 0] = gramian
        for length in range(1, size):
            # Row i: from departure i, on from arrival i + length - 1 to the next one.
            turn = step.transition[length - 1 :]
            response = turn @ response[:-1]
            gramian = turn @ gramian[:-1] @ np.swapaxes(turn, 1, 2) + step.gramian[length - 1 :]
            legs.response[:-length, length] = response
            legs.gramian[:-length, length] = gramian
        since_zero = [motion.transition(0.0, arrive[0])]
        for turn in step.transition:
            since_zero.append(turn @ since_zero[-1])
        return _Departure(legs, self._states(np.stack(since_zero)))

    def _states(self, since_zero: Floats) -> Floats:
        """Return the states of the targets and, last, of the coasting chaser, shape (n + 1, k, 6).

        `since_zero`, shape (k, 6, 6), are the transition matrices from t = 0.
        """
        tour = self._tour
        # The chaser's coasting orbit at t = 0, like the targets.
        chaser = tour.motion.transition(tour.start_s, 0.0) @ tour.start_state
        initial = np.concatenate([tour.initial, chaser[None]])
        return np.ascontiguousarray(np.moveaxis(since_zero @ initial.T, 2, 0))

    def _visit(
        self, before: dict[int, CostToCome], last: int, departure: _Departure, final: bool
    ) -> CostToCome:
        """Return the visits of the target `last` that come from targets `before`."""
        size = len(self._steps_s)
        flyby = self._tour.targets[last].meet is Meet.FLYBY
        legs, states = departure
        ranks = 1 if START in before else self._ranks
        # A last rendezvous needs candidates of each time of the visit before it: of 90 valleys 2
        # were lost otherwise.
        rows = ranks * size if (flyby or final) and START not in before else ranks
        visits = CostToCome(
            np.full((rows, size), np.inf),
            np.zeros((rows, size, 3)),
            np.zeros((rows, size, 3, 3)),
            np.full((rows, size, 4), _NONE, dtype=np.int16),
        )
        met = 3 if flyby else 6  # components of a state that must agree
        kept = Kept(ranks, self._apart)
        # The cheapest first: most others cost more already than the whole ways known.
        for target, earlier in sorted(before.items(), key=lambda each: float(each[1].cost.min())):
            cheapest = np.argsort(earlier.cost, axis=0)
            relative = states[last] - states[target]
            extend(earlier, cheapest, legs, relative, target, met, kept, visits)
        # After a rendezvous m and P are zero, and after the last visit no leg follows.
        if not flyby or final:
            return visits

        # Only now is it known which of the ways are kept (`visits.back`).
        for target, earlier in before.items():
            write_quadratics(earlier, legs, states[last] - states[target], target, visits)
        return visits

    def _candidates(self, complete: int, ends: dict[int, CostToCome]) -> Iterator[Candidate]:
        """Yield visits of all targets in time that cost no more than their neighbours."""
        start_s = self._tour.start_s
        for last, visits in ends.items():
            arrive_s = self._arrive_s(complete & ~(1 << last))
            cost = visits.cost + self._limits.price_per_s * (arrive_s - start_s)
            # A sum of gaps may exceed the latest time by its rounding.
            cost[:, arrive_s - self._latest_s > 1e-12 * (self._latest_s - start_s)] = np.inf
            for row, at in np.argwhere(self._lowest(cost, visits.back)).tolist():
                order, times = self._way(complete, last, row, at)
                yield Candidate(order, times, float(cost[row, at]))

    def _lowest(self, cost: Floats, back: Shorts) -> Flags:
        """Return whether costs are finite and not above their neighbours' costs.

        The shapes are described in `CostToCome`. Near are those of neighbouring times whose ways
        come from the same target, at times that are not far apart.
        """
        ranks = min(self._ranks, len(cost))
        size = cost.shape[1]
        shape = (len(cost) // ranks, ranks, size)
        cost = cost.reshape(shape)
        target = back[..., TARGET].reshape(shape)
        decided = back[..., DECIDED].reshape(shape)
        edge = ((1, 1), (0, 0), (1, 1))
        costs = np.pad(cost, edge)
        targets = np.pad(target, edge)
        decideds = np.pad(decided, edge)
        # Beyond the edges there are no visits: the zeros that pad `costs` are not compared.
        targets[[0, -1]] = targets[..., [0, -1]] = _NONE

        lowest = np.isfinite(cost)
        for row in range(3):
            for column in range(3):
                window = (slice(row, row + shape[0]), slice(None), slice(column, column + size))
                for rank in range(ranks):
                    its_cost = costs[window][:, rank, None]
                    its_target = targets[window][:, rank, None]
                    its_decided = decideds[window][:, rank, None]
                    near = (its_target == target) & (np.abs(its_decided - decided) <= self._apart)
                    # Of equal costs, the first is a candidate.
                    lower = its_cost <= cost if (row, column) < (1, 1) else its_cost < cost
                    lowest &= ~(near & lower)
        return lowest.reshape(-1, size)

    def _way(self, visited: int, last: int, row: int, at: int) -> tuple[tuple[int, ...], Floats]:
        """Return order and times of visits of a set of targets that end in a row at a time."""
        order: list[int] = []
        times: list[float] = []
        while last != START:
            earlier = visited & ~(1 << last)
            order.append(last)
            times.append(float(self._arrive_s(earlier)[at]))
            before, at, row, _ = self._back[visited, last][row, at].tolist()
            visited = earlier
            last = before
        return tuple(order[::-1]), np.array(times[::-1])
