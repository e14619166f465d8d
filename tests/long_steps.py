"""Scenarios with fewer steps, for claims that hold for steps of any length."""

from __future__ import annotations

from dataclasses import replace

from infoset.sim import Scenario
from infoset.sim.scenario import of_model


def with_long_steps(scenario: Scenario, times: int = 2) -> Scenario:
    """Return a scenario whose steps, and the periods of its angle sensor, are a few times as
    long.
    """
    model = scenario.set_model
    sensor = scenario.set_model.angle_sensor
    sensor = replace(sensor, period_s=times * sensor.period_s)
    return replace(
        scenario, **of_model(replace(model, step_s=times * model.step_s, angle_sensor=sensor))
    )
