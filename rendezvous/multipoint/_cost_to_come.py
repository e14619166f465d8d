"""Compiled recursion for the least energy to come to a target, leg by leg on a grid of times.

A leg from one target to the next takes the chaser's state x = (r, V) relative to the coasting
target to Phi x, and the energy 1/2 e' G^-1 e adds e, with G the Gramian. The least energy with
which the chaser passes a target at velocity V relative to it is therefore quadratic, c + 1/2 (V -
m)' P^-1 (V - m). Mean m and covariance P follow a Kalman filter whose process noise has the
covariance G and whose measurement is an exact position. At a rendezvous V = 0, and c alone remains.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Floats, Places, Shorts
from infoset.rendezvous._compile import allocation_free, compiled

SIX = 6
"""Number of components of a state: position and velocity."""
TARGET, TIME, ROW, DECIDED = 0, 1, 2, 3
"""Columns of `CostToCome.back`."""


class Legs(NamedTuple):
    """Legs on a grid of G times, from departure i to arrival i + l.

    Arrival i is later than departure i by the minimum gap, so that l = 0 is a leg of this length.
    The arrays have one row if the legs depend on l alone, or a row for each i.
    """

    response: Floats
    """Phi's half of velocities, shape (1 or G, G, 6, 3)."""
    gramian: Floats
    """Gramian, shape (1 or G, G, 6, 6)."""


class CostToCome(NamedTuple):
    """Least energies of the visits of one target at each of G times, in m rows.

    Each is the quadratic c + 1/2 (V - m)' P^-1 (V - m) of the velocity V relative to the target.
    After a rendezvous m and P are zero: V = 0 is the only velocity.
    """

    cost: Floats
    """c, shape (m, G); infinite if there is no visit."""
    mean: Floats
    """m, shape (m, G, 3)."""
    covariance: Floats
    """P, shape (m, G, 3, 3)."""
    back: Shorts
    """The visit before, shape (m, G, 4), in columns TARGET, TIME, ROW and DECIDED.

    If there is no visit, TARGET is none of the numbers of targets and of the start.
    """


class Kept(NamedTuple):
    """Number and difference of the ways that are kept for one time, see `extend`."""

    ranks: int
    apart: int


class Origin(NamedTuple):
    """The visit from which another comes; members in the order of the columns of `back`."""

    target: int
    time: int
    row: int
    decided: int
    """Number of the deciding time, see `extend`."""


@compiled
def extend(
    earlier: CostToCome,
    cheapest: Places,
    legs: Legs,
    relative: Floats,
    before: int,
    rows: int,
    kept: Kept,
    visits: CostToCome,
) -> None:
    """Lower the least energies of visits of a target by the ways over the target `before`.

    `earlier` are the visits of the target before, and `cheapest`, shape (m, G), the rows of their
    cost in rising order. `relative`, shape (G, 6), is the state of the target less the state of the
    one before. `rows` is 3 for a flyby and 6 for a rendezvous.

    Only `cost` and `back` of `visits` are changed. They have `kept.ranks` rows in all, or as many
    rows for each time of the target before: the lowest energies that come from different targets,
    or whose deciding times are more than `kept.apart` steps apart. They rise from row to row. The
    deciding time is the time of the target before or, if `visits` have rows for each of these
    times, the time of the target before that, which is zero if `earlier` has no such rows.
    """
    matrix = np.empty((SIX, SIX))
    error = np.empty(rows)
    ranks = kept.ranks
    best = visits.cost
    for leave in range(earlier.cost.shape[1]):
        for place in range(earlier.cost.shape[0]):
            row = cheapest[place, leave]
            spent = earlier.cost[row, leave]
            first = 0
            decided = leave
            # `visits` have rows for each time of the target before: those of `leave` are changed.
            if len(best) > ranks:
                first = leave * ranks
                decided = row // ranks
            origin = Origin(before, leave, row, decided)

            for arrive in range(leave, best.shape[1]):
                # No leg lowers the energy, which is infinite if there is no visit.
                if not spent < best[first + ranks - 1, arrive]:
                    continue
                write_leg(
                    earlier.mean[row, leave],
                    earlier.covariance[row, leave],
                    legs,
                    leave,
                    arrive,
                    relative[arrive],
                    matrix,
                    error,
                )
                factorise(matrix, rows)
                total = spent + half_square(matrix, error, rows)
                insert(total, origin, first, kept, best[:, arrive], visits.back[:, arrive])


