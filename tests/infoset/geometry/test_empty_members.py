"""Batches with empty members: each method, compared with the same method of each member alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest

from infoset import ConvexPolygons
from infoset.arrays import Floats

SHAPES: list[tuple[int, ...]] = [(7,), (2, 3), (3, 1, 2)]


class Arguments(NamedTuple):
    """Arguments of operations, one for each member of a batch, or for one member."""

    vector: Floats
    matrix: Floats
    number: Floats
    other: ConvexPolygons

    def of(self, index: tuple[int, ...]) -> Arguments:
        return Arguments(
            self.vector[index], self.matrix[index], self.number[index], self.other[index]
        )


Operation = Callable[[ConvexPolygons, Arguments], Any]

EMPTY = "the empty set"
MASKED = "no point"
OTHER = "the other set"

CASES: dict[str, tuple[Operation, Any]] = {
    # Sets
    "cut": (lambda p, a: p.cut(a.vector, -a.number, a.number), EMPTY),
    "linear_map": (lambda p, a: p.linear_map(a.matrix), EMPTY),
    "affine_map": (lambda p, a: p.affine_map(a.matrix, a.vector), EMPTY),
    "preimage": (lambda p, a: p.preimage(a.matrix, a.vector), EMPTY),
    "translate": (lambda p, a: p.translate(a.vector), EMPTY),
    "add_segment": (lambda p, a: p.add_segment(a.vector), EMPTY),
    "minkowski_sum": (lambda p, a: p.minkowski_sum(a.other), EMPTY),
    "minkowski_difference": (lambda p, a: p.minkowski_difference(a.other), EMPTY),
    "intersection": (lambda p, a: p.intersection(a.other), EMPTY),
    "convex_hull": (lambda p, a: p.convex_hull(a.other), OTHER),
    "reduce_outward": (lambda p, a: p.reduce_outward(4), EMPTY),
    "broadcast_to": (lambda p, a: p.broadcast_to(p.shape), EMPTY),
    # Intervals
    "project": (lambda p, a: p.project(1), MASKED),
    "slice": (lambda p, a: p.slice(0, a.number), MASKED),
    # Points
    "support_vector": (lambda p, a: p.support_vector(a.vector), MASKED),
    "centroid": (lambda p, a: p.centroid(), MASKED),
    "chebyshev_centre": (lambda p, a: p.chebyshev_centre(), MASKED),
    "bounding_box": (lambda p, a: p.bounding_box(), MASKED),
    "closest_point": (lambda p, a: p.closest_point(a.vector), MASKED),
    # Numbers
    "support_function": (lambda p, a: p.support_function(a.vector), -math.inf),
    "margin": (lambda p, a: p.margin(a.vector), -math.inf),
    "area": (lambda p, a: p.area(), 0.0),
    "volume": (lambda p, a: p.volume(), 0.0),
    "diameter": (lambda p, a: p.diameter(), 0.0),
    "distance": (lambda p, a: p.distance(a.other), math.inf),
    "distance from points": (lambda p, a: p.distance(a.vector), math.inf),
    "hausdorff_distance": (lambda p, a: p.hausdorff_distance(a.other), math.inf),
    # Answers
    "contains": (lambda p, a: p.contains(a.vector), False),
    "contains within a tolerance": (lambda p, a: p.contains(a.vector, 9.0), False),
    "is_subset": (lambda p, a: p.is_subset(a.other), True),
    "equals": (lambda p, a: p.equals(a.other), False),
    "isdisjoint": (lambda p, a: p.isdisjoint(a.other), True),
    "is_empty": (lambda p, a: p.is_empty, True),
}
"""Operations of a batch, and the result for an empty member if the other set is a square."""

OTHERS = {
    "empty": "makes empty sets",
    "unchecked": "takes arrays of kernels",
    **dict.fromkeys(["vertices", "counts", "shape", "space"], "attributes"),
    **dict.fromkeys(
        ["from_vertices", "from_points", "from_constraints", "from_box"], "make sets of numbers"
    ),
    **dict.fromkeys(["from_ball", "from_zonotope", "from_shapely"], "make sets of numbers"),
    **dict.fromkeys(["polygon", "polytope", "to_shapely"], "of a single polygon"),
    "stack": "makes all batches of this module",
    **dict.fromkeys(["sample", "constraints", "plot"], "tests of their own"),
}
"""Other public names, and why they are not among the cases."""


def random_batch(
    random: np.random.Generator, shape: tuple[int, ...], empty_share: float
) -> ConvexPolygons:
    """A batch of polygons, segments, points and empty sets."""
    members = []
    for _ in range(math.prod(shape)):
        size = 0 if random.random() < empty_share else int(random.choice([1, 2, 3, 5, 8]))
        members.append(ConvexPolygons.from_points(random.uniform(-1.0, 1.0, (size, 2))))
    flat = ConvexPolygons.stack(members)
    return ConvexPolygons.unchecked(
        flat.vertices.reshape(*shape, *flat.vertices.shape[1:]), flat.counts.reshape(shape)
    )


def random_arguments(
    random: np.random.Generator, shape: tuple[int, ...], other: ConvexPolygons
) -> Arguments:
    return Arguments(
        random.normal(size=(*shape, 2)),
        random.normal(size=(*shape, 2, 2)),
        random.uniform(0.0, 0.3, shape),
        other,
    )


def assert_same(whole: Any, alone: Any, index: tuple[int, ...]) -> None:
    """The member of a result is, bit for bit, the result of the member."""
    if isinstance(whole, ConvexPolygons):
        np.testing.assert_array_equal(whole[index].polygon(), alone.polygon())
    elif isinstance(whole, tuple):
        for many, one in zip(whole, alone, strict=True):
            assert_same(many, one, index)
    else:
        assert not np.ma.getmaskarray(whole)[index].any()
        np.testing.assert_array_equal(np.ma.getdata(whole)[index], alone)


def assert_masked(whole: Any, index: tuple[int, ...]) -> None:
    for values in whole if isinstance(whole, tuple) else (whole,):
        assert np.ma.getmaskarray(values)[index].all()


def test_cases_are_all_public_methods() -> None:
    names = {name for name in dir(ConvexPolygons) if not name.startswith("_")}

    assert {*(name.split()[0] for name in CASES), *OTHERS} >= names
    assert set(CASES).isdisjoint(OTHERS)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("name", CASES)
def test_members_of_a_batch_have_the_results_of_single_polygons(name: str, seed: int) -> None:
    """Members of the other set may be empty, too."""
    random = np.random.default_rng(seed)
    shape = SHAPES[seed % len(SHAPES)]
    batch = random_batch(random, shape, 0.4)
    arguments = random_arguments(random, shape, random_batch(random, shape, 0.3))
    operation, _ = CASES[name]

    whole = operation(batch, arguments)

    for index in np.ndindex(shape):
        try:
            alone = operation(batch[index], arguments.of(index))
        except ValueError as error:
            if "unbounded" in str(error):  # only the difference with an empty set
                assert whole[index].is_empty
            else:
                assert_masked(whole, index)
            continue
        assert_same(whole, alone, index)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("share", [0.5, 1.0])
@pytest.mark.parametrize("name", CASES)
def test_empty_members_have_the_results_of_the_empty_set(
    name: str, share: float, shape: tuple[int, ...]
) -> None:
    random = np.random.default_rng(5)
    square = ConvexPolygons.from_box([-2.0, -2.0], [2.0, 2.0])
    batch = random_batch(random, shape, share)
    arguments = random_arguments(random, shape, square.broadcast_to(shape))
    operation, wanted = CASES[name]

    whole = operation(batch, arguments)

    assert batch.is_empty.any()

    for index in np.argwhere(batch.is_empty):
        member = tuple(index)
        if wanted is EMPTY:
            assert whole[member].is_empty
        elif wanted is OTHER:
            assert whole[member].equals(square)
        elif wanted is MASKED:
            assert_masked(whole, member)
        else:
            assert whole[member] == wanted


@pytest.mark.parametrize(
    "name",
    [
        "cut",
        "affine_map",
        "preimage",
        "translate",
        "add_segment",
        "support_vector",
        "closest_point",
        "support_function",
        "margin",
        "distance from points",
        "contains",
        "contains within a tolerance",
        "slice",
    ],
)
@pytest.mark.parametrize("shape", SHAPES)
def test_values_masked_for_empty_members_are_taken(name: str, shape: tuple[int, ...]) -> None:
    """Results of a batch are such values."""
    random = np.random.default_rng(6)
    batch = random_batch(random, shape, 0.5)
    centres = batch.centroid()
    numbers = batch.support_vector((1.0, 0.0))[..., 0]
    given = random_arguments(random, shape, batch)._replace(
        vector=np.ma.getdata(centres), number=np.ma.getdata(numbers)
    )
    operation, _ = CASES[name]

    masked = operation(batch, given._replace(vector=centres, number=numbers))

    assert np.ma.is_masked(centres)

    for index in np.ndindex(shape):
        if not batch.is_empty[index]:
            assert_same(masked, operation(batch[index], given.of(index)), index)


@pytest.mark.parametrize(
    "name", ["distance from points", "affine_map", "preimage", "translate", "contains"]
)
def test_value_that_is_masked_for_a_set_with_points_is_refused(name: str) -> None:
    batch = ConvexPolygons.stack(
        [ConvexPolygons.empty(), ConvexPolygons.from_box([0.0, 0.0], [1.0, 1.0])]
    )
    hidden = np.ma.masked_array(np.zeros((2, 2)), [[True, True], [False, True]])
    arguments = random_arguments(np.random.default_rng(0), (2,), batch)._replace(vector=hidden)

    with pytest.raises(TypeError, match="must be real numbers, not masked"):
        CASES[name][0](batch, arguments)


@pytest.mark.parametrize("shape", SHAPES)
def test_samples_of_a_batch_are_in_its_members_and_masked_for_empty_ones(
    shape: tuple[int, ...],
) -> None:
    batch = random_batch(np.random.default_rng(7), shape, 0.5)

    points = batch.sample(9)

    assert points.shape == (*shape, 9, 2)
    np.testing.assert_array_equal(np.ma.getmaskarray(points).all(axis=(-1, -2)), batch.is_empty)

    for number in range(9):
        # Each coordinate is a sum of two products of numbers below 2, with less than 5 roundings.
        inside = batch.contains(points[..., number, :], 8.0 * np.finfo(float).eps)
        np.testing.assert_array_equal(inside, ~batch.is_empty)


@pytest.mark.parametrize("shape", SHAPES)
def test_constraints_of_a_batch_describe_it(shape: tuple[int, ...]) -> None:
    """Flat members are left out: rounded directions may make them empty."""
    batch = random_batch(np.random.default_rng(1), shape, 0.5)
    solid = batch.counts > 2

    normals, offsets = batch.constraints()
    again = ConvexPolygons.from_constraints(normals, offsets)

    assert batch.is_empty.any()
    assert solid.sum() > 1
    assert again.is_empty[batch.is_empty].all()

    for index in np.argwhere(solid):
        sides = normals[tuple(index)][: batch.counts[tuple(index)]]
        before = np.roll(sides, 1, axis=0)
        assert np.abs(before[:, 0] * sides[:, 1] - before[:, 1] * sides[:, 0]).min() > 0.2

    # Coordinates and offsets below 2 are known to less than 10 roundings, and the crossings of
    # sides to 5 times that.
    assert (again.hausdorff_distance(batch)[solid] < 50.0 * np.finfo(float).eps).all()
