"""Construction of polytopes: hulls of points, intersections of half-spaces, and cuts.

Each set is computed in three steps. The double description finds vertices or facets with rounded
numbers. What it finds is *settled* (`settled`): what is redundant goes, and the rest is kept only
if it proves to be all (`incidence.is_closed`), with the incidence of the double description or with
that of all points within SNAP of a facet. Otherwise the set is computed again with integers
(`cone`), which round nothing.

Whether half-spaces have an empty, flat or unbounded intersection is decided by integers. A cut of a
set that exists is decided to ON of its size if it is empty, and to SNAP if it is flat.

New vertices move to the outer sides of their facets. If no vertex is missing, the hull of the
vertices then contains the set of the half-spaces: each face of the hull is on the outer side of its
facet.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.double_words import supports
from infoset.geometry.polytope import cone
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope.arrays import PolytopeArrays, half_spaces, own_and_others
from infoset.geometry.polytope.incidence import is_closed, without_redundant
from infoset.geometry.polytope.outward import around, loses_points, push_out, refined, touching
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
    moved_limits,
    scaled_points,
)
from infoset.geometry.tolerances import ON, REDUCED, SNAP, UNSURE

Ends = tuple[Floats, Floats]
"""Minimum and maximum coordinates, each of shape (n,)."""
FINE = 2.0**14
"""Ratio of widths from which a part of a set is computed in its own coordinates: its vertices are
known to ON of the whole, which would be SNAP of a part 2000 times smaller than this."""
_GOOD_WIDTH_RATIO = 2.0**6
"""Ratio of widths up to which coordinates are as good as those of the set itself: two digits are
lost.
"""
_LEAST_WIDTH = 64.0 * UNSURE / SNAP
"""Scale of an axis, relative to the coordinates from which limits were computed, in which their
rounding is flat.
"""
_PIVOT_GROWTH = 64.0
"""Growth of distances from a plane in the pivots of a flat set."""
_SAME_VERTEX = 64.0 * SNAP
"""Distance of points that are the same vertex: within SNAP of its facets, unless these are at a
small angle.
"""
_MEETING = 16.0 * SNAP
"""Distance from a vertex of computed facets that meet in it; up to 6 SNAP were measured in
observers of four states.
"""


def empty(space: int) -> PolytopeArrays:
    """Return the empty set of R^n, n = `space`."""
    nothing = np.zeros((0, space + 1))
    return PolytopeArrays(
        nothing[:, 1:],
        nothing,
        nothing,
        np.zeros((0, 0), np.bool_),
        np.zeros(space),
        np.ones(space),
    )


def box(lower: Floats, upper: Floats) -> PolytopeArrays:
    """Return {x: lower <= x <= upper} for bounds of shape (n,); flat along axes whose bounds are
    equal. Exact.
    """
    space = len(lower)
    centre, scale = coordinates(lower.copy(), upper.copy(), np.zeros(space), 0.0)
    least = (lower - centre) / scale
    most = (upper - centre) / scale
    ends = [dict.fromkeys(pair) for pair in zip(least, most, strict=True)]
    points = np.array(list(itertools.product(*ends)))

    unit = np.eye(space)
    is_wide = least < most
    normals = np.vstack([unit[is_wide], -unit[is_wide]])
    offsets = np.concatenate([most[is_wide], -least[is_wide]])
    incidence = points @ normals.T == offsets
    equations = np.column_stack([unit[~is_wide], most[~is_wide]])
    return PolytopeArrays(
        points, np.column_stack([normals, offsets]), equations, incidence, centre, scale
    )


def of_polyhedron(found: Polyhedron) -> PolytopeArrays:
    """Return an exact set; its numbers are rounded to nearest, and once more in what is computed
    from them.
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


# Hulls of points
# --------------------------------------------------------------------------------------------------


def hull_of(points: Floats, flat: float = SNAP) -> PolytopeArrays:
    """Return the convex hull of points, shape (m, n), at least one; see `hull`."""
    centre, scale = coordinates(
        points.min(axis=0), points.max(axis=0), np.zeros(points.shape[1]), SNAP
    )
    return hull((points - centre) / scale, centre, scale, flat)


