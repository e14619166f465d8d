"""Division into simplices, largest ball, and orthonormal bases."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.optimize import linprog

from infoset.arrays import Flags, Floats, Integers
from infoset.geometry.polytope.errors import SolverError

HIGHS = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
"""Options of HiGHS for linear programs on the scale of a polytope: 1e-10 is the smallest tolerance
that HiGHS accepts.
"""


def simplices_of(sides: Flags, dimension: int) -> Integers:
    """Return the vertices of simplices that divide a polytope, shape (k, d + 1).

    `sides[i, j]`, shape (f, v), is whether vertex j is on facet i. A face is the union of the
    pyramids from its first vertex over its own facets that do not contain this vertex. Faces are
    integers here: bit j is set if vertex j is on the face.

    References
    ----------
    B. Bueler, A. Enge and K. Fukuda, Exact volume computation for polytopes, in Polytopes (2000).
    """
    known: dict[int, list[tuple[int, ...]]] = {}

    def divide(face: int, facets: list[int], size: int) -> list[tuple[int, ...]]:
        if face in known:
            return known[face]
        # With one vertex more than dimensions it is a simplex.
        if face.bit_count() <= size + 1:
            known[face] = [tuple(i for i in range(face.bit_length()) if face >> i & 1)]
            return known[face]

        # The number of the lowest bit: the first vertex of the face.
        first = (face & -face).bit_length() - 1
        simplices: list[tuple[int, ...]] = []
        for facet in facets:
            if facet >> first & 1:
                continue
            own_facets = _facets_of(facet, facets, size - 1)
            simplices += [(first, *rest) for rest in divide(facet, own_facets, size - 1)]
        known[face] = simplices
        return simplices

    sets = [
        int.from_bytes(bits.tobytes(), "little")
        for bits in np.packbits(sides, axis=1, bitorder="little")
    ]
    whole = 0
    for side in sets:
        whole |= side
    return np.array(divide(whole, sets, dimension))


def _facets_of(face: int, others: list[int], size: int) -> list[int]:
    """Return the facets of a face of dimension `size`: the maximal intersections with other faces.

    Each has at least `size` vertices.
    """
    parts = sorted({face & other for other in others} - {face}, key=int.bit_count, reverse=True)
    found: list[int] = []
    for part in parts:
        if part.bit_count() >= size and not any(part & ~one == 0 for one in found):
            found.append(part)
    return found


def largest_ball(rows: Floats, limits: Floats) -> tuple[Floats, float]:
    """Return the centre, shape (d,), and radius of a largest ball in {z: rows z <= limits}.

    No row is zero. The distance from a facet is limit - row . z, as for rows of unit length. The
    radius is negative if the set is empty; its absolute value is the minimum relaxation of the rows
    that has a point.

    Raises
    ------
    SolverError
        If the linear program (HiGHS) was not solved, for example because the set has balls of any
        size.
    """
    # The program has rows of size one. Its last variable is the radius / `minimum`, the size of the
    # smallest row, or 1 if that is less: no coefficient exceeds 1. The value 1e-300 only avoids a
    # division by zero: with a row of zeros the result has no meaning.
    units = np.abs(rows).max(axis=1, initial=1e-300)
    minimum = float(units.min(initial=1.0))
    matrix = np.column_stack([rows / units[:, None], minimum / units])
    cost = np.zeros(matrix.shape[1])
    cost[-1] = -1.0
    optimum = linprog(
        cost, A_ub=matrix, b_ub=limits / units, bounds=(None, None), method="highs", options=HIGHS
    )
    if optimum.status != 0:
        raise SolverError(
            "the linear program of a largest ball inside was not solved: is the set unbounded?"
        )
    return optimum.x[:-1], float(optimum.x[-1]) * minimum


def triangle_of(columns: Floats) -> tuple[Floats, Integers]:
    """Return the triangle and the order of the columns of a QR factorization.

    The sizes of the rows may differ much.
    """
    # The largest rows first: the small ones then keep their digits.
    order = np.argsort(-np.abs(columns).max(axis=1))
    triangle, pivots = qr(columns[order], mode="r", pivoting=True)
    return triangle[: columns.shape[1]], pivots


def orthonormal(columns: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Return an orthonormal basis of the span of columns, shape (n, d), and functions in it.

    The columns are independent. `rows`, shape (k, d), are linear functions of their coefficients;
    the result has functions of the coefficients of the basis. Each row of the basis is exact to
    rounding of itself: the sizes of the rows may differ much.
    """
    if not columns.shape[1]:
        return columns, rows
    # The second pass corrects angles.
    for _ in range(2):
        triangle, pivots = triangle_of(columns)
        columns = solve_triangular(triangle.T, columns[:, pivots].T, lower=True).T
        rows = solve_triangular(triangle.T, rows[:, pivots].T, lower=True).T
    return columns, rows
