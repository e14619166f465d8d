"""Observers that allow for wrong measurements: widths and times, for docs/estimation.md.

``python -m benchmarks.wrong_measurements [RUNS]``, 300 runs of the vehicle by default, each with
none to q wrong measurements, and three runs of relative motion with one. Widths are relative to the
exact union, of all ordinary observers that leave out q measurements of the run, at all steps. The
times are processor times of a step and its bounds, and their ratio is the median of pairs that
follow each other: an ordinary observer of one run, and one that allows for wrong measurements.
"""

from __future__ import annotations

import sys
import time
from itertools import combinations
from typing import Any

import numpy as np

from infoset import LinearObserver
from infoset.arrays import Floats
from tests.infoset.observer.test_cover import STEPS, Driven, clohessy_wiltshire, vehicle

CASES = ((1, 4), (1, 8), (2, 5), (2, 8))
"""Wrong measurements and classes."""
PAIRS = 60
"""Pairs of runs whose times are compared."""


def union_widths(driven: Driven, run: int, wrong: int) -> Floats:
    """Return the widths of the exact union of a run, shape (N, 2)."""
    left_out = np.array(list(combinations(range(STEPS), wrong)))
    measured = np.repeat(driven.measured[:, run, None], len(left_out), axis=1)
    for number, steps in enumerate(left_out):
        measured[steps, number] = np.nan
    inputs = driven.inputs[:, run]
    estimates = vehicle(runs=len(left_out)).run(measured, inputs)
    lower = np.array([np.nanmin(estimate.lower, axis=0) for estimate in estimates])
    upper = np.array([np.nanmax(estimate.upper, axis=0) for estimate in estimates])
    return np.asarray(upper - lower)


def print_vehicle(wrong: int, classes: int, runs: int) -> None:
    """Print a row of the vehicle."""
    driven = Driven.of(runs, wrong, seed=wrong)
    observer = vehicle(runs=runs, wrong_measurements=wrong, measurement_classes=classes)
    estimates = observer.run(driven.measured, driven.inputs)
    widths = np.array([estimate.upper - estimate.lower for estimate in estimates])
    exact = np.array([union_widths(driven, run, wrong) for run in range(runs)]).swapaxes(0, 1)
    ratios = (widths / exact).reshape(-1, 2)

    ordinary = vehicle(runs=runs).run(driven.measured, driven.inputs)
    inside = np.array(
        [
            estimate.polygons.contains(state)
            for estimate, state in zip(ordinary, driven.states, strict=True)
        ]
    )
    emptied = ordinary[-1].is_empty
    lost = ~inside.all(axis=0) & ~emptied
    has_wrong = int((driven.wrong >= 0).any(axis=1).sum())
    median = np.median(ratios, axis=0)
    most = np.quantile(ratios, 0.9, axis=0)
    print(
        f"vehicle, q = {wrong}, G = {classes}: widths {median.round(3)}, 90 % {most.round(3)}; "
        f"ordinary set empty {emptied.sum()}, false {lost.sum()} of {has_wrong} runs with a wrong "
        f"one; {time_ratio(driven, wrong, classes)}",
        flush=True,
    )


def time_ratio(driven: Driven, wrong: int, classes: int) -> str:
    """Return the times of a step of both observers, and their ratio."""
    arguments = {"wrong_measurements": wrong, "measurement_classes": classes}
    pairs = []
    for number in range(PAIRS):
        run = number % len(driven.wrong)
        measured = driven.measured[:, run]
        inputs = driven.inputs[:, run]
        ms = [run_ms(vehicle(**given), measured, inputs) for given in ({}, arguments)]
        pairs.append(ms)
    ordinary, covered = np.median(pairs, axis=0)
    ratio = float(np.median([after / before for before, after in pairs[5:]]))
    return f"{ordinary:.3f} and {covered:.3f} ms a step, ratio {ratio:.2f}"


def run_ms(observer: LinearObserver, measured: Floats, inputs: Floats) -> float:
    """Return the processor time of a step and its bounds, ms."""
    start = time.process_time()
    for k, y in enumerate(measured):
        if k:
            observer.predict(inputs[k - 1])
        observer.update(y)
        estimate = observer.estimate()
        _ = estimate.lower, estimate.upper
    return 1e3 * (time.process_time() - start) / len(measured)


def print_relative_motion(classes: int, steps: int = 24) -> None:
    """Print a row of relative motion, four states."""
    ratios = []
    times = []
    for seed in range(3):
        random = np.random.default_rng([seed, 6])
        _, a, generators = clohessy_wiltshire()
        states = [random.uniform(-1.0, 1.0, 4) * [1e3, 1e3, 1.0, 1.0]]
        for _ in range(steps - 1):
            states.append(a @ states[-1] + random.uniform(-1.0, 1.0, 2) @ generators)
        measured = np.array(states)[:, :2] + random.uniform(-10.0, 10.0, (steps, 2))
        measured[random.integers(6, steps)] += random.choice([-1.0, 1.0], 2) * [40.0, 200.0]

        arguments: list[dict[str, Any]] = [{}, {"wrong_measurements": 1}]
        arguments[1]["measurement_classes"] = classes
        row = [
            run_ms(clohessy_wiltshire(**given)[0], measured, np.zeros((steps, 0)))
            for given in arguments
        ]
        times.append(row)
        last = clohessy_wiltshire(**arguments[1])[0].run(measured)[-1]
        assert ((last.lower <= states[-1]) & (states[-1] <= last.upper)).all()
        hypotheses = np.repeat(measured[:, None], steps, axis=1)
        hypotheses[np.arange(steps), np.arange(steps)] = np.nan
        union = clohessy_wiltshire(runs=steps)[0].run(hypotheses)[-1]
        exact = np.nanmax(union.upper, axis=0) - np.nanmin(union.lower, axis=0)
        ratios.append((last.upper - last.lower) / exact)
    widths = np.median(ratios, axis=0).round(2)
    ordinary, covered = np.mean(times, axis=0)
    print(
        f"relative motion, q = 1, G = {classes}: last widths {widths}; {ordinary:.2f} and "
        f"{covered:.2f} ms a step",
        flush=True,
    )


def main() -> None:
    """Print a row for each case."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 300
    for wrong, classes in CASES:
        # The union of two wrong measurements has 780 hypotheses a run.
        print_vehicle(wrong, classes, runs if wrong == 1 else max(runs // 10, 1))
    for classes in (4, 8):
        print_relative_motion(classes)


if __name__ == "__main__":
    main()
