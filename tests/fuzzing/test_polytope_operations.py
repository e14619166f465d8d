"""Laws that polytopes in R^n obey.

Shown elsewhere: hulls and intersections are those of exact rationals, supports of sums, images and
projections, members of intersections, flat sets, empty and unbounded ones
(`tests/infoset/geometry/polytope`).

Here: every operation is monotone and includes what it must; cuts, sums, hulls and intersections
commute with linear maps (shear, shift, scaling, mirror); volumes scale by determinants, multiply in
products and obey Brunn and Minkowski.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from infoset.arrays import Floats
from infoset.geometry.polytope import (
    Polytope,
    product,
)

pytestmark = pytest.mark.thorough

some = settings(max_examples=4, deadline=None)
few = settings(max_examples=2, deadline=None)

SIZE = 10.0
ROUNDING = 1e-9 * SIZE
SEED = st.integers(0, 10**6)


def solid(seed: int, space: int) -> Polytope:
    """A hull of a dozen points of the box [-10, 10]^n, neither thin nor with facets nearly in one
    plane.
    """
    points = np.random.default_rng(seed).uniform(-SIZE, SIZE, (space + 8, space))
    return Polytope.from_vertices(points)


def map_of(kind: str, seed: int, space: int) -> Floats:
    """A matrix whose inverse is as harmless as itself."""
    generator = np.random.default_rng(seed)
    if kind == "mirror":
        return np.diag(generator.permutation(np.append(np.ones(space - 1), -1.0)))
    if kind == "scaling":
        return np.diag(generator.uniform(0.3, 3.0, space))
    return np.eye(space) + np.triu(generator.uniform(-1.0, 1.0, (space, space)), 1)


KIND = st.sampled_from(["shear", "mirror", "scaling"])
SPACE = st.integers(2, 4)


def lies_in(inner: Polytope, outer: Polytope, by: float = ROUNDING) -> bool:
    return float(outer.margin(inner.vertices).min()) >= -by


def same(one: Polytope, other: Polytope, by: float = ROUNDING) -> bool:
    return lies_in(one, other, by) and lies_in(other, one, by)


# Polytopes
# --------------------------------------------------------------------------------------------------


@some
@given(SEED, SPACE, KIND)
def test_operations_commute_with_linear_maps(seed: int, space: int, kind: str) -> None:
    one = solid(seed, space)
    other = solid(seed + 1, space)
    matrix = map_of(kind, seed, space)
    shift = np.random.default_rng(seed).uniform(-SIZE, SIZE, space)

    def moved(polytope: Polytope) -> Polytope:
        return polytope.affine_map(matrix, shift)

    inverse = np.linalg.inv(matrix)
    normals = np.random.default_rng(seed + 2).standard_normal((2, space))
    middle = one.vertices.mean(axis=0)
    offsets = normals @ middle + 0.4 * (one.support_function(normals) - normals @ middle)
    images = normals @ inverse
    assert same(
        moved(one.cut(normals, upper=offsets)),
        moved(one).cut(images, upper=offsets + images @ shift),
        1e-7 * SIZE,
    )
    together = one.minkowski_sum(other)
    assert same(moved(together), moved(one).minkowski_sum(other.affine_map(matrix)), 1e-7 * SIZE)
    common = one.intersection(other)
    if common.is_empty:
        assert moved(one).intersection(moved(other)).is_empty
    else:
        assume(common.volume() > 1e-3 and common.dimension == space)
        assert same(moved(common), moved(one).intersection(moved(other)), 1e-7 * SIZE)
    assert same(moved(one).affine_map(inverse, -inverse @ shift), one, 1e-7 * SIZE)


@some
@given(SEED, SPACE, st.floats(0.1, 1.0))
def test_operations_are_monotone_and_include_their_arguments(
    seed: int, space: int, part: float
) -> None:
    outer = solid(seed, space)
    other = solid(seed + 1, space)
    middle = outer.vertices.mean(axis=0)
    inner = outer.affine_map(part * np.eye(space), (1.0 - part) * middle)
    matrix = map_of("shear", seed, space)
    normal = np.ones((1, space))
    level = normal @ middle
    assert lies_in(inner, outer)
    assert lies_in(inner.affine_map(matrix), outer.affine_map(matrix))
    assert lies_in(inner.minkowski_sum(other), outer.minkowski_sum(other))
    assert lies_in(inner.cut(normal, upper=level), outer.cut(normal, upper=level))
    assert lies_in(outer.cut(normal, upper=level), outer)
    assert lies_in(inner.intersection(outer), inner)
    assert lies_in(inner.project([0, 1]), outer.project([0, 1]))
    assert lies_in(product(inner, other), product(outer, other))
    assert (
        inner.support_function(np.eye(space)) <= outer.support_function(np.eye(space)) + ROUNDING
    ).all()
    assert inner.volume() <= outer.volume() * (1.0 + 1e-9)
    hull = Polytope.from_vertices(np.vstack([outer.vertices, other.vertices]))
    assert lies_in(outer, hull)
    assert lies_in(other, hull)


@some
@given(SEED, SPACE, KIND, st.floats(0.0, 1.0))
def test_volumes_of_sums_and_intersections_are_consistent(
    seed: int, space: int, kind: str, part: float
) -> None:
    one = solid(seed, space)
    other = solid(seed + 1, space)
    matrix = map_of(kind, seed, space)
    volume = one.volume()
    assert one.affine_map(matrix, np.ones(space)).volume() == pytest.approx(
        abs(float(np.linalg.det(matrix))) * volume, rel=1e-9
    )
    assert one.minkowski_sum(one).volume() == pytest.approx(2.0**space * volume, rel=1e-9)
    minimum = volume ** (1.0 / space) + other.volume() ** (1.0 / space)
    assert one.minkowski_sum(other).volume() ** (1.0 / space) >= minimum * (1.0 - 1e-9)
    assert volume <= float(np.prod(np.subtract(*one.bounding_box()[::-1])))
    line = Polytope.from_box([-1.0], [2.0])
    assert product(one, line).volume() == pytest.approx(3.0 * volume, rel=1e-9)
    normal = np.random.default_rng(seed).standard_normal((1, space))
    low = -float(one.support_function(-normal)[0])
    high = float(one.support_function(normal)[0])
    level = np.array([low + (0.05 + 0.9 * part) * (high - low)])
    pieces = one.cut(normal, upper=level).volume() + one.cut(-normal, upper=-level).volume()
    assert pieces == pytest.approx(volume, rel=1e-7)
