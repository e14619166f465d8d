"""Misses that images of a camera leave possible: closed forms without disturbance, for a known range and speed."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np

from infoset import SetModel
from infoset.arrays import Floats
from sim.scenario import Scenario

FloatOrFloats = TypeVar("FloatOrFloats", float, Floats)


def possible_miss_m(
    closing_speed_m_s: float,
    pixel_error_rad: FloatOrFloats,
    centroid_error_m: float,
    first_image_s: float,
    last_image_s: FloatOrFloats,
    *,
    constant_bias: bool = False,
) -> FloatOrFloats:
    """Return half the greatest width of the interval of misses along one axis that images leave possible, m.

    It is also the greatest miss after an impulse that centres this interval exactly. With the closing speed e, the
    pixel error beta, the centroid error c, and the times t_f and t_c before the arrival of the first and the last
    image, s, it is 2 beta e t_c/(1 - t_c/t_f) + c (1 + t_c/t_f)/(1 - t_c/t_f). With `constant_bias` the second term is
    c: the interval is that of a set that knows that the centroid error is constant, which the information set does not
    know. docs/guarantee.md contains the proof (Lemma 17).
    """
    share = last_image_s / first_image_s
    of_pixels = 2.0 * pixel_error_rad * closing_speed_m_s * last_image_s / (1.0 - share)
    if constant_bias:
        return of_pixels + centroid_error_m
    return of_pixels + centroid_error_m * (1.0 + share) / (1.0 - share)


def _images_s(scenario: Scenario) -> list[float]:
    """Return the times before the nominal arrival of the images until the last decision of an impulse, s."""
    model, thruster, arrival_s = scenario.set_model, scenario.thruster, scenario.nominal_arrival_s
    steps = scenario.impulse_steps
    end_s = arrival_s - model.least_range_m / model.closing_speed_m_s
    last_step = int(end_s / model.step_s) if steps is None else int(max(steps))
    camera = model.angle_sensor
    before_s = (
        arrival_s - step * model.step_s
        for step in range(0, last_step - thruster.delay_steps + 1, model.steps_in(camera.period_s))
    )
    return [time_s for time_s in before_s if camera.measures_at(time_s)]


def images_s(scenario: Scenario) -> tuple[float, float]:
    """Return the times before the arrival of the first image and of the last one before the last decision, s.

    A ValueError is raised if there are fewer than two such images.
    """
    before_s = _images_s(scenario)
    if len(before_s) < 2:
        raise ValueError("a bound of the miss needs two images before the last impulse: take more images, or earlier")
    return before_s[0], before_s[-1]


def worst_shift_m(scenario: Scenario) -> Floats | None:
    """Return how far game noise shifts the measured position across x in each step, m; in space by axis, (2, steps).

    None without a cut-off or times of impulses, or with fewer than two images before the last decision.

    Two motions with the same images differ by at most 2 b along an axis at each image, with the error bound b, m. Let
    this difference be 2 b0 at the last image before the last decision, and 2 b0 - s u + nu u^2 at the time u before it:
    the disturbance nu accelerates the motions apart. It is at least -2 b at all images if s is at most
    (2 b0 + 2 b)/u + nu u, and its speed is possible at t = 0 if s is at most 2 w + 2 nu t, with the half-width w of the
    speeds of the initial set and the time t of the last image. With the greatest s the misses differ most; before its
    least value, at u = s/(2 nu), the difference is constant. If one of the motions is the true one, images in the
    middle of both are shifted by half the difference.
    """
    model = scenario.set_model
    if scenario.impulse_steps is None:
        return None
    before_s = np.array(_images_s(scenario))
    if before_s.size < 2:
        return None
    shifts_m = [_worst_shift_along_m(model.axis(name), before_s, scenario.nominal_arrival_s) for name in model.axes]
    return np.stack(shifts_m) if scenario.is_spatial else shifts_m[0]


def _worst_shift_along_m(model: SetModel, before_s: Floats, arrival_s: float) -> Floats:
    """Return `worst_shift_m` in the planar model of one axis, for images at these times before the arrival, s."""
    range_m = before_s * model.closing_speed_m_s
    bound_m, last_s = model.angle_sensor.error_bound(range_m) * range_m, before_s[-1]
    earlier_s, disturbance, (least, greatest) = before_s[:-1] - last_s, model.disturbance_m_s2, model.bounds.vz_m_s
    speed_m_s = min(
        np.min(2.0 * (bound_m[-1] + bound_m[:-1]) / earlier_s + disturbance * earlier_s),
        greatest - least + 2.0 * disturbance * (arrival_s - last_s),
    )
    times_s = arrival_s - last_s - model.step_s * np.arange(math.ceil((arrival_s - last_s) / model.step_s) + 1)
    times_s = np.clip(times_s, 0.0, 0.5 * speed_m_s / disturbance if disturbance else None)
    return np.asarray(bound_m[-1] - 0.5 * speed_m_s * times_s + 0.5 * disturbance * times_s**2, dtype=np.float64)


def possible_miss_of(scenario: Scenario) -> float:
    """Return `possible_miss_m` of the camera and the last impulse of a scenario, m: in space that of both axes at once.

    A ValueError is raised if the angle sensor is not a camera, images can be lost, or there are fewer than two images
    before the last impulse.
    """
    camera = scenario.set_model.angle_sensor
    if camera.centroid_error_m is None:
        raise ValueError("the closed form is that of a camera: set angle_sensor.pixel_error_rad and centroid_error_m")
    if camera.miss_probability > 0.0:
        raise ValueError(
            "the closed form is that of a camera that loses no image: set angle_sensor.miss_probability = 0"
        )
    first_s, last_s = images_s(scenario)
    speed_m_s, axes = scenario.set_model.closing_speed_m_s, len(scenario.set_model.axes)
    along_one = possible_miss_m(speed_m_s, camera.pixel_error_rad, camera.centroid_error_m, first_s, last_s)
    return math.sqrt(axes) * along_one
