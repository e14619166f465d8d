"""Input of a strategy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.engine.predicted_miss import PredictedMiss
from infoset.guidance.thruster import Thruster, modulus
from infoset.information_set import InformationSetView
from infoset.sensors import Measurements, Sensor


@dataclass(frozen=True)
class Situation:
    """Everything known on board at one step, for a batch of B engagements.

    Predicted misses, measured angles, rates and impulses have the shape (C, B), for C lateral axes:
    z in a plane, y and z in space.

    Parameters
    ----------
    predicted_miss : PredictedMiss
        Interval of the miss without further impulses, with the points of the set that reach its
        ends.
    budget_left_m_s : ndarray, shape (B,)
        Impulse budget left, m/s.
    thruster : Thruster
        Limits of the engine; they are applied to the impulses of the strategy.
    closing_speed_m_s : float
        The nominal closing speed e, m/s.
    measured : mapping of str to ndarray
        Last measured values by sensor, "angle" (rad) and "rate" (rad/s), shape (C, B), and "range"
        (m), shape (B,); a sensor that has not measured yet is missing, and NaN is the value of an
        engagement without a measurement so far.
    last_impulse_m_s : ndarray, shape (C, B)
        Impulses of the previous step, m/s.
    information : InformationSetView
        The information set itself, read-only.
    new : frozenset of str
        Sensors that measured in this step, in one engagement of the batch at least.
    seen : mapping of str to ndarray of bool, shape (B,)
        Engagements in which each sensor of `new` measured: images can be lost. `is_new` reads it.
    sensors : mapping of str to Sensor
        All sensors on board by name, with their error bounds.
    may_fire : bool
        Whether an impulse can be decided in this step; otherwise the impulses of a strategy are
        ignored.
    lead_s : float
        Time from a decision to its impulse, s.
    later_times_s : ndarray, shape (n,), or None
        Times since the start at which impulses of later decisions can be given, s; None is every
        later step.
    pending : tuple of (float, ndarray)
        Impulses that are decided and not given yet: time from now, s, and impulse, m/s, shape (C,
        B). `predicted_miss` contains their effect, and `information` does not.
    """

    time_s: float
    step: int
    step_s: float
    predicted_miss: PredictedMiss
    budget_left_m_s: Floats
    thruster: Thruster
    closing_speed_m_s: float
    measured: Measurements
    last_impulse_m_s: Floats
    information: InformationSetView
    new: frozenset[str] = frozenset()
    sensors: Mapping[str, Sensor] = field(default_factory=dict)
    seen: Mapping[str, Flags] = field(default_factory=dict)
    may_fire: bool = True
    lead_s: float = 0.0
    later_times_s: Floats | None = None
    pending: tuple[tuple[float, Floats], ...] = ()

    def is_new(self, name: str) -> Flags:
        """Return the engagements in which a sensor measured in this step, shape (B,)."""
        # A sensor without an entry in `seen` measured in all engagements, or in none.
        all_or_none = np.full(self.budget_left_m_s.shape, name in self.new)
        return self.seen.get(name, all_or_none)

    @property
    def next_s(self) -> float | None:
        """Time from now to the next decision after this step, s; None without one."""
        if self.later_times_s is None:
            return self.step_s
        if not self.later_times_s.size:
            return None
        return float(self.later_times_s[0]) - self.lead_s - self.time_s

    @property
    def last_s(self) -> float:
        """Time from now to the last impulse that can be given, s; infinite without a last one.

        It is `lead_s`, the time to the impulse that is decided now, if no later one can be decided.
        """
        if self.later_times_s is None:
            return math.inf
        if not self.later_times_s.size:
            return self.lead_s
        return float(self.later_times_s[-1]) - self.time_s

    def pending_m(self, time_to_go_s: Floats) -> Floats:
        """Return the changes of predicted misses by the pending impulses, m, to be subtracted.

        Parameters
        ----------
        time_to_go_s : ndarray, shape (B, S) or (C, B, S)
            Time to x = 0 of the predicted misses.

        Returns
        -------
        ndarray, shape (C, B, S)
        """
        change = np.zeros((len(self.last_impulse_m_s), *time_to_go_s.shape[-2:]))
        for time_s, impulse in self.pending:
            # A burn acts at its middle; without a thrust its duration is zero.
            middle_s = time_s + 0.5 * self.thruster.burn_s(modulus(impulse))[:, None]
            change += impulse[..., None] * np.maximum(time_to_go_s - middle_s, 0.0)
        return change
