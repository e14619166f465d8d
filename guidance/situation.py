"""What a strategy may know when it decides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.thruster import Thruster
from infoset import InformationSetView, PredictedMiss, RangeSensor

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Situation:
    """Everything known on board at one step, for a batch of B engagements.

    Parameters
    ----------
    time_s : float
        Time now, s.
    step : int
        Number of this step; the first is 0.
    step_s : float
        Time between steps, s.
    predicted_miss : PredictedMiss
        Misses still possible without control, with the points that reach the ends of the interval.
    budget_left_m_s : ndarray, shape (B,)
        What is left of the impulse budget, m/s.
    thruster : Thruster
        Limits of the engine; whatever a strategy wants is limited by them.
    closing_speed_m_s : float
        The nominal closing speed e, m/s.
    measured_angle_rad : ndarray, shape (B,), or None
        Last measured line-of-sight angle; None before the first.
    measured_range_m : ndarray, shape (B,), or None
        Last measured range; None before the first or without a range meter.
    measured_rate_rad_s : ndarray, shape (B,), or None
        Last measured line-of-sight rate; None before the first or without such a sensor.
    last_impulse_m_s : ndarray, shape (B,)
        Impulses of the step before, m/s.
    information : InformationSetView
        The information set itself, read-only.
    angle_is_new, range_is_new : bool
        Whether the angle, or the range, was measured in this step.
    range_sensor : RangeSensor or None
        Error law of the range meter; None without one.
    """

    time_s: float
    step: int
    step_s: float
    predicted_miss: PredictedMiss
    budget_left_m_s: Floats
    thruster: Thruster
    closing_speed_m_s: float
    measured_angle_rad: Floats | None
    measured_range_m: Floats | None
    last_impulse_m_s: Floats
    information: InformationSetView
    measured_rate_rad_s: Floats | None = None
    angle_is_new: bool = True
    range_is_new: bool = False
    range_sensor: RangeSensor | None = None
