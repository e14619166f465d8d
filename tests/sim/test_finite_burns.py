"""Burns: their motion, and the guarantee with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.experiments import load_scenario
from infoset.experiments.common.input_file import read_text, to_toml
from infoset.guidance import NoiseKind, Thruster, make_strategy
from infoset.limits import MAXIMUM
from infoset.sim import Results, Scenario, Sun, lower_bound, simulate
from infoset.sim.bound.game_value import why_no_value
from infoset.sim.bound.pair_flight import fly_pair
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.gravity import on_board_model
from infoset.sim.kepler import KeplerMotion

THRUST: dict[str, Any] = {"thrust_N": 10.0, "mass_kg": 500.0}
AU_M = 1.495978707e11
SUN = Sun(1.32712440018e20, AU_M, 0.3)


@pytest.fixture(scope="module")
def mission() -> Scenario:
    """`haiv-2013` with a step that is long enough for its first burn, of up to 1.8 m/s."""
    scenario = load_scenario("haiv-2013", ["step_s=90", "camera.period_s=90"])
    return replace(scenario, thruster=replace(scenario.thruster, max_impulse_m_s=1.7))


def burning(scenario: Scenario) -> Scenario:
    return replace(scenario, thruster=replace(scenario.thruster, **THRUST))


def sound(results: Results) -> bool:
    return bool(
        results.truth_kept.all()
        and results.phi_held.filled(False).all()
        and not results.set_emptied.any()
    )


@pytest.mark.parametrize("axes", [1, 2])
@pytest.mark.parametrize("sun", [None, SUN])
def test_the_motion_is_that_of_a_constant_acceleration(axes: int, sun: Sun | None) -> None:
    """Against the same motion with the acceleration, integrated in steps of 5 s."""
    position = np.array([[3e3, -4e3, 8e7][-axes - 1 :]])
    velocity = np.array([[1.0, 0.5, -1.15e4][-axes - 1 :]])
    impulse = np.array([[0.6], [-0.8]][:axes])
    acceleration = 0.02
    duration_s = float(np.hypot.reduce(impulse, axis=0).item()) / acceleration

    program = KeplerMotion(position, velocity, sun, acceleration)
    program.fire(impulse)
    program.advance(60.0)

    integrated = KeplerMotion(position, velocity, sun)
    parts = 10
    for _ in range(parts):
        # The acceleration of the object relative to the spacecraft.
        integrated.advance(duration_s / parts, -impulse / duration_s)
    integrated.advance(60.0 - duration_s, np.zeros_like(impulse))

    # The burn of the object is 1e8 m farther from the Sun than that of the spacecraft: gravity
    # differs by 1e-13 / s^2 over at most 25 m.
    np.testing.assert_allclose(program.position_m, integrated.position_m, rtol=0.0, atol=2e-8)
    np.testing.assert_allclose(program.velocity_m_s, integrated.velocity_m_s, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
@pytest.mark.parametrize(
    "runs", [12, pytest.param(1000, marks=pytest.mark.thorough)], ids=["few", "many"]
)
def test_modelled_burns_keep_the_guarantee(mission: Scenario, noise: NoiseKind, runs: int) -> None:
    assert sound(simulate(replace(burning(mission), noise=noise), runs))


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
def test_burns_that_are_flown_and_not_modelled_break_it(
    mission: Scenario, noise: NoiseKind
) -> None:
    scenario = replace(mission, noise=noise)
    draws = draw(scenario, range(12), 0)
    truth = KeplerMotion(draws.position_m, draws.velocity_m_s, None, 0.02)
    flight = Engagements(scenario, draws, truth=truth)
    while flight.flying:
        flight.advance()
    # 10 and 5 of these 12 flights keep the true state.
    most = 0.9 if noise is NoiseKind.RANDOM else 0.6
    assert flight.results(np.arange(12)).truth_kept.mean() < most


@pytest.mark.parametrize("delay_steps", [0, 1])
def test_all_strategies_hit_with_burns(mission: Scenario, delay_steps: int) -> None:
    engine = replace(burning(mission).thruster, delay_steps=delay_steps)
    for strategy in ("symmetric-miss", "patient", "least-effort", "zero-effort-miss", "kalman"):
        results = simulate(replace(mission, thruster=engine, strategy=strategy), 6)
        assert results.hit.all(), strategy
        assert sound(results)


def in_plane(**sensors: Any) -> Scenario:
    """A planar scenario with wide ranges, speeds and times of arrival, and burns of a step."""
    scenario = load_scenario("own-scenario")
    engine = Thruster(
        200.0,
        0.1,
        7.0,
        execution_error_relative=0.02,
        last_impulse_s=15.0,
        thrust_N=15.0,
        mass_kg=1.0,
    )
    return replace(scenario, thruster=engine, **sensors)


@pytest.mark.parametrize("noise", [NoiseKind.RANDOM, NoiseKind.GAME])
@pytest.mark.parametrize("sensors", [{}, {"range_sensor": None}])
def test_burns_in_a_plane_keep_the_guarantee(noise: NoiseKind, sensors: dict[str, Any]) -> None:
    assert sound(simulate(replace(in_plane(**sensors), noise=noise), 6))


@pytest.mark.parametrize(
    ("numbers", "batch", "refused"),
    [
        pytest.param((0, 2, 3, 5), 16, (0, 0), id="few"),
        # In the others no impulse is before the earliest arrival.
        pytest.param(range(10_000, 10_100), 80, (20, 15), marks=pytest.mark.thorough, id="many"),
    ],
)
@pytest.mark.parametrize(
    "rate_sensor", [False, pytest.param(True, marks=pytest.mark.thorough)], ids=["angles", "rates"]
)
def test_random_scenarios_with_burns_keep_the_guarantee(
    rate_sensor: bool,
    numbers: Sequence[int],
    batch: int,
    refused: tuple[int, int],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every sensor, noise and tie rule; errors of the engine at their bounds in half of them."""
    soundness = pytest.importorskip("benchmarks.soundness", reason="only in a checkout")
    monkeypatch.setattr(soundness, "BATCH", batch)
    total = soundness.Count()
    for number in numbers:
        total += soundness.fly_random_batch(number, rate_sensor, seed=3, burns=True)
    left = len(numbers) - refused[rate_sensor]
    assert total == soundness.Count(left * batch, refused=refused[rate_sensor] * batch)


