"""Proportional navigation, augmented proportional navigation and predictive guidance against their
closed forms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from infoset import BearingSensor, Bias, Camera, InformationSet, Model, SetModel, StateBox
from infoset.arrays import Flags, Floats
from infoset.experiments import load_scenario
from infoset.guidance import (
    Kalman,
    KalmanBank,
    MissEstimate,
    Predictive,
    ProportionalNavigation,
    Situation,
    Strategy,
    Thruster,
    make_strategy,
    strategy_names,
)
from infoset.guidance.scripted_noise import ScriptedNoise
from infoset.sensors import OffsetCamera
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements
from infoset.sim.scenario import of_model

E = 6e3
"""Closing speed, m/s."""
T = 1000.0
"""Time of flight, s."""
ENGINE = Thruster(budget_m_s=1e9, min_impulse_m_s=0.0, max_impulse_m_s=1e9)
BASELINES = [name for name in strategy_names() if "kalman" in name]


def set_model(
    sensor: BearingSensor, nu: float = 0.0, width_m: float = 1e5, range_error_m: float = 0.0
) -> SetModel:
    box = StateBox(
        (-width_m, width_m),
        (E * T - range_error_m, E * T + range_error_m),
        (-width_m / T, width_m / T),
        (-E, -E),
    )
    return SetModel(
        E,
        10.0,
        box,
        sensor,
        disturbance_m_s2=nu,
        range_threshold_m=10.0 * sensor.farthest_m,
        model=Model.PAPER,
    )


MODEL = set_model(Camera(10.0, 1e-5))


def situation(
    model: SetModel = MODEL, batch: int = 1, step: int = 0, step_s: float = 10.0
) -> Situation:
    view = InformationSet(model, batch).view()
    return Situation(
        time_s=step * step_s,
        step=step,
        step_s=step_s,
        predicted_miss=view.predicted_miss(),
        budget_left_m_s=np.full(batch, 1e9),
        thruster=ENGINE,
        closing_speed_m_s=E,
        measured={},
        last_impulse_m_s=np.zeros((1, batch)),
        information=view,
    )


@dataclass
class Truth:
    """Motion of an impactor toward a target with a constant lateral acceleration."""

    z: float
    v: float
    a: float = 0.0
    to_go_s: float = T

    @property
    def miss_m(self) -> float:
        return self.z + self.v * self.to_go_s + 0.5 * self.a * self.to_go_s**2

    def advance(self, step_s: float) -> None:
        self.z += self.v * step_s + 0.5 * self.a * step_s**2
        self.v += self.a * step_s
        self.to_go_s -= step_s


class Known:
    """An estimator that knows the motion, but for an error of the miss; only if augmented it knows
    `a`.
    """

    def __init__(
        self, truth: Truth, is_augmented: bool, errors_m: Callable[[float], float]
    ) -> None:
        self.truth = truth
        self.a = truth.a if is_augmented else 0.0
        self.errors_m = errors_m

    def update(self, situation: Situation) -> None:
        pass

    def estimate(self, situation: Situation) -> MissEstimate:
        truth = self.truth
        to_go = self.truth.to_go_s
        miss = truth.z + truth.v * to_go + 0.5 * self.a * to_go**2 + self.errors_m(to_go)
        one = np.ones((1, 1))
        return MissEstimate(miss * one, 0.0 * one, max(to_go - situation.lead_s, 0.0) * one)


def started(
    strategy: Any, truth: Truth, errors_m: Callable[[float], float] = lambda to_go_s: 0.0
) -> Any:
    """Return the state of a strategy whose estimator knows the motion."""
    state = strategy.start((1, 1))
    state.estimator = Known(truth, getattr(strategy, "is_augmented", False), errors_m)
    return state


@dataclass
class Flight:
    """Times to go, impulses, and misses before each impulse of a flight; the miss at the end is the
    last one.
    """

    to_go_s: Floats
    impulses_m_s: Floats
    misses_m: Floats


def fly(
    strategy: Strategy,
    truth: Truth,
    steps: int,
    burns: Sequence[int] | None = None,
    errors_m: Callable[[float], float] = lambda to_go_s: 0.0,
) -> Flight:
    """Fly to the arrival with an engine that gives all that is wanted, at all steps or at some."""
    state = started(strategy, truth, errors_m)
    rows = []
    schedule = () if burns is None else tuple(T - burn * T / steps for burn in burns)
    now = replace(situation(step_s=T / steps), thruster=replace(ENGINE, impulses_s=schedule))
    for step in range(steps):
        times = (
            None if burns is None else np.array([burn * T / steps for burn in burns if burn > step])
        )
        now = replace(
            now,
            time_s=step * T / steps,
            step=step,
            may_fire=burns is None or step in burns,
            later_times_s=times,
        )
        impulse = strategy.decide(now, state).item()
        rows.append((truth.to_go_s, impulse, truth.miss_m))
        truth.v -= impulse
        truth.advance(T / steps)
    to_go, impulses, misses = np.array(rows).T
    return Flight(to_go, impulses, np.append(misses, truth.z))


@pytest.mark.parametrize("ratio", [2.5, 3.0, 4.0, 5.0])
@pytest.mark.parametrize("steps", [10, 1000])
def test_proportional_navigation_makes_the_miss_zero_along_its_closed_form(
    ratio: float, steps: int
) -> None:
    """m = m_0 (tau/T)^N, the rate of the line of sight is q_0 (tau/T)^(N - 2), and the impulses are
    their changes.
    """
    truth = Truth(z=0.0, v=2.0)
    flight = fly(ProportionalNavigation(ratio=ratio), truth, steps)
    share = flight.to_go_s / T
    expected = 2000.0 * share**ratio
    np.testing.assert_allclose(flight.misses_m[:-1], expected, rtol=1e-9, atol=1e-9)
    rate = flight.misses_m[:-1] / (E * flight.to_go_s**2)
    np.testing.assert_allclose(
        rate, 2000.0 / (E * T**2) * share ** (ratio - 2.0), rtol=1e-9, atol=1e-15
    )
    np.testing.assert_allclose(
        flight.impulses_m_s, -np.diff(expected, append=0.0) / flight.to_go_s, atol=1e-9
    )
    assert abs(flight.misses_m[-1]) < 1e-6


@pytest.mark.parametrize("ratio", [3.0, 4.0, 5.0])
def test_impulse_of_proportional_navigation_equals_the_textbook_formula(ratio: float) -> None:
    """Acceleration N V/T (tau/T)^(N - 2) for a velocity V across the line of sight: N/(N - 1) V in
    all.
    """
    steps = 4000
    flight = fly(ProportionalNavigation(ratio=ratio), Truth(z=0.0, v=2.0), steps)
    acceleration = flight.impulses_m_s / (T / steps)
    middle = 0.5 * (flight.to_go_s + np.append(flight.to_go_s[1:], 0.0)) / T
    np.testing.assert_allclose(
        acceleration, ratio * 2.0 / T * middle ** (ratio - 2.0), rtol=1e-2, atol=1e-6
    )
    assert flight.impulses_m_s.sum() == pytest.approx(2.0 * ratio / (ratio - 1.0), rel=1e-3)


@pytest.mark.parametrize("ratio", [3.0, 4.0, 5.0])
def test_proportional_navigation_against_a_constant_acceleration_has_the_known_cost(
    ratio: float,
) -> None:
    """a N/2 (tau/T)^(N - 2) with augmentation, a N/(N - 2) (1 - (tau/T)^(N - 2)) without (Zarchan,
    chapter 8).
    """
    a, steps = 1e-3, 4000
    middle = (np.arange(steps, 0.0, -1.0) - 0.5) / steps
    early = middle > 0.05
    for is_augmented, expected in (
        (True, 0.5 * ratio * a * middle ** (ratio - 2.0)),
        (False, ratio / (ratio - 2.0) * a * (1.0 - middle ** (ratio - 2.0))),
    ):
        truth = Truth(z=0.0, v=0.0, a=a)
        flight = fly(ProportionalNavigation(is_augmented, ratio), truth, steps)
        acceleration = flight.impulses_m_s / (T / steps)
        np.testing.assert_allclose(acceleration[early], expected[early], rtol=1e-2, atol=1e-2 * a)
        # In the last step the target accelerates after the last impulse.
        assert abs(flight.misses_m[-1]) < (1e-6 if is_augmented else a * (T / steps) ** 2)
        if is_augmented:
            np.testing.assert_allclose(
                flight.misses_m[:-1], 500.0 * (flight.to_go_s / T) ** ratio, atol=1e-9
            )


def test_pulses_are_no_smaller_than_the_dead_band_and_follow_the_commands() -> None:
    plain = Truth(0.0, 2.0)
    pulsed = Truth(0.0, 2.0)
    all_commands = fly(ProportionalNavigation(), plain, 1000).impulses_m_s
    flight = fly(ProportionalNavigation(dead_band_m_s=0.1), pulsed, 1000)
    pulses = flight.impulses_m_s[:-1][flight.impulses_m_s[:-1] != 0.0]
    assert (pulses >= 0.1).all()
    assert 15 <= len(pulses) <= 30
    assert np.abs(np.cumsum(flight.impulses_m_s) - np.cumsum(all_commands))[:-1].max() < 0.2
    assert abs(flight.misses_m[-1]) < 1e-6
    minimum = fly(ProportionalNavigation(), Truth(0.0, 0.0), 10)
    assert (minimum.impulses_m_s == 0.0).all()


def test_the_dead_band_is_the_min_impulse_by_default_and_old_commands_are_not_given() -> None:
    truth = Truth(0.0, 1.0)
    strategy = ProportionalNavigation()
    state = started(strategy, truth)
    engine = Thruster(1e9, 0.05, 1e9)
    now = replace(situation(), thruster=engine)
    assert strategy.decide(now, state)[0, 0] == 0.0  # 1 (1 - 0.99^3) = 0.0297
    assert state.accumulated_m_s[0, 0] == pytest.approx(1.0 - 0.99**3)
    assert strategy.decide(now, state)[0, 0] == pytest.approx(2.0 * (1.0 - 0.99**3))
    strategy.decide(now, state)
    truth.v = 0.0
    assert strategy.decide(now, state)[0, 0] == 0.0
    assert state.accumulated_m_s[0, 0] == 0.0


def test_predictive_guidance_leaves_the_error_of_its_last_estimate() -> None:
    """k_i = (e_i - e_(i-1))/tau_i after the first burn, and the miss is -e_i."""
    errors = {900.0: 300.0, 350.0: -40.0, 120.0: 5.0}
    truth = Truth(0.0, 2.0)
    burns = [100, 650, 880]
    flight = fly(Predictive(), truth, 1000, burns, lambda to_go: errors.get(round(to_go, 6), 1e9))
    expected = [2300.0 / 900.0, -340.0 / 350.0, 45.0 / 120.0]
    np.testing.assert_allclose(flight.impulses_m_s[burns], expected, rtol=1e-9)
    assert np.flatnonzero(flight.impulses_m_s).tolist() == burns
    assert flight.misses_m[-1] == pytest.approx(-5.0)


def test_predictive_guidance_corrects_an_exact_estimate_at_once() -> None:
    truth = Truth(100.0, 2.0)
    flight = fly(Predictive(spacing=2.0), truth, 1000)
    assert np.flatnonzero(np.abs(flight.impulses_m_s) > 1e-9).tolist() == [500]
    assert flight.impulses_m_s[500] == pytest.approx(2100.0 / 500.0)
    assert abs(flight.misses_m[-1]) < 1e-6


@pytest.mark.parametrize("make", [ProportionalNavigation, Predictive])
def test_the_divisor_is_the_time_from_the_impulse(make: Callable[..., Strategy]) -> None:
    """The last decision, 300 s before the arrival, gives its impulse 100 s later."""
    truth = Truth(0.0, 2.0, to_go_s=300.0)
    strategy = make()
    now = replace(situation(), lead_s=100.0, later_times_s=np.empty(0))
    assert strategy.decide(now, started(strategy, truth))[0, 0] == pytest.approx(600.0 / 200.0)
    assert strategy.decide(replace(now, may_fire=False), started(strategy, truth))[0, 0] == 0.0


def measured(
    model: SetModel,
    truth: Truth,
    steps: int,
    seen: Flags | None = None,
    errors_rad: Floats | None = None,
    is_augmented: bool = False,
) -> tuple[Any, Situation]:
    """Return an estimator after angles along a motion with no impulse, and its last situation."""
    batch = 1 if seen is None else len(seen)
    estimator = KalmanBank((1, batch), is_augmented)
    for step in range(steps):
        angle = np.full((1, batch), np.arctan2(truth.z, E * truth.to_go_s))
        values = {"angle": angle + (0.0 if errors_rad is None else errors_rad[step])}
        flags = {} if seen is None else {"angle": seen[:, step]}
        now = replace(
            situation(model, batch, step), measured=values, new=frozenset(values), seen=flags
        )
        estimator.update(now)
        if step < steps - 1:
            truth.advance(10.0)
    return estimator, now


def deviation_m(
    bounds_rad: Callable[[Floats], Floats], steps: Floats, width_m: float = 1e5
) -> float:
    """Standard deviation of the miss of a line through positions with known range, by its normal
    equations.
    """
    to_go = T - 10.0 * steps
    weight = 3.0 / (bounds_rad(E * to_go) * E * to_go) ** 2
    # Unknowns are the miss and V.
    normal = np.array(
        [
            [weight.sum(), -(weight * to_go).sum()],
            [-(weight * to_go).sum(), (weight * to_go**2).sum()],
        ]
    )
    prior = np.linalg.inv(
        np.array([[1.0, T], [0.0, 1.0]])
        @ np.diag([width_m**2, (width_m / T) ** 2])
        / 3.0
        @ np.array([[1.0, 0.0], [T, 1.0]])
    )
    return float(np.sqrt(np.linalg.inv(normal + prior)[0, 0]))


@pytest.mark.parametrize("centroid_m", [0.0, 30.0])
@pytest.mark.parametrize("bias", list(Bias))
def test_deviations_with_a_camera_equal_a_line_through_the_positions(
    centroid_m: float, bias: Bias
) -> None:
    """Range and speed are known; a constant centroid error adds c^2/3 to the variance of the
    miss.
    """
    model = set_model(Camera(10.0, 1e-5, centroid_m, bias=bias))
    estimator, now = measured(model, Truth(0.0, 0.0), 60)
    independent = centroid_m if bias is Bias.RANDOM else 0.0
    expected = deviation_m(lambda x: 1e-5 + independent / x, np.arange(60.0))
    if bias is Bias.CONSTANT:
        expected = float(np.hypot(expected, centroid_m / np.sqrt(3.0)))
    estimate = estimator.estimate(now)
    assert estimate.deviation_m[0, 0] == pytest.approx(expected, rel=1e-4)
    assert estimate.miss_m[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert estimate.to_go_s[0, 0] == pytest.approx(T - 590.0)


@pytest.mark.parametrize("bias", list(Bias))
def test_offset_that_is_not_subtracted_is_a_constant_error(bias: Bias) -> None:
    """As the constant error of a centroid, it adds its bound squared / 3 to the variance."""
    camera = OffsetCamera(
        10.0,
        1e-5,
        10.0,
        bias=bias,
        phase_angle_rad=1.0,
        sun_angle_rad=0.5 * np.pi,
        phase_correction=False,
        offset_m=(20.0,),
    )
    model = set_model(camera)
    estimator, now = measured(model, Truth(0.0, 0.0), 60)
    independent, constant = (10.0, 20.0) if bias is Bias.RANDOM else (0.0, 30.0)
    of_images = deviation_m(lambda x: 1e-5 + independent / x, np.arange(60.0))
    expected = float(np.hypot(of_images, constant / np.sqrt(3.0)))
    assert estimator.estimate(now).deviation_m[0, 0] == pytest.approx(expected, rel=1e-4)


def test_lost_images_change_nothing_in_the_engagement_that_lost_them() -> None:
    generator = np.random.default_rng(1)
    seen = generator.random((3, 60)) < 0.5
    seen[2] = True
    errors = generator.uniform(-1e-5, 1e-5, 60)
    estimator, now = measured(MODEL, Truth(500.0, -2.0), 60, seen, errors)
    estimate = estimator.estimate(now)
    for number in range(3):
        steps = np.flatnonzero(seen[number]).astype(float)
        assert estimate.deviation_m[0, number] == pytest.approx(
            deviation_m(lambda x: 0.0 * x + 1e-5, steps), rel=1e-3
        )
        single, last = measured(MODEL, Truth(500.0, -2.0), 60, seen[number : number + 1], errors)
        np.testing.assert_allclose(
            single.estimate(last).miss_m, estimate.miss_m[0, number], rtol=1e-9
        )
    assert len(set(estimate.miss_m[0].tolist())) == 3


def test_the_dead_zone_ends_at_the_last_allowed_time() -> None:
    now = replace(situation(), measured={"angle": np.array([[1e-4]])}, new=frozenset({"angle"}))
    strategy = Kalman()
    assert strategy.decide(now, strategy.start((1, 1)))[0, 0] == 0.0
    for others in ({"later_times_s": np.empty(0)}, {"later_times_s": np.array([2.0])}):
        assert strategy.decide(replace(now, **others), strategy.start((1, 1)))[0, 0] != 0.0
    assert (
        strategy.decide(replace(now, later_times_s=np.array([20.0])), strategy.start((1, 1)))[0, 0]
        == 0.0
    )
    assert (
        strategy.decide(
            replace(now, later_times_s=np.empty(0), may_fire=False), strategy.start((1, 1))
        )[0, 0]
        == 0.0
    )


def test_augmented_estimators_find_the_acceleration_of_the_target() -> None:
    model = set_model(Camera(10.0, 1e-6), nu=0.01)
    truth = Truth(500.0, -2.0, a=0.006)
    estimator, now = measured(model, truth, 60, is_augmented=True)
    assert estimator.estimate(now).miss_m[0, 0] == pytest.approx(truth.miss_m, rel=0.02)
    assert estimator.mean[0, 0, 0, 4] == pytest.approx(0.006, rel=0.02)


@pytest.mark.parametrize("name", BASELINES)
def test_engagements_without_noise_and_gravity_hit(name: str) -> None:
    scenario = replace(load_scenario("asteroid-1997"), sun=None, thruster=Thruster(1e4, 0.0, 100.0))
    draws = draw(scenario, range(4), 1)
    none = {sensor: np.zeros_like(errors) for sensor, errors in draws.errors.items()}
    flight = Engagements(scenario, draws, make_strategy(name), noise=ScriptedNoise(none))
    while flight.flying:
        flight.advance()
    # The initial bounds count as a measurement, which leaves a part of the miss of up to 10 km.
    assert flight.results(np.arange(4)).miss_m.max() < 0.1


@pytest.mark.parametrize("name", BASELINES)
def test_a_mission_with_a_camera_a_schedule_and_a_delay(name: str) -> None:
    """Images are lost, and each impulse of three is given two steps after its decision."""
    scenario = load_scenario("asteroid-1997-space")
    camera = Camera(0.5, 1e-4, 20.0, bias=Bias.CONSTANT, miss_probability=0.3, last_image_s=4.0)
    engine = Thruster(1e4, 0.0, 1e3, impulses_s=(75.0, 30.0, 8.0), delay_steps=2)
    scenario = replace(
        scenario,
        **of_model(replace(scenario.set_model, angle_sensor=camera)),
        range_sensor=None,
        thruster=engine,
    )
    given: list[int] = []
    flight = Engagements(scenario, draw(scenario, range(6), 1), make_strategy(name))
    while flight.flying:
        flight.advance(lambda step: given.append(step.step) if step.impulse_m_s.any() else None)
    assert given == [50, 140, 184]
    results = flight.results(np.arange(6))
    assert results.truth_kept.all()
    # Constant centroid errors of up to 20 m along each axis remain, and the error of 8 s without an
    # impulse.
    assert np.median(results.miss_m) < 60.0
