"""The nearest points of two convex hulls, also of hulls that are far from each other."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats, Integers
from infoset.geometry.double_words import two_product, two_sum
from infoset.geometry.tolerances import EPS, ON
from infoset.kernels import Kernels

# Without fast-math: sums in another order would lose the errors.
_kernels = Kernels()

_MAX_PAIRS = 1000
"""Maximum number of pairs of vertices that Wolfe's algorithm adds, a guard: it ends after a few
vertices of each hull. For 23 random pairs of hulls 10 are enough (measured)."""
_PRECISION = 64.0 * EPS
"""Decrease of x . d, for hulls of the size one, that a new pair must offer, relative to the squared
length of x, or to one if x is longer: 64 roundings.
"""
_REFINEMENTS = 3
"""Maximum number of corrections of the shares. Each multiplies their error by 1e-16 times the
squared condition number of the edges. For 23 random pairs of hulls one is enough, and without any
correction distances are wrong (measured).
"""
_SMALL_STEP = 0.5 * EPS
"""Change of the shares that is their rounding."""
_DEPENDENT = ON
"""Part of an edge, relative to it, that is orthogonal to others, below which it is rounding."""
_SMALLEST = 1e-90
"""Size of the hulls, relative to the coordinates, up to which they count as points. In units of
larger hulls coordinates are at most 1e90, whose squares do not overflow.
"""


class NearestPair(NamedTuple):
    """Nearest points of two hulls, each of shape (n,), and their `difference`, point - other."""

    point: Floats
    other: Floats
    difference: Floats


def nearest_pair(one: Floats, two: Floats) -> NearestPair:
    """Return the nearest points of the hulls of two sets of points, shapes (k, n) and (m, n).

    The points are convex combinations of the given ones. Which vertices they combine, and with
    which shares, follows from differences of vertices of one hull and from products with doubled
    digits. The rounding is therefore relative to the size of the hulls, not to their distance.

    References
    ----------
    P. Wolfe, Finding the nearest point in a polytope, Mathematical Programming 11 (1976).
    """
    extent = max(float(np.abs(one - one[0]).max()), float(np.abs(two - two[0]).max()))
    largest = max(float(np.abs(one).max()), float(np.abs(two).max()))
    if extent <= _SMALLEST * largest:
        return NearestPair(one[0], two[0], one[0] - two[0])

    unit = np.ldexp(1.0, np.frexp(extent)[1])
    one_unit = np.ascontiguousarray(one / unit)
    two_unit = np.ascontiguousarray(two / unit)
    i, j, shares = _shares_of_nearest(one_unit, two_unit)
    difference, _ = _combination(shares, one[i], two[j])
    return NearestPair(shares @ one[i], shares @ two[j], difference)


def _shares_of_nearest(one: Floats, two: Floats) -> tuple[Integers, Integers, Floats]:
    """Return the vertices i and j of pairs, and the shares of the pairs in the nearest points.

    The hulls have the size one.
    """
    i = j = np.zeros(1, np.int64)
    shares = np.ones(1)
    for _ in range(_MAX_PAIRS):
        p, q, gap, is_known = _next_pair(one, two, i, j, shares)
        if is_known or gap <= 0.0:
            break

        i = np.append(i, p)
        j = np.append(j, q)
        shares = np.append(shares, 0.0)
        while True:
            target = _affine_minimizer(one[i], two[j], shares)
            if (target > 0.0).all():
                shares = target
                break

            # Go toward the minimizer until a share is zero; drop that pair. A share that is zero
            # already does not decrease: 1e-300 is a divisor in place of zero.
            below = target <= 0.0
            decrease = np.maximum(shares[below] - target[below], 1e-300)
            part = float(np.min(shares[below] / decrease))
            shares = shares + min(1.0, part) * (target - shares)
            shares[below & (shares <= shares[below].min())] = 0.0
            kept = shares > 0.0
            i = i[kept]
            j = j[kept]
            shares = shares[kept] / shares[kept].sum()
    return i, j, shares


@_kernels.compiled
def _next_pair(
    one: Floats, two: Floats, i: Integers, j: Integers, shares: Floats
) -> tuple[int, int, float, bool]:
    """Return the pair of vertices with the lowest difference along x, its gain, and if it is known.

    x is the present difference. The gain is x . x - x . d for the new difference d, less the
    minimum gain (`_PRECISION`). The pair is known if a present pair has the same difference.
    """
    x, low = _combination(shares, one[i], two[j])
    heights = _heights(one, one[i[0]], x, low)
    other_heights = _heights(two, two[j[0]], x, low)
    p = int(np.argmin(heights))
    q = int(np.argmax(other_heights))

    # The bases of the heights cancel: x . x is the mean of the present pairs, by their shares.
    gap = other_heights[q] - heights[p]
    is_known = False
    for k in range(len(shares)):
        gap += shares[k] * (heights[i[k]] - other_heights[j[k]])
        is_same = True
        for axis in range(len(x)):
            is_same &= one[i[k], axis] - one[p, axis] == two[j[k], axis] - two[q, axis]
        is_known |= is_same

    length_squared = 0.0
    for value in x:
        length_squared += value * value
    return p, q, gap - _PRECISION * min(1.0, max(length_squared, _PRECISION)), is_known


@_kernels.compiled
def _affine_minimizer(one: Floats, two: Floats, shares: Floats) -> Floats:
    """Return the coefficients of the shortest affine combination x of the differences one - two.

    The differences have the shape (k, n); the coefficients have the sum 1. Newton steps from
    `shares`: the derivatives e . x along the edges e are precise, also if x is much longer than
    they.
    """
    result = shares.copy()
    if len(shares) == 1:
        return result

    lengths, triangle = _edge_factor(one, two)
    for _ in range(_REFINEMENTS):
        x, low = _combination(result, one, two)
        step = (_heights(two, two[0], x, low) - _heights(one, one[0], x, low))[1:] / lengths
        _solve(triangle, step)
        step /= lengths
        result[1:] += step
        result[0] -= step.sum()
        if np.abs(step).max() <= _SMALL_STEP:
            break
    return result


@_kernels.compiled
def _edge_factor(one: Floats, two: Floats) -> tuple[Floats, Floats]:
    """Return the lengths of the edges and R of E = Q R, with edges of length one as columns of E.

    The edges are the differences one - two, less the first one; no two differences are equal. An
    edge that depends on earlier edges has a zero on the diagonal of R.
    """
    basis = (one[1:] - one[0]) - (two[1:] - two[0])
    count = len(basis)
    lengths = np.empty(count)
    triangle = np.zeros((count, count))
    for k in range(count):
        lengths[k] = math.sqrt(np.square(basis[k]).sum())
        basis[k] /= lengths[k]
        # Orthogonalized twice, because of rounding.
        for m in range(2 * k):
            along = (basis[m % k] * basis[k]).sum()
            triangle[m % k, k] += along
            basis[k] -= along * basis[m % k]

        triangle[k, k] = math.sqrt(np.square(basis[k]).sum())
        if triangle[k, k] > _DEPENDENT:
            basis[k] /= triangle[k, k]
        else:
            triangle[k, k] = 0.0
            basis[k] = 0.0
    return lengths, triangle


@_kernels.allocation_free
def _solve(triangle: Floats, step: Floats) -> None:
    """Solve R' R z = step, in place; z is 0 where the diagonal of the triangle R is 0."""
    count = len(step)
    for k in range(count):
        for m in range(k):
            step[k] -= triangle[m, k] * step[m]
        step[k] = step[k] / triangle[k, k] if triangle[k, k] > 0.0 else 0.0
    for k in range(count - 1, -1, -1):
        for m in range(k + 1, count):
            step[k] -= triangle[k, m] * step[m]
        step[k] = step[k] / triangle[k, k] if triangle[k, k] > 0.0 else 0.0


