"""Python's edge is as strict as the files': what is no sound value is refused with its name, in one
sentence.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import infoset
from infoset import (
    AngleSensor,
    Camera,
    ConvexPolygons,
    InformationSet,
    InitialSet,
    Model,
    RangeSensor,
    RateSensor,
    SetModel,
    SetSettings,
    StateBox,
)
from infoset.experiments import load_scenario
from infoset.guidance import (
    SymmetricMiss,
    Thruster,
)
from infoset.sim import (
    Body,
    Campaign,
    HitRequirement,
    Manoeuvre,
    QuantileName,
    Requirement,
    Scenario,
    StoppingRule,
    Sun,
    Target,
    fly_one,
    simulate,
)
from infoset.sim.adversary import find_worst

REFUSALS = (TypeError, ValueError)
NO_NUMBERS: tuple[Any, ...] = (
    math.nan,
    math.inf,
    -math.inf,
    1e300,
    1 + 1j,
    "1",
    True,
    [1.0],
    np.array([1.0, 2.0]),
    np.ma.masked,
    10**400,
)
NO_COUNTS: tuple[Any, ...] = (1.5, math.nan, "1", True, 2j, [1], -1)

BOX = StateBox((-1e3, 1e3), (5e6, 6e6), (-10.0, 10.0), (-5.9e4, -5.7e4))
SPACE_BOX = replace(BOX, y_m=(-2e3, 1e3), vy_m_s=(-20.0, 10.0))
SENSOR = AngleSensor(0.5, 1.5e-4, 2.3e-4, 5.8e6)
SPACE_SENSOR = replace(
    SENSOR,
    error_at_nominal_range_y_rad=1e-4,
    error_at_zero_range_y_rad=2e-4,
    first_image_s=80.0,
    last_image_s=2.0,
    miss_probability=0.1,
)
SETTINGS: dict[str, Any] = {
    "model": Model.GUARANTEED,
    "initial_set": InitialSet.BOX,
    "sections": 9,
    "fewest_sections": 3,
    "recovery": infoset.Recovery.WIDENED,
    "range_threshold_m": 5e3,
    "disturbance_m_s2": 0.005,
}
MODEL = SetModel(closing_speed_m_s=5.8e4, step_s=0.5, bounds=BOX, angle_sensor=SENSOR, **SETTINGS)
THRUSTER = Thruster(1e3, 0.25, 7.5, last_impulse_s=20.0, impulses_s=(60.0, 30.0), delay_steps=2)
SCENARIO = Scenario(
    name="edge",
    nominal_range_m=5.8e6,
    closing_speed_m_s=5.8e4,
    step_s=0.5,
    strategy="patient",
    uncertainty=BOX,
    dispersion=BOX,
    angle_sensor=SENSOR,
    thruster=THRUSTER,
    information_set=SetSettings(**SETTINGS),
)
SOUND: tuple[Any, ...] = (
    SPACE_SENSOR,
    Camera(0.5, 1e-6, 5.0),
    RangeSensor(0.5, 0.05),
    RateSensor(0.5, 1e-6),
    SPACE_BOX,
    replace(MODEL, bounds=SPACE_BOX, angle_sensor=SPACE_SENSOR, disturbance_y_m_s2=0.006),
    SetSettings(**SETTINGS, disturbance_y_m_s2=0.006),
    THRUSTER,
    Thruster(1e3, 0.25, 7.5, last_impulse_s=20.0, impulse_period_s=5.0, first_impulse_s=60.0),
    Sun(1.3e20, 1.5e11, 1.0, 0.5),
    Target(Manoeuvre.BANG_BANG, 0.1, 10.0, 0.2),
    Body(80.0),
    SCENARIO,
    QuantileName("miss_m", 0.9),
    StoppingRule(QuantileName("miss_m", 0.9), 1.0),
    HitRequirement(0.9),
    Requirement(QuantileName("miss_m", 0.9), 1.0),
)
ANY_SIGN = ("direction_rad", "elevation_rad")


def refused(call: Callable[[], object], name: str) -> None:
    """Check that a call is refused in a sentence that names the parameter, with no warning before
    it.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(REFUSALS) as found:
            call()
    message = str(found.value)
    assert name in message
    assert len(message) < 400
    assert message.isprintable()