def hull(points: Floats, centre: Floats, scale: Floats, flat: float = SNAP) -> PolytopeArrays:
    """Return the convex hull of points in scaled coordinates; it is flat if it is thinner than
    `flat`.

    Points that span no more than d dimensions differ in d coordinates, found by complete pivoting.
    The hull is computed in these; the other coordinates are functions of them.
    """
    space = points.shape[1]
    start = np.column_stack([points, np.ones(len(points))])
    chosen, columns = dd.pivots(start, flat, 0)
    own = columns[1:]
    rest = np.delete(np.arange(space), own)
    slopes = np.linalg.solve(start[chosen][:, [*own, space]], points[np.ix_(chosen, rest)]).T
    equations = np.eye(space, space + 1)[rest]
    equations[:, own] = -slopes[:, :-1]
    equations[:, -1] = slopes[:, -1]
    if not len(own):
        return PolytopeArrays(
            points[:1].copy(), equations[:0], equations, np.zeros((1, 0), np.bool_), centre, scale
        )

    if len(rest):
        # The two sides of a flat set are the same points, to its thickness.
        points = points[
            np.sort(np.unique(np.rint(points[:, own] / SNAP), axis=0, return_index=True)[1])
        ]
    inner = np.ascontiguousarray(points[:, own])
    used, normals, incidence = _facets_of(inner)
    facets = np.zeros((len(normals), space + 1))
    facets[:, own] = normals
    facets[:, -1] = supports(inner, normals)
    return PolytopeArrays(points[used], facets, equations, incidence, centre, scale)


def _spans_less(points: Floats, flat: float) -> bool:
    """Whether points are in a plane, to a distance `flat`."""
    chosen, _ = dd.pivots(np.column_stack([points, np.ones(len(points))]), flat, 0)
    return bool(len(chosen) <= points.shape[1])


def _facets_of(points: Floats) -> tuple[Integers, Floats, Flags]:
    """Return the numbers of the vertices, the normals of the facets and the incidence of a hull
    with an interior.
    """
    dimension = points.shape[1]
    rays, on = dd.extreme_rays(np.column_stack([-points, np.ones(len(points))]), False, 0.0)
    for is_exact in (False, True):
        if is_exact:
            rows = [
                cone.whole([*(-x for x in point), Fraction(1)]) for point in cone.rationals(points)
            ]
            exact = cone.extreme_rays(rows)
            rays = np.array([cone.rounded(ray) for ray in exact.rays])
            on = exact.on
        # Rounding can divide a facet in two rays, each on some of its points: on all of them, they
        # are one.
        snapped, is_consistent = touching(points, rays, on.T.copy(), 0, 1.0, SNAP)
        for one in (on.T.copy(), snapped):
            used, sides, incidence = without_redundant(one, dimension)
            is_lost = loses_points(points, used, one, dimension, _SAME_VERTEX)
            if is_consistent and not is_lost and is_closed(incidence, dimension):
                return used, rays[sides, :-1].copy(), incidence
    # Facets at a small angle: what is on which is as the integers say.
    used, sides, incidence = without_redundant(on.T.copy(), dimension)
    return used, rays[sides, :-1].copy(), incidence


# Half-spaces
# --------------------------------------------------------------------------------------------------


def of_half_spaces(
    rows: Floats,
    limits: Floats,
    origin: Floats | float = 0.0,
    ends: Ends | None = None,
    sizes: Floats | None = None,
    *,
    is_inside: bool = True,
) -> PolytopeArrays:
    """Return {x: rows (x - origin) <= limits}; limits may be infinite.

    If the set is known to be about in a box, its `ends` save time. If it certainly `is_inside`, and
    unbounded because of rounding, it is clipped to the box.

    `sizes`, shape (n,), are those of the coordinates from which limits were computed. Integers
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
    frame = np.zeros(space), np.ones(space)
    if ends is not None:
        frame = _frame_of(*ends)
    for _ in range(3):
        found = _rounded(rows, limits, start, *frame)
        if found is None:
            break
        if (
            np.abs(found.points).max() <= _GOOD_WIDTH_RATIO
            and np.ptp(found.points, axis=0).min() >= 1.0 / _GOOD_WIDTH_RATIO
        ):
            return found
        frame = _frame_of(*found.bounding_box())
    if sizes is not None:
        limits = limits + UNSURE * (np.abs(rows) @ sizes)
    found = _with_integers(rows, limits, start, np.zeros(space) if sizes is None else sizes)
    if found.is_bounded or ends is None or not is_inside:
        return found
    sides = np.vstack([rows, np.eye(space), -np.eye(space)])
    ends_of_box = np.concatenate([ends[1] - start, start - ends[0]])
    return _with_integers(
        sides, np.append(limits, ends_of_box), start, np.zeros(space) if sizes is None else sizes
    )


def _frame_of(lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return the centre and the scales of coordinates for a set in a box."""
    found: tuple[Floats, Floats] = coordinates(lower, upper, np.zeros(len(lower)), SNAP)
    return found