@_kernels.compiled
def _combination(shares: Floats, one: Floats, two: Floats) -> tuple[Floats, Floats]:
    """Return the sum of shares, (k,), times differences of points, (k, n), as two parts each."""
    size = one.shape[1]
    high = np.zeros(size)
    low = np.zeros(size)
    for axis in range(size):
        for k in range(len(shares)):
            for sign, value in ((1.0, one[k, axis]), (-1.0, two[k, axis])):
                product, rounded = two_product(sign * shares[k], value)
                high[axis], lost = two_sum(high[axis], product)
                low[axis] += lost + rounded
        high[axis], low[axis] = two_sum(high[axis], low[axis])
    return high, low


@_kernels.compiled
def _heights(points: Floats, base: Floats, high: Floats, low: Floats) -> Floats:
    """Return (point - base) . (high + low) of points, shape (k, n), each rounded once.

    The differences are exact.
    """
    heights = np.empty(len(points))
    for k in range(len(points)):
        total = 0.0
        rest = 0.0
        for axis in range(len(base)):
            step, step_low = two_sum(points[k, axis], -base[axis])
            product, rounded = two_product(step, high[axis])
            total, lost = two_sum(total, product)
            rest += lost + rounded + (step * low[axis] + step_low * high[axis])
        heights[k] = total + rest
    return heights
