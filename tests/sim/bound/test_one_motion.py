"""The lower bound by one motion that all impulses together do not bring to the target."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from infoset import InitialSet, Model, StateBox
from infoset.experiments import load_scenario
from infoset.guidance import Thruster, make_strategy
from infoset.sim import Scenario
from infoset.sim.bound.lower_bound import lower_bound, pair_at
from infoset.sim.bound.pair_flight import fly_pair
from infoset.sim.bound.pair_of_motions import PairApproach
from infoset.sim.scenario import of_model
from tests.space import in_space


def cosine(across_m_s: float) -> float:
    """Cosine of the angle between the relative velocity and the x axis, at a closing speed of 58
    km/s.
    """
    return 1.0 / float(np.hypot(1.0, across_m_s / 58e3))


def offset(z_m: tuple[float, float], **engine: Any) -> Scenario:
    """The 1997 sensor without gravity: known range and speed, a start far from the x axis and a
    weak engine.
    """
    published = load_scenario("asteroid-1997")
    box = StateBox(z_m, (5801.3e3, 5801.3e3), (0.0, 0.0), (-58e3, -58e3))
    model = replace(published.set_model, bounds=box, disturbance_m_s2=0.005, model=Model.GUARANTEED)
    model = replace(
        model, initial_set=InitialSet.BOX, angle_sensor=replace(model.angle_sensor, period_s=0.5)
    )
    thruster = Thruster(
        **{"budget_m_s": 1000.0, "min_impulse_m_s": 1e-4, "max_impulse_m_s": 0.5} | engine
    )
    return replace(
        published, sun=None, **of_model(model), dispersion=box, range_sensor=None, thruster=thruster
    )


@pytest.mark.parametrize(
    ("engine", "given"),
    [
        ({}, [0.5] * 201),
        ({"budget_m_s": 20.2}, [0.5] * 40 + [0.2]),
        ({"delay_steps": 20}, [0.0] * 20 + [0.5] * 181),
        ({"last_impulse_s": 60.0}, [0.5] * 81),
        ({"impulses_s": (90.0, 30.0)}, [0.0] * 20 + [0.5] + [0.0] * 119 + [0.5]),
    ],
    ids=["all", "budget", "delay", "cut-off", "schedule"],
)
def test_bound_of_a_far_start_is_its_miss_less_all_impulses(
    engine: dict[str, Any], given: list[float]
) -> None:
    """From z = 10 km the target ends at 10 km + nu T^2/2, and an impulse at the step k of D seconds
    moves that by T - k D times it.

    The cosine is that of the velocity nu T and all impulses. Every strategy misses by that; two
    motions with the same measurements prove 90 m.
    """
    scenario = offset((8e3, 10e3), **engine)
    arrival_s = 5801.3 / 58.0
    step_s = scenario.set_model.step_s
    impulses = np.array(given)
    by_impulses = float(impulses @ (arrival_s - step_s * np.arange(len(impulses))))
    # The bound counts the step of the arrival too.
    across_m_s = 0.005 * step_s * 201 + min(scenario.thruster.budget_m_s, 0.5 * 201)
    left_m = (10e3 + 0.5 * 0.005 * arrival_s**2 - by_impulses) * cosine(across_m_s)
    found = lower_bound(scenario)
    assert found.pair.is_single
    assert found.bound_m == pytest.approx(left_m, rel=5e-6)
    assert found.bound_m <= left_m
    flight = fly_pair(scenario, found.pair, make_strategy("symmetric-miss"))
    assert flight.results.miss_m[0] == flight.results.miss_m[1] >= found.bound_m
    assert flight.results.miss_m[0] == pytest.approx(found.bound_m, rel=1e-4)


def test_farthest_start_in_space_is_a_corner_of_the_box() -> None:
    """The impulses limit the modulus: the corner (-4, 10) km less what all of them move."""
    planar = offset((8e3, 10e3))
    scenario = in_space(planar)
    box = replace(scenario.set_model.bounds, y_m=(-4e3, 1e3), vy_m_s=(0.0, 0.0))
    model = replace(scenario.set_model, bounds=box, disturbance_m_s2=0.0, disturbance_y_m_s2=0.0)
    pair = pair_at(replace(scenario, **of_model(model), dispersion=box), 5801.3e3, -58e3)
    assert pair.is_single
    assert pair.position_m[0, :2].tolist() == [-4e3, 10e3]
    left_m = np.hypot(4e3, 10e3) - pair_at(planar, 5801.3e3, -58e3).correction_m
    assert pair.bound_m == pytest.approx(left_m * cosine(0.5 * 201), rel=5e-6)


def test_middle_of_a_pair_adds_nothing_to_pair_and_single_motion() -> None:
    """max(0, |c0| - C_s) + W_s - A_s of a pair around c0 is one of the other two bounds, as C_s =
    A_-1 - A_s.
    """
    for low_m in (0.0, 4e3, 4.9e3, 6e3):
        scenario = offset((low_m, low_m + 200.0))
        approach = PairApproach(scenario, 5801.3e3, -58e3)
        single = approach.single()
        pair = approach.best_pair()
        spent = single.correction_m - pair.correction_m
        middle = max(0.0, low_m + 100.0 - spent) + 0.5 * pair.apart_m - pair.correction_m
        assert middle * pair.cosine <= max(single.unlimited_bound_m, pair.unlimited_bound_m) + 1e-2
