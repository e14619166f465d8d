"""Measurement noises by name, as scenario files and commands select them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from enum import Enum
from types import MappingProxyType
from typing import NamedTuple, Protocol

from infoset.arrays import Floats
from infoset.guidance.game_noise import GameNoise
from infoset.guidance.gaussian_noise import gaussian_noise, share_cut
from infoset.guidance.noise import MeasurementNoise, TieRule
from infoset.guidance.scripted_noise import RandomNoise


class NoiseKind(Enum):
    """How measurement errors are chosen within their bounds.

    RANDOM errors are uniform and independent, GAUSSIAN ones truncated Gaussian and independent,
    CORRELATED ones truncated Gaussian and correlated in time; GAME errors are chosen against the
    guidance.
    """

    RANDOM = "random"
    GAUSSIAN = "gaussian"
    CORRELATED = "correlated"
    GAME = "game"


class NoiseSettings(Protocol):
    """Settings of noises: fields and properties of a scenario, with the same names."""

    @property
    def fitted_step_s(self) -> float:
        """Length of a step of the flight, s."""

    @property
    def tie(self) -> TieRule:
        """Which extreme game noise keeps when both are equally bad."""

    @property
    def noise_sigma(self) -> float:
        """Standard deviation of Gaussian errors before the truncation, in units of the bound."""

    @property
    def correlation_time_s(self) -> float:
        """Time constant of correlated errors, s."""


class NoiseBatch(NamedTuple):
    """Data of a batch of engagements from which its noise is made.

    Parameters
    ----------
    errors : mapping of str to ndarray, shape (C, B, steps), for ranges (B, steps)
        Random numbers by sensor, independent and uniform in [-1, 1].
    bias : ndarray, shape (C, B), or None
        Random numbers of the constant error of a camera's centroid, uniform in [-1, 1]; None
        without such an error.
    drift : ndarray, shape (C, B, steps), or None
        Random numbers of the drift of a camera's attitude, uniform in [-1, 1] and correlated in
        time; None without a drift.
    tie : ndarray, shape (C, B, steps)
        Random numbers of `TieRule.RANDOM`, uniform in [-1, 1].
    worst_shift_m, target_side : callable
        Return `shift_m` and `target_side` of `GameNoise`. They are computed only if a noise needs
        them.
    """

    errors: Mapping[str, Floats]
    bias: Floats | None
    drift: Floats | None
    tie: Floats
    worst_shift_m: Callable[[], Floats | None]
    target_side: Callable[[], Floats | None]


def make_noise(kind: NoiseKind, settings: NoiseSettings, batch: NoiseBatch) -> MeasurementNoise:
    """Return the noise of a kind for a batch of engagements."""
    return _NOISES[kind].make(settings, batch)


def noise_note(kind: NoiseKind, settings: NoiseSettings) -> str | None:
    """Return a line for the user about the errors of a noise; None if its name says enough."""
    note = _NOISES[kind].note
    return None if note is None else note(settings)


class _RegisteredNoise(NamedTuple):
    make: Callable[[NoiseSettings, NoiseBatch], MeasurementNoise]
    note: Callable[[NoiseSettings], str] | None = None


def _random(_settings: NoiseSettings, batch: NoiseBatch) -> MeasurementNoise:
    return RandomNoise(batch.errors, batch.bias, batch.drift)


def _gaussian(settings: NoiseSettings, batch: NoiseBatch) -> MeasurementNoise:
    return gaussian_noise(batch.errors, batch.bias, settings.noise_sigma, drift=batch.drift)


def _correlated(settings: NoiseSettings, batch: NoiseBatch) -> MeasurementNoise:
    correlation = math.exp(-settings.fitted_step_s / settings.correlation_time_s)
    return gaussian_noise(batch.errors, batch.bias, settings.noise_sigma, correlation, batch.drift)


def _game(settings: NoiseSettings, batch: NoiseBatch) -> MeasurementNoise:
    return GameNoise(settings.tie, batch.tie, batch.worst_shift_m(), batch.target_side())


def _gaussian_note(settings: NoiseSettings) -> str:
    return f"gaussian noise: {_deviation(settings)}"


def _correlated_note(settings: NoiseSettings) -> str:
    return (
        f"correlated noise: {_deviation(settings)}; the time constant of the correlation is "
        f"{settings.correlation_time_s:.4g} s"
    )


def _deviation(settings: NoiseSettings) -> str:
    sigma = settings.noise_sigma
    return (
        f"the standard deviation is {sigma:.3g} of the bound, where the errors are truncated; this "
        f"cuts {100.0 * share_cut(sigma):.4g} % of a Gaussian"
    )


_NOISES: Mapping[NoiseKind, _RegisteredNoise] = MappingProxyType(
    {
        NoiseKind.RANDOM: _RegisteredNoise(_random),
        NoiseKind.GAUSSIAN: _RegisteredNoise(_gaussian, _gaussian_note),
        NoiseKind.CORRELATED: _RegisteredNoise(_correlated, _correlated_note),
        NoiseKind.GAME: _RegisteredNoise(_game),
    }
)
