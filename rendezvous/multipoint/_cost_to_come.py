"""The least energy to come to a target, leg by leg on a grid of times: compiled.

A leg from one target to the next takes the chaser's state x = (r, V) relative to the coasting
target to Phi x, and the energy 1/2 e' G^-1 e adds e, with G the Gramian. The least energy with
which the chaser passes a target at velocity V relative to it is therefore quadratic, c + 1/2 (V -
m)' P^-1 (V - m): that of a Kalman filter whose process noise has the covariance G and whose
measurement is an exact position. At a rendezvous V = 0, and c alone remains.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Floats, Places, Shorts
from infoset.rendezvous._compile import allocation_free, compiled

SIX = 6


class Legs(NamedTuple):
    """Legs on a grid of G times, from time i to time i + l; one row if they depend on l alone, or a
    row for each i.
    """

    response: Floats
    """Phi's half of velocities, shape (1 or G, G, 6, 3)."""
    gramian: Floats
    """Gramian, shape (1 or G, G, 6, 6)."""


@compiled
def extend(
    cost: Floats,
    mean: Floats,
    covariance: Floats,
    cheapest: Places,
    legs: Legs,
    relative: Floats,
    before: int,
    rows: int,
    ranks: int,
    apart: int,
    best: Floats,
    back: Shorts,
) -> None:
    """Lower the least energies `best` at a target by all visits that come from the target `before`.

    `cost`, shape (m, G), `mean`, (m, G, 3), and `covariance`, (m, G, 3, 3), are those of the
    quadratics at the target before, at each of G times; `cheapest`, shape (m, G), are the rows of
    `cost` in rising order. `relative`, shape (G, 6), is the state of the target less that of the
    one before. `rows` is 3 for a flyby and 6 for a rendezvous.

    `best`, shape (m', G), has `ranks` rows in all, or `ranks` rows for each time of the target
    before: the lowest energies that come from different targets, or whose deciding times are more
    than `apart` steps apart. That is the time of the target before or, if it has rows for each,
    that of the one before it. `back`, shape (m', G, 4), has the target before, its time, its row,
    and the deciding time.
    """
    matrix = np.empty((SIX, SIX))
    error = np.empty(SIX)
    for leave in range(cost.shape[1]):
        for place in range(cost.shape[0]):
            row = cheapest[place, leave]
            spent = cost[row, leave]
            first = 0
            decided = leave
            if len(best) > ranks:
                first = leave * ranks
                decided = row // ranks
            for arrive in range(leave, best.shape[1]):
                # The energy never falls; it is infinite if there is no visit.
                if not spent < best[first + ranks - 1, arrive]:
                    continue
                write_leg(
                    mean[row, leave],
                    covariance[row, leave],
                    legs,
                    leave,
                    arrive,
                    relative[arrive],
                    rows,
                    matrix,
                    error,
                )
                factorise(matrix, rows)
                total = spent + half_square(matrix, error, rows)
                insert(
                    total,
                    before,
                    leave,
                    row,
                    decided,
                    first,
                    ranks,
                    apart,
                    best[:, arrive],
                    back[:, arrive],
                )


@compiled
def write_quadratics(
    mean: Floats,
    covariance: Floats,
    legs: Legs,
    relative: Floats,
    before: int,
    back: Shorts,
    new_mean: Floats,
    new_covariance: Floats,
) -> None:
    """Write m and P of the flybys that come from the target `before`; arrays as for `extend`, at a
    flyby.
    """
    matrix = np.empty((SIX, SIX))
    error = np.empty(SIX)
    for slot in range(back.shape[0]):
        for arrive in range(back.shape[1]):
            if back[slot, arrive, 0] != before:
                continue
            leave = back[slot, arrive, 1]
            row = back[slot, arrive, 2]
            write_leg(
                mean[row, leave],
                covariance[row, leave],
                legs,
                leave,
                arrive,
                relative[arrive],
                SIX,
                matrix,
                error,
            )
            # With L of the blocks (A, 0; B, C), m = -(e_V - B A^-1 e_r) and P = C C', in which
            # nothing cancels.
            factorise(matrix, SIX)
            half_square(matrix, error, 3)
            for axis in range(3):
                corrected = -error[3 + axis]
                for other in range(3):
                    corrected += matrix[3 + axis, other] * error[other]
                new_mean[slot, arrive, axis] = corrected
                for second in range(3):
                    product = 0.0
                    for other in range(min(axis, second) + 1):
                        product += matrix[3 + axis, 3 + other] * matrix[3 + second, 3 + other]
                    new_covariance[slot, arrive, axis, second] = product


@allocation_free
def insert(
    total: float,
    before: int,
    leave: int,
    row: int,
    decided: int,
    first: int,
    ranks: int,
    apart: int,
    best: Floats,
    back: Shorts,
) -> None:
    """Insert an energy among the `ranks` lowest, from row `first`; of those that are near to each
    other, keep one.
    """
    last = first + ranks - 1
    place = last
    for rank in range(first, last + 1):
        if (
            back[rank, 0] == before
            and abs(back[rank, 3] - decided) <= apart
            and best[rank] < np.inf
        ):
            place = rank
            break
    if not total < best[place]:
        return
    while place > first and total < best[place - 1]:
        best[place] = best[place - 1]
        for part in range(4):
            back[place, part] = back[place - 1, part]
        place -= 1
    best[place] = total
    back[place, 0] = before
    back[place, 1] = leave
    back[place, 2] = row
    back[place, 3] = decided


@allocation_free
def write_leg(
    mean: Floats,
    covariance: Floats,
    legs: Legs,
    leave: int,
    arrive: int,
    relative: Floats,
    rows: int,
    matrix: Floats,
    error: Floats,
) -> None:
    """Write the first `rows` of e = `relative` - Phi m and of the lower triangle of Phi P Phi' +
    G.
    """
    response = legs.response[leave % len(legs.response), arrive - leave]
    gramian = legs.gramian[leave % len(legs.gramian), arrive - leave]
    for first in range(rows):
        a = response[first, 0]
        b = response[first, 1]
        c = response[first, 2]
        error[first] = relative[first] - (a * mean[0] + b * mean[1] + c * mean[2])
        x = a * covariance[0, 0] + b * covariance[1, 0] + c * covariance[2, 0]
        y = a * covariance[0, 1] + b * covariance[1, 1] + c * covariance[2, 1]
        z = a * covariance[0, 2] + b * covariance[1, 2] + c * covariance[2, 2]
        for second in range(first + 1):
            product = x * response[second, 0] + y * response[second, 1] + z * response[second, 2]
            matrix[first, second] = product + gramian[first, second]


@allocation_free
def factorise(matrix: Floats, rows: int) -> None:
    """Replace the lower triangle of a positive definite matrix by that of its Cholesky factor."""
    for first in range(rows):
        for second in range(first + 1):
            value = matrix[first, second]
            for other in range(second):
                value -= matrix[first, other] * matrix[second, other]
            matrix[first, second] = (
                np.sqrt(value) if first == second else value / matrix[second, second]
            )


@allocation_free
def half_square(lower: Floats, error: Floats, rows: int) -> float:
    """Replace the first `rows` of e by L^-1 e, and return 1/2 e' (L L')^-1 e of them."""
    total = 0.0
    for first in range(rows):
        value = error[first]
        for other in range(first):
            value -= lower[first, other] * error[other]
        value /= lower[first, first]
        error[first] = value
        total += value * value
    return 0.5 * total
