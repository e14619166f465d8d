"""Coordinates in which a set is about one wide along each axis, for sets in mixed units or far from the origin."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.optimize import linprog

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.polytope._affine_hull import (
    FLAT,
    HIGHS,
    ROUNDING,
    EmptyPolytopeError,
    UnboundedPolytopeError,
    UncertainHullError,
    chebyshev_ball,
    null_space_basis,
)
from infoset.geometry.polytope._qhull import Description, hull_of_points, intersection_of_halfspaces

MAX_RATIO = 100.0
"""Maximum ratio of widths along the axes, and of coordinates to widths, for which no local axes are needed."""
_MIN = 3e-12
"""A width along an axis that is less than this part of the width along another one may be rounding: the set is flat,
unless it is known to be solid."""
_MAX_PASSES = 5


@dataclass(frozen=True, eq=False)
class LocalAxes:
    """Coordinates u = (x - middle) / scale along the axes that are `wide`; along the other axes x is `middle`.

    All three arrays have the shape (n,). The scales are powers of two.
    """

    middle: Floats
    scale: Floats
    wide: Flags

    @classmethod
    def of_box(cls, lower: Floats, upper: Floats, solid: Floats | None = None) -> LocalAxes:
        """Return axes for a set with these bounds, in sets that have an interior and the widths `solid`, if known."""
        widths, sizes = np.abs(upper - lower), np.maximum(np.abs(lower), np.abs(upper))
        minimum = _MIN * (widths.max() if solid is None else solid)
        wide = (widths > 10.0 * ROUNDING * sizes) & (widths > minimum)
        return cls(0.5 * lower + 0.5 * upper, powers_of_two(np.where(wide, widths, 1.0)), wide)

    @classmethod
    def needed(
        cls, lower: Floats, upper: Floats, solid: Floats | None = None, around: Floats | None = None
    ) -> LocalAxes | None:
        """Return axes as `of_box`, or None if the coordinates of the set itself have similar sizes.

        `around` are widths of larger sets whose half-spaces bound this one.
        """
        axes = cls.of_box(lower, upper, solid)
        sizes = np.maximum(np.abs(lower), np.abs(upper))
        widths = np.where(axes.wide, axes.scale, 0.0 if around is None else around)
        widths = widths[widths > 0.0] if widths.any() else sizes[sizes > 0.0]
        if not len(widths) or max(widths.max(), sizes.max()) < MAX_RATIO * widths.min():
            return None
        return axes

    @property
    def rounding(self) -> float:
        """Rounding of coordinates of the set, relative to its widths."""
        return ROUNDING * float((np.abs(self.middle) / self.scale)[self.wide].max(initial=1.0))

    def inward(self, points: Floats) -> Floats:
        """Return points, shape (k, n), in these coordinates, shape (k, d)."""
        return np.asarray(((points - self.middle) / self.scale)[:, self.wide])

    def outward(self, points: Floats) -> Floats:
        """Return points in these coordinates, shape (k, d), in R^n."""
        return self.middle + self.spread(points)

    def spread(self, vectors: Floats) -> Floats:
        """Return differences of points in these coordinates, shape (k, d), in R^n."""
        result = np.zeros((len(vectors), len(self.middle)))
        result[:, self.wide] = vectors * self.scale[self.wide]
        return result

    def volume(self, steps: Floats) -> float:
        """Return the volume of the parallelepiped of columns in these coordinates, shape (d, k), in R^n."""
        return float(np.prod(np.abs(np.diag(_triangle(self.spread(steps.T).T)[0])))) if steps.size else 1.0

    def hull(self, points: Floats, flat: float) -> Description:
        """Return both representations of the convex hull of points in R^n."""
        return self.described(*hull_of_points(self.inward(points), max(flat, self.rounding))[:4])

    def intersection(
        self, normals: Floats, offsets: Floats, across: Floats, levels: Floats, widths: Floats
    ) -> Description:
        """Return both representations of {x: normals x <= offsets, across x = levels}, a bounded set.

        `widths`, shape (n,), are those of a larger set: along an axis that is not wide, 1e-9 of them is no distance.
        """
        sides = []
        for rows, ends, equal in ((normals, offsets, False), (across, levels, True)):
            inner, rest = rows[:, self.wide] * self.scale[self.wide], ends - rows @ self.middle
            units, terms = np.linalg.norm(inner, axis=1), np.abs(rows) @ np.abs(self.middle) + np.abs(ends)
            kept = units > ROUNDING * terms
            slack = ROUNDING * terms + FLAT * np.abs(rows) @ np.where(self.wide, 0.0, widths)
            if ((np.abs(rest) > slack) if equal else rest < -slack)[~kept].any():
                raise EmptyPolytopeError(self._relaxation(normals, offsets, across, levels))
            sides += [inner[kept] / units[kept, None], rest[kept] / units[kept]]
        half = np.ones(int(self.wide.sum()))
        if not len(half):
            return self.described(half[None], np.zeros((0, 0)), half, np.zeros((0, 0)))
        try:
            near = without_far(sides[0], sides[1], -half, half)
            return self.described(
                *intersection_of_halfspaces(*near, *sides[2:], bounded=True, rounding=self.rounding)[:4]
            )
        except EmptyPolytopeError:
            raise EmptyPolytopeError(self._relaxation(normals, offsets, across, levels)) from None

    def _relaxation(self, normals: Floats, offsets: Floats, across: Floats, levels: Floats) -> float:
        """Return the minimum relaxation of constraints that no point satisfies, their normals of unit length in R^n."""
        rows, limits = np.vstack([normals, across, -across]), np.concatenate([offsets, levels, -levels])
        limits, units = limits - rows @ self.middle, np.linalg.norm(rows * self.scale, axis=1)
        used = units > 0.0
        sizes = np.linalg.norm(rows[used], axis=1) / units[used]
        minimum = float(1.0 / sizes.max())
        inner = rows[used] * self.scale / units[used, None]
        with contextlib.suppress(UncertainHullError):
            return max(0.0, -minimum * chebyshev_ball(inner, limits[used] / units[used], sizes * minimum)[1])
        return 0.0

    def described(self, points: Floats, normals: Floats, _offsets: Floats, across: Floats) -> Description:
        """Return the set in R^n of vertices, facets and an affine hull in these coordinates."""
        basis = null_space_basis(across)
        steps, wanted, facets = self.spread(basis.T).T, normals @ basis, np.zeros((len(normals), len(self.middle)))
        for _ in range(2):  # the second pass corrects rounding
            columns, rows = _orthonormal(steps, wanted - facets @ steps)
            facets = facets + rows @ columns.T
        facets /= np.linalg.norm(facets, axis=1)[:, None]
        equations = np.zeros((len(across), len(self.middle)))
        equations[:, self.wide] = across / self.scale[self.wide]
        equations = np.vstack([_orthonormal(equations.T, across)[0].T, np.eye(len(self.middle))[~self.wide]])
        vertices = self.outward(points)
        # Offsets follow from the vertices, so that both agree.
        levels = equations @ self.outward(points.mean(axis=0)[None])[0]
        return vertices, facets, (vertices @ facets.T).max(axis=0), equations, levels


def _triangle(columns: Floats) -> tuple[Floats, Integers]:
    """Return the triangle and the order of columns of a QR factorization; the sizes of the rows may differ much."""
    order = np.argsort(-np.abs(columns).max(axis=1))
    triangle, pivots = qr(columns[order], mode="r", pivoting=True)
    return triangle[: columns.shape[1]], pivots


def _orthonormal(columns: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Return an orthonormal basis of the span of columns, shape (n, d), and linear functions for its coefficients.

    `rows`, shape (k, d), are such functions for the coefficients of the columns. Each row of the basis is exact to
    rounding of itself: the sizes of the rows may differ much.
    """
    if columns.shape[1]:
        for _ in range(2):  # the second pass corrects angles
            triangle, pivots = _triangle(columns)
            columns, rows = (solve_triangular(triangle.T, part[:, pivots].T, lower=True).T for part in (columns, rows))
    return columns, rows


