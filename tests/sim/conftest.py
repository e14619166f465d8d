from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset import AngleSensor, Model, RangeSensor, SetModel, StateBox
from infoset.guidance import Thruster
from infoset.sim import Scenario, Sun
from infoset.sim.scenario import of_model
from tests.sensors import linear


@pytest.fixture(scope="session")
def asteroid() -> Scenario:
    """The paper's engagement without a range sensor."""
    model = SetModel(
        closing_speed_m_s=58e3,
        step_s=0.5,
        bounds=StateBox((-10e3, 10e3), (5301.3e3, 6301.3e3), (-100.0, 100.0), (-59e3, -57e3)),
        angle_sensor=AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3),
        disturbance_m_s2=0.005,
        range_threshold_m=5e3,
        model=Model.PAPER,
    )
    return Scenario(
        name="asteroid",
        sun=Sun(1.324948e20, 150e9, np.pi / 2),
        nominal_range_m=5801.3e3,
        dispersion=StateBox((-1e3, 1e3), (5701.3e3, 5901.3e3), (-100.0, 100.0), (-58.1e3, -57.9e3)),
        **of_model(model),
        thruster=Thruster(1000.0, 0.25, 7.5),
    )


@pytest.fixture(scope="session")
def ranging(asteroid: Scenario) -> Scenario:
    """The same with the range sensor."""
    return replace(asteroid, range_sensor=RangeSensor(2.0, 0.05))


@pytest.fixture(scope="session")
def comet() -> Scenario:
    """Quite another engagement: other speeds, steps, bounds, section count."""
    model = SetModel(
        closing_speed_m_s=20e3,
        step_s=0.4,
        bounds=StateBox((-3e3, 5e3), (1400e3, 1700e3), (-60.0, 40.0), (-20.3e3, -19.7e3)),
        angle_sensor=AngleSensor(0.8, 0.0002, 0.0001, 1550e3),
        disturbance_m_s2=0.02,
        range_threshold_m=2e3,
        sections=17,
        fewest_sections=3,
        model=Model.PAPER,
    )
    return Scenario(
        name="comet",
        sun=Sun(1.324948e20, 60e9, 0.3),
        nominal_range_m=1550e3,
        dispersion=StateBox((-1e3, 2e3), (1500e3, 1600e3), (-30.0, 20.0), (-20.02e3, -19.98e3)),
        **of_model(model),
        range_sensor=RangeSensor(1.2, 0.1),
        thruster=Thruster(600.0, 0.5, 12.0),
    )


@pytest.fixture(scope="session")
def brief(asteroid: Scenario) -> Scenario:
    """The last ten seconds of an approach whose range is known, in few sections: thousands of them
    take a second.
    """
    box = StateBox((-100.0, 100.0), (590e3, 600e3), (-10.0, 10.0), (-58e3, -57.5e3))
    sensor = replace(linear(asteroid.angle_sensor), nominal_range_m=595e3)
    model = replace(
        asteroid.set_model, bounds=box, sections=5, fewest_sections=3, angle_sensor=sensor
    )
    return replace(asteroid, name="brief", **of_model(model), dispersion=box, nominal_range_m=595e3)
