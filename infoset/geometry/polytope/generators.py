"""Vertices and facets of zonotopes.

A zonotope is {centre + t_1 g_1 + ... + t_m g_m: all -1 <= t_i <= 1} for generators g_i. A facet of
a zonotope of R^3 is parallel to two generators; all the others are at their ends, t = 1 or -1, on
the side of the facet. Signs of determinants are therefore enough: no set is enlarged step by step.

References
----------
P. McMullen, On zonotopes, Transactions of the American Mathematical Society 159 (1971).
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.double_words import affine_image, two_product, two_sum
from infoset.geometry.polytope import double_description as dd
from infoset.geometry.polytope.arrays import PolytopeArrays
from infoset.geometry.polytope.outward import MAX_MOVE, push_out
from infoset.geometry.polytope.scaled_coordinates import coordinates
from infoset.geometry.tolerances import EPS, ON, SNAP, UNSURE
from infoset.kernels import Kernels

_kernels = Kernels()
PARALLEL = SNAP
"""Sine of the angle between two generators that count as parallel: their difference is flat,
relative to them.
"""
_NEARLY_PARALLEL = 1.0 - 1e-6
"""Cosine of two generators above which their sine is computed, to compare it with `PARALLEL`.

The cosine itself cannot decide: of parallel generators it is 1 - 3e-23, which is rounded to 1.
Chosen: at this cosine the sine is 1.4e-3, so that generators below it are certainly not parallel.
"""
COPLANAR = 128.0 * UNSURE
"""Determinant of three generators of length one that count as coplanar: 500 roundings.

It is 60 times below the determinant of two generators that just count as parallel and a third one
at right angles.
"""
_BLUNT = 0.1
"""Minimum cosine of the angles between the mean normal of a vertex and the normals of its facets
for which the vertex moves along the mean normal.

