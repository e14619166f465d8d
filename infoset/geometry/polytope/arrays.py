"""Construction and storage of polytopes."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Floats
from infoset.geometry._set_arguments import box_ends, constraint_values, finite_values, need_finite, radius_values
from infoset.geometry.polytope._affine_hull import FLAT, ROUNDING, EmptyPolytopeError
from infoset.geometry.polytope._qhull import hull_of_points, together
from infoset.geometry.polytope._scaling import LocalAxes, described
from infoset.limits import COUNT

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry


_TOGETHER = 1e-7


@dataclass(frozen=True, eq=False)
class PolytopeArrays:
    """Vertices, facets and affine hull of a polytope, shapes (v, n), (f, n), (f,), (e, n) and (e,); see `Polytope`."""

    vertices: Floats
    normals: Floats
    offsets: Floats
    across: Floats
    levels: Floats
    relaxation: float = 0.0

    @classmethod
    def from_vertices(cls, points: ArrayLike, flat: float = FLAT) -> Self:
        """Return the convex hull of `points`, shape (k, n), at least one.

        `flat` is the relative thickness below which a set counts as flat: greater for points that are known to fewer
        digits. The affine hull first, then Qhull in coordinates of it in which the set is round, then a check that
        facets and vertices agree. Qhull takes O(k log k) for n to 3, O(k^(n/2)) beyond at worst.

        Raises
        ------
        ValueError
            If there is no point.
        UncertainHullError
            If rounding decides which points are vertices.
        """
        array = finite_values("points", points, "k", "n")
        if not len(array):
            raise ValueError("points must have at least one row: Polytope.empty makes the empty set")
        return cls._hull(array, flat)

    @classmethod
    def _hull(cls, points: Floats, flat: float = FLAT, *, solid: bool = False) -> Self:
        """Return the convex hull of points, which is `solid` if it surely has an interior."""
        lower, upper = points.min(axis=0), points.max(axis=0)
        axes = LocalAxes.needed(lower, upper, upper - lower if solid else None)
        return cls(*(hull_of_points(points, flat) if axes is None else axes.hull(points, flat)))

    @classmethod
    def from_constraints(
        cls,
        normals: ArrayLike,
        offsets: ArrayLike,
        across: ArrayLike | None = None,
        levels: ArrayLike | None = None,
        *,
        bounded: bool = False,
    ) -> Self:
        """Return {x: normals x <= offsets, across x = levels}, of shapes (m, n), (m,), (k, n) and (k,); it may be
        empty.

        Infinite offsets are no limit. A set that is known to be `bounded` saves a linear program. Equations hidden in
        the half-spaces are found first, by linear programs (HiGHS); then Qhull intersects in the affine hull, around
        the Chebyshev centre. An UnboundedPolytopeError, which holds a direction, is raised if the set is unbounded,
        and an UncertainHullError if rounding decides which points are vertices.
        """
        rows, limits = constraint_values(("normals", "offsets"), normals, offsets, "k", "n")
        space = rows.shape[1]
        flat, heights = constraint_values(
            ("across", "levels"), [] if across is None else across, [] if levels is None else levels, "k", space
        )
        need_finite("levels", heights)
        if np.isneginf(limits).any():
            return cls.empty(space)
        limited = limits < np.inf
        try:
            return cls(*described(rows[limited], limits[limited], flat, heights, bounded=bounded))
        except EmptyPolytopeError as error:
            return cls.empty(space, error.relaxation)

    @classmethod
    def empty(cls, space: int, relaxation: float = 0.0) -> Self:
        """Return the empty set of R^n, n = `space`, with the `relaxation` of its constraints if it is known."""
        COUNT.need("space", space)
        return cls(
            np.zeros((0, space)), np.zeros((1, space)), -np.ones(1), np.zeros((0, space)), np.zeros(0), relaxation
        )

    @classmethod
    def from_box(cls, lower: ArrayLike, upper: ArrayLike) -> Self:
        """Return {x: lower <= x <= upper} for bounds of shape (n,); flat along axes whose bounds are equal. Exact."""
        minimum, most = box_ends(lower, upper, "n")
        unit, wide = np.eye(len(minimum)), minimum < most
        corners = list(itertools.product(*(dict.fromkeys(pair) for pair in zip(minimum, most, strict=True))))
        return cls(
            np.array(corners),
            np.vstack([unit[wide], -unit[wide]]),
            np.concatenate([most[wide], -minimum[wide]]),
            unit[~wide],
            most[~wide],
        )

    @classmethod
    def from_ball(cls, centre: ArrayLike, radius: float, *, outer: bool = True) -> Self:
        """Return a polytope around the ball with `centre`, shape (n,), and `radius`, or in it.

        Its facets, or its vertices if not `outer`, are in the 3^n - 1 directions whose components are in ratios of -1,
        0 and 1; it has 2^n n! vertices, or facets. It extends beyond the ball, or stays inside it, by the factor 1.09
        in two dimensions, 1.13 in three and 1.21 in six at most.
        """
        middle, size = finite_values("centre", centre, "n"), float(radius_values(radius))
        space = len(middle)
        rows = np.array([row for row in itertools.product((-1.0, 0.0, 1.0), repeat=space) if any(row)])
        rows /= np.linalg.norm(rows, axis=1)[:, None]
        # The hyperplane through (1, 0, ..), (1, 1, 0, ..) / sqrt(2), .. is one side; symmetry gives the others.
        side = np.diff(np.sqrt(np.arange(space + 1)))
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=space)))
        sides = (np.array(list(itertools.permutations(side)))[:, None] * signs).reshape(-1, space)
        if size <= ROUNDING * np.abs(middle).max():
            return cls.from_vertices(middle + size * (sides if outer else rows))
        flat = np.zeros((0, space))
        if outer:
            return cls(middle + size * sides, rows, size + rows @ middle, flat, flat[:, 0])
        length = float(np.linalg.norm(side))
        normals = sides / length
        return cls(middle + size * rows, normals, size / length + normals @ middle, flat, flat[:, 0])

    @classmethod
    def from_zonotope(cls, centre: ArrayLike, generators: ArrayLike) -> Self:
        """Return {centre + sum of z_i generators[i]: -1 <= z_i <= 1}; `generators`, shape (g, n), has a row for each.

        One Minkowski sum for each generator: O(g^(n-1)) vertices.
        """
        middle = finite_values("centre", centre, "n")
        rows = finite_values("generators", generators, "g", len(middle))
        widths = np.abs(rows).sum(axis=0)
        axes = LocalAxes.needed(middle - widths, middle + widths, widths)
        if axes is not None and axes.wide.any():
            inner = cls.from_zonotope(np.zeros(int(axes.wide.sum())), (rows / axes.scale)[:, axes.wide])
            return cls(*axes.described(inner.vertices, inner.normals, inner.offsets, inner.across))
        zonotope = cls.from_vertices(middle[None, :])
        for row in rows:
            zonotope = cls.from_vertices(np.vstack([zonotope.vertices - row, zonotope.vertices + row]))
        return zonotope

    @classmethod
    def from_shapely(cls, geometry: BaseGeometry) -> Self:
        """Return a convex shapely Point, LineString or Polygon as a set of R^2; see `ConvexPolygons.from_shapely`."""
        from infoset.geometry.polygon_arrays import PolygonArrays

        vertices = PolygonArrays.from_shapely(geometry).polygon()
        return cls.from_vertices(vertices) if len(vertices) else cls.empty(2)

    def to_shapely(self) -> BaseGeometry:
        """Return a set of R^2 as a shapely Point, LineString or Polygon; the empty set is an empty Polygon."""
        from infoset.geometry.polygon_arrays import PolygonArrays

        return PolygonArrays.from_points(self._of_plane().vertices).to_shapely()

    @property
    def space(self) -> int:
        """Dimension n of the space."""
        return int(self.vertices.shape[1])

    @property
    def dimension(self) -> int:
        """Dimension of the affine hull; -1 for the empty set."""
        return int(self.space - len(self.across)) if len(self.vertices) else -1

    @property
    def is_empty(self) -> bool:
        """Whether the set is empty."""
        return not len(self.vertices)

    def needed(self) -> Self:
        """Return the set itself.

        Raises
        ------
        EmptyPolytopeError
            If it is empty; the error has the minimum relaxation of the constraints.
        """
        if self.is_empty:
            raise EmptyPolytopeError(self.relaxation)
        return self

    def __repr__(self) -> str:
        if self.is_empty:
            return f"<empty polytope in R^{self.space}>"
        return (
            f"<polytope of dimension {self.dimension} in R^{self.space}: "
            f"{len(self.vertices)} vertices, {len(self.normals)} facets>"
        )

    def essential_vertices(self) -> int:
        """Return the number of vertices; those within 1e-7 of each other in every coordinate count once."""
        return int(together(self.vertices, _TOGETHER).max()) + 1

    def _of_plane(self) -> Self:
        """Return the set; it must be in the plane."""
        if self.space != 2:
            raise ValueError(f"a set of R^2 is needed: project this one, of R^{self.space}, on two axes first")
        return self
