"""The engine: limits of its impulses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import Annotated

import numpy as np

from infoset.arrays import Floats, some
from infoset.limits import POSITIVE, Limits, NotNegative, Part, Positive, check_fields

_DELAY = Limits(minimum=0, maximum=100_000, whole=True)  # a flight has no more steps
MIN_FLOAT = float(np.finfo(np.float64).smallest_subnormal)
STEP_TOLERANCE = 1e-9
"""Part of a step by which a time may be after a step and still belong to it, for times that are rounded decimals."""


@dataclass(frozen=True)
class Thruster:
    """An engine that gives impulses across x, limited in size and in their sum.

    Parameters
    ----------
    budget_m_s : float
        Budget mu: maximum sum of the moduli of all impulses, m/s.
    min_impulse_m_s, max_impulse_m_s : float
        Bounds mu1 and mu2 of the modulus of an impulse that is not zero, m/s.
    execution_error_relative : float
        Bound delta of |given / commanded - 1|: a commanded impulse k is executed as k (1 + error).
    pointing_error_rad : float
        Bound psi of the angle between the given and the commanded impulse, across the x axis. For space only.
    last_impulse_s : float or None
        Time before the nominal arrival after which no impulse is given, s (cut-off); None is no cut-off.
    impulses_s : tuple of float
        Times before the nominal arrival at which impulses can be given, s, decreasing; an impulse is given at the step
        at that time or just before it. Without times, impulses can be given at every step.
    delay_steps : int
        Number of steps from the decision to the impulse. The budget is reserved at the decision.

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits, mu1 exceeds mu2, or the times do not decrease.

    References
    ----------
    Kumkov and Patsko (1997), equation (3).
    """

    budget_m_s: NotNegative
    min_impulse_m_s: NotNegative
    max_impulse_m_s: Positive
    execution_error_relative: Part = 0.0
    pointing_error_rad: Part = 0.0
    last_impulse_s: NotNegative | None = None
    impulses_s: Annotated[tuple[float, ...], POSITIVE] = ()
    delay_steps: Annotated[int, _DELAY] = 0

    def __post_init__(self) -> None:
        check_fields(self)
        if self.min_impulse_m_s > self.max_impulse_m_s:
            raise ValueError(
                f"Thruster: min_impulse_m_s must not exceed max_impulse_m_s, {self.max_impulse_m_s:g}: "
                f"got {self.min_impulse_m_s!r}"
            )
        for time_s, next_s in pairwise(self.impulses_s):
            if next_s >= time_s:
                raise ValueError(
                    f"Thruster: impulses_s, times before the arrival, must decrease: got {next_s!r} after {time_s!r}"
                )

    def impulse_steps(self, arrival_s: float, step_s: float) -> Sequence[int] | None:
        """Return the steps in which impulses can be given, increasing; None is every step from `delay_steps`.

        Parameters
        ----------
        arrival_s, step_s : float
            Time from the start to the nominal arrival, and length of a step.

        Raises
        ------
        ValueError
            If there is no such step, or one of `impulses_s` is before the first step in which an impulse can be given,
            or in the same step as the one before it. The message names the key to change.
        """
        if self.last_impulse_s is None and not self.impulses_s:
            return None
        times_s = (*self.impulses_s, self.last_impulse_s or 0.0)
        *of_times, last = (math.floor((arrival_s - time_s) / step_s + STEP_TOLERANCE) for time_s in times_s)
        first = f"the first impulse can be given {arrival_s - self.delay_steps * step_s:g} s before the nominal arrival"
        for i, step in enumerate(of_times):
            if step < self.delay_steps:
                raise ValueError(
                    f"thruster.impulses_s: {first}; give later times or fewer delay_steps: got {self.impulses_s[i]!r}"
                )
            if i > 0 and step == of_times[i - 1]:
                raise ValueError(
                    f"thruster.impulses_s: two impulses in one step of {step_s:g} s: got {self.impulses_s[i - 1]!r} "
                    f"and {self.impulses_s[i]!r}"
                )
        steps = [step for step in of_times if step <= last] if of_times else range(self.delay_steps, last + 1)
        if not steps:
            raise ValueError(f"thruster.last_impulse_s excludes all impulses: {first}: got {self.last_impulse_s!r}")
        return steps

    def give(self, wanted_m_s: Floats, budget_left_m_s: Floats) -> Floats:
        """Return the impulses that the engine gives, m/s.

        Zero if |wanted| < mu1 or n < mu1, otherwise `wanted` with its modulus limited to min(mu2, n).

        Parameters
        ----------
        wanted_m_s : ndarray, shape (C, B)
            Impulses of the strategy.
        budget_left_m_s : ndarray, shape (B,)
            Budget n that is left.
        """
        size, limit = modulus(wanted_m_s), np.minimum(self.max_impulse_m_s, budget_left_m_s)
        given, over = wanted_m_s, size > limit
        if some(over):
            given = np.where(over, wanted_m_s / np.maximum(size, MIN_FLOAT) * limit, wanted_m_s)
            # Rounding must not make the modulus greater than the limit.
            while some(above := modulus(given) > limit):
                given = np.where(above, np.nextafter(given, 0.0), given)
        idle = (size < self.min_impulse_m_s) | (budget_left_m_s < self.min_impulse_m_s)
        return np.where(idle, 0.0, given)

    def executed(self, impulse_m_s: Floats, size: Floats | None, direction: Floats | None) -> Floats:
        """Return impulses as they are executed, m/s.

        Parameters
        ----------
        impulse_m_s : ndarray, shape (C, B)
            Commanded impulses.
        size, direction : ndarray, shape (B,), or None
            Errors of the modulus, and of the direction from y toward z, in units of their bounds; None is zero.
        """
        if size is not None:
            impulse_m_s = impulse_m_s * (1.0 + self.execution_error_relative * size)
        if direction is not None:
            sine, cosine = (turn(self.pointing_error_rad * direction) for turn in (np.sin, np.cos))
            y, z = impulse_m_s  # only impulses in space have an error of the direction
            impulse_m_s = np.stack([cosine * y - sine * z, cosine * z + sine * y])
        return impulse_m_s


def modulus(lateral: Floats) -> Floats:
    """Return the moduli, shape (B,), of lateral values of shape (C, B)."""
    return reduce(np.hypot, np.abs(lateral))
