"""The bound of Theorem 8 of docs/guarantee.md for flights with `least-effort` and one hypothesis."""

from __future__ import annotations

import numpy as np

from guidance.authority import correctable_later_m
from guidance.least_effort import unavoidable_m
from guidance.situation import Situation
from infoset import BearingSensor, SetModel
from infoset.arrays import Flags, Floats
from infoset.engine.section_law import BOUND_SLACK, section_laws

ONE_LABEL = 1e-7
"""Maximum width of the interval of labels, in labels: the misses of all its labels are the same."""


def has_theorem_8(model: SetModel, delay_steps: int) -> bool:
    """Return whether the assumptions of Theorem 8 that belong to the scenario hold for the program.

    They are the guaranteed model with a box, in a plane; known range and closing speed; angles whose bands are those of
    Lemma 4; and impulses that are executed exactly and without delay.
    """
    is_planar_box = model.is_guaranteed and model.starts_as_box and len(model.axes) == 1
    if not is_planar_box or delay_steps or model.execution_error_relative > 0.0:
        return False
    minimum, maximum = model.label_limits_m
    fastest = max(-vx for vx in model.bounds.vx_m_s)
    is_one = maximum - minimum <= ONE_LABEL * maximum and fastest == model.closing_speed_m_s
    return is_one and not section_laws(model)[0].linear_band


class Theorem8:
    """The bound of the miss by Theorem 8, decision by decision, for B flights.

    Notes
    -----
    The possible misses are within the box of the start and within equation (34), which the first image and the present
    one limit. Psi_s is half the length of this interval less the authority M_s. It does not depend on what the
    images in between measure. `excess_m` bounds R_s(u_s) by induction. At the first decision and in the dead zone of
    the engine, where (32) is no bound, R_s(u_s) itself is computed.
    """

    def __init__(self, model: SetModel, batch: int, budget_m_s: float) -> None:
        self._law, self._eta = section_laws(model)[0], model.speed_error
        self._label_m = 0.5 * sum(model.label_limits_m)
        self._arrival_s = self._label_m / model.closing_speed_m_s
        self._first_s = np.full(batch, np.nan)
        self._first_slopes = np.zeros((2, batch))
        # Sums over the impulses since the first image: u, and u t.
        self._given, self._moments = np.zeros((2, batch))
        # The sum of |u| in the widening is at most the budget.
        self._doubt_m_s = self._law.impulse_error * budget_m_s
        self.valid, self._started = np.ones(batch, dtype=bool), np.zeros(batch, dtype=bool)
        self._has_first = np.zeros(batch, dtype=bool)
        self.excess_m, self._later_m = np.zeros((2, batch))

    @property
    def miss_m(self) -> Floats:
        """The bound of the miss after the last decision, m, shape (B,); `known` says where it exists."""
        # Impulses below the range threshold count in M, and are not given.
        return np.asarray(
            (self.excess_m + self._later_m + self._doubt_m_s * self._arrival_s)
            * (1.0 + self._eta)
            * (1.0 + BOUND_SLACK)
        )

    @property
    def known(self) -> Flags:
        """Engagements whose decisions satisfied the assumptions: an image at each one, and a budget of mu2 or more."""
        return self.valid & self._started

    def decide(self, situation: Situation, wanted_m_s: Floats, given_m_s: Floats, deciding: Flags) -> None:
        """Add a step: the impulses of the strategy and those of the engine, in the engagements that decide.

        Impulses have the shape (1, B), because the theorem is that of a plane.
        """
        (wanted_m_s,), (given_m_s,) = wanted_m_s, given_m_s
        angles = situation.measured[BearingSensor.name][0] if BearingSensor.name in situation.measured else None
        seen = deciding & situation.is_new(BearingSensor.name)
        if angles is not None and not self._has_first.all():
            self._look_first(seen & ~self._has_first, situation.time_s, angles)
        if not situation.may_fire or angles is None:
            self.valid &= ~deciding | (not situation.may_fire)
            return
        self.valid &= ~deciding | (seen & (situation.budget_left_m_s >= situation.thruster.max_impulse_m_s))
        e = self._law.closing_speed
        to_go_s = max(self._label_m / e - situation.time_s, 0.0)
        later = correctable_later_m(situation, np.full((len(deciding), 1), e * to_go_s))[:, 0]
        excess = np.maximum(self.excess_m, self.half_width_m(situation.time_s, angles) - later)
        start = deciding & ~self._started
        if start.any():
            excess[start] = unavoidable_m(situation)[0]
        exact = np.flatnonzero(start | (wanted_m_s != given_m_s))
        if exact.size:
            moved, interval = given_m_s[exact] * to_go_s, situation.predicted_miss
            worst = np.maximum(interval.upper_m[0, exact] - moved, moved - interval.lower_m[0, exact]) - later[exact]
            excess[exact] = np.maximum(excess[exact], worst)
        given = given_m_s if deciding.all() else np.where(deciding, given_m_s, 0.0)
        self.excess_m = np.where(deciding, excess, self.excess_m)
        self._later_m = np.where(deciding, later, self._later_m)
        self._given += given
        self._moments += given * np.where(self._has_first, situation.time_s - self._first_s, 0.0)
        self._started |= start

    def half_width_m(self, time_s: float, angles_rad: Floats) -> Floats:
        """Return half the length of the interval of possible misses by the start, the first image and this one, m."""
        law, since_s, moments, arrival_s = self._law, time_s - self._first_s, self._moments, self._arrival_s
        to_go_s, from_first_s = arrival_s - time_s, arrival_s - self._first_s
        # The box of the start, moved by the impulses.
        moved, doubt = from_first_s * self._given - moments, self._doubt_m_s * arrival_s
        drift = 0.5 * law.disturbance * arrival_s * (arrival_s + law.step)
        box_upper = (law.z_max + law.vz_max * arrival_s + drift + doubt) - moved
        box_lower = (law.z_min + law.vz_min * arrival_s - drift - doubt) - moved
        # Equation (34).
        share = to_go_s / np.where(since_s > 0.0, since_s, np.nan)
        x0, disturbed = law.closing_speed * from_first_s, 0.5 * law.disturbance * to_go_s * (from_first_s + law.step)
        disturbed = disturbed + self._doubt_m_s * to_go_s
        error = law.error_at_zero_range + law.error_slope * law.closing_speed * to_go_s
        first_min, first_max = self._first_slopes
        maximum = x0 * (np.tan(angles_rad + error) - first_min)
        minimum = x0 * (np.tan(angles_rad - error) - first_max)
        # `fmin` and `fmax` ignore the first image, for which the share is not a number.
        upper, lower = (
            np.fmin(box_upper, share * (maximum - moments) + disturbed),
            np.fmax(box_lower, share * (minimum - moments) - disturbed),
        )
        return np.asarray(0.5 * (upper - lower))

    def _look_first(self, first: Flags, time_s: float, angles_rad: Floats) -> None:
        """Store the time and the slopes of the first image."""
        law = self._law
        error = law.error_at_zero_range + law.error_slope * (self._label_m - law.closing_speed * time_s)
        self._first_s[first], self._has_first[first] = time_s, True
        self._first_slopes[:, first] = np.tan(np.stack([angles_rad - error, angles_rad + error]))[:, first]
