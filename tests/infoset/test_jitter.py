"""Error bounds from a spectrum of the line of sight, against closed forms."""

from __future__ import annotations

import math

import pytest
from scipy.special import sici
from scipy.stats import norm

from infoset import jitter

EXPOSURE_S, PERIOD_S, FLIGHT_S = 0.1, 10.0, 14400.0


def gauss_markov(sigma_rad: float, time_s: float, frequency_hz: float) -> float:
    """Return the one-sided spectrum of a Gauss-Markov process, rad^2/Hz."""
    return 4.0 * sigma_rad**2 * time_s / (1.0 + (2.0 * math.pi * frequency_hz * time_s) ** 2)


def test_drift_and_misalignment_of_a_gauss_markov_process() -> None:
    """The share of its variance below f is 2/pi arctan(2 pi f T)."""
    sigma_rad, time_s = 1e-5, 600.0
    found = jitter(
        lambda frequency_hz: gauss_markov(sigma_rad, time_s, frequency_hz),
        exposure_s=EXPOSURE_S,
        period_s=PERIOD_S,
        flight_s=FLIGHT_S,
    )

    def share_below(frequency_hz: float) -> float:
        return 2.0 / math.pi * math.atan(2.0 * math.pi * frequency_hz * time_s)

    constant = share_below(1.0 / FLIGHT_S)
    slow = share_below(0.5 / PERIOD_S)
    # The relative error of the integrals is 1.5e-8, the default of `quad`.
    assert found.misalignment_rad / found.sigmas == pytest.approx(
        sigma_rad * math.sqrt(constant), rel=1e-7
    )
    assert found.drift_rad / found.sigmas == pytest.approx(
        sigma_rad * math.sqrt(slow - constant), rel=1e-7
    )
    middle_hz = 1.0 / (2.0 * math.pi * found.drift_time_s)
    assert share_below(middle_hz) == pytest.approx(0.5 * (constant + slow), rel=1e-6)


def test_white_spectrum_is_new_in_each_image() -> None:
    """The integral of sinc^2 is that of a table: Si(2 pi x)/pi - sin^2(pi x)/(pi^2 x)."""
    level = 1e-12
    found = jitter(lambda _: level, exposure_s=EXPOSURE_S, period_s=PERIOD_S, flight_s=FLIGHT_S)

    def until(x: float) -> float:
        sine_integral = float(sici(2.0 * math.pi * x)[0])
        return sine_integral / math.pi - math.sin(math.pi * x) ** 2 / (math.pi**2 * x)

    variance = level / EXPOSURE_S * (until(0.5) - until(0.5 * EXPOSURE_S / PERIOD_S))
    assert found.pixel_error_rad / found.sigmas == pytest.approx(math.sqrt(variance), rel=1e-7)


@pytest.mark.parametrize("images", [178, 1069, 1426])
def test_bounds_hold_for_all_images_of_a_flight(images: int) -> None:
    """New errors and drift of N images of two angles, to both sides, and two constant errors."""
    found = jitter(lambda _: 1e-12, exposure_s=EXPOSURE_S, period_s=1.0, flight_s=float(images - 1))
    assert 4.0 * (2 * images + 1) * norm.sf(found.sigmas) == pytest.approx(0.01)


def test_times_that_do_not_increase_are_refused() -> None:
    with pytest.raises(ValueError, match="exposure_s must be positive and less than period_s"):
        jitter(lambda _: 1.0, exposure_s=1.0, period_s=0.5, flight_s=100.0)
    with pytest.raises(ValueError, match="confidence must be between 0 and 1"):
        jitter(lambda _: 1.0, exposure_s=0.1, period_s=1.0, flight_s=100.0, confidence=1.0)
