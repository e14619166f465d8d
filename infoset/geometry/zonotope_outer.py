"""Outer sets of zonotopes, as arrays: fewer generators, and the part within strips."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats
from infoset.geometry.double_words import affine_image
from infoset.geometry.tolerances import EPS, ON
from infoset.geometry.zonotope_arrays import box_generators

_SINGULAR = ON
"""Share of the largest eigenvalue below which strips count as dependent.

Any value gives a zonotope that contains the part: it holds for every gain.
"""


class CentreAndGenerators(NamedTuple):
    """The arrays of a zonotope, shapes (n,) and (m, n)."""

    centre: Floats
    generators: Floats


def fewer_generators(generators: Floats, count: int) -> Floats:
    """Return at most `count` >= n generators of a zonotope that contains a given one.

    The generators have the shape (m, n). The ones with the greatest |g|_1 - |g|_inf, in units of
    the widths of the set, stay. The others become a box around their sum: also long ones along an
    axis, which a box has exactly. O(m n).

    References
    ----------
    A. Girard, Reachability of uncertain linear systems using zonotopes, in HSCC (2005).
    """
    if len(generators) <= count:
        return generators
    sizes = np.abs(generators)
    widths = sizes.sum(axis=0)
    shares = sizes / np.where(widths > 0.0, widths, 1.0)
    # In ascending order of |g|_inf - |g|_1: the generators that stay come first.
    ranks = np.argsort(shares.max(axis=1) - shares.sum(axis=1), kind="stable")

    # The box takes up to n generators.
    kept = count - generators.shape[1]
    box = box_generators(_sums_up(sizes[ranks[kept:]]))
    return np.vstack([generators[np.sort(ranks[:kept])], box])


def corrected_by_strips(
    centre: Floats, generators: Floats, rows: Floats, low: Floats, high: Floats
) -> CentreAndGenerators:
    """Return a zonotope that contains the part of another one in strips low <= rows x <= high.

    The rows C have the shape (k, n). x = x + K (y - C x - v) holds for each x of the part, with y
    the middles of the strips and |v| at most half of their widths, and for every matrix K. The gain
    K that is used gives the smallest sum of squares of the generators (`Zonotope.cut`). Rounding is
    added as a box. O((m + n) n k + k^3).
    """
    # Rounding of the middle must not lose an end.
    y = 0.5 * low + 0.5 * high
    half = np.nextafter(np.maximum(high - y, y - low), np.inf)

    # In units of the widths of the strips' normals the matrix to invert has ones on its diagonal.
    images = generators @ rows.T
    covariance = images.T @ images + np.diag(half**2)
    units = np.sqrt(np.diag(covariance))
    units = np.where(units > 0.0, units, 1.0)
    inverse = _inverse(covariance / units / units[:, None])
    gain = generators.T @ (images / units) @ inverse / units

    corrected = np.vstack([generators - images @ gain.T, half[:, None] * gain.T])
    corrected = corrected[corrected.any(axis=1)]

    # Rounding: each number is a sum of at most so many products, of these sizes. Eight more are for
    # the centre, a bound and the rounding itself, as in `Zonotope._operations`.
    operations = sum(generators.shape) + 8 + len(rows)
    sizes = np.abs(centre) + np.abs(generators).sum(axis=0)
    terms = sizes + np.abs(gain) @ (np.abs(rows) @ sizes + np.abs(y) + half)
    box = box_generators(operations * EPS * terms)

    return CentreAndGenerators(centre + gain @ (y - rows @ centre), np.vstack([corrected, box]))


def _inverse(matrix: Floats) -> Floats:
    """Return the pseudo-inverse of a symmetric matrix with a diagonal of ones."""
    values, vectors = np.linalg.eigh(matrix)
    used = values > _SINGULAR * values[-1]
    return np.asarray((vectors[:, used] / values[used]) @ vectors[:, used].T)


def _sums_up(sizes: Floats) -> Floats:
    """Return the sums of nonnegative numbers in each column, rounded up."""
    ones = np.ones((1, len(sizes)))
    sums, lost = affine_image(ones, np.ascontiguousarray(sizes.T), np.zeros(sizes.shape[1]))
    return np.asarray(np.where(lost > 0.0, np.nextafter(sums[0], np.inf), sums[0]))
