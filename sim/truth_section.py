"""The section at the truth's own label: does the information set keep the truth?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from infoset import SetModel
from infoset.information_set_view import MaskedFloats
from infoset.section_law import BOUND_SLACK, section_law
from infoset.section_stack import SectionStack
from sim.kepler import Sight

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

LABEL_ROUNDING = 4.0 * float(np.finfo(np.float64).eps)


class TruthSection:
    """The section whose label is the truth's, one an engagement, carried beside the set that is on board.

    Parameters
    ----------
    model : SetModel
    arrival_s : ndarray, shape (B,)
        Time T when the truth's x is zero.

    Notes
    -----
    Angles do not see scale: a truth with closing speed e (1 + eta) has the angles of a model motion at range
    x / (1 + eta), so its label is e T with T the time when x = 0.
    """

    def __init__(self, model: SetModel, arrival_s: Floats) -> None:
        law = section_law(model)
        labels = model.closing_speed_m_s * arrival_s
        self._exact_angles = model.is_guaranteed
        self._threshold_m = model.range_threshold_m
        self._stack = SectionStack(law, labels[:, None], np.ones(len(labels), dtype=np.int64))
        self._elapsed = 0
        self._everywhere = np.ones(len(labels), dtype=bool)
        self._margin = np.full(len(labels), np.inf)
        self._least_margin = np.full(len(labels), np.inf)

    @property
    def margin_m(self) -> MaskedFloats:
        """Signed margin of each truth as of its last measurement, m; masked where nothing was measured yet."""
        return _if_measured(self._margin)

    @property
    def least_margin_m(self) -> MaskedFloats:
        """Least of the signed margins so far, m; masked where nothing was measured yet."""
        return _if_measured(self._least_margin)

    def measure(
        self, alpha_rad: Floats | None, omega_rad_s: Floats | None, rate_error_rad_s: float, where: Flags, sight: Sight
    ) -> None:
        """Cut by what was measured, and see how deep inside the truth is then."""
        ranges = self._stack.ranges(self._elapsed)[:, 0]
        where = where & (ranges >= self._threshold_m)
        if alpha_rad is not None:
            self._stack.measure_angle(where, alpha_rad, self._elapsed, self._elapsed)
        if omega_rad_s is not None:
            error = rate_error_rad_s * (1.0 + BOUND_SLACK)
            self._stack.measure_rate(where, omega_rad_s, error, self._elapsed, self._elapsed)
        slope, rate = sight.alpha_rad, sight.omega_rad_s
        if self._exact_angles:
            slope, rate = sight.slope, sight.slope_rate_per_s
        z = slope * ranges
        v = rate * ranges - self._stack.law.closing_speed * slope
        margin = self._stack.margins(v, z, self._elapsed)
        margin = np.where(self._stack.living[:, 0], margin, self._stack.sections.overlaps[:, 0])
        # The truth's own label is known to half an ulp, and its z and V as well as that.
        margin += LABEL_ROUNDING * self._stack.labels[:, 0] * np.abs(slope)
        self._margin = np.where(where, margin, self._margin)
        self._least_margin = np.minimum(self._least_margin, self._margin)

    def shift(self, impulse_m_s: Floats) -> None:
        """Shift by an impulse."""
        self._stack.shift(self._everywhere, impulse_m_s, self._elapsed)

    def predict(self) -> None:
        """Move one step on."""
        self._elapsed += 1
        self._stack.predict(self._everywhere, self._elapsed)


def _if_measured(margin: Floats) -> MaskedFloats:
    never = np.isinf(margin)
    return np.ma.MaskedArray(np.where(never, 0.0, margin), mask=never)
