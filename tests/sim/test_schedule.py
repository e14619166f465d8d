"""The images and impulses of a scenario: those that flights have, and where the file asks for other
times.
"""

from __future__ import annotations

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.experiments import load_scenario
from infoset.sim import Scenario, fly_one, simulate
from infoset.sim.scenario import of_model
from infoset.sim.schedule import Difference, image_times_s, schedule

LATE = Path(__file__).parent / "cases" / "late-cut-off.toml"
ARRIVAL_S = 124200123.4598 / 11500.03425967
"""Nominal arrival of the case, s: 0.0214 s before 180 steps of 60 s; flights have 180 steps."""


def changed(scenario: Scenario, images: dict[str, Any], impulses: dict[str, Any]) -> Scenario:
    """Return a scenario with other times of images and impulses."""
    sensor = replace(scenario.bearing_sensor, **images)
    model = replace(scenario.set_model, angle_sensor=sensor)
    return replace(scenario, **of_model(model), thruster=replace(scenario.thruster, **impulses))


def test_the_last_impulse_and_image_are_nearest_to_their_times() -> None:
    found = schedule(load_scenario(LATE))
    assert found is not None
    assert (len(found.images_s), found.images_s[0]) == (180, ARRIVAL_S)
    assert found.images_s[-1] == pytest.approx(ARRIVAL_S / 180)
    assert (len(found.impulses_s), found.impulses_s[0]) == (179, ARRIVAL_S)
    assert found.impulses_s[-1] == pytest.approx(2 * ARRIVAL_S / 180)
    assert found.images_before_last_decision == 179
    assert found.differences == ()


def test_cut_off_is_at_the_step_nearest_to_its_time() -> None:
    """A cut-off at 120 s equals one at 119.98 s: the step is at 119.9998 s.

    A cut-off at the step before leaves a larger miss.
    """
    misses_m = []
    for cut_off_s in (120, 119.97856, 179.97856):
        scenario = load_scenario(LATE, [f"thruster.last_impulse_s={cut_off_s}", "noise=game"])
        misses_m.append(simulate(scenario, 2).guaranteed_miss_m)
    np.testing.assert_array_equal(misses_m[0], misses_m[1])
    assert (misses_m[0] < misses_m[2]).all()


