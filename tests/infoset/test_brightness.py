"""The centre of brightness of a sphere, against integrals over the lit and visible part."""

from __future__ import annotations

import math

import numpy as np
import pytest

from infoset.sensors.brightness import Brightness, correction_residual, offset_share

POINTS, WEIGHTS = np.polynomial.legendre.leggauss(300)
"""Points and weights of an integral over [-1, 1]; the integrands are analytic."""


def integrated(phase_rad: float, law: Brightness) -> float:
    """Return the offset in radii by a double integral over longitude and latitude."""
    # Lit and visible are the longitudes from phase - pi/2 to pi/2.
    half = 0.5 * (math.pi - phase_rad)
    longitude = (0.5 * phase_rad + half * POINTS)[:, None]
    latitude = 0.5 * math.pi * POINTS
    mu = np.cos(latitude) * np.cos(longitude)
    mu0 = np.cos(latitude) * np.cos(longitude - phase_rad)
    intensity = {
        Brightness.LAMBERT: mu0,
        Brightness.LOMMEL_SEELIGER: mu0 / (mu0 + mu),
        Brightness.BINARY: np.ones_like(mu),
    }[law]
    light = intensity * mu * np.cos(latitude) * WEIGHTS[:, None] * WEIGHTS
    return float((light * np.cos(latitude) * np.sin(longitude)).sum() / light.sum())


@pytest.mark.parametrize("law", [Brightness.LAMBERT, Brightness.LOMMEL_SEELIGER, Brightness.BINARY])
@pytest.mark.parametrize("phase_deg", [1.0, 10.0, 45.0, 60.0, 90.0, 120.0, 150.0, 170.0])
def test_offset_equals_the_integral_over_the_sphere(phase_deg: float, law: Brightness) -> None:
    phase_rad = math.radians(phase_deg)
    assert offset_share(phase_rad, law) == pytest.approx(integrated(phase_rad, law), abs=1e-9)


@pytest.mark.parametrize(
    ("phase_deg", "lambert", "lommel_seeliger", "binary"),
    [
        (10, 0.0656, 0.0589, 0.0064),
        (30, 0.1986, 0.1831, 0.0569),
        (60, 0.399952, 0.378175, 0.212207),
        (90, 0.5890, 0.5632, 0.4244),
        (150, 0.8477, 0.8143, 0.7920),
    ],
)
def test_offsets_of_the_table(
    phase_deg: float, lambert: float, lommel_seeliger: float, binary: float
) -> None:
    phase_rad = math.radians(phase_deg)
    found = [
        offset_share(phase_rad, law)
        for law in (Brightness.LAMBERT, Brightness.LOMMEL_SEELIGER, Brightness.BINARY)
    ]
    # The table has four digits after the point.
    assert found == pytest.approx([lambert, lommel_seeliger, binary], abs=5e-5)


@pytest.mark.parametrize("phase_deg", [1.0, 30.0, 60.0, 90.0, 150.0])
def test_offsets_are_the_factors_of_other_flight_software(phase_deg: float) -> None:
    """Basilisk's `cobConverter` has them for Lambert's law, after Bhaskaran and others (1998), and
    for binary images.
    """
    phase_rad = math.radians(phase_deg)
    sine = math.sin(phase_rad)
    cosine = math.cos(phase_rad)
    lambert = 3.0 * math.pi / 16.0 * (cosine + 1.0) * sine
    lambert /= sine + (math.pi - phase_rad) * cosine
    binary = 4.0 / (3.0 * math.pi) * (1.0 - cosine)

    assert offset_share(phase_rad, Brightness.LAMBERT) == pytest.approx(lambert, rel=1e-12)
    # 1 - cos(phase) loses four digits at 1 degree.
    assert offset_share(phase_rad, Brightness.BINARY) == pytest.approx(binary, rel=1e-11)


def test_mean_covers_both_laws_with_six_percent_at_every_phase() -> None:
    for phase_rad in np.radians(np.linspace(0.5, 170.0, 200)).tolist():
        mean = offset_share(phase_rad, Brightness.MEAN)
        for law in (Brightness.LAMBERT, Brightness.LOMMEL_SEELIGER):
            # At a phase of zero 3/8 and 1/3 differ from their mean by 5.9 %.
            assert abs(offset_share(phase_rad, law) - mean) <= 0.06 * mean


@pytest.mark.parametrize(
    ("law", "slope"),
    [
        (Brightness.LAMBERT, 3.0 / 8.0),
        (Brightness.LOMMEL_SEELIGER, 1.0 / 3.0),
        (Brightness.MEAN, 17.0 / 48.0),
        (Brightness.BINARY, 0.0),
    ],
)
def test_offset_at_small_phases_is_proportional_to_them(law: Brightness, slope: float) -> None:
    assert offset_share(0.0, law) == 0.0
    # The next terms are at most of second order; that of `BINARY` is 2/(3 pi) of the square.
    for phase_rad in (1e-9, 1e-4):
        assert offset_share(phase_rad, law) == pytest.approx(
            slope * phase_rad, abs=1e-3 * phase_rad
        )


def test_residual_is_the_sum_of_its_parts() -> None:
    """A body of radius 30 m at 40 deg, its radius known to 30 % and its axis ratio 0.7: 9.3 m."""
    residual = correction_residual(math.radians(40.0), 30.0)
    assert residual.total_m == pytest.approx(9.3, abs=0.05)
    exact = correction_residual(math.radians(40.0), 30.0, radius_error=0.0, axis_ratio=1.0)
    share = offset_share(math.radians(40.0), Brightness.MEAN)
    assert exact.total_m == pytest.approx(0.06 * share * 30.0)
    turned = correction_residual(math.radians(40.0), 30.0, sun_error_rad=0.1)
    assert turned.direction_m == pytest.approx(1.3 * share * 30.0 * 0.1)