@compiled
def write_quadratics(
    earlier: CostToCome, legs: Legs, relative: Floats, before: int, visits: CostToCome
) -> None:
    """Write m and P of the flybys that come from the target `before`; arguments as for `extend`.

    It is called after `extend` for all targets before: `visits.back` must be final.
    """
    matrix = np.empty((SIX, SIX))
    error = np.empty(SIX)
    back = visits.back
    for slot in range(back.shape[0]):
        for arrive in range(back.shape[1]):
            if back[slot, arrive, TARGET] != before:
                continue
            leave = back[slot, arrive, TIME]
            row = back[slot, arrive, ROW]
            write_leg(
                earlier.mean[row, leave],
                earlier.covariance[row, leave],
                legs,
                leave,
                arrive,
                relative[arrive],
                matrix,
                error,
            )

            # With L of the blocks (A, 0; B, C), m = -(e_V - B A^-1 e_r) and P = C C', in which
            # nothing cancels. `half_square` replaces e_r by A^-1 e_r; C is lower triangular.
            factorise(matrix, SIX)
            half_square(matrix, error, 3)
            for axis in range(3):
                corrected = -error[3 + axis]
                for other in range(3):
                    corrected += matrix[3 + axis, other] * error[other]
                visits.mean[slot, arrive, axis] = corrected
                for second in range(3):
                    product = 0.0
                    for other in range(min(axis, second) + 1):
                        product += matrix[3 + axis, 3 + other] * matrix[3 + second, 3 + other]
                    visits.covariance[slot, arrive, axis, second] = product


@allocation_free
def insert(
    total: float, origin: Origin, first: int, kept: Kept, best: Floats, back: Shorts
) -> None:
    """Insert an energy, with the visit it comes from, among the lowest, from row `first` on.

    Of energies that come from the same target at near deciding times, only the lowest is kept. The
    `kept.ranks` energies rise from row to row; the greatest is dropped if another is inserted.
    """
    last = first + kept.ranks - 1
    # The row to replace: that of a near way or, without one, that of the greatest energy.
    place = last
    for rank in range(first, last + 1):
        if (
            back[rank, TARGET] == origin.target
            and abs(back[rank, DECIDED] - origin.decided) <= kept.apart
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
    back[place, TARGET] = origin.target
    back[place, TIME] = origin.time
    back[place, ROW] = origin.row
    back[place, DECIDED] = origin.decided


@allocation_free
def write_leg(
    mean: Floats,
    covariance: Floats,
    legs: Legs,
    leave: int,
    arrive: int,
    relative: Floats,
    matrix: Floats,
    error: Floats,
) -> None:
    """Write the rows of e = `relative` - Phi m, and of the lower triangle of Phi P Phi' + G.

    Phi is here its half of velocities. The number of rows is the length of `error`; the upper
    triangle of `matrix` is not written.
    """
    response = legs.response[leave % len(legs.response), arrive - leave]
    gramian = legs.gramian[leave % len(legs.gramian), arrive - leave]
    for first in range(len(error)):
        a = response[first, 0]
        b = response[first, 1]
        c = response[first, 2]
        error[first] = relative[first] - (a * mean[0] + b * mean[1] + c * mean[2])

        # A row of Phi P.
        x = a * covariance[0, 0] + b * covariance[1, 0] + c * covariance[2, 0]
        y = a * covariance[0, 1] + b * covariance[1, 1] + c * covariance[2, 1]
        z = a * covariance[0, 2] + b * covariance[1, 2] + c * covariance[2, 2]
        for second in range(first + 1):
            product = x * response[second, 0] + y * response[second, 1] + z * response[second, 2]
            matrix[first, second] = product + gramian[first, second]


@allocation_free
def factorise(matrix: Floats, rows: int) -> None:
    """Replace the lower triangle of a positive definite matrix by its Cholesky factor.

    Only the first `rows` rows and columns count, and only their lower triangle is read.
    """
    for first in range(rows):
        for second in range(first + 1):
            value = matrix[first, second]
            for other in range(second):
                value -= matrix[first, other] * matrix[second, other]
            if first == second:
                matrix[first, second] = np.sqrt(value)
            else:
                matrix[first, second] = value / matrix[second, second]


@allocation_free
def half_square(lower: Floats, error: Floats, rows: int) -> float:
    """Replace the first `rows` of e by those of L^-1 e, and return 1/2 e' (L L')^-1 e."""
    total = 0.0
    for first in range(rows):
        value = error[first]
        for other in range(first):
            value -= lower[first, other] * error[other]
        value /= lower[first, first]
        error[first] = value
        total += value * value
    return 0.5 * total
