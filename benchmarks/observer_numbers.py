"""Times of observers: the published example, also with other libraries, and larger systems.

``python -m benchmarks.observer_numbers [SYSTEMS]``, with the number of random systems, 80 by
default. A set-step is a prediction and a measurement of one set. The errors of the published
example are the errors of the bounds of its last set, compared with exact rational arithmetic; it is
also computed with shapely's objects, and with zonoopt if it is installed. The other systems have
three and four states. Their excess compares the widths of the last set, which was reduced, with the
exact ones, for the Clohessy-Wiltshire case and the first 80 systems. The true state must be inside
at every step. A step of a random system is timed three times, and the least time counts.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.linalg import expm

from infoset import LinearObserver, Zonotope
from infoset.experiments.common.input_file import load_problem
from infoset.experiments.observer.file import ObserverProblem
from tests.infoset.observer.test_random_observers import System

Floats = NDArray[np.float64]

RUNS = 10_000
"""Runs of the batch."""
ROUNDS = 7
"""Repetitions, of which the shortest counts."""
EXACT = np.array(
    [
        [-0.10623093461203588, -0.2540037859300611],
        [0.14112566964187895, 0.21278460555195491],
    ]
)
"""Bounds of the last set, rounded from rational numbers."""
TARGET_BATCH_US = 0.5
"""Target of the time of a set-step in a batch, us."""
SYSTEMS = 80
"""Default number of random systems."""


def main() -> None:
    """Print the times and errors."""
    problem = load_problem("observer-2005")
    measured = problem.measured
    assert measured is not None
    notes = [
        f"target of the batch: at most {TARGET_BATCH_US} us; one run: at most the time of shapely"
    ]
    steps = len(measured)
    timings = {
        f"LinearObserver, batch of {RUNS}": timed(
            lambda: ours(problem, measured, RUNS), RUNS * steps
        ),
        "LinearObserver, one run": timed(lambda: ours(problem, measured, None), steps),
        "shapely objects, one run": timed(lambda: with_shapely(problem, measured), steps),
    }
    try:
        zonoopt = importlib.import_module("zonoopt")
    except ImportError:
        notes.append("zonoopt is not installed; install it in a separate environment to compare")
    else:
        for name, bounds in (
            ("zonoopt, sets alone", False),
            ("zonoopt, sets and bounds", True),
        ):
            run = partial(with_zonoopt, zonoopt, problem, measured, bounds)
            timings[name] = timed(run, steps)
    lines = [
        f"{name:36} {us:10.3f} us a set-step   error of the bounds {error:.2g}"
        for name, (us, error) in timings.items()
    ]
    print("\n".join([*lines, *notes]))
    print_many_states(int(sys.argv[1]) if len(sys.argv) > 1 else SYSTEMS)


def print_many_states(count: int) -> None:
    """Print the times of relative motion on a circular orbit, and of random systems of 30 steps."""
    random_runs(range(8))  # compiles the kernels
    print_row(
        "Clohessy-Wiltshire, 500 steps",
        [steps_of(*clohessy_wiltshire(), 500, seed) for seed in range(3)],
    )
    for size in (3, 4):
        seeds = range(size - 3, count, 2)
        print_row(f"{len(seeds)} random systems of {size} states", random_runs(seeds))


def random_runs(seeds: Iterable[int]) -> list[tuple[Floats, Floats]]:
    """Return the times and the excess of random systems.

    The times are the least of three runs, without interruptions.
    """
    runs = []
    for one in map(System, seeds):
        arguments = one.a, one.c, one.generators, one.noise, 30, one.seed
        times, excess = zip(*(steps_of(one.observer(), *arguments) for _ in range(3)), strict=True)
        runs.append((np.minimum.reduce(times), excess[0]))
    return runs


def print_row(name: str, runs: list[tuple[Floats, Floats]]) -> None:
    """Print a row of the times and the excess of some runs."""
    ms = np.concatenate([times for times, _ in runs])
    excess = np.concatenate([more for _, more in runs])
    spread = (
        f"median {np.median(ms):6.2f}, 99 % {np.quantile(ms, 0.99):6.2f}, greatest {ms.max():6.2f} "
        "ms a step"
    )
    more = (
        f"{excess.mean():.1%} too large, median {np.median(excess):.1%}, {excess.max():.1%} at most"
    )
    print(f"{name:32} {spread}; widths {more}", flush=True)


def clohessy_wiltshire() -> tuple[LinearObserver, Floats, Floats, Floats, float]:
    """Return an observer of motion in a plane near a craft at 1.1e-3 rad/s, and its arguments.

    The step is 30 s, the noise 10 m and the disturbance 1e-4 m/s^2.
    """
    rate = 1.1e-3
    pushed = np.zeros((6, 6))
    pushed[:2, 2:4] = np.eye(2)
    pushed[2:4, 4:] = np.eye(2)
    pushed[2, 0] = 3.0 * rate**2
    pushed[2, 3] = 2.0 * rate
    pushed[3, 2] = -2.0 * rate
    moved = expm(30.0 * pushed)
    c = np.eye(2, 4)
    a = moved[:4, :4]
    generators = 1e-4 * moved[:4, 4:].T
    half = np.array([1e3, 1e3, 1.0, 1.0])
    start = Zonotope.box(-half, half)
    disturbance = Zonotope(np.zeros(4), generators)
    return LinearObserver(a, c, start, noise=10.0, disturbance=disturbance), a, c, generators, 10.0


def steps_of(
    observer: LinearObserver,
    a: Floats,
    c: Floats,
    generators: Floats,
    noise: float,
    steps: int,
    seed: int,
) -> tuple[Floats, Floats]:
    """Return the processor times of the steps, ms, and the relative excess of the last widths."""
    random = np.random.default_rng(seed)
    times = []
    state = np.zeros(len(a))
    for k in range(steps):
        if k:
            state = a @ state + random.uniform(-1.0, 1.0, len(generators)) @ generators
        start = time.thread_time()  # without threads of BLAS that wait for work
        if k:
            observer.predict()
        observer.update(c @ state + random.uniform(-noise, noise, len(c)))
        times.append(1e3 * (time.thread_time() - start))
        last = observer.estimate()
        assert last.polytopes[0].contains(state)
    if seed >= SYSTEMS:
        return np.array(times[1:]), np.zeros(0)
    more = last.excess_widths()
    return np.array(times[1:]), more / (last.upper - last.lower - more)


def timed(run: Callable[[], Floats], steps: int) -> tuple[float, float]:
    """Return the shortest processor time, us a step, and the maximum error of the bounds."""
    best = np.inf
    bounds = run()
    for _ in range(ROUNDS):
        start = time.process_time()
        bounds = run()
        best = min(best, time.process_time() - start)
    return 1e6 * best / steps, float(np.abs(bounds - EXACT).max())


def ours(problem: ObserverProblem, measured: Floats, runs: int | None) -> Floats:
    """Return the bounds of the last set of an observer."""
    observer = problem.observer(runs)
    y = measured if runs is None else np.broadcast_to(measured[:, None], (len(measured), runs, 1))
    last = observer.run(y)[-1]
    bounds = np.array([last.lower, last.upper])
    return bounds if runs is None else bounds[:, -1]


def with_shapely(problem: ObserverProblem, measured: Floats) -> Floats:
    """Return the same bounds by one shapely object a step: hulls of points, cut by strips."""
    assert isinstance(problem.disturbance_set, Zonotope)
    w = problem.disturbance_set.generators[0]
    (normal,) = np.array(problem.system.C)
    half = problem.noise.half_width[0]
    along = 100.0 * np.array([-normal[1], normal[0]])
    polygon = shapely.box(-3.0, -3.0, 3.0, 3.0)
    for k, (y,) in enumerate(measured):
        if k:
            points = shapely.get_coordinates(polygon)[:-1] @ np.transpose(problem.system.A)
            polygon = shapely.convex_hull(shapely.multipoints(np.vstack([points + w, points - w])))
        low, high = ((y + side * half) * normal / (normal @ normal) for side in (-1.0, 1.0))
        strip = shapely.polygons([low - along, low + along, high + along, high - along])
        polygon = shapely.intersection(polygon, strip)
    left, bottom, right, top = polygon.bounds
    return np.array([[left, bottom], [right, top]])


def with_zonoopt(zonoopt: Any, problem: ObserverProblem, measured: Floats, bounds: bool) -> Floats:
    """Return the same bounds by constrained zonotopes, computed at every step or at the last."""
    sparse = importlib.import_module("scipy.sparse").csc_matrix
    assert isinstance(problem.disturbance_set, Zonotope)

    def zonotope(centre: Sequence[float], generators: Floats) -> Any:
        return zonoopt.Zono(sparse(generators.T), np.array(centre))

    w = zonotope([0.0, 0.0], problem.disturbance_set.generators)
    shape = zonotope([0.0, 0.0], 3.0 * np.eye(2))
    a = sparse(np.array(problem.system.A))
    c = sparse(np.array(problem.system.C))
    box = None
    for k, y in enumerate(measured):
        if k:
            shape = zonoopt.minkowski_sum(zonoopt.affine_map(shape, a), w)
        shape = zonoopt.intersection(shape, zonotope(y, np.array([problem.noise.half_width])), c)
        if bounds or k == len(measured) - 1:
            box = shape.bounding_box()
    assert box is not None
    return np.array([np.ravel(box.lower()), np.ravel(box.upper())])


if __name__ == "__main__":
    main()
