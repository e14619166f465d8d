"""The section at the label of the true state, and the distance of the true state from its boundary.

The label is known only on arrival, because impulses change the arrival time by some nanoseconds
through gravity. Therefore measurements and impulses are stored during the flight and evaluated
afterwards.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats, some
from infoset.engine.history import ANGLE, IMPULSE, PREDICTION, RATE, History
from infoset.engine.replays import margins_along
from infoset.engine.section_law import BOUND_SLACK, law_table, section_laws
from infoset.model import SetModel
from infoset.set_queries import MaskedFloats
from infoset.sim.kepler import Sight

ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Rounding error of a margin, relative to the terms of z: a quarter of that for which each cut
widens the set.
"""


@dataclass(frozen=True)
class _OutputTime:
    """True states of the flights that measure in a step, after some events; slopes have the shape
    (C, B).
    """

    step: int
    events: int
    where: Flags
    slope: Floats
    slope_rate_per_s: Floats


class TruthSection:
    """Measurements and impulses of a batch of flights, for the margins of the true states in their
    sections.

    Angles do not depend on scale: a true motion with closing speed e (1 + eta) has the angles of a
    model motion at range x / (1 + eta), so its label is e T, with T the time at which x = 0.
    """

    def __init__(self, model: SetModel, batch: int) -> None:
        laws = section_laws(model)
        self._law = laws[0]
        self._laws = law_table(laws)
        self._exact_angles = model.is_guaranteed
        self._min_range_m = model.min_range_m
        self._history = History(len(laws), batch)
        self._output_times: list[_OutputTime] = []

    def store_state(self, where: Flags, sight: Sight) -> None:
        """Store which flights measured in this step, after the measurements, and the true
        states.
        """
        slope = sight.alpha_rad
        rate = sight.omega_rad_s
        if self._exact_angles:
            slope = sight.slope
            rate = sight.slope_rate_per_s
        self._output_times.append(
            _OutputTime(self._history.elapsed, self._history.events, where, slope, rate)
        )

    def measure_angle(self, alpha_rad: Floats, where: Flags) -> None:
        """Store a measured angle."""
        self._history.record(ANGLE, alpha_rad, where)

    def measure_range(
        self, range_m: Floats, relative_error: float, where: Flags, *, alpha_rad: ArrayLike | None
    ) -> None:
        """Do nothing: a range selects labels and does not cut sections."""

    def measure_rate(self, omega_rad_s: Floats, error_rad_s: float, where: Flags) -> None:
        """Store a measured rate."""
        self._history.record(RATE, omega_rad_s, where, error_rad_s * (1.0 + BOUND_SLACK))

    def shift(self, impulse_m_s: Floats, where: Flags) -> None:
        """Store the impulse of this step, m/s, shape (C, B)."""
        if some(where):
            self._history.record(IMPULSE, impulse_m_s, where)

    def predict(self) -> None:
        """End the step."""
        self._history.record(PREDICTION)

    def margins_m(self, arrival_s: Floats) -> list[MaskedFloats]:
        """Return the signed margins (m) of the true states in their sections, one array of shape
        (B,) per step.

        A margin is that of the last measurement; it is masked before the first one. It includes an
        allowance for rounding. `arrival_s` are the times from the start to x = 0.
        """
        latest = np.full(len(arrival_s), np.inf)
        margins = []
        measured: dict[int, Floats] = {}
        for time, margin in zip(self._output_times, self._margins(arrival_s), strict=True):
            measured[time.step] = np.minimum(margin, measured.get(time.step, np.inf))
        for step in range(self._history.elapsed + 1):
            margin = measured.get(step, latest)
            latest = np.where(np.isinf(margin), latest, margin)
            margins.append(_if_measured(latest))
        return margins

    def min_margin_m(self, arrival_s: Floats) -> MaskedFloats:
        """Return the minimum signed margin of each true state, m; masked where nothing was
        measured.
        """
        return _if_measured(self._margins(arrival_s).min(axis=0, initial=np.inf))

    def _margins(self, arrival_s: Floats) -> Floats:
        """Return the margin of each flight at each time, m, shape (L, B); infinite where it does
        not measure.
        """
        law = self._law
        history = copy.copy(self._history)
        times = self._output_times
        if not times:
            return np.empty((0, len(arrival_s)))
        labels = law.closing_speed * arrival_s
        ranges = labels - law.closing_speed * (law.step * np.arange(history.elapsed + 1))[:, None]
        kinds = history.kinds[: history.events]
        measured = np.isin(kinds, (ANGLE, RATE))
        steps = np.cumsum(kinds == PREDICTION)
        history.applies = history.applies[: history.events].copy()
        history.applies[measured] &= (ranges >= self._min_range_m)[steps[measured]]
        at = [time.step for time in times]
        ranges = ranges[at]
        where = np.reshape([time.where for time in times], ranges.shape) & (
            ranges >= self._min_range_m
        )
        # Shape (L, C, B), then (C, L, B).
        each = (len(times), len(self._laws), len(labels))
        slope = np.reshape([time.slope for time in times], each).swapaxes(0, 1)
        rate = np.reshape([time.slope_rate_per_s for time in times], each).swapaxes(0, 1)
        ends = np.array([time.events for time in times], dtype=np.int64)
        v = np.ascontiguousarray(rate * ranges - law.closing_speed * slope)
        z = np.ascontiguousarray(slope * ranges)
        margins, reaches = margins_along(labels, ends, v, z, history, self._laws)
        # The label and z = label |slope| of the true state are rounded, and so is z = m - V
        # (label/e) of a vertex: the sections of an exactly known z are thinner than that.
        margins += ROUNDING * labels * (np.abs(slope) + reaches / law.closing_speed)
        return np.where(where, margins.min(axis=0), np.inf)


def _if_measured(margin: Floats) -> MaskedFloats:
    never = np.isinf(margin)
    return np.ma.MaskedArray(np.where(never, 0.0, margin), mask=never)
