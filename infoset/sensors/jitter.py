"""Error bounds of a camera's attitude from a spectrum of its line of sight."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from scipy.integrate import quad
from scipy.optimize import brentq
from scipy.special import ndtri

AXES = 2
"""Number of angles of an image."""


class Jitter(NamedTuple):
    """Bounds of the errors of a camera's attitude: keys of `[camera]`.

    Parameters
    ----------
    pixel_error_rad : float
        Bound of the part that is new in each image; the error of the image processing is added to
        it.
    drift_rad, drift_time_s : float
        Bound of the part that changes slowly, rad, and its time constant, s.
    misalignment_rad : float
        Bound of the part that is constant in the flight.
    sigmas : float
        Number of standard deviations in each bound.
    """

    pixel_error_rad: float
    drift_rad: float
    drift_time_s: float
    misalignment_rad: float
    sigmas: float


def jitter(
    psd: Callable[[float], float],
    *,
    exposure_s: float,
    period_s: float,
    flight_s: float,
    confidence: float = 0.99,
) -> Jitter:
    """Return bounds that the attitude of a whole flight keeps with a probability.

    Parameters
    ----------
    psd : callable
        One-sided power spectral density of one angle of the line of sight, rad^2/Hz, at a frequency
        in Hz.
    exposure_s, period_s, flight_s : float
        Exposure of an image, time between two images, and time of all images, s.
    confidence : float
        Probability that no error of the flight exceeds its bound.

    Raises
    ------
    ValueError
        If the times do not increase, or the confidence is not between 0 and 1.

    Notes
    -----
    Frequencies above 1/(2 exposure) blur an image and do not displace it. Those from 1/(2 period)
    on are new in each image, with the factor sinc^2 of the exposure; those below 1/flight are
    constant. The time constant is that of a Gauss-Markov process with the same frequency below
    which half of its variance is.

    A Gaussian error has no bound. In N images of two angles there are 2 N new errors, 2 N of the
    drift and 2 constant ones: 4 (2 N + 1) Q(k) = 1 - confidence for k standard deviations, where Q
    is the tail of a Gaussian. A flight leaves the assumptions with a probability of at most 1 -
    confidence. The set on board uses the bounds only, and neither the spectrum nor the time
    constant.
    """
    if not 0.0 < exposure_s < period_s < flight_s:
        raise ValueError(
            "jitter: exposure_s must be positive and less than period_s, and period_s less than "
            f"flight_s: got {exposure_s!r}, {period_s!r} and {flight_s!r}"
        )
    if not 0.0 < confidence < 1.0:
        raise ValueError(f"jitter: confidence must be between 0 and 1: got {confidence!r}")

    constant_hz = 1.0 / flight_s
    slow_hz = 0.5 / period_s
    blur_hz = 0.5 / exposure_s

    def seen(frequency_hz: float) -> float:
        phase = math.pi * frequency_hz * exposure_s
        return psd(frequency_hz) * (math.sin(phase) / phase) ** 2

    white = _integral(seen, slow_hz, blur_hz)
    drift = _integral(psd, constant_hz, slow_hz)
    constant = quad(psd, 0.0, constant_hz)[0]

    # With the image at the start.
    images = flight_s / period_s + 1.0
    tail = (1.0 - confidence) / (2.0 * AXES * (2.0 * images + 1.0))
    sigmas = float(-ndtri(tail))
    return Jitter(
        pixel_error_rad=sigmas * math.sqrt(white),
        drift_rad=sigmas * math.sqrt(drift),
        drift_time_s=_time_constant_s(psd, constant_hz, slow_hz, drift),
        misalignment_rad=sigmas * math.sqrt(constant),
        sigmas=sigmas,
    )


def _integral(density: Callable[[float], float], first_hz: float, last_hz: float) -> float:
    """Return the integral of a spectrum between two positive frequencies, over their logarithm."""

    def by_logarithm(logarithm: float) -> float:
        frequency_hz = math.exp(logarithm)
        return frequency_hz * density(frequency_hz)

    # A table of a spectrum has kinks: 500 intervals are enough for 10 in each decade.
    found = quad(by_logarithm, math.log(first_hz), math.log(last_hz), limit=500)
    return float(found[0])


def _time_constant_s(
    psd: Callable[[float], float], first_hz: float, last_hz: float, variance: float
) -> float:
    """Return the time constant of the drift, s; the longest one without a drift."""
    if variance == 0.0:
        return 1.0 / (2.0 * math.pi * first_hz)
    middle_hz = brentq(
        lambda frequency_hz: _integral(psd, first_hz, frequency_hz) - 0.5 * variance,
        first_hz,
        last_hz,
    )
    return float(1.0 / (2.0 * math.pi * middle_hz))