def test_maximum_impulse_that_is_not_given_follows_the_thrust_and_the_step(
    mission: Scenario,
) -> None:
    """F D / m, divided by one and the error of size, after any change of the scenario."""
    engine = replace(mission.thruster, max_impulse_m_s=MAXIMUM, **THRUST)
    scenario = replace(mission, thruster=engine)
    assert mission.camera is not None
    camera = replace(mission.camera, period_s=45.0)
    cases = {
        0.02 * 90.0: scenario,
        0.02 * 45.0: replace(scenario, step_s=45.0, camera=camera),
        0.04 * 90.0: replace(scenario, thruster=replace(scenario.thruster, thrust_N=20.0)),
        0.02 * 89.82: replace(scenario, nominal_range_m=0.998 * scenario.nominal_range_m),
    }
    for most_m_s, changed in cases.items():
        with_error_m_s = most_m_s / (1.0 + engine.execution_error_relative)
        assert changed.engine.max_impulse_m_s == pytest.approx(with_error_m_s, rel=1e-9)
    assert read_text(Scenario, to_toml(scenario), "copy") == scenario


def test_mirrored_flights_have_mirrored_burns(mission: Scenario) -> None:
    scenario = replace(burning(mission), noise=NoiseKind.RANDOM)
    draws = draw(scenario, range(4), 1)
    mirrored = replace(
        draws,
        position_m=draws.position_m * [-1.0, -1.0, 1.0],
        velocity_m_s=draws.velocity_m_s * [-1.0, -1.0, 1.0],
        errors={"angle": -draws.errors["angle"]},
        bias=None if draws.bias is None else -draws.bias,
    )
    misses: list[Floats] = []
    for each in (draws, mirrored):
        flight = Engagements(scenario, each)
        while flight.flying:
            flight.advance()
        misses.append(flight.results(np.arange(4)).lateral_miss_m)
    np.testing.assert_allclose(misses[0], -misses[1], rtol=0.0, atol=1e-6)


