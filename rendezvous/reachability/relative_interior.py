"""The affine hull of a set of half-spaces and equations, and a largest ball inside the set.

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
"""Thickness of a set, relative to its width, below which it is flat: the violation of a constraint
that is accepted (`conic.MAX_VIOLATION`)."""
COORDINATE_ROUNDING = 1e-13
"""Rounding of zero, relative to the size of the coordinates: some hundred roundings of doubles."""
_SMALLEST = 1e-300
"""Thickness below which any set is flat, one whose coordinates are zero too."""
_SIMILAR = 1e3
"""Ratio of the lengths of rows up to which they are not rescaled. Chosen: singular values are then
exact to 1e-13 of the shortest row."""
_LOOSE = 30.0
"""Slack, in units of the thickness of a flat set, above which a row is not always tight. The rows
are relaxed by one unit, which can give a slack of a few units in a corner."""


@dataclass(frozen=True, eq=False)
class RelativeInterior:
    """The set {point + basis z: rows z <= limits}, with the centre of a largest ball inside.

    `point`, shape (n,), is the origin of the coordinates z, `basis`, shape (n, d), has orthonormal
    columns, and `rows`, shape (k, d), have unit length. `kept`, shape (k,), contains the index of
    each row's half-space; the other half-spaces are always tight, or do not depend on z. `centre`,
    shape (d,), is the Chebyshev centre.
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
    """Return the affine hull of {x: normals x <= offsets, across x = levels}.

    The shapes are (m, n), (m,), (e, n) and (e,). The set is bounded, and `member`, shape (n,), is a
    point in it except for rounding, by which the half-spaces are relaxed. If the radius of a
    largest ball is zero, some half-spaces imply equations; linear programs (HiGHS) find the rows
    that are always tight. A set is flat in a direction in which it is thinner than 1e-9 of its
    width.

    Raises
    ------
    SolverError
        If a linear program was not solved.
    """
    offsets = np.maximum(offsets, normals @ member)
    # Half-spaces of unit length; shorter normals have no direction.
    lengths = np.linalg.norm(normals, axis=1)
    used = np.flatnonzero(lengths > COORDINATE_ROUNDING * float(lengths.max(initial=0.0)))
    normals = normals[used] / lengths[used, None]
    offsets = offsets[used] / lengths[used]
    size = max(float(np.abs(offsets).max(initial=0.0)), float(np.abs(member).max(initial=0.0)))

    # Rows that are always tight become equations, until a ball fits inside.
    for _ in range(len(normals) + 1):
        point, basis = _solutions(across, levels)
        rows = normals @ basis
        limits = offsets - normals @ point
        lengths = np.linalg.norm(rows, axis=1)
        if not basis.shape[1]:
            return RelativeInterior(point, basis, rows[:0], limits[:0], used[:0], np.zeros(0))
        # A shorter row hardly depends on z.
        kept = np.flatnonzero(lengths > FLAT)
        rows = rows[kept] / lengths[kept, None]
        limits = limits[kept] / lengths[kept]

        centre, radius = largest_ball(rows, limits)
        width = max(float(np.abs(limits - rows @ centre).max()), float(np.abs(centre).max()))
        flat = max(FLAT * width, COORDINATE_ROUNDING * size, _SMALLEST)
        interior = RelativeInterior(point, basis, rows, limits, used[kept], centre)
        if radius > flat:
            return interior
        tight = _always_tight(rows, limits, flat)
        # A thin set that is not flat has no row that is always tight.
        if not len(tight):
            return interior

        across = np.vstack([across, rows[tight] @ basis.T])
        levels = across @ member
    # Each pass lowers the dimension.
    raise SolverError("the affine hull was not found")  # pragma: no cover


def null_space_basis(across: Floats) -> Floats:
    """Return an orthonormal basis, shape (n, d), of the null space of `across`, shape (e, n)."""
    if not across.any():
        return np.eye(across.shape[1])
    return np.asarray(null_space(across * _balance(across)[:, None], rcond=FLAT))


def _solutions(across: Floats, levels: Floats) -> tuple[Floats, Floats]:
    """Return the solution of minimum norm of equations, and a basis of their null space.

    The equations may be dependent.
    """
    if not len(across):
        return np.zeros(across.shape[1]), np.eye(across.shape[1])
    factors = _balance(across)
    point = np.linalg.lstsq(across * factors[:, None], levels * factors, rcond=FLAT)[0]
    return np.asarray(point, dtype=np.float64), null_space_basis(across)


def _balance(across: Floats) -> Floats:
    """Return powers of two, shape (e,), that make the lengths of rows similar; ones if they are."""
    lengths = np.linalg.norm(across, axis=1)
    lengths = np.where(lengths > 0.0, lengths, lengths.max(initial=0.0))
    if lengths.max() <= _SIMILAR * lengths.min():
        return np.ones(len(lengths))
    return np.asarray(np.exp2(-np.round(np.log2(lengths))))


def _always_tight(rows: Floats, limits: Floats, tolerance: float) -> Integers:
    """Return the rows that hold with equality at every point; none if the set is not flat.

    Each linear program maximises the sum of the slacks, up to one, of the rows that are not known
    to be loose.
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

        new = left[optimum.x[size:] > _LOOSE * tolerance]
        if not len(new):
            return left
        loose[new] = True
    return np.zeros(0, dtype=np.int64)
