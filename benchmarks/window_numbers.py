"""Observers of five and more states: times of zonotopes and of programs, and widths compared with
the exact ones.

``python -m benchmarks.window_numbers [STATES ..]``, 8, 12 and 20 by default. The systems are those
of `tests/infoset/observer/test_window.py`: a random one, masses in a row whose positions are
measured, and undamped masses between springs, of which every other position is measured; 40 steps
with errors within their bounds. The ratios are geometric means over the states at steps 29 and 39,
of the width to that of the whole record. Times are processor times of one thread: of a step of the
zonotope, and of one bound.

``python -m benchmarks.window_numbers small`` compares windows with the polytopes of `max_facets`,
for random systems of three and four states of `benchmarks/observer_numbers.py` with 30 steps.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from typing import NamedTuple
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from infoset import LinearObserver, Zonotope
from infoset.observer import linear_observer
from infoset.observer.estimate import Estimate
from infoset.observer.window import Windows
from tests.infoset.observer.test_random_observers import System
from tests.infoset.observer.test_window import WideSystem

Floats = NDArray[np.float64]

STEPS = 40
AT = (29, 39)
WINDOWS = (5, 10, 20, None)
SMALL_SYSTEMS = 5
"""Random systems of each of three and four states."""
SMALL_STEPS = 30


class Timed(NamedTuple):
    """Estimates of all steps, and the time of a step, ms."""

    estimates: list[Estimate]
    step_ms: float


def run_timed(observer: LinearObserver, measured: Floats) -> Timed:
    """Process measurements."""
    start = time.thread_time()
    estimates = observer.run(measured)
    return Timed(estimates, 1e3 * (time.thread_time() - start) / len(measured))


def widths_of(estimate: Estimate) -> tuple[Floats, float]:
    """Return the widths along the states, and the time of a bound, ms."""
    start = time.thread_time()
    widths = np.asarray(estimate.upper - estimate.lower)
    return widths, 1e3 * (time.thread_time() - start) / (2 * len(widths))


def zonotope_widths(estimate: Estimate) -> Floats:
    """Return the widths of the carried zonotope."""
    assert isinstance(estimate.sets, Windows)
    return np.asarray(2.0 * np.abs(estimate.sets.members[0].carried.generators).sum(axis=0))


def mean_ratio(widths: Sequence[Floats], exact: Sequence[Floats]) -> float:
    """Return the geometric mean of the ratios."""
    return float(np.exp(np.log(np.concatenate(widths) / np.concatenate(exact)).mean()))


def print_system(name: str, system: WideSystem) -> None:
    """Print the row of a system."""
    _, measured = system.simulated(STEPS, 1, extremal=False)
    cells = []
    columns = []
    for window in WINDOWS:
        timed = run_timed(system.observer(window=window), measured)
        pairs = [widths_of(timed.estimates[step]) for step in AT]
        columns.append([widths for widths, _ in pairs])
        cells.append(f"{np.mean([ms for _, ms in pairs]):6.1f} ms")
        zonotopes = [zonotope_widths(timed.estimates[step]) for step in AT]
        step_ms = timed.step_ms
    exact = columns[-1]
    text = [f"{name:10} zonotope {step_ms:.3f} ms, {mean_ratio(zonotopes, exact):.2f}"]
    for window, cell, widths in zip(WINDOWS, cells, columns, strict=True):
        text.append(f"{window or 'whole'}: {cell}, {mean_ratio(widths, exact):.3f}")
    print(" | ".join(text), flush=True)


def windows_of_few_states(system: System) -> LinearObserver:
    """Return an observer of three or four states with windows in place of polytopes."""
    start = Zonotope.box(-np.ones(system.size), np.ones(system.size))
    disturbance = Zonotope(np.zeros(system.size), system.generators)
    with patch.object(linear_observer, "MAX_POLYTOPE_STATES", 2):
        return LinearObserver(
            system.a, system.c, start, noise=system.noise, disturbance=disturbance
        )


def print_small(states: int) -> None:
    """Print both methods for random systems of a number of states."""
    rows: dict[str, list[tuple[float, float, Floats]]] = {"polytopes": [], "windows": []}
    for seed in range(states - 3, states - 3 + 2 * SMALL_SYSTEMS, 2):
        system = System(seed)
        random = np.random.default_rng(seed)
        state = np.zeros(states)
        measured = []
        for k in range(SMALL_STEPS):
            if k:
                state = (
                    system.a @ state
                    + random.uniform(-1.0, 1.0, len(system.generators)) @ system.generators
                )
            measured.append(
                system.c @ state + random.uniform(-system.noise, system.noise, len(system.c))
            )
        for name, observer in (
            ("polytopes", system.observer()),
            ("windows", windows_of_few_states(system)),
        ):
            timed = run_timed(observer, np.array(measured))
            last = timed.estimates[-1]
            widths, bound_ms = widths_of(last)
            excess = last.excess_widths()
            rows[name].append((timed.step_ms, bound_ms, excess / (widths - excess)))
    for name, results in rows.items():
        excess = np.concatenate([more for _, _, more in results])
        step_ms, bound_ms = (np.median([row[k] for row in results]) for k in range(2))
        print(
            f"{states} states, {name:9}: {step_ms:6.2f} ms a step, {bound_ms:5.2f} ms a bound; "
            f"widths {excess.mean():.1%} too large, median {np.median(excess):.1%}, "
            f"{excess.max():.1%} at most",
            flush=True,
        )


def main() -> None:
    """Print the rows that the arguments ask for."""
    if sys.argv[1:] == ["small"]:
        for states in (3, 4):
            print_small(states)
        return
    for states in map(int, sys.argv[1:] or ("8", "12", "20")):
        print_system(f"{states} random", WideSystem.random(states, 1))
        print_system(f"{states} chain", WideSystem.chain(states))
        print_system(f"{states} springs", WideSystem.springs(states))


if __name__ == "__main__":
    main()
