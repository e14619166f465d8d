"""Sensors in space: conventions of the angles, shapes of the error, and the bands that a measurement leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from infoset import AngleSensor, Convention, ErrorShape, ExtremePoints, PredictedMiss, RangeSensor, RateSensor
from infoset.arrays import Floats

EPS = float(np.finfo(np.float64).eps)
SENSOR = AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3)
KINDS = [
    (Convention.PLANE, ErrorShape.BOX),
    (Convention.PLANE, ErrorShape.DISC),
    (Convention.GIMBAL, ErrorShape.BOX),
    (Convention.GIMBAL, ErrorShape.DISC),
    (Convention.CONE, None),
]

kinds = st.sampled_from(KINDS)
angles = st.floats(-1.0, 1.0)
bounds = st.floats(1e-6, 0.2)
shares = st.floats(-1.0, 1.0)
ranges = st.floats(1e3, 7e6)


@dataclass(frozen=True)
class Place:
    """One engagement with the object at a position."""

    x_m: float
    y_m: float
    z_m: float

    @property
    def alpha_rad(self) -> Floats:
        return np.arctan2([[self.y_m], [self.z_m]], self.x_m)

    @property
    def omega_rad_s(self) -> Floats:
        return np.array([[1e-6], [-2e-6]])

    @property
    def range_m(self) -> Floats:
        return np.array([np.hypot(self.x_m, np.hypot(self.y_m, self.z_m))])


places = st.builds(lambda x, y, z: Place(x, x * np.tan(y), x * np.tan(z)), ranges, angles, angles)


def sensor(kind: tuple[Convention, ErrorShape | None], bound: float | None = None) -> AngleSensor:
    """Sensor with a constant bound, or the one of 1997."""
    law = SENSOR if bound is None else AngleSensor(0.5, bound, bound, 1.0)
    return replace(law, convention=kind[0], error_shape=kind[1])


def possible(of: AngleSensor, right: float, up: float) -> Floats:
    return of.limited(np.array([[right], [up]]))


def swapped(place: Place) -> Place:
    return Place(place.x_m, place.z_m, place.y_m)


def separation(place: Place, measured: Floats) -> float:
    """Angle between the true direction and plane angles ahead, rad."""
    true, other = np.array([place.x_m, place.y_m, place.z_m]), np.array([1.0, *np.tan(measured[:, 0])])
    return float(np.arctan2(np.linalg.norm(np.cross(true, other)), true @ other))


def rounding(bound: float) -> float:
    """Rounding of angles below a right angle, in units of the bound."""
    return 64.0 * EPS * (1.0 + 1.0 / bound)


@given(kinds, places, bounds, shares, shares)
def test_the_error_of_a_measurement_is_the_one_that_made_it(
    kind: Any, place: Place, bound: float, right: float, up: float
) -> None:
    one = sensor(kind, bound)
    error = possible(one, right, up)
    np.testing.assert_allclose(one.error(place, one.measured(place, error)), error, atol=rounding(bound))


@given(places, shares, shares)
def test_errors_of_1997_are_found_to_rounding_at_small_angles(place: Place, right: float, up: float) -> None:
    near = Place(place.x_m, 1e-3 * place.y_m, 1e-3 * place.z_m)
    for kind in KINDS:
        one = sensor(kind)
        assume(float(one.bound(near)[0]) > 1e-4)
        error = possible(one, right, up)
        np.testing.assert_allclose(one.error(near, one.measured(near, error)), error, atol=1e-13)


@pytest.mark.parametrize("kind", KINDS)
def test_without_an_error_the_true_value_is_measured(kind: Any) -> None:
    one, place = sensor(kind), Place(3e6, -2e6, 1e6)
    np.testing.assert_allclose(one.measured(place, np.zeros((2, 1))), one.true_value(place), rtol=4 * EPS)
    np.testing.assert_allclose(one.measured(place, 0.0), one.true_value(place), rtol=4 * EPS)
    np.testing.assert_allclose(one.error(place, one.true_value(place)), 0.0, atol=1e-11)


@given(places, bounds, shares, shares)
def test_a_cone_is_the_directions_within_the_bound(place: Place, bound: float, right: float, up: float) -> None:
    cone = sensor((Convention.CONE, None), bound)
    error = possible(cone, right, up)
    measured = cone.measured(place, error)
    assume(np.abs(measured).max() < 1.5)  # ahead
    size = float(np.hypot(*error)[0])
    assert separation(place, measured) == pytest.approx(bound * size, abs=32.0 * EPS)
    assert separation(place, measured) <= bound + 32.0 * EPS
    if size > 1e-3:
        border = cone.measured(place, error / size)
        assert separation(place, border) == pytest.approx(bound, abs=32.0 * EPS)


@given(places, bounds, angles, angles)
def test_every_direction_within_the_bound_can_be_measured(place: Place, bound: float, y: float, z: float) -> None:
    cone = sensor((Convention.CONE, None), bound)
    wanted = place.alpha_rad + bound * np.array([[y], [z]])
    assume(np.abs(wanted).max() < 1.4)
    error = cone.error(place, wanted)
    assert float(np.hypot(*error)[0]) == pytest.approx(separation(place, wanted) / bound, abs=rounding(bound))
    # Also outside of the cone, the error is the one that makes the measurement.
    np.testing.assert_allclose(cone.measured(place, error), wanted, atol=64.0 * EPS)


@given(angles, angles, ranges, st.booleans())
def test_gimbal_angles_are_azimuth_and_elevation(y: float, z: float, distance: float, behind: bool) -> None:
    place = Place(-distance if behind else distance, distance * np.tan(y), distance * np.tan(z))
    gimbal = sensor((Convention.GIMBAL, None))
    azimuth, elevation = gimbal.true_value(place)
    assert azimuth[0] == np.arctan2(place.y_m, place.x_m)
    assert elevation[0] == pytest.approx(np.arctan2(place.z_m, np.hypot(place.x_m, place.y_m)), rel=1e-14, abs=EPS)
    plane = gimbal.plane_angles(np.array([azimuth, elevation]))
    # The sign of zero decides between pi and -pi.
    np.testing.assert_allclose(np.tan(plane), np.tan(place.alpha_rad), rtol=1e-13, atol=4 * EPS)
    assert (np.cos(plane) > 0.0).all() != behind


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind[0] is not Convention.GIMBAL])
def test_plane_angles_of_other_conventions_are_the_measured_ones(kind: Any) -> None:
    one, alpha = sensor(kind), np.array([[0.1, -0.4], [0.3, 0.2]])
    assert one.plane_angles(alpha) is alpha
    assert one.of_plane_angles(alpha) is alpha


@given(kinds, places, bounds, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_the_nearest_measurement_is_possible_and_the_wanted_one_if_that_is(
    kind: Any, place: Place, bound: float, right: float, up: float
) -> None:
    one = sensor(kind, bound)
    wanted = place.alpha_rad + bound * np.array([[right], [up]])
    assume(np.abs(wanted).max() < 1.4)
    nearest = one.nearest(place, wanted)
    error, asked = one.error(place, nearest), one.error(place, one.of_plane_angles(wanted))
    size = np.hypot if one.is_disc else np.maximum
    assert float(size(*np.abs(error))[0]) <= 1.0 + rounding(bound)
    np.testing.assert_allclose(error, one.limited(asked), atol=rounding(bound))
    if float(size(*np.abs(asked))[0]) <= 1.0 - rounding(bound):
        assert np.array_equal(nearest, one.of_plane_angles(wanted))


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), shares, shares)
def test_the_limited_error_is_the_nearest_possible_one(right: float, up: float, other: float, another: float) -> None:
    error = np.array([[right], [up]])
    for kind in KINDS:
        one = sensor(kind)
        limited, any_other = one.limited(error), possible(one, other, another)
        assert np.linalg.norm(limited - error) <= np.linalg.norm(any_other - error) + 1e-12
        assert np.array_equal(limited, error) == (
            float((np.hypot if one.is_disc else np.maximum)(*np.abs(error))[0]) <= 1
        )


@given(st.sampled_from([kind for kind in KINDS if kind[0] is not Convention.GIMBAL]), places, bounds, shares, shares)
def test_exchanged_axes_are_measured_exchanged_bit_for_bit(
    kind: Any, place: Place, bound: float, right: float, up: float
) -> None:
    one = sensor(kind, bound)
    error = possible(one, right, up)
    measured = one.measured(place, error)
    assert np.array_equal(one.measured(swapped(place), error[::-1]), measured[::-1])
    assert np.array_equal(one.error(swapped(place), measured[::-1]), one.error(place, measured)[::-1])
    wanted = place.alpha_rad + 2.0 * bound * error
    assert np.array_equal(one.nearest(swapped(place), wanted[::-1]), one.nearest(place, wanted)[::-1])


@given(kinds, places, bounds, shares, shares, st.sampled_from([(-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)]))
def test_mirrored_axes_are_measured_mirrored_bit_for_bit(
    kind: Any, place: Place, bound: float, right: float, up: float, signs: tuple[float, float]
) -> None:
    one, flip = sensor(kind, bound), np.array(signs)[:, None]
    mirrored = Place(place.x_m, signs[0] * place.y_m, signs[1] * place.z_m)
    error = possible(one, right, up)
    measured = one.measured(place, error)
    assert np.array_equal(one.measured(mirrored, flip * error), flip * measured)
    assert np.array_equal(one.error(mirrored, flip * measured), flip * one.error(place, measured))
    wanted = place.alpha_rad + 2.0 * bound * error
    assert np.array_equal(one.nearest(mirrored, flip * wanted), flip * one.nearest(place, wanted))


@given(ranges, angles, shares, st.floats(-2.0, 2.0))
def test_in_the_plane_the_angle_of_z_is_the_planar_one(x: float, alpha: float, error: float, beyond: float) -> None:
    place = Place(x, 0.0, x * np.tan(alpha))
    planar = ExtremePoints(place.alpha_rad[1], place.omega_rad_s[1], place.range_m)
    expected, bound = SENSOR.measured(planar, np.array([error])), SENSOR.bound(planar)
    wanted = planar.alpha_rad + beyond * bound
    spatial = np.array([[0.0], [error]]), np.array([[0.0], wanted])
    for kind in KINDS:
        one = sensor(kind)
        measured, nearest = one.measured(place, spatial[0]), one.nearest(place, spatial[1])
        assert measured[0, 0] == nearest[0, 0] == 0.0
        np.testing.assert_allclose(measured[1], expected, rtol=4 * EPS, atol=EPS * 1e-3)
        np.testing.assert_allclose(nearest[1], SENSOR.nearest(planar, wanted), rtol=4 * EPS, atol=EPS * 1e-3)
    plane = sensor((Convention.PLANE, ErrorShape.BOX))
    assert np.array_equal(plane.measured(place, spatial[0])[1], expected)
    assert np.array_equal(plane.error(place, plane.measured(place, spatial[0]))[1], SENSOR.error(planar, expected))
    assert np.array_equal(plane.nearest(place, spatial[1])[1], SENSOR.nearest(planar, wanted))


def test_a_planar_angle_is_clipped() -> None:
    planar, wanted = ExtremePoints(np.array([1e-3]), np.zeros(1), np.array([3e6])), np.array([0.2])
    assert SENSOR.nearest(planar, wanted) == 1e-3 + SENSOR.error_bound(3e6)
    assert RateSensor(0.5, 1e-6).nearest(planar, wanted) == 1e-6


def test_bounds_that_differ_by_axis() -> None:
    one = replace(SENSOR, error_at_nominal_range_y_rad=0.0003, error_at_zero_range_y_rad=0.0)
    place = Place(2e6, 3e3, -4e3)
    expected = [0.0003 * place.range_m / 5801.3e3, SENSOR.error_bound(place.range_m)]
    np.testing.assert_allclose(one.bound(place), expected, rtol=1e-12)
    by_axis = np.array([[1e6, 2e6], [3e6, 4e6]])
    np.testing.assert_allclose(one.error_bounds(by_axis)[0], 0.0003 * by_axis[0] / 5801.3e3, rtol=1e-12)
    assert np.array_equal(one.error_bounds(by_axis)[1], SENSOR.error_bound(by_axis[1]))
    assert np.array_equal(SENSOR.error_bounds(by_axis), SENSOR.error_bound(by_axis))
    measured = one.measured(place, np.ones((2, 1)))
    assert np.array_equal(measured, place.alpha_rad + one.bound(place))


@given(kinds, shares, shares)
def test_an_axis_without_error_is_measured_exactly(kind: Any, right: float, up: float) -> None:
    assume(kind[0] is not Convention.CONE and kind[1] is ErrorShape.BOX)
    one = replace(sensor(kind), error_at_nominal_range_y_rad=0.0, error_at_zero_range_y_rad=0.0)
    for place in (Place(2e6, 3e3, -4e3), Place(2e6, 0.0, 0.0)):
        measured = one.measured(place, np.array([[right], [up]]))
        assert measured[0, 0] == one.true_value(place)[0, 0]
        assert np.array_equal(one.nearest(place, place.alpha_rad + 1e-3)[0], one.true_value(place)[0])
        assert one.error(place, measured)[0, 0] == 0.0
        assert one.error(place, measured + 1e-12)[0, 0] > 1e40


def test_range_and_rate_in_space() -> None:
    place = Place(2e6, 3e3, -4e3)
    meter, rate = RangeSensor(0.5, 0.05), RateSensor(0.5, 1e-6)
    assert meter.measured(place, np.array([0.5])).shape == (1,)
    error = np.array([[0.5], [-1.0]])
    measured = rate.measured(place, error)
    assert np.array_equal(measured, place.omega_rad_s + 1e-6 * error)
    np.testing.assert_allclose(rate.error(place, measured), error, rtol=1e-9)
    assert np.array_equal(rate.nearest(place, place.omega_rad_s + 1.0), place.omega_rad_s + 1e-6)


def bands(kind: Convention, measured: Floats, bound: float) -> Floats:
    """Slopes y/x and z/x that agree with a measurement, shape (2 axes, 2 ends): section 1 of the theory."""
    first, second = measured[:, 0]
    if kind is Convention.CONE:
        half = [np.arcsin(np.sin(bound) / np.cos(other)) for other in (second, first)]
        return np.tan([[angle - width, angle + width] for angle, width in zip((first, second), half, strict=True)])
    if kind is Convention.PLANE:
        return np.tan([[angle - bound, angle + bound] for angle in (first, second)])
    lower, upper = np.tan([second - bound, second + bound])
    # |azimuth| cannot be negative: the theory's minimum |azimuth_m| - b is at least zero.
    minimum, maximum = 1.0 / np.cos(max(abs(first) - bound, 0.0)), 1.0 / np.cos(abs(first) + bound)
    elevation = [lower * (maximum if lower < 0.0 else minimum), upper * (maximum if upper > 0.0 else minimum)]
    return np.array([np.tan([first - bound, first + bound]), elevation])


def outside(place: Place, band: Floats) -> float:
    """How far the true slopes are outside of the bands, relative to 1 + slope^2, the scale of their rounding."""
    slopes = np.array([place.y_m, place.z_m]) / place.x_m
    return float((np.maximum(band[:, 0] - slopes, slopes - band[:, 1]) / (1.0 + slopes**2)).max())


@given(kinds, places, bounds, shares, shares, st.booleans())
def test_the_bands_of_a_measurement_contain_the_truth(
    kind: Any, place: Place, bound: float, right: float, up: float, extremal: bool
) -> None:
    one = sensor(kind, bound)
    error = np.array([[right], [up]])
    if extremal:
        error = np.where(error < 0.0, -1.0, 1.0) if not one.is_disc else error / max(float(np.hypot(*error)[0]), 1e-3)
    measured = one.measured(place, one.limited(error))
    assume(np.abs(measured).max() + bound < 1.5)
    if kind[0] is Convention.CONE:
        assume(np.sin(bound) < 0.99 * np.cos(np.abs(measured).max()))
    assert outside(place, bands(kind[0], measured, bound)) <= 64.0 * EPS


@pytest.mark.parametrize("convention", [Convention.GIMBAL, Convention.CONE])
def test_with_the_bands_of_plane_angles_true_states_are_outside(convention: Convention) -> None:
    """The bands of each convention are needed, at the angles of 1997 too."""
    one, random, maximum, lost = sensor((convention, None)), np.random.default_rng(3), 0.0, 0
    for _ in range(300):
        place = Place(5.8e6, *random.uniform(-10e3, 10e3, 2))
        bound = float(one.bound(place)[0])
        error = random.choice([-1.0, 1.0], (2, 1))
        if one.is_disc:
            error *= random.permutation([[0.0], [1.0]])
        measured = one.measured(place, error)
        beyond = outside(place, bands(Convention.PLANE, one.plane_angles(measured), bound)) * place.x_m
        assert outside(place, bands(convention, measured, bound)) * place.x_m <= 1e-9
        lost, maximum = lost + (beyond > 1e-9), max(maximum, beyond)
    assert lost > 20
    assert 1e-6 < maximum < 1e-2  # m: of second order, and not to be left out


def test_the_interval_of_one_axis() -> None:
    numbers = np.arange(16.0).reshape(8, 2, 1)
    whole = PredictedMiss(
        np.array([True]), numbers[0], numbers[1], ExtremePoints(*numbers[2:5]), ExtremePoints(*numbers[5:8])
    )
    for number in range(2):
        part = whole.axis(number)
        assert np.array_equal(part.exists, whole.exists)
        assert np.array_equal(part.upper_m, numbers[1, number])
        assert np.array_equal(part.lower_point.omega_rad_s, numbers[3, number])
        assert np.array_equal(part.upper_point.range_m, numbers[7, number])
