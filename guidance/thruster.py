"""What the engine can do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoset.limits import NotNegative, Part, Positive, check_fields


@dataclass(frozen=True)
class Thruster:
    """An engine that gives impulses along z of bounded size from a bounded budget.

    Parameters
    ----------
    budget_m_s : float
        Sum mu of the moduli of all impulses, m/s.
    least_impulse_m_s, greatest_impulse_m_s : float
        Bounds mu1 and mu2 of the modulus of one impulse that is not zero, m/s.
    execution_error_relative : float
        Bound delta of |given / commanded - 1|: an impulse k comes out as k (1 + error).

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

    def __post_init__(self) -> None:
        check_fields(self)
        if self.least_impulse_m_s > self.greatest_impulse_m_s:
            raise ValueError(
                f"Thruster: least_impulse_m_s must not exceed greatest_impulse_m_s, {self.greatest_impulse_m_s:g}: "
                f"got {self.least_impulse_m_s!r}"
            )

    def give(self, wanted_m_s: NDArray[np.float64], budget_left_m_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Impulses that the engine gives when a strategy wants these.

        Parameters
        ----------
        wanted_m_s, budget_left_m_s : ndarray, shape (B,)
            Wanted impulses (signed) and what is left of the budget n, m/s.

        Returns
        -------
        ndarray, shape (B,)
            Zero if |wanted| < mu1 or n < mu1, else `wanted` limited in modulus to min(mu2, n), m/s.
        """
        size = np.abs(wanted_m_s)
        limited = np.copysign(np.minimum(size, np.minimum(self.greatest_impulse_m_s, budget_left_m_s)), wanted_m_s)
        idle = (size < self.least_impulse_m_s) | (budget_left_m_s < self.least_impulse_m_s)
        return np.where(idle, 0.0, limited)