def powers_of_two(sizes: Floats) -> Floats:
    """Return powers of two near positive sizes: scales that round nothing."""
    return np.asarray(np.exp2(np.rint(np.log2(sizes))))


def bounds_of_constraints(
    normals: Floats, offsets: Floats, across: Floats, levels: Floats, guess: Floats | None = None
) -> Floats | None:
    """Return bounds of {x: normals x <= offsets, across x = levels}, and scales to which they are exact, shape (3, n).

    None if they are not found.

    Linear programs (HiGHS), repeated in the coordinates of the bounds until these are about one wide. `guess` are
    perhaps inexact bounds.
    """
    rows, space = np.vstack([normals, across]), normals.shape[1]
    ends = np.abs(np.concatenate([offsets, levels]))[:, None]
    # The sizes of coordinates at which a row is tight, or of one unit if no row is tight away from zero.
    tight = (rows != 0.0) & (ends != 0.0)
    logarithms = np.log(np.where(tight, ends, 1.0)) - np.log(np.where(rows != 0.0, np.abs(rows), 1.0))
    tight = np.where(tight.any(axis=0), tight, rows != 0.0)
    scale = np.exp((logarithms * tight).sum(axis=0) / np.maximum(tight.sum(axis=0), 1))
    middle, bounds = np.zeros(space), _bounds_of_axes(normals, offsets) if guess is None else guess
    if np.isfinite(bounds).all() and (bounds[0] <= bounds[1]).all():
        bounds = np.array(tightened(normals, offsets, *bounds)) if guess is None else bounds
        axes = LocalAxes.of_box(bounds[0], bounds[1], np.zeros(space))
        middle, scale = np.where(axes.wide, axes.middle, middle), np.where(axes.wide, axes.scale, scale)
    known: Floats | None = None
    for _ in range(_MAX_PASSES):
        parts = []
        for part, limits in ((normals, offsets), (across, levels)):
            units = np.linalg.norm(part * scale, axis=1)
            units = np.where(units > 0.0, units, 1.0)
            parts += [part * scale / units[:, None], (limits - part @ middle) / units]
        equal = parts[2:] if len(across) else (None, None)
        inner = np.zeros((2, space))
        for side, axis in np.ndindex(2, space):
            cost = np.zeros(space)
            cost[axis] = 1.0 - 2.0 * side
            optimum = linprog(cost, *parts[:2], *equal, bounds=(None, None), method="highs", options=HIGHS)
            if optimum.status != 0:
                return known if known is None else np.vstack([known, scale])
            inner[side, axis] = cost[axis] * optimum.fun
        known, width = middle + scale * inner, inner[1] - inner[0]
        rounding = 10.0 * ROUNDING * np.abs(known).max(axis=0)
        width = np.where(scale * width > rounding, width, 0.0)
        if ((width > 1e-2) | (rounding >= 1e-6 * scale)).all():
            break
        middle = known.mean(axis=0)
        scale = scale * np.maximum(width, 1e-6)
    # Widths that may be rounding of the linear programs count as zero.
    return known if known is None else np.vstack([np.where(width > 1e-7, known, known.mean(axis=0)), scale])


