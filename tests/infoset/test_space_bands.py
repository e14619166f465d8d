"""Bands of the guaranteed model in space contain the truth, and are convex in the label."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from infoset import AngleSensor, Camera, InitialSet, Model, SetModel, StateBox
from infoset.arrays import Floats
from infoset.engine import section_life
from infoset.engine.section_law import section_laws
from infoset.sensors import OffsetCamera
from infoset.sensors.sensor import along_x_m
from tests.kernels import callable_kernels

EPS = float(np.finfo(np.float64).eps)
WIDE = (-1e7, 1e7)
SLOW = (-100.0, 100.0)
KNOWN = StateBox(WIDE, (5.3e6, 6.3e6), SLOW, (-59e3, -57e3), WIDE, SLOW)

slope_band = callable_kernels(section_life).slope_band
shares = st.floats(0.0, 1.0)
signed = st.floats(-1.0, 1.0)
bounds = st.one_of(st.floats(1e-6, 0.05), st.sampled_from([1e-9, 1e-4]))


@dataclass(frozen=True)
class Sight:
    """The line of sight of one engagement; the rates are not used."""

    alpha_rad: Floats
    range_m: Floats

    @property
    def omega_rad_s(self) -> Floats:
        return np.zeros_like(self.alpha_rad)

    @property
    def along_x_m(self) -> Floats:
        return along_x_m(self.alpha_rad, self.range_m)


def sight(x_m: float, angles: tuple[float, float]) -> Sight:
    alpha = np.array(angles)[:, None]
    return Sight(alpha, x_m * np.sqrt(1.0 + (np.tan(alpha) ** 2).sum(axis=0)))


def bands(
    model: SetModel, measured: Floats, elapsed_m: float
) -> Callable[[float], list[tuple[float, float]]]:
    """Return the bands of y/x and z/x of the engine as a function of the label."""
    y, z = measured[:, 0].tolist()
    law_y, law_z = section_laws(model)
    return lambda label: [
        slope_band(y, z, elapsed_m, label - elapsed_m, law_y),
        slope_band(z, y, elapsed_m, label - elapsed_m, law_z),
    ]


class Motion(NamedTuple):
    """A true line of sight, its closing speed, and the errors of a measurement."""

    angles: tuple[float, float]
    speed: float
    error: tuple[float, float]
    is_extremal: bool

    @property
    def errors(self) -> Floats:
        """Errors in units of the bound; extremal ones are corners of the box."""
        errors = np.array(self.error)[:, None]
        return np.where(errors < 0.0, -1.0, 1.0) if self.is_extremal else errors


motions = st.builds(
    Motion, st.tuples(signed, signed), signed, st.tuples(signed, signed), st.booleans()
)


@settings(deadline=None)
@given(
    bounds,
    bounds,
    st.none() | st.tuples(st.just(0.0) | bounds, st.just(0.0) | bounds),
    motions,
    shares,
    shares,
)
def test_bands_contain_the_truth_and_are_convex(
    at_nominal: float,
    at_zero: float,
    of_y: tuple[float, float] | None,
    motion: Motion,
    label_share: float,
    flown: float,
) -> None:
    sensor = AngleSensor(0.5, at_nominal, max(at_zero, 0.3 * at_nominal), 5.8e6)
    if of_y is not None:
        at_zero_y = max(of_y[1], 0.3 * of_y[0])
        sensor = replace(
            sensor, error_at_nominal_range_y_rad=of_y[0], error_at_zero_range_y_rad=at_zero_y
        )
    # The falling bound must be positive up to the maximum distance.
    if min(sensor.error_bounds(np.array([3e7]))[..., 0].min(), sensor.error_bound(3e7)) < 0.0:
        sensor = replace(sensor, nominal_range_m=5.8e7)
    model = SetModel(58e3, 0.5, KNOWN, sensor, initial_set=InitialSet.BOX, model=Model.GUARANTEED)
    minimum, maximum = model.label_limits_m
    label = minimum + label_share * (maximum - minimum)
    elapsed_m = 0.999 * flown * minimum
    x = label - elapsed_m
    true = sight(x * (1.0 + motion.speed * model.speed_error), motion.angles)
    contain_and_are_convex(model, true, motion.errors, label, elapsed_m)


@settings(deadline=None, max_examples=100)
@given(
    st.floats(-9.0, -1.0),
    st.floats(-2.0, 5.0),
    st.floats(0.0, 2.0),
    motions,
    st.floats(0.0, 0.5),
    shares,
    st.floats(-3.0, 0.0),
    shares,
)
def test_bands_of_a_camera_contain_the_truth_and_are_convex(
    pixel: float,
    centroid: float,
    threshold: float,
    motion: Motion,
    speed_error: float,
    label_share: float,
    far: float,
    near: float,
) -> None:
    """At all ranges from ten centroid errors up, with a closing speed known to 50 %.

    The bounds of both axes are reached.
    """
    sensor = Camera(0.5, 10.0**pixel, 10.0**centroid)
    threshold_m = 10.0 ** (centroid + 1.0 + threshold) * (1.0 + 1e-12)
    known = replace(KNOWN, vx_m_s=(-58e3 * (1.0 + speed_error), -58e3 * (1.0 - speed_error)))
    if threshold_m >= 5e6:
        return
    model = SetModel(
        58e3,
        0.5,
        known,
        sensor,
        range_threshold_m=threshold_m,
        initial_set=InitialSet.BOX,
        model=Model.GUARANTEED,
    )
    minimum, maximum = model.label_limits_m
    label = minimum + label_share * (maximum - minimum)
    # From the threshold to the start, many of them near the threshold.
    x = threshold_m + (label - threshold_m) * (10.0**far if near < 0.5 else 1e-9 * near)
    true = sight(x * (1.0 + motion.speed * model.speed_error), motion.angles)
    contain_and_are_convex(model, true, motion.errors, label, label - x)


@settings(deadline=None)
@given(
    st.floats(-8.0, -2.0),
    st.floats(0.0, 3.0),
    st.tuples(signed, signed),
    st.booleans(),
    motions,
    st.floats(0.0, 0.5),
    shares,
    st.floats(-3.0, 0.0),
)
def test_bands_with_an_offset_of_the_images_contain_the_truth_and_are_convex(
    pixel: float,
    length: float,
    offset: tuple[float, float],
    is_corrected: bool,
    motion: Motion,
    speed_error: float,
    label_share: float,
    far: float,
) -> None:
    """The images show a point beside the centre: (21')."""
    length_m = 10.0**length
    sensor = OffsetCamera(
        0.5,
        10.0**pixel,
        0.1 * length_m,
        phase_angle_rad=1.0,
        sun_angle_rad=0.0,
        phase_correction=is_corrected,
        offset_m=(length_m * offset[0], length_m * offset[1]),
    )
    threshold_m = 10.0 * sensor.farthest_m * (1.0 + 1e-12)
    known = replace(KNOWN, vx_m_s=(-58e3 * (1.0 + speed_error), -58e3 * (1.0 - speed_error)))
    model = SetModel(
        58e3,
        0.5,
        known,
        sensor,
        range_threshold_m=threshold_m,
        initial_set=InitialSet.BOX,
        model=Model.GUARANTEED,
    )
    minimum, maximum = model.label_limits_m
    label = minimum + label_share * (maximum - minimum)
    x = threshold_m + (label - threshold_m) * 10.0**far
    true = sight(x * (1.0 + motion.speed * model.speed_error), motion.angles)
    contain_and_are_convex(model, true, motion.errors, label, label - x)


def contain_and_are_convex(
    model: SetModel, true: Sight, errors: Floats, label: float, elapsed_m: float
) -> None:
    """Check that the band at the label contains the truth, and that bands are convex in it."""
    x = label - elapsed_m
    minimum, maximum = model.label_limits_m
    band = bands(model, model.angle_sensor.measured(true, errors), elapsed_m)
    for (lower, upper), slope in zip(band(label), np.tan(true.alpha_rad[:, 0]), strict=True):
        rounding = 64.0 * EPS * (1.0 + slope**2) * label / x
        assert lower - rounding <= slope <= upper + rounding

    labels = np.linspace(max(minimum, elapsed_m + model.min_range_m), maximum, 7)
    ranges = labels - elapsed_m
    heights = np.array([band(each) for each in labels.tolist()]) * ranges[:, None, None]
    if np.isfinite(heights).all():
        bend = np.diff(heights, n=2, axis=0)
        steepest = np.abs(heights / ranges[:, None, None]).max()
        rounding = 64.0 * EPS * maximum * (1.0 + steepest)
        assert bend[..., 0].min() >= -rounding
        assert bend[..., 1].max() <= rounding
