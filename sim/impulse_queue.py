"""Impulses of a batch from the decision to the engine: schedule, budget and delay."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats, some
from infoset.guidance.thruster import MIN_FLOAT, modulus
from infoset.sim.scenario import Scenario

Pending = tuple[tuple[float, Floats], ...]
"""Impulses that are decided and not given yet: times from now, s, and impulses, m/s."""


class Opportunity(NamedTuple):
    """Whether an impulse can be decided now, and the times at which later ones can be given, s.

    Without a schedule, impulses can be given at every step, and the times are None.
    """

    may_fire: bool
    later_times_s: Floats | None


class ImpulseQueue:
    """Impulses of B engagements: decided, waiting for the delay of the engine, and given.

    `lateral` is the shape (C, B) of impulses.

    Attributes
    ----------
    lead_s : float
        Time from a decision to its impulse, s.
    budget_left_m_s : ndarray, shape (B,)
        Budget without the impulses that are decided.
    is_spent : ndarray of bool, shape (B,)
        Engagements whose strategy commanded an impulse of at least the minimum impulse with a
        smaller budget left; none if the minimum impulse is zero.
    last_m_s : ndarray, shape (C, B)
        Impulses given in the last step.
    """

    def __init__(self, scenario: Scenario, lateral: tuple[int, int]) -> None:
        batch = lateral[1]
        thruster = scenario.engine
        self._thruster = thruster
        self._step_s = scenario.set_model.step_s
        self.lead_s = thruster.delay_steps * self._step_s
        self.budget_left_m_s: Floats = np.full(batch, float(thruster.budget_m_s))
        self.is_spent: Flags = np.zeros(batch, dtype=bool)
        self.last_m_s: Floats = np.zeros(lateral)
        # One impulse for each of the next steps, in their order: `decide` appends, then `give`
        # removes one. The zeros are one array: impulses are replaced, never changed in place.
        self._waiting = [self.last_m_s] * thruster.delay_steps
        self._not_given_m_s = np.zeros(batch)

        steps = scenario.impulse_steps
        self._times_s = None if steps is None else np.array(steps) * self._step_s
        self._last_step = None if steps is None else steps[-1]
        self._burn_of_step: dict[int, int] = {}
        if steps is not None and thruster.is_scheduled:
            self._burn_of_step = {step: burn for burn, step in enumerate(steps)}
        self._burns_m_s = np.zeros((batch, len(self._burn_of_step)))

    @property
    def burns_m_s(self) -> Floats | None:
        """Moduli of the impulses at the scheduled times, m/s, shape (B, n); None without a
        schedule.
        """
        return self._burns_m_s.copy() if self._burn_of_step else None

    def pending(self) -> Pending:
        """Return the impulses that are decided and not given yet."""
        return tuple(
            (steps * self._step_s, impulse)
            for steps, impulse in enumerate(self._waiting)
            if impulse.any()
        )

    def opportunity(self, time_s: float) -> Opportunity:
        """Return whether an impulse can be decided at a time, s, and when later ones can be given.

        The times of the schedule are times of impulses: decisions plus the delay.
        """
        if self._times_s is None:
            return Opportunity(True, None)
        # Half a step separates the times of different steps, whatever their rounding errors are.
        half_s = 0.5 * self._step_s
        ends_s = (time_s + self.lead_s - half_s, time_s + self.lead_s + half_s)
        first, after = np.searchsorted(self._times_s, ends_s).tolist()
        return Opportunity(after > first, self._times_s[after:])

    def decide(self, wanted_m_s: Floats, to_go_s: float) -> None:
        """Add the impulses that the engine gives for the commanded ones, and reserve their
        budget. `to_go_s` is the time from the impulse to the nominal arrival, s.

        The command is an instantaneous impulse: an engine that burns gives the impulse that changes
        the miss as much.
        """
        wanted_m_s = self._thruster.as_burns(wanted_m_s, to_go_s)
        min_impulse_m_s = self._thruster.min_impulse_m_s
        is_short = self.budget_left_m_s < min_impulse_m_s
        if some(is_short):
            self.is_spent |= is_short & (modulus(wanted_m_s) >= min_impulse_m_s)

        decided = self._thruster.give(wanted_m_s, self.budget_left_m_s)
        self._waiting.append(decided)
        self.budget_left_m_s = np.maximum(self.budget_left_m_s - modulus(decided), 0.0)

    def give(self, step: int, flying: Flags) -> Floats:
        """Return the impulses that are due in a step, m/s; zero after the closest approach if the
        engine has a delay.

        It is called once in each step, after `decide`. `flying` are the engagements before their
        closest approach.
        """
        due = self._waiting.pop(0)
        if self.lead_s > 0.0:
            self._not_given_m_s += np.where(flying, 0.0, modulus(due))
            due = np.where(flying, due, 0.0)
        if step in self._burn_of_step:
            self._burns_m_s[:, self._burn_of_step[step]] = modulus(due)
        self.last_m_s = due
        return due

    def is_over(self, step: int) -> Flags:
        """Return whether no later step can give an impulse, shape (B,).

        That is so from the last step of the schedule on, or with less budget than the minimum
        impulse, and only if no decided impulse waits. It is called after `give` in the same step.
        """
        if self._last_step is not None and step >= self._last_step:
            is_over = np.ones(len(self.budget_left_m_s), dtype=bool)
        else:
            # With a minimum impulse of zero, only a budget of zero is over.
            is_over = self.budget_left_m_s < max(self._thruster.min_impulse_m_s, MIN_FLOAT)
        for waiting in self._waiting:
            is_over &= modulus(waiting) == 0.0
        return is_over

    def given_m_s(self) -> Floats:
        """Return the sum of the moduli of the impulses given so far, m/s, shape (B,)."""
        # The budget left is without the impulses that wait, and those after the closest approach.
        not_given = self._not_given_m_s + sum(map(modulus, self._waiting))
        return np.maximum(self._thruster.budget_m_s - self.budget_left_m_s - not_given, 0.0)
