"""The first image in which the body of a scenario is bright enough (`check --magnitude`)."""

from __future__ import annotations

from dataclasses import dataclass

from infoset.experiments.common.errors import InputError, input_errors, shown
from infoset.experiments.common.units import duration_text
from infoset.sim import Scenario
from infoset.sim.detection import AU_M, FACTOR_PER_MAGNITUDE, Magnitude

_OPTION = "--magnitude"
_FIELDS = {"H": "absolute", "limit": "limit", "phase": "phase_deg"}
"""Fields of `Magnitude` by their names in the option."""


@dataclass(frozen=True)
class FirstImage:
    """Time before the nominal arrival at which a body has the limiting magnitude.

    Parameters
    ----------
    first_image_s : float
        The time, s, at the nominal closing speed.
    sun_distance_au : float
        Distance of the body from the Sun: that of [sun], or 1 au without this table.
    """

    first_image_s: float
    sun_distance_au: float

    def __str__(self) -> str:
        earliest_s = self.first_image_s * FACTOR_PER_MAGNITUDE
        latest_s = self.first_image_s / FACTOR_PER_MAGNITUDE
        # Three digits, and no exponent: a value for the key of the file.
        value_s = float(f"{self.first_image_s:.3g}")
        return (
            f"first image by the magnitude, {self.sun_distance_au:.3g} au from the Sun: "
            f"camera.first_image_s = {value_s:.12g} ({duration_text(self.first_image_s)} "
            f"before the arrival); an error of one magnitude is a factor of "
            f"{FACTOR_PER_MAGNITUDE:.1f}: {duration_text(latest_s)} to {duration_text(earliest_s)}"
        )


def first_image(scenario: Scenario, magnitude: Magnitude) -> FirstImage:
    """Return the first image in which the body is bright enough."""
    sun_distance_m = AU_M
    if scenario.sun is not None:
        sun_distance_m = scenario.sun.distance_m
    distance_m = magnitude.distance_m(sun_distance_m)
    return FirstImage(distance_m / scenario.closing_speed_m_s, sun_distance_m / AU_M)


def read_magnitude(text: str) -> Magnitude:
    """Read `H=23.8,limit=11,phase=40`; raise `InputError` for another text."""
    values = {}
    for part in text.split(","):
        name, _, number = part.partition("=")
        try:
            values[_FIELDS[name.strip()]] = float(number)
        except (KeyError, ValueError):
            break
    if len(values) != len(_FIELDS) or text.count(",") != len(_FIELDS) - 1:
        raise InputError(
            f"{_OPTION}: must be three numbers, for example H=23.8,limit=11,phase=40: got "
            f"{shown(text)}"
        )
    with input_errors(_OPTION):
        return Magnitude(**values)
