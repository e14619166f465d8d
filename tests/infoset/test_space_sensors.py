"""Sensors in space: two angles with their own errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from infoset import AngleSensor
from infoset.arrays import Floats

EPS = float(np.finfo(np.float64).eps)
SENSOR = AngleSensor(0.5, 0.00015, 0.00023, 5801.3e3)

angles = st.floats(-1.0, 1.0)
bounds = st.floats(1e-6, 0.2)
shares = st.floats(-1.0, 1.0)


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

    @property
    def along_x_m(self) -> Floats:
        return np.array([self.x_m])


places = st.builds(
    lambda x, y, z: Place(x, x * np.tan(y), x * np.tan(z)), st.floats(1e3, 7e6), angles, angles
)


@given(places, bounds, shares, shares, st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_error_of_a_measurement_is_recovered_and_the_nearest_is_possible(
    place: Place, bound: float, right: float, up: float, wanted_y: float, wanted_z: float
) -> None:
    sensor = AngleSensor(0.5, bound, bound, 1.0)
    rounding = 64.0 * EPS * (1.0 + 1.0 / bound)
    error = np.array([[right], [up]])
    wanted = np.array([[wanted_y], [wanted_z]])
    measured = sensor.measured(place, error)

    np.testing.assert_allclose(sensor.error(place, measured), error, atol=rounding)

    nearest = sensor.nearest(place, place.alpha_rad + bound * wanted)
    np.testing.assert_allclose(
        sensor.error(place, nearest), np.clip(wanted, -1.0, 1.0), atol=rounding
    )

    assume(np.abs(measured).max() + bound < 1.5)
    slopes = np.array([[place.y_m], [place.z_m]]) / place.x_m
    slack = 64.0 * EPS * (1.0 + slopes**2)

    assert (np.tan(measured - bound) - slack <= slopes).all()
    assert (slopes <= np.tan(measured + bound) + slack).all()


def test_error_bounds_of_the_two_axes_may_differ() -> None:
    one = replace(SENSOR, error_at_nominal_range_y_rad=0.0003, error_at_zero_range_y_rad=0.0)
    place = Place(2e6, 3e3, -4e3)
    expected = [0.0003 * place.range_m / 5801.3e3, SENSOR.error_bound(place.range_m)]

    np.testing.assert_allclose(one.bound(place), expected, rtol=1e-12)

    by_axis = np.array([[1e6, 2e6], [3e6, 4e6]])
    np.testing.assert_allclose(
        one.error_bounds(by_axis)[0], 0.0003 * by_axis[0] / 5801.3e3, rtol=1e-12
    )
    assert np.array_equal(one.error_bounds(by_axis)[1], SENSOR.error_bound(by_axis[1]))
    assert np.array_equal(SENSOR.error_bounds(by_axis), SENSOR.error_bound(by_axis))

    measured = one.measured(place, np.ones((2, 1)))
    assert np.array_equal(measured, place.alpha_rad + one.bound(place))


@given(shares, shares)
def test_axis_without_error_is_measured_exactly(right: float, up: float) -> None:
    one = replace(SENSOR, error_at_nominal_range_y_rad=0.0, error_at_zero_range_y_rad=0.0)
    for place in (Place(2e6, 3e3, -4e3), Place(2e6, 0.0, 0.0)):
        measured = one.measured(place, np.array([[right], [up]]))
        assert measured[0, 0] == place.alpha_rad[0, 0]
        assert np.array_equal(one.nearest(place, place.alpha_rad + 1e-3)[0], place.alpha_rad[0])
        assert one.error(place, measured)[0, 0] == 0.0
        assert one.error(place, measured + 1e-12)[0, 0] > 1e40
