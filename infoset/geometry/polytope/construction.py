"""Construction of polytopes: boxes, intersections of half-spaces, and cuts.

Each set is computed in three steps. The double description finds vertices or facets with rounded
numbers. The result is *settled* (`settled`): what is redundant goes, and the rest is kept only if
it proves to be all (`incidence.is_closed`), with the incidence of the double description or with
all points within SNAP of a facet. Otherwise the set is computed again with integers (`cone`),
which round nothing. Hulls of points (`hulls`) are computed in the same steps.

Integers decide whether half-spaces have an empty, flat or unbounded intersection. A cut of a set
that exists is decided to ON of its size if it is empty, and to SNAP if it is flat.

New vertices move to the outer sides of their facets. If no vertex is missing, the hull of the
vertices then contains the set of the half-spaces: each face of the hull is on the outer side of its
facet.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.geometry.polytope import cone
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope.arrays import PolytopeArrays, half_spaces, own_and_others
from infoset.geometry.polytope.hulls import hull, hull_of, spans_less
from infoset.geometry.polytope.incidence import Needed, is_closed, without_redundant
from infoset.geometry.polytope.outward import around, push_out
from infoset.geometry.polytope.polyhedron import (
    Polyhedron,
    holds_with_equality,
    of_generators,
    rounded_equations,
    rounded_points,
    rounded_rows,
)
from infoset.geometry.polytope.scaled_coordinates import (
    coordinates,
    exact_coordinates,
    largest_coordinate,
    moved_limits,
    scaled_points,
)
from infoset.geometry.polytope.vertex_checks import SAME_VERTEX, loses_points, refined, touching
from infoset.geometry.tolerances import ON, REDUCED, SNAP, UNSURE

Ends = tuple[Floats, Floats]
"""Minimum and maximum coordinates, each of shape (n,)."""
FINE = 2.0**14
"""Width of a set, in widths of a part of it, from which the part is computed in its own
coordinates: UNSURE, one rounding of the whole set, is then 2 SNAP of the part, whose facets could
no longer be told from a flat set.
"""
_GOOD_WIDTH_RATIO = 2.0**6
"""Coordinates are good if no coordinate of a vertex exceeds this, and all widths of the set are at
least its inverse: up to two digits are lost then, compared with coordinates in which the set is one
wide.
"""
_MAX_FRAMES = 3
"""Number of systems of coordinates in which half-spaces are tried before integers decide: those of
the given box, those of the set found in the first ones, and those of the set found in the second
ones, whose ends are then computed.
"""
_LEAST_WIDTH = 64.0 * UNSURE / SNAP
"""Minimum scale of an axis, relative to the coordinates from which limits were computed: 64
roundings of these coordinates are then SNAP in the scale, so that a set as thin as this is flat.
Chosen: 60 differences that are segments are all flat from 16 to 16384, and 15 of them have an
interior with 4 (measured).
"""
_PIVOT_GROWTH = 64.0
"""Factor by which elimination (`pivots`) may enlarge the distances of points from the plane of a
flat set. For complete pivoting in R^6 it is at most 11 (Wilkinson's bound for 7 columns); chosen:
several times this.
"""
_MEETING = 16.0 * SNAP
"""Maximum distance of a vertex from the computed facets that meet in it. Up to 6 SNAP were measured
in observers of four states; chosen: more than twice this.
"""


def empty(space: int) -> PolytopeArrays:
    """Return the empty set of R^n, n = `space`."""
    no_point = np.zeros((0, space))
    no_row = np.zeros((0, space + 1))
    on = np.zeros((0, 0), np.bool_)
    return PolytopeArrays(no_point, no_row, no_row, on, np.zeros(space), np.ones(space))


def box(lower: Floats, upper: Floats) -> PolytopeArrays:
    """Return {x: lower <= x <= upper} for bounds of shape (n,). Exact.

    It is flat along axes whose bounds are equal.
    """
    space = len(lower)
    centre, scale = coordinates(lower.copy(), upper.copy(), np.zeros(space), 0.0)
    least = (lower - centre) / scale
    most = (upper - centre) / scale
    # Equal bounds give one end.
    ends = [dict.fromkeys(pair) for pair in zip(least, most, strict=True)]
    points = np.array(list(itertools.product(*ends)))

    unit = np.eye(space)
    is_wide = least < most
    normals = np.vstack([unit[is_wide], -unit[is_wide]])
    offsets = np.concatenate([most[is_wide], -least[is_wide]])
    facets = np.column_stack([normals, offsets])
    equations = np.column_stack([unit[~is_wide], most[~is_wide]])
    incidence = points @ normals.T == offsets
    return PolytopeArrays(points, facets, equations, incidence, centre, scale)


def of_polyhedron(found: Polyhedron) -> PolytopeArrays:
    """Return the arrays of an exact set.

    Its vertices are rounded to nearest. The facets of a bounded set are computed again, from the
    rounded vertices; those of an unbounded set are the exact ones, rounded, and the exact set is
    kept (`PolytopeArrays.exact`).
    """
    if not found.points:
        return empty(found.space)
    points = rounded_points(found.points, found.space)
    if found.is_bounded:
        return hull_of(points)

    on = np.array(
        [[holds_with_equality(facet, point) for facet in found.facets] for point in found.points]
    )
    return PolytopeArrays(
        points,
        rounded_rows(found.facets, found.space),
        rounded_equations(found.equations, found.space),
        on.reshape(len(points), len(found.facets)),
        np.zeros(found.space),
        np.ones(found.space),
        found,
    )


def enlarged(one: PolytopeArrays, by: Floats) -> PolytopeArrays:
    """Return a set that contains {y + e: |e_i| <= by_i}, in scaled coordinates."""
    is_flat = len(one.equations) > 0
    points, facets = around(one.points, one.facets, one.incidence, by, is_flat)
    return replace(one, points=points, facets=facets)


def of_half_spaces(
    rows: Floats,
    limits: Floats,
    origin: Floats | float = 0.0,
    ends: Ends | None = None,
    sizes: Floats | None = None,
    *,
    is_inside: bool = True,
) -> PolytopeArrays:
    """Return {x: rows (x - origin) <= limits}; a limit of inf is none, -inf gives the empty set.

    `ends` are the ends of a box that about contains the set: they save time. `is_inside` says that
    the set is certainly in this box: if rounding makes it unbounded, it is clipped to the box.

    `sizes`, shape (n,), are the sizes of the coordinates from which limits were computed. Integers
    would be exact about the wrong set, often an empty one: where they decide, the half-spaces are
    larger by the rounding of such limits, and what is thinner is flat.
    """
    space = rows.shape[1]
    if np.isneginf(limits).any():
        return empty(space)
    is_limit = limits < np.inf
    rows = rows[is_limit]
    limits = limits[is_limit]
    start = np.broadcast_to(np.asarray(origin, np.float64), space).copy()

    found = _in_good_coordinates(rows, limits, start, ends)
    if found is not None:
        return found

    if sizes is None:
        sizes = np.zeros(space)
    else:
        limits = limits + UNSURE * (np.abs(rows) @ sizes)
    found = _with_integers(rows, limits, start, sizes)
    if found.is_bounded or ends is None or not is_inside:
        return found

    lower, upper = ends
    sides = np.vstack([rows, np.eye(space), -np.eye(space)])
    ends_of_sides = np.concatenate([limits, upper - start, start - lower])
    return _with_integers(sides, ends_of_sides, start, sizes)


def _in_good_coordinates(
    rows: Floats, limits: Floats, origin: Floats, ends: Ends | None
) -> PolytopeArrays | None:
    """Return {x: rows (x - origin) <= limits} in coordinates in which it is about one wide.

    None means that integers must decide.
    """
    space = rows.shape[1]
    centre = np.zeros(space)
    scale = np.ones(space)
    if ends is not None:
        centre, scale = _coordinates_of_box(ends)

    for _ in range(_MAX_FRAMES):
        found = _by_double_description(rows, limits, origin, centre, scale)
        if found is None:
            return None
        is_near = np.abs(found.points).max() <= _GOOD_WIDTH_RATIO
        if is_near and np.ptp(found.points, axis=0).min() >= 1.0 / _GOOD_WIDTH_RATIO:
            return found
        centre, scale = _coordinates_of_box(found.bounding_box())
    return None


def _coordinates_of_box(ends: Ends) -> tuple[Floats, Floats]:
    """Return the centre and the scales of coordinates for a set in a box."""
    lower, upper = ends
    found: tuple[Floats, Floats] = coordinates(lower, upper, np.zeros(len(lower)), SNAP)
    return found


def _by_double_description(
    rows: Floats, limits: Floats, origin: Floats, centre: Floats, scale: Floats
) -> PolytopeArrays | None:
    """Return {x: rows (x - origin) <= limits} with rounded numbers.

    None means that integers must decide: a row is nearly zero, or the set is not bounded, not
    closed, or a facet is nearer than REDUCED to the mean of the vertices in these coordinates.
    """
    space = len(scale)
    facets = _scaled(rows, limits, origin, centre, scale)
    if _is_short(facets[:, :-1]).any() or not len(facets):
        return None

    facets = dd.in_units(facets)
    is_ahead = np.eye(space + 1)[-1:]  # t >= 0, the first row of the cone
    rays, on = dd.extreme_rays(np.vstack([is_ahead, dd.rows_of_cone(facets)]), True, ON)
    # Rays with t = 0 are directions in which the set is unbounded.
    is_bounded = len(rays) > 0 and (rays[:, -1] == 1.0).all()
    if not is_bounded:
        return None

    points = rays[:, :-1].copy()
    depths = facets[:, -1] - facets[:, :-1] @ points.mean(axis=0)
    if depths.min() < REDUCED:
        return None
    rough = PolytopeArrays(points, facets, facets[:0], on[:, 1:].copy(), centre, scale)
    return settled(rough, 0)


def _with_integers(rows: Floats, limits: Floats, origin: Floats, sizes: Floats) -> PolytopeArrays:
    """Return {x: rows (x - origin) <= limits}, decided by integers.

    What is thinner than the rounding of coordinates of some `sizes`, shape (n,), is flat.
    """
    is_noise, exact = _noise(rows, limits, origin)
    if not exact.points or not _holds_without_direction(limits, is_noise):
        return empty(rows.shape[1])
    if not exact.is_bounded:
        return of_polyhedron(_unbounded(exact))

    rows = rows[~is_noise]
    limits = limits[~is_noise]
    centre, scale = exact_coordinates(exact.box())
    # Scales are powers of two, so that scaling is exact; here the next ones below.
    least = np.ldexp(1.0, np.frexp(_LEAST_WIDTH * sizes)[1] - 1) * (sizes > 0.0)
    scale = np.maximum(scale, least)
    points = scaled_points(exact.points, centre, scale)
    if _is_flat(exact.on, rows.shape[1]):
        return hull(points, centre, scale)

    facets = dd.in_units(_scaled(rows, limits, origin, centre, scale))
    rough = PolytopeArrays(points, facets, facets[:0], exact.on, centre, scale)
    found = settled(rough, 0)
    if found is not None:
        return found
    if spans_less(points, _PIVOT_GROWTH * SNAP):
        return hull(points, centre, scale, _PIVOT_GROWTH * SNAP)

    # Facets at a small angle: the incidence is the exact one.
    needed = without_redundant(rough.incidence, rough.dimension)
    return _reduced(rough, 0, needed, SNAP * largest_coordinate(points))


def _scaled(
    rows: Floats, limits: Floats, origin: Floats | float, centre: Floats, scale: Floats
) -> Floats:
    """Return half-spaces rows (x - origin) <= limits in scaled coordinates, as rows (a, b)."""
    return np.column_stack([rows * scale, moved_limits(rows, limits, centre - origin)])


def _unbounded(exact: cone.Vertices) -> Polyhedron:
    """Return the unbounded set of exact vertices, directions and lines."""
    points = [cone.whole([*point, Fraction(1)]) for point in exact.points]
    directions = [[*row, 0] for row in exact.directions]
    lines = [[*row, 0] for row in exact.lines]
    return of_generators(len(points[0]) - 1, points, directions, lines)


def _is_short(rows: Floats) -> Flags:
    """Return which rows are zero or, relative to the longest row, the rounding of a zero row."""
    sizes = np.abs(rows).max(axis=1)
    return np.asarray(sizes <= UNSURE * sizes.max(initial=0.0))


def _holds_without_direction(limits: Floats, which: Flags) -> bool:
    """Whether 0 x <= limit holds, to rounding, for each row of `which`."""
    return bool((limits[which] >= -ON * np.abs(limits).max(initial=0.0)).all())


def _noise(rows: Floats, limits: Floats, origin: Floats) -> tuple[Flags, cone.Vertices]:
    """Return which rows are rounding, and the exact vertices of the others.

    A row is rounding if it is far shorter than the longest one, also in units of the box of the
    rows that are not short: a set that needs a short row to be bounded has no such box.
    """
    is_short = _is_short(rows)
    exact = _exact_vertices(rows[~is_short], limits[~is_short], origin)
    if not is_short.any():
        return is_short, exact

    is_noise = np.asarray(~rows.any(axis=1))
    if exact.points and exact.is_bounded:
        _, scale = exact_coordinates(exact.box())
        is_noise = is_noise | is_short & _is_short(rows * scale)
    if (is_short == is_noise).all():
        return is_noise, exact
    return is_noise, _exact_vertices(rows[~is_noise], limits[~is_noise], origin)


def _exact_vertices(rows: Floats, limits: Floats, origin: Floats) -> cone.Vertices:
    """Return the exact vertices of {x: rows (x - origin) <= limits}, of all R^n without rows."""
    if not len(rows):
        rows = np.zeros((1, rows.shape[1]))
        limits = np.zeros(1)
    normals = cone.rationals(rows)
    shifts = cone.product(normals, cone.rationals(origin[:, None]))
    ends = [
        Fraction(limit) + shift for limit, (shift,) in zip(limits.tolist(), shifts, strict=True)
    ]
    return cone.vertices_of(normals, ends)


def cut(
    whole: PolytopeArrays, rows: Floats, limits: Floats, origin: Floats | float = 0.0
) -> PolytopeArrays:
    """Return the part of a bounded set where rows (x - origin) <= limits, or the set itself.

    The set is not empty, and the limits are finite. A half-space from which the set sticks out by
    less than ON of its size does not cut it. A part that is much smaller than the set is computed
    again, in its own coordinates, from the half-spaces that are near it.
    """
    facets = _in_coordinates_of(whole, rows, limits, origin)
    cuts = _cutting(whole, facets)
    if cuts is None:
        return empty(whole.space)
    if not len(cuts):
        return whole

    part = _with_facets(whole, cuts)
    if part.is_empty:
        return _of_all_half_spaces(part, whole)
    found = settled(part, len(whole.facets))
    if found is not None and not _is_small_part(found, whole):
        return found

    again = _of_near_half_spaces(part)
    if again is None:
        again = _of_all_half_spaces(part, whole)
    if not again.is_empty:
        return again
    # The set touches the half-spaces to rounding, and the exact intersection is empty: the points
    # of the part are the result.
    return hull(part.points, part.centre, part.scale) if found is None else found


def _in_coordinates_of(
    whole: PolytopeArrays, rows: Floats, limits: Floats, origin: Floats | float
) -> Floats:
    """Return half-spaces rows (x - origin) <= limits as rows (a, b) in the coordinates of a set.

    For a flat set these are its own coordinates: the others are functions of them. Entries that are
    the rounding of a difference are zero. A row without a direction gets the limit 0 if the set
    satisfies it to ON of its terms; otherwise its limit stays negative, and the set is outside.
    """
    facets = _scaled(rows, limits, origin, whole.centre, whole.scale)
    if not len(whole.equations):
        return facets

    _, others = own_and_others(whole.equations)
    factors = facets[:, others]
    within = facets - factors @ whole.equations
    within[:, others] = 0.0
    terms = np.abs(facets) + np.abs(factors) @ np.abs(whole.equations)
    within[np.abs(within) <= UNSURE * facets.shape[1] * terms] = 0.0

    # The distance of the set from a half-space without a direction is known to ON of the terms.
    is_zero = ~within[:, :-1].any(axis=1)
    holds = within[:, -1] >= -ON * terms.max(axis=1)
    within[is_zero & holds, -1] = 0.0
    return np.asarray(within)


def _cutting(whole: PolytopeArrays, facets: Floats) -> Floats | None:
    """Return the half-spaces, rows (a, b), that cut a set; None if the set is outside of one."""
    is_zero = np.asarray(~facets[:, :-1].any(axis=1))
    if (facets[is_zero, -1] < 0.0).any():
        return None

    facets = dd.in_units(facets[~is_zero])
    heights = whole.points @ facets[:, :-1].T - facets[:, -1]
    near = ON * largest_coordinate(whole.points)
    if (heights.min(axis=0) > near).any():
        return None
    return np.asarray(facets[heights.max(axis=0) > near])


def _with_facets(whole: PolytopeArrays, cuts: Floats) -> PolytopeArrays:
    """Return a set after the steps of the double description for half-spaces, rows (a, b).

    Nothing is checked: `settled` does this. The facets are the facets of the set and all cuts.
    """
    rays = np.column_stack([whole.points, np.ones(len(whole.points))])
    on = np.hstack([whole.incidence, np.zeros((len(rays), len(cuts)), np.bool_)])
    numbers = len(whole.facets) + np.arange(len(cuts))
    # An edge lies on one facet less than the set has dimensions.
    least = whole.dimension - 1
    rays, on = dd.insert_rows(rays, on, dd.rows_of_cone(cuts), numbers, least, True)

    points = rays[:, :-1].copy()
    return replace(whole, points=points, facets=np.vstack([whole.facets, cuts]), incidence=on)


def _of_all_half_spaces(part: PolytopeArrays, whole: PolytopeArrays) -> PolytopeArrays:
    """Return a part of a set from all its half-spaces alone."""
    rows, limits = half_spaces(part, whole.centre)
    return of_half_spaces(rows, limits, whole.centre, whole.bounding_box())


def _of_near_half_spaces(part: PolytopeArrays) -> PolytopeArrays | None:
    """Return a part from its half-spaces that are within SNAP of its points.

    None means that others cut what they leave. The points need not be right: if all half-spaces
    hold where these few hold, the others are redundant.
    """
    near = SNAP * largest_coordinate(part.points)
    gaps = part.facets[:, -1] - (part.points @ part.facets[:, :-1].T).max(axis=0)
    few = replace(part, facets=part.facets[gaps <= near])
    rows, limits = half_spaces(few, part.centre)
    found = of_half_spaces(rows, limits, part.centre, part.bounding_box(), is_inside=False)
    if not found.is_bounded:
        return None

    points = (found.vertices - part.centre) / part.scale
    heights = points @ part.facets[:, :-1].T - part.facets[:, -1]
    if heights.max(initial=0.0) > near:
        return None
    return found


def _is_small_part(part: PolytopeArrays, whole: PolytopeArrays) -> bool:
    """Whether a part is much narrower than the whole set along an axis, but not flat there."""
    before = np.ptp(whole.points, axis=0)
    widths = np.ptp(part.points, axis=0)
    return bool(((FINE * widths < before) & (widths > SNAP * before)).any())


def settled(rough: PolytopeArrays, known: int) -> PolytopeArrays | None:
    """Return a set without what is redundant, or None if vertices and facets are not certainly all.

    The first `known` facets belong to a set that was settled before; 0 means that all were
    computed. Vertices on the other facets were computed: they are compared with all facets, and
    move to the outer sides of their own.

    Facets that were themselves computed need not meet in one point. If a vertex is not within SNAP
    of its facets, the vertices are computed again from them, and may then be _MEETING away.

    Points within SNAP of a facet are on it where the result is not closed otherwise: vertices
    nearer to each other are one. Facets on which all vertices lie are equations of a set of lower
    dimension: the hull of its vertices.
    """
    size = largest_coordinate(rough.points)
    far = SNAP * size
    on, is_consistent = touching(rough.points, rough.facets, rough.incidence, known, size, far)
    if not is_consistent:
        points = refined(rough.points, rough.facets, rough.equations, rough.incidence, known)
        rough = replace(rough, points=points)
        far = _MEETING * size
        on, is_consistent = touching(points, rough.facets, rough.incidence, known, size, far)
    if not is_consistent:
        return None
    if _is_flat(on, rough.dimension):
        return _flat_part(replace(rough, incidence=on), known)

    # First the incidence that the steps of the double description left: it tells apart even
    # vertices that are within SNAP of each other, but may lack points of a facet. Then the
    # incidence by distances.
    for incidence in (rough.incidence, on):
        needed = without_redundant(incidence, rough.dimension)
        is_lost = loses_points(
            rough.points, needed.points, incidence, rough.dimension, SAME_VERTEX * size
        )
        if not is_lost and is_closed(needed.on, rough.dimension):
            return _reduced(replace(rough, incidence=incidence), known, needed, far)
    return None


def _is_flat(on: Flags, dimension: int) -> bool:
    """Whether points, with an incidence `on`, are too few for an interior or all on one facet."""
    return len(on) <= dimension or bool(on.all(axis=0).any())


def _flat_part(whole: PolytopeArrays, known: int) -> PolytopeArrays | None:
    """Return the hull of points that are all on a facet.

    It is None if the hull is not flat, or if the set of the facets is not.
    """
    if _has_interior(whole):
        return None
    near = SNAP * largest_coordinate(whole.points)
    points = push_out(whole.points, whole.facets, whole.incidence, known, True, near)

    # Rounding grows across the facets on which all points are, and in no other direction. The
    # greater thickness is for these directions alone: if the hull is flat in more, SNAP decides.
    planes = np.ascontiguousarray(whole.facets[whole.incidence.all(axis=0), :-1])
    expected = 0
    if len(planes):
        chosen, _ = dd.pivots(planes, REDUCED, -1)
        expected = whole.dimension - len(chosen)
    flat = hull(points, whole.centre, whole.scale, _PIVOT_GROWTH * SNAP)
    if flat.dimension < expected:
        flat = hull(points, whole.centre, whole.scale)
    return flat if flat.dimension < whole.dimension else None


def _has_interior(whole: PolytopeArrays) -> bool:
    """Whether a point near the middle of the points, REDUCED inward, is in the set of the facets.

    Then points that are all on one facet are not all vertices: one that is not on it was lost.
    """
    planes = whole.facets[whole.incidence.all(axis=0), :-1]
    middle = whole.points.mean(axis=0)
    inside = middle - REDUCED * planes.sum(axis=0)
    return bool((whole.facets[:, :-1] @ inside < whole.facets[:, -1] - SAME_VERTEX).all())


def _reduced(rough: PolytopeArrays, known: int, needed: Needed, most: float) -> PolytopeArrays:
    """Return a set with its `needed` points and facets.

    New vertices move to the outer sides of their facets, by at most a distance `most`.
    """
    is_flat = len(rough.equations) > 0
    points = push_out(rough.points, rough.facets, rough.incidence, known, is_flat, most)
    return replace(
        rough,
        points=points[needed.points],
        facets=rough.facets[needed.rows],
        incidence=needed.on,
    )
