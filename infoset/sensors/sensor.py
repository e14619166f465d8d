"""The interface of a sensor with a bounded error.

A sensor has a measured quantity, an error bound, and a cut of sets by a measurement.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats

Measurements = Mapping[str, Floats]
"""Measured values of a batch by the name of the sensor.

A sensor that does not measure in a step is left out.
"""


class Geometry(Protocol):
    """True geometry of a batch of engagements, or other points with angles, rates and ranges.

    Arrays of angles and rates have the shape (C, B), along C lateral axes.
    """

    @property
    def alpha_rad(self) -> Floats:
        """Line-of-sight angles in the planes of x and each lateral axis, rad.

        They are atan2(y, x) and atan2(z, x).
        """

    @property
    def omega_rad_s(self) -> Floats:
        """Their rates, rad/s."""

    @property
    def range_m(self) -> Floats:
        """Distance, m, shape (B,), or for points that differ by axis (C, B)."""

    @property
    def along_x_m(self) -> Floats:
        """Part of the distance along x, m, with its shape.

        A misaligned camera turns the angles, and neither the distance nor this part.
        """


def along_x_m(alpha_rad: Floats, range_m: Floats) -> Floats:
    """Return the part of distances along x, m, from line-of-sight angles, shape (C, B), rad.

    It is negative behind x = 0, where an angle is beyond a right one.
    """
    # The cosines of all axes have the sign of x.
    slope = np.tan(alpha_rad)
    distance_per_x = np.sqrt(1.0 + (slope * slope).sum(axis=0))
    return np.asarray(np.copysign(range_m / distance_per_x, np.cos(alpha_rad[0])))


@dataclass(frozen=True)
class Apart:
    """Two true motions at n times, for the lower bound of the miss (`infoset.sim.lower_bound`).

    Parameters
    ----------
    offset_m, predicted_miss_m : ndarray, shape (axes, n)
        Maximum differences of their positions z and of their predicted misses z + V x/e along each
        lateral axis, m.
    shift_m : ndarray, shape (n,)
        Maximum difference of their ranges x, m.
    range_m, farthest_m : ndarray, shape (n,)
        Their minimum range x and maximum distance, m.
    slope : ndarray, shape (n,)
        Maximum distance of both from the x axis, and its maximum change until x = 0, as a share of
        x.
    closing_speed_m_s : ndarray, shape (n,)
        Their maximum closing speed e.
    """

    offset_m: Floats
    predicted_miss_m: Floats
    shift_m: Floats
    range_m: Floats
    farthest_m: Floats
    slope: Floats
    closing_speed_m_s: Floats


class Cuttable(Protocol):
    """A batch of sets that measurements cut; `InformationSet` describes the methods."""

    def measure_angle(self, alpha_rad: Floats, where: Flags) -> None:
        """Cut by a line-of-sight angle."""

    def measure_range(
        self,
        range_m: Floats,
        relative_error: float,
        where: Flags,
        *,
        alpha_rad: ArrayLike | None,
        wrong_measurements: int = 0,
    ) -> None:
        """Cut by a range."""

    def measure_rate(self, omega_rad_s: Floats, error_rad_s: float, where: Flags) -> None:
        """Cut by a rate of the line of sight."""


class Sensor(ABC):
    """A sensor that measures one quantity of the line of sight, with a bounded error.

    Attributes
    ----------
    name : str
        Key of its measurements and errors.
    table : str
        Its table in files.
    quantity : str
        Measured quantity, with the unit: ``measured_<quantity>`` is its column in files.
    stream : int
        Its stream of random numbers: a number below 16 that no other kind and no stream of
        `infoset.sim.draws` has.
    is_lateral : bool
        Whether it measures one value for each lateral axis: its arrays have the shape (C, B),
        otherwise (B,).
    """

    name: ClassVar[str]
    table: ClassVar[str]
    quantity: ClassVar[str]
    stream: ClassVar[int]
    is_lateral: ClassVar[bool] = True
    period_s: float

    @abstractmethod
    def true_value(self, sight: Geometry) -> Floats:
        """Return the measured quantity without error.

        The shape is (C, B), or (B,) if the sensor is not lateral.
        """

    @abstractmethod
    def bound(self, sight: Geometry) -> Floats | float:
        """Return the maximum size of the error, in the unit of the quantity.

        It is broadcast against the true value.
        """

    @abstractmethod
    def cut(self, sets: Cuttable, measured: Measurements, where: Flags) -> None:
        """Cut sets by the measurement of this sensor.

        Parameters
        ----------
        sets : Cuttable
            Sets of a batch, for example an `InformationSet`.
        measured : mapping of str to ndarray, shape (C, B) or (B,)
            All measurements of the step (rad, m, rad/s), including the measurement of this sensor.
        where : ndarray of bool, shape (B,)
            Engagements that have measured.
        """

    @abstractmethod
    def band(
        self, range_m: Floats, closing_speed_m_s: Floats | float, errors: float = 1.0
    ) -> tuple[bool, Floats] | None:
        """Return the band of (V, z) that a measurement leaves, for `infoset.lower_bound`.

        The search for two motions uses it. It may neglect terms of second order, because `share`
        checks the motions that are found.

        Parameters
        ----------
        range_m : ndarray
            Ranges x, m.
        closing_speed_m_s : float or ndarray
            Closing speed e at these ranges.
        errors : float
            Half-width of the interval of the measured quantity, in units of the bound.

        Returns
        -------
        tuple of (bool, ndarray), or None
            Whether it is a band of the predicted miss z + V x/e (otherwise of z), and its
            half-width, m. None if a measurement leaves V and z as they are.
        """

    @abstractmethod
    def share(self, apart: Apart) -> Floats:
        """Return half of the maximum difference of the measured values of two motions.

        It is in units of the bound, shape (n,). Both motions can have the same measured value where
        it is at most 1.

        The lower bound of the miss is a theorem only if no difference of two motions within `apart`
        is greater: see Lemma 20 of docs/guarantee-bound.md.
        """

    def measures_at(self, before_arrival_s: float) -> bool:
        """Return whether the sensor measures at a time before the nominal arrival, s."""
        return True

    def measured(self, sight: Geometry, error: Floats | float) -> Floats:
        """Return the measured value for an error in units of the bound, from -1 to 1."""
        return self.true_value(sight) + self.bound(sight) * error

    def error(self, sight: Geometry, measured: Floats) -> Floats:
        """Return the error of a measured value in units of the bound."""
        return (measured - self.true_value(sight)) / self.bound(sight)

    def limited(self, error: Floats) -> Floats:
        """Return the possible error (in units of the bound) that is nearest to an error."""
        return np.clip(error, -1.0, 1.0)

    def nearest(self, sight: Geometry, wanted: Floats) -> Floats:
        """Return the possible measurement that is nearest to a wanted one."""
        true = self.true_value(sight)
        bound = self.bound(sight)
        return np.minimum(np.maximum(wanted, true - bound), true + bound)