@pytest.mark.parametrize("sound", SOUND, ids=lambda sound: type(sound).__name__)
def test_field_with_an_invalid_value_is_refused(sound: Any) -> None:
    for field in fields(sound):
        value = getattr(sound, field.name)
        bad = list[Any]()
        if value == ():
            bad = [1.0, "ab"]
        elif isinstance(value, tuple):
            bad = [1.0, "ab", value[::-1]]
            bad += [ends for each in NO_NUMBERS for ends in ((each, value[1]), (value[0], each))]
        elif isinstance(value, bool):
            bad = [None, 0, 1.0, "true"]
        elif isinstance(value, int):
            bad = [None, *NO_COUNTS]
        elif isinstance(value, float):
            bad = [*NO_NUMBERS, *([] if field.name in ANY_SIGN else [-1.0])]
        elif isinstance(value, str):
            bad = [None, 1.0, b"x"]
        elif value is not None:  # an enumeration, or another dataclass
            bad = ["paper", 1.0, object]
        for each in bad:
            refused(partial(replace, sound, **{field.name: each}), field.name)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda: AngleSensor(0.5, 0.00015, 1.0, 5.8e6), "error_at_zero_range_rad"),
        (lambda: replace(SENSOR, first_image_s=1.0, last_image_s=2.0), "first_image_s"),
        (lambda: replace(SENSOR, first_image_s=0.0), "first_image_s"),
        (lambda: replace(SENSOR, miss_probability=1.0), "miss_probability"),
        (lambda: Thruster(1e3, 8.0, 7.5), "min_impulse_m_s"),
        (lambda: Thruster(1e3, 0.0, 7.5, 1.0), "execution_error_relative"),
        (lambda: Thruster(1e3, 0.0, 7.5, impulses_s=(30.0, 30.0)), "impulses_s"),
        (
            lambda: replace(SCENARIO, thruster=replace(THRUSTER, last_impulse_s=61.0)),
            "last_impulse_s",
        ),
        (lambda: replace(SCENARIO, thruster=replace(THRUSTER, impulses_s=(99.5,))), "impulses_s"),
        (
            lambda: replace(SCENARIO, thruster=replace(THRUSTER, impulses_s=(30.0, 29.8))),
            "impulses_s",
        ),
        (lambda: replace(MODEL, sections=2), "sections"),
        (lambda: replace(MODEL, sections=10_001), "sections"),
        (lambda: replace(MODEL, range_threshold_m=5e6), "range_threshold_m"),
        (lambda: replace(MODEL, angle_sensor=AngleSensor(0.5, 1e-6, 0.1, 5.8e6)), "angle_sensor"),
        (lambda: InformationSet(replace(MODEL, gravity_speed_change=1.0)), "gravity_speed_change"),
        (lambda: replace(BOX, vx_m_s=(-1.0, 1.0)), "vx_m_s"),
        (lambda: replace(BOX, x_m=(0.0, 1.0)), "x_m"),
        (lambda: replace(MODEL, step_s=0.7), "angle_sensor.period_s"),
        (lambda: replace(SCENARIO, range_sensor=RangeSensor(0.7, 0.05)), "range_sensor.period_s"),
        (lambda: replace(SCENARIO, rate_sensor=RateSensor(0.2, 1e-6)), "rate_sensor.period_s"),
        (lambda: replace(SCENARIO, sun=Sun(1.3e20, 6e6, 0.0)), "sun.distance_m"),
        (lambda: replace(SCENARIO, dispersion=replace(BOX, x_m=(1.0, 2.0))), "dispersion"),
        (lambda: replace(SCENARIO, dispersion=replace(BOX, z_m=(0.0, 1e8))), "dispersion"),
        (lambda: StoppingRule(QuantileName("miss_m", 0.5), 1.0, 1.0), "confidence"),
        (lambda: QuantileName("fuel", 0.5), "fuel"),
    ],
)
def test_values_that_contradict_each_other_are_refused(
    change: Callable[[], object], name: str
) -> None:
    refused(change, name)


