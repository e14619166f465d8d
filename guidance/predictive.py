"""Predictive guidance: few corrections of the whole estimated miss."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from infoset.arrays import Floats
from infoset.guidance.kalman import KalmanBank
from infoset.guidance.situation import Situation
from infoset.guidance.thruster import modulus
from infoset.limits import Checked, Limits


@dataclass
class ManoeuvreState:
    """State of predictive guidance.

    `due_s`, shape (C, B), is the time to go at which the next manoeuvre begins, s; infinite before
    the first step in which an impulse can be decided, and not used if the engine has scheduled
    times.
    """

    estimator: KalmanBank
    due_s: Floats


@dataclass(frozen=True)
class Predictive(Checked):
    """Correct the whole estimated zero-effort miss, at a few times before the arrival.

    Parameters
    ----------
    spacing : float
        The ratio of the times to go of two manoeuvres in a row, greater than 1, if the engine has
        no scheduled times. The default was chosen on runs with seed 11 (docs/strategies.md).

    Notes
    -----
    The impulse is k = m / tau, with the estimated miss m and the time to go tau. If the engine has
    scheduled times (`Thruster.is_scheduled`), each of them corrects the whole miss. Otherwise the
    first manoeuvre begins at the time to go T/s, with T estimated at the first step in which the
    engine can give an impulse, and each further one at 1/s of the time to go at which the one
    before ended. One also begins at the last time that the engine allows. A manoeuvre that is
    greater than the maximum impulse of the engine continues in the next steps. In space each axis
    has its own manoeuvres, and the modulus of both is compared with the maximum impulse.

    After a manoeuvre, its miss is the error of its estimate. With independent errors of angles this
    falls in proportion to the time to go, or faster, so geometric times make the impulses after the
    first one of similar size. The three targeting manoeuvres of Deep Impact, 90, 35 and 12.5 min
    before the impact, had ratios of 2.6 and 2.8.

    Good where manoeuvres are few, and the engine is exact: each one is as small as its time allows.
    Limits: a manoeuvre corrects the noise of its estimate too, and the last one decides the miss;
    between manoeuvres nothing is corrected. The first one waits for measurements until the time to
    go T/s, so it costs s times the impulse of an immediate correction. Nothing is guaranteed.

    References
    ----------
    Gil-Fernández, Prieto-Llanos, Panzeca and Drai, Autonomous GNC algorithms for NEO impactor
    missions, ISSFD, for predictive guidance on a Kalman filter; Hawkins, Guo and Wie (2012), IJASS
    13(2), 154-169. The geometric times are not from there.
    """

    spacing: Annotated[float, Limits(above=1.0)] = 1.5

    def start(self, shape: tuple[int, int]) -> ManoeuvreState:
        """Start before the first manoeuvre."""
        return ManoeuvreState(KalmanBank(shape), np.full(shape, np.inf))

    def decide(self, situation: Situation, state: ManoeuvreState) -> Floats:
        """Update the estimate, and return the impulses of a manoeuvre if one is due, m/s."""
        state.estimator.update(situation)
        if not situation.may_fire:
            return np.zeros_like(state.due_s)

        estimate = state.estimator.estimate(situation)
        whole = estimate.correction_m_s()
        next_s = situation.next_s
        if situation.thruster.is_scheduled or next_s is None:
            return whole

        state.due_s = np.where(np.isinf(state.due_s), estimate.to_go_s / self.spacing, state.due_s)
        # If the next decision is at or after the arrival, this is the last one.
        is_due = (estimate.to_go_s <= state.due_s) | (estimate.to_go_s <= next_s)
        wanted = np.where(is_due, whole, 0.0)
        # A manoeuvre above the limit stays due, and continues in the next step. The engine limits
        # the modulus of both axes (`Thruster.give`).
        is_done = is_due & (modulus(wanted) <= situation.thruster.max_impulse_m_s)
        state.due_s = np.where(is_done, estimate.to_go_s / self.spacing, state.due_s)
        return wanted
