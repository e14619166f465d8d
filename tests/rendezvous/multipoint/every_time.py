"""Minimum-energy visits at all increasing times of a grid: least squares in the velocities at
flybys, many at once.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from infoset.arrays import Floats, Integers
from infoset.rendezvous.multipoint import Meet, Tour

CHUNK = 20_000


class EveryTime:
    """The costs of visits in the order of the targets, at all increasing times of a grid of equal
    steps from t = 0.
    """

    def __init__(self, tour: Tour, latest_s: float, size: int) -> None:
        self.tour = tour
        self.time_s = np.linspace(0.0, latest_s, size + 1)
        self.count = len(tour.targets)
        self.size = size
        motion = tour.motion
        none = np.zeros(size)
        self.transition = motion.transition(none, self.time_s[1:])
        # The inverse of L, with the Gramian L L', whitens what is missing after a leg.
        self.whiten = np.linalg.inv(np.linalg.cholesky(motion.gramian(none, self.time_s[1:])))
        states = [
            tour.target_states(np.full(size + 1, target), self.time_s)
            for target in range(self.count)
        ]
        self.states = np.stack(states)
        self.flyby = np.array([target.meet is Meet.FLYBY for target in tour.targets])

    def minima(self, most: int) -> list[Floats]:
        """Return the times of the lowest costs that are not above those of their neighbours on the
        grid.
        """
        places = self._places()
        around = np.full((self.size + 2,) * self.count, np.inf)
        for begin in range(0, len(places), CHUNK):
            chunk = places[begin : begin + CHUNK]
            around[tuple(chunk.T)] = self._costs(chunk)
        inside = (slice(1, -1),) * self.count
        costs = around[inside]
        lowest = np.isfinite(costs)
        for shift in product((0, 1, 2), repeat=self.count):
            lowest &= costs <= around[tuple(slice(each, each + self.size) for each in shift)]
        found = np.argwhere(lowest)
        cheapest = np.argsort(costs[lowest])[:most]
        return [self.time_s[1 + place] for place in found[cheapest]]

    def _places(self) -> Integers:
        """Return increasing numbers of times, shape (k, n)."""
        places = np.arange(1, self.size + 1)[:, None]
        for _ in range(1, self.count):
            later = [np.arange(last + 1, self.size + 1) for last in range(self.size + 1)]
            repeats = [len(later[last]) for last in places[:, -1]]
            following = np.concatenate([later[last] for last in places[:, -1]])
            places = np.column_stack([np.repeat(places, repeats, axis=0), following])
        return places

    def _costs(self, places: Integers) -> Floats:
        """Return the costs, shape (k,), of visits at the times numbered `places`, shape (k, n)."""
        rows = 6 * self.count
        columns = 3 * int(self.flyby.sum())
        missing = np.zeros((len(places), rows))
        slopes = np.zeros((len(places), rows, columns))
        begin = np.broadcast_to(self.tour.start_state, (len(places), 6))
        before = np.zeros(len(places), dtype=int)
        free_before = None
        column = 0
        for visit in range(self.count):
            leg = places[:, visit] - before - 1
            part = slice(6 * visit, 6 * visit + 6)
            end = self.states[visit, places[:, visit]].copy()
            whiten = self.whiten[leg]
            transition = self.transition[leg]
            if free_before is not None:
                slopes[:, part, free_before] = -(whiten @ transition)[:, :, 3:]
            free_before = None
            if self.flyby[visit]:
                end[:, 3:] = 0.0
                free_before = slice(column, column + 3)
                slopes[:, part, free_before] = whiten[:, :, 3:]
                column += 3
            error = end - (transition @ begin[:, :, None])[:, :, 0]
            missing[:, part] = (whiten @ error[:, :, None])[:, :, 0]
            begin = end
            before = places[:, visit]
        across = np.swapaxes(slopes, 1, 2)
        velocities = np.linalg.solve(across @ slopes, -(across @ missing[:, :, None]))
        left = missing + (slopes @ velocities)[:, :, 0]
        return np.asarray(0.5 * (left**2).sum(axis=1))
