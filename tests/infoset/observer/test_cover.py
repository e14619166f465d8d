"""Observers of which at most q measurements are wrong: true states, members, proofs, classes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb
from typing import Any

import numpy as np
import pytest

from infoset import ConvexPolygons, Estimate, LinearObserver, Zonotope
from infoset.arrays import Flags, Floats, Integers
from infoset.observer.cover import Cover
from tests.infoset.observer.test_linear_observer import chain
from tests.infoset.observer.test_window import WideSystem

A = np.array([[1.0, 0.5], [0.0, 1.0]])
B = np.array([[0.125], [0.5]])
C = np.array([[1.0, 0.0]])
PUSH = np.array([0.05, 0.2])
"""The disturbance of a vehicle is this vector times -1 to 1."""
BOUND = 3.0
STEPS = 40


def vehicle(**arguments: Any) -> LinearObserver:
    """Return the observer of docs/estimation.md."""
    start = Zonotope.box([-10.0, 0.0], [10.0, 20.0])
    arguments = {"noise": BOUND} | arguments
    return LinearObserver(
        A, C, start, disturbance=Zonotope(np.zeros(2), [PUSH]), input_matrix=B, **arguments
    )


@dataclass(frozen=True)
class Driven:
    """Simulated vehicles, independent of the observers: N steps of B runs."""

    states: Floats
    inputs: Floats
    measured: Floats
    wrong: Integers
    """Steps of the wrong measurements, shape (B, q); -1 is none."""

    @classmethod
    def of(cls, runs: int, most_wrong: int, seed: int) -> Driven:
        """Return runs with 0 to `most_wrong` wrong measurements, of 1.05 to 1000 bounds."""
        random = np.random.default_rng(seed)
        inputs = random.uniform(-2.0, 2.0, (STEPS, runs, 1))
        states = np.empty((STEPS, runs, 2))
        states[0] = random.uniform([-10.0, 0.0], [10.0, 20.0], (runs, 2))
        for k in range(1, STEPS):
            pushed = random.uniform(-1.0, 1.0, (runs, 1)) * PUSH
            states[k] = states[k - 1] @ A.T + inputs[k - 1] @ B.T + pushed

        errors = random.uniform(-BOUND, BOUND, (STEPS, runs))
        wrong = np.full((runs, most_wrong), -1)
        for run in range(runs):
            number = int(random.integers(most_wrong + 1))
            steps = random.permutation(STEPS)[:number]
            sizes = BOUND * np.exp(random.uniform(np.log(1.05), np.log(1000.0), number))
            errors[steps, run] = random.choice([-1.0, 1.0], number) * sizes
            wrong[run, :number] = steps
        return cls(states, inputs, states[..., :1] + errors[..., None], wrong)

    def without(self, steps: Integers) -> Floats:
        """Return the measurements without those of some steps."""
        measured = self.measured.copy()
        measured[steps] = np.nan
        return measured


def are_inside(estimate: Estimate, states: Floats) -> Flags:
    """Return whether states, shape (2,) or (B, 2), are in some member of each run."""
    return np.asarray(estimate.polygons.contains(states[..., None, :]).any(axis=-1))


@pytest.mark.parametrize(
    ("wrong", "classes", "runs"),
    [
        (1, 8, 1000),
        (1, 3, 200),
        (2, 5, 200),
        (2, 8, 200),
        (3, 8, 50),
    ],
)
def test_true_state_is_inside_with_at_most_as_many_wrong_measurements_as_assumed(
    wrong: int, classes: int, runs: int
) -> None:
    driven = Driven.of(runs, wrong, seed=wrong + classes)
    observer = vehicle(runs=runs, wrong_measurements=wrong, measurement_classes=classes)
    ordinary = vehicle(runs=runs)
    loses = np.zeros(runs, dtype=bool)

    for k in range(STEPS):
        if k:
            for each in (observer, ordinary):
                each.predict(driven.inputs[k - 1])
        for each in (observer, ordinary):
            each.update(driven.measured[k])
        estimate = observer.estimate()
        state = driven.states[k]
        assert are_inside(estimate, state).all()
        assert ((estimate.lower <= state) & (state <= estimate.upper)).all()
        loses |= ~np.asarray(ordinary.estimate().polygons.contains(state))

    detection = observer.detection
    has_wrong = (driven.wrong >= 0).any(axis=1)
    assert (observer.inconsistency.step == -1).all()
    assert not detection.refuted.all(axis=1).any()
    # Nothing is proved where nothing is wrong, and the ordinary set fails in most other runs.
    assert (detection.step[~has_wrong] == -1).all()
    assert not detection.suspected[~has_wrong].any()
    assert not loses[~has_wrong].any()
    assert loses[has_wrong].mean() > 0.5
    # No wrong measurement is proved before the first one, and one of its classes is suspected.
    proved = np.flatnonzero(detection.step >= 0)
    assert len(proved) > 0.3 * has_wrong.sum()
    for run in proved:
        steps = driven.wrong[run][driven.wrong[run] >= 0]
        assert detection.step[run] >= steps.min()
        assert detection.suspected[run, steps % classes].any()


def test_bounds_are_close_to_those_of_all_hypotheses() -> None:
    """Of all ordinary observers that leave out one measurement: the exact union (Theorem 4
    with as many classes as measurements). 1.01 is the required median.
    """
    runs = 300
    driven = Driven.of(runs, 1, seed=8)
    observer = vehicle(runs=runs, wrong_measurements=1, measurement_classes=8)
    hypotheses = vehicle(runs=STEPS * runs)
    ratios = []
    for k in range(STEPS):
        if k:
            observer.predict(driven.inputs[k - 1])
            hypotheses.predict(np.tile(driven.inputs[k - 1], (STEPS, 1)))
        observer.update(driven.measured[k])
        measured = np.tile(driven.measured[k], (STEPS, 1))
        measured[k * runs : (k + 1) * runs] = np.nan  # hypothesis number k does not use it
        hypotheses.update(measured)

        every = hypotheses.estimate()
        lower = np.nanmin(every.lower.reshape(STEPS, runs, 2), axis=0)
        upper = np.nanmax(every.upper.reshape(STEPS, runs, 2), axis=0)
        estimate = observer.estimate()
        # Rounding of different polygons: a few ulp of coordinates up to 500.
        assert (estimate.lower <= lower + 1e-9).all()
        assert (estimate.upper >= upper - 1e-9).all()
        ratios.append((estimate.upper - estimate.lower) / (upper - lower))
    assert np.median(np.concatenate(ratios), axis=0).max() <= 1.01


def clohessy_wiltshire(**arguments: Any) -> tuple[LinearObserver, Floats, Floats]:
    """Return an observer of motion near a craft on a circular orbit, its A and its generators."""
    rate = 1.1e-3
    step = 30.0
    sine = np.sin(rate * step)
    cosine = np.cos(rate * step)
    a = np.array(
        [
            [4.0 - 3.0 * cosine, 0.0, sine / rate, 2.0 * (1.0 - cosine) / rate],
            [
                6.0 * (sine - rate * step),
                1.0,
                2.0 * (cosine - 1.0) / rate,
                4.0 * sine / rate - 3.0 * step,
            ],
            [3.0 * rate * sine, 0.0, cosine, 2.0 * sine],
            [6.0 * rate * (cosine - 1.0), 0.0, -2.0 * sine, 4.0 * cosine - 3.0],
        ]
    )
    generators = 1e-4 * np.array([[450.0, 0.0, 30.0, 0.0], [0.0, 450.0, 0.0, 30.0]])
    half = np.array([1e3, 1e3, 1.0, 1.0])
    observer = LinearObserver(
        a,
        np.eye(2, 4),
        Zonotope.box(-half, half),
        noise=10.0,
        disturbance=Zonotope(np.zeros(4), generators),
        **arguments,
    )
    return observer, a, generators


@pytest.mark.parametrize(
    ("wrong", "classes", "max_facets"),
    [
        (1, 4, 36),
        (1, 4, 12),
        (2, 4, 36),
    ],
)
def test_relative_motion_with_wrong_measurements_is_inside(
    wrong: int, classes: int, max_facets: int
) -> None:
    observer, a, generators = clohessy_wiltshire(
        wrong_measurements=wrong, measurement_classes=classes, max_facets=max_facets
    )
    ordinary, _, _ = clohessy_wiltshire()
    random = np.random.default_rng(4)
    state = random.uniform(-1.0, 1.0, 4) * [1e3, 1e3, 1.0, 1.0]
    steps = 14
    wrong_steps = (7, 11)[:wrong]
    loses = False
    for k in range(steps):
        if k:
            state = a @ state + random.uniform(-1.0, 1.0, 2) @ generators
            observer.predict()
            ordinary.predict()
        y = state[:2] + random.uniform(-10.0, 10.0, 2)
        if k in wrong_steps:
            y = state[:2] + np.array([80.0, -200.0])
        observer.update(y)
        ordinary.update(y)

        estimate = observer.estimate()
        assert any(polytope.contains(state) for polytope in estimate.polytopes)
        assert ((estimate.lower <= state) & (state <= estimate.upper)).all()
        loses |= not ordinary.estimate().polytopes[0].contains(state)

    assert loses
    assert observer.inconsistency.step == -1
    assert observer.detection.step == 7
    assert observer.detection.suspected[7 % classes]
    assert estimate.reduced


@pytest.mark.parametrize("window", [3, 10])
def test_eight_states_with_a_wrong_measurement_are_inside(window: int) -> None:
    system = WideSystem.chain(8)

    def observer(**arguments: Any) -> LinearObserver:
        return LinearObserver(
            system.a,
            system.c,
            Zonotope.box(-np.ones(8), np.ones(8)),
            noise=system.noise,
            disturbance=Zonotope(np.zeros(8), system.generators),
            window=window,
            **arguments,
        )

    covered = observer(wrong_measurements=1, measurement_classes=3)
    ordinary = observer()
    random = np.random.default_rng(9)
    state = random.uniform(-1.0, 1.0, 8)
    for k in range(12):
        if k:
            state = system.a @ state + random.uniform(-1.0, 1.0, 4) @ system.generators
            covered.predict()
            ordinary.predict()
        y = system.c @ state + random.uniform(-0.2, 0.2, 4)
        if k == 6:
            y[1] += 1.5
        covered.update(y)
        ordinary.update(y)
        if k in (3, 6, 8, 11):
            estimate = covered.estimate()
            assert ((estimate.lower <= state) & (state <= estimate.upper)).all()

    assert ordinary.inconsistency.step == 6
    detection = covered.detection
    assert detection.step == 6
    assert detection.refuted.tolist() == [False, True, True]
    assert detection.suspected.tolist() == [True, False, False]
    assert covered.inconsistency.step == -1


@pytest.mark.parametrize(("wrong", "classes"), [(1, 4), (2, 5)])
def test_member_equals_an_ordinary_observer_without_its_measurements(
    wrong: int, classes: int
) -> None:
    driven = Driven.of(1, 0, seed=3)
    inputs = driven.inputs[:, 0]
    observer = vehicle(wrong_measurements=wrong, measurement_classes=classes)
    estimates = observer.run(driven.measured[:, 0], inputs)
    smoothed = observer.smooth(estimates, inputs)

    members = list(combinations(range(classes), wrong))
    assert estimates[-1].polygons.shape == (comb(classes, wrong),)
    for number, classes_left_out in enumerate(members):
        steps = np.flatnonzero(np.isin(np.arange(STEPS) % classes, classes_left_out))
        alone = vehicle()
        of_alone = alone.run(driven.without(steps)[:, 0], inputs)
        for both in (
            (estimates[-1], of_alone[-1]),
            (smoothed[9], alone.smooth(of_alone, inputs)[9]),
        ):
            polygons = [each.polygons for each in both]
            np.testing.assert_array_equal(polygons[0][number].polygon(), polygons[1].polygon())


@pytest.mark.parametrize("seed", range(5))
def test_smoothed_sets_contain_the_true_states(seed: int) -> None:
    driven = Driven.of(20, 1, seed=50 + seed)
    observer = vehicle(runs=20, wrong_measurements=1)
    estimates = observer.run(driven.measured, driven.inputs)
    for estimate, state in zip(
        observer.smooth(estimates, driven.inputs), driven.states, strict=True
    ):
        assert are_inside(estimate, state).all()


def test_run_of_a_batch_equals_a_single_run() -> None:
    """Each run has its own missing measurements, initial set and inputs."""
    driven = Driven.of(3, 1, seed=6)
    measured = driven.measured.copy()
    measured[4:9, 1] = np.nan
    measured[::3, 2] = np.nan
    starts = ConvexPolygons.from_box(
        [[-10.0, 0.0], [-11.0, -1.0], [-12.0, 0.0]], [[10.0, 20.0], [11.0, 20.0], [10.0, 22.0]]
    )
    disturbance = Zonotope(np.zeros(2), [PUSH])
    arguments: dict[str, Any] = {
        "noise": BOUND,
        "disturbance": disturbance,
        "input_matrix": B,
        "wrong_measurements": 1,
    }
    batch = LinearObserver(A, C, starts, runs=3, **arguments)
    last = batch.run(measured, driven.inputs)[-1]
    for run in range(3):
        single = LinearObserver(A, C, starts[run], **arguments)
        one = single.run(measured[:, run], driven.inputs[:, run])[-1]
        np.testing.assert_array_equal(last.lower[run], one.lower)
        np.testing.assert_array_equal(last.upper[run], one.upper)
        np.testing.assert_array_equal(batch.detection.refuted[run], single.detection.refuted)
        assert last.to_dict()["vertices"][run] == one.to_dict()["vertices"]


def test_missing_measurement_has_no_number() -> None:
    """Told as NaN, as None or not at all, it does not change the classes of the others."""
    given = [vehicle(wrong_measurements=1) for _ in range(3)]
    for k in range(12):
        is_missing = k in (2, 3, 7)
        for observer in given:
            if k:
                observer.predict()
        if is_missing:
            given[0].update([np.nan])
            given[1].update(None)
        else:
            for observer in given:
                observer.update(10.0 + 3.0 * k)
    first, *others = (observer.estimate().to_dict() for observer in given)
    assert all(first == other for other in others)


def test_periodic_measurements_are_in_all_classes() -> None:
    """With every fourth step measured and four classes, no member leaves all of them out."""
    observer = vehicle(wrong_measurements=1, measurement_classes=4)
    for k in range(33):
        if k:
            observer.predict()
        observer.update(0.0 if k % 4 == 0 else None)
    # A member uses one of the last two measurements: 4 steps of at most 20 m/s, and the noise.
    widths = observer.estimate().upper - observer.estimate().lower
    assert widths[0] < 2.0 * BOUND + 8.0 * 0.5 * 20.0


def test_sensors_that_fail_alone_are_measurements_of_their_own() -> None:
    """Two sensors of the position, each measurement in a call; the second one fails once."""

    def observer(wrong: int) -> LinearObserver:
        return LinearObserver(
            A,
            [[1.0, 0.0], [1.0, 0.0]],
            Zonotope.box([-10.0, 0.0], [10.0, 20.0]),
            noise=[BOUND, 1.0],
            wrong_measurements=wrong,
        )

    covered = observer(1)
    ordinary = observer(0)
    state = np.array([3.0, 8.0])
    for k in range(15):
        if k:
            state = A @ state
            covered.predict()
            ordinary.predict()
        second = state[0] + (4.0 if k == 8 else 0.5)
        for each in (covered, ordinary):
            each.update([state[0] - 1.0, None])
            each.update([None, second])
        assert are_inside(covered.estimate(), state)
    assert ordinary.inconsistency.step == 8
    assert covered.detection.step == 8
    assert covered.detection.suspected.tolist() == [number == 17 % 4 for number in range(4)]


def test_more_wrong_measurements_than_assumed_leave_no_state() -> None:
    driven = Driven.of(1, 0, seed=12)
    measured = driven.measured[:, 0].copy()
    measured[14] += 100.0
    measured[21] -= 100.0
    inputs = driven.inputs[:, 0]
    observer = vehicle(wrong_measurements=1, measurement_classes=8)

    estimates = observer.run(measured, inputs)

    assert [bool(estimate.is_empty) for estimate in estimates] == [k >= 21 for k in range(STEPS)]
    last = estimates[-1]
    assert np.isnan(last.lower).all()
    assert "no state is possible" in repr(last)
    assert last.to_dict()["vertices"] == [[]] * 8
    assert last.polygons.is_empty.tolist() == [True] * 8
    detection = observer.detection
    assert detection.step == 14
    assert detection.refuted.all()
    assert not detection.suspected.any()
    where = observer.inconsistency
    assert where.step == 21
    # With the bound of this measurement enlarged by the excess, a state is possible.
    noise = np.full((STEPS, 1), BOUND)
    noise[21] += where.excess + 1e-9
    enlarged = vehicle(wrong_measurements=1, measurement_classes=8, noise=noise)
    assert not enlarged.run(measured[:22], inputs)[-1].is_empty
    noise[21] -= 2e-9
    reduced = vehicle(wrong_measurements=1, measurement_classes=8, noise=noise)
    assert reduced.run(measured[:22], inputs)[-1].is_empty


def test_other_constraints_cut_all_members() -> None:
    observer = vehicle(runs=2, wrong_measurements=1)
    observer.update([[1.0], [2.0]])
    observer.cut([0.0, 1.0], upper=[[5.0], [6.0]])
    assert observer.estimate().upper[:, 1] == pytest.approx([5.0, 6.0])


def test_bounds_of_outputs_are_those_of_all_members() -> None:
    driven = Driven.of(1, 0, seed=20)
    estimate = vehicle(wrong_measurements=1).run(driven.measured[:, 0], driven.inputs[:, 0])[-1]
    matrix = np.array([[1.0, 2.0], [-0.3, 1.0], [0.0, 1.0]])
    lower, upper = estimate.output_hull(matrix)
    values = np.concatenate([polytope.vertices for polytope in estimate.polytopes]) @ matrix.T
    np.testing.assert_allclose(lower, values.min(axis=0), rtol=1e-12)
    np.testing.assert_allclose(upper, values.max(axis=0), rtol=1e-12)


def test_excess_of_the_widths_is_relative_to_the_exact_members() -> None:
    a, c, generators = chain(1, 3)
    random = np.random.default_rng(2)
    measured = random.uniform(-0.1, 0.1, (9, 1))

    def last(max_facets: int | None) -> Estimate:
        observer = LinearObserver(
            a,
            c,
            Zonotope.box(-np.ones(3), np.ones(3)),
            noise=0.2,
            disturbance=Zonotope(np.zeros(3), generators),
            max_facets=max_facets,
            wrong_measurements=1,
        )
        return observer.run(measured)[-1]

    reduced = last(7)
    exact = last(None)
    assert reduced.reduced
    excess = reduced.excess_widths()
    widths = (reduced.upper - reduced.lower) - (exact.upper - exact.lower)
    assert (excess > 0.0).any()
    # Exact members equal linear programs to 1e-9 of the coordinates, which are at most 10.
    np.testing.assert_allclose(excess, widths, rtol=0.0, atol=1e-7)
    assert not exact.excess_widths().any()


def test_picture_has_the_sets_of_all_members_that_are_not_empty() -> None:
    plt = pytest.importorskip("matplotlib.pyplot")
    observer = vehicle(wrong_measurements=1, measurement_classes=5)
    observer.update(0.0)
    observer.predict()
    observer.update(20.0)  # this measurement is wrong, or the first one
    figure, axes = plt.subplots()
    artists = observer.estimate().plot(axes)
    plt.close(figure)
    assert observer.detection.refuted.tolist() == [False, False, True, True, True]
    assert len(artists) == 2


def test_observer_without_wrong_measurements_has_one_set_for_each_run() -> None:
    driven = Driven.of(2, 0, seed=1)
    observer = vehicle(runs=2, wrong_measurements=0)
    estimate = observer.run(driven.measured, driven.inputs)[-1]
    assert estimate.polygons.shape == (2,)
    assert observer.detection.refuted.shape == (2, 1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"wrong_measurements": 4}, "wrong_measurements must be at most 3"),
        ({"measurement_classes": 4}, "measurement_classes belongs to wrong_measurements"),
        (
            {"wrong_measurements": 2, "measurement_classes": 3},
            "measurement_classes must be at least 4",
        ),
        ({"wrong_measurements": 1, "measurement_classes": 65}, "at most 64 sets: 65 classes"),
    ],
)
def test_senseless_numbers_are_refused(arguments: dict[str, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        vehicle(**arguments)


@pytest.mark.parametrize(("wrong", "sets"), [(0, 1), (1, 4), (2, 15), (3, 56)])
def test_number_of_classes_by_default_is_two_more_than_twice_the_wrong_ones(
    wrong: int, sets: int
) -> None:
    assert Cover.of(wrong, None).members == sets
