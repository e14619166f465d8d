"""Scenarios whose guarantee failed in earlier versions, and random scenarios of their kinds."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from infoset import (
    AngleSensor,
    InformationSet,
    InformationSetView,
    InitialSet,
    Model,
    SetModel,
    StateBox,
)
from infoset.arrays import Floats
from infoset.engine import section_window as windows
from infoset.engine.history import LastSight
from infoset.engine.section_law import BOUND_SLACK, SectionLaw, section_laws
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.guidance import NoiseKind, RandomNoise, Thruster, TieRule
from infoset.sim import Outcome, Results, Scenario, simulate
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements, Step
from infoset.sim.scenario import of_model
from tests.kernels import callable_kernels
from tests.sensors import linear

CASES = Path(__file__).parent / "cases"
kernels = callable_kernels(windows)


def sound(results: Results) -> bool:
    held = results.phi_held
    assert np.isfinite(results.guaranteed_miss_m.compressed()).all()
    return bool(results.truth_kept.all() and held.all() and not held.mask.any())


@pytest.mark.parametrize(
    ("case", "seed", "noise", "tie", "runs"),
    [
        # Phi between labels took the supports to be concave in the label, which a rate's bands do
        # not leave them.
        pytest.param(
            *("rate-between-labels", 13014, NoiseKind.GAME, TieRule.UPPER, [6, 13, 21, 40, 86]),
            marks=pytest.mark.thorough,
        ),
        ("rate-free-space", 4006, NoiseKind.GAME, TieRule.UPPER, [84]),
        # Feasible labels beyond those found were taken to be refuted.
        pytest.param(
            *("rate-between-labels", 13014, NoiseKind.GAME, TieRule.UPPER, [1, 22, 36, 47]),
            marks=pytest.mark.thorough,
        ),
        ("rate-between-labels", 13014, NoiseKind.RANDOM, TieRule.UPPER, [47]),
        ("rate-wide-speeds", 13017, NoiseKind.RANDOM, TieRule.UPPER, [70]),
        # The truth's label was that of a motion without impulses, 8.5 ns off.
        ("late-arrival-strong-sun", 4008, NoiseKind.GAME, TieRule.LOWER, [10]),
        ("late-arrival-no-rate", 4029, NoiseKind.GAME, TieRule.UPPER, [99]),
    ],
)
def test_scenarios_of_earlier_failures_keep_the_guarantee(
    case: str, seed: int, noise: NoiseKind, tie: TieRule, runs: list[int]
) -> None:
    scenario = replace(load_scenario(CASES / f"{case}.toml"), noise=noise, tie=tie)
    results = simulate(scenario, runs, seed=seed)
    assert sound(results)
    assert Outcome.SET_EMPTY not in results.outcomes


@pytest.mark.parametrize("rate_sensor", [False, True])
@pytest.mark.parametrize(
    ("first", "scenarios", "batch"),
    [(0, 12, 16), pytest.param(10_000, 150, 80, marks=pytest.mark.thorough)],
)
def test_random_scenarios_keep_the_guarantee(
    rate_sensor: bool, first: int, scenarios: int, batch: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every sensor, noise and tie rule, with warnings as errors; `benchmarks/soundness.py` flies
    300 000.
    """
    soundness = pytest.importorskip("benchmarks.soundness", reason="only in a checkout")
    monkeypatch.setattr(soundness, "BATCH", batch)
    total = soundness.Count()
    for number in range(first, first + scenarios):
        total += soundness.fly_random_batch(number, rate_sensor, seed=3)
    assert total == soundness.Count(scenarios * batch)


def flat_law(error_rad: float, rising: bool) -> tuple[SetModel, SectionLaw]:
    """A model whose error bound at zero range is half (rising) or twice the nominal one."""
    box = StateBox((-1e4, 1e4), (4e5, 6e5), (-300.0, 300.0), (-5e3, -5e3))
    model = SetModel(
        5e3,
        1.0,
        box,
        AngleSensor(1.0, error_rad, (0.5 if rising else 2.0) * error_rad, 5e5),
        disturbance_m_s2=0.05,
        sections=5,
        fewest_sections=2,
        execution_error_relative=0.02,
    )
    return model, section_laws(model)[0]


