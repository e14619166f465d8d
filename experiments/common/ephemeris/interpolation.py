"""Interpolation of a table of states by the polynomials of Hermite and Lagrange."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np

from infoset.arrays import Floats

METHODS = ("HERMITE", "LAGRANGE", "LINEAR")
DEFAULT_DEGREE = 7
"""Degree for tables that name none; tables of orbits have degrees of 5 to 9."""
MAX_DEGREE = 20
"""Largest degree: near the ends of a table an error of the states grows by about two to the power
of the degree. Chosen: a rounding of 1 mm then becomes 1 km.
"""
SPACING = Fraction(1, 2)
"""Smallest distance of two states of a polynomial in units of the interval that contains the epoch.

Where a step of 600 s changes to one of a day, eight consecutive states amplify a rounding of 1 mm
to 10 000 km. Chosen: equal steps have the distance 1, so that states near a small change of
the step are not left out.
"""
GAP = 20
"""An interval of more than this number of times the longer of the two neighbouring steps is a gap,
and the states in it are not known. A table of two states has no gap. Chosen: steps that adapt to
the motion change less from one to the next.
"""


class Interpolated(NamedTuple):
    """A state at an epoch from a table.

    Parameters
    ----------
    state : array of shape (2, 3)
        Position and velocity.
    method : str
        HERMITE, LAGRANGE, LINEAR, or TABULATED: the epoch is in the table.
    degree : int
        The number of states used, less one.
    error : array of shape (2,)
        Estimated error of position and velocity (`interpolate`).
    nearest : array of shape (2, 3)
        The tabulated state nearest in time.
    nearest_s : float
        Time from this state to the epoch, s.
    """

    state: Floats
    method: str
    degree: int
    error: Floats
    nearest: Floats
    nearest_s: float


def interpolate(
    epoch: Fraction,
    times: Sequence[Fraction],
    states: Floats,
    method: str,
    degree: int,
    drift_s: Callable[[Fraction], float],
) -> Interpolated:
    """Return the state of a table at an epoch.

    Parameters
    ----------
    epoch, times : Fraction
        Seconds in one scale without leaps. The times increase, each is there once.
    states : array of shape (N, 2, 3)
        Positions and velocities.
    method, degree : str, int
        One of `METHODS`; degree + 1 states are used, or fewer if the table has no more.
    drift_s : callable
        Function of a time; the velocities are derivatives with respect to the time plus its value,
        s.

    Raises
    ------
    ValueError
        If the epoch is outside the table or in a gap.

    Notes
    -----
    The states are the next ones on both sides of the epoch, as far as the ends of the table allow.
    Where the step becomes shorter, some are left out (`SPACING`). The error is estimated by the
    same polynomial without the state that is farthest in time, and for two states by the polynomial
    of the other method.
    """
    after = bisect_right(times, epoch)
    if after and times[after - 1] == epoch:
        tabulated = states[after - 1]
        return Interpolated(tabulated, "TABULATED", 0, np.zeros(2), tabulated, 0.0)
    if not 0 < after < len(times):
        raise ValueError("the epoch is outside the table of states")

    _check_gap(times, after)

    window = _window(times, after, degree + 1)
    drift_at_epoch_s = drift_s(epoch)
    relative_s = np.array(
        [float(times[row] - epoch) + (drift_s(times[row]) - drift_at_epoch_s) for row in window]
    )
    used = states[window]
    polynomial, other_polynomial = lagrange, hermite
    if method == "HERMITE":
        polynomial, other_polynomial = hermite, lagrange
    state = polynomial(relative_s, used)
    if len(used) > 2:
        farthest = np.argmax(np.abs(relative_s))
        other = polynomial(np.delete(relative_s, farthest), np.delete(used, farthest, axis=0))
    else:
        other = other_polynomial(relative_s, used)

    nearest = int(np.argmin(np.abs(relative_s)))
    return Interpolated(
        state=state,
        method=method,
        degree=len(relative_s) - 1,
        error=np.linalg.norm(state - other, axis=1),
        nearest=used[nearest],
        nearest_s=-float(relative_s[nearest]),
    )


def lagrange(times_s: Floats, states: Floats) -> Floats:
    """Return the value at time zero of Lagrange's polynomials, shape (2, 3).

    The polynomials of the positions and of the velocities are independent. The weight of state i is
    the product of t_j / (t_j - t_i) over all other states j; no time is zero.
    """
    weights, _, _ = _basis(times_s)
    base = states[np.argmin(np.abs(times_s))]
    # The weights have the sum one: differences from one state have smaller rounding errors.
    return np.asarray(base + np.tensordot(weights, states - base, axes=1))


def hermite(times_s: Floats, states: Floats) -> Floats:
    """Return the value and derivative at time zero of Hermite's polynomials, shape (2, 3).

    The polynomial has the positions and velocities of all states; the velocity is its derivative.

    Notes
    -----
    With Lagrange's weights L_i, D_i = sum 1 / (t_i - t_j) and G_i = -sum 1 / t_j over all other
    states j, the position is the sum of (1 + 2 t_i D_i) L_i^2 r_i - t_i L_i^2 v_i, and the velocity
    the sum of its derivatives.
    """
    weights, slopes, growth = _basis(times_s)
    squares = weights**2
    of_position = (1.0 + 2.0 * times_s * slopes) * squares
    of_velocity = -times_s * squares
    rate_of_position = 2.0 * squares * (growth * (1.0 + 2.0 * times_s * slopes) - slopes)
    rate_of_velocity = squares * (1.0 - 2.0 * times_s * growth)

    base = states[np.argmin(np.abs(times_s))]
    positions = states[:, 0] - base[0]
    velocities = states[:, 1]
    position = base[0] + of_position @ positions + of_velocity @ velocities
    velocity = rate_of_position @ positions + rate_of_velocity @ velocities
    return np.stack([position, velocity])


def _basis(times_s: Floats) -> tuple[Floats, Floats, Floats]:
    """Return Lagrange's weights at time zero, and the sums D_i and G_i, each of shape (n,).

    The sums are defined in `hermite`. The times are different, and none is zero.
    """
    differences = times_s[:, None] - times_s
    np.fill_diagonal(differences, 1.0)
    ratios = -times_s / differences
    np.fill_diagonal(ratios, 1.0)
    inverse = 1.0 / differences
    np.fill_diagonal(inverse, 0.0)
    growth = 1.0 / times_s - np.sum(1.0 / times_s)
    return ratios.prod(axis=1), inverse.sum(axis=1), growth


def _window(times: Sequence[Fraction], after: int, wanted: int) -> list[int]:
    """Return rows of states around the interval that ends at row `after`, in order of time.

    There are up to `wanted` rows, at least two. Neighbours are `SPACING` intervals apart or more.
    """
    apart = SPACING * (times[after] - times[after - 1])
    before = [after - 1]
    while len(before) < wanted:
        row = bisect_right(times, times[before[-1]] - apart) - 1
        if row < 0:
            break
        before.append(row)

    behind = [after]
    while len(behind) < wanted:
        row = bisect_left(times, times[behind[-1]] + apart)
        if row == len(times):
            break
        behind.append(row)

    # Half of them on each side, of an odd number one more behind; where a side has fewer, the other
    # one has more.
    count = min(max(wanted // 2, wanted - len(behind)), len(before))
    return [*reversed(before[:count]), *behind[: wanted - count]]


def _check_gap(times: Sequence[Fraction], after: int) -> None:
    """Raise a ValueError if the interval that ends at row `after` is a gap."""
    step = times[after] - times[after - 1]
    # A step is named by the row at its end.
    neighbours = [
        times[row] - times[row - 1] for row in (after - 1, after + 1) if 0 < row < len(times)
    ]
    if neighbours and step > GAP * max(neighbours):
        raise ValueError(
            f"the epoch is in a gap of {float(step):.6g} s, {float(step / max(neighbours)):.3g} "
            f"times the steps beside it (at most {GAP}); give a table with states there"
        )
