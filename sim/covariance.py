"""The covariance of a start: a matrix, or standard deviations and correlations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from infoset.arrays import Floats
from infoset.limits import NOT_NEGATIVE, check_fields

Rows = tuple[tuple[float, ...], ...]
CORRELATION_ROUNDING = 1e-6
"""Differences of correlations that are rounding: files have about seven digits."""
DIGITS = 12
"""Decimals of the correlations of `covariance_of`: more than files have, and fewer than the 16 of a
float, the last of which are rounding errors.
"""
SAMPLE = 2000
"""Starts that estimate the share within a box: a share of 1 % has a standard error of 0.2 %."""


@dataclass(frozen=True)
class Covariance:
    """Covariance of a relative state, positions before velocities.

    Parameters
    ----------
    position_sigma_m, velocity_sigma_m_s : tuple of float
        Standard deviations of the components.
    correlations : tuple of rows
        Correlations of all components: the whole matrix, or its lower triangle. Without rows: zero.
    matrix_m2 : tuple of rows
        The covariance in place of the three others, in m^2, m^2/s and m^2/s^2: the whole matrix, or
        its lower triangle.

    Raises
    ------
    TypeError, ValueError
        If a value is not within its limits, or the matrix is not a covariance.
    """

    position_sigma_m: Annotated[tuple[float, ...], NOT_NEGATIVE] = ()
    velocity_sigma_m_s: Annotated[tuple[float, ...], NOT_NEGATIVE] = ()
    correlations: Rows = ()
    matrix_m2: Rows = ()

    def __post_init__(self) -> None:
        check_fields(self)
        positions = len(self.position_sigma_m)
        velocities = len(self.velocity_sigma_m_s)
        has_deviations = positions > 0 or velocities > 0
        if bool(self.matrix_m2) == has_deviations or (self.matrix_m2 and self.correlations):
            raise ValueError(
                "Covariance: must have matrix_m2, or position_sigma_m and velocity_sigma_m_s"
            )
        if positions != velocities:
            raise ValueError(
                "Covariance: position_sigma_m and velocity_sigma_m_s must have as many values: "
                f"got {positions} and {velocities}"
            )
        self._check_exact_components()
        self._check_correlations()

    def _check_exact_components(self) -> None:
        """Raise ValueError if a component with the variance zero has another covariance.

        abs(c_ij) <= sigma_i sigma_j = 0 without a tolerance: rounding leaves zeros of a file zero.
        """
        if not self.matrix_m2:
            return
        matrix = _symmetric("matrix_m2", self.matrix_m2)
        rows, columns = np.nonzero((self.sigma == 0.0)[:, None] & (matrix != 0.0))
        if rows.size:
            row = rows[0]
            column = columns[0]
            raise ValueError(
                f"Covariance: the variance of component {row + 1} is 0, so that its covariance "
                f"with component {column + 1} must be 0: got {matrix[row, column]:.3g}"
            )

    def _check_correlations(self) -> None:
        """Raise ValueError unless the correlations are a covariance of n components."""
        if len(self.correlation) != self.size:
            raise ValueError(
                f"Covariance: correlations must have {self.size} rows: got {len(self.correlation)}"
            )
        if not np.allclose(self.correlation.diagonal(), 1.0, atol=CORRELATION_ROUNDING, rtol=0.0):
            raise ValueError(
                "Covariance: the variances must not be negative, and correlations have the "
                "diagonal 1"
            )

        row, column = np.unravel_index(np.abs(self.correlation).argmax(), self.correlation.shape)
        greatest = self.correlation[row, column]
        if abs(greatest) > 1.0 + CORRELATION_ROUNDING:
            raise ValueError(
                f"Covariance: the correlation of components {min(row, column) + 1} and "
                f"{max(row, column) + 1} is {greatest:.3g}, and must be from -1 to 1"
            )

        least = np.linalg.eigvalsh(self.correlation)[0]
        if least < -CORRELATION_ROUNDING:
            raise ValueError(
                f"Covariance: its correlations have a negative eigenvalue, {least:.3g}: check the "
                "signs, and that positions stand before velocities"
            )

    @property
    def size(self) -> int:
        """Number n of components."""
        return len(self.sigma)

    @cached_property
    def sigma(self) -> Floats:
        """Standard deviations, m and m/s, shape (n,)."""
        if not self.matrix_m2:
            return np.array([*self.position_sigma_m, *self.velocity_sigma_m_s])
        # A negative variance is refused by its correlation of -1; it must not become NaN before.
        return np.asarray(np.sqrt(np.abs(_symmetric("matrix_m2", self.matrix_m2).diagonal())))

    @cached_property
    def correlation(self) -> Floats:
        """Correlations, shape (n, n).

        A component whose variance in `matrix_m2` is zero has zeros and one.
        """
        if self.matrix_m2:
            inverse = np.divide(1.0, self.sigma, out=np.zeros(self.size), where=self.sigma > 0.0)
            exact = np.diag(np.where(self.sigma > 0.0, 0.0, 1.0))
            matrix = _symmetric("matrix_m2", self.matrix_m2)
            return np.asarray(matrix * np.outer(inverse, inverse) + exact)
        if self.correlations:
            return _symmetric("correlations", self.correlations)
        return np.eye(self.size)

    @property
    def matrix(self) -> Floats:
        """The covariance, m^2, m^2/s and m^2/s^2, shape (n, n)."""
        return np.asarray(self.correlation * np.outer(self.sigma, self.sigma))

    @cached_property
    def root(self) -> Floats:
        """Lower triangular matrix A with A A^T equal to the covariance, shape (n, n) (Cholesky).

        A component that follows from those before it has a column of zeros.
        """
        lower = np.zeros((self.size, self.size))
        for k, column in enumerate(self.correlation.T):
            rest = column[k:] - lower[k:, :k] @ lower[k, :k]
            # A variance, to which a correlation that is only rounding contributes its square.
            if rest[0] > CORRELATION_ROUNDING**2:
                lower[k:, k] = rest / np.sqrt(rest[0])
        return self.sigma[:, None] * lower

    def share_within(self, half: Floats) -> float:
        """Return the share of normal states with all components from -`half` to `half`.

        `half` has the shape (n,), and both ends count. The share is estimated by a fixed sample.
        """
        sample = np.random.default_rng(0).standard_normal((SAMPLE, self.size)) @ self.root.T
        return float((np.abs(sample) <= half).all(axis=1).mean())


def covariance_of(matrix: Floats) -> Covariance:
    """Return a covariance matrix in space, shape (6, 6), as deviations and rounded correlations.

    The correlations are the lower triangle. A matrix that is symmetric up to rounding is made
    symmetric.
    """
    symmetric = 0.5 * (matrix + matrix.T)
    given = Covariance(matrix_m2=tuple(map(tuple, symmetric.tolist())))
    rows = np.round(given.correlation, DIGITS).tolist()
    triangle = tuple(tuple(row[: index + 1]) for index, row in enumerate(rows))
    sigma = given.sigma.tolist()
    return Covariance(tuple(sigma[:3]), tuple(sigma[3:]), triangle)


def _symmetric(name: str, rows: Rows) -> Floats:
    """Return a symmetric matrix from its rows, or from the rows of its lower triangle."""
    size = len(rows)
    lengths = [len(row) for row in rows]
    if lengths not in ([size] * size, [*range(1, size + 1)]):
        raise ValueError(
            f"Covariance: {name} must be a square matrix or its lower triangle: got rows of "
            f"{lengths}"
        )

    # The rest of a row of a triangle is in the column below its last value.
    matrix = np.array(
        [[*row, *(rows[k][len(row) - 1] for k in range(len(row), size))] for row in rows]
    )
    scale = np.sqrt(np.abs(matrix.diagonal()))
    if (np.abs(matrix - matrix.T) > CORRELATION_ROUNDING * np.outer(scale, scale)).any():
        raise ValueError(
            f"Covariance: {name} must be symmetric: correct it, or write its lower triangle only"
        )
    return np.asarray(0.5 * (matrix + matrix.T))
