"""A camera: misses that its images leave possible, constant bias, first and last image, lost
images.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

from infoset import AngleSensor, Bias, Camera, InformationSet, InitialSet, Model, SetModel, StateBox
from infoset.arrays import Floats
from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind, Thruster, TieRule
from infoset.sim import Record, Results, Scenario, fly_one, simulate
from infoset.sim.bound.lower_bound import lower_bound, pair_at
from infoset.sim.bound.pair_flight import fly_pair
from infoset.sim.closed_form import possible_miss_m, possible_miss_of
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements, Step
from infoset.sim.scenario import of_model
from infoset.sim.schedule import image_times_s

SPEED_M_S, PIXEL_RAD, CENTROID_M = 6140.0, 5e-6, 12.0
FIRST_S, LAST_S, EVERY_S = 3600.0, 300.0, 30.0


def camera_scenario(**fields: Any) -> Scenario:
    """Return an engagement of one hour in a plane, with a camera that has some `fields`."""
    law = {"centroid_error_m": CENTROID_M, **fields}
    camera = Camera(EVERY_S, PIXEL_RAD, **law)
    box = StateBox(
        (-1e4, 1e4), (3590.0 * SPEED_M_S, 3610.0 * SPEED_M_S), (-2.0, 2.0), (-6141.0, -6139.0)
    )
    model = SetModel(
        SPEED_M_S, EVERY_S / 2, box, camera, range_threshold_m=1e3, sections=5, fewest_sections=3
    )
    return Scenario(
        name="camera",
        nominal_range_m=3600.0 * SPEED_M_S,
        dispersion=box,
        **of_model(model),
        thruster=Thruster(20.0, 0.001, 0.5),
    )


def in_space(scenario: Scenario, **fields: Any) -> Scenario:
    """Return the scenario in space, with fields of the angle sensor."""
    model = scenario.set_model
    box = replace(scenario.dispersion, y_m=(-8e3, 9e3), vy_m_s=(-1.0, 2.0))
    model = replace(model, bounds=box, angle_sensor=replace(model.angle_sensor, **fields))
    return replace(scenario, dispersion=box, **of_model(model))


def widest_m(
    measured: Floats, times_s: Floats, pixel: float, centroid_m: float, constant: bool
) -> float:
    """Return half the width of the interval of misses m that agree with measured z/x, by two linear
    programs.

    z = m + s t at the time t before the arrival; with a constant bias, its share of the centroid
    error is a variable.
    """
    x = SPEED_M_S * times_s
    bound = pixel * x + (0.0 if constant else centroid_m)
    # Variables: m, s FIRST_S and the bias, m.
    rows = np.stack([np.ones_like(x), times_s / FIRST_S, np.full_like(x, float(constant))], axis=1)
    matrix = np.concatenate([rows, -rows])
    most = np.concatenate([measured * x + bound, bound - measured * x])
    scale = 1.0 / np.abs(np.concatenate([x, x]))
    ends = []
    for sign in (1.0, -1.0):
        solved = linprog(
            [sign, 0.0, 0.0],
            A_ub=matrix * scale[:, None] * 1e6,
            b_ub=most * scale * 1e6,
            bounds=[(None, None), (None, None), (-centroid_m, centroid_m)],
        )
        assert solved.status == 0, solved.message
        ends.append(solved.x[0])
    return 0.5 * float(ends[1] - ends[0])


@pytest.mark.parametrize("constant", [False, True])
@pytest.mark.parametrize(
    "last_s",
    [30.0, 1200.0, *(pytest.param(each, marks=pytest.mark.thorough) for each in (300.0, 3000.0))],
)
@pytest.mark.parametrize("centroid_m", [0.0, 3.0, 50.0])
def test_possible_miss_equals_the_result_of_linear_programs(
    last_s: float, centroid_m: float, constant: bool
) -> None:
    """Exact measurements reach the closed form, and no admissible ones exceed it."""
    times_s = np.linspace(FIRST_S, last_s, 40)
    expected = possible_miss_m(
        SPEED_M_S, PIXEL_RAD, centroid_m, FIRST_S, last_s, constant_bias=constant
    )
    exact = widest_m(np.zeros(40), times_s, PIXEL_RAD, centroid_m, constant)
    assert exact == pytest.approx(expected, rel=1e-6)
    random = np.random.default_rng(7)
    for _ in range(5):
        share = random.uniform(-1.0, 1.0, 40) * (1.0 if random.uniform() < 0.5 else 0.0)
        bias = random.uniform(-1.0, 1.0) if constant else random.uniform(-1.0, 1.0, 40)
        errors = share * PIXEL_RAD + bias * centroid_m / (SPEED_M_S * times_s)
        assert widest_m(errors, times_s, PIXEL_RAD, centroid_m, constant) <= expected * (1.0 + 1e-6)


def widest_with_disturbance_m(
    times_s: Floats, pixel: float, centroid_m: float, disturbance_m_s2: float, constant: bool
) -> float:
    """Return the maximum miss that agrees with images of zero at these times before the arrival, by
    a linear program.

    Variables: z and V_z at the first image, the bias, and the acceleration between neighbouring
    images and up to the arrival, each in a unit that makes the coefficients about 1.
    """
    events_s = np.append(times_s, 0.0)
    since_s = events_s[0] - events_s
    lasting_s = -np.diff(events_s)
    middle_s = since_s[:-1] + 0.5 * lasting_s
    ahead_s = np.maximum(
        since_s[:, None] - middle_s, 0.0
    )  # constant over a step: the impulse acts from its middle
    steps = np.tril(ahead_s * lasting_s, -1) / since_s[-1] ** 2
    of_bias = np.append(np.full(times_s.size, float(constant)), 0.0)
    z = np.column_stack([np.ones_like(since_s), since_s / since_s[-1], of_bias, steps])
    bound = pixel * SPEED_M_S * times_s + (0.0 if constant else centroid_m)
    most = disturbance_m_s2 * since_s[-1] ** 2
    limits = [
        (None, None),
        (None, None),
        (-centroid_m, centroid_m),
        *[(-most, most)] * lasting_s.size,
    ]
    images = np.concatenate([z[:-1], -z[:-1]])
    solved = linprog(-z[-1], A_ub=images, b_ub=np.concatenate([bound, bound]), bounds=limits)
    assert solved.status == 0, solved.message
    return float(-solved.fun)


@pytest.mark.parametrize("constant", [False, True])
@pytest.mark.parametrize(
    ("disturbance_m_s2", "last_s", "centroid_m", "pixel"),
    [
        (0.0, 300.0, 12.0, PIXEL_RAD),
        (1e-7, 300.0, 12.0, PIXEL_RAD),  # the arc is shorter than the best one
        (2.7e-5, 3000.0, 12.0, PIXEL_RAD),
        (1e-3, 3300.0, 3.0, PIXEL_RAD),
        (2.7e-5, 150.0, 12.0, PIXEL_RAD),
        (2.7e-5, 900.0, 12.0, PIXEL_RAD),
        (1e-3, 900.0, 0.0, PIXEL_RAD),
        (2.7e-5, 900.0, 12.0, 1e-6),
    ],
)
def test_possible_miss_with_a_disturbance_equals_the_result_of_a_linear_program(
    disturbance_m_s2: float, last_s: float, centroid_m: float, pixel: float, constant: bool
) -> None:
    """400 images in place of a continuous arc leave at most 0.3 % more."""
    times_s = np.linspace(FIRST_S, last_s, 400)
    found = widest_with_disturbance_m(times_s, pixel, centroid_m, disturbance_m_s2, constant)
    expected = possible_miss_m(
        *(SPEED_M_S, pixel, centroid_m, FIRST_S, last_s),
        disturbance_m_s2=disturbance_m_s2,
        constant_bias=constant,
    )
    assert expected * (1.0 - 3e-3) <= found <= expected * (1.0 + 3e-3)


@pytest.mark.parametrize(
    ("cut_off_s", "changing_m", "constant_m"), [(150, 37.2, 33.6), (900, 197.5, 186.3)]
)
def test_possible_misses_of_dart_equal_the_bounds_of_pairs(
    cut_off_s: float, changing_m: float, constant_m: float
) -> None:
    """The program of the pair at the nominal range is another way to the same number."""
    scenario = load_scenario("dart-2022", [f"thruster.last_impulse_s={cut_off_s}"])
    assert possible_miss_of(scenario) == pytest.approx(changing_m, abs=0.05)
    assert possible_miss_of(scenario, constant_bias=True) == pytest.approx(constant_m, abs=0.05)
    pair = pair_at(scenario, scenario.nominal_range_m, -scenario.set_model.closing_speed_m_s)
    assert possible_miss_of(scenario) == pytest.approx(pair.bound_m, rel=1e-4)


def measured_set(centroid_m: float, alpha_rad: Callable[[float], float]) -> InformationSet:
    """Return the set after images from `FIRST_S` to `LAST_S`, with known range and speed and no
    disturbance.
    """
    camera = Camera(EVERY_S, PIXEL_RAD, centroid_m)
    at_start = (FIRST_S * SPEED_M_S, FIRST_S * SPEED_M_S)
    box = StateBox((-1e6, 1e6), at_start, (-1e3, 1e3), (-SPEED_M_S, -SPEED_M_S))
    threshold_m = max(1e3, 10.0 * centroid_m)
    model = SetModel(
        SPEED_M_S,
        EVERY_S,
        box,
        camera,
        range_threshold_m=threshold_m,
        sections=1,
        fewest_sections=1,
    )
    information = InformationSet(model)
    while True:
        before_s = FIRST_S - information.time_s
        information.measure_angle(alpha_rad(before_s))
        if before_s <= LAST_S:
            return information
        information.predict()


@pytest.mark.parametrize("centroid_m", [0.0, 12.0, 100.0])
def test_width_of_the_set_equals_the_possible_misses(centroid_m: float) -> None:
    """Exact images reach the closed form; images with errors at their bounds do not exceed it."""
    expected = possible_miss_m(SPEED_M_S, PIXEL_RAD, centroid_m, FIRST_S, LAST_S)

    def interval(alpha_rad: Callable[[float], float]) -> tuple[float, float]:
        miss = measured_set(centroid_m, alpha_rad).predicted_miss()
        return miss.lower_m.item(), miss.upper_m.item()

    lower, upper = interval(lambda before_s: 0.0)
    assert upper == pytest.approx(-lower)
    assert expected * (1.0 - 1e-9) <= upper <= (1.0 + 1e-5) * expected
    bound = Camera(EVERY_S, PIXEL_RAD, centroid_m).error_bound
    random = np.random.default_rng(3)
    for _ in range(5):
        lower, upper = interval(
            lambda before_s: random.choice([-1.0, 1.0]) * bound(before_s * SPEED_M_S)
        )
        assert 0.5 * (upper - lower) <= (1.0 + 1e-5) * expected
        assert lower <= 0.0 <= upper


def test_closed_form_of_a_scenario_uses_schedule_delay_and_images() -> None:
    scenario = camera_scenario(first_image_s=2400.0, last_image_s=60.0)
    late = replace(
        scenario, thruster=replace(scenario.thruster, last_impulse_s=300.0, delay_steps=3)
    )
    for each, last_s in ((scenario, 60.0), (late, 360.0)):
        first, *_, last = image_times_s(each)
        assert (first, last) == pytest.approx((2400.0, last_s))
    expected = possible_miss_m(SPEED_M_S, PIXEL_RAD, CENTROID_M, 2400.0, 360.0)
    assert possible_miss_of(late) == pytest.approx(expected)
    assert possible_miss_of(in_space(late)) == pytest.approx(math.sqrt(2.0) * expected)
    with pytest.raises(ValueError, match="at least 2 images"):
        possible_miss_of(replace(late, thruster=replace(late.thruster, last_impulse_s=2400.0)))
    line = replace(late.set_model, angle_sensor=AngleSensor(EVERY_S, 1e-5, 2e-5, 3e7))
    with pytest.raises(ValueError, match="camera"):
        possible_miss_of(replace(late, **of_model(line)))


def sound(results: Results) -> bool:
    return bool(
        results.truth_kept.all() and results.phi_held.all() and not results.phi_held.mask.any()
    )


@pytest.mark.parametrize("noise", NoiseKind)
@pytest.mark.parametrize(
    "fields",
    [
        pytest.param({}, marks=pytest.mark.thorough),
        pytest.param({"bias": Bias.CONSTANT}, marks=pytest.mark.thorough),
        {"miss_probability": 0.5, "first_image_s": 2400.0, "last_image_s": 90.0},
        {"bias": Bias.CONSTANT, "miss_probability": 0.2},
    ],
)
def test_engagements_with_a_camera_keep_the_truth_and_the_bound(
    noise: NoiseKind, fields: dict[str, Any]
) -> None:
    plane = replace(camera_scenario(), noise=noise, tie=TieRule.RANDOM)
    model = replace(plane.set_model, angle_sensor=replace(plane.set_model.angle_sensor, **fields))
    assert sound(simulate(replace(plane, **of_model(model)), 16))
    assert sound(simulate(in_space(plane, **fields), 16))


@pytest.mark.parametrize("last_s", [300.0, 900.0])
@pytest.mark.parametrize("spatial", [False, True])
def test_phi_with_the_last_impulse_at_the_last_image_is_the_possible_miss(
    last_s: float, spatial: bool
) -> None:
    """Images reach from the start to the cut-off, so Phi is at most the closed form, up to the
    range's uncertainty.
    """
    scenario = camera_scenario(last_image_s=last_s)
    thruster = Thruster(20.0, 0.0, 5.0, last_impulse_s=last_s)
    scenario = replace(scenario, thruster=thruster, noise=NoiseKind.GAME)
    scenario = in_space(scenario) if spatial else scenario
    results = simulate(scenario, 8)
    assert sound(results)
    phi = results.guaranteed_miss_m.compressed()
    # A label may arrive 10 s later than the nominal one, and the bands are up to 1 % wider at the
    # threshold.
    assert phi.max() <= 1.08 * possible_miss_of(scenario)
    assert phi.max() >= 0.5 * possible_miss_of(scenario)


def test_a_camera_without_centroid_error_is_the_line_with_equal_errors(asteroid: Scenario) -> None:
    """Bit for bit, in both models."""
    for kind in Model:
        initial = InitialSet.BOX if kind is Model.GUARANTEED else InitialSet.RECTANGLE
        model = replace(asteroid.set_model, model=kind, initial_set=initial)
        line = AngleSensor(0.5, 2e-4, 2e-4, 5801.3e3)
        camera = Camera(0.5, 2e-4)
        first, second = (
            simulate(
                replace(
                    asteroid, noise=NoiseKind.GAME, **of_model(replace(model, angle_sensor=sensor))
                ),
                5,
            )
            for sensor in (line, camera)
        )
        assert first.miss_m.tolist() == second.miss_m.tolist()
        assert first.guaranteed_miss_m.tolist() == second.guaranteed_miss_m.tolist()


def steps_of(scenario: Scenario, runs: int = 6, seed: int = 2) -> list[Step]:
    draws = draw(scenario, range(runs), seed)
    flight = Engagements(scenario, draws)
    steps = list[Step]()
    while flight.flying:
        flight.advance(steps.append)
    return steps


@pytest.mark.parametrize("spatial", [False, True])
def test_a_constant_bias_is_a_constant_length(spatial: bool) -> None:
    """The error at the distance d is pixel times a draw of the image plus centroid/d times the draw
    of the run.
    """
    scenario = camera_scenario(bias=Bias.CONSTANT)
    scenario = in_space(scenario) if spatial else scenario
    steps = steps_of(scenario)
    draws = draw(scenario, range(6), 2)
    assert draws.bias is not None
    assert np.unique(draws.bias).size == draws.bias.size
    assert np.abs(draws.bias).max() <= 1.0
    for step in steps[:-10]:
        if "angle" in step.measured:
            error = step.measured["angle"] - step.sight.alpha_rad
            pixel = PIXEL_RAD * draws.errors["angle"][..., step.step]
            assert error == pytest.approx(
                pixel + CENTROID_M / step.sight.range_m * draws.bias, rel=1e-6, abs=1e-15
            )


def test_images_are_taken_from_the_first_to_the_last_and_measured_from_then_on() -> None:
    scenario = camera_scenario(first_image_s=1800.0, last_image_s=600.0)
    record = fly_one(scenario)
    times_s = record.time_s[record.measures("angle")].tolist()
    assert times_s == np.arange(1800.0, 3000.1, EVERY_S).tolist()
    assert np.isnan(record.truth_margin_m[0])
    # The period begins at t = 0, whatever the first image is.
    odd = fly_one(camera_scenario(first_image_s=1786.0, last_image_s=614.0))
    assert odd.time_s[odd.measures("angle")].tolist() == times_s
    later = fly_one(camera_scenario(first_image_s=1784.0, last_image_s=615.0))
    assert later.time_s[later.measures("angle")].tolist() == times_s[1:-1]


def test_lost_image_is_nan_in_the_record_and_does_not_cut_the_set() -> None:
    scenario = camera_scenario(miss_probability=0.4)
    record: Record = fly_one(scenario, 3)
    images = draw(scenario, [3], 0).images
    assert images is not None
    taken_s = record.time_s[:230][record.measures("angle")[:230]]
    assert taken_s.tolist() == [
        step * EVERY_S / 2 for step in range(0, 230, 2) if images[0, step] >= 0.4
    ]


@pytest.mark.parametrize("centroid_m", [CENTROID_M, 60.0])
def test_pairs_of_the_lower_bound_stay_within_the_bounds_of_a_camera(centroid_m: float) -> None:
    """The two motions have the same images until the cut-off of the images, and at least one misses
    by the bound.
    """
    scenario = camera_scenario(centroid_error_m=centroid_m, last_image_s=300.0)
    bound = lower_bound(scenario)
    assert bound.bound_m > 0.0
    flown = fly_pair(scenario, bound.pair)
    assert flown.max_error_share <= 1.0
    assert flown.results.miss_m.max() >= bound.bound_m * (1.0 - 1e-6)
    if centroid_m == CENTROID_M:
        # Images beyond the last one tell no more: the bound is not less without the limit of time.
        assert bound.bound_m >= lower_bound(camera_scenario()).bound_m * (1.0 - 1e-6)


@pytest.mark.parametrize("centroid_m", [0.0, CENTROID_M, 60.0])
@pytest.mark.parametrize("delay_steps", [0, 2])
def test_extremal_errors_reach_the_possible_miss_with_any_strategy(
    centroid_m: float, delay_steps: int
) -> None:
    """With a cut-off, two motions with the same images until the last decision miss by the closed
    form and by Phi.
    """
    scenario = camera_scenario(centroid_error_m=centroid_m)
    at_start = (3600.0 * SPEED_M_S,) * 2
    box = replace(scenario.dispersion, x_m=at_start, vx_m_s=(-SPEED_M_S, -SPEED_M_S))
    scenario = replace(
        scenario,
        dispersion=box,
        **of_model(replace(scenario.set_model, bounds=box)),
        thruster=Thruster(20.0, 0.0, 5.0, last_impulse_s=300.0, delay_steps=delay_steps),
    )
    expected = possible_miss_of(scenario)
    bound = lower_bound(scenario)
    assert bound.bound_m == pytest.approx(expected, rel=1e-4)
    flown = fly_pair(scenario, bound.pair)
    assert flown.max_error_share <= 1.0
    phi = flown.results.guaranteed_miss_m.max()
    assert expected * (1.0 - 1e-4) <= flown.results.miss_m.max() <= phi <= expected * (1.0 + 1e-4)
