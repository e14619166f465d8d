"""Encounters of several spacecraft and visits to several targets: computing time and memory.

Times are processor times, the shortest of several rounds, so that other work on the machine has
little effect. Ratios are measured in one run.
"""

from __future__ import annotations

import time
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from infoset.experiments.common.input_file import load_problem
from infoset.rendezvous.multipoint import (
    Nodes,
    TimeLimits,
    Tour,
    TourTarget,
    best_order,
    best_times,
    solve_segments,
)
from infoset.rendezvous.pareto import analyse_coalitions, solve_encounter
from infoset.rendezvous.relative_motion import (
    ClohessyWiltshire,
    EllipticOrbit,
    TimeVaryingMotion,
    TschaunerHempel,
)
from tests.rendezvous.multipoint.dense import solve_dense

Floats = NDArray[np.float64]
Check = Callable[[str, float, float, str], None]

RATE = 1.13e-3


def best_s(work: Callable[[], object], rounds: int) -> float:
    """Return the shortest processor time of several rounds, s."""
    shortest_s = np.inf
    for _ in range(rounds):
        began = time.process_time()
        work()
        shortest_s = min(shortest_s, time.process_time() - began)
    return float(shortest_s)


def equally_spaced(count: int) -> Nodes:
    """Return visits to random targets every 150 s."""
    times = 150.0 * np.arange(1.0, count + 1.0)
    states = 100.0 * np.random.default_rng(0).normal(size=(count, 6))
    return Nodes(times, times, states, states, np.zeros(count, dtype=bool))


def test_pareto(benchmark: BenchmarkFixture, under: Check) -> None:
    encounter = load_problem("pareto-2008").encounter
    benchmark.pedantic(solve_encounter, args=(encounter,), rounds=300, warmup_rounds=5)
    under("pareto, 3 craft", 1e3 * best_s(lambda: solve_encounter(encounter), 500), 1.0, "ms")
    both = 1e3 * best_s(lambda: analyse_coalitions(solve_encounter(encounter)), 300)
    under("the same with its coalitions", both, 2.0, "ms")


def test_elliptic_motion(under: Check, at_least: Check) -> None:
    """500 transitions over 2.5 revolutions, and a Gramian over them, in closed form and by
    collocation of A(t).
    """
    orbit = EllipticOrbit(RATE, 0.3, 0.4)
    end = 2.5 * 2.0 * np.pi / RATE
    times = np.linspace(0.0, end, 500)
    ends = np.full(500, end)
    closed = TschaunerHempel(orbit)
    collocated = TimeVaryingMotion(orbit.dynamics)
    transitions = best_s(lambda: closed.transition(times, ends), 20)
    under("500 transitions about an ellipse", 1e3 * transitions, 5.0, "ms")
    by_collocation = best_s(lambda: collocated.transition(times, ends), 1)
    at_least("the same by collocation, compared with it", by_collocation / transitions, 1000.0, "x")
    gramian = best_s(lambda: closed.gramian(0.0, end), 20)
    under("Gramian of 2.5 revolutions about an ellipse", 1e3 * gramian, 1.0, "ms")
    by_collocation = best_s(lambda: collocated.gramian(0.0, end), 3)
    at_least("the same by collocation, compared with it", by_collocation / gramian, 20.0, "x")


def test_segments_and_the_dense_system(
    benchmark: BenchmarkFixture, under: Check, at_least: Check
) -> None:
    motion = ClohessyWiltshire(RATE)
    nodes = equally_spaced(1000)
    start = np.zeros(6)
    benchmark.pedantic(solve_segments, args=(motion, 0.0, start, nodes), rounds=20, warmup_rounds=2)
    segments = best_s(lambda: solve_segments(motion, 0.0, start, nodes), 20)
    dense = best_s(lambda: solve_dense(motion, 0.0, start, nodes), 2)
    under("segment solver, N = 1000", 1e3 * segments, 40.0, "ms")
    at_least(
        "time of the dense system divided by the segment solver, N = 1000",
        dense / segments,
        10.0,
        "times",
    )


def test_memory_is_linear(under: Check) -> None:
    motion = ClohessyWiltshire(RATE)
    start = np.zeros(6)
    peaks = []
    for count in (1000, 4000):
        nodes = equally_spaced(count)
        solve_segments(motion, 0.0, start, nodes)
        tracemalloc.start()
        solve_segments(motion, 0.0, start, nodes)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    under("memory of 4000 nodes compared with 1000", peaks[1] / peaks[0], 4.4, "times")
    under("memory per node", peaks[1] / 4000 / 1024, 10.0, "kB")


def test_time_is_linear(under: Check) -> None:
    motion = ClohessyWiltshire(RATE)
    start = np.zeros(6)
    few = equally_spaced(1000)
    many = equally_spaced(8000)
    short = best_s(lambda: solve_segments(motion, 0.0, start, few), 20)
    long = best_s(lambda: solve_segments(motion, 0.0, start, many), 10)
    under("time of 8000 nodes compared with 1000", long / short, 12.0, "times")


def test_order_and_times_of_five(benchmark: BenchmarkFixture, under: Check) -> None:
    problem = load_problem("service-5")
    benchmark.pedantic(best_order, args=(problem.tour, problem.limits()), rounds=3, warmup_rounds=1)
    under(
        "N = 5, order and times",
        best_s(lambda: best_order(problem.tour, problem.limits()), 3),
        2.0,
        "s",
    )


@pytest.mark.parametrize(("count", "most_s"), [(6, 4.0), (9, 120.0)])
def test_order_and_times_of_many(count: int, most_s: float, under: Check) -> None:
    rate_rad_s = 1.1e-3
    random = np.random.default_rng(1)
    states = random.normal(size=(count, 6)) * np.array([300.0, 3000.0, 300.0, 0.3, 0.3, 0.3])
    states[:, 4] = -2.0 * rate_rad_s * states[:, 0]
    targets = tuple(TourTarget(str(number)) for number in range(count))
    tour = Tour(ClohessyWiltshire(rate_rad_s), targets, states, np.zeros(6))
    two_revolutions = TimeLimits(4.0 * np.pi / rate_rad_s)
    best_order(tour, TimeLimits(1.0 / rate_rad_s))
    under(
        f"N = {count}, order and times",
        best_s(lambda: best_order(tour, two_revolutions), 1),
        most_s,
        "s",
    )


def test_the_asteroid_tour(benchmark: BenchmarkFixture, under: Check) -> None:
    problem = load_problem("asteroid-tour")
    assert problem.times_s is not None
    times = problem.times_s
    order = (0, 1, 2)
    problem.tour.fly(order, times)
    benchmark.pedantic(problem.tour.fly, args=(order, times), rounds=3)
    under("asteroid-tour: its path", best_s(lambda: problem.tour.fly(order, times), 3), 2.0, "s")
    under(
        "its best times",
        best_s(lambda: best_times(problem.tour, order, problem.limits(), [times]), 1),
        20.0,
        "s",
    )
    both = best_s(lambda: best_order(problem.tour, problem.limits(), [times]), 1)
    under("its best order and times", both, 60.0, "s")
