"""The section at the truth's own label: does the information set keep the truth?"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from infoset import SetModel
from infoset.information_set import section_law
from infoset.section_stack import SectionStack
from sim.kepler import Sight, X

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class TruthSection:
    """The section whose label is the truth's, one an engagement, carried beside the set that is on board.

    Parameters
    ----------
    model : SetModel
    position_m, velocity_m_s : ndarray, shape (B, 2)
        The truth at t = 0: (z, x) and (V_z, V_x).

    Notes
    -----
    Angles do not see scale: a truth with closing speed e (1 + eta) has the angles of a model motion at range
    x / (1 + eta), so its label is e T with T the time when x = 0.
    """

    def __init__(self, model: SetModel, position_m: Floats, velocity_m_s: Floats) -> None:
        law = section_law(model)
        labels = position_m[:, X] * (model.closing_speed_m_s / -velocity_m_s[:, X])
        self._threshold_m = model.range_threshold_m
        self._stack = SectionStack(law, labels[:, None], np.ones(len(labels), dtype=np.int64))
        self._elapsed = 0
        self._everywhere = np.ones(len(labels), dtype=bool)
        self.margin_m = np.full(len(labels), np.inf)
        self.least_margin_m = np.full(len(labels), np.inf)

    def measure(self, alpha_rad: Floats, where: Flags, sight: Sight) -> None:
        """Cut by a measured angle, and see how deep inside the truth is then."""
        ranges = self._stack.ranges(self._elapsed)[:, 0]
        where = where & (ranges >= self._threshold_m)
        self._stack.measure_angle(where, alpha_rad, self._elapsed, self._elapsed)
        z = sight.alpha_rad * ranges
        v = sight.omega_rad_s * ranges - self._stack.law.closing_speed * sight.alpha_rad
        margin = self._stack.margins(v, z, self._elapsed)
        margin = np.where(self._stack.living[:, 0], margin, self._stack.sections.overlaps[:, 0])
        self.margin_m = np.where(where, margin, self.margin_m)
        self.least_margin_m = np.minimum(self.least_margin_m, self.margin_m)

    def shift(self, impulse_m_s: Floats) -> None:
        """Shift by an impulse."""
        self._stack.shift(self._everywhere, impulse_m_s, self._elapsed)

    def predict(self) -> None:
        """Move one step on."""
        self._elapsed += 1
        self._stack.predict(self._everywhere, self._elapsed)
