"""Zonotopes: boxes, disturbances, initial sets of observers, and sets kept as generators."""

from __future__ import annotations

from functools import cached_property
from itertools import chain, combinations, islice
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats
from infoset.geometry._set_arguments import (
    axis_numbers,
    bound_values,
    finite_values,
    not_negative,
    offset_values,
)
from infoset.geometry.convex_set import ConvexSet
from infoset.geometry.double_words import affine_image
from infoset.geometry.polytope import EmptyPolytopeError, Polytope
from infoset.geometry.polytope._measures import triangle_of
from infoset.geometry.polytope.generators import Span, exact_determinant
from infoset.geometry.tolerances import EPS, SNAP
from infoset.geometry.zonotope_arrays import ZonotopeArrays, box_generators
from infoset.geometry.zonotope_membership import are_inside
from infoset.geometry.zonotope_outer import corrected_by_strips, fewer_generators
from infoset.limits import Limits, real_values

_MAX_SUBSETS = 1_000_000
"""Maximum number of determinants of which `volume` is the sum: they take about a second."""
_SUBSETS_AT_ONCE = 20_000
"""Number of determinants that are computed together: they take a few MB."""


class Zonotope(ZonotopeArrays, ConvexSet):
    """The set of centre + t_1 g_1 + ... + t_m g_m with all -1 <= t_i <= 1.

    Sums and maps take O(m n) steps in any dimension, where a `Polytope` has O(m^(n - 1)) facets. A
    zonotope is also an argument of `LinearObserver`. It may be flat, a segment or a point, and is
    never empty.

    Parameters
    ----------
    centre : array_like, shape (n,)
        Point of symmetry.
    generators : array_like, shape (m, n)
        One generator g_i a row; none for a point.

    Raises
    ------
    ValueError
        If the shapes do not agree, or a number is not finite.

    Notes
    -----
    Operations return new objects and have the same names as the operations of `Polytope`. Sums,
    maps, projections and multiples of zonotopes are zonotopes, whose centre and generators are
    rounded once, to nearest. `reduce_outward`, `cut` and `bounding_box` are rounded outward: they
    contain the set of the stored numbers, or its part. Intersection, hull, difference, `margin`,
    `is_subset` and `equals` are computed by `polytope()`, which is rounded outward too, and may
    take long in more than three dimensions; the other set is then a zonotope or a polytope.

    Operators: `Z + Y` (Minkowski sum), `Z + vector` (translation), `A @ Z` (linear map), `2 * Z`,
    `-Z`, `point in Z`, `Z & Y` (a `Polytope`), `Z <= Y` (subset, to rounding). `Z == Y` compares
    objects; `equals` compares sets.
    """

    # Sets
    # ----------------------------------------------------------------------------------------------

    def affine_map(self, matrix: ArrayLike, offset: ArrayLike = 0.0) -> Zonotope:
        """Return {matrix x + offset}.

        The matrix has the shape (k, n), singular or not, and the offset the shape (k,), or is 0.

        O(m n k); centre and generators are rounded once.
        """
        # Copies are contiguous and writeable: kernels are compiled once, for such arrays.
        rows = finite_values("matrix", matrix, "m", self.space).copy()
        moved = offset_values(offset, len(rows)).copy()
        centre, _ = affine_image(self.centre[None].copy(), rows, moved)
        generators, _ = affine_image(self.generators.copy(), rows, np.zeros(len(rows)))
        return Zonotope(centre[0], generators)

    def minkowski_sum(self, other: ConvexSet) -> Any:
        """Return {x + y: x in the set, y in the other}.

        The sum of two zonotopes is the zonotope with all generators of both, O(m n).

        With a set of another class it is a `Polytope`, by `polytope()`.

        Raises
        ------
        ValueError
            If the other set is in another space.
        """
        if not isinstance(other, Zonotope):
            return self.polytope().minkowski_sum(other)
        if other.space != self.space:
            raise ValueError(f"other must be a set in R^{self.space}, as this one: got {other!r}")
        return Zonotope(self.centre + other.centre, np.vstack([self.generators, other.generators]))

    def add_segment(self, half: ArrayLike) -> Zonotope:
        """Return the sum with the segment from -half to +half, shape (n,). Exact.

        The result has one more generator.
        """
        along = finite_values("half", half, self.space)
        if not along.any():
            return self
        return Zonotope(self.centre, np.vstack([self.generators, along]))

    def enlarged(self, by: ArrayLike) -> Zonotope:
        """Return {x + e: |e_i| <= by_i}, with `by` of the shape (n,): up to n more generators.
        Exact.
        """
        margin = finite_values("by", by, self.space)
        not_negative("by", float(margin.min()))
        if not margin.any():
            return self
        return Zonotope(self.centre, np.vstack([self.generators, box_generators(margin)]))

    def project(self, axes: ArrayLike) -> Zonotope:
        """Return the projection on `axes`, an integer or a sequence of integers.

        It is a set of as many dimensions. Exact; generators that become zero go.
        """
        numbers = axis_numbers(axes, self.space, self.space)
        rows = self.generators[:, numbers]
        return Zonotope(self.centre[numbers], rows[rows.any(axis=1)])

    def reduce_outward(self, order: float) -> Zonotope:
        """Return a zonotope with at most `order` n generators (`order` >= 1) that contains the set.

        The generators with the greatest |g|_1 - |g|_inf, in units of the widths of the set, stay.
        The others become a box around their sum: also long ones along an axis, which a box has
        exactly. O(m n).

        References
        ----------
        A. Girard, Reachability of uncertain linear systems using zonotopes, in HSCC (2005).
        """
        Limits(minimum=1.0).need("order", order)
        # `fewer_generators` also returns few generators unchanged: here the set itself is returned.
        if len(self.generators) <= order * self.space:
            return self
        return Zonotope(self.centre, fewer_generators(self.generators, int(order * self.space)))

    def cut(
        self,
        normals: ArrayLike,
        lower: ArrayLike = -np.inf,
        upper: ArrayLike = np.inf,
        *,
        slack_ulp: float = 0.0,
    ) -> Zonotope:
        """Return a zonotope that contains the part in strips lower <= normals x <= upper.

        The exact part, which is not a zonotope, is `polytope().cut`. The result need not be inside
        the strips, nor inside this set: of all linear corrections by the strips it has the smallest
        sum of squares of the generators. It is this set if the strips contain it.

        `normals`, shape (n,) or (k, n), have any length. The bounds have the shape () or (k,);
        infinite ones give half-spaces. Each strip is wider on both sides by `slack_ulp` ulp of the
        products in normals x. Each strip adds one generator, and rounding up to n: `reduce_outward`
        removes generators. O((m + n) n k + k^3) for k strips.

        Raises
        ------
        EmptyPolytopeError
            If a strip is empty or certainly misses the set. If only several strips together miss
            it, the error is not raised.

        Notes
        -----
        x = c + G t and y = C x + v with |v| <= V give x in c + K (y - C c) + (I - K C) G [-1, 1]^m
        + K diag(V) [-1, 1]^k for every matrix K; K = P C' (C P C' + diag V^2)^-1 with P = G G' has
        the smallest sum of squares.

        References
        ----------
        T. Alamo, J. M. Bravo and E. F. Camacho, Guaranteed state estimation by zonotopes,
        Automatica 41 (2005). C. Combastel, Zonotopes and Kalman observers, Automatica 55 (2015).
        """
        rows = real_values("normals", normals)
        shape = ("m", self.space) if rows.ndim > 1 else (self.space,)
        rows = np.atleast_2d(finite_values("normals", rows, *shape))
        minimum = bound_values("lower", lower, (), (len(rows),))
        maximum = bound_values("upper", upper, (), (len(rows),))

        # Ends of the set along the normals, rounded outward; no bound is farther out.
        terms = np.abs(rows) @ (np.abs(self.centre) + np.abs(self.generators).sum(axis=0))
        wider = not_negative("slack_ulp", slack_ulp) * EPS * terms
        rounding = self._operations * EPS * terms
        middles = rows @ self.centre
        reach = np.abs(rows @ self.generators.T).sum(axis=1) + rounding
        low = np.maximum(minimum - wider, middles - reach)
        high = np.minimum(maximum + wider, middles + reach)
        if (low > high).any():
            worst = int(np.argmax(low - high))
            least = np.broadcast_to(minimum, len(rows))[worst]
            greatest = np.broadcast_to(maximum, len(rows))[worst]
            raise EmptyPolytopeError(
                f"no point of the zonotope is in strip {worst}, from {least:g} to {greatest:g}"
            )

        # Strips that leave both ends of the set inside add no generator.
        is_cut = (low > middles - reach) | (high < middles + reach)
        if not is_cut.any():
            return self
        outer = corrected_by_strips(
            self.centre, self.generators, rows[is_cut], low[is_cut], high[is_cut]
        )
        return Zonotope(outer.centre, outer.generators)

    @property
    def _operations(self) -> int:
        """Maximum number of roundings of a sum over generators of scalar products.

        They are m + n, and eight more for the centre, a bound and the rounding itself.
        """
        return sum(self.generators.shape) + 8

    def polytope(self) -> Polytope:
        """Return the set as a `Polytope`, by `Polytope.from_zonotope`; it is computed once."""
        return self._polytope

    @cached_property
    def _polytope(self) -> Polytope:
        return Polytope.from_zonotope(self)

    @cached_property
    def _span(self) -> Span:
        """Scaled coordinates and the affine hull."""
        return Span(self.centre, self.generators)

    @cached_property
    def _in_own(self) -> Zonotope:
        """The projection on the coordinates that are independent in the set."""
        return self if self.dimension == self.space else self.project(self._span.own)

    def intersection(self, *others: ConvexSet) -> Polytope:
        """Return the intersection with one or more sets, by `polytope()`."""
        return self.polytope().intersection(*others)

    def convex_hull(self, *others: ConvexSet) -> Polytope:
        """Return the convex hull of the union with one or more sets, by `polytope()`."""
        return self.polytope().convex_hull(*others)

    def minkowski_difference(self, other: ConvexSet) -> Polytope:
        """Return {x: x + y in the set for all y in the other}, by `polytope()`.

        This is the Pontryagin difference.
        """
        return self.polytope().minkowski_difference(other)

    # Measures
    # ----------------------------------------------------------------------------------------------

    @property
    def dimension(self) -> int:
        """Dimension of the affine hull."""
        return len(self._span.own)

    @property
    def is_empty(self) -> bool:
        """Whether the set is empty: never."""
        return False

    @property
    def vertices(self) -> Floats:
        """Vertices, shape (v, n), by `polytope()`."""
        return self.polytope().vertices

    def support_function(self, directions: ArrayLike) -> Floats:
        """Return max direction . x, shape (...), for `directions`, shape (..., n). O(m n)."""
        rows = finite_values("directions", directions, "...", self.space)
        return np.asarray(rows @ self.centre + np.abs(rows @ self.generators.T).sum(axis=-1))

    def support_vector(self, direction: ArrayLike) -> Floats:
        """Return a vertex farthest along a `direction`, both of shape (n,). O(m n)."""
        row = finite_values("direction", direction, self.space)
        heights = self.generators @ row
        # A generator across the direction has the sign of its first coordinate that is not zero, so
        # that the point is a vertex.
        first = (self.generators != 0.0).argmax(axis=1)
        leading = np.take_along_axis(self.generators, first[:, None], axis=1)[:, 0]
        # A generator of zeros has the sign 0: it moves nothing.
        signs = np.sign(np.where(heights != 0.0, heights, leading))
        return np.asarray(self.centre + signs @ self.generators)

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum coordinates, each (n,), rounded outward. O(m n)."""
        ones = np.ones((1, len(self.generators)))
        rows = np.ascontiguousarray(np.abs(self.generators).T)
        lower, below = affine_image(ones, -rows, self.centre.copy())
        upper, above = affine_image(ones, rows, self.centre.copy())
        return (
            np.where(below > 0.0, np.nextafter(lower[0], -np.inf), lower[0]),
            np.where(above > 0.0, np.nextafter(upper[0], np.inf), upper[0]),
        )

    def margin(self, points: ArrayLike) -> Floats:
        """Return the minimum distance of `points`, shape (..., n), from the facets.

        It is `Polytope.margin` of `polytope()`. `contains` needs no facets.
        """
        return self.polytope().margin(points)

    def contains(self, points: ArrayLike, tolerance: float = 0.0) -> Flags:
        """Return whether `points`, shape (..., n), are in the set, to rounding.

        With a `tolerance`, they may be outside by so much on each axis.

        In the plane the sides decide. In more dimensions, a point that is not decided by the
        bounding box or by coefficients of least squares needs a linear program (HiGHS, about 2 ms).
        The program only proposes coefficients, or a plane between the point and the set; a point is
        outside if the plane holds to rounding. The facets are not needed.
        """
        x = finite_values("points", points, "...", self.space)
        if not_negative("tolerance", tolerance):
            return self.enlarged(np.full(self.space, float(tolerance))).contains(x)

        span = self._span
        listed = x.reshape(-1, self.space)
        away = (listed - self.centre) / span.scale
        terms = np.abs(listed) + np.abs(self.centre) + np.abs(self.generators).sum(axis=0)
        rounding = self._operations * EPS * terms / span.scale

        # Points in the affine hull of a flat set, or as near to it as points of the set may be.
        inner = away[:, span.own]
        missing = np.abs(away[:, span.others] - inner @ span.slopes.T)
        allowed = rounding[:, span.others] + rounding[:, span.own] @ np.abs(span.slopes).T + SNAP
        found = (missing <= allowed).all(axis=1)

        if self.dimension > 2:
            # Coordinates in which no set is thin, for the program.
            back = np.linalg.inv(span.base)
            unsure = rounding[found][:, span.own] @ np.abs(back)
            found[found] = are_inside(inner[found] @ back, span.coefficients, span.basis, unsure)
        elif self.dimension > 0:
            found[found] = self._in_own.polytope().contains(listed[found][:, span.own])
        return np.asarray(found.reshape(x.shape[:-1]))

    def is_subset(self, other: ConvexSet, tolerance: float = 0.0) -> bool:
        """Return whether all vertices are in the other set, to rounding.

        With a `tolerance`, they may be within this distance of its facets.
        """
        return self.polytope().is_subset(other, tolerance)

    def volume(self) -> float:
        """Return the volume within the affine hull, of its dimension d; 1 for a point.

        It is 2^d times the sum of the determinants, without signs, of all d generators out of m. If
        these are more than 1e6, it is the volume of the polytope.
        """
        span = self._span
        space = self.dimension
        if not space:
            return 1.0
        if comb(len(self.generators), space) > _MAX_SUBSETS:
            return self.polytope().volume()

        # In coordinates along the basis a determinant is exact to rounding of the volume, also of a
        # thin set.
        total = 0.0
        subsets = combinations(range(len(self.generators)), space)
        while chosen := list(islice(subsets, _SUBSETS_AT_ONCE)):
            numbers = np.fromiter(chain.from_iterable(chosen), np.int64).reshape(-1, space)
            total += float(np.abs(np.linalg.det(span.coefficients[numbers])).sum())
        # The volume, within the affine hull, that steps of one in the own scaled coordinates span.
        stretch = np.prod(np.abs(np.diag(triangle_of(span.steps)[0])))
        return float(2.0**space * total * exact_determinant(span.base) * stretch)

    def area(self) -> float:
        """Return the area of a set of R^2; 0 for a segment or a point.

        A ValueError is raised in other spaces; `volume` is for any space.
        """
        return self.polytope().area()

    def centroid(self) -> Floats:
        """Return the centroid, shape (n,): the centre."""
        return self.centre.copy()

    def plot(self, ax: Any = None, **style: Any) -> list[Any]:
        """Draw a set of R^2 or R^3 on matplotlib axes, and return the artists.

        It is `Polytope.plot` of `polytope()`.
        """
        return self.polytope().plot(ax, **style)

    def __and__(self, other: Any) -> Any:
        return self.intersection(other) if isinstance(other, ConvexSet) else NotImplemented
