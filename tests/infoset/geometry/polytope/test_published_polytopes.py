"""Polytopes from the tests and examples of cddlib and pycddlib, against exact rational vertices.

`published_polytopes.json` has their coordinates and where they were published.
"""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from infoset.geometry.polytope import Polytope
from tests.rationals import Fraction

CASES: list[dict[str, Any]] = json.loads(
    (Path(__file__).parent / "published_polytopes.json").read_text()
)["cases"]
MAX_SUBSETS = 3000
Row = tuple[Fraction, ...]


def solution(rows: list[Row]) -> Row | None:
    """Return the only x with b + a x = 0 for rows (b, a), by elimination; None if there is no such
    point.
    """
    table = [[*row[1:], -row[0]] for row in rows]
    size = len(table[0]) - 1
    for k in range(size):
        pivot = next((i for i in range(k, len(table)) if table[i][k]), None)
        if pivot is None:
            return None
        table[k], table[pivot] = table[pivot], table[k]
        for i, row in enumerate(table):
            if i != k and row[k]:
                factor = row[k] / table[k][k]
                table[i] = [one - factor * other for one, other in zip(row, table[k], strict=True)]
    if any(row[-1] for row in table[size:]):
        return None
    return tuple(table[k][-1] / table[k][k] for k in range(size))


def exact_vertices(rows: list[Row], equations: list[int]) -> set[Row]:
    """Return the vertices of a bounded set: points of n independent rows that satisfy all."""
    sides = [i for i in range(len(rows)) if i not in equations]
    points = set()
    for chosen in itertools.combinations(sides, max(0, len(rows[0]) - 1 - len(equations))):
        point = solution([rows[i] for i in (*equations, *chosen)])
        if point is not None and all(
            row[0] + sum(a * x for a, x in zip(row[1:], point, strict=True)) >= 0 for row in rows
        ):
            points.add(point)
    return points


@pytest.mark.parametrize(
    "case", [case for case in CASES if case["form"] == "constraints"], ids=lambda case: case["case"]
)
def test_constraints_give_the_published_vertices(case: dict[str, Any]) -> None:
    rows = [tuple(Fraction(value) for value in row) for row in case["rows"]]
    equations: list[int] = case.get("equations", [])
    table = np.array(rows, dtype=float)
    sides = np.delete(np.arange(len(rows)), equations)
    arguments = -table[sides, 1:], table[sides, 0], -table[equations, 1:], table[equations, 0]
    if case.get("unbounded"):
        assert not Polytope.from_constraints(*arguments).is_bounded
        return
    polytope = Polytope.from_constraints(*arguments)
    assert len(polytope.vertices) == case.get("vertices", len(polytope.vertices))
    assert len(polytope.normals) == case.get("facets", len(polytope.normals))
    size = float(np.abs(polytope.vertices).max(initial=1.0))
    heights = table[:, 0] + polytope.vertices @ table[:, 1:].T
    assert float(heights.min(initial=0.0)) >= -1e-12 * size * float(np.abs(table).sum(axis=1).max())
    if math.comb(len(sides), max(0, len(rows[0]) - 1 - len(equations))) > MAX_SUBSETS:
        return
    wanted = exact_vertices(rows, equations)
    assert len(polytope.vertices) == len(wanted)
    if wanted:
        gaps = np.abs(polytope.vertices[:, None] - np.array(sorted(wanted), dtype=float)).max(
            axis=-1
        )
        assert float(gaps.min(axis=1).max()) <= 1e-12 * size


@pytest.mark.parametrize(
    "case", [case for case in CASES if case["form"] == "vertices"], ids=lambda case: case["case"]
)
def test_vertices_give_the_published_facets(case: dict[str, Any]) -> None:
    """All points are inside, and each facet contains points that span it: the facets are right."""
    points = np.array(case["rows"], dtype=float)[:, 1:]
    polytope = Polytope.from_vertices(points)
    assert len(polytope.normals) == case.get("facets", len(polytope.normals))
    size = float(np.abs(points).max())
    depths = polytope.offsets - points @ polytope.normals.T
    assert float(depths.min()) >= -1e-12 * size
    for depth in depths.T:
        on = points[depth <= 1e-9 * size]
        assert np.linalg.matrix_rank(on - on[0], tol=1e-12 * size) >= polytope.dimension - 1
    gaps = np.abs(polytope.vertices[:, None] - points).max(axis=-1)
    assert float(gaps.min(axis=1).max()) <= 1e-12 * size
