"""Times of observers whose sets are small, flat or singular, and true states outside of them.

    python -m benchmarks.hard_observers

The errors of all steps are at their bounds. The first rows are the 1 000 random systems of the
thorough tests. The last one has 600 systems of three and four states: some have singular or rounded
matrices, flat initial sets, exact measurements, or units of the states from 1e-9 to 1e9. A lost
state is beyond a facet normal . x <= offset, by a distance relative to the terms of normal . x.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from infoset import LinearObserver, Zonotope
from tests.infoset.observer.test_random_observers import STEPS, System

Floats = NDArray[np.float64]
Case = tuple[LinearObserver, Floats, Floats]
"""An observer, its true states, and its measurements, NaN where one is missing."""


def random_case(seed: int) -> Case:
    """Return a system of the thorough tests."""
    system = System(seed)
    coefficients, measured = system.simulated(STEPS)
    states = [coefficients[: system.size]]
    pushes = coefficients[system.size :].reshape(STEPS - 1, -1)
    for push in pushes:
        states.append(system.a @ states[-1] + push @ system.generators)
    return system.observer(), np.array(states), measured


def degenerate_case(seed: int) -> Case:
    """Return a system of three or four states: singular, flat, exact, or in different units."""
    random = np.random.default_rng(seed + 100_000)
    n = int(random.choice([3, 4]))
    outputs = int(random.integers(1, 4))
    a = random.normal(size=(n, n)) * random.choice([0.3, 0.6])
    if seed % 4 == 0:
        a[-1] = 0.0
    if seed % 5 == 0:
        a = np.round(2.0 * a) / 2.0
    c = np.eye(outputs, n) if seed % 3 == 0 else random.normal(size=(outputs, n))
    generators = 0.1 * random.normal(size=(int(random.integers(0, 3)), n))
    half = random.choice([0.0, 0.5, 1.0], n)
    noise = float(random.choice([0.0, 1e-6, 1e-3, 0.05, 0.5]))
    half = np.maximum(half, 0.5) if seed % 2 else half
    units = 10.0 ** random.integers(-9, 10, n) if seed % 7 < 3 else np.ones(n)
    a = a * units[:, None] / units
    c = c / units
    generators = generators * units
    half = half * units

    start = Zonotope.box(-half, half)
    disturbance = Zonotope(np.zeros(n), generators)
    states = [random.choice([-1.0, 1.0], n) * half]
    measured = []
    for k in range(8):
        if k:
            states.append(a @ states[-1] + random.choice([-1.0, 1.0], len(generators)) @ generators)
        known = 1.0 if random.random() < 0.8 else np.nan
        measured.append(known * (c @ states[-1] + random.choice([-1.0, 1.0], outputs) * noise))
    return (
        LinearObserver(a, c, start, noise=noise, disturbance=disturbance),
        np.array(states),
        np.array(measured),
    )


def show(name: str, case_of: Callable[[int], Case], seeds: Iterable[int]) -> None:
    """Simulate the systems and print the row."""
    times_ms = list[float]()
    lost = list[float]()
    emptied = 0
    count = 0
    for seed in seeds:
        observer, states, measured = case_of(seed)
        count += 1
        for k, (state, y) in enumerate(zip(states, measured, strict=True)):
            start = time.thread_time()
            if k:
                observer.predict()
            observer.update(y)
            times_ms.append(1e3 * (time.thread_time() - start))
            (polytope,) = observer.estimate().polytopes
            if polytope.is_empty:
                emptied += 1
                break
            if not polytope.contains(state):
                rows, limits = polytope.constraints()
                terms = np.abs(rows) @ np.abs(state) + np.abs(limits)
                lost.append(float(((rows @ state - limits) / np.maximum(terms, 1e-300)).max()))
                break
    ms = np.array(times_ms)
    print(
        f"{count} systems {name}: median {np.median(ms):.2f}, 99 % {np.quantile(ms, 0.99):.1f}, "
        f"greatest {ms.max():.0f} ms a step; {(ms > 50.0).sum()} of {len(ms)} steps over 50 ms; "
        f"emptied {emptied}, lost {len(lost)}, by {max(lost, default=0.0):.1e} of the terms at "
        "most",
        flush=True,
    )


if __name__ == "__main__":
    show("of 3 and 4 states, with the time to compile", random_case, range(2))
    for size in (3, 4):
        show(f"of {size} states, errors at their bounds", random_case, range(size - 3, 1000, 2))
    show("singular, flat or in different units", degenerate_case, range(600))
