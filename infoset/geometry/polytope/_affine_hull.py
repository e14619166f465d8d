"""Affine hulls of points and of sets of half-spaces and equations, and the centre of a largest ball inside."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog

from infoset.arrays import Floats, Integers

FLAT = 1e-9
"""Relative thickness below which a set is flat."""
ROUNDING = 1e-13
"""Rounding of zero, relative to the size of the coordinates."""
HIGHS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


class EmptyPolytopeError(ValueError):
    """No point satisfies the constraints.

    `relaxation` is the minimum relaxation of every constraint, its normal of unit length, with which a point satisfies
    all; 0 if it is not known.
    """

    def __init__(self, relaxation: float) -> None:
        remedy = f"; it is not if its constraints are relaxed by {relaxation:.3g}" if relaxation else ""
        super().__init__(f"the polytope is empty{remedy}")
        self.relaxation = relaxation


class UnboundedPolytopeError(ValueError):
    """The constraints do not bound a set; `direction`, shape (n,), of unit length, is one in which it is unbounded."""

    def __init__(self, direction: Floats) -> None:
        shown = ", ".join(f"{component:.3g}" for component in direction)
        super().__init__(f"the polytope is unbounded along ({shown})")
        self.direction = direction


class UncertainHullError(ArithmeticError):
    """Facets and vertices do not agree because of rounding."""


@dataclass(frozen=True)
class Frame:
    """Coordinates y = (x - centre) basis / extents of an affine subspace of dimension d in R^n.

    `centre` is the mean of the points, `basis`, shape (n, d), has orthonormal columns, and `extents`, shape (d,), are
    the maximum distances of a point from the centre along them. `across`, shape (n, n - d), completes the basis.
    """

    centre: Floats
    basis: Floats
    extents: Floats
    across: Floats

    @property
    def dimension(self) -> int:
        """Dimension d of the subspace."""
        return int(self.basis.shape[1])

    def inward(self, points: Floats) -> Floats:
        """Return points, shape (k, n), in coordinates of the frame, shape (k, d)."""
        return np.asarray((points - self.centre) @ self.basis / self.extents)

    def outward(self, inner: Floats) -> Floats:
        """Return points in coordinates of the frame, shape (k, d), in R^n."""
        return np.asarray(self.centre + (inner * self.extents) @ self.basis.T)

    def rows_outward(self, normals: Floats, offsets: Floats) -> tuple[Floats, Floats]:
        """Return half-spaces of the frame, normals (m, d) and offsets (m,), in R^n with normals of unit length."""
        turned = (normals / self.extents) @ self.basis.T
        lengths = np.linalg.norm(turned, axis=1)
        return turned / lengths[:, None], (offsets + (normals / self.extents) @ (self.basis.T @ self.centre)) / lengths


def frame_of(points: Floats, flat: float = FLAT) -> Frame:
    """Return the frame of the affine hull of points, shape (k, n), at least one.

    A singular-value decomposition, O(k n^2). A direction counts where the points are wider along it than `flat` times
    their maximum width, and wider than the rounding of their coordinates.
    """
    varies = (points != points[0]).any(axis=0)
    if not varies.all():  # the other coordinates are exact, without the rounding errors of those that vary
        inner, axes, centre = frame_of(points[:, varies], flat), np.eye(len(varies)), points[0].copy()
        centre[varies] = inner.centre
        across = np.hstack([axes[:, varies] @ inner.across, axes[:, ~varies]])
        return Frame(centre, axes[:, varies] @ inner.basis, inner.extents, across)
    centre = points.mean(axis=0)
    centred = points - centre
    # With fewer points than coordinates all right singular vectors are needed, and the left ones are few.
    directions = np.linalg.svd(centred, full_matrices=len(points) < points.shape[1])[2]
    extents = np.abs(centred @ directions.T).max(axis=0)
    minimum = max(flat * float(extents.max(initial=0.0)), ROUNDING * float(np.abs(points).max(initial=0.0)))
    wide = extents > minimum
    return Frame(centre, directions[wide].T, extents[wide], directions[~wide].T)


@dataclass(frozen=True, eq=False)
class RelativeInterior:
    """The set {point + basis z: rows z <= limits}, with the centre and radius of a largest ball inside.

    `point`, shape (n,), is the origin of the coordinates z, `basis`, shape (n, d), has orthonormal columns, and `rows`,
    shape (k, d), have unit length. `kept`, shape (k,), is the index of each row's half-space; the others are always
    tight, or do not depend on z. `centre`, shape (d,), is the Chebyshev centre.
    """

    point: Floats
    basis: Floats
    rows: Floats
    limits: Floats
    kept: Integers
    centre: Floats
    radius: float

    @property
    def dimension(self) -> int:
        """Dimension d of the affine hull."""
        return int(self.basis.shape[1])


def relative_interior(
    normals: Floats,
    offsets: Floats,
    across: Floats,
    levels: Floats,
    *,
    bounded: bool = False,
    member: Floats | None = None,
    rounding: float = 0.0,
) -> RelativeInterior:
    """Return the affine hull of {x: normals x <= offsets, across x = levels}, of shapes (m, n), (m,), (e, n) and (e,).

    A set that is known to be `bounded` saves a linear program. `member`, shape (n,), is a point that is known to be in
    the set: the rows are relaxed by its rounding. `rounding` is an error of all offsets. If the radius of a largest
    ball is zero, some half-spaces imply equations; linear programs (HiGHS) find the rows that are always tight. A set
    is flat in a direction in which it is thinner than 1e-9 of its width.

    Raises
    ------
    EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError
        If no point satisfies all rows, the set is unbounded, or a linear program was not solved.
    """
    try:
        return _relative_interior(normals, offsets, across, levels, bounded=bounded, member=member, rounding=rounding)
    except EmptyPolytopeError as error:
        if not len(across):
            raise
        rows, limits = np.vstack([normals, across, -across]), np.concatenate([offsets, levels, -levels])
        relaxation = min_relaxation(rows, limits) or error.relaxation
    raise EmptyPolytopeError(relaxation)


def _relative_interior(
    normals: Floats,
    offsets: Floats,
    across: Floats,
    levels: Floats,
    *,
    bounded: bool,
    member: Floats | None,
    rounding: float,
) -> RelativeInterior:
    lengths = np.linalg.norm(normals, axis=1)
    long = lengths > ROUNDING * float(lengths.max(initial=0.0))
    if member is not None:
        offsets = np.maximum(offsets, normals @ member)
    # A row whose length is rounding has no direction.
    void = np.flatnonzero(~long & (offsets < -ROUNDING * float(np.abs(offsets).max(initial=0.0))))
    if len(void):
        raise EmptyPolytopeError(float(-offsets[void].min()))
    used = np.flatnonzero(long)
    normals, offsets = normals[used] / lengths[used, None], offsets[used] / lengths[used]
    size = max(
        float(np.abs(offsets).max(initial=0.0)), 0.0 if member is None else float(np.abs(member).max(initial=0.0))
    )
    for _ in range(len(normals) + 1):
        point, basis = solutions(across, levels)
        slack = FLAT * max(1.0, float(np.abs(point).max(initial=0.0)))
        rows, limits = normals @ basis, offsets - normals @ point
        lengths = np.linalg.norm(rows, axis=1)
        kept = np.flatnonzero(lengths > FLAT)
        worst = float(np.delete(limits, kept).min(initial=np.inf))
        if worst < -slack:
            raise EmptyPolytopeError(-worst)
        if not basis.shape[1]:
            return RelativeInterior(point, basis, rows[:0], limits[:0], used[:0], np.zeros(0), 0.0)
        rows, limits = rows[kept] / lengths[kept, None], limits[kept] / lengths[kept]
        if not bounded:
            _need_bounded(rows, limits, slack, basis)
        centre, radius = chebyshev_ball(rows, limits)
        width = max(float(np.abs(limits - rows @ centre).max()), float(np.abs(centre).max()))
        flat = max(FLAT * width, ROUNDING * size, rounding, 1e-300)
        if radius < -flat:
            raise EmptyPolytopeError(-radius)
        tight = np.zeros(0, dtype=np.int64) if radius > flat else _always_tight(rows, limits, flat)
        if not len(tight):
            return RelativeInterior(point, basis, rows, limits, used[kept], centre, radius)
        turned = rows[tight] @ basis.T
        across = np.vstack([across, turned])
        levels = np.concatenate([levels, limits[tight] + turned @ point]) if member is None else across @ member
    raise UncertainHullError("the affine hull was not found")  # pragma: no cover - each pass lowers the dimension


def chebyshev_ball(rows: Floats, limits: Floats, sizes: Floats | float = 1.0) -> tuple[Floats, float]:
    """Return the centre, shape (d,), and radius of a largest ball in {z: rows z <= limits}, rows of unit length.

    `sizes` are the lengths of the rows in the coordinates in which the ball is round, if these are others. The radius
    is negative if the set is empty; its absolute value is the minimum relaxation of the rows that has a point. An
    UncertainHullError is raised if the linear program (HiGHS) was not solved, for example because the set has balls of
    any size.
    """
    size = rows.shape[1]
    matrix = np.column_stack([rows, np.broadcast_to(sizes, len(rows))])
    cost = np.zeros(size + 1)
    cost[-1] = -1.0
    optimum = linprog(cost, A_ub=matrix, b_ub=limits, bounds=(None, None), method="highs", options=HIGHS)
    if optimum.status != 0:
        raise UncertainHullError("the linear program of a largest ball inside was not solved: is the set unbounded?")
    return optimum.x[:-1], float(optimum.x[-1])


def min_relaxation(rows: Floats, limits: Floats) -> float:
    """Return the minimum relaxation of half-spaces, rows of unit length, that has a point; 0 if it is not known.

    One linear program (HiGHS).
    """
    lengths = np.linalg.norm(rows, axis=1)
    used = lengths > 0.0
    rows, limits = rows[used] / lengths[used, None], limits[used] / lengths[used]
    size = float(np.abs(limits).max(initial=0.0))
    if math.isinf(size):
        return 0.0
    try:
        return max(0.0, -size * chebyshev_ball(rows, limits / max(size, 1e-300))[1])
    except UncertainHullError:
        return 0.0


def solutions(across: Floats, levels: Floats) -> tuple[Floats, Floats]:
    """Return the solution of minimum norm of equations, which may be dependent, and a basis of the null space.

    An EmptyPolytopeError is raised if the equations are inconsistent.
    """
    if not len(across):
        return np.zeros(across.shape[1]), np.eye(across.shape[1])
    factors = _balance(across)
    across, levels = across * factors[:, None], levels * factors
    point = np.linalg.lstsq(across, levels, rcond=FLAT)[0]
    misfit = float(np.abs(across @ point - levels).max())
    if misfit > 1e2 * FLAT * max(1.0, float(np.abs(levels).max())):
        raise EmptyPolytopeError(misfit)
    return np.asarray(point, dtype=np.float64), null_space_basis(across)


def null_space_basis(across: Floats) -> Floats:
    """Return an orthonormal basis of the null space of `across`, shape (e, n), as columns of shape (n, d)."""
    if not across.any():
        return np.eye(across.shape[1])
    return np.asarray(null_space(across * _balance(across)[:, None], rcond=FLAT))


def _balance(across: Floats) -> Floats:
    """Return powers of two that make the lengths of rows similar, shape (e,); ones if they differ little."""
    lengths = np.linalg.norm(across, axis=1)
    lengths = np.where(lengths > 0.0, lengths, lengths.max(initial=0.0))
    if lengths.max() <= 1e3 * lengths.min():
        return np.ones(len(lengths))
    return np.asarray(np.exp2(-np.round(np.log2(lengths))))


def _need_bounded(rows: Floats, limits: Floats, slack: float, basis: Floats) -> None:
    """Raise an error if the set is empty, or has a direction of recession d: rows d <= 0 and d not zero."""
    if np.linalg.matrix_rank(rows, tol=FLAT) < rows.shape[1]:
        direction = null_space(rows, rcond=FLAT)[:, 0]
    else:
        optimum = linprog(rows.sum(axis=0), A_ub=rows, b_ub=np.zeros(len(rows)), bounds=(-1.0, 1.0), method="highs")
        if optimum.status != 0 or optimum.fun >= -1e-6:
            return
        direction = optimum.x / np.linalg.norm(optimum.x)
    # The minimum relaxation of the rows with which a point satisfies all.
    matrix = np.column_stack([rows, -np.ones(len(rows))])
    cost = np.append(np.zeros(rows.shape[1]), 1.0)
    bounds = [(None, None)] * rows.shape[1] + [(0.0, None)]
    optimum = linprog(cost, A_ub=matrix, b_ub=limits, bounds=bounds, method="highs", options=HIGHS)
    if optimum.status == 0 and optimum.fun > slack:
        raise EmptyPolytopeError(float(optimum.fun))
    raise UnboundedPolytopeError(basis @ direction)


def _always_tight(rows: Floats, limits: Floats, tolerance: float) -> Integers:
    """Return the rows that every point meets with equality; none in a set that is thin but not flat."""
    loose = np.zeros(len(rows), dtype=bool)
    size = rows.shape[1]
    while not loose.all():
        left = np.flatnonzero(~loose)
        slack = np.zeros((len(rows), len(left)))
        slack[left, np.arange(len(left))] = 1.0
        cost = np.concatenate([np.zeros(size), -np.ones(len(left))])
        bounds = [(None, None)] * size + [(0.0, 1.0)] * len(left)
        optimum = linprog(
            cost,
            A_ub=np.hstack([rows, slack]),
            b_ub=limits + tolerance,
            bounds=bounds,
            method="highs",
            options=HIGHS,
        )
        if optimum.status != 0:
            raise UncertainHullError("the affine hull was not found")
        new = left[optimum.x[size:] > 30.0 * tolerance]
        if not len(new):
            return left
        loose[new] = True
    return np.zeros(0, dtype=np.int64)