def _rounded(
    rows: Floats, limits: Floats, origin: Floats, centre: Floats, scale: Floats
) -> PolytopeArrays | None:
    """Return {x: rows (x - origin) <= limits} by the double description, or None if integers must
    decide.

    They decide unless the set is bounded, closed, and thicker than REDUCED in these coordinates.
    """
    space = len(scale)
    scaled = np.column_stack([rows * scale, moved_limits(rows, limits, centre - origin)])
    if _is_short(scaled[:, :-1]).any() or not len(scaled):
        return None
    scaled = dd.in_units(scaled)
    table = np.vstack(
        [np.eye(space + 1)[-1:], scaled * ([-1.0] * space + [1.0])]
    )  # the first row is t >= 0
    rays, on = dd.extreme_rays(table, True, ON)
    if not len(rays) or not (rays[:, -1] == 1.0).all():
        return None
    rough = PolytopeArrays(rays[:, :-1].copy(), scaled, scaled[:0], on[:, 1:].copy(), centre, scale)
    middle = rough.points.mean(axis=0)
    if (scaled[:, -1] - scaled[:, :-1] @ middle).min() < REDUCED:
        return None
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
    centre, scale = exact_coordinates(exact.box())
    scale = np.maximum(scale, np.ldexp(1.0, np.frexp(_LEAST_WIDTH * sizes)[1] - 1) * (sizes > 0.0))
    facets = dd.in_units(
        np.column_stack([rows * scale, moved_limits(rows, limits[~is_noise], centre - origin)])
    )
    points = scaled_points(exact.points, centre, scale)
    if _is_flat(exact.on, rows.shape[1]):
        return hull(points, centre, scale)
    rough = PolytopeArrays(points, facets, facets[:0], exact.on, centre, scale)
    found = settled(rough, 0)
    if found is not None:
        return found
    if _spans_less(points, _PIVOT_GROWTH * SNAP):
        return hull(points, centre, scale, _PIVOT_GROWTH * SNAP)
    # Facets at a small angle: what is on which is as the integers say.
    used, sides, kept = without_redundant(rough.incidence, rough.dimension)
    return _reduced(rough, 0, used, sides, kept, SNAP * max(1.0, float(np.abs(points).max())))


def _unbounded(exact: cone.Vertices) -> Polyhedron:
    """Return the unbounded set of exact vertices, directions and lines."""
    points = [cone.whole([*point, Fraction(1)]) for point in exact.points]
    directions = [[*row, 0] for row in exact.directions]
    lines = [[*row, 0] for row in exact.lines]
    return of_generators(len(points[0]) - 1, points, directions, lines)


def _is_short(rows: Floats) -> Flags:
    """Return which rows are shorter than the longest one by a factor, or zero: the rounding of a
    sum that is zero.
    """
    sizes = np.abs(rows).max(axis=1)
    return np.asarray(sizes <= UNSURE * sizes.max(initial=0.0))


def _holds_without_direction(limits: Floats, which: Flags) -> bool:
    """Whether 0 x <= limit holds, to rounding, for some of the rows."""
    return bool((limits[which] >= -ON * np.abs(limits).max(initial=0.0)).all())


def _noise(rows: Floats, limits: Floats, origin: Floats) -> tuple[Flags, cone.Vertices]:
    """Return which rows are rounding, and the exact vertices of the others.

    A row is rounding if it is far shorter than the longest one, also in units of the box of the
    rows that are not: a set that needs it to be bounded has no such box.
    """
    is_short = _is_short(rows)
    exact = _exact_vertices(rows[~is_short], limits[~is_short], origin)
    if not is_short.any():
        return is_short, exact
    is_noise = np.asarray(~rows.any(axis=1))
    if exact.points and exact.is_bounded:
        is_noise = is_noise | is_short & _is_short(rows * exact_coordinates(exact.box())[1])
    if (is_short == is_noise).all():
        return is_noise, exact
    return is_noise, _exact_vertices(rows[~is_noise], limits[~is_noise], origin)


def _exact_vertices(rows: Floats, limits: Floats, origin: Floats) -> cone.Vertices:
    """Return the exact vertices of {x: rows (x - origin) <= limits}; without rows, those of the
    whole space.
    """
    if not len(rows):
        rows = np.zeros((1, rows.shape[1]))
        limits = np.zeros(1)
    normals = cone.rationals(rows)
    shifts = cone.product(normals, cone.rationals(origin[:, None]))
    ends = [
        Fraction(limit) + shift for limit, (shift,) in zip(limits.tolist(), shifts, strict=True)
    ]
    return cone.vertices_of(normals, ends)


