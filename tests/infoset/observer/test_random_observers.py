"""1 000 random observers of three and four states, 30 steps each, with the default bound on facets.

The errors of all steps are at their bounds, which is the worst case for rounding. Witnesses are
motions in exact rationals: motions of linear programs, moved a little to a motion that is well
inside, so that they satisfy all measurements. Their states must be in the sets, and in the smoothed
sets.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from infoset import LinearObserver, Zonotope
from infoset.arrays import Floats
from infoset.geometry.polytope import Polytope
from tests.infoset.observer.test_linear_observer import Programs
from tests.rationals import Fraction

pytestmark = pytest.mark.thorough

STEPS, BLOCK = 30, 25


@dataclass
class System:
    """A random system; the noise is thin or fat, the outputs are states or not."""

    seed: int

    def __post_init__(self) -> None:
        self.random = random = np.random.default_rng([77, self.seed])
        self.size = n = 3 + self.seed % 2
        a = random.normal(size=(n, n))
        self.a = a * random.uniform(0.8, 1.02) / np.abs(np.linalg.eigvals(a)).max()
        outputs = int(random.integers(1, 3))
        self.c = random.normal(size=(outputs, n)) if self.seed % 8 < 4 else np.eye(outputs, n)
        self.generators = 0.1 * random.normal(size=(int(random.integers(1, 3)), n))
        self.noise = float(random.choice([1e-3, 0.05, 1.0]))

    def observer(self) -> LinearObserver:
        start = Zonotope.box(-np.ones(self.size), np.ones(self.size))
        disturbance = Zonotope(np.zeros(self.size), self.generators)
        return LinearObserver(self.a, self.c, start, noise=self.noise, disturbance=disturbance)

    def simulated(self, steps: int, part: float = 1.0) -> tuple[Floats, Floats]:
        """Coefficients of the initial set and of the disturbances, and measurements, NaN where one
        is missing.
        """
        choice = self.random.choice
        coefficients = part * choice([-1.0, 1.0], self.size + len(self.generators) * (steps - 1))
        x = coefficients[: self.size]
        y = []
        for k in range(steps):
            if k:
                first = self.size + len(self.generators) * (k - 1)
                x = (
                    self.a @ x
                    + coefficients[first : first + len(self.generators)] @ self.generators
                )
            y.append(self.c @ x + part * choice([-1.0, 1.0], len(self.c)) * self.noise)
        measured = np.array(y)
        measured[self.random.random(steps) < 0.1] = np.nan
        return coefficients, measured

    def states(self, coefficients: list[Fraction], steps: int) -> list[list[Fraction]]:
        """Exact states of coefficients."""
        a = exactly(self.a)
        rows = exactly(self.generators)
        states = [coefficients[: self.size]]
        for k in range(1, steps):
            first = self.size + len(rows) * (k - 1)
            w = coefficients[first : first + len(rows)]
            states.append(
                [
                    sum((p * q for p, q in zip(a[i], states[-1], strict=True)), Fraction(0))
                    + sum((z * row[i] for z, row in zip(w, rows, strict=True)), Fraction(0))
                    for i in range(self.size)
                ]
            )
        return states


def exactly(matrix: Floats) -> list[list[Fraction]]:
    return [[Fraction(float(value)) for value in row] for row in matrix]


def beyond(polytope: Polytope, state: list[Fraction]) -> float:
    """Exact distance of a state beyond the facets of a set, relative to the terms of normal . x; at
    most 0 inside.
    """
    if polytope.is_empty:
        return np.inf
    rows, limits = polytope.constraints()
    point = np.array(state, dtype=float)
    terms = np.abs(rows) @ np.abs(point) + np.abs(limits)
    worst = -np.inf
    for row, limit, size, rough in zip(
        exactly(rows), limits.tolist(), terms, rows @ point - limits, strict=True
    ):
        if rough > -1e-9 * size:
            exact = sum((p * q for p, q in zip(row, state, strict=True)), Fraction(0)) - Fraction(
                limit
            )
            worst = max(worst, float(exact) / float(size))
    return worst


@pytest.mark.parametrize("first", range(0, 1000, BLOCK))
def test_true_state_is_inside_at_every_step(first: int) -> None:
    for seed in range(first, first + BLOCK):
        system = System(seed)
        observer = system.observer()
        coefficients, measured = system.simulated(STEPS)
        x = coefficients[: system.size]
        wrong = []
        for k, y in enumerate(measured):
            if k:
                observer.predict()
                place = system.size + len(system.generators) * (k - 1)
                x = (
                    system.a @ x
                    + coefficients[place : place + len(system.generators)] @ system.generators
                )
            observer.update(y)
            (polytope,) = observer.estimate().polytopes
            if not polytope.contains(x):
                wrong.append((seed, k))
        assert not wrong


def witnesses(
    system: System, steps: int, count: int
) -> tuple[Floats, list[tuple[int, list[list[Fraction]]]]]:
    """Measurements, and motions that satisfy them exactly: with an extreme state at a step along a
    random direction.
    """
    inner, measured = system.simulated(steps, part=0.9)
    half = np.ones(system.size)
    noise = np.full(len(system.c), system.noise)
    programs = Programs(system.a, system.c, system.generators, half, noise, measured)
    found = []
    for _ in range(count):
        step = int(system.random.integers(steps))
        extreme = programs.farthest(step, system.random.normal(size=system.size))
        # Linear programs violate constraints by 1e-10; a motion nearer to the inner one does not.
        coefficients = [
            Fraction(float(value))
            for value in np.clip(extreme + 1e-6 * (inner - extreme), -1.0, 1.0)
        ]
        states = system.states(coefficients, steps)
        for state, y in zip(states, measured, strict=True):
            for row, value in zip(exactly(system.c), y.tolist(), strict=True):
                if not np.isnan(value):
                    output = sum((p * q for p, q in zip(row, state, strict=True)), Fraction(0))
                    assert abs(output - Fraction(value)) <= Fraction(system.noise)
        found.append((step, states))
    return measured, found


@pytest.mark.parametrize("first", range(0, 100, 10))
def test_exact_witnesses_are_inside(first: int) -> None:
    """Ten steps: states of witnesses for a step, with all measurements, are in its set and in its
    smoothed set.
    """
    for seed in range(first, first + 10):
        system = System(seed)
        measured, found = witnesses(system, 10, 20)
        observer = system.observer()
        estimates = observer.run(measured)
        smoothed = observer.smooth(estimates)
        for _, states in found:
            for sets in (estimates, smoothed):
                for estimate, state in zip(sets, states, strict=True):
                    assert beyond(estimate.polytopes[0], state) <= 0.0, (
                        seed,
                        estimate.step,
                        sets is smoothed,
                    )
