"""The kernel of the segment solver: whitening, block elimination and costates of one path."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rendezvous._compile import compiled

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


@compiled
def factor(matrix: Floats, lower: Floats) -> bool:
    """Fill the Cholesky factor; False if the matrix is not positive definite."""
    size = len(matrix)
    for row in range(size):
        for column in range(row + 1):
            value = matrix[row, column]
            for inner in range(column):
                value -= lower[row, inner] * lower[column, inner]
            if row == column:
                if not value > 0.0:
                    return False
                lower[row, row] = np.sqrt(value)
            else:
                lower[row, column] = value / lower[column, column]
    return True


@compiled
def whiten(lower: Floats, columns: Floats) -> None:
    """Multiply by the inverse of a lower triangle, in place; `columns` has shape (size, m)."""
    for column in range(columns.shape[1]):
        for row in range(len(lower)):
            value = columns[row, column]
            for inner in range(row):
                value -= lower[row, inner] * columns[inner, column]
            columns[row, column] = value / lower[row, row]


@compiled
def whiten_back(lower: Floats, columns: Floats) -> None:
    """Multiply by the inverse of its transpose, in place."""
    for column in range(columns.shape[1]):
        for row in range(len(lower) - 1, -1, -1):
            value = columns[row, column]
            for inner in range(row + 1, len(lower)):
                value -= lower[inner, row] * columns[inner, column]
            columns[row, column] = value / lower[row, row]


@compiled
def solve_path(
    transition: Floats,
    gramian: Floats,
    drift: Floats,
    durations: Floats,
    begin: Floats,
    arrive: Floats,
    pinned: Flags,
    before: Floats,
    at_start: Floats,
) -> tuple[bool, float]:
    """Solve for the velocities at flybys (in `begin`, `arrive`) and the costates `before` and `at_start` of N segments.

    Transitions, Gramians, drifts and durations are those of the segments, begin and arrive their states at both ends;
    `pinned` says whether the velocity at the end is given. Returns whether all blocks are positive definite, and I;
    otherwise the outputs are invalid.

    Notes
    -----
    y_k = L_k^-1 S_k^-1 (x_k - Phi_k x_(k-1) - d_k) with S = (T, T, T, 1, 1, 1); ahead and behind are its slopes along
    the velocities at the end and, negated, at the start. Normal equations by blocks of 3, factored as they are built.
    """
    count = len(durations)
    lower = np.zeros((count, 6, 6))
    ahead, behind, effort = np.zeros((count, 6, 3)), np.zeros((count, 6, 3)), np.zeros((count, 6, 1))
    scaled = np.empty((6, 6))
    for k in range(count):
        for row in range(6):
            by = durations[k] if row < 3 else 1.0
            for column in range(6):
                scaled[row, column] = gramian[k, row, column] / (by * (durations[k] if column < 3 else 1.0))
            value = -drift[k, row]
            if row < 3 or pinned[k]:
                value += arrive[k, row]
            for column in range(6):
                if column < 3 or k == 0 or pinned[k - 1]:
                    value -= transition[k, row, column] * begin[k, column]
            effort[k, row, 0] = value / by
            for column in range(3):
                behind[k, row, column] = transition[k, row, 3 + column] / by
        for axis in range(3):
            ahead[k, 3 + axis, axis] = 1.0
        if not factor(scaled, lower[k]):
            return False, 0.0
        whiten(lower[k], effort[k])
        whiten(lower[k], ahead[k])
        whiten(lower[k], behind[k])
    velocities = np.zeros((count, 3))
    if not _eliminate(ahead, behind, effort, pinned, velocities):
        return False, 0.0
    cost = 0.0
    for k in range(count):
        for row in range(6):
            value = effort[k, row, 0]
            for column in range(3):
                value += ahead[k, row, column] * velocities[k, column]
                if k > 0:
                    value -= behind[k, row, column] * velocities[k - 1, column]
            effort[k, row, 0] = value
            cost += 0.5 * value * value
        whiten_back(lower[k], effort[k])
        for row in range(6):
            before[k, row] = effort[k, row, 0] / (durations[k] if row < 3 else 1.0)
        for row in range(6):
            value = 0.0
            for column in range(6):
                value += transition[k, column, row] * before[k, column]
            at_start[k, row] = value
        if not pinned[k]:
            for axis in range(3):
                arrive[k, 3 + axis] = velocities[k, axis]
                if k + 1 < count:
                    begin[k + 1, 3 + axis] = velocities[k, axis]
    return True, cost


@compiled
def _eliminate(ahead: Floats, behind: Floats, effort: Floats, pinned: Flags, velocities: Floats) -> bool:
    """Solve the block-tridiagonal normal equations; given velocities stay zero."""
    count = len(effort)
    lower, coupled = np.zeros((count, 3, 3)), np.zeros((count, 3, 3))
    right, block = np.zeros((count, 3, 1)), np.zeros((3, 3))
    for k in range(count):
        for first in range(3):
            value = 0.0
            for row in range(6):
                value -= ahead[k, row, first] * effort[k, row, 0]
                if k + 1 < count:
                    value += behind[k + 1, row, first] * effort[k + 1, row, 0]
            right[k, first, 0] = value
            for second in range(3):
                value = 0.0
                for row in range(6):
                    value += ahead[k, row, first] * ahead[k, row, second]
                    if k + 1 < count:
                        value += behind[k + 1, row, first] * behind[k + 1, row, second]
                block[first, second] = value
        if pinned[k]:
            for axis in range(3):
                right[k, axis, 0] = 0.0
                lower[k, axis, axis] = 1.0
            continue
        if k > 0 and not pinned[k - 1]:
            # coupled = L_(k-1)^-1 times the block above the diagonal.
            for first in range(3):
                for second in range(3):
                    value = 0.0
                    for row in range(6):
                        value -= behind[k, row, first] * ahead[k, row, second]
                    coupled[k, first, second] = value
            whiten(lower[k - 1], coupled[k])
            for first in range(3):
                for inner in range(3):
                    right[k, first, 0] -= coupled[k, inner, first] * right[k - 1, inner, 0]
                    for second in range(3):
                        block[first, second] -= coupled[k, inner, first] * coupled[k, inner, second]
        if not factor(block, lower[k]):
            return False
        whiten(lower[k], right[k])
    for k in range(count - 1, -1, -1):
        if k + 1 < count:
            for first in range(3):
                for second in range(3):
                    right[k, first, 0] -= coupled[k + 1, first, second] * right[k + 1, second, 0]
        whiten_back(lower[k], right[k])
        for axis in range(3):
            velocities[k, axis] = right[k, axis, 0]
    return True
