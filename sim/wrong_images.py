"""Wrong images and ranges of simulated flights: which, by how much, and which a set proves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from infoset.arrays import Floats
from infoset.covered_set import CoveredSetView
from infoset.information_set import InformationSetView
from infoset.limits import NOT_NEGATIVE, Checked, Limits
from infoset.sensors import Sensor
from infoset.sensors.sensor import Geometry

MAX_NUMBER = 1000
"""Maximum number of wrong images of a flight. Chosen: far more than the 3 that a set allows for."""
MAX_ANGLE_RAD = 1.5
"""Maximum size of a wrong angle: less than a right angle, which no camera sees."""
_NUMBER = Limits(minimum=0, maximum=MAX_NUMBER, whole=True)
_SIZE = Limits(minimum=1.0, maximum=1e6)
"""Limits of an error of a wrong image in bounds: below 1 it would not be wrong; 1e6 is chosen, and
far beyond `MAX_ANGLE_RAD` for a bound of an angle."""


@dataclass(frozen=True)
class WrongMeasurements(Checked):
    """Measurements of one sensor with errors beyond their bound in the simulated flights.

    They are simulated whatever the set allows for.

    Parameters
    ----------
    number : int
        Number of wrong measurements of each flight.
    size : tuple of float
        Minimum and maximum error of a wrong measurement in units of its bound: the logarithm is
        uniform, and the sign of each value random.
    when_s : tuple of float, or None
        Minimum and maximum time of a wrong measurement before the nominal arrival, s, both
        included; None is the whole flight.
    """

    number: Annotated[int, _NUMBER]
    size: Annotated[tuple[float, float], _SIZE] = (2.0, 100.0)
    when_s: Annotated[tuple[float, float], NOT_NEGATIVE] | None = None


@dataclass(frozen=True)
class WrongImages(WrongMeasurements):
    """Images with errors beyond their bound in the simulated flights.

    They are simulated whatever the set allows for: `wrong_images` of `[information_set]` is what
    the set allows for.

    Parameters
    ----------
    number : int
        Number of wrong images of each flight; all images, if there are fewer.
    size : tuple of float
        Minimum and maximum error of a wrong image in units of its bound: the logarithm is uniform,
        and the sign of each axis random.
    when_s : tuple of float, or None
        Minimum and maximum time of a wrong image before the nominal arrival, s, both included; None
        is the whole flight.
    """


@dataclass(frozen=True)
class WrongRanges(WrongMeasurements):
    """Measured ranges with errors beyond their bound in the simulated flights.

    They are simulated whatever the set allows for: `wrong_measurements` of `[range_sensor]` is what
    the set allows for.

    Parameters
    ----------
    number : int
        Number of wrong ranges of each flight; all ranges, if there are fewer.
    size : tuple of float
        Minimum and maximum error of a wrong range in units of its bound: the logarithm is uniform,
        and the sign random. A negative range becomes zero.
    when_s : tuple of float, or None
        Minimum and maximum time of a wrong range before the nominal arrival, s, both included; None
        is the whole flight.
    """


def draw_wrong_measurements(
    wrong: WrongMeasurements, before_arrival_s: Floats, axes: int, random: np.random.Generator
) -> Floats:
    """Return the errors of the wrong measurements of one flight.

    Parameters
    ----------
    before_arrival_s : ndarray, shape (steps,)
        Time of the measurement of each step before the nominal arrival, s; NaN without one.
    axes : int
        Number of measured values.

    Returns
    -------
    ndarray, shape (axes, steps)
        Errors in units of the bounds; zero for measurements that are not wrong.
    """
    earliest_s, latest_s = math.inf, -math.inf
    # Times before the arrival: the minimum is the latest one.
    if wrong.when_s is not None:
        latest_s, earliest_s = wrong.when_s
    possible = np.flatnonzero((before_arrival_s >= latest_s) & (before_arrival_s <= earliest_s))
    steps = random.permutation(possible)[: wrong.number]
    smallest, largest = wrong.size
    logarithms = random.uniform(math.log(smallest), math.log(largest), size=(axes, len(steps)))
    signs = np.where(random.uniform(size=(axes, len(steps))) < 0.5, -1.0, 1.0)
    errors = np.zeros((axes, len(before_arrival_s)))
    errors[:, steps] = signs * np.exp(logarithms)
    return errors


def wrong_angles(sensor: Sensor, sight: Geometry, measured: Floats, errors: Floats) -> Floats:
    """Return measured angles, rad, with those of wrong images in place of the others.

    `errors`, shape (C, B), are in units of the bounds, and zero for images that are not wrong.
    """
    is_wrong = (errors != 0.0).any(axis=0)
    angles = np.clip(sensor.measured(sight, errors), -MAX_ANGLE_RAD, MAX_ANGLE_RAD)
    return np.where(is_wrong, angles, measured)


def suspected_times_s(information: InformationSetView, engagement: int = 0) -> tuple[float, ...]:
    """Return the times of the images one of which is wrong; none without a proof."""
    if not isinstance(information, CoveredSetView):
        return ()
    step_s = information.model.step_s
    return tuple(step_s * step for step in information.suspected_steps(engagement))


def proved_columns(information: InformationSetView) -> dict[str, Any]:
    """Return the columns of `Results` about wrong images that a set has proved.

    There are none for a set that allows for no wrong image.
    """
    if not isinstance(information, CoveredSetView):
        return {}
    suspects = [suspected_times_s(information, number) for number in range(information.batch)]
    count = np.array([len(times) for times in suspects], dtype=np.int64)
    last_s = np.array([max(times, default=0.0) for times in suspects])
    return {
        "wrong_image_proved_s": information.proof_step * information.model.step_s,
        "suspected_images": np.ma.MaskedArray(count, mask=count == 0),
        "wrong_image_s": np.ma.MaskedArray(last_s, mask=count != 1),
    }


def wrong_ranges(sensor: Sensor, sight: Geometry, measured: Floats, errors: Floats) -> Floats:
    """Return measured ranges, m, with wrong ones in place of the others; `errors` has the shape
    (B,).
    """
    ranges = np.maximum(sensor.measured(sight, errors), 0.0)
    return np.where(errors != 0.0, ranges, measured)