# Cuts
# --------------------------------------------------------------------------------------------------


def cut(
    whole: PolytopeArrays, rows: Floats, limits: Floats, origin: Floats | float = 0.0
) -> PolytopeArrays:
    """Return the part of a bounded set where rows (x - origin) <= limits, or the set itself.

    A half-space from which the set sticks out by less than ON of its size does not cut it. A part
    that is much smaller than the set is computed again, in its own coordinates, from the
    half-spaces that are near it.
    """
    scaled = np.column_stack(
        [rows * whole.scale, moved_limits(rows, limits, whole.centre - origin)]
    )
    if len(whole.equations):
        scaled = _within(scaled, whole.equations)
    is_zero = np.asarray(~scaled[:, :-1].any(axis=1))
    if (scaled[is_zero, -1] < 0.0).any():
        return empty(whole.space)
    scaled = dd.in_units(scaled[~is_zero])
    heights = whole.points @ scaled[:, :-1].T - scaled[:, -1]
    near = ON * max(1.0, float(np.abs(whole.points).max()))
    if (heights.min(axis=0) > near).any():
        return empty(whole.space)
    cuts = scaled[heights.max(axis=0) > near]
    if not len(cuts):
        return whole

    rays = np.column_stack([whole.points, np.ones(len(whole.points))])
    on = np.hstack([whole.incidence, np.zeros((len(rays), len(cuts)), np.bool_)])
    numbers = len(whole.facets) + np.arange(len(cuts))
    table = cuts * ([-1.0] * whole.space + [1.0])
    # An edge lies on one facet less than the set has dimensions.
    rays, on = dd.insert_rows(rays, on, table, numbers, whole.dimension - 1, True)
    part = replace(
        whole, points=rays[:, :-1].copy(), facets=np.vstack([whole.facets, cuts]), incidence=on
    )
    if not len(rays):
        return of_half_spaces(*half_spaces(part, whole.centre), whole.centre, whole.bounding_box())
    found = settled(part, len(whole.facets))
    if found is not None and not _is_small_part(found, whole):
        return found

    again = _computed_again(part, whole)
    if not again.is_empty:
        return again
    # It touches the half-spaces, to rounding: in less than a point, the integers say.
    if found is not None:
        return found
    return hull(part.points, part.centre, part.scale)


def _computed_again(part: PolytopeArrays, whole: PolytopeArrays) -> PolytopeArrays:
    """Return a part of a set from its half-spaces alone: those that are near it, or if these are
    not enough, all.
    """
    few = _of_near_half_spaces(part)
    if few is not None:
        return few
    return of_half_spaces(*half_spaces(part, whole.centre), whole.centre, whole.bounding_box())


def _of_near_half_spaces(part: PolytopeArrays) -> PolytopeArrays | None:
    """Return a part from its half-spaces that are within SNAP of its points, or None if others cut
    what they leave.

    The points need not be right: if all half-spaces hold where these few hold, the others are
    redundant.
    """
    near = SNAP * max(1.0, float(np.abs(part.points).max()))
    gaps = part.facets[:, -1] - (part.points @ part.facets[:, :-1].T).max(axis=0)
    few = replace(part, facets=part.facets[gaps <= near])
    lower, upper = part.bounding_box()
    found = of_half_spaces(
        *half_spaces(few, part.centre), part.centre, (lower, upper), is_inside=False
    )
    if not found.is_bounded:
        return None
    points = (found.vertices - part.centre) / part.scale
    heights = points @ part.facets[:, :-1].T - part.facets[:, -1]
    return None if heights.max(initial=0.0) > near else found


def _within(rows: Floats, equations: Floats) -> Floats:
    """Return rows (a, b) in the own coordinates of a flat set: the others are functions of them.

    Entries that are the rounding of a difference are zero; a row without others holds to this
    rounding.
    """
    _, others = own_and_others(equations)
    factors = rows[:, others]
    own = rows - factors @ equations
    own[:, others] = 0.0
    terms = np.abs(rows) + np.abs(factors) @ np.abs(equations)
    own[np.abs(own) <= UNSURE * rows.shape[1] * terms] = 0.0
    is_zero = ~own[:, :-1].any(axis=1)
    # The distance of the set from such a half-space is known to ON of the terms.
    near = ON * terms.max(axis=1)
    own[is_zero & (own[:, -1] >= -near), -1] = 0.0
    return np.asarray(own)


