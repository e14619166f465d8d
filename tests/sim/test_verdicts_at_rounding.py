"""Verdicts that rounding must not decide: exactly known parts, few feasible labels, a guaranteed
miss of zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset import (
    AngleSensor,
    InformationSetView,
    InitialSet,
    Model,
    RateSensor,
    Recovery,
    StateBox,
)
from infoset.arrays import Floats
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import LineOfSight, NoiseKind, Situation
from infoset.sim import Outcome, Results, Scenario, simulate
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.scenario import of_model

CASES = Path(__file__).parent / "cases"
ULP = 2.0**-52
LAST_ANGLE_AT, LABEL_M = 26, 5095928.0671172105
"""Step of the last angle of `narrow-labels`, and the label of its truth."""


# A truth on the boundary of a section that is thinner than rounding
# --------------------------------------------------


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
@pytest.mark.parametrize("has_range_sensor", [False, True])
def test_rounding_does_not_move_a_truth_with_exactly_known_z_outside(
    noise: NoiseKind, has_range_sensor: bool
) -> None:
    """With a rate sensor and gravity: formerly 68 of 200 true states were outside, by 4e-16 m."""
    scenario = replace(load_scenario(CASES / "exactly-known-offset.toml"), noise=noise)
    sensor = scenario.range_sensor if has_range_sensor else None
    results = simulate(replace(scenario, range_sensor=sensor), 50)
    assert results.truth_kept.all()
    assert results.phi_held.all()


def displaced(scenario: Scenario, z_m: float) -> Results:
    """Simulate one engagement with a given true z at the start, which may be outside the box of the
    set.
    """
    known = draw(scenario, [0], 0)
    flight = Engagements(
        scenario, replace(known, position_m=np.array([[z_m, known.position_m[0, 1]]]))
    )
    while flight.flying:
        flight.advance()
    return flight.results(np.array([0]))


@pytest.mark.parametrize(("disturbance_m_s2", "max_m"), [(0.007, 4e-15), (30.0, 2e-11)])
def test_a_truth_outside_by_a_hundred_allowances_is_reported(
    disturbance_m_s2: float, max_m: float
) -> None:
    """The allowance is 4 ulp of the terms of z. For z = 0 they are the maximum V times the time to
    go.
    """
    scenario = load_scenario(CASES / "exactly-known-offset.toml")
    model = replace(scenario.set_model, disturbance_m_s2=disturbance_m_s2)
    scenario = replace(scenario, **of_model(model), sun=None)
    # At t = 0 the set contains the first half of a step's disturbance.
    to_go_s = scenario.nominal_range_m / model.closing_speed_m_s
    v_m_s = 0.5 * disturbance_m_s2 * model.step_s
    allowance_m = 4 * ULP * to_go_s * v_m_s
    assert 0.5 * max_m < allowance_m < max_m
    assert displaced(scenario, 0.0).truth_kept.all()
    for side in (-1.0, 1.0):
        assert not displaced(scenario, side * 100.0 * allowance_m).truth_kept.any()


# Feasible labels in a very short interval
# --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Stored:
    """An engagement with stored measured angles and impulses; the errors are less by a share."""

    arrays: dict[str, Any]
    delay_steps: int
    share: float

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> dict[str, Floats]:
        true = sight.sensors["angle"].true_value(sight)
        measured = self.arrays["angle"][self.arrays["steps"] == sight.step].reshape(true.shape)
        return {"angle": true + (measured - true) * (1.0 - self.share)}

    def start(self, shape: tuple[int, int]) -> None:
        return None

    def decide(self, situation: Situation, state: None) -> Floats:
        impulses = self.arrays["imp"]
        return np.array([[impulses[min(situation.step + self.delay_steps, impulses.size - 1)]]])


def narrow_labels(share: float) -> Engagements:
    """Errors of 1e-12 rad, almost at their bounds.

    At the end, labels are feasible within 150 ulp around the label of the truth.
    """
    scenario = load_scenario(CASES / "narrow-labels.toml")
    scenario = replace(scenario, **of_model(replace(scenario.set_model, recovery=Recovery.NONE)))
    with np.load(CASES / "narrow-labels.npz") as arrays:
        stored = Stored(dict(arrays), scenario.thruster.delay_steps, share)
    position_m = stored.arrays["position"]
    velocity_m_s = stored.arrays["velocity"]
    known = replace(
        draw(scenario, [0], 0), position_m=position_m, velocity_m_s=velocity_m_s, images=None
    )
    given = stored.arrays["acc"].reshape(1, 1, -1)
    target = np.pad(given, ((0, 0), (0, 0), (0, max(0, known.steps - given.shape[-1]))))
    return Engagements(scenario, known, strategy=stored, noise=stored, target_m_s2=target)


@pytest.mark.parametrize("share", [3e-8, 1e-7, 1e-6, 1e-4])
def test_a_set_with_few_feasible_labels_does_not_become_empty(share: float) -> None:
    flight = narrow_labels(share)
    while flight.flying:
        flight.advance()
    results = flight.results(np.array([0]))
    assert results.outcomes == (Outcome.ARRIVED,)
    assert not results.set_emptied.any()
    assert results.truth_kept.all()
    assert results.phi_held.all()
    assert not results.phi_held.mask.any()


def test_labels_are_found_down_to_the_stated_width() -> None:
    """The last angle is moved step by step until no label is feasible; replays of all floats show
    the interval.
    """
    flight = narrow_labels(3e-8)
    while flight.step < LAST_ANGLE_AT:
        flight.advance()
    with np.load(CASES / "narrow-labels.npz") as arrays:
        last_rad = float(arrays["angle"][-1])
    labels = LABEL_M + np.spacing(LABEL_M) * np.arange(-300, 301)
    widths = []
    for moved_rad in np.linspace(0.0, 2e-16, 41).tolist():
        after = flight._information.copy()
        after.measure_angle(last_rad + moved_rad)
        feasible = labels[
            [not after.section_at(label).polygons[0].is_empty for label in labels.tolist()]
        ]
        width = np.ptp(feasible) / LABEL_M if feasible.size else 0.0
        if width > 1e-15 or feasible.size == 0:
            assert after.feasible.any() == (feasible.size > 0)
        widths.append(width)
    assert min(widths) == 0.0
    assert sum(1e-15 < width < 3e-14 for width in widths) > 20


# A guaranteed miss of zero
# --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("rate_sensor", [None, RateSensor(1.0, 1e-9)])
def test_a_guaranteed_miss_of_zero_allows_for_the_rounding_of_the_miss(
    asteroid: Scenario, rate_sensor: RateSensor | None
) -> None:
    """A target straight ahead in free space, at rest across the line: the miss is the rounding
    error of x.
    """
    misses_m = []
    ranges_m = np.geomspace(3e3, 9e7, 12)
    for range_m in ranges_m.tolist():
        speed_m_s = range_m / 77.7
        known = StateBox(
            (0.0, 0.0), (range_m, range_m), (0.0, 0.0), (-1.01 * speed_m_s, -0.99 * speed_m_s)
        )
        model = replace(
            asteroid.set_model,
            model=Model.GUARANTEED,
            closing_speed_m_s=speed_m_s,
            bounds=known,
            initial_set=InitialSet.BOX,
            disturbance_m_s2=0.0,
            range_threshold_m=0.01 * range_m,
            angle_sensor=AngleSensor(1.0, 1e-5, 1e-5, range_m),
            step_s=1.0,
        )
        scenario = replace(
            asteroid,
            sun=None,
            nominal_range_m=range_m,
            dispersion=known,
            **of_model(model),
            rate_sensor=rate_sensor,
        )
        results = simulate(scenario, 10)
        assert results.truth_kept.all()
        assert results.phi_held.all()
        assert not results.phi_held.mask.any()
        assert (results.guaranteed_miss_m < 1e-14 * range_m).all()
        misses_m.append(results.miss_m.max())
    assert max(misses_m) > 0.0
