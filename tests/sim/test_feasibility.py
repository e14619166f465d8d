"""What a scenario allows, against the causes of misses of simulated runs and against the closed
form.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from infoset.experiments import load_scenario
from infoset.guidance import Thruster
from infoset.sim import Body, Scenario, possible_miss_of, simulate
from infoset.sim.bound.lower_bound import pair_at
from infoset.sim.closed_form import possible_miss
from infoset.sim.feasibility import STARTS, feasibility

CASES = Path(__file__).parent / "cases"


@pytest.mark.parametrize(
    "thruster",
    [
        Thruster(1000.0, 0.0, 0.5),
        Thruster(1000.0, 0.0, 1.0, last_impulse_s=4.0),
        Thruster(2.0, 0.0, 1.0),
    ],
    ids=["engine", "cut-off", "budget"],
)
def test_starts_beyond_engine_and_budget_equal_causes_of_simulated_runs(
    thruster: Thruster, brief: Scenario
) -> None:
    scenario = replace(brief, thruster=thruster, body=Body(5.0), sun=None)
    found = feasibility(scenario)
    assert found is not None
    flown = simulate(scenario, STARTS)
    missed = ~flown.hit.filled(False)
    for share, corrects_m in (
        (found.beyond_engine, flown.engine_corrects_m),
        (found.beyond_budget, flown.budget_corrects_m),
    ):
        beyond = flown.unguided_miss_m - corrects_m > 5.0
        assert (missed[beyond]).all()
        assert beyond.mean() == pytest.approx(share, abs=1.0 / STARTS)
    assert found.beyond_engine <= found.beyond_budget
    assert 0.05 < found.beyond_budget < 0.95
    assert found.unguided_miss_m == pytest.approx(flown.unguided_miss_m.max(), rel=1e-3)


@pytest.mark.parametrize(
    ("name", "setting"), [("dart-2022", "150"), ("dart-2022", "900"), ("haiv-2013", None)]
)
def test_the_possible_miss_is_the_closed_form_of_a_camera(name: str, setting: str | None) -> None:
    settings = [] if setting is None else [f"thruster.last_impulse_s={setting}"]
    scenario = load_scenario(name, settings)
    found = feasibility(scenario)
    assert found is not None
    possible = found.possible_miss
    assert possible is not None
    assert possible.images_m == possible_miss_of(scenario)
    # The closed form has images at all times, and the flight every ten seconds. The speeds at the
    # start add nothing.
    assert possible.images_and_speeds_m == pytest.approx(possible_miss_of(scenario), rel=0.01)


def test_the_speeds_at_the_start_and_the_images_leave_the_miss_of_a_pair() -> None:
    """The farthest pair is another way to the number; the images alone leave more."""
    scenario = replace(load_scenario(CASES / "late-cut-off.toml"), sun=None)
    found = possible_miss(scenario)
    assert found is not None
    pair = pair_at(scenario, scenario.nominal_range_m, -scenario.closing_speed_m_s)
    assert found.images_and_speeds_m == pytest.approx(pair.bound_m, rel=1e-4)
    assert found.images_m is not None
    assert found.images_m > 1.2 * found.images_and_speeds_m


@pytest.mark.parametrize("setting", ["camera.miss_probability=0.1", None])
def test_closed_form_of_images_is_none_if_the_camera_loses_some(
    setting: str | None,
) -> None:
    scenario = (
        load_scenario("asteroid-1997") if setting is None else load_scenario("dart-2022", [setting])
    )
    found = possible_miss(scenario)
    assert found is not None
    assert found.images_m is None
    assert found.images_and_speeds_m > 0.0


def test_numbers_of_a_flight_and_a_nominal_arrival_that_is_far_too_late(brief: Scenario) -> None:
    found = feasibility(brief)
    assert found is not None
    assert found.steps == int(595e3 / 58e3 / 0.5) == 20
    assert found.possible_miss is not None
    assert feasibility(replace(brief, nominal_range_m=1e12)) is None
