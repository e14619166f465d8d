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

MARGIN_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Rounding error of a margin, relative to the terms of z: a quarter of `CUT_SLACK` of the sections,
by which each cut is widened.
"""


@dataclass(frozen=True)
class _OutputTime:
    """True states of the flights at a measurement.

    Parameters
    ----------
    step, events : int
        Step of the measurement, and number of events in the history until it.
    where : ndarray of bool, shape (B,)
        Flights that measure.
    slope, slope_rate_per_s : ndarray, shape (C, B)
        Slope z/x of the true line of sight in the axes of the camera, and its rate; in the model
        `paper` the angle and its rate, which that model takes for them.
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
        """Store the true states of the flights that measured, after their measurements."""
        slope = sight.slope if self._exact_angles else sight.alpha_rad
        rate = sight.slope_rate_per_s if self._exact_angles else sight.omega_rad_s
        self._output_times.append(
            _OutputTime(self._history.elapsed, self._history.events, where, slope, rate)
        )

    def measure_angle(self, alpha_rad: Floats, where: Flags) -> None:
        """Store a measured angle."""
        self._history.record(ANGLE, alpha_rad, where)

    def measure_range(
        self,
        range_m: Floats,
        relative_error: float,
        where: Flags,
        *,
        alpha_rad: ArrayLike | None,
        wrong_measurements: int = 0,
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

        The margin of a step is the margin at the last measurement until then; it is masked before
        the first one. It includes an allowance for rounding. The last array is for the step that
        begins now. `arrival_s` are the times from the start to x = 0.
        """
        measured: dict[int, Floats] = {}
        for time, margin in zip(self._output_times, self._margins(arrival_s), strict=True):
            measured[time.step] = np.minimum(margin, measured.get(time.step, np.inf))

        margins = []
        latest = np.full(len(arrival_s), np.inf)
        for step in range(self._history.elapsed + 1):
            margin = measured.get(step, latest)
            latest = np.where(np.isinf(margin), latest, margin)
            margins.append(_masked_unless_measured(latest))
        return margins

    def min_margin_m(self, arrival_s: Floats) -> MaskedFloats:
        """Return the minimum signed margin of each true state, m; masked without measurements."""
        return _masked_unless_measured(self._margins(arrival_s).min(axis=0, initial=np.inf))

    def _margins(self, arrival_s: Floats) -> Floats:
        """Return the margin of each flight at each of L measurements, m, shape (L, B); infinite
        where it does not measure, and below the range threshold.
        """
        times = self._output_times
        if not times:
            return np.empty((0, len(arrival_s)))

        law = self._law
        steps = np.arange(self._history.elapsed + 1)
        labels = law.closing_speed * arrival_s
        ranges_by_step = labels - law.closing_speed * (law.step * steps)[:, None]
        history = self._history_beyond_threshold(ranges_by_step)
        ranges = ranges_by_step[[time.step for time in times]]
        measures = np.reshape([time.where for time in times], ranges.shape)
        where = measures & (ranges >= self._min_range_m)

        # Shape (L, C, B), then (C, L, B).
        shape = (len(times), len(self._laws), len(labels))
        slope = np.reshape([time.slope for time in times], shape).swapaxes(0, 1)
        rate = np.reshape([time.slope_rate_per_s for time in times], shape).swapaxes(0, 1)
        v = np.ascontiguousarray(rate * ranges - law.closing_speed * slope)
        z = np.ascontiguousarray(slope * ranges)

        ends = np.array([time.events for time in times], dtype=np.int64)
        margins, reaches = margins_along(labels, ends, v, z, history, self._laws)
        # The label and z = label |slope| of the true state are rounded, and so is z = m - V
        # (label/e) of a vertex: the sections of an exactly known z are thinner than that.
        margins += MARGIN_ROUNDING * labels * (np.abs(slope) + reaches / law.closing_speed)
        return np.where(where, margins.min(axis=0), np.inf)

    def _history_beyond_threshold(self, ranges: Floats) -> History:
        """Return the history without the measurements below the range threshold.

        `ranges`, shape (steps, B), are the ranges of the labels. The sets drop a label there.
        """
        history = copy.copy(self._history)
        kinds = history.kinds[: history.events]
        is_measurement = np.isin(kinds, (ANGLE, RATE))
        step_of_event = np.cumsum(kinds == PREDICTION)
        is_beyond = (ranges >= self._min_range_m)[step_of_event[is_measurement]]
        history.applies = history.applies[: history.events].copy()
        history.applies[is_measurement] &= is_beyond
        return history


def _masked_unless_measured(margin: Floats) -> MaskedFloats:
    """Return margins, masked where they are infinite."""
    never = np.isinf(margin)
    return np.ma.MaskedArray(np.where(never, 0.0, margin), mask=never)
