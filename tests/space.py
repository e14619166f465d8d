"""Scenarios in space from planar ones."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from infoset import StateBox
from infoset.sim import Scenario
from infoset.sim.scenario import of_model


def in_space(scenario: Scenario, **sensor: Any) -> Scenario:
    """Return a scenario whose y axis has the bounds of its z axis, with fields of the angle sensor
    replaced.
    """
    model = scenario.set_model
    angle_sensor = replace(model.angle_sensor, **sensor)
    spatial = replace(model, bounds=_both(model.bounds), angle_sensor=angle_sensor)
    return replace(scenario, **of_model(spatial), dispersion=_both(scenario.dispersion))


def _both(box: StateBox) -> StateBox:
    return replace(box, y_m=box.z_m, vy_m_s=box.vz_m_s)
