"""The sets of differences against polygons in rational numbers."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from numpy.typing import NDArray

from infoset.sim.bound.difference_sets import farthest_difference

Floats = NDArray[np.float64]
Point = tuple[Fraction, Fraction]

ROUNDING = 1e-12
"""A height is a sum of at most 30 products, one for each segment: below 30 ulp. At most 20 cuts
pass it on.
"""


def exact(values: Floats) -> Point:
    return Fraction(float(values[0])), Fraction(float(values[1]))


def dot(one: Point, other: Point) -> Fraction:
    return one[0] * other[0] + one[1] * other[1]


def cross(origin: Point, one: Point, other: Point) -> Fraction:
    first = one[0] - origin[0], one[1] - origin[1]
    second = other[0] - origin[0], other[1] - origin[1]
    return first[0] * second[1] - first[1] * second[0]


def hull(points: list[Point]) -> list[Point]:
    """Return the vertices of a convex hull, counterclockwise."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return ordered
    halves = []
    for chain in (ordered, ordered[::-1]):
        half: list[Point] = []
        for point in chain:
            while len(half) > 1 and cross(half[-2], half[-1], point) <= 0:
                half.pop()
            half.append(point)
        halves.append(half[:-1])
    return halves[0] + halves[1]


def add(polygon: list[Point], segment: Point) -> list[Point]:
    return hull(
        [(x + sign * segment[0], y + sign * segment[1]) for x, y in polygon for sign in (1, -1)]
    )


def clip(polygon: list[Point], normal: Point, limit: Fraction) -> list[Point]:
    """Return the vertices with dot(normal, point) <= limit, and the points where edges cross the
    border.
    """
    kept = [point for point in polygon if dot(normal, point) <= limit]
    for one, other in zip(polygon, polygon[1:] + polygon[:1], strict=True):
        inside = dot(normal, one) - limit
        outside = dot(normal, other) - limit
        if inside * outside < 0:
            share = inside / (inside - outside)
            kept.append(
                (one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1]))
            )
    return hull(kept)


class Case:
    """Random widths, accelerations and strips of the kind of a flight, and others that are hard for
    rounding.
    """

    def __init__(self, kind: str, number: int) -> None:
        random = np.random.default_rng([number, len(kind)])
        steps = int(random.integers(3, 10))
        times_s = np.arange(steps) + random.uniform(0.0, 0.5)
        arrival_s = times_s[-1] + random.uniform(0.1, 2.0)
        self.widths = 10.0 ** random.uniform(-1.0, 3.0, 2)
        self.towards = np.array([1.0, arrival_s])
        strength = 10.0 ** random.uniform(-2.0, 2.0)
        self.pushes = strength * np.column_stack([-times_s - 0.5, np.ones(steps)])
        self.normals = np.ones((steps, 2, 2))
        self.normals[:, 0, 1] = times_s
        self.normals[:, 1, 1] = arrival_s
        self.limits = 10.0 ** random.uniform(-1.0, 3.0, (steps, 2))
        self.limits[random.random((steps, 2)) < 0.3] = np.inf
        if kind == "any directions":
            self.pushes = random.normal(size=(steps, 2)) * 10.0 ** random.uniform(
                -3.0, 3.0, (steps, 1)
            )
            self.normals = random.normal(size=(steps, 2, 2))
            self.towards = random.normal(size=2)
        if kind in ("parallel", "nearly parallel"):
            # Accelerations along borders, in both orientations, and strips with the same normal.
            borders = self.normals[
                random.integers(steps, size=steps), random.integers(2, size=steps)
            ]
            sizes = random.choice([-1.0, 1.0], steps) * 10.0 ** random.uniform(-2.0, 2.0, steps)
            self.pushes = sizes[:, None] * np.column_stack([-borders[:, 1], borders[:, 0]])
        if kind == "nearly parallel":
            ulps = random.integers(-4, 5, (steps, 2))
            self.pushes *= 1.0 + ulps * np.finfo(float).eps
            self.normals *= 1.0 + random.integers(-4, 5, self.normals.shape) * np.finfo(float).eps
        if kind == "extreme limits":
            extremes = random.choice([0.0, 1e-300, 1e-18, 1e-9, 1e18, 1e300], self.limits.shape)
            self.limits = np.where(random.random(self.limits.shape) < 0.5, extremes, self.limits)
        if kind == "nothing moves":
            self.pushes[random.random(steps) < 0.5] = 0.0
            self.widths[int(random.integers(2))] = 0.0
            self.pushes *= random.choice([0.0, 1.0])

    @property
    def size(self) -> float:
        """The maximum difference at the arrival without measurements."""
        along = np.abs(self.towards * self.widths).sum()
        return float(along + np.abs(self.pushes @ self.towards).sum())

    def farthest(self) -> list[Fraction]:
        """Return the maximum differences with equal measurements in the first 0, 1, ..., steps, by
        clipping.
        """
        widths = [Fraction(float(width)) for width in self.widths]
        towards = exact(self.towards)
        steps = len(self.pushes)
        later = [abs(dot(towards, exact(push))) for push in self.pushes]
        polygon = hull([(x * widths[0], y * widths[1]) for x in (-1, 1) for y in (-1, 1)])
        found = [max(dot(towards, point) for point in polygon) + sum(later)]
        for k in range(steps):
            for normal, limit in zip(self.normals[k], self.limits[k], strict=True):
                if limit < np.inf:
                    one = exact(normal)
                    polygon = clip(polygon, one, Fraction(float(limit)))
                    polygon = clip(polygon, (-one[0], -one[1]), Fraction(float(limit)))
            found.append(max(dot(towards, point) for point in polygon) + sum(later[k:]))
            polygon = add(polygon, exact(self.pushes[k]))
        return found


