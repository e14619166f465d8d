"""Scaled coordinates y of a set, x = centre + scale y: the set is about one wide along each axis.

The scales are powers of two, which round nothing; a centre is used only where the set is far from
the origin.
"""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np

from infoset.arrays import Floats
from infoset.geometry.double_words import affine_image
from infoset.geometry.polytope.cone import Box
from infoset.geometry.tolerances import SNAP
from infoset.kernels import Kernels

_kernels = Kernels()
_FAR = 16.0
"""Distance of a set from the origin, in scales, above which a centre is used. Up to it at most four
of the 53 bits are lost without a centre.
"""


@_kernels.compiled
def coordinates(
    lower: Floats, upper: Floats, minimum: Floats, share: float
) -> tuple[Floats, Floats]:
    """Return a centre and scales, powers of two, each of shape (n,), for a set between two points.

    A scale is the greatest power of two up to the width, or up to 1 if that is zero. The width is
    at least `minimum`, shape (n,), and at least a `share` of the coordinates. Differences from a
    centre far away are exact.
    """
    centre = np.zeros(len(lower))
    scale = np.empty(len(lower))
    for j in range(len(lower)):
        size = max(abs(lower[j]), abs(upper[j]))
        width = max(upper[j] - lower[j], minimum[j], share * size)
        scale[j] = math.ldexp(1.0, math.frexp(width or 1.0)[1] - 1)
        if size > _FAR * scale[j]:
            centre[j] = 0.5 * lower[j] + 0.5 * upper[j]
    return centre, scale


def exact_coordinates(box: Box) -> tuple[Floats, Floats]:
    """Return a centre and scales, shape (n,), of an exact box, however thin it is.

    Along an axis without a width the scale is a small share of the coordinate.
    """
    centre = np.zeros(len(box[0]))
    scale = np.empty(len(box[0]))
    for j, (lower, upper) in enumerate(zip(*box, strict=True)):
        size = float(max(abs(lower), abs(upper)))
        width = float(upper - lower) or SNAP * size or 1.0
        scale[j] = math.ldexp(1.0, math.frexp(width)[1] - 1)
        if size > _FAR * scale[j]:
            centre[j] = float((lower + upper) / 2)
    return centre, scale


def scaled_points(points: list[list[Fraction]], centre: Floats, scale: Floats) -> Floats:
    """Return exact points in scaled coordinates, shape (k, n), each number rounded once."""
    middles = [Fraction(middle) for middle in centre.tolist()]
    units = [Fraction(unit) for unit in scale.tolist()]
    scaled = []
    for point in points:
        axes = zip(point, middles, units, strict=True)
        scaled.append([float((x - middle) / unit) for x, middle, unit in axes])
    return np.array(scaled)


def moved_limits(rows: Floats, limits: Floats, shift: Floats) -> Floats:
    """Return the limits of half-spaces rows (x - shift) <= limits for rows x <= `limits`."""
    if not shift.any():
        return limits
    moved, _ = affine_image(shift[None], -rows, limits.copy())
    return np.asarray(moved[0])


def largest_coordinate(points: Floats) -> float:
    """Return the maximum absolute coordinate of points, at least 1. Tolerances are relative."""
    return max(1.0, float(np.abs(points).max()))