class RateCase(NamedTuple):
    """A measured rate after one measured angle: draws of errors are in units of their bounds.

    The last angle was measured `ago` steps before the rate, or never: then the initial box stands
    for it. `place` and `width` are the places of the label and of the window around it.
    """

    slope: float
    v: float
    ago: int
    angle_draw: float
    rate_draw: float
    log_error: float
    place: float
    width: float
    impulse: float
    push: float
    rising: bool
    measured: bool


class Truth(NamedTuple):
    """The state at the measured rate, and the last angle before it."""

    z_then: float
    z: float
    v: float
    x: float
    omega: float
    sight: LastSight


RATE_ERROR = 1e-9
SIDES = st.sampled_from([-1.0, 1.0]) | st.floats(-1.0, 1.0)
RATE_CASES = st.builds(
    RateCase,
    slope=st.floats(-0.02, 0.02),
    v=st.floats(-40.0, 40.0),
    ago=st.integers(0, 6),
    angle_draw=SIDES,
    rate_draw=SIDES,
    log_error=st.floats(-8.0, -2.0),
    place=st.floats(0.0, 1.0),
    width=st.floats(0.0, 1.0),
    impulse=st.floats(-5.0, 5.0),
    push=SIDES,
    rising=st.booleans(),
    measured=st.booleans(),
)


