"""The affine hull of a set defined by half-spaces and equations, and the centre of a largest ball inside."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space
from scipy.optimize import linprog

from infoset.polytope._frame import FLAT, ROUNDING
from infoset.polytope.errors import EmptyPolytopeError, UnboundedPolytopeError, UncertainHullError

Floats = NDArray[np.float64]
Places = NDArray[np.int64]

HIGHS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}


@dataclass(frozen=True, eq=False)
class RelativeInterior:
    """The set {point + basis z: rows z <= limits}, with the centre of a largest ball inside.

    Parameters
    ----------
    point : ndarray, shape (n,)
        Origin of the coordinates z.
    basis : ndarray, shape (n, d)
        Orthonormal columns.
    rows : ndarray, shape (k, d)
        Rows of unit length.
    limits : ndarray, shape (k,)
        Limits of the rows.
    kept : ndarray of int, shape (k,)
        Index of each row's half-space; the others are always tight, or do not depend on z.
    centre : ndarray, shape (d,)
        The Chebyshev centre.
    radius : float
        Radius of a largest ball inside.
    """

    point: Floats
    basis: Floats
    rows: Floats
    limits: Floats
    kept: Places
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
) -> RelativeInterior:
    """Return the affine hull of {x: normals x <= offsets, across x = levels}.

    Parameters
    ----------
    normals, offsets, across, levels : ndarray
        Arrays of shapes (m, n), (m,), (e, n) and (e,).
    bounded : bool
        Whether the set is known to be bounded, which saves a linear program.
    member : ndarray, shape (n,), optional
        A point that is known to be in the set: the rows are relaxed by its rounding.

    Raises
    ------
    EmptyPolytopeError
        If no point satisfies all rows.
    UnboundedPolytopeError
        If the set is unbounded.
    UncertainHullError
        If a linear program was not solved.

    Notes
    -----
    If the radius of a largest ball is zero, some half-spaces imply equations; linear programs (HiGHS) find the rows
    that are always tight. A set is flat in a direction in which it is thinner than 1e-9 of its width.
    """
    lengths = np.linalg.norm(normals, axis=1)
    long = lengths > ROUNDING * float(lengths.max(initial=0.0))
    size = float(np.abs(offsets).max(initial=0.0))
    if member is not None:
        size = max(size, float(np.abs(member).max(initial=0.0)))
        offsets = np.maximum(offsets, normals @ member)
    # A row whose length is rounding has no direction.
    void = np.flatnonzero(~long & (offsets < -ROUNDING * size))
    if len(void):
        raise EmptyPolytopeError(float(-offsets[void].min()), void)
    used = np.flatnonzero(long)
    normals, offsets = normals[used] / lengths[used, None], offsets[used] / lengths[used]
    for _ in range(len(normals) + 1):
        point, basis = solutions(across, levels)
        slack = FLAT * max(1.0, float(np.abs(point).max(initial=0.0)))
        rows, limits = normals @ basis, offsets - normals @ point
        lengths = np.linalg.norm(rows, axis=1)
        kept = np.flatnonzero(lengths > FLAT)
        worst = float(np.delete(limits, kept).min(initial=np.inf))
        if worst < -slack:
            raise EmptyPolytopeError(-worst, used[np.flatnonzero((lengths <= FLAT) & (limits < -slack))])
        if not basis.shape[1]:
            return RelativeInterior(point, basis, rows[:0], limits[:0], used[:0], np.zeros(0), 0.0)
        rows, limits = rows[kept] / lengths[kept, None], limits[kept] / lengths[kept]
        if not bounded:
            _need_bounded(rows, basis)
        centre, radius = chebyshev_ball(rows, limits)
        width = max(float(np.abs(limits - rows @ centre).max()), float(np.abs(centre).max()))
        flat = max(FLAT * width, ROUNDING * size, 1e-300)
        if radius < -flat:
            raise EmptyPolytopeError(-radius)
        tight = np.zeros(0, dtype=np.int64) if radius > flat else _always_tight(rows, limits, flat)
        if not len(tight):
            return RelativeInterior(point, basis, rows, limits, used[kept], centre, radius)
        turned = rows[tight] @ basis.T
        across = np.vstack([across, turned])
        levels = np.concatenate([levels, limits[tight] + turned @ point]) if member is None else across @ member
    raise UncertainHullError("the affine hull was not found")  # pragma: no cover - each pass lowers the dimension


def chebyshev_ball(rows: Floats, limits: Floats) -> tuple[Floats, float]:
    """Return the centre, shape (d,), and radius of a largest ball in {z: rows z <= limits}, rows of unit length.

    The radius is negative if the set is empty; its absolute value is the least relaxation of the rows that has a point.

    Raises
    ------
    UncertainHullError
        If the linear program (HiGHS) was not solved, for example because the set has balls of any size.
    """
    size = rows.shape[1]
    matrix = np.column_stack([rows, np.ones(len(rows))])
    cost = np.zeros(size + 1)
    cost[-1] = -1.0
    optimum = linprog(cost, A_ub=matrix, b_ub=limits, bounds=(None, None), method="highs", options=HIGHS)
    if optimum.status != 0:
        raise UncertainHullError("the linear program of a largest ball inside was not solved")
    return optimum.x[:-1], float(optimum.x[-1])


def solutions(across: Floats, levels: Floats) -> tuple[Floats, Floats]:
    """Return all solutions of equations, which may be dependent: the one of least norm, and a basis of the null space.

    Raises
    ------
    EmptyPolytopeError
        If the equations are inconsistent.
    """
    if not len(across):
        return np.zeros(across.shape[1]), np.eye(across.shape[1])
    point = np.linalg.lstsq(across, levels, rcond=FLAT)[0]
    misfit = float(np.abs(across @ point - levels).max())
    if misfit > 1e2 * FLAT * max(1.0, float(np.abs(levels).max())):
        raise EmptyPolytopeError(misfit)
    return np.asarray(point, dtype=np.float64), null_space_basis(across)


def null_space_basis(across: Floats) -> Floats:
    """Return an orthonormal basis of the null space of `across`, shape (e, n), as columns of shape (n, d)."""
    if not across.any():
        return np.eye(across.shape[1])
    return np.asarray(null_space(across, rcond=FLAT))


def _need_bounded(rows: Floats, basis: Floats) -> None:
    """Raise an error if the set has a direction of recession d: rows d <= 0 and d not zero."""
    if np.linalg.matrix_rank(rows, tol=FLAT) < rows.shape[1]:
        raise UnboundedPolytopeError(basis @ null_space(rows, rcond=FLAT)[:, 0])
    optimum = linprog(rows.sum(axis=0), A_ub=rows, b_ub=np.zeros(len(rows)), bounds=(-1.0, 1.0), method="highs")
    if optimum.status == 0 and optimum.fun < -1e-6:
        raise UnboundedPolytopeError(basis @ optimum.x / np.linalg.norm(optimum.x))


def _always_tight(rows: Floats, limits: Floats, tolerance: float) -> Places:
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
