"""Misses that images of a camera leave possible: closed forms without disturbance, for a known range and speed."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sim.scenario import Scenario

FloatOrFloats = TypeVar("FloatOrFloats", float, NDArray[np.float64])


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

    It is also the greatest miss after an impulse that centres this interval exactly.

    Parameters
    ----------
    closing_speed_m_s, pixel_error_rad, centroid_error_m : float
        Closing speed e, pixel error beta and centroid error c.
    first_image_s, last_image_s : float
        Times t_f and t_c before the arrival of the first and the last image, s.
    constant_bias : bool
        Whether the interval is that of a set that knows that the centroid error is constant. The information set does
        not know it.

    Notes
    -----
    2 beta e t_c/(1 - t_c/t_f) + c (1 + t_c/t_f)/(1 - t_c/t_f); with a known constant bias the second term is c.
    docs/guarantee.md contains the proof (Lemma 17).
    """
    share = last_image_s / first_image_s
    of_pixels = 2.0 * pixel_error_rad * closing_speed_m_s * last_image_s / (1.0 - share)
    if constant_bias:
        return of_pixels + centroid_error_m
    return of_pixels + centroid_error_m * (1.0 + share) / (1.0 - share)


def images_s(scenario: Scenario) -> tuple[float, float]:
    """Return the times before the arrival of the first image and of the last one before the last decision, s.

    Raises
    ------
    ValueError
        If there are fewer than two such images.
    """
    model, thruster, arrival_s = scenario.set_model, scenario.thruster, scenario.nominal_arrival_s
    steps = thruster.impulse_steps(arrival_s, model.step_s)
    end_s = arrival_s - model.least_range_m / model.closing_speed_m_s
    last_step = int(end_s / model.step_s) if steps is None else int(max(steps))
    camera = model.angle_sensor
    before_s = [
        arrival_s - step * model.step_s
        for step in range(0, last_step - thruster.delay_steps + 1, model.steps_in(camera.period_s))
    ]
    before_s = [time_s for time_s in before_s if camera.measures_at(time_s)]
    if len(before_s) < 2:
        raise ValueError("a bound of the miss needs two images before the last impulse: take more images, or earlier")
    return before_s[0], before_s[-1]


def possible_miss_of(scenario: Scenario) -> float:
    """Return `possible_miss_m` of the camera and the last impulse of a scenario, m: in space that of both axes at once.

    Raises
    ------
    ValueError
        If the angle sensor is not a camera, or there are fewer than two images before the last impulse.
    """
    camera = scenario.set_model.angle_sensor
    if camera.centroid_error_m is None:
        raise ValueError("the closed form is that of a camera: set angle_sensor.pixel_error_rad and centroid_error_m")
    first_s, last_s = images_s(scenario)
    speed_m_s, axes = scenario.set_model.closing_speed_m_s, len(scenario.set_model.axes)
    along_one = possible_miss_m(speed_m_s, camera.pixel_error_rad, camera.centroid_error_m, first_s, last_s)
    return math.sqrt(axes) * along_one
