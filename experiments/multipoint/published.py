"""Numbers of Mironov and Mironov (2007): visits to several moving targets."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from experiments.common.printed_numbers import Progress, Reproduction, read_paper
from experiments.multipoint.file import load_multipoint
from infoset.arrays import Floats
from rendezvous.multipoint import (
    DriftingTargets,
    KeplerTargets,
    KeplerTour,
    Meet,
    Nodes,
    Target,
    TimeLimits,
    Tour,
    best_order,
    best_times,
    solve_segments,
)
from rendezvous.relative_motion import TimeVaryingMotion
from sim.storage.codec import fingerprint

PAPER = "multipoint"
PROBLEMS = ("service-2", "service-3")


def reproduce(progress: Progress) -> Reproduction:
    """Compute the numbers."""
    ours = {"N = 2": _visits(2)}
    progress(0.2)
    ours["N = 3"] = _visits(3)
    progress(0.4)
    ours["N = 2, last time at 1e-6 a second"] = _priced()
    progress(0.5)
    ours["N = 3"] += _orders()
    progress(0.8)
    ours |= {"cubic spline": _spline(), "out to 1 and back by T = 1": _out_and_back(), "nonlinear": [_kepler()]}
    problems = tuple((problem.name, fingerprint(problem)) for problem in map(load_multipoint, PROBLEMS))
    paper = read_paper(PAPER)
    progress(1.0)
    return Reproduction(paper, problems, paper.compare(ours))


def _tour(count: int, meets: Sequence[Meet] | None = None) -> tuple[Tour, Floats]:
    """Return the tour of a built-in problem, with other kinds of visits if given, and its times."""
    problem = load_multipoint(f"service-{count}")
    tour, times = problem.tour, problem.times_s
    assert isinstance(tour, Tour)
    assert isinstance(tour.targets, DriftingTargets)
    assert times is not None
    if meets is not None:
        described = tuple(replace(target, meet=meet) for target, meet in zip(tour.targets.targets, meets, strict=True))
        tour = replace(tour, targets=replace(tour.targets, targets=described))
    return tour, times


def _visits(count: int) -> list[float]:
    tour, times = _tour(count)
    order, limits = range(count), TimeLimits(latest_s=float(times[-1]))
    path, best = tour.fly(order, times), best_times(tour, order, limits, [times])
    last, _ = _tour(count, [*[Meet.FLYBY] * (count - 1), Meet.RENDEZVOUS])
    last_costs = last.fly(order, times).cost, best_times(last, order, limits, [times]).path.cost
    numbers = [path.cost, *path.time_gradient, *best.time_s[:-1], best.path.cost, *last_costs]
    return [*numbers, *path.costate_start[:3], *path.arrival_states[0, 3:]] if count == 2 else numbers


def _priced() -> list[float]:
    """Return the times and the cost if every second has a price."""
    tour, times = _tour(2)
    best = best_times(tour, (0, 1), TimeLimits(price_per_s=1e-6), [times])
    return [*best.time_s, best.path.cost]


def _orders() -> list[float]:
    """Return the cost of the worst order at the given times, and of the best one at its best times."""
    tour, times = _tour(3)
    worst = max(tour.fly(order, times).cost for order in itertools.permutations(range(3)))
    return [worst, best_order(tour, TimeLimits(latest_s=float(times[-1]))).objective]


def _double_integrator() -> TimeVaryingMotion:
    matrix = np.zeros((6, 6))
    matrix[:3, 3:] = np.eye(3)
    return TimeVaryingMotion(lambda at: np.broadcast_to(matrix, (len(at), 6, 6)))


def _spline() -> list[float]:
    """Return cost, jumps and velocities in free space: a cubic spline, clamped at the start and natural at the end."""
    motion, at, states = _double_integrator(), np.array([1.0, 2.0, 3.0]), np.zeros((3, 6))
    states[:, 0] = [1.0, -1.0, 2.0]
    nodes = Nodes(at, at, states, states, 0.0 * states, 0.0 * states, np.zeros(3, dtype=bool))
    path = solve_segments(motion, 0.0, np.zeros(6), nodes)
    return [path.cost, *path.jumps[:, 0], *path.arrival_states[:, 3]]


def _out_and_back() -> list[float]:
    motion, there = _double_integrator(), np.zeros((2, 6))
    there[0, 0] = 1.0
    tour = Tour(motion, DriftingTargets((Target("out"), Target("back")), motion, there), np.zeros(6))
    back = best_times(tour, (0, 1), TimeLimits(latest_s=1.0))
    return [back.time_s[0], back.path.cost]


def _kepler() -> float:
    """Return the cost for a point mass, mu = 1, and targets on circles."""
    states = []
    for radius, phase, inclination in ((1.01, 0.02, 0.005), (1.02, 0.05, -0.01)):
        (c, s), tilt = (np.cos(phase), np.sin(phase)), np.array([1.0, np.cos(inclination), np.sin(inclination)])
        states.append(np.concatenate([radius * np.array([c, s, s]) * tilt, radius**-0.5 * np.array([-s, c, c]) * tilt]))
    targets = KeplerTargets((Target("first"), Target("second")), np.array(states), np.zeros(2), 1.0)
    return KeplerTour(targets, np.array([1.0, 0.0, 0.0, 0.0, 1.0, 0.0])).fly((0, 1), [2.0, 4.0]).cost
