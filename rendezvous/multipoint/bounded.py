"""Visits in linear motion with a bound on the control: |u| <= u_max at all times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.bounded_control import (
    Arc,
    BoundedFlight,
    least_bound,
    saturated,
    solve_bounded,
)
from infoset.rendezvous.multipoint.order import BestOrder
from infoset.rendezvous.multipoint.segments import LinearPath, Path, time_gradient
from infoset.rendezvous.multipoint.times import Effort, TimeLimits, optimise_times
from infoset.rendezvous.multipoint.tour import Tour
from infoset.rendezvous.piecewise import max_control


@dataclass(frozen=True, eq=False)
class BoundedPath(LinearPath):
    """A path of minimum energy with |u| <= `max_m_s2`; `flights` are its segments."""

    max_m_s2: float
    flights: tuple[BoundedFlight, ...]

    def control(self, time_s: Floats) -> Floats:
        """Return u, m/s^2, shape (k, 3), at k times: B' lambda, cut to the bound."""
        return saturated(super().control(time_s), self.max_m_s2)

    def breaks(self) -> Floats:
        """Return times, s, not decreasing; the control turns by about a radian between them."""
        return np.concatenate([flight.breaks() for flight in self.flights])

    def along(self, time_s: Floats) -> tuple[Floats, Floats]:
        """Return states and costates, shapes (k, 6), at k times from the start to the last node."""
        times = np.asarray(time_s, dtype=np.float64)
        states, costates = super().along(times)
        which, moving = self._segment_of(times)
        for segment in np.unique(which[moving]):
            flying = moving & (which == segment)
            states[flying] = self.flights[segment].state(times[flying])
        return states, costates


def needed_bound(path: LinearPath) -> float:
    """Return the smallest possible bound, m/s^2, at the times of a `path`.

    It is never too high, and at most 1e-6 of it too low.
    """
    return least_bound(_arcs(path)).value_m_s2


def bound_path(path: LinearPath, max_m_s2: float) -> LinearPath:
    """Return the path of minimum energy through the nodes of a `path` with |u| <= `max_m_s2`.

    It is the `path` itself if it keeps the bound.

    Raises
    ------
    BoundTooSmallError
        If the visits are not possible with the bound.
    """
    if max_control(path.control, path.breaks()) <= max_m_s2:
        return path
    nodes = path.nodes
    motion = path.motion
    optimum = solve_bounded(_arcs(path), max_m_s2)

    arrive, begin = _at_rest(path)
    velocities = np.zeros((len(nodes.arrive_s), 3))
    velocities[~nodes.rendezvous] = optimum.free.reshape(-1, 3)
    free = ~nodes.rendezvous
    arrive[free, 3:] = velocities[free]
    # The segment after a flyby starts with the velocity at it.
    begin[1:][free[:-1], 3:] = velocities[:-1][free[:-1]]
    before = np.array(optimum.costates)
    transition = motion.transition(path.starts_s, nodes.arrive_s)
    at_start = np.einsum("kji,kj->ki", transition, before)
    after = np.concatenate([at_start[1:], np.zeros((1, 6))])
    flights = tuple(
        BoundedFlight(motion, float(start_s), float(end_s), state, costate, max_m_s2, edges_s)
        for start_s, end_s, state, costate, edges_s in zip(
            path.starts_s, nodes.arrive_s, begin, before, optimum.edges_s, strict=True
        )
    )
    return BoundedPath(
        nodes,
        0.5 * float(optimum.energies.sum()),  # an energy is int |u|^2 dt
        path.starts_s,
        begin,
        arrive,
        before,
        after,
        at_start[0],
        time_gradient(nodes, arrive, before, after, max_m_s2),
        motion,
        max_m_s2,
        flights,
    )


def _at_rest(path: LinearPath) -> tuple[Floats, Floats]:
    """Return states at the ends and at the starts of the segments, shape (N, 6).

    The velocities at flybys are zero.
    """
    nodes = path.nodes
    free = ~nodes.rendezvous
    arrive = nodes.arrive.copy()
    begin = np.concatenate([path.start_states[:1], nodes.leave[:-1]])
    arrive[free, 3:] = 0.0
    begin[1:][free[:-1], 3:] = 0.0
    return arrive, begin


def _arcs(path: LinearPath) -> list[Arc]:
    """The segments of a path; the free values are the velocities at its flybys."""
    nodes = path.nodes
    motion = path.motion
    arrive, begin = _at_rest(path)
    transition = motion.transition(path.starts_s, nodes.arrive_s)
    # By its control a segment has to change its state by `missing` plus `slope` times the free
    # velocities: that at its end less the effect of that at its start.
    missing = arrive - (transition @ begin[:, :, None])[:, :, 0]
    # First column of the velocity at each node, used at flybys only.
    columns = 3 * (np.cumsum(~nodes.rendezvous) - 1)
    arcs = []
    for index, end_s in enumerate(nodes.arrive_s):
        slope = np.zeros((6, 3 * int((~nodes.rendezvous).sum())))
        if not nodes.rendezvous[index]:
            slope[3:, columns[index] : columns[index] + 3] = np.eye(3)
        if index and not nodes.rendezvous[index - 1]:
            slope[:, columns[index - 1] : columns[index - 1] + 3] = -transition[index][:, 3:]
        arcs.append(Arc(motion, float(path.starts_s[index]), float(end_s), missing[index], slope))
    return arcs


def bound_visits(
    tour: Tour,
    best: BestOrder,
    max_m_s2: float,
    limits: TimeLimits | None,
    guesses: Sequence[Floats] = (),
) -> BestOrder:
    """Return the visits of `best` with |u| <= `max_m_s2`.

    They are `best` itself if its path keeps the bound. The order stays. With `limits`, the times
    are optimised again with the bound, from those of `best` and from `guesses`; without them, they
    stay.

    Raises
    ------
    BoundTooSmallError
        If the visits are not possible with the bound at these times or, with `limits`, at any times
        from which the search starts.
    """
    path = best.path
    if max_control(path.control, path.breaks()) <= max_m_s2:
        return best
    fly = tour.flyer(best.order)

    def fly_bounded(time_s: Floats) -> Path:
        return bound_path(fly(time_s), max_m_s2)

    if limits is None:
        bounded = fly_bounded(path.nodes.arrive_s)
        # At the same times the price of the time is the same.
        return replace(best, path=bounded, objective=best.objective - path.cost + bounded.cost)
    dwell_s = tour.dwell_s[list(best.order)]
    starts = [path.nodes.arrive_s, *guesses]
    timed = optimise_times(fly_bounded, tour.start_s, dwell_s, limits, starts, effort=Effort.LAST)
    return replace(
        best,
        path=timed.path,
        objective=timed.objective,
        evaluations=best.evaluations + timed.evaluations,
    )
