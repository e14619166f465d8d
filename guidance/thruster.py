"""The engine: limits of its impulses."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from infoset.limits import ADDED_LATER, NotNegative, Part, Positive, check_fields


@dataclass(frozen=True)
class Thruster:
    """An engine that gives impulses along z, limited in size and in their sum.

    Parameters
    ----------
    budget_m_s : float
        Budget mu: greatest sum of the absolute values of all impulses, m/s.
    least_impulse_m_s, greatest_impulse_m_s : float
        Bounds mu1 and mu2 of the absolute value of an impulse that is not zero, m/s.
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

    def give(self, wanted_m_s: NDArray[np.float64], budget_left_m_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the impulses that the engine gives, m/s.

        Zero if |wanted| < mu1 or n < mu1, otherwise `wanted` with its absolute value limited to min(mu2, n).

        Parameters
        ----------
        wanted_m_s, budget_left_m_s : ndarray, shape (B,)
            Impulses of the strategy (signed), and the budget n that is left.
        """
        size = np.abs(wanted_m_s)
        limited = np.copysign(np.minimum(size, np.minimum(self.greatest_impulse_m_s, budget_left_m_s)), wanted_m_s)
        idle = (size < self.least_impulse_m_s) | (budget_left_m_s < self.least_impulse_m_s)
        return np.where(idle, 0.0, limited)
