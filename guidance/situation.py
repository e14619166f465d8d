"""Input of a strategy."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from guidance.thruster import Thruster
from infoset import InformationSetView, PredictedMiss
from infoset.sensors import Measurements, Sensor

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Situation:
    """Everything known on board at one step, for a batch of B engagements.

    Parameters
    ----------
    step : int
        Number of this step; the first is 0.
    predicted_miss : PredictedMiss
        Interval of the miss without further impulses, with the points of the set that reach its ends.
    budget_left_m_s : ndarray, shape (B,)
        Impulse budget left, m/s.
    thruster : Thruster
        Limits of the engine; they are applied to what the strategy returns.
    closing_speed_m_s : float
        The nominal closing speed e, m/s.
    measured : mapping of str to ndarray, shape (B,)
        Last measured values by sensor, "angle" (rad), "range" (m) and "rate" (rad/s); a sensor that has not measured
        yet is missing.
    last_impulse_m_s : ndarray, shape (B,)
        Impulses of the previous step, m/s.
    information : InformationSetView
        The information set itself, read-only.
    new : frozenset of str
        Sensors that measured in this step.
    sensors : mapping of str to Sensor
        All sensors on board by name, with their error bounds.
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
