"""The section at the truth's own label: does the information set keep the truth?

The label is known when the truth has arrived, and not before: impulses move it, through gravity, by some nanoseconds
of time. So what happens is noted in flight, and judged afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset import SetModel
from infoset.history import History
from infoset.information_set_view import MaskedFloats
from infoset.section_law import BOUND_SLACK, section_law
from infoset.section_life import ANGLE, IMPULSE, PREDICTION
from infoset.section_stack import SectionStack
from sim.kepler import Sight

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

LABEL_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)


@dataclass
class _Step:
    """What one step did to the sections, and where the truth was when it measured; None where it did not."""

    where: Flags | None = None
    slope: Floats | None = None
    slope_rate_per_s: Floats | None = None
    alpha_rad: Floats | None = None
    rates: list[tuple[Floats, float]] = field(default_factory=list)
    impulse_m_s: Floats | None = None


class TruthSection:
    """What was measured and fired in a batch of flights, to judge whether the truths stayed in their sections.

    Parameters
    ----------
    model : SetModel

    Notes
    -----
    Angles do not see scale: a truth with closing speed e (1 + eta) has the angles of a model motion at range
    x / (1 + eta), so its label is e T with T the time when x = 0.
    """

    def __init__(self, model: SetModel) -> None:
        self._law = section_law(model)
        self._exact_angles = model.is_guaranteed
        self._least_range_m = model.least_range_m
        self._steps = [_Step()]

    def look(self, where: Flags, sight: Sight) -> None:
        """Note which flights measure in this step, and where the true states are."""
        slope, rate = sight.alpha_rad, sight.omega_rad_s
        if self._exact_angles:
            slope, rate = sight.slope, sight.slope_rate_per_s
        self._steps[-1] = _Step(where.copy(), slope, rate)

    def measure_angle(self, alpha_rad: Floats, where: Flags) -> None:
        """Note a measured angle."""
        self._steps[-1].alpha_rad = alpha_rad.copy()

    def measure_range(
        self, range_m: Floats, relative_error: float, where: Flags, *, alpha_rad: ArrayLike | None
    ) -> None:
        """Do nothing: a range selects labels and leaves the true state's section as it is."""

    def measure_rate(self, omega_rad_s: Floats, error_rad_s: float, where: Flags) -> None:
        """Note a measured rate."""
        self._steps[-1].rates.append((omega_rad_s.copy(), error_rad_s * (1.0 + BOUND_SLACK)))

    def shift(self, impulse_m_s: Floats) -> None:
        """Note an impulse."""
        self._steps[-1].impulse_m_s = impulse_m_s

    def predict(self) -> None:
        """Note that a step has ended."""
        self._steps.append(_Step())

    def margins_m(self, arrival_s: Floats) -> list[MaskedFloats]:
        """Signed margins of the truths in their sections after each step's measurement, for the times when x is zero.

        Parameters
        ----------
        arrival_s : ndarray, shape (B,)
            From the start to x = 0, s.

        Returns
        -------
        list of masked array, shape (B,)
            One a step, m, as of the last measurement; masked where nothing was measured yet.
        """
        labels = self._law.closing_speed * arrival_s
        stack = SectionStack(self._law, labels[:, None], np.ones(len(labels), dtype=np.int64))
        history, everywhere = History(len(labels)), np.ones(len(labels), dtype=bool)
        margin = np.full(len(labels), np.inf)
        margins = []
        for elapsed, step in enumerate(self._steps):
            if elapsed:
                history.record(PREDICTION)
                stack.predict(everywhere, elapsed)
            if step.where is not None and step.slope is not None and step.slope_rate_per_s is not None:
                ranges = stack.ranges(elapsed)[:, 0]
                where = step.where & (ranges >= self._least_range_m)
                if step.alpha_rad is not None:
                    history.record(ANGLE, step.alpha_rad, where)
                    stack.measure_angle(where, step.alpha_rad, elapsed, elapsed)
                for omega, error in step.rates:
                    stack.measure_rate(where, omega, error, elapsed, elapsed, history)
                z = step.slope * ranges
                v = step.slope_rate_per_s * ranges - self._law.closing_speed * step.slope
                now = stack.margins(v, z, elapsed)
                now = np.where(stack.living[:, 0], now, stack.sections.overlaps[:, 0])
                # The truth's own label is known to half an ulp, and its z and V as well as that.
                now += LABEL_ROUNDING * labels * np.abs(step.slope)
                margin = np.where(where, now, margin)
            margins.append(_if_measured(margin))
            if step.impulse_m_s is not None:
                history.record(IMPULSE, step.impulse_m_s, step.impulse_m_s != 0.0)
                stack.shift(everywhere, step.impulse_m_s, elapsed)
        return margins

    def least_margin_m(self, arrival_s: Floats) -> MaskedFloats:
        """Least of the signed margins of each truth, m; masked where nothing was measured."""
        margins = self.margins_m(arrival_s)
        least = np.min([each.filled(np.inf) for each in margins], axis=0)
        return _if_measured(least)


def _if_measured(margin: Floats) -> MaskedFloats:
    never = np.isinf(margin)
    return np.ma.MaskedArray(np.where(never, 0.0, margin), mask=never)