KINDS = [
    "flight",
    "any directions",
    "parallel",
    "nearly parallel",
    "extreme limits",
    "nothing moves",
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("number", range(12))
def test_farthest_differences_equal_the_maxima_of_rational_polygons(kind: str, number: int) -> None:
    case = Case(kind, number)
    steps = len(case.pushes)

    found = farthest_difference(
        case.widths, case.pushes, case.normals, case.limits, case.towards, steps
    )

    expected = [float(value) for value in case.farthest()]
    assert found.farthest == pytest.approx(expected, abs=ROUNDING * case.size)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("number", range(12))
def test_farthest_member_is_in_all_strips_and_reaches_the_maximum(kind: str, number: int) -> None:
    case = Case(kind, number)
    for common in range(len(case.pushes) + 1):
        found = farthest_difference(
            case.widths, case.pushes, case.normals, case.limits, case.towards, common
        )

        assert len(found.farthest) == common + 1
        assert np.abs(found.start).max() <= 1.0
        assert np.abs(found.pushes).max() <= 1.0
        member = found.start * case.widths
        for k, push in enumerate(case.pushes):
            if k < common:
                heights = np.abs(case.normals[k] @ member)
                # The height of a member is a sum of the heights of all segments, which cancel.
                largest = np.abs(
                    case.normals[k] @ np.column_stack([np.diag(case.widths), case.pushes[:k].T])
                ).sum(axis=1)
                assert (heights <= case.limits[k] + ROUNDING * largest).all()
            member = member + found.pushes[k] * push
        assert case.towards @ member == pytest.approx(found.farthest[-1], abs=ROUNDING * case.size)


def test_strip_with_an_infinite_limit_does_not_cut() -> None:
    case = Case("flight", 1)
    limits = case.limits.copy()
    limits[1:] = np.inf

    left_out = farthest_difference(
        case.widths, case.pushes, case.normals, limits, case.towards, len(case.pushes)
    )
    first = farthest_difference(
        case.widths, case.pushes, case.normals, case.limits, case.towards, 1
    )

    assert left_out.farthest[-1] == pytest.approx(first.farthest[-1], rel=ROUNDING)
