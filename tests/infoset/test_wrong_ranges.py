"""Limits of the labels by measured ranges of which some may be wrong."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from infoset import InformationSet, SetModel, StateBox
from tests.infoset.test_information_set import SENSOR, STEP, E

ERROR = 0.05
X = 5801.3e3
KNOWN = StateBox((-10e3, 10e3), (5301.3e3, 6301.3e3), (-100.0, 100.0), (-59e3, -57e3))
MODEL = SetModel(E, STEP, KNOWN, SENSOR, disturbance_m_s2=0.005, sections=9)


def limits_of(ranges: list[float], wrong: int) -> tuple[float, float]:
    """Limits of the labels after ranges, one in each step."""
    information = InformationSet(MODEL)
    for range_m in ranges:
        information.measure_range(range_m, ERROR, wrong_measurements=wrong)
        information.predict()
    state = information._state
    return float(state.lower_label[0]), float(state.upper_label[0])


@pytest.mark.parametrize("wrong", [0, 1, 2, 3])
@pytest.mark.parametrize("seed", range(4))
def test_limits_are_the_union_over_all_choices_of_wrong_ranges(wrong: int, seed: int) -> None:
    # The label is feasible if it agrees with all ranges but at most `wrong` of them.
    random = np.random.default_rng(seed)
    count = 6
    ranges = [X - E * STEP * step for step in range(count)]
    ranges = [range_m * (1.0 + ERROR * random.uniform(-1.0, 1.0)) for range_m in ranges]
    for step in random.permutation(count)[:wrong]:
        ranges[step] *= float(random.choice([0.2, 0.93, 1.07, 3.0]))

    # (4) of docs/guarantee.md without the cosine, which is at most 1e-5 from 1 here.
    eta = MODEL.speed_error
    single = []
    for step, range_m in enumerate(ranges):
        travelled = E * STEP * step
        lower = range_m / ((1.0 + ERROR) * (1.0 + eta)) + travelled
        upper = range_m / ((1.0 - ERROR) * (1.0 - eta)) + travelled
        single.append((lower, upper))

    minimum, maximum = MODEL.label_limits_m
    lowest = np.inf
    highest = -np.inf
    for right in combinations(range(count), count - wrong):
        lowest = min(lowest, max(minimum, *(single[step][0] for step in right)))
        highest = max(highest, min(maximum, *(single[step][1] for step in right)))
    lower, upper = limits_of(ranges, wrong)
    assert lower == pytest.approx(lowest, rel=1e-5)
    assert upper == pytest.approx(highest, rel=1e-12)


def test_engagements_that_do_not_measure_keep_their_limits() -> None:
    information = InformationSet(MODEL, 2)
    for _ in range(3):
        information.measure_range(5.5e6, 0.01, [True, False], wrong_measurements=1)
    state = information._state
    assert state.lower_label[0] > state.lower_label[1]
    assert (state.lower_label[1], state.upper_label[1]) == MODEL.label_limits_m


def test_as_many_ranges_as_may_be_wrong_say_nothing() -> None:
    assert limits_of([5.5e6, 5.5e6], 2) == MODEL.label_limits_m
    assert limits_of([5.5e6, 5.5e6, 5.5e6], 2)[1] < MODEL.label_limits_m[1]


def test_discarded_range_does_not_count_later() -> None:
    exact = replace(MODEL, bounds=replace(KNOWN, x_m=(X, X), vx_m_s=(-E, -E)))
    information = InformationSet(exact)
    for _ in range(2):
        information.measure_range(2.0 * X, 0.01, wrong_measurements=1)
    assert information.inconsistent.all()
    assert information.tracking.all()

    information.measure_range(X, 0.01, wrong_measurements=1)
    assert information.tracking.all()
    assert information.section_counts[0] > 0
