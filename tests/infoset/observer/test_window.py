"""Observers of five and more states: true states, linear programs of their own, contradictions,
smoothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from infoset import LinearObserver, Polytope, Zonotope
from infoset.arrays import Floats
from infoset.observer import programs
from infoset.observer.estimate import Estimate
from infoset.observer.window import Windows
from tests.infoset.observer.test_linear_observer import Programs, chain

PROGRAM_GAP = 1e-7
"""Difference of our bounds from the optima, in widths: both programs have tolerances of 1e-10, and
multipliers of up to hundreds of them are added."""


@dataclass(frozen=True)
class WideSystem:
    """A system of many states from a box of half-width 1."""

    a: Floats
    c: Floats
    generators: Floats
    noise: float

    @classmethod
    def random(cls, states: int, seed: int) -> WideSystem:
        """Return a random system near the limit of stability, with half as many outputs as
        states.
        """
        random = np.random.default_rng([57, states, seed])
        a = random.normal(size=(states, states))
        a *= random.uniform(0.8, 1.02) / np.abs(np.linalg.eigvals(a)).max()
        c = random.normal(size=(states // 2, states))
        generators = 0.1 * random.normal(size=(max(states // 3, 1), states))
        return cls(a, c, generators, float(random.choice([0.05, 0.2, 1.0])))

    @classmethod
    def chain(cls, states: int) -> WideSystem:
        """Return masses in a row, of an even number of states, whose positions are measured."""
        a, c, generators = chain(states // 2, 2)
        return cls(a, c, generators, 0.2)

    @classmethod
    def springs(cls, states: int) -> WideSystem:
        """Return undamped masses in a row between springs, of an even number of states; every other
        position is seen.

        The slowest oscillation of four masses takes 34 steps.
        """
        masses = states // 2
        springs = 0.09 * (2.0 * np.eye(masses) - np.eye(masses, k=1) - np.eye(masses, k=-1))
        rates = np.block(
            [[np.zeros((masses, masses)), np.eye(masses)], [-springs, np.zeros((masses, masses))]]
        )
        c = np.eye(states)[:masses:2]
        generators = 0.05 * np.eye(states)[masses:]
        return cls(expm(rates), c, generators, 0.2)

    def observer(self, **options: Any) -> LinearObserver:
        states = len(self.a)
        box = Zonotope.box(-np.ones(states), np.ones(states))
        disturbance = Zonotope(np.zeros(states), self.generators)
        return LinearObserver(
            self.a, self.c, box, noise=self.noise, disturbance=disturbance, **options
        )

    def simulated(
        self, steps: int, seed: int, share: float = 1.0, *, extremal: bool = True
    ) -> tuple[Floats, Floats]:
        """Return states and measurements with errors at a share of their bounds, or within it."""
        random = np.random.default_rng([seed, len(self.a)])

        def errors(count: int) -> Floats:
            if extremal:
                return share * random.choice([-1.0, 1.0], count)
            return share * random.uniform(-1.0, 1.0, count)

        states = [errors(len(self.a))]
        for _ in range(steps - 1):
            states.append(self.a @ states[-1] + errors(len(self.generators)) @ self.generators)
        measured = [self.c @ state + self.noise * errors(len(self.c)) for state in states]
        return np.array(states), np.array(measured)

    def programs(self, measured: Floats) -> Programs:
        """Return linear programs that share no code with the observer."""
        half = np.ones(len(self.a))
        return Programs(
            self.a, self.c, self.generators, half, np.full(len(self.c), self.noise), measured
        )


def need_inside(estimate: Estimate, state: Floats) -> None:
    """Assert that a state is within the bounds of an estimate."""
    assert (estimate.lower <= state).all(), estimate.step
    assert (estimate.upper >= state).all(), estimate.step


def geometric_mean(ratios: Floats) -> float:
    return float(np.exp(np.log(ratios).mean()))


# The true state
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "system",
    [
        WideSystem.random(7, 1),
        WideSystem.chain(8),
        WideSystem.springs(8),
        WideSystem.random(12, 1),
        pytest.param(WideSystem.random(20, 1), marks=pytest.mark.thorough),
    ],
)
def test_true_state_with_errors_at_their_bounds_is_inside_the_window_bounds(
    system: WideSystem,
) -> None:
    states, measured = system.simulated(14, 3)
    every = 1 if len(system.a) < 10 else 13

    estimates = system.observer().run(measured)

    for estimate, state in list(zip(estimates, states, strict=True))[::every]:
        need_inside(estimate, state)
        direction = np.linspace(-1.0, 2.0, len(state))
        lower, upper = estimate.output_hull([direction])
        assert lower[0] <= direction @ state <= upper[0]
    assert not estimates[-1].is_empty


def hard_system(seed: int) -> tuple[LinearObserver, Floats, Floats]:
    """Return an observer of 7 to 9 states that may be singular, flat, exact, unstable or in
    different units.
    """
    random = np.random.default_rng([571, seed])
    states = int(random.integers(7, 10))
    outputs = int(random.integers(1, 5))
    a = random.normal(size=(states, states)) * random.choice([0.2, 0.4, 0.6])
    if seed % 4 == 0:
        a[-1] = 0.0
    if seed % 5 == 0:
        a = np.round(2.0 * a) / 2.0
    c = np.eye(outputs, states) if seed % 3 == 0 else random.normal(size=(outputs, states))
    generators = 0.1 * random.normal(size=(int(random.integers(0, 3)), states))
    half = random.choice([0.0, 0.5, 1.0], states)
    noise = float(random.choice([0.0, 1e-6, 0.05, 0.5]))
    units = 10.0 ** random.integers(-9, 10, states) if seed % 2 else np.ones(states)
    a = a * units[:, None] / units
    c = c / units
    generators = generators * units
    half = half * units

    true = [random.choice([-1.0, 1.0], states) * half]
    measured = []
    for k in range(14):
        if k:
            true.append(a @ true[-1] + random.choice([-1.0, 1.0], len(generators)) @ generators)
        y = c @ true[-1] + random.choice([-1.0, 1.0], outputs) * noise
        y[random.random(outputs) < 0.2] = np.nan
        measured.append(y)
    start = Zonotope.box(-half, half)
    observer = LinearObserver(
        a, c, start, noise=noise, disturbance=Zonotope(np.zeros(states), generators)
    )
    return observer, np.array(true), np.array(measured)


@pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(6, 12))]
)
def test_true_state_of_singular_flat_exact_unstable_systems_is_inside(seed: int) -> None:
    observer, states, measured = hard_system(seed)

    estimates = observer.run(measured)
    smoothed = observer.smooth(estimates)

    for k in (0, 3, 13):
        need_inside(estimates[k], states[k])
        need_inside(smoothed[k], states[k])
    assert int(observer.inconsistency.step) == -1


def test_any_multipliers_give_an_upper_bound() -> None:
    system = WideSystem.random(7, 2)
    states, measured = system.simulated(9, 5)
    observer = system.observer()
    observer.run(measured)
    sets = observer.estimate().sets
    assert isinstance(sets, Windows)
    program = sets.members[0].program
    random = np.random.default_rng(1)

    for _ in range(200):
        direction = random.normal(size=7)
        marginals = random.normal(size=9 * len(system.c)) * 10.0 ** random.integers(-9, 4)
        assert program._sum(direction, marginals) >= direction @ states[-1]
        assert program._sum(np.zeros(7), marginals) >= 0.0


def test_bounds_do_not_depend_on_the_success_of_the_solver(monkeypatch: pytest.MonkeyPatch) -> None:
    system = WideSystem.random(8, 1)
    states, measured = system.simulated(12, 2)
    monkeypatch.setattr(programs, "linprog", lambda *_, **__: SimpleNamespace(status=4))

    observer = system.observer()
    estimates = observer.run(measured)

    for estimate, state in zip(estimates, states, strict=True):
        need_inside(estimate, state)
    for estimate, state in zip(observer.smooth(estimates), states, strict=True):
        need_inside(estimate, state)
    assert int(observer.inconsistency.step) == -1


# Other programs
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("system", [WideSystem.random(7, 3), WideSystem.chain(8)])
def test_bounds_of_the_whole_record_equal_other_programs(system: WideSystem) -> None:
    _, measured = system.simulated(14, 1, 0.8, extremal=False)
    measured[2, 0] = np.nan

    observer = system.observer(window=None)
    estimates = observer.run(measured)

    for k in (0, 7, 13):
        lower, upper = map(np.array, system.programs(measured[: k + 1]).hull(k))
        gap = PROGRAM_GAP * (upper - lower)
        np.testing.assert_array_less(np.abs(estimates[k].lower - lower), gap)
        np.testing.assert_array_less(np.abs(estimates[k].upper - upper), gap)
        assert not estimates[k].reduced
    for k in (0, 6):
        lower, upper = map(np.array, system.programs(measured).hull(k))
        smoothed = observer.smooth(estimates)[k]
        gap = PROGRAM_GAP * (upper - lower)
        np.testing.assert_array_less(np.abs(smoothed.lower - lower), gap)
        np.testing.assert_array_less(np.abs(smoothed.upper - upper), gap)


@pytest.mark.parametrize("system", [WideSystem.random(8, 1), WideSystem.chain(8)])
def test_window_of_ten_steps_is_within_six_per_cent_of_the_exact_widths(system: WideSystem) -> None:
    _, measured = system.simulated(25, 1, extremal=False)

    estimate = system.observer().run(measured)[-1]

    lower, upper = map(np.array, system.programs(measured).hull(24))
    ratio = (estimate.upper - estimate.lower) / (upper - lower)
    assert estimate.reduced
    assert ratio.min() >= 1.0 - PROGRAM_GAP
    assert geometric_mean(ratio) <= 1.06
    excess = estimate.excess_widths()
    np.testing.assert_allclose(excess, estimate.upper - estimate.lower - (upper - lower), atol=1e-6)


def test_initial_polytope_and_disturbance_are_exact_within_the_window() -> None:
    system = WideSystem.random(7, 4)
    _, measured = system.simulated(5, 1, 0.8, extremal=False)
    box = Polytope.from_box(-np.ones(7), np.ones(7))
    disturbance = Zonotope(np.zeros(7), system.generators).polytope()

    observer = LinearObserver(system.a, system.c, box, noise=system.noise, disturbance=disturbance)
    estimate = observer.run(measured)[-1]

    lower, upper = map(np.array, system.programs(measured).hull(4))
    np.testing.assert_allclose(estimate.lower, lower, rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(estimate.upper, upper, rtol=0.0, atol=1e-7)


def test_runs_of_a_batch_equal_single_runs() -> None:
    system = WideSystem.chain(8)
    records = [system.simulated(12, seed)[1] for seed in range(2)]
    records[1][4] = np.nan

    batch = system.observer(runs=2).run(np.stack(records, axis=1))[-1]

    for run, record in enumerate(records):
        alone = system.observer().run(record)[-1]
        np.testing.assert_array_equal(batch.lower[run], alone.lower)
        np.testing.assert_array_equal(batch.upper[run], alone.upper)
    assert batch.is_empty.tolist() == [False, False]


# Contradictions
# --------------------------------------------------------------------------------------------------


def test_contradiction_that_only_a_program_shows_is_located_with_its_excess() -> None:
    system = WideSystem.random(7, 5)
    _, measured = system.simulated(10, 2, 0.5, extremal=False)
    exact = system.programs(measured[:6])
    step, output = 6, 1
    # The farthest possible output at the step, before its own measurement, and a measurement just
    # beyond it.
    row = system.c[output]
    before = np.vstack([measured[:6], np.full((1, len(system.c)), np.nan)])
    before[6, :output] = measured[6, :output]
    exact = system.programs(before)
    farthest = float(row @ exact.states[6] @ exact.farthest(6, row))
    excess = 0.01
    measured[step, output] = farthest + system.noise + excess

    observer = system.observer()
    estimates = observer.run(measured[:8])

    where = observer.inconsistency
    assert [int(where.step), int(where.output)] == [step, output]
    np.testing.assert_allclose(where.excess, excess, rtol=0.0, atol=1e-6)
    assert [bool(estimate.is_empty) for estimate in estimates] == [False] * 6 + [True] * 2
    assert np.isnan(estimates[-1].lower).all()
    assert all(estimate.is_empty for estimate in observer.smooth(estimates))


def test_contradiction_that_the_zonotope_shows_is_found_without_a_program() -> None:
    system = WideSystem.chain(8)
    observer = system.observer()

    observer.update([0.0, 0.0, 9.0, 0.0])

    where = observer.inconsistency
    assert [int(where.step), int(where.output)] == [0, 2]
    np.testing.assert_allclose(where.excess, 9.0 - 1.0 - 0.2)
    observer.predict()
    assert observer.estimate().is_empty
    assert observer.estimate().to_dict() == {
        "step": 1,
        "is_empty": True,
        "lower": None,
        "upper": None,
    }


# Interface
# --------------------------------------------------------------------------------------------------


def test_polytopes_of_many_states_are_refused() -> None:
    estimate = WideSystem.random(7, 1).observer().estimate()
    with pytest.raises(
        ValueError, match=r"at most 4 states are possible: use \.lower, \.upper or \.output_hull"
    ):
        _ = estimate.polytopes
    with pytest.raises(ValueError, match=r"not two: use \.lower, \.upper or \.output_hull"):
        _ = estimate.polygons
    with pytest.raises(ValueError, match=r"of 5 and more states .* use the bounds of the states"):
        estimate.chebyshev_centre()
    with pytest.raises(ValueError, match="window"):
        WideSystem.random(7, 1).observer(window=0)


@pytest.mark.thorough
@pytest.mark.parametrize("states", range(7, 21))
def test_true_states_of_many_systems_are_inside(states: int) -> None:
    """About 730 checks for each number of states: both bounds of a few states at each step, and of
    one direction.
    """
    for seed in range(6):
        system = (
            WideSystem.random(states, seed) if seed % 2 or states % 2 else WideSystem.chain(states)
        )
        true, measured = system.simulated(21, seed)
        observer = system.observer()
        random = np.random.default_rng(seed)
        for estimate, state in list(zip(observer.run(measured), true, strict=True))[::4]:
            directions = np.vstack(
                [np.eye(states)[random.choice(states, 5)], random.normal(size=(5, states))]
            )
            lower, upper = estimate.output_hull(directions)
            assert (lower <= directions @ state).all(), (seed, estimate.step)
            assert (upper >= directions @ state).all(), (seed, estimate.step)
        assert int(observer.inconsistency.step) == -1


@pytest.mark.thorough
@pytest.mark.parametrize("first", range(12, 252, 24))
def test_true_states_of_many_hard_systems_are_inside(first: int) -> None:
    for seed in range(first, first + 24):
        observer, states, measured = hard_system(seed)
        for estimate, state in list(zip(observer.run(measured), states, strict=True))[::4]:
            need_inside(estimate, state)
        assert int(observer.inconsistency.step) == -1, seed


@pytest.mark.thorough
@pytest.mark.parametrize("states", [8, 12, 20])
@pytest.mark.parametrize("kind", ["random", "chain"])
def test_window_widths_are_within_six_per_cent_up_to_twenty_states(states: int, kind: str) -> None:
    system = WideSystem.chain(states) if kind == "chain" else WideSystem.random(states, 1)
    _, measured = system.simulated(30, 1, extremal=False)

    estimate = system.observer().run(measured)[-1]

    excess = estimate.excess_widths()
    width = estimate.upper - estimate.lower
    assert geometric_mean(width / (width - excess)) <= 1.06
