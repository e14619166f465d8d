"""Laws that the sets of `rendezvous` obey: polytopes in R^n and reachable sets.

Shown elsewhere: hulls and intersections are those of exact rationals, supports of sums, images and projections,
members of intersections, flat sets, empty and unbounded ones (`tests/infoset/geometry/polytope`); exact and lifted
reachable sets agree with each other and with rationals, samples and selections are members
(`tests/rendezvous/reachability`). The other problems have no set operations: a front of points
(`tests/rendezvous/pareto`), paths, or numbers.

Here: every operation is monotone and includes what it must; cuts, sums, hulls and intersections commute with linear
maps (shear, shift, scaling, mirror); volumes scale by determinants, multiply in products and obey Brunn and Minkowski.
Reachable sets: more thrust reaches more; a step is the image, the sum and the cut it is said to be; mirrored starts and
other units of the state give the mirrored and the scaled sets.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from infoset.arrays import Floats
from infoset.geometry.polytope import (
    Polytope,
    product,
)
from rendezvous.reachability import EmptyTubeError, ReachabilityProblem, Route, SetKind, Solution, solve

pytestmark = pytest.mark.thorough

some = settings(max_examples=4, deadline=None)
few = settings(max_examples=2, deadline=None)

SIZE = 10.0
ROUNDING = 1e-9 * SIZE
SEED = st.integers(0, 10**6)


def solid(seed: int, space: int) -> Polytope:
    """A hull of a dozen points of the box [-10, 10]^n, neither thin nor with facets nearly in one plane."""
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
    return float(outer.excess(inner.vertices).max()) <= by


def same(one: Polytope, other: Polytope, by: float = ROUNDING) -> bool:
    return lies_in(one, other, by) and lies_in(other, one, by)


# Polytopes ------------------------------------------------------------------------------------------------------


@some
@given(SEED, SPACE, KIND)
def test_operations_commute_with_linear_maps(seed: int, space: int, kind: str) -> None:
    one, other, matrix = solid(seed, space), solid(seed + 1, space), map_of(kind, seed, space)
    shift = np.random.default_rng(seed).uniform(-SIZE, SIZE, space)

    def moved(polytope: Polytope) -> Polytope:
        return polytope.affine_map(matrix, shift)

    inverse = np.linalg.inv(matrix)
    normals = np.random.default_rng(seed + 2).standard_normal((2, space))
    middle = one.vertices.mean(axis=0)
    offsets = normals @ middle + 0.4 * (one.support_function(normals) - normals @ middle)
    images = normals @ inverse
    assert same(
        moved(one.cut(normals, upper=offsets)), moved(one).cut(images, upper=offsets + images @ shift), 1e-7 * SIZE
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
def test_operations_are_monotone_and_include_what_they_must(seed: int, space: int, part: float) -> None:
    outer, other = solid(seed, space), solid(seed + 1, space)
    middle = outer.vertices.mean(axis=0)
    inner = outer.affine_map(part * np.eye(space), (1.0 - part) * middle)
    matrix, normal = map_of("shear", seed, space), np.ones((1, space))
    level = normal @ middle
    assert lies_in(inner, outer)
    assert lies_in(inner.affine_map(matrix), outer.affine_map(matrix))
    assert lies_in(inner.minkowski_sum(other), outer.minkowski_sum(other))
    assert lies_in(inner.cut(normal, upper=level), outer.cut(normal, upper=level))
    assert lies_in(outer.cut(normal, upper=level), outer)
    assert lies_in(inner.intersection(outer), inner)
    assert lies_in(inner.project([0, 1]), outer.project([0, 1]))
    assert lies_in(product(inner, other), product(outer, other))
    assert (inner.support_function(np.eye(space)) <= outer.support_function(np.eye(space)) + ROUNDING).all()
    assert inner.volume() <= outer.volume() * (1.0 + 1e-9)
    hull = Polytope.from_vertices(np.vstack([outer.vertices, other.vertices]))
    assert lies_in(outer, hull)
    assert lies_in(other, hull)


@some
@given(SEED, SPACE, KIND, st.floats(0.0, 1.0))
def test_volumes(seed: int, space: int, kind: str, part: float) -> None:
    one, other, matrix = solid(seed, space), solid(seed + 1, space), map_of(kind, seed, space)
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
    low, high = -float(one.support_function(-normal)[0]), float(one.support_function(normal)[0])
    level = np.array([low + (0.05 + 0.9 * part) * (high - low)])
    pieces = one.cut(normal, upper=level).volume() + one.cut(-normal, upper=-level).volume()
    assert pieces == pytest.approx(volume, rel=1e-7)


# Reachable sets -------------------------------------------------------------------------------------------------


def problem(seed: int) -> ReachabilityProblem:
    """A random plant of two or three states; what is asked of it is near enough to be reached."""
    generator = np.random.default_rng(seed)
    states, periods = int(generator.integers(2, 4)), int(generator.integers(2, 4))
    return ReachabilityProblem(
        np.eye(states) + 0.3 * generator.standard_normal((periods, states, states)),
        np.repeat(np.eye(states)[None], periods, axis=0) + 0.1 * generator.standard_normal((periods, states, states)),
        generator.uniform(-0.4, 0.4, states),
        np.full(states, 2.0),
        generator.uniform(0.5, 1.5, states),
    )


def solved(given_problem: ReachabilityProblem) -> Solution:
    try:
        return solve(given_problem, Route.EXACT)
    except EmptyTubeError:
        assume(False)
        raise


def probes(seed: int, states: int) -> Floats:
    return np.vstack([np.eye(states), -np.eye(states), np.random.default_rng(seed).standard_normal((6, states))])


@few
@given(SEED, st.floats(1.0, 2.0))
def test_more_thrust_and_wider_limits_reach_more(seed: int, more: float) -> None:
    asked = problem(seed)
    few_sets = solved(asked).sets
    seen = probes(seed, asked.states)
    for wider in (
        replace(asked, control_bounds=asked.control_bounds * more),
        replace(asked, state_bounds=asked.state_bounds * more),
    ):
        many = solved(wider).sets
        for time in range(asked.periods + 1):
            less = few_sets.support(SetKind.FORWARD, time, seen)
            assert (less <= many.support(SetKind.FORWARD, time, seen) + 1e-8).all()


@few
@given(SEED)
def test_a_step_is_the_image_the_sum_and_the_cut(seed: int) -> None:
    asked = problem(seed)
    sets = solved(asked).sets
    seen = probes(seed, asked.states)
    reached = Polytope.from_vertices(asked.initial[None, :])
    thrust = Polytope.from_box(-asked.control_bounds, asked.control_bounds)
    limits = Polytope.from_box(-asked.state_bounds, asked.state_bounds)
    for time in range(asked.periods):
        pushed = thrust.affine_map(asked.control[time])
        reached = reached.affine_map(asked.transition[time]).minkowski_sum(pushed).intersection(limits)
        np.testing.assert_allclose(
            sets.support(SetKind.FORWARD, time + 1, seen), reached.support_function(seen), atol=1e-7
        )


@few
@given(SEED)
def test_mirrored_starts_and_other_units_give_mirrored_and_scaled_sets(seed: int) -> None:
    asked = problem(seed)
    plain = solved(asked)
    unit = 2.0 ** np.random.default_rng(seed).integers(-6, 7, asked.states)
    scaled = replace(
        asked,
        transition=unit[:, None] * asked.transition / unit,
        control=unit[:, None] * asked.control,
        initial=unit * asked.initial,
        state_bounds=unit * asked.state_bounds,
    )
    mirrored, other = solved(replace(asked, initial=-asked.initial)), solved(scaled)
    seen = probes(seed, asked.states)
    for kind in SetKind:
        for time in range(asked.periods + 1):
            wanted = plain.sets.support(kind, time, seen)
            np.testing.assert_allclose(mirrored.sets.support(kind, time, -seen), wanted, atol=1e-7)
            np.testing.assert_allclose(other.sets.support(kind, time, seen / unit), wanted, atol=1e-7)
