"""Pulsed proportional navigation on an estimated motion, plain and augmented."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from infoset.arrays import Floats
from infoset.guidance.kalman import KalmanBank
from infoset.guidance.situation import Situation
from infoset.limits import Checked, Limits, NotNegative


@dataclass
class PulseState:
    """State of proportional navigation: the estimator, and the sum of commands without impulse."""

    estimator: KalmanBank
    accumulated_m_s: Floats


@dataclass(frozen=True)
class ProportionalNavigation(Checked):
    """Command an acceleration proportional to the rate of the line of sight, in pulses.

    Parameters
    ----------
    is_augmented : bool
        Estimate the lateral acceleration of the target, and compensate for it (augmented
        proportional navigation).
    ratio : float
        Navigation ratio N, greater than 2; 3 to 5 are usual.
    dead_band_m_s : float or None
        Commands accumulate until their sum has this size, m/s; None is the minimum impulse of the
        engine.

    Notes
    -----
    The law is a = N c q, with the closing speed c and the rate q of the line of sight; the
    augmented law adds half of N times the acceleration of the target. With the zero-effort miss m
    (which contains the acceleration of the target in the augmented law) and the time to go tau,
    both are a = N m / tau^2. Continuous acceleration by this law makes m proportional to tau^N, so
    m and, for N > 2, a become zero at the arrival.

    Impulses replace the acceleration until the next decision at the time to go tau': k = (m / tau)
    (1 - (tau'/tau)^N) changes m as the acceleration would. For short steps this is N m/tau^2 times
    the step. With impulses at few allowed times, it corrects nearly the whole miss at each of them,
    and the last allowed one corrects all of it. Commands below the dead band accumulate, and their
    sum never exceeds m/tau, so an old command whose miss has disappeared is not given.

    Good without a prediction of the motion: it needs the rate of the line of sight only, and its
    gain N/tau is small far from the target, so it responds less to noise than a full correction at
    every step. Limits: it delays the correction, so a known miss costs N/(N - 1) times the impulse
    of an immediate correction, and an acceleration of the target costs N/(N - 2) times its size at
    the end of the flight without augmentation. Nothing is guaranteed.

    References
    ----------
    Zarchan (2012), Tactical and Strategic Missile Guidance, chapters 2 and 8; Hawkins, Guo and Wie
    (2012), Spacecraft guidance algorithms for asteroid intercept and rendezvous missions, IJASS
    13(2), 154-169, for pulses (there by a Schmitt trigger). The exact factor of an impulse and the
    accumulation are not from there.
    """

    is_augmented: bool = False
    ratio: Annotated[float, Limits(above=2.0)] = 3.0
    dead_band_m_s: NotNegative | None = None

    def start(self, shape: tuple[int, int]) -> PulseState:
        """Start without commands."""
        return PulseState(KalmanBank(shape, self.is_augmented), np.zeros(shape))

    def decide(self, situation: Situation, state: PulseState) -> Floats:
        """Update the estimate, and return the accumulated commands beyond the dead band, m/s.

        The last decision gives the whole sum, also within the dead band. Each axis is compared
        alone.
        """
        state.estimator.update(situation)
        if not situation.may_fire:
            return np.zeros_like(state.accumulated_m_s)

        estimate = state.estimator.estimate(situation)
        whole = estimate.correction_m_s()
        # Time to go at the next decision: zero after the last one, which corrects all.
        left_s = np.zeros_like(whole)
        if situation.next_s is not None:
            left_s = np.maximum(estimate.to_go_s - situation.next_s, 0.0)
        part = np.divide(
            left_s, estimate.to_go_s, out=np.zeros_like(whole), where=estimate.to_go_s > 0.0
        )
        command = state.accumulated_m_s + whole * (1.0 - part**self.ratio)
        # The sum with old commands is at most as large as the whole correction.
        command = np.clip(command, -np.abs(whole), np.abs(whole))

        dead_band_m_s = self.dead_band_m_s
        if dead_band_m_s is None:
            dead_band_m_s = situation.thruster.min_impulse_m_s
        # Without time left after this decision, the whole sum is given.
        given = np.where((np.abs(command) >= dead_band_m_s) | (left_s <= 0.0), command, 0.0)
        state.accumulated_m_s = np.where(given == 0.0, command, 0.0)
        return given
