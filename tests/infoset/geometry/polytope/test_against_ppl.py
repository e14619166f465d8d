"""Random polytopes of R^3 to R^6 against exact rational arithmetic (PPL): nothing lost, nothing
refused, little added.

A check compares one operation with its exact result on the same floats. The exact set satisfies the
facets of the computed one: in rationals without a tolerance if it has an interior, within the
rounding of one scalar product if it is flat. Each exact vertex is close to the hull of the computed
vertices; the computed set extends little beyond the exact facets, and no facet is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from math import lcm
from typing import Any

import numpy as np
import pytest

from infoset.arrays import Floats
from infoset.geometry.polytope import Polytope
from tests.rationals import Fraction
from tests.rendezvous.reachability.rationals import polyhedron_of, vertices_of

pytestmark = pytest.mark.skipif(
    find_spec("ppl") is None, reason="needs the extra exact: pip install '.[exact]'"
)

KINDS = ["round", "flat", "touching", "integers", "mixed units"]
SEEDS = 20
"""Sets of a kind in a space; each has eight checks: 3 200 in all. By default one set of each kind
is checked.
"""
MAX_EXCESS = 1e-9
"""Extension beyond exact facets, relative to the widths of the sets along the axes."""
MAX_FLAT_EXCESS = 1e-7
"""The same where the exact result is flat: rounding of its facets decides how far they are from
parallel ones.
"""
MAX_LOSS = 1e-12
"""Distance of exact vertices from the hull of the computed ones, in the same widths."""
OUTWARD = 0.0
"""Distance of exact vertices beyond the computed facets, relative to the terms of normal . x."""
FLAT_ROUNDING = 1e-13
"""The same distance for flat sets, whose facets are rounded to nearest."""
STEP = 1e-6
"""Distance from a facet of points that are clearly inside or outside, relative to the distance of
the centre.
"""
POINTS = {3: 12, 4: 12, 5: 11, 6: 10}
"""Points of a set in each space."""


class Exact:
    """A bounded polyhedron of PPL, its vertices as rationals and its facets as floats.

    `widths` are the widths of the given sets.
    """

    def __init__(self, polyhedron: Any, widths: Floats) -> None:
        self.polyhedron = polyhedron
        self.widths = widths
        self.space = polyhedron.space_dimension()
        self.is_empty = bool(polyhedron.is_empty())
        self.vertices = [] if self.is_empty else vertices_of(polyhedron)
        self.points = np.array(self.vertices, dtype=float).reshape(-1, self.space)
        self.solid = not self.is_empty and polyhedron.affine_dimension() == self.space
        rows = list[list[float]]()
        limits = list[float]()
        flat = list[list[float]]()
        levels = list[float]()
        for row in polyhedron.minimized_constraints():
            # PPL writes a . x + b >= 0 with integers that may be larger than a float.
            numbers = [-int(row.coefficient(_variable(i))) for i in range(self.space)] + [
                int(row.inhomogeneous_term())
            ]
            size = max(map(abs, numbers[:-1]))
            *normal, limit = (float(Fraction(number, size or 1)) for number in numbers)
            (rows if row.is_inequality() else flat).append(normal)
            (limits if row.is_inequality() else levels).append(limit)
        self.normals = np.array(rows).reshape(-1, self.space)
        self.offsets = np.array(limits)
        self.across = np.array(flat).reshape(-1, self.space)
        self.levels = np.array(levels)

    @classmethod
    def hull(cls, points: list[list[Fraction]], widths: Floats) -> Exact:
        return cls(polyhedron_of(points), widths)

    @classmethod
    def of_rows(cls, rows: list[list[Fraction]], space: int, widths: Floats) -> Exact:
        """Rows (normal, offset) of half-spaces."""
        return cls(_polyhedron(rows, space), widths)

    def rows(self) -> list[list[Fraction]]:
        """Rows (normal, offset), both signs of each equation."""
        rows = []
        for row in self.polyhedron.minimized_constraints():
            numbers = [Fraction(-int(row.coefficient(_variable(i)))) for i in range(self.space)]
            numbers.append(Fraction(int(row.inhomogeneous_term())))
            rows += [numbers] if row.is_inequality() else [numbers, [-number for number in numbers]]
        return rows


def _variable(i: int) -> Any:
    import ppl

    return ppl.Variable(i)


def _polyhedron(rows: list[list[Fraction]], space: int) -> Any:
    import ppl

    polyhedron = ppl.C_Polyhedron(space, "universe")
    for row in rows:
        divisor = lcm(*(int(value.denominator) for value in row))
        *normal, offset = (int(value * divisor) for value in row)
        terms = (n * ppl.Variable(i) for i, n in enumerate(normal))
        polyhedron.add_constraint(sum(terms, start=ppl.Linear_Expression(0)) <= offset)
    return polyhedron


def rationals(points: Floats) -> list[list[Fraction]]:
    return [[Fraction(float(value)) for value in point] for point in points]


# The judge
# --------------------------------------------------------------------------------------------------


def judge(got: Polytope, exact: Exact) -> float:
    """Fail if the computed set is wrong; return its extension beyond the exact one, relative to the
    inputs' widths.
    """
    assert got.is_empty == exact.is_empty, f"empty: {got.is_empty}, exactly {exact.is_empty}"
    if exact.is_empty:
        return 0.0
    _assert_facets_hold(got, exact)
    gaps = (np.abs(exact.points[:, None] - got.vertices) / exact.widths).max(axis=-1)
    far = gaps.min(axis=1) > MAX_LOSS
    if far.any():  # merged with other vertices, or lost
        hull = Exact.hull(rationals(got.vertices), exact.widths)
        lost = _excess(exact.points[far], hull)
        assert lost <= MAX_LOSS, f"vertices lack the exact set by {lost:.2g}"
    excess = _excess(got.vertices, exact)
    assert excess <= (MAX_EXCESS if exact.solid else MAX_FLAT_EXCESS), f"too wide by {excess:.2g}"
    if exact.solid:
        _assert_members(got, exact)
    return excess


def _assert_facets_hold(got: Polytope, exact: Exact) -> None:
    """Each exact vertex satisfies each computed facet; only those that rounding could violate need
    rationals.
    """
    rows, limits = got.constraints()
    terms = np.abs(exact.points).max(axis=0) @ np.abs(rows).T + np.abs(limits)
    close = exact.points @ rows.T - limits > -1e-13 * terms
    solid = got.dimension == got.space
    for i, j in zip(*np.nonzero(close), strict=True):
        beyond = sum(
            (Fraction(float(a)) * x for a, x in zip(rows[j], exact.vertices[i], strict=True)),
            Fraction(0),
        )
        beyond -= Fraction(float(limits[j]))
        if beyond > (OUTWARD if solid else FLAT_ROUNDING) * terms[j]:
            raise AssertionError(
                f"a vertex is {float(beyond / terms[j]):.2g} of the terms beyond a facet"
            )


def _excess(points: Floats, exact: Exact) -> float:
    """Distance of points beyond the exact facets or from the affine hull, relative to the widths of
    the inputs.
    """
    beyond = points @ exact.normals.T - exact.offsets
    away = np.abs(points @ exact.across.T - exact.levels)
    sizes = np.abs(exact.normals) @ exact.widths, np.abs(exact.across) @ exact.widths
    parts = beyond / sizes[0], away / np.where(sizes[1] > 0.0, sizes[1], 1.0)
    return float(max(part.max(initial=0.0) for part in parts))


def _assert_members(got: Polytope, exact: Exact) -> None:
    """Points on the exact facets, moved a little to the centre, are inside; moved away from it,
    outside.
    """
    centre = exact.points.mean(axis=0)
    depth = exact.offsets - exact.normals @ centre
    heights = exact.points @ exact.normals.T - exact.offsets
    on = (heights >= heights.max(axis=0) - 1e-9 * depth).astype(float)  # heights are rounded
    middles = (on.T @ exact.points) / on.sum(axis=0)[:, None]
    assert got.contains(exact.points).all()
    assert got.contains(middles + STEP * (centre - middles)).all(), "a point inside is not a member"
    # A step less than the rounding of the coordinates proves nothing.
    is_step = STEP * depth > 1e-15 * np.abs(exact.normals) @ np.abs(exact.points).max(axis=0)
    assert not got.contains(middles - STEP * (centre - middles))[is_step].any(), (
        "a point outside is a member: a facet is missing"
    )


# The sets
# --------------------------------------------------------------------------------------------------


def points_of(kind: str, space: int, random: np.random.Generator) -> Floats:
    points = random.normal(size=(POINTS[space], space))
    match kind:
        case "flat":
            points = (
                np.round(points * 2.0**16) / 2.0**16
            )  # sums of few such numbers are exact: the set is flat
            points[:, -1] = (
                points[:, :2] @ [[0.0, 0.0], [1.0, 0.0], [1.0, -2.0]][int(random.integers(3))]
                + 0.25
            )
        case "integers":
            points = random.integers(-3, 4, points.shape).astype(float)
        case "mixed units":
            points *= 10.0 ** random.integers(-6, 7, space)
        case "touching":
            points = np.round(points * 2.0**10) / 2.0**10
    return np.asarray(points)


def pair_of(kind: str, points: Floats, random: np.random.Generator) -> Floats:
    """Points of another set; if `touching`, a face of it, such as a vertex, is common to both."""
    if kind == "touching":
        # The mirrored set at a support plane: the face in which the plane touches is common.
        axis = int(random.integers(points.shape[1]))
        other = points.copy()
        other[:, axis] = 2.0 * points[:, axis].max() - points[:, axis]
        return other
    others = points_of(kind, points.shape[1], random)
    if kind == "mixed units":
        others *= points.std(axis=0) / others.std(axis=0)
    if kind == "flat":
        others[:, -1] = others[:, 0]
        return np.asarray(others)
    return np.asarray(0.75 * others)


def widths_of(*sets: Floats) -> Floats:
    widths = np.max([np.ptp(points, axis=0) for points in sets], axis=0)
    return np.asarray(np.where(widths > 0.0, widths, 1e-9 * widths.max(initial=1e-300)))


def checks(
    kind: str, space: int, seed: int
) -> Iterator[tuple[str, Callable[[], Polytope], Callable[[], Exact]]]:
    """Yield operations and their exact results."""
    random = np.random.default_rng([KINDS.index(kind), space, seed])
    points = points_of(kind, space, random)
    others = pair_of(kind, points, random)
    one = Polytope.from_vertices(points)
    two = Polytope.from_vertices(others)
    widths = widths_of(points)
    exact_one = Exact.hull(rationals(points), widths)
    exact_two = Exact.hull(rationals(others), widths)
    yield "hull", lambda: Polytope.from_vertices(points), lambda: exact_one

    # Half-spaces that touch an ellipsoid with the axes `widths` (integers: lattice rows), and
    # equations of a flat set.
    normals = (
        random.integers(-2, 3, (2 * space, space))
        if kind == "integers"
        else random.normal(size=(space + 4, space))
    )
    rows = np.vstack([normals / widths, np.diag(1.0 / widths), -np.diag(1.0 / widths)])
    rows = rows[np.any(rows, axis=1)]
    limits = np.full(len(rows), 3.0 if kind == "integers" else 1.0)
    flat, levels = (
        (exact_one.across, exact_one.levels)
        if kind == "flat"
        else (np.zeros((0, space)), np.zeros(0))
    )
    table = [
        [*row, limit]
        for row, limit in zip(rationals(rows), map(Fraction, limits.tolist()), strict=True)
    ]
    for sign in (1, -1):
        table += [
            [*(sign * n for n in row), sign * level]
            for row, level in zip(rationals(flat), map(Fraction, levels.tolist()), strict=True)
        ]
    yield (
        "vertices",
        lambda: Polytope.from_constraints(rows, limits, flat, levels),
        lambda: Exact.of_rows(table, space, widths),
    )
    both = Exact.of_rows(exact_one.rows() + exact_two.rows(), space, widths_of(points, others))
    yield "intersection", lambda: one & two, lambda: both

    few = others[:2] if space >= 5 else others[: space + 1]
    sums = [
        [a + b for a, b in zip(p, q, strict=True)]
        for p in exact_one.vertices
        for q in rationals(few)
    ]
    yield (
        "sum",
        lambda: one + Polytope.from_vertices(few),
        lambda: Exact.hull(sums, widths_of(points, few) * 2.0),
    )
    scale = 1.0 if kind != "mixed units" else 2.0 ** np.round(np.log2(widths))
    regular = (np.eye(space) + np.triu(random.integers(-2, 3, (space, space)), 1)) * np.ones(space)
    regular = np.asarray(regular * np.broadcast_to(scale, space)[:, None] / scale)
    for name, matrix in (
        ("map", regular),
        ("projection", random.integers(-2, 3, (2, space)).astype(float)),
    ):
        reach = np.abs(matrix) @ widths + 1e-300
        image = (np.array(rationals(points)) @ np.array(rationals(matrix)).T).tolist()
        yield name, partial(one.linear_map, matrix), partial(Exact.hull, image, reach)

    # The preimage under a regular matrix, and the preimage of an image under a tall one.
    def composed(of: Exact, matrix: Floats, reach: Floats) -> Exact:
        exact_rows = [
            [*(np.array(row[:-1]) @ np.array(rationals(matrix))).tolist(), row[-1]]
            for row in of.rows()
        ]
        return Exact.of_rows(exact_rows, matrix.shape[1], reach)

    reach = np.abs(np.linalg.inv(regular)) @ widths
    yield "preimage", lambda: one.preimage(regular), lambda: composed(exact_one, regular, reach)
    tall = np.vstack([np.eye(space - 1), random.integers(-2, 3, (1, space - 1))])
    base = np.round(points[:, : space - 1] / widths[: space - 1] * 2.0**10) / 2.0**10
    lifted = base @ tall.T
    exact_lifted = Exact.hull(rationals(lifted), widths_of(lifted))
    yield (
        "tall preimage",
        lambda: Polytope.from_vertices(lifted).preimage(tall),
        lambda: composed(exact_lifted, tall, widths_of(base)),
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("space", "count"),
    [
        (3, 1),
        (4, 1),
        *(pytest.param(space, SEEDS, marks=pytest.mark.thorough) for space in (3, 4, 5, 6)),
    ],
)
def test_operations_lose_nothing_and_add_little(
    kind: str, space: int, count: int, record_property: Callable[[str, object], None]
) -> None:
    wrong = []
    excess = dict[str, float]()
    for seed in range(count):
        for name, compute, exactly in checks(kind, space, seed):
            try:
                excess[name] = max(excess.get(name, 0.0), judge(compute(), exactly()))
            except (AssertionError, ArithmeticError, ValueError) as error:
                wrong.append(f"{name}, seed {seed}: {type(error).__name__}: {error}")
    record_property("largest excess", excess)
    assert not wrong, "\n".join([f"{len(wrong)} wrong", *wrong])


@pytest.mark.thorough
@pytest.mark.parametrize("space", [3, 4, 5, 6])
def test_cones_and_cylinders_are_unbounded(space: int) -> None:
    random = np.random.default_rng(space)
    cone = Polytope.from_constraints(random.normal(size=(space, space)), np.ones(space))
    assert (len(cone.vertices), len(cone.directions), len(cone.lines)) == (1, space, 0)
    cube = Polytope.from_box(-np.ones(space), np.ones(space))
    cylinder = cube.preimage(random.normal(size=(space, space + 1)))
    assert (len(cylinder.vertices), len(cylinder.directions), len(cylinder.lines)) == (
        2**space,
        0,
        1,
    )