def _is_small_part(part: PolytopeArrays, whole: PolytopeArrays) -> bool:
    """Whether a part is much narrower than the whole set along an axis, but not flat there."""
    before = np.ptp(whole.points, axis=0)
    widths = np.ptp(part.points, axis=0)
    return bool(((FINE * widths < before) & (widths > SNAP * before)).any())


def settled(rough: PolytopeArrays, known: int) -> PolytopeArrays | None:
    """Return a set without what is redundant, or None if vertices and facets are not certainly all.

    The first `known` facets are those of a set that was settled before. Vertices on others were
    computed: they are compared with all facets, and move to the outer sides of their own. 0 means
    that all were computed.

    Facets that were themselves computed need not meet in one point. If a vertex is not within SNAP
    of its facets, the vertices are computed again from them, and may then be _MEETING away.

    Points within SNAP of a facet are on it where the result is not closed otherwise: vertices
    nearer to each other are one. Facets on which all vertices lie are equations of a set of lower
    dimension: the hull of its vertices.
    """
    size = max(1.0, float(np.abs(rough.points).max()))
    far = SNAP * size
    on, is_consistent = touching(rough.points, rough.facets, rough.incidence, known, size, far)
    if not is_consistent:
        rough = replace(
            rough,
            points=refined(rough.points, rough.facets, rough.equations, rough.incidence, known),
        )
        far = _MEETING * size
        on, is_consistent = touching(rough.points, rough.facets, rough.incidence, known, size, far)
    if not is_consistent:
        return None
    if _is_flat(on, rough.dimension):
        return _flat_part(replace(rough, incidence=on), known)

    # What is on which by the steps of the double description is finer than by distances, if it is
    # all.
    for incidence in (rough.incidence, on):
        used, sides, kept = without_redundant(incidence, rough.dimension)
        if loses_points(rough.points, used, incidence, rough.dimension, _SAME_VERTEX * size):
            continue
        if is_closed(kept, rough.dimension):
            return _reduced(replace(rough, incidence=incidence), known, used, sides, kept, far)
    return None


def _flat_part(whole: PolytopeArrays, known: int) -> PolytopeArrays | None:
    """Return the hull of points that are all on a facet; None if it is not flat, or if the set of
    the facets is not.
    """
    if _has_interior(whole):
        return None
    near = SNAP * max(1.0, float(np.abs(whole.points).max()))
    points = push_out(whole.points, whole.facets, whole.incidence, known, True, near)
    # Rounding grows across the facets on which all points are, and in no other direction.
    planes = np.ascontiguousarray(whole.facets[whole.incidence.all(axis=0), :-1])
    expected = whole.dimension - len(dd.pivots(planes, REDUCED, -1)[0]) if len(planes) else 0
    flat = hull(points, whole.centre, whole.scale, _PIVOT_GROWTH * SNAP)
    if flat.dimension < expected:
        flat = hull(points, whole.centre, whole.scale)
    return flat if flat.dimension < whole.dimension else None


def _has_interior(whole: PolytopeArrays) -> bool:
    """Whether a point beside the middle of the points, REDUCED inward, is in the set of the facets.

    Then points that are all on one facet are not all vertices: one that is not on it was lost.
    """
    planes = whole.facets[whole.incidence.all(axis=0), :-1]
    middle = whole.points.mean(axis=0)
    inside = middle - REDUCED * planes.sum(axis=0)
    return bool((whole.facets[:, :-1] @ inside < whole.facets[:, -1] - _SAME_VERTEX).all())


def _is_flat(on: Flags, dimension: int) -> bool:
    """Whether points, with `on` for which is on which half-space, are too few for an interior or
    all on a boundary.
    """
    return len(on) <= dimension or bool(on.all(axis=0).any())


def _reduced(
    rough: PolytopeArrays, known: int, used: Integers, sides: Integers, kept: Flags, most: float
) -> PolytopeArrays:
    """Return a set with some of its points and facets, `kept` which of them are on which.

    New vertices move to the outer sides of their facets, by at most a distance `most`.
    """
    is_flat = len(rough.equations) > 0
    points = push_out(rough.points, rough.facets, rough.incidence, known, is_flat, most)
    return replace(rough, points=points[used], facets=rough.facets[sides], incidence=kept)


def enlarged(one: PolytopeArrays, by: Floats) -> PolytopeArrays:
    """Return a set that contains {y + e: |e_i| <= by_i}, in scaled coordinates, `by` of shape
    (n,).
    """
    points, facets = around(one.points, one.facets, one.incidence, by, len(one.equations) > 0)
    return replace(one, points=points, facets=facets)
