"""The engine: limits of its impulses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from functools import reduce
from itertools import pairwise
from typing import Annotated, TypeVar

import numpy as np

from infoset.arrays import Floats, some
from infoset.clock import STEP_ROUNDING, steps_between
from infoset.limits import MAXIMUM, POSITIVE, Limits, NotNegative, Part, Positive, check_fields
from infoset.model import LONGEST_BURN

FloatOrFloats = TypeVar("FloatOrFloats", float, Floats)

MAX_IMPULSES = 100_000
"""Maximum number of impulses that a period gives: a flight has no more steps."""
_DELAY = Limits(minimum=0, maximum=MAX_IMPULSES, whole=True)
"""Limits of a delay in steps: at most as many as a flight has."""
MIN_FLOAT = float(np.finfo(np.float64).smallest_subnormal)
"""Minimum divisor of an impulse: the modulus of an impulse that is not zero is not less."""
_DIGITS = 4
"""Number of digits of the values that a message advises; chosen: enough to type."""


@dataclass(frozen=True)
class Thruster:
    """An engine that gives impulses across x, limited in size and in their sum.

    Parameters
    ----------
    budget_m_s : float
        Budget mu: maximum sum of the moduli of all impulses, m/s.
    min_impulse_m_s, max_impulse_m_s : float
        Bounds mu1 and mu2 of the modulus of an impulse that is not zero, m/s. With a thrust, the
        default mu2 is the impulse of a burn that lasts one step at most (`limited_to`).
    execution_error_relative : float
        Bound delta of |given / commanded - 1|: a commanded impulse k is executed as k (1 + error).
    pointing_error_rad : float
        Bound psi of the angle between the given and the commanded impulse, across the x axis. For
        space only.
    last_impulse_s : float or None
        Time before the nominal arrival after which no impulse is given, s (cut-off); None is no
        cut-off.
    impulses_s : tuple of float
        Times before the nominal arrival at which impulses can be given, s, decreasing. Without
        times and period, impulses can be given at every step.
    impulse_period_s : float or None
        Time between two impulses, s, counted back from `last_impulse_s`: the same as a list of
        these times in `impulses_s`. At least a step.
    first_impulse_s : float or None
        Time before the nominal arrival from which impulses can be given, s; with a period, the
        impulse nearest to it is the first one. None is the first possible step.
    delay_steps : int
        Number of steps from the decision to the impulse. The budget is reserved at the decision.
    thrust_N, mass_kg : float or None
        Thrust F and mass m of the spacecraft, both or neither. With them an impulse is a burn of
        constant acceleration F / m that starts at its step. Its error of size is one of duration.
        The decrease of the mass is neglected. None: impulses are instantaneous.

    Raises
    ------
    TypeError, ValueError
        If a value is not a number within its limits, mu1 exceeds mu2, the times do not decrease,
        two of the keys of times contradict each other, only one of thrust and mass is given, or
        there is neither a thrust nor a maximum impulse.

    Notes
    -----
    A time before the nominal arrival means the nearest step (`infoset.clock.steps_between`).

    References
    ----------
    Kumkov and Patsko (1997), equation (3).
    """

    budget_m_s: NotNegative
    min_impulse_m_s: NotNegative
    max_impulse_m_s: Positive = MAXIMUM
    execution_error_relative: Part = 0.0
    pointing_error_rad: Part = 0.0
    last_impulse_s: NotNegative | None = None
    impulses_s: Annotated[tuple[float, ...], POSITIVE] = ()
    impulse_period_s: Positive | None = None
    first_impulse_s: Positive | None = None
    delay_steps: Annotated[int, _DELAY] = 0
    thrust_N: Positive | None = None  # noqa: N815 - a key ends with its unit
    mass_kg: Positive | None = None

    def __post_init__(self) -> None:
        check_fields(self)
        self._check_burns()
        if self.min_impulse_m_s > self.max_impulse_m_s:
            raise ValueError(
                "Thruster: min_impulse_m_s must not exceed max_impulse_m_s, "
                f"{self.max_impulse_m_s:g}: got {self.min_impulse_m_s!r}"
            )
        for time_s, next_s in pairwise(self.impulses_s):
            if next_s >= time_s:
                raise ValueError(
                    "Thruster: impulses_s, times before the arrival, must decrease: got "
                    f"{next_s!r} after {time_s!r}"
                )
        self._check_period()

    def _check_burns(self) -> None:
        """Refuse a thrust without a mass, and an engine without a maximum impulse."""
        if (self.thrust_N is None) != (self.mass_kg is None):
            missing = "thrust_N" if self.thrust_N is None else "mass_kg"
            raise ValueError(
                f"Thruster: thrust_N and mass_kg must both be set, or neither: {missing} is missing"
            )
        if self.thrust_N is None and self.max_impulse_m_s == MAXIMUM:
            raise ValueError(
                "Thruster: max_impulse_m_s is missing: set it, or set thrust_N and mass_kg, from "
                "which it follows"
            )

    def _check_period(self) -> None:
        """Refuse a period or a first impulse that other times contradict."""
        for name in ("impulse_period_s", "first_impulse_s"):
            if self.impulses_s and getattr(self, name) is not None:
                raise ValueError(
                    f"Thruster: {name} and impulses_s exclude each other, because impulses_s has "
                    f"the times of all impulses: leave one of them out: got {getattr(self, name)!r}"
                )
        if self.impulse_period_s is not None and self.last_impulse_s is None:
            raise ValueError(
                "Thruster: impulse_period_s is counted back from last_impulse_s: set "
                "last_impulse_s, the time of the last impulse before the arrival: got "
                f"{self.impulse_period_s!r}"
            )
        if self.first_impulse_s is not None and self.first_impulse_s < (self.last_impulse_s or 0.0):
            raise ValueError(
                "Thruster: first_impulse_s must be at least last_impulse_s, because both are "
                f"times before the arrival: got {self.first_impulse_s!r} and "
                f"{self.last_impulse_s!r}"
            )

    @property
    def acceleration_m_s2(self) -> float | None:
        """Acceleration F / m of a burn, m/s^2; None for instantaneous impulses."""
        if self.thrust_N is None or self.mass_kg is None:
            return None
        return self.thrust_N / self.mass_kg

    @property
    def longest_burn_s(self) -> float:
        """Duration of the maximum impulse, with its error of size, s."""
        return self.burn_s(self.max_impulse_m_s * (1.0 + self.execution_error_relative))

    def burn_s(self, size_m_s: FloatOrFloats) -> FloatOrFloats:
        """Return the durations of burns with impulses of a modulus, s; zero without a thrust."""
        if self.acceleration_m_s2 is None:
            return 0.0 * size_m_s
        return size_m_s / self.acceleration_m_s2

    def as_burns(self, impulse_m_s: Floats, to_go_s: float) -> Floats:
        """Return the burns that change the miss as much as instantaneous impulses, m/s.

        A burn u with the acceleration a changes the miss by u (tau - u / (2 a)), at the time to go
        tau of its start, which grows with u until the burn lasts until the arrival. An impulse that
        no burn replaces is doubled, so that its burn would last longer than until the arrival; the
        limits of the engine are applied later (`give`).

        Parameters
        ----------
        impulse_m_s : ndarray, shape (C, B)
            Instantaneous impulses.
        to_go_s : float
            Time from the impulse to the nominal arrival, s. If it is not positive, the impulses are
            returned unchanged.
        """
        if self.acceleration_m_s2 is None or to_go_s <= 0.0:
            return impulse_m_s
        # With the modulus k of an impulse, u tau - u^2 / (2 a) = k tau: its smaller root, without
        # cancellation. If it has no real root, the maximum of 0 makes it 2 k.
        share = 2.0 * self.burn_s(modulus(impulse_m_s)) / to_go_s
        return np.asarray(impulse_m_s * (2.0 / (1.0 + np.sqrt(np.maximum(1.0 - share, 0.0)))))

    def limited_to(self, step_s: float) -> Thruster:
        """Return the engine with a maximum impulse whose burn ends within a step.

        Raises
        ------
        ValueError
            If the maximum impulse is given, and its burn may be longer than a step; or if it is not
            given, and the minimum impulse exceeds the impulse of a burn of one step.
        """
        acceleration_m_s2 = self.acceleration_m_s2
        if acceleration_m_s2 is None:
            return self
        most_m_s = acceleration_m_s2 * step_s / (1.0 + self.execution_error_relative)
        if self.max_impulse_m_s == MAXIMUM:
            return replace(self, max_impulse_m_s=most_m_s)
        if self.longest_burn_s <= LONGEST_BURN * step_s:
            return self
        # Rounded to the side on which the check above is passed, which allows for `LONGEST_BURN`.
        shortest_s = _rounded(self.longest_burn_s / LONGEST_BURN, ROUND_CEILING)
        greatest_m_s = _rounded(LONGEST_BURN * most_m_s, ROUND_FLOOR)
        raise ValueError(
            "thruster.max_impulse_m_s: a burn must end before the next step: a burn "
            f"of {self.max_impulse_m_s:g} m/s lasts up to {self.longest_burn_s:.4g} s, a step "
            f"{step_s:g} s; write a step_s of at least {shortest_s:g}, or a "
            f"max_impulse_m_s of at most {greatest_m_s:g}: got {self.max_impulse_m_s!r}"
        )

    @property
    def is_scheduled(self) -> bool:
        """Whether the times of single impulses are given, as a list or by a period."""
        return bool(self.impulses_s) or self.impulse_period_s is not None

    @property
    def has_times(self) -> bool:
        """Whether times before the nominal arrival are given; 0 s, the arrival itself, is none."""
        return bool(self.impulses_s or self.last_impulse_s or self.first_impulse_s)

    def impulse_steps(self, arrival_s: float, step_s: float) -> Sequence[int] | None:
        """Return the steps in which impulses can be given; None is every step from `delay_steps`.

        Parameters
        ----------
        arrival_s, step_s : float
            Time from the start to the nominal arrival, and length of a step.

        Raises
        ------
        ValueError
            If there is no such step, a time of `impulses_s` or `first_impulse_s` is before the
            first step in which an impulse can be given, two of `impulses_s` are in one step, or the
            period is shorter than a step or gives more than `MAX_IMPULSES`. The message names the
            key to change.
        """
        if self.last_impulse_s is None and self.first_impulse_s is None and not self.impulses_s:
            return None

        # Without a cut-off it is the arrival itself: all steps before it can have an impulse.
        last = steps_between(arrival_s, self.last_impulse_s or 0.0, step_s)
        if self.impulses_s:
            steps: Sequence[int] = [
                step for step in self._listed_steps(arrival_s, step_s) if step <= last
            ]
        elif self.impulse_period_s is not None:
            steps = self._periodic_steps(self.impulse_period_s, arrival_s, step_s)
        else:
            steps = range(self._first_step(arrival_s, step_s), last + 1)
        if not steps:
            raise ValueError(
                "thruster.last_impulse_s excludes all impulses: "
                f"{self._first_text(arrival_s, step_s)}: got {self.last_impulse_s!r}"
            )
        return steps

    def _listed_steps(self, arrival_s: float, step_s: float) -> list[int]:
        """Return the steps of `impulses_s`, also after the cut-off."""
        steps = [steps_between(arrival_s, time_s, step_s) for time_s in self.impulses_s]
        for i, step in enumerate(steps):
            if step < self.delay_steps:
                raise ValueError(
                    f"thruster.impulses_s: {self._first_text(arrival_s, step_s)}; give later times "
                    f"or fewer delay_steps: got {self.impulses_s[i]!r}"
                )
            if i > 0 and step == steps[i - 1]:
                raise ValueError(
                    f"thruster.impulses_s: two impulses in one step of {step_s:g} s: got "
                    f"{self.impulses_s[i - 1]!r} and {self.impulses_s[i]!r}"
                )
        return steps

    def _periodic_steps(self, period_s: float, arrival_s: float, step_s: float) -> list[int]:
        """Return the steps of impulses every period, counted back from the cut-off."""
        # The asked step is shorter than the fitted one by at most this factor (`fitted_step_s`): a
        # period of one asked step is not refused.
        fitting = 1.0 - 0.5 * step_s / arrival_s
        if period_s < step_s * fitting * (1.0 - STEP_ROUNDING):
            raise ValueError(
                f"thruster.impulse_period_s must be at least a step, {step_s:g} s: got {period_s!r}"
            )
        # Raises ValueError if first_impulse_s is before the first possible step.
        self._first_step(arrival_s, step_s)
        first_s = arrival_s if self.first_impulse_s is None else self.first_impulse_s
        last_s = self.last_impulse_s or 0.0

        # The first impulse is the one nearest to first_impulse_s. `steps_between` counts forward in
        # time, with times before the arrival: from the last impulse to the first one it is
        # negative. Both times are a period earlier here: the last impulse may be at the arrival
        # itself, where `steps_between` allows no step.
        number = 1 - steps_between(last_s + period_s, first_s + period_s, period_s)
        if number > MAX_IMPULSES:
            raise ValueError(
                f"thruster.impulse_period_s gives {number} impulses, more than {MAX_IMPULSES}; "
                f"write a longer period or a later first_impulse_s: got {period_s!r}"
            )

        times_s = (last_s + place * period_s for place in reversed(range(number)))
        steps = (steps_between(arrival_s, time_s, step_s) for time_s in times_s)
        # Without first_impulse_s the period also gives impulses in the first `delay_steps` steps,
        # which are dropped. A period of one step may round two times to one step.
        return [*dict.fromkeys(step for step in steps if step >= self.delay_steps)]

    def _first_step(self, arrival_s: float, step_s: float) -> int:
        """Return the step of `first_impulse_s`, or the first step that can have an impulse."""
        if self.first_impulse_s is None:
            return self.delay_steps
        step = steps_between(arrival_s, self.first_impulse_s, step_s)
        if step < self.delay_steps:
            raise ValueError(
                f"thruster.first_impulse_s: {self._first_text(arrival_s, step_s)}; give a later "
                f"time or fewer delay_steps: got {self.first_impulse_s!r}"
            )
        return step

    def _first_text(self, arrival_s: float, step_s: float) -> str:
        """Return the time of the first possible impulse as a clause of messages."""
        return (
            f"the first impulse can be given {arrival_s - self.delay_steps * step_s:g} s before "
            "the nominal arrival"
        )

    def give(self, wanted_m_s: Floats, budget_left_m_s: Floats) -> Floats:
        """Return the impulses that the engine gives, m/s.

        Zero if |wanted| < mu1 or n < mu1, otherwise `wanted` with its modulus limited to min(mu2,
        n).

        Parameters
        ----------
        wanted_m_s : ndarray, shape (C, B)
            Impulses of the strategy.
        budget_left_m_s : ndarray, shape (B,)
            Budget n that is left.
        """
        size = modulus(wanted_m_s)
        limit = np.minimum(self.max_impulse_m_s, budget_left_m_s)
        given = wanted_m_s
        is_over = size > limit
        if some(is_over):
            limited = wanted_m_s / np.maximum(size, MIN_FLOAT) * limit
            given = np.where(is_over, limited, wanted_m_s)
            # Rounding must not make the modulus greater than the limit.
            while some(is_above := modulus(given) > limit):
                given = np.where(is_above, np.nextafter(given, 0.0), given)

        idle = (size < self.min_impulse_m_s) | (budget_left_m_s < self.min_impulse_m_s)
        return np.where(idle, 0.0, given)

    def executed(
        self, impulse_m_s: Floats, size: Floats | None, direction: Floats | None
    ) -> Floats:
        """Return impulses as they are executed, m/s.

        Parameters
        ----------
        impulse_m_s : ndarray, shape (C, B)
            Commanded impulses.
        size, direction : ndarray, shape (B,), or None
            Errors of the modulus, and of the direction from y toward z, in units of their bounds;
            None is zero.
        """
        if size is not None:
            impulse_m_s = impulse_m_s * (1.0 + self.execution_error_relative * size)
        if direction is not None:
            angle_rad = self.pointing_error_rad * direction
            sine = np.sin(angle_rad)
            cosine = np.cos(angle_rad)
            y, z = impulse_m_s  # only impulses in space have an error of the direction
            impulse_m_s = np.stack([cosine * y - sine * z, cosine * z + sine * y])
        return impulse_m_s


def _rounded(value: float, rounding: str) -> float:
    """Return a number with `_DIGITS` digits, by a rounding of `decimal`."""
    return float(Context(prec=_DIGITS, rounding=rounding).create_decimal_from_float(value))


def modulus(lateral: Floats) -> Floats:
    """Return the moduli of lateral values of the shape (C, B), shape (B,)."""
    return reduce(np.hypot, np.abs(lateral))
