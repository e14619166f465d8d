"""The first image in which the body of a scenario is bright enough (`check --magnitude`)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from infoset.experiments.common.errors import InputError, shown
from infoset.experiments.common.units import duration_text
from infoset.experiments.interception.sun_direction import is_the_sun
from infoset.limits import Limits
from infoset.sim import Scenario
from infoset.sim.detection import AU_M, FACTOR_PER_MAGNITUDE, MAGNITUDE, PHASE_DEG, Magnitude

_OPTION = "--magnitude"
_LIMITS = {"H": MAGNITUDE, "limit": MAGNITUDE, "phase": PHASE_DEG}
"""Limits of the numbers of the option, by name."""


@dataclass(frozen=True)
class FirstImage:
    """Time before the nominal arrival at which a body has the limiting magnitude.

    Parameters
    ----------
    first_image_s : float
        The time, s, at the nominal closing speed.
    sun_distance_au : float
        Distance of the body from the Sun: the distance in [sun], or 1 au if this table is another
        attracting body or is missing.
    sun_is_another_body : bool
        Whether the table [sun] is another attracting body.
    limit : float
        The limiting magnitude.
    before_start : bool
        Whether the time is not after the start of the flight: all images are bright enough.
    key : str
        Key of the file for this time, with its table.
    """

    first_image_s: float
    sun_distance_au: float
    sun_is_another_body: bool
    limit: float
    before_start: bool
    key: str

    def __str__(self) -> str:
        before = f"{duration_text(self.first_image_s)} before the arrival"
        earliest_s = self.first_image_s * FACTOR_PER_MAGNITUDE
        latest_s = self.first_image_s / FACTOR_PER_MAGNITUDE
        error = (
            f"an error of one magnitude is a factor of {FACTOR_PER_MAGNITUDE:.1f}: "
            f"{duration_text(latest_s)} to {duration_text(earliest_s)}"
        )
        head = f"first image by the magnitude, {self.sun_distance_au:.3g} au from the Sun"
        if self.sun_is_another_body:
            head += ", because [sun] is another body"
        if self.before_start:
            return (
                f"{head}: the body has the limiting magnitude {self.limit:g} {before}, before the "
                f"start of the flight: all images are bright enough ({error})"
            )
        # Three digits, and no exponent: a value for the key of the file.
        value_s = float(f"{self.first_image_s:.3g}")
        return f"{head}: {self.key} = {value_s:.12g} ({before}); {error}"


def first_image(scenario: Scenario, text: str) -> FirstImage:
    """Return the first image in which the body is bright enough.

    `text` is the value of the option. Raise `InputError` if it is not one, or contradicts the phase
    angle of the scenario.
    """
    phase_rad = None
    if scenario.camera is not None:
        phase_rad = scenario.camera.phase_angle_rad
    magnitude = read_magnitude(text, phase_rad)

    sun = scenario.sun
    sun_distance_m = AU_M
    if sun is not None and is_the_sun(sun):
        sun_distance_m = sun.distance_m
    first_s = magnitude.distance_m(sun_distance_m) / scenario.closing_speed_m_s
    return FirstImage(
        first_image_s=first_s,
        sun_distance_au=sun_distance_m / AU_M,
        sun_is_another_body=sun is not None and not is_the_sun(sun),
        limit=magnitude.limit,
        before_start=first_s >= scenario.nominal_arrival_s,
        key=f"{scenario.bearing_sensor.table}.first_image_s",
    )


def read_magnitude(text: str, phase_rad: float | None = None) -> Magnitude:
    """Read `H=23.8,limit=11,phase=40`; without `phase` it is the phase angle of a file, rad.

    Raise `InputError` for another text, and for a phase whose six digits are not those of the phase
    of the file.
    """
    numbers = _numbers(text)
    if phase_rad is not None:
        of_file = f"{math.degrees(phase_rad):g}"
        asked = f"{numbers.setdefault('phase', float(of_file)):g}"
        if asked != of_file:
            raise InputError(f"{_OPTION}: phase is {asked}, camera.phase_angle_deg is {of_file}")
    if "phase" not in numbers:
        raise InputError(
            f"{_OPTION}: phase is missing: write it, for example H=23.8,limit=11,phase=40, or set "
            "camera.phase_angle_deg"
        )

    for name, limits in _LIMITS.items():
        _need(name, numbers[name], limits)
    return Magnitude(numbers["H"], numbers["limit"], numbers["phase"])


def _numbers(text: str) -> dict[str, float]:
    """Return the numbers of the option by name; `phase` may be missing."""
    numbers: dict[str, float] = {}
    parts = text.split(",")
    for part in parts:
        name, _, number = part.partition("=")
        try:
            numbers[name.strip()] = float(number)
        except ValueError:
            break

    has_all = set(numbers) in ({"H", "limit"}, {"H", "limit", "phase"})
    if not has_all or len(numbers) != len(parts):
        raise InputError(
            f"{_OPTION}: must be three numbers, for example H=23.8,limit=11,phase=40: got "
            f"{shown(text)}"
        )
    return numbers


def _need(name: str, number: float, limits: Limits) -> None:
    """Raise `InputError` if a number of the option is not within its limits."""
    problem = "must be a finite number"
    if math.isfinite(number):
        problem = limits.problem(number) or ""
    if problem:
        raise InputError(f"{_OPTION}: {name} {problem}: got {number:g}")