def information(batch: int = 2) -> InformationSet:
    return InformationSet(MODEL, batch)


NO_ARRAYS: tuple[Any, ...] = (
    math.nan,
    [0.0, math.inf],
    [1.0, 2.0, 3.0],
    np.zeros((2, 1)),
    [1j, 0.0],
    np.ma.masked_array([0.0, 0.0], [True, False]),
    "1",
    True,
    [True, False],
    None,
    [],
)


@pytest.mark.parametrize(
    ("operation", "name"),
    [
        (lambda given, value: given.measure_angle(value), "alpha_rad"),
        (lambda given, value: given.measure_range(value, 0.05), "range_m"),
        (lambda given, value: given.measure_rate(value, 1e-6), "omega_rad_s"),
        (lambda given, value: given.shift(value), "impulse_m_s"),
        (
            lambda given, value: given.measure_range(
                5.5e6, 0.05, alpha_rad=[] if value is None else value
            ),
            "alpha_rad",
        ),
    ],
)
def test_invalid_measurement_or_impulse_is_refused(
    operation: Callable[[Any, Any], object], name: str
) -> None:
    for value in NO_ARRAYS:
        refused(partial(operation, information(), value), name)


@pytest.mark.parametrize("value", [*NO_NUMBERS, -1e-9])
def test_invalid_error_bound_is_refused(value: Any) -> None:
    refused(lambda: information().measure_range(5.5e6, value), "relative_error")
    refused(lambda: information().measure_rate(0.0, value), "error_rad_s")
    refused(lambda: information().measure_range(5.5e6, 1.0), "relative_error")
    refused(lambda: information().measure_range(-1.0, 0.05), "range_m")


@pytest.mark.parametrize("value", NO_COUNTS)
def test_invalid_count_is_refused(value: Any) -> None:
    scenario = load_scenario("asteroid-1997")
    refused(lambda: information(value), "batch")
    refused(lambda: information().sections(value), "engagement")
    refused(lambda: information().section_at(5.5e6, value), "engagement")
    refused(lambda: square().reduce_outward(value), "cap")
    refused(lambda: fly_one(scenario, value), "run")
    refused(lambda: fly_one(scenario, seed=value), "seed")
    refused(lambda: simulate(scenario, 1, seed=value), "seed")
    if value != [1]:
        refused(lambda: simulate(scenario, value), "run")
    for name in ("budget", "seed", "threads"):
        refused(partial(find_worst, scenario, **{name: value}), name)
    for name in ("runs", "chunk", "seed"):
        numbers = {"runs": 4, "chunk": 2, "seed": 0, name: value}
        refused(partial(Campaign, scenario, folder="runs", **numbers), name)


def square() -> ConvexPolygons:
    return ConvexPolygons.from_box((0.0, 0.0), (1.0, 1.0))


NO_POINTS = (
    [1j, 0.0],
    np.ma.masked_array([0.0, 1.0], [True, False]),
    ["a", "b"],
    [math.nan, 0.0],
    [0.0],
    [True, False],
)


