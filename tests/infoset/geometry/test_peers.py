"""Values of the tests of four other projects, computed by the operations of this one.

`peers.json` has one assertion a line: the project, the name of its test or file, the operation in
the words of this module, the sets, the arguments and the expected answer. Only numbers are taken:

* CORA, https://github.com/TUMcps/CORA (unit tests of polytopes and zonotopes),
* MPT3, https://github.com/kvasnica/mpt3 (tests of polyhedra),
* pycvxset, https://github.com/merlresearch/pycvxset (tests of polytopes),
* LazySets, https://github.com/JuliaReach/LazySets.jl (tests of polyhedra, polytopes and zonotopes).

If the answer of this project is different, the line has both: `expected` is the answer of the other
project, `here` the answer of this project, and `because` the reason.

A set is given by half-spaces (`normals`, `offsets`, `across`, `levels`), by `points`, perhaps with
`directions` and `lines`, by a `centre` and `generators`, one a row, or by `lower` and `upper`.
`empty` and `whole` are the empty set and R^n. Infinite numbers are strings.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.geometry.polytope import EmptyPolytopeError, Polytope, UnboundedPolytopeError, product
from infoset.geometry.zonotope import Zonotope

CASES: list[dict[str, Any]] = json.loads((Path(__file__).parent / "peers.json").read_text())
TOLERANCE = 1e-8
"""Distance of numbers that count as equal, absolute and relative.