To move by a rounding across a facet, the vertex moves by a rounding over the cosine: by at most ten
roundings. Chosen; at smaller cosines, in sharp corners, `push_out` finds shorter moves.
"""
SHORT = ON
"""Sum of the lengths of the shortest generators, in scaled coordinates, up to which they are left
out; facets and vertices move outward by them instead.
"""


class Span:
    """Scaled coordinates of a zonotope, and its affine hull.

    In the coordinates y, x = `middle` + `scale` y, it is about one wide along each axis.

    Attributes
    ----------
    middle, scale, start : ndarray, shape (n,)
        The scales are powers of two. The centre of the zonotope is y = `start`.
    generators : ndarray, shape (m, n)
        In scaled coordinates.
    own, others : ndarray of int, shapes (d,) and (n - d,)
        Numbers of coordinates that are independent in the set, and of the others, which are
        functions of them.
    rows : ndarray, shape (m, d)
        The generators in the own scaled coordinates.
    basis : ndarray of int, shape (d,)
        Numbers of independent generators.
    base : ndarray, shape (d, d)
        The rows of the basis; the first is turned if this makes their determinant positive.
    slopes : ndarray, shape (n - d, d)
        Changes of the other scaled coordinates with the own ones.
    """

    def __init__(self, centre: Floats, generators: Floats) -> None:
        radius = np.abs(generators).sum(axis=0)
        # No width is too small, as for a box: nothing is known from rounded points.
        self.middle, self.scale = coordinates(centre - radius, centre + radius, 2.0 * radius, 0.0)
        self.start = (centre - self.middle) / self.scale
        self.generators = generators / self.scale

        own, self.basis = _independent(self.generators)
        self.own = np.sort(own)
        self.others = np.delete(np.arange(len(centre)), own)
        self.rows = np.ascontiguousarray(self.generators[:, self.own])
        self.base = self.rows[self.basis]
        across = self.generators[self.basis][:, self.others]
        self.slopes = np.asarray(np.linalg.solve(self.base, across).T, np.float64)
        if np.linalg.det(self.base) < 0.0:
            self.base[0] *= -1.0

    @cached_property
    def coefficients(self) -> Floats:
        """Coordinates of the generators in the base, shape (m, d): result @ base = rows.

        In them the basis spans a box from -1 to 1 along each axis, so that no zonotope is thin. One
        solution and two corrections, whose residuals are computed in doubled digits, are exact to
        rounding also if the given set is thin. The generators of the basis have coefficients of
        exactly 0, 1 or -1.
        """
        space = len(self.own)
        equations = np.hstack([self.base.T, -np.eye(space)])
        result = np.zeros(self.rows.shape)
        for _ in range(3):
            missing, _ = affine_image(np.hstack([result, self.rows]), equations, np.zeros(space))
            result -= np.linalg.solve(self.base.T, missing.T).T
        result[self.basis] = np.rint(result[self.basis])
        return result

    @cached_property
    def steps(self) -> Floats:
        """Changes of x with the own scaled coordinates, shape (n, d)."""
        steps = np.zeros((len(self.scale), len(self.own)))
        steps[self.own] = np.eye(len(self.own))
        steps[self.others] = self.slopes
        return self.scale[:, None] * steps


class Distinct(NamedTuple):
    """Generators of which no two are parallel."""

    rows: Floats
    """In own scaled coordinates, shape (k, d)."""
    coefficients: Floats
    """As combinations of the base, shape (k, d)."""
    missed: Floats
    """Half-widths of a box, shape (d,): the zonotope of the rows, enlarged by the box, contains the
    given one.
    """


class Faces(NamedTuple):
    """Facets and vertices of a zonotope with an interior and the centre 0."""

    along: Integers
    """Independent generators to which each facet is parallel, shape (f, d - 1)."""
    ahead: Floats
    """Factor of their outward normal, 1 or -1, see `_normals`, shape (f,)."""
    signs: Floats
    """The factors of the generators at each vertex, 1 or -1, shape (v, m)."""
    vertex: Integers
    """The vertices on the facets, in ascending order, shape (p,)."""
    facet: Integers
    """The facets on which they are, shape (p,)."""

    def incidence(self) -> Flags:
        """Return which vertex is on which facet, shape (v, f)."""
        on = np.zeros((len(self.signs), len(self.ahead)), np.bool_)
        on[self.vertex, self.facet] = True
        return on


def polytope_of(kind: Any, centre: Floats, generators: Floats) -> Any:
    """Return a zonotope as a polytope of a class `kind` that contains it, larger by rounding.

    In up to three dimensions all facets and vertices follow from signs. In more, or where rounding
    decides which generators are coplanar, it is a sum of segments.
    """
    span = Span(centre, generators)
    if not len(span.own):
        return kind.from_vertices(centre[None])

    kept = without_parallel(span)
    faces = None
    if len(span.own) <= 3:
        faces = faces_of(kept.coefficients)
    if faces is not None:
        inner = _of_faces(kind, faces, span, kept)
    else:
        scale = span.scale[span.own]
        segments = _sum_of_segments(kind, centre[span.own], kept.rows, scale)
        inner = segments.enlarged(kept.missed * scale)
    return inner if inner.space == len(centre) else _lifted(kind, inner, span, centre)


def _independent(generators: Floats) -> tuple[Integers, Integers]:
    """Return independent coordinates and generators of a zonotope, shapes (d,), by elimination.

    The generators are in coordinates in which the set is about one wide. Each step eliminates the
    coordinate in which the rest of the set is widest, until no rest is wider than SNAP.
    """
    rest = generators.copy()
    columns: list[int] = []
    rows: list[int] = []
    while len(rows) < min(rest.shape):
        widths = 2.0 * np.abs(rest).sum(axis=0)
        column = int(widths.argmax())
        if widths[column] <= SNAP:
            break

        row = int(np.abs(rest[:, column]).argmax())
        rest -= np.outer(rest[:, column] / rest[row, column], rest[row])
        # Exactly zero: the rounding of the elimination could be chosen again.
        rest[:, column] = 0.0
        rest[row] = 0.0
        columns.append(column)
        rows.append(row)
    return np.array(columns, np.int64), np.array(rows, np.int64)


def exact_determinant(matrix: Floats) -> float:
    """Return the determinant of a regular matrix, shape (d, d), rounded once.

    Gaussian elimination in fractions.
    """
    rows = [[Fraction(entry) for entry in row] for row in matrix.tolist()]
    determinant = Fraction(1)
    for k in range(len(rows)):
        pivot = max(range(k, len(rows)), key=lambda i: abs(rows[i][k]))
        if pivot != k:
            rows[k], rows[pivot] = rows[pivot], rows[k]
            determinant = -determinant
        determinant *= rows[k][k]
        for i in range(k + 1, len(rows)):
            factor = rows[i][k] / rows[k][k]
            pairs = zip(rows[i], rows[k], strict=True)
            rows[i] = [entry - factor * above for entry, above in pairs]
    return float(determinant)


def without_parallel(span: Span) -> Distinct:
    """Return generators of which no two are parallel.

    Parallel generators are summed, and the shortest ones left out (`SHORT`). O(m k) for m
    generators.
    """
    lengths = np.linalg.norm(span.rows, axis=1)
    order = np.argsort(lengths, kind="stable")
    is_short = np.zeros(len(order), np.bool_)
    is_short[order] = np.cumsum(lengths[order]) <= SHORT
    is_short[span.basis] = False
    missed = np.abs(span.rows[is_short]).sum(axis=0)

    descending = order[::-1]
    groups, directions = _parallel_groups(span.coefficients, descending[~is_short[descending]])
    rows = np.empty((len(groups), len(span.own)))
    coefficients = np.empty_like(rows)
    for k, group in enumerate(groups):
        turned = np.where(span.coefficients[group] @ directions[k] < 0.0, -1.0, 1.0)[:, None]
        members = turned * span.rows[group]
        rows[k] = members.sum(axis=0)
        coefficients[k] = (turned * span.coefficients[group]).sum(axis=0)
        if len(group) > 1:
            shares = members @ rows[k] / (rows[k] @ rows[k])
            # For each member a product, a difference and a sum are rounded by half of EPS; the rest
            # is for shares whose sum is 1 only to rounding.
            rounding = 4.0 * len(group) * EPS * np.abs(rows[k])
            missed += np.abs(members - shares[:, None] * rows[k]).sum(axis=0) + rounding
    return Distinct(rows, coefficients, missed)


def _parallel_groups(generators: Floats, numbers: Integers) -> tuple[list[list[int]], Floats]:
    """Return groups of parallel generators, some `numbers` of them, and the directions of groups.

    A direction, of length one, is the direction of the first generator of a group.
    """
    units = generators[numbers] / np.linalg.norm(generators[numbers], axis=1)[:, None]
    directions = np.empty_like(units)
    groups: list[list[int]] = []
    for number, unit in zip(numbers.tolist(), units, strict=True):
        known = directions[: len(groups)]
        cosines = known @ unit
        near = np.flatnonzero(np.abs(cosines) > _NEARLY_PARALLEL)
        away = unit - cosines[near, None] * known[near]
        same = near[np.linalg.norm(away, axis=1) <= PARALLEL]
        if len(same):
            groups[int(same[0])].append(number)
        else:
            directions[len(groups)] = unit
            groups.append([number])
    return groups, directions


def faces_of(generators: Floats) -> Faces | None:
    """Return the faces of a zonotope in one to three dimensions, of generators of shape (m, d).

    No two generators are parallel, and they span all dimensions. It is None if rounding decides
    which generators are coplanar.
    """
    dimension = generators.shape[1]
    if dimension == 1:
        ends = np.array([1.0, -1.0])
        signs = np.sign(generators) * ends[:, None]
        numbers = np.arange(2)
        return Faces(np.zeros((2, 0), np.int64), ends, signs, numbers, numbers)
    if dimension == 2:
        return _sides(generators)
    return _facets(generators)


def _normals(faces: Faces, rows: Floats) -> Floats:
    """Return outward normals of facets, shape (f, d), with a longest entry of about one.

    They are cross products of two generators, or one generator turned clockwise, times a factor.
    """
    units = dd.in_units(rows)
    if rows.shape[1] == 1:
        normals = np.ones((len(faces.ahead), 1))
    elif rows.shape[1] == 2:
        normals = units[faces.along[:, 0]][:, ::-1] * [1.0, -1.0]
    else:
        normals = _cross_products(units, *faces.along.T.copy())
    # A normal along an axis has an entry of exactly one.
    normals /= np.abs(normals).max(axis=1)[:, None]
    return np.asarray(normals * faces.ahead[:, None])


def _corners(generators: Floats) -> tuple[Floats, Integers]:
    """Return the factors of generators of the plane at the corners of their zonogon, (2 m, m).

    The corners are counter-clockwise from the lowest corner; the side after corner i is parallel to
    generator i of the returned order, shape (m,), and so is the side after corner m + i. O(m^2).
    """
    is_up = (generators[:, 1] > 0.0) | ((generators[:, 1] == 0.0) & (generators[:, 0] > 0.0))
    up = np.where(is_up, 1.0, -1.0)
    order = np.argsort(np.arctan2(up * generators[:, 1], up * generators[:, 0]), kind="stable")
    # The sides before corner i have turned the factors of their generators.
    turned = np.tri(len(order), k=-1)
    signs = np.empty((len(order), len(order)))
    signs[:, order] = (2.0 * turned - 1.0) * up[order]
    return np.vstack([signs, -signs]), order


def _sides(generators: Floats) -> Faces:
    """Return the sides and corners of a zonotope of the plane."""
    signs, order = _corners(generators)
    count = len(order)
    # Along side i the factor of its own generator changes from -1 to 1, or back: 1 or -1.
    turns = 0.5 * (signs[np.arange(1, count + 1), order] - signs[np.arange(count), order])
    corners = np.arange(2 * count)
    # Corner i is between the sides i - 1 and i.
    sides = np.column_stack([corners - 1, corners]) % (2 * count)
    return Faces(
        np.tile(order, 2)[:, None],
        np.concatenate([turns, -turns]),
        signs,
        np.repeat(corners, 2),
        sides.reshape(-1),
    )


class _Part(NamedTuple):
    """Facets, one of each pair of opposite facets, and their vertices, facet by facet."""

    pairs: Integers
    """The pair of generators that spans each facet, as its number, shape (f,)."""
    sizes: Integers
    """The numbers of vertices of the facets, shape (f,)."""
    signs: Floats
    """The factors of the generators at the vertices, shape (sum of sizes, m)."""


def _facets(generators: Floats) -> Faces | None:
    """Return the faces of a zonotope in three dimensions, or None if rounding decides about them.

    O(m^3): each pair of generators spans the planes of two facets, on which others may lie too.
    """
    units = generators / np.linalg.norm(generators, axis=1)[:, None]
    first, second = np.triu_indices(len(units), 1)
    normals = _cross_products(units, first, second)
    heights = affine_image(units, normals, np.zeros(len(normals)))[0].T
    within = np.abs(heights) <= COPLANAR
    pairs = np.arange(len(normals))
    within[pairs, first] = True
    within[pairs, second] = True
    outside = np.where(within, 0.0, np.sign(heights))

    parts = [_parallelograms(within, outside, first, second)]
    others = np.flatnonzero(within.sum(axis=1) > 2)
    groups, group_of = np.unique(within[others], axis=0, return_inverse=True)
    for k, group in enumerate(groups):
        # Each pair of the generators in a plane must have found the same ones.
        same = others[group_of.reshape(-1) == k]
        members = np.flatnonzero(group)
        if 2 * len(same) != len(members) * (len(members) - 1):
            return None
        best = same[np.linalg.norm(normals[same], axis=1).argmax()]
        in_plane = _in_plane(units[members], normals[best])
        parts.append(_zonogon(best, members, in_plane, outside[best]))

    half = np.vstack([part.signs for part in parts])
    sizes = np.tile(np.concatenate([part.sizes for part in parts]), 2)
    used, vertex_of = _different(np.vstack([half, -half]))
    # A facet has as many edges as corners, and each is on two facets (Euler).
    if 2 * (len(used) + len(sizes) - 2) != sizes.sum():
        return None

    chosen = np.concatenate([part.pairs for part in parts])
    along = np.column_stack([first[chosen], second[chosen]])
    # The second half are the opposite facets, whose normals are turned.
    ahead = np.repeat([1.0, -1.0], len(chosen))
    facet_of = np.repeat(np.arange(len(sizes)), sizes)
    order = np.argsort(vertex_of, kind="stable")
    return Faces(np.vstack([along, along]), ahead, used, vertex_of[order], facet_of[order])


def _parallelograms(within: Flags, outside: Floats, first: Integers, second: Integers) -> _Part:
    """Return the facets that exactly two of the m generators span, one of each two opposite ones.

    `first` and `second`, shape (p,), are the generators of the p pairs. `within`, shape (p, m), is
    whether a generator is in the plane of a pair; `outside`, shape (p, m), are the factors of the
    others at the facet, 0 for those within. The four corners of a facet are in no order around it.
    """
    simple = np.flatnonzero(within.sum(axis=1) == 2)
    corners = np.repeat(outside[simple, None], 4, axis=1)
    ends = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])
    every = np.arange(len(simple))
    corners[every, :, first[simple]] = ends[:, 0]
    corners[every, :, second[simple]] = ends[:, 1]
    signs = corners.reshape(-1, outside.shape[1])
    return _Part(simple, np.full(len(simple), 4), signs)


def _zonogon(pair: int, members: Integers, in_plane: Floats, outside: Floats) -> _Part:
    """Return the facet of a pair that is parallel to more than two generators, the `members`.

    `in_plane`, shape (k, 2), are the members in the plane; `outside`, shape (m,), the factors of
    the other generators.
    """
    around, _ = _corners(in_plane)
    signs = np.repeat(outside[None], len(around), axis=0)
    signs[:, members] = around
    return _Part(np.array([pair]), np.array([len(around)]), signs)


def _in_plane(rows: Floats, normal: Floats) -> Floats:
    """Return coordinates, (k, 2), in the plane across a normal, counter-clockwise from its end."""
    one = rows[0] / np.linalg.norm(rows[0])
    two = np.cross(normal / np.linalg.norm(normal), one)
    return np.column_stack([rows @ one, rows @ two])


def _different(signs: Floats) -> tuple[Floats, Integers]:
    """Return the different rows of signs, and for each row the number of its equal."""
    # Eight bytes of bits are a word, and rows of words are sorted; the last word is filled by
    # zeros.
    words = np.packbits(signs > 0.0, axis=1)
    words = np.pad(words, ((0, 0), (0, -words.shape[1] % 8))).view(np.uint64)
    order = np.lexsort(words.T)
    is_new = np.ones(len(order), np.bool_)
    is_new[1:] = (words[order[1:]] != words[order[:-1]]).any(axis=1)
    number = np.empty(len(order), np.int64)
    number[order] = np.cumsum(is_new) - 1
    return signs[order[is_new]], number


@_kernels.compiled
def _cross_products(rows: Floats, first: Integers, second: Integers) -> Floats:
    """Return the cross products of pairs of rows, shape (p, 3).

    Each entry is exact to rounding of itself.
    """
    result = np.empty((len(first), 3))
    for k in range(len(first)):
        a = rows[first[k]]
        b = rows[second[k]]
        for i in range(3):
            j = (i + 1) % 3
            m = (i + 2) % 3
            one, one_low = two_product(a[j], b[m])
            two, two_low = two_product(a[m], b[j])
            total, low = two_sum(one, -two)
            result[k, i] = total + (low + (one_low - two_low))
    return result


def _of_faces(kind: Any, faces: Faces, span: Span, kept: Distinct) -> Any:
    """Return the polytope of faces in the own coordinates of a zonotope.

    The offset of a facet is the support function of all generators, rounded up, so that the facets
    contain the zonotope; vertices move to the outer sides of their facets.
    """
    rows = span.rows
    start = span.start[span.own]
    normals = _normals(faces, kept.rows)
    products, rounded = affine_image(rows, normals, np.zeros(len(normals)))
    levels, away = affine_image(start[None], normals, np.zeros(len(normals)))
    sums, lost = affine_image(
        np.ones((1, len(rows))), np.ascontiguousarray(np.abs(products).T), levels[0]
    )
    # `rounded` is the greatest rounding of a product for each normal, and there is one product for
    # each generator.
    unsure = lost + away + len(rows) * rounded
    offsets = np.where(unsure > 0.0, np.nextafter(sums[0] + unsure, np.inf), sums[0])
    facets = dd.in_units(np.column_stack([normals, offsets]))

    points, rounded = affine_image(faces.signs, np.ascontiguousarray(kept.rows.T), start)
    is_ahead = np.zeros(len(points), np.bool_)
    if rounded.any():
        points, is_ahead = _ahead(points, facets, faces)
    incidence = faces.incidence()
    if not is_ahead.all():
        most = ON + MAX_MOVE * kept.missed.max()
        points = push_out(points, facets, incidence, np.int64(0), False, most)
    return kind(
        points,
        facets,
        facets[:0],
        incidence,
        span.middle[span.own].copy(),
        span.scale[span.own].copy(),
    )


def _ahead(points: Floats, facets: Floats, faces: Faces) -> tuple[Floats, Flags]:
    """Return vertices, shape (v, d), moved at blunt corners, and whether each one was moved.

    They move along the mean normal of their facets, to the outer sides. `push_out` moves the
    others; at a blunt corner it would move a vertex farther than this.
    """
    vertex = faces.vertex
    facet = faces.facet
    # Where the pairs of each vertex begin: `vertex` is in ascending order.
    first = np.flatnonzero(np.diff(vertex, prepend=-1))
    lengths = np.linalg.norm(facets[:, :-1], axis=1)
    units = (facets[:, :-1] / lengths[:, None])[facet]
    ends = (facets[:, -1] / lengths)[facet]
    means = np.add.reduceat(units, first)
    means /= np.linalg.norm(means, axis=1)[:, None] + np.finfo(np.float64).tiny

    slopes = (units * means[vertex]).sum(axis=1)
    products = units * points[vertex]
    # A sum of n products, and six more roundings: of the lengths, the units, the ends and the move.
    rounding = (points.shape[1] + 6) * EPS * (np.abs(products).sum(axis=1) + np.abs(ends))
    gaps = ends - products.sum(axis=1) + rounding
    needs = np.maximum.reduceat(gaps / np.maximum(slopes, _BLUNT), first)
    is_blunt = np.minimum.reduceat(slopes, first) >= _BLUNT
    return points + (is_blunt * needs)[:, None] * means, is_blunt


def _sum_of_segments(kind: Any, centre: Floats, rows: Floats, scale: Floats) -> Any:
    """Return a zonotope as the sum of a parallelepiped and segments, one after the other.

    Its generators are `rows`, shape (p, n), in units of `scale`, shape (n,).
    """
    # Independent in these units: in others, a set thinner than SNAP would have no generator.
    _, basis = _independent(rows)
    generators = rows * scale
    cube = kind.from_box(-np.ones(len(basis)), np.ones(len(basis)))
    found = cube.affine_map(generators[basis].T, centre)
    for row in np.delete(generators, basis, axis=0):
        found = found.add_segment(row)
    return found


def _lifted(kind: Any, inner: PolytopeArrays, span: Span, centre: Floats) -> Any:
    """Return a flat zonotope in all coordinates, from the polytope of its own coordinates."""
    own = span.own
    others = span.others
    scale = span.scale[own]
    matrix = span.slopes * (inner.scale / scale)
    away = (inner.centre - centre[own]) / scale
    levels = affine_image(away[None], span.slopes, span.start[others])[0][0]

    space = len(centre)
    points = np.empty((len(inner.points), space))
    points[:, own] = inner.points
    points[:, others] = affine_image(inner.points, matrix, levels)[0]
    facets = np.zeros((len(inner.facets), space + 1))
    facets[:, [*own, space]] = inner.facets
    equations = np.eye(space, space + 1)[others]
    equations[:, own] = -matrix
    equations[:, -1] = levels
    middles = span.middle.copy()
    scales = span.scale.copy()
    middles[own] = inner.centre
    scales[own] = inner.scale
    return kind(points, facets, equations, inner.incidence, middles, scales)
