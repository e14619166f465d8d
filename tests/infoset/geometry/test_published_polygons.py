"""Published pairs of polygons against exact rationals.

They are from the tests of JTS (which GEOS runs too), boost geometry and Clipper2.
`published_polygons.json` has their coordinates and where they were published.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from infoset import ConvexPolygons
from tests.infoset.geometry.test_polygon_oracle import (
    Case,
    U,
    assert_same_set,
    exact,
    exact_sum,
    hull,
    outside_by,
)
from tests.infoset.geometry.test_set_library import (
    exact_difference,
    exact_distance_between,
    exact_intersection,
    holds,
)

pytestmark = pytest.mark.thorough

PAIRS: list[dict[str, Any]] = json.loads(
    (Path(__file__).parent / "published_polygons.json").read_text()
)["pairs"]
NAMES = [f"{pair['source']}: {pair['case']}" for pair in PAIRS]


def cases(pair: dict[str, Any]) -> tuple[Case, Case]:
    rings = [np.array(pair[key], dtype=float) for key in "ab"]
    make = ConvexPolygons.from_points if "hull" in pair else ConvexPolygons.from_vertices
    one, other = (Case(make(ring), hull(exact(ring))) for ring in rings)
    return one, other


@pytest.mark.parametrize("pair", PAIRS, ids=NAMES)
def test_operations_on_a_published_pair_are_exact(pair: dict[str, Any]) -> None:
    one, other = cases(pair)
    for case, key in ((one, "a"), (other, "b")):
        assert set(exact(case.polygon.polygon())) == set(case.exact)
        ring = shapely.Polygon(pair[key])
        assert ConvexPolygons.from_shapely(ring.convex_hull if "hull" in pair else ring).equals(
            case.polygon
        )

    size = (max(one.size[0], other.size[0]), max(one.size[1], other.size[1]))
    box = (8 * U * size[0], 8 * U * size[1])
    wanted = exact_intersection(one.exact, other.exact)
    common = one.polygon & other.polygon

    assert common.is_empty == (not wanted)
    assert_same_set(common, wanted, box)
    assert set(exact(one.polygon.convex_hull(other.polygon).polygon())) == set(
        hull(one.exact + other.exact)
    )
    assert_same_set(one.polygon + other.polygon, exact_sum(one.exact, other.exact), box)
    assert (one.polygon <= other.polygon) == all(holds(other.exact, p) for p in one.exact)

    distance = exact_distance_between(one.exact, other.exact)
    assert float(one.polygon.distance(other.polygon)) == pytest.approx(distance, rel=1e-14, abs=0.0)

    less = exact(one.polygon.minkowski_difference(other.polygon).polygon())
    wide = exact_sum(
        one.exact,
        [(sx * 2 * box[0], sy * 2 * box[1]) for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))],
    )

    assert outside_by(less, exact_difference(wide, other.exact), box) is None
    assert (
        outside_by(exact_difference(one.exact, other.exact), hull(less), (8 * box[0], 8 * box[1]))
        is None
        or not less
    )


@pytest.mark.parametrize(
    "pair", [pair for pair in PAIRS if "area" in pair], ids=lambda pair: pair["case"]
)
def test_areas_of_a_published_pair_are_equal_to_the_published_ones(pair: dict[str, Any]) -> None:
    """Clipper2 rounds vertices to whole numbers, and its areas with them."""
    one, other = (case.polygon for case in cases(pair))
    common = float((one & other).area())
    kind, published = pair["area"]
    first = float(one.area())
    second = float(other.area())
    area = {
        "intersection": common,
        "difference": first - common,
        "union": first + second - common,
        "symmetric difference": first + second - 2.0 * common,
    }[kind]

    assert area == pytest.approx(published, rel=6e-3)