def truth_of(case: RateCase, label: float, elapsed: int, model: SetModel, law: SectionLaw) -> Truth:
    """Return the motion of a case in closed form.

    An impulse with an error of execution is given in the middle between angle and rate, and the
    disturbance is constant.
    """
    e = law.closing_speed
    time = case.ago * law.step
    x_then = label - e * law.step * (elapsed - case.ago)
    z_then = case.slope * x_then
    bound = model.angle_sensor.error_bound(x_then / math.cos(math.atan(case.slope)))
    alpha = math.atan(case.slope) + case.angle_draw * bound

    executed = case.impulse * (1.0 + 0.02 * case.angle_draw) if case.ago else 0.0
    fired_after = (case.ago // 2) * law.step
    acceleration = case.push * law.disturbance
    v = case.v + acceleration * time - executed
    z = z_then + case.v * time + 0.5 * acceleration * time**2 - executed * (time - fired_after)
    x = label - e * law.step * elapsed
    omega = (v + e * z / x) / x / (1.0 + (z / x) ** 2)

    size = abs(case.impulse) if case.ago else 0.0
    return Truth(z_then, z, v, x, omega, LastSight(case.measured, alpha, 0.0, case.ago, size))


@settings(max_examples=300, deadline=None)
@given(RATE_CASES)
def test_a_rate_band_holds_the_truth_and_is_convex_over_its_window(case: RateCase) -> None:
    """The measured rate of a motion in closed form admits its predicted miss, displaced by (13),
    for every window.
    """
    model, law = flat_law(10.0**case.log_error, case.rising)
    e = law.closing_speed
    elapsed = 60 if case.measured else case.ago
    label = 4.2e5 + 1.5e5 * case.place
    near = label - 8e4 * case.width * case.place
    far = label + 8e4 * case.width * (1.0 - case.place)
    truth = truth_of(case, label, elapsed, model, law)
    farthest_v = abs(case.v) + truth.sight.fired + law.disturbance * case.ago * law.step
    if farthest_v > 300.0 or abs(truth.z_then) > 1e4:
        return

    window = windows.Window(near, far, case.impulse, abs(case.push), 0.0, 0.0)
    rate_error = RATE_ERROR * (1.0 + BOUND_SLACK)
    rate = windows.Rate(truth.omega + case.rate_draw * RATE_ERROR, rate_error, truth.sight)
    steepest = kernels.max_slope(elapsed, truth.sight, window, law)
    assert abs(truth.z / truth.x) <= steepest * (1.0 + 1e-12)

    def rate_band(label: float, window: windows.Window) -> tuple[float, float]:
        lower, upper = kernels.rate_band(label, elapsed, rate, 1.0 + steepest**2, window, law)
        return lower, upper

    lower, upper = rate_band(label, window)
    value = (
        truth.z
        + truth.v * truth.x / e
        + case.impulse * (label - 0.5 * (near + far)) / e
        + case.push * 0.5 * (far - near) / e
    )
    rounding = 1e-9 * (abs(value) + abs(lower) + abs(upper) + 1.0)
    assert lower - rounding <= value <= upper + rounding

    bounds = np.array([rate_band(each, window) for each in np.linspace(near, far, 9)])
    bend = np.diff(bounds, n=2, axis=0)
    assert (bend[:, 0] >= -rounding).all()
    assert (bend[:, 1] <= rounding).all()

    if case.ago == 0:
        # In a window of one label the band is as wide as the error of the sensor.
        alone = rate_band(label, window._replace(near=label, far=label))
        widest = 2.0 * (abs(rate.omega) * 0.01 + rate_error) * truth.x**2 / e
        assert alone[1] - alone[0] <= 1.01 * widest


def test_a_truth_inside_a_section_that_is_thinner_than_rounding_is_not_outside(
    asteroid: Scenario,
) -> None:
    """z and V are known exactly, and the bound of the acceleration makes the section 900 m wide and
    1e-14 m high.
    """
    step_s, range_m = 19.0, 2.5e6
    box = StateBox((0.0, 0.0), (range_m, 1.2 * range_m), (-0.1, -0.1), (-58.1e3, -57.9e3))
    model = SetModel(
        58e3,
        step_s,
        box,
        AngleSensor(step_s, 0.00015, 0.00023, 5.8e6),
        disturbance_m_s2=1.0,
        range_threshold_m=5e3,
    )
    scenario = replace(
        asteroid,
        sun=None,
        nominal_range_m=range_m,
        dispersion=box,
        **of_model(model),
        range_sensor=None,
    )
    assert sound(simulate(scenario, 50, seed=1))


def test_phi_covers_a_truth_that_passes_its_closest_approach_before_its_label_leaves(
    asteroid: Scenario,
) -> None:
    """An oblique, receding offset: the closest approach comes several steps before x = 0."""
    e, range_m = 1e4, 1e6
    box = StateBox((3e5, 5.5e5), (9e5, 1.1e6), (500.0, 1200.0), (-e, -e))
    dispersion = StateBox((4.95e5, 5.5e5), (1.09e6, 1.1e6), (1080.0, 1200.0), (-e, -e))
    # One angle only, at t = 0.
    sensor = AngleSensor(200.0, 1e-3, 1e-3, range_m)
    model = SetModel(e, 1.0, box, sensor, range_threshold_m=1e3, sections=11, fewest_sections=3)
    scenario = replace(
        asteroid,
        sun=None,
        nominal_range_m=range_m,
        dispersion=dispersion,
        **of_model(model),
        thruster=Thruster(0, 0.1, 1),
    )
    results = simulate(scenario, 8, seed=1)
    assert sound(results)
    assert (results.miss_m > 5e5).all()


@pytest.mark.parametrize(
    ("error_at_33_km_rad", "measured_rad", "impulse_m_s", "max_z_m"),
    [
        # Of the four labels and two more, the minimum would be behind x = 0 at this step.
        (2.3e-4, 2.07e-4, 4.0, 4.4),
        # The maximum would be beyond the range at which the error bound is zero.
        (2.3e-7, 1.61e-4, 0.0, 40.0),
    ],
)
def test_phi_is_extrapolated_from_labels_with_sections_only(
    error_at_33_km_rad: float, measured_rad: float, impulse_m_s: float, max_z_m: float
) -> None:
    """All labels leave at the first step: the misses after one angle and one impulse, at V_z = 0,
    by hand.

    At the range x the angle leaves z within x tan(alpha_m -+ b) and the start, the impulse moves z
    by -k x/e.
    """
    e = 58e3
    x_m = (5010.0, 33e3)
    error_rad = 2.3e-4
    box = StateBox((-max_z_m, max_z_m), x_m, (0.0, 0.0), (-e, -e))
    sensor = AngleSensor(0.5, error_at_33_km_rad, error_rad, x_m[1])
    model = SetModel(e, 0.5, box, sensor, range_threshold_m=5e3)
    information = InformationSet(model)
    information.measure_angle(measured_rad)
    information.shift(impulse_m_s)
    information.drop_below_threshold()
    x = np.linspace(*x_m, 10_001)
    bound = error_rad + (error_at_33_km_rad - error_rad) * x / x_m[1]
    minimum = np.maximum(x * np.tan(measured_rad - bound), -max_z_m) - impulse_m_s * x / e
    maximum = np.minimum(x * np.tan(measured_rad + bound), max_z_m) - impulse_m_s * x / e
    phi_m, exists = information.guaranteed_miss()
    assert exists.all()
    assert phi_m[0] >= max(maximum.max(), -minimum.min())


@pytest.mark.parametrize("max_z_m", [0.0, 0.5, 10.0])
def test_phi_of_an_exactly_known_range_and_speed(max_z_m: float) -> None:
    """The only label leaves after the angle at 1100 m, which leaves z within 1100 tan(1e-3); V_z is
    zero.

    Phi is greater by 4 ulp of the label, which is all of it if z is zero.
    """
    e = 1e3
    box = StateBox((-max_z_m, max_z_m), (2e4, 2e4), (0.0, 0.0), (-e, -e))
    sensor = AngleSensor(0.9, 1e-3, 1e-3, 2e4)
    model = SetModel(e, 0.9, box, sensor, range_threshold_m=500.0)
    information = InformationSet(model)
    while information.tracking.any():
        information.measure_angle(0.0)
        information.drop_below_threshold()
        information.predict()
    phi_m, exists = information.guaranteed_miss()
    assert exists.all()
    rounding_m = 4.0 * 2.0**-52 * 2e4
    assert phi_m[0] == pytest.approx(
        min(max_z_m, 1100.0 * math.tan(1e-3)) + rounding_m, rel=1e-6, abs=0.0
    )


def test_the_direction_of_an_impulse_is_uncertain_at_an_exactly_known_closing_speed() -> None:
    """An impulse of 10 m/s along y, turned by 0.1 rad at most, changes V_z by up to 10 sin(0.1)
    m/s.
    """
    box = StateBox((-1.0, 1.0), (1e4, 2e4), (0.0, 0.0), (-1e3, -1e3), (-1.0, 1.0), (0.0, 0.0))
    sensor = AngleSensor(1.0, 1e-3, 1e-3, 1e4)
    model = SetModel(1e3, 1.0, box, sensor, pointing_error_rad=0.1)
    information = InformationSet(model)
    information.shift([[10.0], [0.0]])
    for section in information.sections():
        changes_m_s = section.polygons[1].polygon()[:, 0]
        assert changes_m_s.max() >= 10.0 * math.sin(0.1)
        assert changes_m_s.min() <= -10.0 * math.sin(0.1)


def two_intervals(steps: int) -> tuple[SetModel, Floats, InformationSetView]:
    """Model, measured angles and last set of a flight with a bound that rises with range and the
    rectangle.
    """
    e, range_m = 20e3, 2.5e6
    generator = np.random.default_rng(170)
    step_s = float(generator.choice([1.0, 2.0, 5.0]))
    z_m = range_m * 10.0 ** generator.uniform(-3.0, -1.0)
    vz_m_s = e * 10.0 ** generator.uniform(-4.0, -2.0)
    error_rad = 10.0 ** generator.uniform(-4.0, -2.0)
    at_zero_rad = error_rad * generator.uniform(0.0, 0.3)
    box = StateBox(
        (-z_m, z_m), (0.95 * range_m, 1.05 * range_m), (-vz_m_s, vz_m_s), (-1.01 * e, -0.99 * e)
    )
    model = SetModel(
        e,
        step_s,
        box,
        AngleSensor(step_s, error_rad, at_zero_rad, range_m),
        range_threshold_m=1e4,
        fewest_sections=3,
        initial_set=InitialSet.RECTANGLE,
        model=Model.PAPER,
    )
    scenario = Scenario(
        name="",
        nominal_range_m=range_m,
        dispersion=box,
        **of_model(model),
        thruster=Thruster(0.0, 0.1, 1.0),
    )
    draws = draw(scenario, range(6), 170)
    signs = np.where(draws.errors["angle"] >= 0.0, 1.0, -1.0)
    flight = Engagements(scenario, draws, noise=RandomNoise({**draws.errors, "angle": signs}))
    views: list[InformationSetView] = []
    measured = []

    def look(step: Step) -> None:
        views.append(step.information)
        measured.append(step.measured["angle"])

    while flight.step < steps:
        flight.advance(look)
    return model, np.array(measured), views[-1]


@pytest.mark.parametrize("y", [None, "mirror of z", "bound that falls with range"])
def test_a_new_grid_takes_the_interval_of_its_stored_sections_and_keeps_the_limits(
    y: str | None,
) -> None:
    """Two intervals of feasible labels, at 2400 km and above 2560 km; the measurement of step 16
    empties the latter.
    """
    model, measured, _ = two_intervals(17)
    angles = measured[:, :, 2].T
    if y is not None:
        box = model.bounds
        sensor = model.angle_sensor
        if y == "bound that falls with range":
            sensor = replace(
                linear(sensor), error_at_nominal_range_y_rad=0.01, error_at_zero_range_y_rad=0.02
            )
        model = replace(
            model, bounds=replace(box, y_m=box.z_m, vy_m_s=box.vz_m_s), angle_sensor=sensor
        )
        angles = np.concatenate([-angles if y == "mirror of z" else 0.0 * angles, angles])

    def after(steps: int, sections: int) -> InformationSet:
        information = InformationSet(replace(model, sections=sections))
        for step in range(steps):
            if step > 0:
                information.predict()
            information.measure_angle(angles[:, [step]])
        for section in information.sections():
            replayed = information.section_at(section.label_m)
            np.testing.assert_array_equal(section.polygons.vertices, replayed.polygons.vertices)
        return information

    def is_feasible(information: InformationSet, label_m: float) -> bool:
        return not information.section_at(label_m).polygons.is_empty.any()

    def stored(information: InformationSet) -> Floats:
        return information.labels_m[information.feasible]

    # Many sections: both intervals are stored, and the set goes on with the one that empties later.
    many = after(16, 29)
    assert [is_feasible(many, label) for label in (2.4e6, 2.48e6, 2.59e6)] == [True, False, True]
    assert stored(many).min() < 2.41e6
    assert stored(many).max() > 2.55e6
    many = after(17, 29)
    assert not many.inconsistent.any()
    assert len(stored(many)) == 7
    assert ((stored(many) > 2.39e6) & (stored(many) < 2.41e6)).all()
    # Three sections: the new grid of step 12 takes the interval in which one is stored. The limits
    # still contain the other one, in which no section is stored. The set is empty, to the search,
    # when the first one is.
    few = after(16, 3)
    assert len(stored(few)) == 7
    assert stored(few).min() > 2.55e6
    assert is_feasible(few, 2.4e6)
    assert (few._state.lower_label[0], few._state.upper_label[0]) == model.label_limits_m
    assert after(17, 3).inconsistent.all()