def _bounds_of_axes(rows: Floats, limits: Floats) -> Floats:
    """Return the minimum and the maximum coordinates that the rows along the axes allow, shape (2, n)."""
    along = rows[np.count_nonzero(rows, axis=1) == 1]
    ends = limits[np.count_nonzero(rows, axis=1) == 1, None]
    ends = np.divide(ends, along, out=np.zeros_like(along), where=along != 0.0)
    lower = np.where(along < 0.0, ends, -np.inf).max(axis=0, initial=-np.inf)
    return np.array([lower, np.where(along > 0.0, ends, np.inf).min(axis=0, initial=np.inf)])


def tightened(rows: Floats, limits: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return bounds of {x: rows x <= limits, lower <= x <= upper}, from each row alone; not always the tightest."""
    minimum = np.minimum(rows * lower, rows * upper)
    ends = limits[:, None] - (minimum.sum(axis=1)[:, None] - minimum)
    ends = np.divide(ends, rows, out=np.zeros_like(rows), where=rows != 0.0)
    most = np.where(rows > 0.0, ends, np.inf).min(axis=0, initial=np.inf)
    return np.where(rows < 0.0, ends, -np.inf).max(axis=0, initial=-np.inf).clip(lower), most.clip(max=upper)


def without_far(rows: Floats, limits: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return half-spaces without those 1e3 times farther away than a box that contains the set; a larger box if any.

    Their offsets would hide the size of the set: it would count as flat.
    """
    if (lower > upper).any():
        return rows, limits
    size = float(np.maximum(np.abs(lower), np.abs(upper)).max())
    middle, half = 0.5 * lower + 0.5 * upper, upper - lower + 1e-3 * size
    near = limits - (rows @ middle + np.abs(rows) @ half) <= 1e3 * size * np.linalg.norm(rows, axis=1)
    if near.all():
        return rows, limits
    unit = np.eye(len(lower))
    return np.vstack([rows[near], unit, -unit]), np.concatenate([limits[near], middle + half, half - middle])


def described(
    rows: Floats, limits: Floats, across: Floats, levels: Floats, *, bounded: bool, box: Floats | None = None
) -> Description:
    """Return both representations as `intersection_of_halfspaces`, by `LocalAxes` if coordinates differ much.

    `box`, shape (3, n), are bounds of the set, for which local axes are not needed, and widths of larger sets.
    """
    result: Description | None = None
    failure: ValueError | ArithmeticError | None = None
    axes, bounds = None, box
    try:
        result = intersection_of_halfspaces(rows, limits, across, levels, bounded=bounded)
        lower, upper = result[0].min(axis=0), result[0].max(axis=0)
        bounds = np.array([lower, upper, upper - lower if box is None else box[2]])
        axes = LocalAxes.needed(lower, upper, upper - lower)
        flat = len(result[3]) and (axes is not None or len(result[0]) == 1 or _mixed(rows, limits, across))
    except (EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError) as error:
        failure, flat = error, True
    if flat and box is None:  # a flat set, or none at all, can be a mistake of coordinates that differ much
        better = bounds_of_constraints(rows, limits, across, levels, None if bounds is None else bounds[:2])
        bounds = bounds if better is None else better
    if flat and bounds is not None and not (box is not None and isinstance(failure, EmptyPolytopeError)):
        find = LocalAxes.of_box if result is None else LocalAxes.needed
        axes = find(bounds[0], bounds[1], bounds[1] - bounds[0])
    if axes is not None and bounds is not None:
        with contextlib.suppress(UncertainHullError):
            return axes.intersection(rows, limits, across, levels, bounds[2])
        if isinstance(failure, EmptyPolytopeError):
            failure = UncertainHullError(
                "the half-spaces have common points, but their sizes differ too much for a hull: scale the coordinates"
            )
    if result is None:
        assert failure is not None
        raise failure
    return result


def _mixed(rows: Floats, limits: Floats, across: Floats) -> bool:
    """Return whether the sizes of offsets or of columns differ much."""
    lengths = np.linalg.norm(rows, axis=1)
    sizes = np.abs(limits[(lengths > 0.0) & (limits != 0.0)] / lengths[(lengths > 0.0) & (limits != 0.0)])
    table = np.vstack([rows, across])
    columns = np.ones(1)
    if table.any(axis=0).all():
        columns = np.exp(np.mean(np.log(np.where(table != 0.0, np.abs(table), 1.0)), axis=0, where=table != 0.0))
    return bool(columns.max() >= 1e3 * columns.min() or (len(sizes) and sizes.max() >= MAX_RATIO * sizes.min()))
