"""The lower bound if images may be wrong: Theorem 5b of docs/guarantee-bound.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import linprog

from infoset import AngleSensor, BearingSensor, Camera, Model, SetModel, StateBox
from infoset.arrays import Floats
from infoset.experiments import load_scenario
from infoset.guidance import Thruster
from infoset.sim import Scenario, possible_miss_of
from infoset.sim.bound.difference_sets import MARGIN, POSITION
from infoset.sim.bound.lower_bound import lower_bound, pair_at
from infoset.sim.bound.pair_flight import PairFlight, fly_pair
from infoset.sim.bound.pair_of_motions import PairApproach, TruthPair
from infoset.sim.closed_form import possible_miss
from infoset.sim.scenario import of_model
from tests.sim.bound.test_lower_bound import toy

SPEED_M_S = 1000.0
RANGE_M = 10e3
LAST_IMAGE_S = 1.0
DECISION_STEP = 9
"""Step of the last image."""
CAMERA = Camera(1.0, 1e-6, 2e-3)
FALLING = AngleSensor(1.0, 1e-6, 2e-6, RANGE_M)
RISING = AngleSensor(1.0, 10e-6, 1e-9, RANGE_M)


def one_impulse(
    sensor: BearingSensor, *, wrong_images: int = 1, disturbance_m_s2: float = 0.0
) -> Scenario:
    """Ten images in the ten seconds before the arrival, and one impulse at the last of them.

    Range and speed are known, and velocities across x are so small that the line of sight has no
    slope.
    """
    model = SetModel(
        closing_speed_m_s=SPEED_M_S,
        step_s=1.0,
        bounds=StateBox((-1.0, 1.0), (RANGE_M, RANGE_M), (-0.1, 0.1), (-SPEED_M_S, -SPEED_M_S)),
        angle_sensor=sensor,
        disturbance_m_s2=disturbance_m_s2,
        range_threshold_m=0.02,
        model=Model.GUARANTEED,
        wrong_images=wrong_images,
    )
    return Scenario(
        name="one impulse",
        nominal_range_m=RANGE_M,
        dispersion=model.bounds,
        **of_model(model),
        thruster=Thruster(0.01, 0.0, 0.01, impulses_s=(LAST_IMAGE_S,)),
    )


def of_wrong_images(name: str, wrong_images: int) -> Scenario:
    scenario = load_scenario(name)
    settings = replace(
        scenario.information_set,
        model=Model.GUARANTEED,
        initial_set=None,
        wrong_images=wrong_images,
    )
    return replace(scenario, information_set=settings)


def pair_of(scenario: Scenario) -> TruthPair:
    return pair_at(scenario, RANGE_M, -SPEED_M_S, last_common_step=DECISION_STEP)


def half_distance_m(scenario: Scenario, left_out: Sequence[int]) -> float:
    """Half of the maximum distance at the arrival without the limits of some images."""
    approach = PairApproach(scenario, RANGE_M, -SPEED_M_S)
    (differences,) = approach._differences
    limits_m = differences.limits_m.copy()
    limits_m[list(left_out), POSITION] = np.inf
    member = differences.member(limits_m, DECISION_STEP + 1)
    difference_m = approach.motion.difference(
        np.array([member.offset_m]),
        np.array([member.velocity_m_s]),
        member.acceleration_m_s2[None],
    )
    return 0.5 * abs(float(difference_m[0, -1]))


@pytest.mark.parametrize("wrong_images", [1, 2])
@pytest.mark.parametrize("disturbance_m_s2", [0.0, 2e-4])
@pytest.mark.parametrize("sensor", [CAMERA, FALLING, RISING])
def test_no_other_choice_of_images_gives_a_greater_distance(
    sensor: BearingSensor, disturbance_m_s2: float, wrong_images: int
) -> None:
    scenario = one_impulse(sensor, wrong_images=wrong_images, disturbance_m_s2=disturbance_m_s2)
    choices = combinations(range(DECISION_STEP + 1), 2 * wrong_images)
    expected_m = max(half_distance_m(scenario, choice) for choice in choices)

    pair = pair_of(scenario)

    wrong_steps = np.sort(np.concatenate(pair.wrong_steps))
    assert wrong_steps.tolist() == [*range(DECISION_STEP + 1)][-2 * wrong_images :]
    # Lemma 20 reduces the distance by its margin at most: there is no slope.
    assert 0.5 * pair.apart_m == pytest.approx(expected_m, rel=2.0 * MARGIN)


def exact_miss_m(scenario: Scenario) -> float:
    """Greatest miss that the images leave possible, by a linear program for each choice of images.

    Variables: the difference at the arrival and its change over the whole flight.
    """
    model = scenario.set_model
    times_s = np.arange(RANGE_M / SPEED_M_S, LAST_IMAGE_S - 0.5, -1.0)
    ranges_m = SPEED_M_S * times_s
    limits_m = ranges_m * model.angle_sensor.error_bound(ranges_m)
    greatest_m = 0.0
    for kept in combinations(range(len(times_s)), len(times_s) - 2 * model.wrong_images):
        chosen = list(kept)
        rows = np.column_stack([np.ones(len(chosen)), times_s[chosen] / times_s[0]])
        rows /= limits_m[chosen, None]
        solved = linprog(
            [-1.0, 0.0],
            A_ub=np.concatenate([rows, -rows]),
            b_ub=np.ones(2 * len(chosen)),
            bounds=(None, None),
        )
        assert solved.status == 0
        greatest_m = max(greatest_m, float(-solved.fun))
    return greatest_m


@pytest.mark.parametrize("wrong_images", [0, 1, 2])
def test_closed_form_equals_an_exhaustive_search_and_the_pair(wrong_images: int) -> None:
    scenario = one_impulse(CAMERA, wrong_images=wrong_images)

    found_m = possible_miss_of(scenario)

    # The solver's own tolerance is 1e-7.
    assert found_m == pytest.approx(exact_miss_m(scenario), rel=1e-6)
    assert found_m == pytest.approx(0.5 * pair_of(scenario).apart_m, rel=2.0 * MARGIN)


def test_closed_form_of_the_ends_is_not_used_if_the_bound_rises_with_the_range() -> None:
    """A line through both ends of the arc violates a convex limit between them."""
    scenario = one_impulse(RISING)
    exact_m = exact_miss_m(scenario)

    found = possible_miss(scenario)

    assert found is not None
    assert found.images_m is None
    assert found.images_and_speeds_m == pytest.approx(exact_m, rel=1e-6)
    first_m, last_m = (
        time_s * SPEED_M_S * RISING.error_bound(time_s * SPEED_M_S) for time_s in (10.0, 3.0)
    )
    of_ends_m = last_m + (first_m + last_m) * 3.0 / (10.0 - 3.0)
    assert of_ends_m > 1.05 * exact_m


def test_closed_form_needs_two_images_that_are_not_left_out() -> None:
    late = Camera(1.0, 1e-6, 2e-3, first_image_s=7.0)
    scenario = one_impulse(late, wrong_images=3)

    with pytest.raises(ValueError, match="at least 8 images"):
        possible_miss_of(scenario)
    assert possible_miss(scenario) is None


@pytest.mark.parametrize(
    ("name", "wrong_images", "expected_m"),
    [
        ("asteroid-1997", 1, 48.53),
        ("asteroid-1997", 2, 73.10),
        pytest.param("asteroid-1997", 3, 98.14, marks=pytest.mark.thorough),
        ("dart-2022", 1, 41.26),
        pytest.param("dart-2022", 2, 44.68, marks=pytest.mark.thorough),
        ("haiv-2013", 1, 42.84),
        pytest.param("haiv-2013", 2, 46.44, marks=pytest.mark.thorough),
    ],
)
def test_bound_with_wrong_images_equals_that_of_another_program(
    name: str, wrong_images: int, expected_m: float
) -> None:
    """A program of linear programs found the expected bounds at one label.

    It reduced the whole difference where this one narrows limits, so its bounds can be less by
    0.01 m.
    """
    bound_m = lower_bound(of_wrong_images(name, wrong_images)).bound_m

    assert expected_m - 0.005 <= bound_m <= expected_m + 0.01


def checked_flight(scenario: Scenario, pair: TruthPair, strategy: str) -> PairFlight:
    flight = fly_pair(replace(scenario, strategy=strategy), pair)
    common = flight.impulse_m_s[: pair.last_common_step + 1]
    assert (common[..., 0] == common[..., 1]).all()
    assert flight.max_error_share <= 1.0
    assert flight.results.miss_m.max() >= pair.bound_m
    assert flight.results.truth_kept.all()
    assert flight.results.phi_held.all()
    return flight


@pytest.mark.parametrize("strategy", ["symmetric-miss", "least-effort"])
@pytest.mark.parametrize("wrong_images", [1, 2])
def test_each_motion_of_a_simulated_pair_has_q_wrong_images(
    wrong_images: int, strategy: str
) -> None:
    scenario = of_wrong_images("asteroid-1997", wrong_images)
    pair = pair_at(scenario, 5309.9e3, -59e3)

    flight = checked_flight(scenario, pair, strategy)

    beyond = flight.wrong_errors > 1.0
    assert beyond.sum(axis=0).tolist() == [wrong_images, wrong_images]
    # An image is exact in the motion in which it is not wrong.
    assert (flight.wrong_errors[~beyond] == 0.0).all()


@pytest.mark.thorough
@pytest.mark.parametrize("name", ["dart-2022", "haiv-2013", "asteroid-1997-space"])
def test_simulated_pairs_of_other_scenarios_miss_by_the_bound(name: str) -> None:
    scenario = of_wrong_images(name, 1)
    pair = lower_bound(scenario).pair

    flight = checked_flight(scenario, pair, "symmetric-miss")

    assert (flight.wrong_errors > 1.0).sum(axis=0).tolist() == [1, 1]


def test_pair_whose_images_can_all_be_wrong_has_any_starts() -> None:
    """Both images of this flight can be wrong: the starts differ by the whole box."""
    scenario = replace(toy(z_m=10.0, vz_m_s=1.0), thruster=Thruster(1e-3, 0.0, 1e-3))
    model = replace(scenario.set_model, model=Model.GUARANTEED, wrong_images=1)

    pair = pair_at(replace(scenario, **of_model(model)), 2000.0, -1000.0, last_common_step=1)

    assert [steps.tolist() for steps in pair.wrong_steps] == [[1], [0]]
    # Two seconds at 1 m/s from 10 m; the margin is a share of the measurements.
    assert 0.5 * pair.apart_m == pytest.approx(12.0, rel=2.0 * MARGIN)


def test_bound_does_not_fall_with_the_number_of_wrong_images() -> None:
    bounds: Floats = np.array(
        [pair_at(of_wrong_images("asteroid-1997", q), 5801.3e3, -58e3).bound_m for q in range(4)]
    )

    assert (np.diff(bounds) > 0.0).all()
