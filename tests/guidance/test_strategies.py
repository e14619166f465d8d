"""The rules of the strategies, on situations made by hand and in flight."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from guidance import Patient, Situation, Thruster
from guidance.patient import correctable_later_m
from infoset import AngleSensor, ExtremePoints, InformationSet, PredictedMiss, SetModel, StateBox

Floats = NDArray[np.float64]

E = 58e3
THRUSTER = Thruster(budget_m_s=1000.0, least_impulse_m_s=0.25, greatest_impulse_m_s=7.5)
MODEL = SetModel(
    closing_speed_m_s=E,
    step_s=0.5,
    bounds=StateBox((-10e3, 10e3), (5301.3e3, 6301.3e3), (-100.0, 100.0), (-59e3, -57e3)),
    angle_sensor=AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3),
)


def situation(
    lower: float, upper: float, lower_to_go_s: float = 50.0, upper_to_go_s: float = 50.0, budget: float = 1000.0
) -> Situation:
    """One engagement with this predicted-miss interval, reached at ranges that are so many seconds away."""

    def point(to_go_s: float) -> ExtremePoints:
        return ExtremePoints(np.zeros(1), np.zeros(1), np.array([E * to_go_s]))

    return Situation(
        time_s=0.0,
        step=0,
        step_s=0.5,
        predicted_miss=PredictedMiss(
            np.array([True]), np.array([lower]), np.array([upper]), point(lower_to_go_s), point(upper_to_go_s)
        ),
        budget_left_m_s=np.array([budget]),
        thruster=THRUSTER,
        closing_speed_m_s=E,
        measured_angle_rad=None,
        measured_range_m=None,
        last_impulse_m_s=np.zeros(1),
        information=InformationSet(MODEL).view(),
    )


def wanted(now: Situation, share: float = 0.5) -> float:
    return float(Patient(share).decide(now, None)[0])


@pytest.mark.parametrize("budget", [0.0, 7.0, 100.0, 1000.0])
@pytest.mark.parametrize("to_go_s", [0.2, 0.5, 0.7, 3.0, 50.1, 100.0])
def test_what_can_be_corrected_later_is_the_sum_over_the_steps(to_go_s: float, budget: float) -> None:
    """Step by step: mu2 x_j/e as long as the object is ahead and the budget pays."""
    expected, left, ahead = 0.0, budget, to_go_s - 0.5
    while ahead > 1e-9 and left >= 7.5:
        expected, left, ahead = expected + 7.5 * ahead, left - 7.5, ahead - 0.5
    now = situation(-1.0, 1.0, to_go_s, to_go_s, budget)
    assert correctable_later_m(now, np.array([E * to_go_s]))[0] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("lower", "upper", "expected"),
    [
        (-300.0, 200.0, 0.0),  # not even the side is certain
        (100.0, 200.0, 100.0 / 50.0),  # the near end is
        (-200.0, -100.0, -100.0 / 50.0),
        (0.0, 200.0, 0.0),
    ],
)
def test_patient_corrects_only_what_is_certain(lower: float, upper: float, expected: float) -> None:
    assert wanted(situation(lower, upper)) == pytest.approx(expected)


def test_patient_uses_the_range_of_the_end_that_it_corrects() -> None:
    assert wanted(situation(100.0, 200.0, 40.0, 60.0)) == pytest.approx(100.0 / 40.0)
    assert wanted(situation(-200.0, -100.0, 40.0, 60.0)) == pytest.approx(-100.0 / 60.0)


def test_patient_corrects_what_could_not_be_corrected_later() -> None:
    # With 10 s to go the 19 impulses to come can correct 7.5 (9.5 + ... + 0.5) = 712.5 m.
    assert correctable_later_m(situation(0.0, 0.0), np.array([10.0 * E]))[0] == pytest.approx(712.5)
    assert wanted(situation(-100.0, 356.0, 10.0, 10.0)) == 0.0
    assert wanted(situation(-100.0, 356.25 + 30.0, 10.0, 10.0)) == pytest.approx(3.0)
    assert wanted(situation(-356.25 - 30.0, 100.0, 10.0, 10.0)) == pytest.approx(-3.0)
    assert wanted(situation(-100.0, 356.25 + 30.0, 10.0, 10.0), share=0.6) == 0.0
    # What is certain asks for more.
    assert wanted(situation(50.0, 356.25 + 30.0, 10.0, 10.0)) == pytest.approx(5.0)


def test_patient_balances_where_both_ends_are_beyond() -> None:
    assert wanted(situation(-400.0, 440.0, 10.0, 10.0)) == pytest.approx(2.0)
    assert wanted(situation(-400.0, 440.0, 10.0, 10.0), share=0.0) == pytest.approx(2.0)


def test_a_small_budget_makes_patient_act_sooner() -> None:
    assert wanted(situation(-100.0, 300.0, 10.0, 10.0)) == 0.0
    assert wanted(situation(-100.0, 300.0, 10.0, 10.0, budget=20.0)) > 0.0


def test_patient_ends_as_the_symmetric_strategy() -> None:
    assert wanted(situation(-100.0, 120.0, 2.9, 3.1)) == pytest.approx(20.0 / 6.0)
    assert wanted(situation(-6.0, 8.0, 3.1, 3.1)) == 0.0


@pytest.mark.parametrize("share", [-0.1, 1.1, float("nan")])
def test_a_share_is_from_none_to_all(share: float) -> None:
    with pytest.raises(ValueError, match="share must lie from 0 to 1"):
        Patient(share)