The other projects compare with 1e-4 to 1e-14, and print ten digits of numbers that are not short
decimals.
"""
ERRORS: dict[str, type[Exception]] = {
    "EmptyPolytopeError": EmptyPolytopeError,
    "UnboundedPolytopeError": UnboundedPolytopeError,
    "ValueError": ValueError,
}
AnySet = Polytope | Zonotope


def numbers(values: Any) -> Floats:
    """Return numbers as floats; infinite ones are strings."""
    return np.array(values, dtype=float)


def space_of(given: dict[str, Any]) -> int:
    """Return the dimension of the space of a set of half-spaces."""
    rows = [*given["normals"], *given.get("across", [])]
    return len(rows[0])


def set_of(given: dict[str, Any]) -> AnySet:
    """Return a set of the data."""
    if "empty" in given:
        return Polytope.empty(given["empty"])
    if "whole" in given:
        return Polytope.space_of(given["whole"])
    if "lower" in given:
        return Polytope.from_box(given["lower"], given["upper"])
    if "points" in given:
        return Polytope.from_rays(
            given["points"], given.get("directions", ()), given.get("lines", ())
        )
    if "generators" in given:
        return Zonotope(given["centre"], given["generators"])
    space = space_of(given)
    normals = numbers(given["normals"]).reshape(-1, space)
    across = numbers(given.get("across", [])).reshape(-1, space)
    return Polytope.from_constraints(
        normals, numbers(given["offsets"]), across, given.get("levels", [])
    )


def facets_of(one: AnySet) -> Floats:
    """Return the rows (normal, offset) of a set with an interior, with normals of unit length."""
    return np.column_stack([one.polytope().normals, one.polytope().offsets])


def centroid(one: AnySet) -> Floats:
    return one.centroid()


def meets(one: AnySet, other: AnySet) -> bool:
    return not (one & other).is_empty


def has_interior(one: AnySet) -> bool:
    return one.dimension == one.space


def preimage(one: AnySet, matrix: Any, offset: Any = 0.0) -> Polytope:
    return one.polytope().preimage(matrix, offset)


def again(one: AnySet) -> Polytope:
    """Return the set of the facets of a set."""
    return Polytope.from_constraints(*one.polytope().constraints())


OPERATIONS: dict[str, Callable[..., Any]] = {
    # Sets.
    "intersection": lambda one, other: one & other,
    "hull": lambda one, other: one.convex_hull(other),
    "sum": lambda one, other: one + other,
    "difference": lambda one, other: one.minkowski_difference(other),
    "product": lambda *factors: product(*(factor.polytope() for factor in factors)),
    "map": lambda one, matrix, offset=0.0: one.affine_map(matrix, offset),
    "preimage": preimage,
    "projection": lambda one, axes: one.project(axes),
    "slice": lambda one, axes, values: one.polytope().slice(axes, values),
    "translation": lambda one, offset: one.translate(offset),
    "scaling": lambda one, factor: factor * one,
    "negation": lambda one: -one,
    # Properties of sets.
    "is empty": lambda one: one.is_empty,
    "is bounded": lambda one: one.polytope().is_bounded,
    "has an interior": has_interior,
    "is subset": lambda one, other: one.is_subset(other, TOLERANCE),
    "equals": lambda one, other: bool(one.equals(other, TOLERANCE)),
    "is disjoint": lambda one, other: one.polytope().isdisjoint(other),
    "meets": meets,
    "contains": lambda one, points: one.contains(points, TOLERANCE),
    # The same of results.
    "map is bounded": lambda one, matrix: one.linear_map(matrix).is_bounded,
    "map has an interior": lambda one, matrix: has_interior(one.linear_map(matrix)),
    "sum is bounded": lambda one, other: (one + other).is_bounded,
    "sum contains": lambda one, other, points: (one + other).contains(points),
    "sum contains the second": lambda one, other: other.is_subset(one + other, TOLERANCE),
    "difference is bounded": lambda one, other: one.minkowski_difference(other).is_bounded,
    "product has an interior": lambda one, other: has_interior(product(one, other)),
    "projection is empty": lambda one, axes: one.project(axes).is_empty,
    "projection contains": lambda one, axes, points: one.project(axes).contains(points),
    # Numbers.
    "dimension": lambda one: one.dimension,
    "dimension of the space": lambda one: one.space,
    "number of vertices": lambda one: len(one.vertices),
    "number of facets": lambda one: len(one.polytope().normals),
    "number of facets of the intersection": lambda one, other: len((one & other).normals),
    "number of facets of the product": lambda one, other: len(product(one, other).normals),
    "volume": lambda one: one.volume(),
    "area": lambda one: one.area(),
    "diameter": lambda one: one.polytope().diameter(),
    "distance": lambda one, other: one.polytope().distance(other),
    "Hausdorff distance": lambda one, other: one.polytope().hausdorff_distance(other),
    "radius of a largest ball": lambda one: one.polytope().chebyshev_centre()[1],
    # Arrays.
    "bounding box": lambda one: np.array(one.bounding_box()),
    "centroid": centroid,
    "mean of vertices": lambda one: one.vertices.mean(axis=0),
    "centre of a largest ball": lambda one: one.polytope().chebyshev_centre()[0],
    "closest point": lambda one, point: one.polytope().closest_point(point),
    "support": lambda one, directions: one.support_function(directions),
    "support vector": lambda one, direction: one.support_vector(direction),
    "equal supports": lambda one, other, directions: np.allclose(
        one.support_function(directions),
        other.support_function(directions),
        rtol=0.0,
        atol=TOLERANCE,
    ),
    # Rows in any order.
    "vertices": lambda one: one.vertices,
    "vertices of the half-spaces": lambda one: again(one).vertices,
    "half-spaces": facets_of,
    "half-spaces of the projection": lambda one, axes: facets_of(one.project(axes)),
}
IN_ANY_ORDER = [
    "vertices",
    "vertices of the half-spaces",
    "half-spaces",
    "half-spaces of the projection",
]


def assert_same_sets(found: AnySet, expected: AnySet) -> None:
    assert found.space == expected.space
    assert found.is_empty == expected.is_empty
    assert found.dimension == expected.dimension
    assert found.polytope().is_bounded == expected.polytope().is_bounded
    assert found.equals(expected, TOLERANCE)


def assert_same_rows(found: Floats, expected: Floats) -> None:
    """Check that each row of one table is in the other one, and that they have equal lengths."""
    assert len(found) == len(expected)
    if not len(expected):
        return
    apart = np.abs(found[:, None] - expected).max(axis=2)
    near = TOLERANCE * max(1.0, float(np.abs(expected).max()))
    assert apart.min(axis=0).max() <= near
    assert apart.min(axis=1).max() <= near


def name_of(number: int) -> str:
    case = CASES[number]
    return f"{case['peer']}-{case['test']}-{case['operation']}-{number}"


@pytest.mark.parametrize("number", range(len(CASES)), ids=name_of)
def test_answer_is_equal_to_the_other_project_or_its_difference_is_explained(number: int) -> None:
    case = CASES[number]
    sets = [set_of(given) for given in case["sets"]]
    arguments = dict(case.get("arguments", {}))
    near = arguments.pop("tolerance", TOLERANCE)
    expected = case.get("here", case["expected"])
    operation = OPERATIONS[case["operation"]]
    if isinstance(expected, str) and expected in ERRORS:
        with pytest.raises(ERRORS[expected]):
            operation(*sets, **arguments)
        return

    found = operation(*sets, **arguments)

    if isinstance(expected, dict):
        assert_same_sets(found, set_of(expected))
    elif case["operation"] in IN_ANY_ORDER:
        assert_same_rows(found, numbers(expected))
    else:
        np.testing.assert_allclose(
            np.asarray(found, float), numbers(expected), rtol=near, atol=near
        )


def test_each_difference_has_a_reason_and_is_one() -> None:
    for case in CASES:
        assert ("here" in case) == ("because" in case)
        assert case.get("here") != case["expected"]


def test_each_of_the_four_projects_has_a_hundred_assertions_or_more() -> None:
    counts = Counter(case["peer"] for case in CASES)

    assert sorted(counts) == ["CORA", "LazySets", "MPT3", "pycvxset"]
    assert min(counts.values()) >= 100
