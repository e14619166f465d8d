from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from infoset.rendezvous.two_body import OrbitalElements, conic_shape, perigee_m, semi_major_axis_m

MU = 398600.4418e9
ANGLES = st.floats(0.0, 2.0 * math.pi)


@given(st.floats(6.6e6, 1e9), st.floats(0.0, 0.95), st.floats(0.0, math.pi), ANGLES, ANGLES, ANGLES)
def test_state_of_elements_has_their_axis_perigee_and_inclination(
    axis: float,
    eccentricity: float,
    inclination: float,
    raan: float,
    perigee: float,
    anomaly: float,
) -> None:
    position, velocity = OrbitalElements(
        axis, eccentricity, inclination, raan, perigee, anomaly
    ).state(MU)
    assert semi_major_axis_m(position, velocity, MU) == pytest.approx(axis, rel=1e-9)
    assert perigee_m(position, velocity, MU) == pytest.approx(axis * (1.0 - eccentricity), rel=1e-6)
    momentum = np.cross(position, velocity)
    assert momentum[2] / np.linalg.norm(momentum) == pytest.approx(math.cos(inclination), abs=1e-12)
    assert float(np.linalg.norm(momentum)) == pytest.approx(
        math.sqrt(MU * axis * (1.0 - eccentricity**2)), rel=1e-9
    )


def test_state_at_the_ascending_node_has_the_right_ascension_of_the_node() -> None:
    orbit = OrbitalElements(
        10e6, 0.2, math.radians(30.0), math.radians(40.0), math.radians(-50.0), math.radians(50.0)
    )
    position, velocity = orbit.state(MU)  # at the ascending node
    assert position[2] == pytest.approx(0.0, abs=1e-6)
    assert velocity[2] > 0.0
    assert math.degrees(math.atan2(position[1], position[0])) == pytest.approx(40.0)


@given(st.floats(6.6e6, 1e9), st.floats(0.01, 0.95), st.floats(-3.1, 3.1), ANGLES, ANGLES, ANGLES)
def test_shape_of_a_state_is_that_of_its_elements(
    axis: float, eccentricity: float, anomaly: float, tilt: float, raan: float, perigee: float
) -> None:
    elements = OrbitalElements(axis, eccentricity, tilt, raan, perigee, anomaly)
    shape = conic_shape(*elements.state(MU), MU)
    assert shape.eccentricity == pytest.approx(eccentricity, abs=1e-12)
    # The anomaly of a nearly circular orbit is known to the rounding divided by the eccentricity.
    assert shape.true_anomaly_rad == pytest.approx(anomaly, abs=1e-10)


def test_hyperbola_has_its_eccentricity_and_anomaly() -> None:
    elements = OrbitalElements(-2e7, 1.5, 0.3, 0.2, 0.1, -0.7)
    assert conic_shape(*elements.state(MU), MU) == pytest.approx((1.5, -0.7), rel=1e-12)