def test_the_last_burn_ends_before_the_earliest_arrival(mission: Scenario) -> None:
    engine = burning(mission).thruster
    late = replace(engine, impulses_s=(), last_impulse_s=30.0)
    with pytest.raises(ValueError, match=r"last_impulse_s: the last burn must end.*least 180: got"):
        replace(mission, thruster=late)
    with pytest.raises(ValueError, match=r"may last 86\.7 s: write at least 180: got None"):
        replace(mission, thruster=replace(late, last_impulse_s=None))
    # 130 s is nearer to 90 s, one step of 90 s, than to two.
    rounded = replace(engine, impulses_s=(900.0, 130.0))
    with pytest.raises(
        ValueError, match=r"impulses_s: .* 180: got 130\.0, rounded to the step at 90 s"
    ):
        replace(mission, thruster=rounded)


def test_the_earliest_arrival_is_that_with_gravity(mission: Scenario) -> None:
    """A burn that ends between the earliest arrivals with and without gravity is refused before
    the first step.
    """
    scenario = replace(burning(mission), sun=SUN)
    step_s = scenario.fitted_step_s
    models = (scenario.set_model, on_board_model(scenario))
    free_s, pulled_s = (
        model.label_limits_m[0] / scenario.closing_speed_m_s - scenario.nominal_arrival_s
        for model in models
    )
    assert pulled_s < free_s

    # The last impulse is one step before the nominal arrival, or the start of this step.
    longest_s = step_s + 0.5 * (free_s + pulled_s)
    most_m_s = 0.02 * longest_s / (1.0 + scenario.thruster.execution_error_relative)
    engine = replace(
        scenario.thruster, impulses_s=(), last_impulse_s=step_s, max_impulse_m_s=most_m_s
    )
    late = replace(scenario, thruster=engine)
    with pytest.raises(ValueError, match=r"thruster\.last_impulse_s: the last burn must end"):
        simulate(late, 1)
    simulate(replace(late, sun=None), 1)


def test_the_causes_of_misses_know_that_a_burn_acts_later(mission: Scenario) -> None:
    """The miss without the executed impulses is that of the coasting motion."""
    scenario = burning(mission)
    results = simulate(scenario, 6)
    coasting = results.position_m[:, :2] + results.velocity_m_s[:, :2] * (
        results.position_m[:, 2:] / -results.velocity_m_s[:, 2:]
    )
    # The executed impulse and its duration are known to the log: only the closing speed is not
    # exactly constant across the lateral motion.
    np.testing.assert_allclose(results.unguided_miss_m, np.hypot(*coasting.T), rtol=1e-6)


def test_lower_bound_of_burns_is_that_of_impulses_and_no_value_of_the_game(
    mission: Scenario,
) -> None:
    scenario = burning(mission)
    assert "burns that take time" in why_no_value(scenario)
    # A burn corrects less than the impulse: the bound of impulses is a bound of burns.
    found = lower_bound(scenario)
    assert found.bound_m == pytest.approx(lower_bound(mission).bound_m, rel=1e-9)


@pytest.mark.parametrize("is_scheduled", [True, False])
def test_one_of_a_pair_of_motions_misses_by_the_bound_with_burns(
    mission: Scenario, is_scheduled: bool
) -> None:
    """Few impulses are too weak for the starts, 34 km; with one in each step until 180 s, what the
    images cannot tell apart decides, 39 m.
    """
    scenario = burning(mission)
    if not is_scheduled:
        engine = replace(scenario.thruster, impulses_s=(), last_impulse_s=180.0)
        scenario = replace(scenario, thruster=engine)
    found = lower_bound(scenario)
    assert (found.bound_m > 1e3) == is_scheduled
    for pair in found.pairs:
        for strategy in ("symmetric-miss", "least-effort"):
            flight = fly_pair(scenario, pair, make_strategy(strategy))
            assert flight.max_error_share <= 1.0
            assert flight.results.miss_m.max() >= pair.bound_m
