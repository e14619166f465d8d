"""The affine hull of a set of half-spaces and equations with a known member, and a largest ball
inside.

For sets in spaces of any dimension: linear programs instead of vertices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space
from scipy.optimize import linprog

from infoset.geometry.polytope import HIGHS, SolverError, largest_ball
from infoset.rendezvous._arrays import Floats, Integers

FLAT = 1e-9
"""Relative thickness below which a set is flat."""
ROUNDING = 1e-13
"""Rounding of zero, relative to the size of the coordinates."""


@dataclass(frozen=True, eq=False)
class RelativeInterior:
    """The set {point + basis z: rows z <= limits}, with the centre of a largest ball inside.

    `point`, shape (n,), is the origin of the coordinates z, `basis`, shape (n, d), has orthonormal
    columns, and `rows`, shape (k, d), have unit length. `kept`, shape (k,), is the index of each
    row's half-space; the others are always tight, or do not depend on z. `centre`, shape (d,), is
    the Chebyshev centre.
    """

    point: Floats
    basis: Floats
    rows: Floats
    limits: Floats
    kept: Integers
    centre: Floats


def relative_interior(
    normals: Floats, offsets: Floats, across: Floats, levels: Floats, member: Floats
) -> RelativeInterior:
    """Return the affine hull of {x: normals x <= offsets, across x = levels}, of shapes (m, n),
    (m,), (e, n) and (e,).

    The set is bounded, and `member`, shape (n,), is a point in it: the rows are relaxed by its
    rounding. If the radius of a largest ball is zero, some half-spaces imply equations; linear
    programs (HiGHS) find the rows that are always tight. A set is flat in a direction in which it
    is thinner than 1e-9 of its width.

    Raises
    ------
    SolverError
        If a linear program was not solved.
    """
    lengths = np.linalg.norm(normals, axis=1)
    used = np.flatnonzero(
        lengths > ROUNDING * float(lengths.max(initial=0.0))
    )  # others have no direction
    offsets = np.maximum(offsets, normals @ member)
    normals = normals[used] / lengths[used, None]
    offsets = offsets[used] / lengths[used]
    size = max(float(np.abs(offsets).max(initial=0.0)), float(np.abs(member).max(initial=0.0)))
    for _ in range(len(normals) + 1):
        point, basis = _solutions(across, levels)
        rows = normals @ basis
        limits = offsets - normals @ point
        lengths = np.linalg.norm(rows, axis=1)
        kept = np.flatnonzero(lengths > FLAT)
        if not basis.shape[1]:
            return RelativeInterior(point, basis, rows[:0], limits[:0], used[:0], np.zeros(0))
        rows = rows[kept] / lengths[kept, None]
        limits = limits[kept] / lengths[kept]
        centre, radius = largest_ball(rows, limits)
        width = max(float(np.abs(limits - rows @ centre).max()), float(np.abs(centre).max()))
        flat = max(FLAT * width, ROUNDING * size, 1e-300)
        tight = np.zeros(0, dtype=np.int64) if radius > flat else _always_tight(rows, limits, flat)
        if not len(tight):
            return RelativeInterior(point, basis, rows, limits, used[kept], centre)
        across = np.vstack([across, rows[tight] @ basis.T])
        levels = across @ member
    raise SolverError(
        "the affine hull was not found"
    )  # pragma: no cover - each pass lowers the dimension


def null_space_basis(across: Floats) -> Floats:
    """Return an orthonormal basis of the null space of `across`, shape (e, n), as columns of shape
    (n, d).
    """
    if not across.any():
        return np.eye(across.shape[1])
    return np.asarray(null_space(across * _balance(across)[:, None], rcond=FLAT))


def _solutions(across: Floats, levels: Floats) -> tuple[Floats, Floats]:
    """Return the solution of minimum norm of equations, which may be dependent, and a basis of the
    null space.
    """
    if not len(across):
        return np.zeros(across.shape[1]), np.eye(across.shape[1])
    factors = _balance(across)
    point = np.linalg.lstsq(across * factors[:, None], levels * factors, rcond=FLAT)[0]
    return np.asarray(point, dtype=np.float64), null_space_basis(across)


def _balance(across: Floats) -> Floats:
    """Return powers of two that make the lengths of rows similar, shape (e,); ones if they differ
    little.
    """
    lengths = np.linalg.norm(across, axis=1)
    lengths = np.where(lengths > 0.0, lengths, lengths.max(initial=0.0))
    if lengths.max() <= 1e3 * lengths.min():
        return np.ones(len(lengths))
    return np.asarray(np.exp2(-np.round(np.log2(lengths))))


def _always_tight(rows: Floats, limits: Floats, tolerance: float) -> Integers:
    """Return the rows that every point meets with equality; none in a set that is thin but not
    flat.
    """
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
            raise SolverError("the affine hull was not found")
        new = left[optimum.x[size:] > 30.0 * tolerance]
        if not len(new):
            return left
        loose[new] = True
    return np.zeros(0, dtype=np.int64)
