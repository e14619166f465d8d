"""The centre of brightness of a sphere that the Sun lights from the side, in closed form."""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple

LAW_SHARE = 0.06
"""Maximum difference of the offsets of the Lambert and the Lommel-Seeliger sphere from their mean,
as a share of the mean: 12 % between the two for a small phase angle, less at others."""
SHAPE_SHARE = 0.85
"""Factor of the envelope of the offsets of ellipsoids in the residual of a correction: a measured
envelope (5 shapes, 1500 attitudes each, phase angles of 15 to 90 deg), not a theorem."""


RADIUS_ERROR = 0.3
"""Relative error of a radius that follows from an infrared brightness in one or two bands (Masiero
and others 2021)."""
AXIS_RATIO = 0.7
"""Ratio of the axes of an asteroid of less than a kilometre, on average 0.7 (McNeill and others
2019)."""


class Brightness(Enum):
    """Law of the brightness of a surface.

    LAMBERT and LOMMEL_SEELIGER are images weighted by their brightness, MEAN the mean of both
    offsets. BINARY is an image in which a threshold makes all lit points alike.
    """

    LAMBERT = "lambert"
    LOMMEL_SEELIGER = "lommel-seeliger"
    MEAN = "mean"
    BINARY = "binary"


def offset_share(phase_rad: float, law: Brightness) -> float:
    """Return the distance of the centre of brightness of a sphere from its centre, in radii.

    It is toward the Sun, across the line of sight.

    Parameters
    ----------
    phase_rad : float
        Phase angle phi (Sun, body, camera), rad, in [0, pi).

    Notes
    -----
    k = int f mu cos(b) sin(l) dO / int f mu dO over the lit and visible part of the sphere, with
    the longitude l from the line of sight toward the Sun, the latitude b, mu = cos(b) cos(l) and
    mu0 = cos(b) cos(l - phi); f is mu0, mu0 / (mu0 + mu), or 1 for a binary image.
    """
    # The logarithm of `_lommel_seeliger` is infinite there.
    if phase_rad == 0.0:
        return 0.0
    if law is Brightness.LAMBERT:
        return _lambert(phase_rad)
    if law is Brightness.LOMMEL_SEELIGER:
        return _lommel_seeliger(phase_rad)
    if law is Brightness.MEAN:
        return 0.5 * (_lambert(phase_rad) + _lommel_seeliger(phase_rad))
    # The centre of the lit area, the closed form of k for f = 1.
    return 8.0 / (3.0 * math.pi) * math.sin(0.5 * phase_rad) ** 2


def _lit_part(phase_rad: float) -> float:
    """Return the integral of mu0 mu over the lit and visible part, times 3/2."""
    return math.sin(phase_rad) + (math.pi - phase_rad) * math.cos(phase_rad)


def _lambert(phase_rad: float) -> float:
    """Return k of `offset_share` for f = mu0, in closed form."""
    numerator = math.sin(phase_rad) * (1.0 + math.cos(phase_rad))
    return 3.0 * math.pi / 16.0 * numerator / _lit_part(phase_rad)


def _lommel_seeliger(phase_rad: float) -> float:
    """Return k of `offset_share` for f = mu0 / (mu0 + mu), in closed form; the phase is not 0."""
    half_rad = 0.5 * phase_rad
    logarithm = -math.log(math.tan(0.5 * half_rad))
    denominator = 1.0 - math.sin(half_rad) * math.tan(half_rad) * logarithm
    return 2.0 / (3.0 * math.pi) * math.tan(half_rad) * _lit_part(phase_rad) / denominator


class CorrectionResidual(NamedTuple):
    """Bound of the error of a corrected centre of brightness, m, and its parts.

    Parameters
    ----------
    size_m, law_m, shape_m, direction_m : float
        Parts by the errors of the radius, of the law of brightness, of the shape and of the
        direction of the Sun.
    """

    size_m: float
    law_m: float
    shape_m: float
    direction_m: float

    @property
    def total_m(self) -> float:
        """Sum of the parts, m."""
        return self.size_m + self.law_m + self.shape_m + self.direction_m


def correction_residual(
    phase_rad: float,
    radius_m: float,
    *,
    law: Brightness = Brightness.MEAN,
    radius_error: float = RADIUS_ERROR,
    axis_ratio: float = AXIS_RATIO,
    sun_error_rad: float = 0.0,
) -> CorrectionResidual:
    """Return the residual of a correction by k R toward the Sun, for a radius that is an estimate.

    Parameters
    ----------
    phase_rad : float
        Phase angle phi, rad.
    radius_m : float
        Radius R of the sphere of equal volume, as the software on board knows it, m.
    radius_error : float
        Bound delta of |true / known - 1| of the radius.
    axis_ratio : float
        Minimum ratio c/a of the shortest and the longest semi-axis.
    sun_error_rad : float
        Bound of the error of the direction of the Sun across the line of sight, rad.

    Notes
    -----
    R (k (delta + 0.06 (1 + delta)) + 0.85 (1 + delta) (1 - c/a) sin(phi)) + (1 + delta) k R dtheta.
    The third term is a measured envelope of convex ellipsoids in any attitude.
    """
    offset_m = offset_share(phase_rad, law) * radius_m
    largest = 1.0 + radius_error
    return CorrectionResidual(
        size_m=offset_m * radius_error,
        law_m=offset_m * LAW_SHARE * largest,
        shape_m=SHAPE_SHARE * largest * (1.0 - axis_ratio) * math.sin(phase_rad) * radius_m,
        direction_m=largest * offset_m * sun_error_rad,
    )
