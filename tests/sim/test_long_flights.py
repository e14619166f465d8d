"""Flights of thousands of steps: substeps of gravity, memory, and the cost of a step."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest
from numpy.typing import NDArray

from infoset import AngleSensor, InitialSet, Model, StateBox
from infoset.section_life import IMPULSE
from sim import Scenario, simulate
from sim.draws import Draws, draw
from sim.engagement import Engagements
from sim.kepler import LONGEST_SUBSTEP_S, KeplerMotion, longest_substep_s

Floats = NDArray[np.float64]


@pytest.mark.parametrize(("flight_s", "speed_m_s"), [(14_400.0, 6.14e3), (86_400.0, 10.3e3), (86_400.0, 1e3)])
def test_substeps_of_a_long_flight_are_exact_to_a_millimetre(
    asteroid: Scenario, flight_s: float, speed_m_s: float
) -> None:
    """Substeps of seconds instead of half a second, against eight times as many."""
    range_m = flight_s * speed_m_s
    box = StateBox((-1e4, 1e4), (0.99 * range_m, range_m), (-100.0, 100.0), (-1.001 * speed_m_s, -speed_m_s))
    sensor = AngleSensor(60.0, 1e-5, 1e-5, range_m)
    model = replace(asteroid.set_model, closing_speed_m_s=speed_m_s, bounds=box, step_s=60.0, angle_sensor=sensor)
    scenario = replace(asteroid, nominal_range_m=range_m, set_model=model, dispersion=box)
    substep_s = longest_substep_s(scenario)
    assert 2.0 < substep_s < 60.0

    def end_m(length_s: float) -> Floats:
        position_m, velocity_m_s = np.array([[1e4, range_m]]), np.array([[-100.0, -speed_m_s]])
        motion = KeplerMotion(position_m, velocity_m_s, scenario.sun, length_s)
        for _ in range(int(0.99 * flight_s / 600.0)):
            motion.advance(600.0)
        return np.asarray(motion.position_m[0])

    error_m = np.abs(end_m(substep_s) - end_m(substep_s / 8.0)).max()
    assert 5e-5 < error_m < 1e-3


def test_substeps_of_the_built_in_scenarios_are_their_steps(asteroid: Scenario) -> None:
    assert longest_substep_s(asteroid) > asteroid.set_model.step_s == LONGEST_SUBSTEP_S
    assert longest_substep_s(replace(asteroid, sun=None)) == LONGEST_SUBSTEP_S


def test_the_history_of_a_long_flight_has_two_events_a_step(asteroid: Scenario) -> None:
    """An impulse is an event only where it is given; sections stay small, and the guarantee holds."""
    model = replace(
        asteroid.set_model,
        step_s=0.05,
        angle_sensor=replace(asteroid.set_model.angle_sensor, period_s=0.05),
        kind=Model.GUARANTEED,
        initial_set=InitialSet.BOX,
        sections=5,
    )
    thruster = replace(asteroid.thruster, impulses_s=(60.0, 20.0, 5.0))
    scenario = replace(asteroid, set_model=model, thruster=thruster)
    flight = Engagements(scenario, draw(scenario, range(2), 1))
    while flight.flying:
        flight.advance()
    history = flight._information._state.history
    impulses = int(np.count_nonzero(history.kinds[: history.events] == IMPULSE))
    assert 1 <= impulses <= 3
    assert history.elapsed > 1900
    assert history.events <= 2 * history.elapsed + impulses
    np.testing.assert_allclose(history.total_impulse(), flight.results(np.arange(2)).impulse_m_s)
    results = flight.results(np.arange(2))
    assert results.truth_kept.all()
    assert results.phi_held.all()


def test_a_batch_of_long_flights_is_smaller(asteroid: Scenario, monkeypatch: pytest.MonkeyPatch) -> None:
    """The results do not depend on it."""
    whole = simulate(asteroid, 5, guarantee=False)
    batches: list[int] = []

    def counted(scenario: Scenario, runs: list[int], seed: int) -> Draws:
        batches.append(len(runs))
        return draw(scenario, runs, seed)

    module = import_module("sim.simulate")
    monkeypatch.setattr(module, "draw", counted)
    monkeypatch.setattr(module, "STEPS_AT_ONCE", 500)
    assert simulate(asteroid, 5, guarantee=False).miss_m.tolist() == whole.miss_m.tolist()
    assert batches == [2, 2, 1]