@pytest.mark.parametrize("value", NO_POINTS)
def test_invalid_point_of_a_polygon_is_refused(value: Any) -> None:
    polygon = square()
    several = value[None] if isinstance(value, np.ndarray) else [value]
    refused(lambda: ConvexPolygons(several, 1), "vertices")
    refused(lambda: ConvexPolygons.from_points(several), "points")
    refused(lambda: polygon.cut(value, 0.0), "normal")
    refused(lambda: polygon.translate(value), "offset")
    refused(lambda: polygon.add_segment(value), "half")
    refused(lambda: polygon.support_function(value), "direction")
    refused(lambda: polygon.margin(value), "point")
    refused(lambda: polygon.contains(value), "point")
    if len(several[0]) == 2:
        refused(lambda: polygon.linear_map(several), "matrix")


class Returns:
    """A strategy, or a noise, that returns what it is given from its second step on."""

    def __init__(self, value: Any) -> None:
        self.value = value

    def start(self, shape: tuple[int, int]) -> None:
        pass

    def decide(self, situation: Any, state: None) -> Any:
        return np.zeros((1, 1)) if situation.step == 0 else self.value

    def measure(self, sight: Any, predicted: Any) -> Any:
        honest = {"angle": sight.alpha_rad}
        return (
            honest if sight.step == 0 else self.value(sight) if callable(self.value) else self.value
        )


@pytest.mark.parametrize(
    "wanted",
    [
        None,
        0.5,
        [0.5],
        [[0.5, 0.5]],
        [[math.nan]],
        [[-math.inf]],
        [[0.5j]],
        np.ma.masked_array([[0.5]], [[True]]),
        np.ma.masked_array([[0.5]], [[False]]),
        [["0.5"]],
        [[True]],
    ],
)
def test_invalid_impulses_of_a_strategy_are_refused(wanted: Any, brief: Scenario) -> None:
    refused(
        lambda: simulate(brief, 1, strategy=Returns(wanted)),
        "strategy Returns must return finite impulses",
    )


@pytest.mark.parametrize(
    ("measured", "name"),
    [
        (None, "must return a mapping"),
        (0.001, "must return a mapping"),
        ({"angle": None}, "angle"),
        ({"angle": 0.0}, "angle must be an array of the shape (1, 1): got 0.0"),
        ({"angle": np.array([[math.nan]])}, "angle"),
        ({"angle": np.array([[0.0, 0.0]])}, "angle"),
        ({"angle": np.array([[1j]])}, "angle"),
        ({"angle": np.ma.masked_array([[0.0]], [[True]])}, "angle"),
        (
            lambda sight: {"angle": sight.alpha_rad, "range": sight.range_m},
            "sensor 'range' does not measure",
        ),
        (
            lambda sight: {"angle": sight.alpha_rad, "rate": sight.omega_rad_s},
            "sensor 'rate' does not measure",
        ),
    ],
)
def test_invalid_measurements_of_a_noise_are_refused(
    measured: Any, name: str, brief: Scenario
) -> None:
    refused(lambda: fly_one(brief, noise=Returns(measured)), name)


def test_noise_is_called_for_sensors_that_are_due_only(brief: Scenario) -> None:
    step_s = brief.set_model.step_s
    scenario = replace(
        brief, range_sensor=RangeSensor(2 * step_s, 0.05), rate_sensor=RateSensor(3 * step_s, 1e-4)
    )

    class Honest:
        def measure(self, sight: Any, predicted: Any) -> Any:
            assert ("range" in sight.sensors, "rate" in sight.sensors) == (
                sight.step % 2 == 0,
                sight.step % 3 == 0,
            )
            return {name: sensor.true_value(sight) for name, sensor in sight.sensors.items()}

    record = fly_one(scenario, noise=Honest(), strategy=SymmetricMiss())
    for number in np.flatnonzero(record.measures("angle")).tolist():
        assert record.measures("range")[number] == (number % 2 == 0)
        assert record.measures("rate")[number] == (number % 3 == 0)
    always = replace(scenario, rate_sensor=None)
    both = Returns(lambda sight: {"angle": sight.alpha_rad, "range": sight.range_m})
    refused(
        lambda: fly_one(always, noise=both),
        "sensor 'range' does not measure at this step, only ['angle']",
    )