def random_times(draw: random.Random) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return times of images and of impulses of a flight of 10.3 s."""
    last_s = draw.choice((0.0, round(draw.uniform(0.1, 4.0), 2)))
    first_s = draw.choice((None, round(draw.uniform(last_s + 0.1, 12.0), 2)))
    cut_off_s = round(draw.uniform(0.1, 3.0), 2)
    schedules: tuple[dict[str, Any], ...] = (
        {},
        {"last_impulse_s": cut_off_s},
        {"last_impulse_s": cut_off_s, "impulse_period_s": round(draw.uniform(0.5, 2.0), 2)},
        {"impulses_s": (8.1, round(draw.uniform(4.0, 7.0), 2), cut_off_s)},
        {"first_impulse_s": round(draw.uniform(4.0, 9.0), 2), "last_impulse_s": cut_off_s},
    )
    return {
        "first_image_s": first_s,
        "last_image_s": last_s,
        "period_s": draw.choice((0.5, 1.0)),
    }, draw.choice(schedules)


def test_flights_have_the_images_and_impulses_of_the_schedule(brief: Scenario) -> None:
    """In random flights, images and impulses before the nominal arrival are at no other times."""
    draw = random.Random(5)
    given = 0
    for run in range(40):
        scenario = changed(brief, *random_times(draw))
        found = schedule(scenario)
        assert found is not None
        record = fly_one(scenario, run)
        before_s = scenario.nominal_arrival_s - record.time_s
        is_before = before_s > 1e-9
        images_s = before_s[record.measures("angle") & is_before]
        end = min(len(images_s), len(found.images_s))  # the flight may arrive earlier
        np.testing.assert_allclose(images_s[:end], found.images_s[:end], rtol=1e-12)
        assert len(found.images_s) - 2 <= len(images_s) <= len(found.images_s)
        impulses_s = before_s[record.impulse_m_s.any(axis=1) & is_before]
        given += len(impulses_s)
        assert all(np.isclose(time_s, found.impulses_s, rtol=1e-12).any() for time_s in impulses_s)
    assert given > 40


def test_a_period_gives_the_flights_of_the_list_of_its_times(brief: Scenario) -> None:
    times_s = [1.0 + 1.5 * place for place in range(7)]
    listed = changed(brief, {}, {"impulses_s": tuple(times_s[::-1])})
    periodic = changed(brief, {}, {"last_impulse_s": 1.0, "impulse_period_s": 1.5})
    for strategy in ("symmetric-miss", "predictive-kalman"):
        one, other = (simulate(each, 5, strategy=strategy) for each in (listed, periodic))
        assert one.to_dict() == other.to_dict()
        np.testing.assert_array_equal(one.burns_m_s, other.burns_m_s)


def test_times_that_differ_by_more_than_a_tenth_of_a_step_are_differences(brief: Scenario) -> None:
    brief = replace(brief, nominal_range_m=10.0 * brief.closing_speed_m_s)
    arrival_s = brief.nominal_arrival_s  # 10 s, with steps of 0.5 s
    images = {"first_image_s": arrival_s - 2.04, "last_image_s": arrival_s - 8.06}
    impulses = {"impulses_s": (arrival_s - 2.96, arrival_s - 5.24, arrival_s - 9.0)}
    found = schedule(changed(brief, images, impulses))
    assert found is not None
    assert found.differences == (
        Difference("angle_sensor.last_image_s", arrival_s - 8.06, arrival_s - 16 * 0.5),
        Difference("thruster.impulses_s", arrival_s - 5.24, arrival_s - 10 * 0.5),
    )


def test_times_of_a_period_are_differences_if_it_is_not_a_whole_number_of_steps(
    brief: Scenario,
) -> None:
    brief = replace(brief, nominal_range_m=10.0 * brief.closing_speed_m_s)
    arrival_s = brief.nominal_arrival_s
    impulses = {
        "last_impulse_s": arrival_s - 9.0,
        "impulse_period_s": 3.2,
        "first_impulse_s": arrival_s - 2.0,
    }
    found = schedule(changed(brief, {}, impulses))
    assert found is not None
    assert [(each.key, round(arrival_s - each.scheduled_s, 9)) for each in found.differences] == [
        ("thruster.first_impulse_s", 2.5),
        ("thruster.impulse_period_s", 6.0),
        ("thruster.impulse_period_s", 2.5),
    ]


@pytest.mark.parametrize(
    ("arrival_s", "step_s", "asked_s", "scheduled_s"),
    [
        (10799.9786, 60.0, (5400.0, 2100.0, 750.0, 120.0), (5399.989, 2099.996, 779.998, 119.9998)),
        (10790.0, 60.0, (120.0,), (119.889,)),
        (14404.32, 10.0, (150.0, 20.0), (150.045, 20.006)),
        (83883.495, 15.0, (5400.0, 2100.0, 750.0), (5400.225, 2100.0875, 750.03125)),
        (14400.0, 10.0, (150.0,), (150.0,)),
    ],
)
def test_times_are_kept_if_the_arrival_is_no_whole_number_of_steps(
    arrival_s: float, step_s: float, asked_s: tuple[float, ...], scheduled_s: tuple[float, ...]
) -> None:
    dart = load_scenario("dart-2022")
    assert dart.camera is not None
    scenario = replace(
        dart,
        nominal_range_m=arrival_s * dart.closing_speed_m_s,
        step_s=step_s,
        camera=replace(dart.camera, period_s=step_s),
        thruster=replace(dart.thruster, last_impulse_s=None, impulses_s=asked_s),
    )
    found = schedule(scenario)
    assert found is not None
    assert found.impulses_s == pytest.approx(scheduled_s, abs=5e-4)
    assert found.images_s[0] == scenario.nominal_arrival_s


def test_step_is_the_asked_one_without_times_or_with_a_whole_number_of_steps(
    brief: Scenario,
) -> None:
    assert brief.set_model.step_s == 0.5
    cut_off = {"last_impulse_s": 2.0}
    assert changed(brief, {}, cut_off).set_model.step_s == pytest.approx(595e3 / 58e3 / 21)
    whole = replace(brief, nominal_range_m=10.0 * brief.closing_speed_m_s)
    assert changed(whole, {}, cut_off).set_model.step_s == 0.5


def test_scenario_of_its_own_set_model_is_the_same() -> None:
    """Flights have 197 steps until the arrival; ranges are measured every ten."""
    settings = ["step_s=0.5065", "angle_sensor.period_s=0.5065", "range_sensor.period_s=5.065"]
    scenario = load_scenario("own-scenario", [*settings, "thruster.last_impulse_s=15"])
    assert scenario.fitted_step_s == pytest.approx(5801.3 / 58.0 / 197)
    assert replace(scenario, **of_model(scenario.set_model, scenario)) == scenario
    periods_s = {name: sensor.period_s for name, sensor in scenario.sensors.items()}
    step_s = scenario.fitted_step_s
    assert periods_s["range"] == pytest.approx(10.0 * step_s, rel=1e-12)
    assert periods_s["angle"] == scenario.set_model.angle_sensor.period_s == step_s


def test_number_of_steps_is_limited_with_the_step_of_the_flight(brief: Scenario) -> None:
    """100 000 asked steps are enough; steps that fit the nominal arrival are shorter."""
    longest_s = brief.dispersion.x_m[1] / -brief.dispersion.vx_m_s[1]
    asked_s = longest_s / 99_999.8
    assert brief.angle_sensor is not None
    sensor = replace(brief.angle_sensor, period_s=asked_s)
    many = replace(
        brief,
        step_s=asked_s,
        angle_sensor=sensor,
        range_sensor=None,
        nominal_range_m=99_999.6 * asked_s * brief.closing_speed_m_s,
    )
    with pytest.raises(ValueError, match="step_s must be long enough for at most 100000 steps"):
        replace(many, thruster=replace(many.thruster, last_impulse_s=2.0))


def test_impulses_every_asked_step_are_every_step(brief: Scenario) -> None:
    """Flights have 20 steps of 0.5125 s, longer than the period."""
    longer = replace(brief, nominal_range_m=10.25 * brief.closing_speed_m_s)
    scenario = changed(longer, {}, {"last_impulse_s": 1.0, "impulse_period_s": 0.5})
    assert scenario.impulse_steps == [*range(19)]


def test_true_arrivals_are_those_of_the_fastest_and_the_slowest_start() -> None:
    dart = load_scenario("dart-2022")
    found = schedule(dart)
    assert found is not None
    box = dart.dispersion
    assert found.true_arrivals_s == pytest.approx(
        (box.x_m[0] / -box.vx_m_s[0] - 14400.0, box.x_m[1] / -box.vx_m_s[1] - 14400.0)
    )


def test_step_at_the_arrival_is_not_in_the_schedule(brief: Scenario) -> None:
    whole = replace(brief, nominal_range_m=10.0 * brief.closing_speed_m_s)
    found = schedule(whole)
    assert found is not None
    assert len(found.images_s) == len(found.impulses_s) == 20
    assert found.images_before_last_decision == len(image_times_s(whole))


def test_schedule_is_none_if_the_arrival_is_after_the_maximum_number_of_steps(
    brief: Scenario,
) -> None:
    assert schedule(replace(brief, nominal_range_m=1e12)) is None
