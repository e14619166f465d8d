"""Misses that images of a camera leave possible, in closed form, for a known range and speed."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from infoset.arrays import Floats
from infoset.model import SetModel
from infoset.sensors import Camera
from infoset.sim.scenario import Scenario
from infoset.sim.schedule import image_times_s

FloatOrFloats = TypeVar("FloatOrFloats", float, Floats)


def possible_miss_m(
    closing_speed_m_s: float,
    pixel_error_rad: FloatOrFloats,
    centroid_error_m: float,
    first_image_s: float,
    last_image_s: FloatOrFloats,
    *,
    disturbance_m_s2: float = 0.0,
    constant_bias: bool = False,
) -> FloatOrFloats:
    """Return half the maximum width of the interval of misses that images leave possible, m.

    The misses are along one axis. The result is also the maximum miss after an impulse that centres
    this interval exactly.

    Parameters
    ----------
    closing_speed_m_s, pixel_error_rad, centroid_error_m : float
        e, p and c: at the distance d the error bound of an image is p + c / d.
    first_image_s, last_image_s : float
        t_f and t_c, times before the arrival of the first image and of the last one until the
        decision of the last impulse, s.
    disturbance_m_s2 : float
        Bound nu of the acceleration of the target along the axis, m/s^2.
    constant_bias : bool
        Whether the centroid error is one constant of the flight. The result is then for a set that
        uses this; the information set does not.

    Raises
    ------
    ValueError
        If the first image is not before the last one.

    Notes
    -----
    The bound of the last image is b0 = p e t_c + c. The miss is, by Lemma 17 of
    docs/guarantee-space.md,

        2 p e t_c + c + 2 t_c sqrt(nu b0) + nu t_c^2 / 2   if 2 sqrt(b0 / nu) <= t_f - t_c,
        b0 + (2 b0 / u + p e + nu u / 2) t_c + nu t_c^2 / 2   with u = t_f - t_c otherwise.

    A constant centroid error is the same difference c at all images: b0 is then p e t_c, and c is
    added to the miss.
    """
    arc_s = first_image_s - last_image_s
    if np.any(arc_s <= 0.0):
        raise ValueError(
            f"the first image, {first_image_s:g} s before the arrival, must be before the last "
            "image"
        )

    of_pixel_m_s = pixel_error_rad * closing_speed_m_s
    bound_m = of_pixel_m_s * last_image_s + (0.0 if constant_bias else centroid_error_m)
    # s of `worst_shift_m`, which is a difference of two motions: twice the slopes of the Notes.
    slope_m_s: Any = 2.0 * of_pixel_m_s + np.where(
        4.0 * bound_m <= disturbance_m_s2 * arc_s**2,
        4.0 * np.sqrt(disturbance_m_s2 * bound_m),
        4.0 * bound_m / arc_s + disturbance_m_s2 * arc_s,
    )
    constant_m = centroid_error_m if constant_bias else 0.0
    difference_m = constant_m + bound_m
    miss_m: FloatOrFloats = _at_arrival_m(difference_m, slope_m_s, last_image_s, disturbance_m_s2)
    return miss_m


def _at_arrival_m(bound_m: Any, speed_m_s: Any, last_s: Any, disturbance_m_s2: float) -> Any:
    """Return M of equation (22), m, from b0 and s at the last image, at `last_s`."""
    return bound_m + 0.5 * last_s * (speed_m_s + disturbance_m_s2 * last_s)


@dataclass(frozen=True)
class PossibleMiss:
    """Half the maximum width of the interval of misses at the last decision, m.

    Both values are for errors of images at their bounds, no lost image, and a known range and
    closing speed; in space they are for both axes at once. If q images may be wrong
    (`SetModel.wrong_images`), the last 2q images before this decision are left out.

    Parameters
    ----------
    images_m : float or None
        By the images alone, as if they were taken at all times from the first to the last one: the
        closed form of `possible_miss_of`. None if the sensor of angles is not a camera or loses
        images.
    images_and_speeds_m : float
        By the images at their own times and the speeds across that the initial set allows.
    """

    images_m: float | None
    images_and_speeds_m: float


def possible_miss(scenario: Scenario) -> PossibleMiss | None:
    """Return the misses that are possible at the last decision.

    None means that fewer than two images limit them.
    """
    images_s = _limiting_images_s(scenario)
    if images_s.size < 2:
        return None

    camera = scenario.bearing_sensor
    has_closed_form = isinstance(camera, Camera) and camera.miss_probability == 0.0
    images_m = possible_miss_of(scenario) if has_closed_form else None
    return PossibleMiss(images_m, _images_and_speeds_m(scenario, images_s))


def _limiting_images_s(scenario: Scenario) -> Floats:
    """Return the times before the nominal arrival, s, decreasing, of the images that limit the miss
    after the last decision: all until it, one in its step included, except the last 2q.

    If q images may be wrong, two motions agree with the same measurements although they differ at
    2q images; it is worst if these are the last ones (Lemma 20b of docs/guarantee-bound.md).
    """
    images_s = np.array(image_times_s(scenario))
    left_out = 2 * scenario.set_model.wrong_images
    return images_s[: max(0, len(images_s) - left_out)]


def _images_and_speeds_m(scenario: Scenario, images_s: Floats) -> float:
    """Return half the distance at the arrival of two motions as in `worst_shift_m`, m.

    `images_s` limit their difference. In space it is half the distance across both axes.
    """
    model = scenario.set_model
    misses_m = []
    for axis in map(model.axis, model.axes):
        bound_m, speed_m_s = _worst_difference(axis, images_s, scenario.nominal_arrival_s)
        misses_m.append(_at_arrival_m(bound_m, speed_m_s, images_s[-1], axis.disturbance_m_s2))
    return math.hypot(*misses_m)


def worst_shift_m(scenario: Scenario) -> Floats | None:
    """Return the shift of the measured position across x by game noise, m, shape (C, steps).

    The steps are from t = 0 to the last image until the last decision. None without a cut-off or
    times of impulses, or with fewer than two such images. All these images count, also if some may
    be wrong.

    Two motions with the same images differ by at most 2 b along an axis at each image, with the
    error bound b, m. Let this difference be 2 b0 at the last image before the last decision, and 2
    b0 - s u + nu u^2 at the time u before it: the disturbance nu accelerates the motions apart. It
    is at least -2 b at all images if s is at most (2 b0 + 2 b)/u + nu u, and its speed is possible
    at t = 0 if s is at most 2 w + 2 nu t, with the half-width w of the speeds of the initial set
    and the time t of the last image. With the maximum s the misses differ most; before its minimum
    value, at u = s/(2 nu), the difference is constant. If one of the motions is the true one,
    images in the middle of both are shifted by half the difference.
    """
    model = scenario.set_model
    if scenario.impulse_steps is None:
        return None
    images_s = np.array(image_times_s(scenario))
    if images_s.size < 2:
        return None

    shifts_m = [
        _worst_shift_along_m(model.axis(name), images_s, scenario.nominal_arrival_s)
        for name in model.axes
    ]
    return np.stack(shifts_m)


def _worst_difference(model: SetModel, images_s: Floats, arrival_s: float) -> tuple[float, float]:
    """Return b0, m, and the maximum s, m/s, of `worst_shift_m` in the planar model of one axis.

    `images_s`, times of at least two images before the arrival, decrease.
    """
    range_m = images_s * model.closing_speed_m_s
    bound_m = model.angle_sensor.error_bound(range_m) * range_m
    # The last image, and the times of the others before it.
    last_s = images_s[-1]
    earlier_s = images_s[:-1] - last_s
    disturbance = model.disturbance_m_s2
    minimum, maximum = model.seen_bounds.vz_m_s
    by_images_m_s = np.min(2.0 * (bound_m[-1] + bound_m[:-1]) / earlier_s + disturbance * earlier_s)
    by_start_m_s = maximum - minimum + 2.0 * disturbance * (arrival_s - last_s)
    return bound_m[-1], min(by_images_m_s, by_start_m_s)


def _worst_shift_along_m(model: SetModel, images_s: Floats, arrival_s: float) -> Floats:
    """Return `worst_shift_m` in the planar model of one axis, shape (steps,).

    `images_s` are the times of images before the arrival, s.
    """
    bound_m, speed_m_s = _worst_difference(model, images_s, arrival_s)
    disturbance = model.disturbance_m_s2
    last_s = images_s[-1]

    # Times before the last image, up to the minimum of the difference; without a disturbance it has
    # none. After the last image the time is zero.
    steps = np.arange(math.ceil((arrival_s - last_s) / model.step_s) + 1)
    times_s = arrival_s - last_s - model.step_s * steps
    of_minimum_s = 0.5 * speed_m_s / disturbance if disturbance else None
    times_s = np.clip(times_s, 0.0, of_minimum_s)
    return np.asarray(
        bound_m - 0.5 * speed_m_s * times_s + 0.5 * disturbance * times_s**2, dtype=np.float64
    )


def possible_miss_of(scenario: Scenario, *, constant_bias: bool = False) -> float:
    """Return `possible_miss_m` of the camera and the last impulse of a scenario, m.

    In space it is the miss across both axes. It uses the images until the last decision
    (`image_times_s`), without the last 2q if q images may be wrong, and nothing about the start:
    the set on board is smaller if the speeds across are known well from the start
    (`PossibleMiss.images_and_speeds_m`, which ``infoset scenarios check`` prints too).

    The disturbance is `set_model.disturbance_m_s2` of each axis; `constant_bias` is an argument of
    `possible_miss_m`.

    Raises
    ------
    ValueError
        If the angle sensor is not a camera, images can be lost, or there are fewer than two images
        until the decision of the last impulse.
    """
    model = scenario.set_model
    camera = model.angle_sensor
    if not isinstance(camera, Camera):
        raise ValueError(
            "the closed form is that of a camera: the scenario must have the table camera"
        )
    if camera.miss_probability > 0.0:
        raise ValueError(
            "the closed form is that of a camera that loses no image: set camera.miss_probability "
            "= 0"
        )
    images_s = _limiting_images_s(scenario)
    if images_s.size < 2:
        raise ValueError(
            f"a bound of the miss needs at least {2 + 2 * model.wrong_images} images until the "
            "decision of the last impulse: take more images, or earlier"
        )
    along = (
        possible_miss_m(
            model.closing_speed_m_s,
            axis.angle_sensor.constant_error_rad,
            axis.angle_sensor.centroid_bound_m,
            float(images_s[0]),
            float(images_s[-1]),
            disturbance_m_s2=axis.disturbance_m_s2,
            constant_bias=constant_bias,
        )
        for axis in map(model.axis, model.axes)
    )
    return math.hypot(*along)
