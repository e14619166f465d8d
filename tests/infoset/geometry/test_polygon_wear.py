"""Kernels on polygons as thin as rounding, which a thousand operations leave.

`test_polygon_oracle.py` has the operations on exactly convex polygons and on those with vertices
moved by an ulp.
"""

from __future__ import annotations

import numpy as np
import pytest

import infoset.geometry.polygon_reduction
from infoset.arrays import Floats
from infoset.geometry import polygon, polygon_exact, polygon_sum
from tests.infoset.geometry.test_polygon_oracle import exact, exact_sum, hull, outside_by
from tests.kernels import callable_kernels
from tests.rationals import Fraction

polygon_reduction = callable_kernels(infoset.geometry.polygon_reduction)

EPS = Fraction(1, 2**52)


def reach(*arrays: Floats) -> Fraction:
    """Maximum modulus of the coordinates of some arrays."""
    return Fraction(max(float(np.abs(array).max()) for array in arrays))


@pytest.mark.thorough
@pytest.mark.parametrize(("distance", "thickness"), [(0.0, 1e-16), (1.0, 1e-15), (1e4, 1e-12)])
def test_sum_of_a_sliver_with_a_segment_along_it_keeps_its_ends(
    distance: float, thickness: float
) -> None:
    """An end must not be lost where the lowest vertex is found on the upper side.

    Its height and the heights there agree within rounding.
    """
    rng = np.random.default_rng(1)
    for trial in range(8000):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        along = np.array([np.cos(angle), np.sin(angle)])
        across = np.array([-np.sin(angle), np.cos(angle)])
        parts, sides = rng.uniform(-1.0, 1.0, (2, 10))
        offsets = thickness * 10.0 ** rng.uniform(-1.0, 2.0) * sides * (1.0 - parts**2)
        cloud = distance + parts[:, np.newaxis] * along + offsets[:, np.newaxis] * across
        corners = np.empty((21, 2))
        corners = corners[: polygon_exact.hull(cloud, len(cloud), corners)]
        made = np.concatenate([corners, np.zeros((2, 2))])
        made = made[: polygon_sum.add_segment(made, len(corners), *(0.1 * along))]
        for end in (along, -along):
            grown = np.max((made - corners[0]) @ end) - np.max((corners - corners[0]) @ end)
            assert abs(grown - 0.1) <= 16 * float(EPS) * (1.0 + distance)
        if trial % 200 == 0:
            right = exact_sum(hull(exact(corners)), exact([0.1 * along, -0.1 * along]))
            box = (11 * EPS * (reach(corners) + 1),) * 2
            ends = hull(exact(made))
            assert outside_by(ends, right, box) is None
            assert outside_by(right, ends, box) is None


def test_reduction_of_a_set_as_thin_as_rounding_contains_it() -> None:
    """A rectangle replaces the set if rounding has left no edge a direction."""
    rng = np.random.default_rng(5)
    for _ in range(300):
        along = rng.uniform(-1.0, 1.0, 12)
        noise = 10.0 ** rng.uniform(-18.0, -15.0) * rng.uniform(-1.0, 1.0, 12)
        corners = np.stack([along, rng.uniform(-2.0, 2.0) * along + noise], axis=-1)
        reduced = corners.copy()
        reduced = reduced[: polygon_reduction.reduce_outward(reduced, len(reduced), 4)]
        assert len(reduced) <= 4
        tolerance = 11 * EPS * reach(reduced)
        assert outside_by(exact(corners), hull(exact(reduced)), (tolerance, tolerance)) is None
        assert polygon.moments(reduced, len(reduced))[0] < 1e-14


@pytest.mark.parametrize("count", [5, 16, 33, 60])
def test_edge_that_adds_the_minimum_area_is_removed_first(count: int) -> None:
    """The reference computes all areas again after each removal.

    The lengths are equal in pairs, so that areas are equal too.
    """
    random = np.random.default_rng(2)
    lengths = 10.0 ** random.uniform(-4.0, 0.0, count)
    turns = np.linspace(0.0, 3.0, count)
    directions = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    path = np.cumsum(np.minimum(lengths, lengths[::-1])[:, None] * directions, axis=0)

    expected = path.copy()
    while len(expected) > 4:
        removals = [
            polygon_reduction.removed_edge(expected, i - 1, i, i + 1, i + 2)
            for i in range(1, len(expected) - 2)
        ]
        first = min(range(len(removals)), key=lambda i: removals[i].added)
        expected[first + 1] = removals[first].x, removals[first].y
        expected = np.delete(expected, first + 2, axis=0)

    assert polygon_reduction.drop_inner_edges(path, count, 4, np.empty((128, 2))) == (4, True)
    np.testing.assert_array_equal(path[:4], expected)
