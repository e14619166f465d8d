"""The affine hull of points, and coordinates in it in which the set has about the same width in every direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FLAT = 1e-9
"""Relative thickness below which a set is flat."""
ROUNDING = 1e-13
"""Rounding of zero, relative to the size of the coordinates."""


@dataclass(frozen=True)
class Frame:
    """Coordinates y = (x - centre) basis / extents of an affine subspace of dimension d in R^n.

    Parameters
    ----------
    centre : ndarray, shape (n,)
        Mean of the points.
    basis : ndarray, shape (n, d)
        Orthonormal columns.
    extents : ndarray, shape (d,)
        Greatest distance of a point from the centre along each column.
    across : ndarray, shape (n, n - d)
        Orthonormal columns that complete the basis.
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

    Notes
    -----
    A singular-value decomposition, O(k n^2). A direction counts where the points are wider along it than `flat` times
    their greatest width, and wider than the rounding of their coordinates.
    """
    centre = points.mean(axis=0)
    centred = points - centre
    # With fewer points than coordinates all right singular vectors are needed, and the left ones are few.
    directions = np.linalg.svd(centred, full_matrices=len(points) < points.shape[1])[2]
    extents = np.abs(centred @ directions.T).max(axis=0)
    least = max(flat * float(extents.max()), ROUNDING * float(np.abs(points).max(initial=0.0)))
    wide = extents > least
    return Frame(centre, directions[wide].T, extents[wide], directions[~wide].T)
