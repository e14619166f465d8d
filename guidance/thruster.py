"""The engine: limits of its impulses."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from infoset.limits import ADDED_LATER, NotNegative, Part, Positive, check_fields

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Thruster:
    """An engine that gives impulses across x, along z in a plane, limited in size and in their sum.

    Parameters
    ----------
    budget_m_s : float
        Budget mu: greatest sum of the moduli of all impulses, m/s.
    least_impulse_m_s, greatest_impulse_m_s : float
        Bounds mu1 and mu2 of the modulus of an impulse that is not zero, m/s.
    execution_error_relative : float
        Bound delta of |given / commanded - 1|: a commanded impulse k is executed as k (1 + error).
    pointing_error_rad : float
        Bound psi of the angle between the given and the commanded impulse, across the x axis. For space only.

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits, or mu1 exceeds mu2.

    References
    ----------
    Kumkov and Patsko (1997), equation (3).
    """

    budget_m_s: NotNegative
    least_impulse_m_s: NotNegative
    greatest_impulse_m_s: Positive
    execution_error_relative: Part = 0.0
    pointing_error_rad: Part = field(default=0.0, metadata=ADDED_LATER)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.least_impulse_m_s > self.greatest_impulse_m_s:
            raise ValueError(
                f"Thruster: least_impulse_m_s must not exceed greatest_impulse_m_s, {self.greatest_impulse_m_s:g}: "
                f"got {self.least_impulse_m_s!r}"
            )

    def give(self, wanted_m_s: Floats, budget_left_m_s: Floats) -> Floats:
        """Return the impulses that the engine gives, m/s.

        Zero if |wanted| < mu1 or n < mu1, otherwise `wanted` with its modulus limited to min(mu2, n).

        Parameters
        ----------
        wanted_m_s : ndarray, shape (B,), or (2, B) in space
            Impulses of the strategy: signed, or (y, z).
        budget_left_m_s : ndarray, shape (B,)
            Budget n that is left.
        """
        size, limit = modulus(wanted_m_s), np.minimum(self.greatest_impulse_m_s, budget_left_m_s)
        given, over = wanted_m_s, size > limit
        if over.any():
            given = np.where(over, wanted_m_s / np.where(over, size, 1.0) * limit, wanted_m_s)
            # Rounding must not make the modulus greater than the limit.
            while (above := modulus(given) > limit).any():
                given = np.where(above, np.nextafter(given, 0.0), given)
        idle = (size < self.least_impulse_m_s) | (budget_left_m_s < self.least_impulse_m_s)
        return np.where(idle, 0.0, given)

    def executed(self, impulse_m_s: Floats, size: Floats | None, direction: Floats | None) -> Floats:
        """Return impulses as they are executed, m/s.

        Parameters
        ----------
        impulse_m_s : ndarray, shape (B,), or (2, B) in space
            Commanded impulses.
        size, direction : ndarray, shape (B,), or None
            Errors of the modulus, and of the direction from y toward z, in units of their bounds; None is zero.
        """
        if size is not None:
            impulse_m_s = impulse_m_s * (1.0 + self.execution_error_relative * size)
        if direction is not None:
            sine, cosine = (turn(self.pointing_error_rad * direction) for turn in (np.sin, np.cos))
            y, z = impulse_m_s
            impulse_m_s = np.stack([cosine * y - sine * z, cosine * z + sine * y])
        return impulse_m_s


def modulus(lateral: Floats) -> Floats:
    """Return the moduli, shape (B,), of lateral values of shape (B,) in a plane or (2, B) in space."""
    return np.abs(lateral) if lateral.ndim == 1 else np.hypot(*lateral)
