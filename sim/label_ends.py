"""Misses that the set contains when control ends for a label.

Control ends for a label when it leaves the set below the range threshold, and for all labels after
the last scheduled impulse, after a cut-off, or with the budget spent. All states of a section then
agree with everything that was measured until control ended, so that each of them may be the true
one.
"""

from __future__ import annotations

import numpy as np

from infoset.arrays import Flags, Floats, some
from infoset.engine.section_law import impulse_doubts, section_laws
from infoset.model import SetModel
from infoset.sim.results import Results


class LabelEnds:
    """The misses of the stored sections of a batch of engagements at the end of their control.

    Attributes
    ----------
    published_m : ndarray, shape (B,)
        Maximum predicted miss of the sections when they left the set, m: Phi of the paper.
    left : ndarray of bool, shape (B,)
        Whether a section has left the set.

    Notes
    -----
    Misses along y and z are combined as in Phi: a section in space is the product of both planes.
    Labels between the stored ones are not considered.
    """

    def __init__(self, model: SetModel, batch: int) -> None:
        self._model = model
        self._laws = section_laws(model)
        self.published_m: Floats = np.zeros(batch)
        self.left: Flags = np.zeros(batch, dtype=bool)
        self._exists = np.zeros(batch, dtype=bool)
        # Without control, no later section counts.
        self._is_over = np.zeros(batch, dtype=bool)
        # Sections whose control has ended: engagement, label and misses. Impulses move them until
        # their range is zero.
        self._of = np.empty(0, dtype=np.int64)
        self._labels_m = np.empty(0)
        self._misses_m = np.empty((2, len(self._laws), 0))

    def ends_now(self, control_is_over: Flags) -> bool:
        """Return whether control ends now in an engagement where it had not ended before."""
        return some(control_is_over > self._is_over)

    def fire(self, impulse_m_s: Floats, where: Flags, time_s: float) -> None:
        """Move the labels that have left and have not arrived by impulses of shape (C, B), m/s."""
        if not self._of.size:
            return
        impulse = np.where(where, impulse_m_s, 0.0)
        if not impulse.any():
            return
        doubt = np.stack([impulse_doubts(impulse, law) for law in self._laws])
        to_go_s = np.maximum(self._labels_m / self._model.closing_speed_m_s - time_s, 0.0)
        self._misses_m[0] -= (impulse + doubt)[:, self._of] * to_go_s
        self._misses_m[1] -= (impulse - doubt)[:, self._of] * to_go_s

    def end(
        self,
        left: Flags,
        feasible: Flags,
        control_is_over: Flags,
        labels_m: Floats,
        misses_m: Floats,
    ) -> None:
        """Add the sections whose control ends in this step.

        Parameters
        ----------
        left, feasible : ndarray of bool, shape (B, S)
            Sections that leave the set now, and those that were feasible before.
        control_is_over : ndarray of bool, shape (B,)
            Engagements in which no further impulse can be given.
        labels_m : ndarray, shape (B, S)
            Labels of the sections, m.
        misses_m : ndarray, shape (2, C, B, S)
            Minimum and maximum predicted miss of each section along each lateral axis, m.
        """
        of, slots = np.nonzero(np.where(control_is_over[:, None], feasible, left))
        leaves = left[of, slots]
        counts = ~self._is_over[of]
        misses = misses_m[:, :, of, slots]
        self.left[of[leaves]] = True
        np.maximum.at(self.published_m, of[leaves], _max(misses)[leaves])
        self._is_over = self._is_over | control_is_over
        self._exists[of[counts]] = True
        self._of = np.concatenate((self._of, of[counts]))
        self._labels_m = np.concatenate((self._labels_m, labels_m[of, slots][counts]))
        self._misses_m = np.concatenate((self._misses_m, misses[:, :, counts]), axis=2)

    def any_state_miss_m(self, results: Results) -> Floats:
        """Return the maximum miss of a state that the set contained when control ended for its
        label, m, shape (B,).

        The true state is such a state if it was always inside its section. Where the set became
        empty, or no section has ended, it is the only one.
        """
        ended = self._exists & ~results.set_emptied
        of_truth = np.where(ended & ~results.truth_kept, 0.0, results.miss_m)
        of_sections = np.zeros_like(self.published_m)
        np.maximum.at(of_sections, self._of, _max(self._misses_m) * self._scale(self._labels_m))
        return np.maximum(np.where(ended, of_sections, 0.0), of_truth)

    def _scale(self, labels: Floats) -> Floats:
        """Return the maximum 1 + eta of a label: a length of the guaranteed model times 1 + eta is
        the true one.

        The label is the true range at t = 0 divided by 1 + eta.
        """
        model = self._model
        if not model.is_guaranteed:
            return np.ones_like(labels)
        farthest = model.bounds.x_m[1] * (1.0 + model.gravity_speed_change) / labels
        return np.asarray(np.minimum(1.0 + model.speed_error, farthest))


def _max(misses: Floats) -> Floats:
    """Return the maximum modulus of minimum and maximum misses of shape (2, C, ...), shape
    (...).
    """
    return np.asarray(np.hypot.reduce(np.maximum(misses[1], -misses[0]), axis=0))
