"""The section at the label of the true state, and the distance of the true state from its boundary.

The label is known only on arrival, because impulses change the arrival time by some nanoseconds through gravity.
Therefore measurements and impulses are stored during the flight and evaluated afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset import SetModel
from infoset.history import History
from infoset.section_law import BOUND_SLACK, section_law
from infoset.section_life import ANGLE, IMPULSE, PREDICTION
from infoset.section_stack import SectionStack
from infoset.set_queries import MaskedFloats
from sim.kepler import Sight

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

LABEL_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)


@dataclass
class _Step:
    """Measurements and impulse of one step, and the true state at its measurements; None without one."""

    where: Flags | None = None
    slope: Floats | None = None
    slope_rate_per_s: Floats | None = None
    alpha_rad: Floats | None = None
    rates: list[tuple[Floats, float]] = field(default_factory=list)
    impulse_m_s: Floats | None = None


class TruthSection:
    """Measurements and impulses of a batch of flights, for the margins of the true states in their sections.

    Notes
    -----
    Angles do not depend on scale: a true motion with closing speed e (1 + eta) has the angles of a model motion at
    range x / (1 + eta), so its label is e T, with T the time at which x = 0.
    """

    def __init__(self, model: SetModel) -> None:
        self._law = section_law(model)
        self._exact_angles = model.is_guaranteed
        self._least_range_m = model.least_range_m
        self._steps = [_Step()]

    def look(self, where: Flags, sight: Sight) -> None:
        """Store which flights measure in this step, and the true states."""
        slope, rate = sight.alpha_rad, sight.omega_rad_s
        if self._exact_angles:
            slope, rate = sight.slope, sight.slope_rate_per_s
        self._steps[-1] = _Step(where.copy(), slope, rate)

    def measure_angle(self, alpha_rad: Floats, where: Flags) -> None:
        """Store a measured angle."""
        self._steps[-1].alpha_rad = alpha_rad.copy()

    def measure_range(
        self, range_m: Floats, relative_error: float, where: Flags, *, alpha_rad: ArrayLike | None
    ) -> None:
        """Do nothing: a range selects labels and does not cut sections."""

    def measure_rate(self, omega_rad_s: Floats, error_rad_s: float, where: Flags) -> None:
        """Store a measured rate."""
        self._steps[-1].rates.append((omega_rad_s.copy(), error_rad_s * (1.0 + BOUND_SLACK)))

    def shift(self, impulse_m_s: Floats) -> None:
        """Store an impulse."""
        self._steps[-1].impulse_m_s = impulse_m_s

    def predict(self) -> None:
        """End the step."""
        self._steps.append(_Step())

    def margins_m(self, arrival_s: Floats) -> list[MaskedFloats]:
        """Return the signed margins (m) of the true states in their sections, one array of shape (B,) per step.

        A margin is that of the last measurement; it is masked before the first one. `arrival_s` are the times from the
        start to x = 0.
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
                # The label of the true state has an error of half an ulp, and so have its z and V.
                now += LABEL_ROUNDING * labels * np.abs(step.slope)
                margin = np.where(where, now, margin)
            margins.append(_if_measured(margin))
            if step.impulse_m_s is not None:
                history.record(IMPULSE, step.impulse_m_s, step.impulse_m_s != 0.0)
                stack.shift(everywhere, step.impulse_m_s, elapsed)
        return margins

    def least_margin_m(self, arrival_s: Floats) -> MaskedFloats:
        """Return the least signed margin of each true state, m; masked where nothing was measured."""
        margins = self.margins_m(arrival_s)
        least = np.min([margin.filled(np.inf) for margin in margins], axis=0)
        return _if_measured(least)


def _if_measured(margin: Floats) -> MaskedFloats:
    never = np.isinf(margin)
    return np.ma.MaskedArray(np.where(never, 0.0, margin), mask=never)
