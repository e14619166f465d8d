"""Flights of thousands of steps: substeps of gravity, memory, and the cost of a step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from infoset import InformationSet, InitialSet, Model
from infoset.engine import guaranteed_miss
from infoset.engine.history import IMPULSE
from infoset.sim import Scenario, simulate
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.scenario import of_model


def of_2000_steps(asteroid: Scenario) -> Scenario:
    """Return the scenario with steps of 0.05 s, three impulses and the guaranteed model."""
    model = replace(
        asteroid.set_model,
        step_s=0.05,
        angle_sensor=replace(asteroid.set_model.angle_sensor, period_s=0.05),
        model=Model.GUARANTEED,
        initial_set=InitialSet.BOX,
        sections=5,
    )
    return replace(
        asteroid,
        **of_model(model),
        thruster=replace(asteroid.thruster, impulses_s=(60.0, 20.0, 5.0)),
    )


def test_the_history_of_a_long_flight_has_two_events_a_step(asteroid: Scenario) -> None:
    """An impulse is an event only where it is given; sections stay small, and the guarantee
    holds.
    """
    scenario = of_2000_steps(asteroid)
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


@pytest.mark.thorough
def test_labels_of_a_long_flight_leave_in_groups(
    asteroid: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The number of replays does not grow with the number of steps. Phi holds, and depends little
    on the groups.
    """
    scenario = of_2000_steps(asteroid)
    windows: list[int] = []
    whole = guaranteed_miss.bound_all

    def counted(leaving: guaranteed_miss.Leaving, *arguments: Any) -> None:
        windows.append(len(leaving.events))
        whole(leaving, *arguments)

    monkeypatch.setattr(guaranteed_miss, "bound_all", counted)
    single = simulate(scenario, 3)
    monkeypatch.setattr(guaranteed_miss, "GROUPS", 400)
    grouped = simulate(scenario, 3)
    assert windows[0] >= 4 * windows[1]
    assert grouped.miss_m.tolist() == single.miss_m.tolist()
    assert grouped.truth_kept.all()
    assert grouped.phi_held.all()
    np.testing.assert_allclose(grouped.guaranteed_miss_m, single.guaranteed_miss_m, rtol=0.02)
    # The groups of an engagement do not depend on the others of its batch.
    alone = [simulate(scenario, [run]).guaranteed_miss_m[0] for run in range(3)]
    assert alone == grouped.guaranteed_miss_m.tolist()


def test_a_measured_rate_reads_the_events_since_the_previous_one(asteroid: Scenario) -> None:
    """A contradicting angle is retracted and does not count; stored sections equal replays of the
    whole history.
    """
    information = InformationSet(asteroid.set_model, 2)

    def step(sets: InformationSet, alpha_rad: float) -> None:
        sets.measure_angle(alpha_rad)
        sets.shift(1.5)
        sets.predict()
        sets.measure_rate(1e-8, 1e-5)
        sets.predict()

    for alpha_rad in (1e-4, 0.9, 2e-4):
        step(information, alpha_rad)
    assert information.inconsistent.all()
    for section in information.sections():
        replayed = information.section_at(section.label_m).polygons[0]
        np.testing.assert_array_equal(section.polygons[0].vertices, replayed.vertices)
    twin = information.copy()
    twin._state.history.values[: twin._state.history.seen] = np.nan
    for sets in (information, twin):
        step(sets, 1.5e-4)
    for section, other in zip(information.sections(), twin.sections(), strict=True):
        np.testing.assert_array_equal(section.polygons[0].vertices, other.polygons[0].vertices)
