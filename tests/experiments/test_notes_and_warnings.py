"""Messages, notes and warnings that keep an analyst from a wrong conclusion."""

from __future__ import annotations

from dataclasses import replace

import pytest

from experiments import load_scenario
from experiments.interception.scenario_file import scenario_warnings
from guidance import Thruster
from sim.closed_form import possible_miss_of
from sim.scenario import of_model
from sim.schedule import image_times_s
from tests.experiments.command_line import Command


@pytest.mark.parametrize(
    ("thruster", "message"),
    [
        ({"last_impulse_s": 50.0, "delay_steps": 6}, "excludes all impulses: .* 40 s before the nominal arrival"),
        ({"last_impulse_s": 50.0, "impulses_s": (30.0, 20.0)}, "excludes all impulses"),
        ({"last_impulse_s": 500.0}, "excludes all impulses"),
        ({"impulses_s": (90.0,), "delay_steps": 2}, "give later times or fewer delay_steps: got 90.0"),
    ],
)
def test_a_schedule_without_impulses_names_the_key_to_change(thruster: dict[str, object], message: str) -> None:
    engine = Thruster(10.0, 0.0, 1.0, **thruster)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=message):
        engine.impulse_steps(100.0, 10.0)


def test_an_image_window_between_two_images_has_the_nearest_two() -> None:
    scenario = load_scenario("dart-2022", ["camera.first_image_s=308", "camera.last_image_s=302"])
    assert image_times_s(scenario) == [310.0, 300.0]
    assert not scenario_warnings(scenario)


def test_images_before_the_start_have_a_warning() -> None:
    scenario = load_scenario("dart-2022", ["camera.first_image_s=20000", "camera.last_image_s=14406"])
    assert image_times_s(scenario) == []
    (line,) = scenario_warnings(scenario)
    assert "no impulse follows a measurement: images are taken from 20000 s to 14406 s before" in line


def test_a_nominal_arrival_that_is_far_too_late_is_checked_at_once() -> None:
    """Its steps are not searched: in floating point the time before the arrival does not change with the step."""
    scenario = load_scenario("dart-2022", ["nominal_range_m=1e50"])
    assert "nominal_range_m is 1e+50 m, far outside uncertainty.x_m" in scenario_warnings(scenario)[-1]


def test_the_closed_form_is_not_that_of_a_camera_that_loses_images() -> None:
    scenario = load_scenario("dart-2022")
    lossy = replace(scenario.set_model.angle_sensor, miss_probability=0.5)
    with pytest.raises(ValueError, match="loses no image"):
        possible_miss_of(replace(scenario, **of_model(replace(scenario.set_model, angle_sensor=lossy))))


LONG_STEPS = ("--set", "step_s=30", "--set", "camera.period_s=30")
"""A third of the steps of haiv-2013."""


@pytest.mark.usefixtures("unrendered")
def test_a_sweep_names_keys_without_an_effect_and_its_adversary(infoset: Command) -> None:
    pytest.importorskip("pyarrow")
    arguments = ["sweep", "haiv-2013", "--set", "thruster.impulses_s=[5400, 180]", "--noise", "game", "--runs", "6"]
    arguments += ["--vary", "thruster.last_impulse_s=10:100:2", "--require", "miss_m p50<500", "--out", "out"]
    _, out, _ = infoset(*arguments, *LONG_STEPS)
    assert "thruster.last_impulse_s has no effect: cells that differ only in it have the same results" in out
    assert "miss_m p50<500 is met against this adversary in " in out
    assert "game noise (tie rule upper) is one adversary, not the worst case: infoset bound" in out
    assert "one model of many" not in out
    notes = infoset.json("report", "out")["notes"]
    assert len(notes) == 2
    _, out, _ = infoset("report", "out", "--require", "impulse_m_s p50<100")
    assert "is met in " in out
