"""The maximum miss of any state of the set when control ends: known cases, the truth below it and
Phi above it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset import AngleSensor, InitialSet, Model, SetModel, StateBox
from infoset.guidance import MeasurementNoise, NoiseKind, TieRule
from infoset.guidance.scripted_noise import ScriptedNoise
from infoset.sim import Manoeuvre, Outcome, Results, Scenario, Target
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements, Step
from infoset.sim.scenario import of_model
from tests.guaranteed import guaranteed
from tests.space import in_space

RUNS = 16
EXACT = ScriptedNoise({})


def fly(
    scenario: Scenario,
    runs: int = RUNS,
    *,
    noise: MeasurementNoise | None = None,
    guarantee: bool = True,
) -> tuple[Results, np.ndarray]:
    """Return the results of some runs, and the maximum misses of any state."""
    flight = Engagements(scenario, draw(scenario, range(runs), 0), noise=noise, guarantee=guarantee)
    while flight.flying:
        flight.advance()
    results = flight.results(np.arange(runs))
    return results, flight.any_state_miss_m(results)


def without_control(asteroid: Scenario, kind: Model, x_m: tuple[float, float]) -> Scenario:
    """A spacecraft in free space without fuel and without knowledge.

    The errors of its angles are greater than the box.
    """
    box = StateBox(z_m=(-3e3, 2e3), x_m=x_m, vz_m_s=(-20.0, 10.0), vx_m_s=(-10e3, -10e3))
    return replace(
        asteroid,
        sun=None,
        nominal_range_m=1e6,
        dispersion=replace(box, z_m=(-1e3, -1e3)),
        **of_model(
            SetModel(
                closing_speed_m_s=10e3,
                step_s=0.5,
                bounds=box,
                angle_sensor=AngleSensor(0.5, 0.2, 0.2, nominal_range_m=1e6),
                model=kind,
                initial_set=InitialSet.BOX,
                sections=5,
                range_threshold_m=5e3,
            )
        ),
        thruster=replace(asteroid.thruster, budget_m_s=0.0),
    )


@pytest.mark.parametrize("kind", list(Model))
def test_any_state_miss_without_control_is_the_miss_of_a_corner_of_the_box(
    kind: Model, asteroid: Scenario
) -> None:
    """100 s at -20 m/s from -3 km end at -5 km, wherever the truth is."""
    scenario = without_control(asteroid, kind, (1e6, 1e6))
    results, any_state_m = fly(scenario, 3, noise=EXACT)
    assert (results.miss_m <= 3e3 * (1.0 + 1e-6)).all()
    assert any_state_m == pytest.approx([5e3] * 3, rel=1e-6)


def test_the_disturbance_adds_to_the_miss(asteroid: Scenario) -> None:
    """0.02 m/s^2 over 100 s move by 100 m; the set adds half of a step's change of V, 5 mm/s, at
    the start: 0.5 m.
    """
    scenario = without_control(asteroid, Model.GUARANTEED, (1e6, 1e6))
    scenario = replace(scenario, **of_model(replace(scenario.set_model, disturbance_m_s2=0.02)))
    assert fly(scenario, 1, noise=EXACT)[1] == pytest.approx([5.1005e3], rel=1e-6)


def test_in_space_the_misses_along_both_axes_are_combined(asteroid: Scenario) -> None:
    """The corner (-6 km + 100 s * -30 m/s, -5 km) of the rectangle of misses, as in Phi."""
    plane = without_control(asteroid, Model.GUARANTEED, (1e6, 1e6))
    box = replace(plane.set_model.bounds, y_m=(-6e3, 1e3), vy_m_s=(-30.0, 30.0))
    scenario = replace(plane, dispersion=box, **of_model(replace(plane.set_model, bounds=box)))
    assert fly(scenario, 2, noise=EXACT)[1] == pytest.approx([np.hypot(9e3, 5e3)] * 2, rel=1e-6)


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
@pytest.mark.parametrize("name", ["asteroid", "ranging", "comet", "space", "target"])
def test_the_truth_is_one_of_the_states_and_phi_bounds_them(
    name: str, noise: NoiseKind, request: pytest.FixtureRequest
) -> None:
    """Without a cut-off and with budget left, control ends at the range threshold, where Phi bounds
    all states.
    """
    given = request.getfixturevalue(name if name in ("ranging", "comet") else "asteroid")
    scenario = guaranteed(in_space(given) if name == "space" else given, sections=9)
    target = (
        Target(Manoeuvre.WORST_CASE, scenario.set_model.disturbance_m_s2)
        if name == "target"
        else None
    )
    scenario = replace(scenario, noise=noise, tie=TieRule.RANDOM, target=target)
    results, any_state_m = fly(scenario)
    assert results.truth_kept.all()
    assert (results.miss_m <= any_state_m).all()
    assert (any_state_m <= results.guaranteed_miss_m).all()
    assert (results.miss_m < 0.9 * any_state_m).any()
    assert fly(scenario, guarantee=False)[1].tolist() == any_state_m.tolist()


def test_after_a_cut_off_measurements_do_not_narrow_the_choice(asteroid: Scenario) -> None:
    """The truth may be any state of the set at the last impulse: many metres more than the sections
    that arrive.
    """
    scenario = guaranteed(asteroid, sections=9)
    late = replace(
        scenario, thruster=replace(scenario.thruster, last_impulse_s=20.0), noise=NoiseKind.GAME
    )
    flight = Engagements(late, draw(late, range(RUNS), 0))
    last_step = late.impulse_steps[-1]  # type: ignore[index]
    after_impulse = []

    def at_cut_off(step: Step) -> None:
        if step.step == last_step:
            information = step.information.copy()
            information.shift(step.impulse_m_s)
            lower_m, upper_m = information.predicted_miss_by_section_m()
            after_impulse.append(np.maximum(upper_m, -lower_m)[0].max(axis=1))

    while flight.flying:
        flight.advance(at_cut_off)
    results = flight.results(np.arange(RUNS))
    any_state_m = flight.any_state_miss_m(results)
    assert (results.miss_m <= any_state_m).all()
    # The labels are within 2 % of the true ranges, because the closing speed is.
    assert (after_impulse[0] * (1.0 - 0.02) <= any_state_m).all()
    assert (any_state_m <= after_impulse[0] * (1.0 + 0.02)).all()
    assert (any_state_m > results.guaranteed_miss_m).all()


def test_any_state_miss_is_the_true_miss_if_the_set_became_empty(asteroid: Scenario) -> None:
    """A set that believes in 58 km/s, and truths that come at 110."""
    fast = replace(asteroid.dispersion, vx_m_s=(-110.1e3, -110e3))
    wrong = replace(
        asteroid,
        dispersion=fast,
        **of_model(
            replace(
                asteroid.set_model,
                bounds=replace(asteroid.set_model.bounds, vx_m_s=(-110.1e3, -110e3)),
            )
        ),
    )
    results, any_state_m = fly(wrong, 3)
    assert set(results.outcomes) == {Outcome.SET_EMPTY}
    assert any_state_m.tolist() == results.miss_m.tolist()


def test_the_farthest_range_has_the_max_miss(asteroid: Scenario) -> None:
    """A range of 1200 km takes 120 s: -3 km - 2.4 km."""
    _, any_state_m = fly(
        without_control(asteroid, Model.GUARANTEED, (0.8e6, 1.2e6)), 3, noise=EXACT
    )
    assert any_state_m == pytest.approx([5.4e3] * 3, rel=1e-6)


def test_labels_of_a_run_that_arrives_before_the_cut_off_do_not_wait_for_it(
    asteroid: Scenario,
) -> None:
    """The set of a run that has arrived does not go on: in a batch it counted 404 m instead of 19
    m.
    """
    thruster = replace(asteroid.thruster, last_impulse_s=2.0, delay_steps=2)
    scenario = replace(guaranteed(asteroid), thruster=thruster, noise=NoiseKind.GAME)
    scenario = replace(scenario, dispersion=scenario.set_model.bounds)
    _, together_m = fly(scenario, 11, guarantee=False)
    flight = Engagements(scenario, draw(scenario, [10], 0), guarantee=False)
    while flight.flying:
        flight.advance()
    assert flight.any_state_miss_m(flight.results(np.arange(1))).tolist() == [together_m[10]]
