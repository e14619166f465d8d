"""Operations of a polygon with a polytope of the plane, in either order."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from infoset import ConvexPolygons, Polytope

NEAR = 1e-8
"""Distance between results of the two classes. The sets are less than 32 wide, and a polytope
exceeds the exact set by about 1e-12 of its size. Sides between integer points at most 12 apart meet
at angles above 1/144, which moves their crossing by 144 times as much; different results are
farther apart than 1/144."""

SETS: list[str] = ["intersection", "minkowski_sum", "minkowski_difference", "convex_hull"]
NUMBERS: list[str] = ["distance", "hausdorff_distance"]
ANSWERS: list[str] = ["is_subset", "equals", "isdisjoint"]


def some_polygon(random: np.random.Generator) -> ConvexPolygons:
    """A polygon, a segment or a point with small integer coordinates.

    Different sets are far apart.
    """
    size = random.choice([1, 2, 3, 4, 6])
    return ConvexPolygons.from_points(random.integers(-4, 5, (size, 2)))


def in_both_orders(one: ConvexPolygons, other: ConvexPolygons) -> list[tuple[Any, Any]]:
    """A polygon and a polytope, and a polytope and a polygon, for two sets."""
    return [(one, other.polytope()), (one.polytope(), other)]


@pytest.mark.parametrize("seed", range(25))
@pytest.mark.parametrize("name", SETS)
def test_set_made_from_polygon_and_polytope_is_the_exact_one_to_rounding(
    name: str, seed: int
) -> None:
    random = np.random.default_rng(seed)
    one = some_polygon(random)
    other = some_polygon(random)
    if name == "minkowski_difference":
        # A difference with an interior, or certainly none: rounding decides about a flat one of
        # polytopes.
        box = ConvexPolygons.from_box([-1, -1], [1, 1])
        one, other = (one + other + box, other) if seed % 2 else (one, other + 9 * box)

    exact = getattr(one, name)(other)

    for left, right in in_both_orders(one, other):
        made = getattr(left, name)(right)

        assert isinstance(made, Polytope)
        assert made.is_empty == exact.is_empty
        assert exact.hausdorff_distance(ConvexPolygons.from_points(made.vertices)) <= NEAR


@pytest.mark.parametrize("seed", range(25))
@pytest.mark.parametrize("name", NUMBERS)
def test_distance_of_polygon_and_polytope_is_the_exact_one_to_rounding(
    name: str, seed: int
) -> None:
    random = np.random.default_rng(seed)
    one = some_polygon(random)
    other = some_polygon(random)
    exact = float(getattr(one, name)(other))

    for left, right in in_both_orders(one, other):
        assert float(getattr(left, name)(right)) == pytest.approx(exact, abs=NEAR)


@pytest.mark.parametrize("seed", range(25))
@pytest.mark.parametrize("name", ANSWERS)
def test_answer_for_polygon_and_polytope_is_the_exact_one(name: str, seed: int) -> None:
    """Some sets are equal or parts of each other; others are far from it."""
    random = np.random.default_rng(seed)
    one = some_polygon(random)
    other = [one, one + some_polygon(random), some_polygon(random)][seed % 3]
    exact = bool(getattr(one, name)(other))

    for left, right in in_both_orders(one, other):
        assert bool(getattr(left, name)(right)) == exact


@pytest.mark.parametrize(
    ("apply", "name"),
    [
        (operator.and_, "intersection"),
        (operator.add, "minkowski_sum"),
        (operator.le, "is_subset"),
    ],
)
def test_operators_take_sets_of_both_classes(apply: Callable[[Any, Any], Any], name: str) -> None:
    square = ConvexPolygons.from_box([0, 0], [2, 2])
    other = ConvexPolygons.from_box([1, 1], [3, 4])

    for left, right in in_both_orders(square, other):
        made = apply(left, right)
        wanted = getattr(left, name)(right)

        if isinstance(wanted, Polytope):
            assert made.vertices.tolist() == wanted.vertices.tolist()
        else:
            assert made == wanted


def test_polytope_takes_several_polygons_and_polytopes() -> None:
    square = Polytope.from_box([0, 0], [4, 4])
    polygon = ConvexPolygons.from_box([1, 0], [5, 3])
    polytope = Polytope.from_box([0, 2], [3, 6])

    assert square.intersection(polygon, polytope).equals(Polytope.from_box([1, 2], [3, 3]), NEAR)
    assert square.convex_hull(polygon, polytope).area() == pytest.approx(27.0, abs=NEAR)


def test_witness_separates_a_polytope_from_a_polygon() -> None:
    direction = Polytope.from_box([0, 0], [1, 1]).separating_direction(
        ConvexPolygons.from_box([2, 0], [3, 1])
    )

    assert direction == pytest.approx([1.0, 0.0], abs=1e-15)


@pytest.mark.parametrize("name", [*SETS, *NUMBERS, *ANSWERS])
def test_empty_set_of_the_other_class_gives_the_results_of_the_same_class(name: str) -> None:
    square = ConvexPolygons.from_box([0, 0], [2, 2])
    empty = ConvexPolygons.empty()

    for one, other in [(square, empty), (empty, square), (empty, empty)]:
        for left, right in in_both_orders(one, other):
            if name == "minkowski_difference" and one is square:
                with pytest.raises(
                    ValueError, match="the difference with an empty set is unbounded"
                ):
                    getattr(left, name)(right)
                continue
            found = getattr(left, name)(right)
            wanted = getattr(one, name)(other)
            if isinstance(found, Polytope):
                assert ConvexPolygons.from_points(found.vertices).equals(wanted)
            else:
                assert found == wanted


@pytest.mark.parametrize("name", [*SETS, *NUMBERS, *ANSWERS])
def test_batch_and_polytope_of_another_space_are_refused(name: str) -> None:
    square = ConvexPolygons.from_box([0, 0], [2, 2])
    batch = ConvexPolygons.stack([square, square])
    in_space = Polytope.from_box([0, 0, 0], [1, 1, 1])

    for left, right in [(batch, square.polytope()), (square.polytope(), batch)]:
        with pytest.raises(
            ValueError,
            match=r"a batch of shape \(2,\) is no Polytope: choose one with an index first",
        ):
            getattr(left, name)(right)
    for left, right, space in [(square, in_space, 2), (in_space, square, 3)]:
        with pytest.raises(ValueError, match=rf"other must be a set in R\^{space}, as this one"):
            getattr(left, name)(right)


@pytest.mark.parametrize("name", [*SETS, *ANSWERS, "hausdorff_distance"])
@pytest.mark.parametrize("kind", [ConvexPolygons, Polytope])
def test_argument_other_than_a_set_is_refused(kind: Any, name: str) -> None:
    with pytest.raises(TypeError, match="other must be"):
        getattr(kind.from_box([0, 0], [1, 1]), name)("a set")
