"""The proof that vertices and facets are all: it accepts polytopes, and nothing that was changed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from infoset.arrays import Flags
from infoset.geometry.polytope import Polytope, construction, product
from infoset.geometry.polytope.arrays import PolytopeArrays
from infoset.geometry.polytope.incidence import is_closed
from infoset.geometry.tolerances import SNAP


def cube(space: int) -> Polytope:
    """A set whose vertices are simple."""
    return Polytope.from_box(-np.ones(space), np.ones(space))


def cross_polytope(space: int) -> Polytope:
    """A set whose facets are simplices; from three dimensions on its vertices are not simple."""
    return Polytope.from_vertices(np.vstack([np.eye(space), -np.eye(space)]))


def hull(space: int, count: int) -> Polytope:
    """Random points; their facets are simplices."""
    return Polytope.from_vertices(np.random.default_rng([space, count]).normal(size=(count, space)))


POLYTOPES = {
    "polygon": hull(2, 9),
    "cube": cube(3),
    "cube of five dimensions": cube(5),
    "octahedron": cross_polytope(3),
    "cross-polytope of four dimensions": cross_polytope(4),
    "points in space": hull(3, 15),
    "points of five dimensions": hull(5, 9),
    # Neither vertices nor facets are simple.
    "prism over an octahedron": product(cross_polytope(3), cube(1)),
    "octahedron times octahedron": product(cross_polytope(3), cross_polytope(3)),
    "pyramid over an octahedron": Polytope.from_vertices(np.vstack([np.eye(3, 4), -np.eye(3, 4), np.eye(4)[3:]])),
}


@pytest.mark.parametrize("name", POLYTOPES)
def test_vertices_and_facets_of_a_polytope_are_closed(name: str) -> None:
    one = POLYTOPES[name]
    assert is_closed(one.incidence, one.dimension)
    # The roles of vertices and facets can be exchanged.
    assert is_closed(one.incidence.T.copy(), one.dimension)


@pytest.mark.parametrize("name", POLYTOPES)
@pytest.mark.parametrize("by_facets", [False, True])
def test_a_changed_bit_or_a_missing_or_doubled_vertex_is_refused(name: str, by_facets: bool) -> None:
    one = POLYTOPES[name]
    on: Flags = one.incidence.T.copy() if by_facets else one.incidence
    random = np.random.default_rng(len(on))
    for _ in range(20):
        i = int(random.integers(on.shape[0]))
        j = int(random.integers(on.shape[1]))
        flipped = on.copy()
        flipped[i, j] = not flipped[i, j]
        assert not is_closed(flipped, one.dimension), (i, j)
        assert not is_closed(np.delete(on, i, axis=0), one.dimension), i
        assert not is_closed(np.vstack([on, on[i]]), one.dimension), i


@pytest.mark.parametrize("name", POLYTOPES)
def test_two_polytopes_are_not_one(name: str) -> None:
    on = POLYTOPES[name].incidence
    apart = np.block([[on, np.zeros_like(on)], [np.zeros_like(on), on]])
    assert not is_closed(apart, POLYTOPES[name].dimension)


def settled(one: PolytopeArrays) -> PolytopeArrays | None:
    return construction.settled(one, 0)


@pytest.mark.parametrize("name", POLYTOPES)
def test_a_moved_vertex_is_put_back_and_a_facet_that_cuts_it_off_is_refused(name: str) -> None:
    one = POLYTOPES[name]
    found = settled(one)
    assert found is not None
    assert (len(found.points), len(found.facets)) == (len(one.points), len(one.facets))

    for step in (-1e-9, 1e-9):
        moved = one.points.copy()
        moved[0] += step * (moved[0] - one.points.mean(axis=0))
        back = settled(replace(one, points=moved))
        assert back is not None
        np.testing.assert_allclose(back.points, one.points, rtol=0.0, atol=SNAP)

    # A half-space that cuts a vertex off by 1e-9, and of which no vertex knows.
    normal = one.points[0] - one.points.mean(axis=0)
    normal /= np.abs(normal).max()
    row = np.append(normal, (one.points @ normal).max() - 1e-9)
    on = np.column_stack([one.incidence, np.zeros(len(one.points), np.bool_)])
    assert settled(replace(one, facets=np.vstack([one.facets, row]), incidence=on)) is None
