"""Misses that the set contains when control ends for a label.

Control ends for a label when it leaves the set below the range threshold, and for all labels after
the last scheduled impulse, after a cut-off, or with the budget spent. All states of a section then
agree with everything that was measured until control ended, so that each of them may be the true
one.
"""

from __future__ import annotations

import numpy as np

from infoset.arrays import Flags, Floats, some
from infoset.engine.section_law import change_of_miss, section_laws
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
        # Engagements with a section whose control has ended, shape (B,).
        self._has_ended = np.zeros(batch, dtype=bool)
        # Engagements whose control is over, shape (B,): sections that leave afterwards are not
        # added.
        self._is_over = np.zeros(batch, dtype=bool)
        # Sections whose control has ended: engagement, label (m) and minimum and maximum miss (m),
        # shape (2, C, sections). Impulses move them until their range is zero.
        self._engagements = np.empty(0, dtype=np.int64)
        self._labels_m = np.empty(0)
        self._misses_m = np.empty((2, len(self._laws), 0))

    def ends_now(self, control_is_over: Flags) -> bool:
        """Return whether control ends now in an engagement where it had not ended before."""
        return some(control_is_over > self._is_over)

    def fire(self, impulse_m_s: Floats, where: Flags, time_s: float) -> None:
        """Change the misses of labels whose control has ended by impulses, m/s, shape (C, B).

        Impulses that were decided before can still be given then. A label whose range is zero at
        `time_s` keeps its miss.
        """
        # In most steps nothing changes; these two returns only save time.
        if not self._engagements.size:
            return
        impulse = np.where(where, impulse_m_s, 0.0)
        if not impulse.any():
            return

        # The executed impulse is not known exactly: the misses move by its two ends.
        of_labels = impulse[:, self._engagements]
        to_go_s = np.maximum(self._labels_m / self._model.closing_speed_m_s - time_s, 0.0)
        for channel, law in enumerate(self._laws):
            change = change_of_miss(of_labels, to_go_s, law)
            self._misses_m[0, channel] -= change.greatest
            self._misses_m[1, channel] -= change.least

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
            Sections that leave the set now, and all sections that it had before they leave.
        control_is_over : ndarray of bool, shape (B,)
            Engagements in which no further impulse can be given.
        labels_m : ndarray, shape (B, S)
            Labels of the sections, m.
        misses_m : ndarray, shape (2, C, B, S)
            Minimum and maximum predicted miss of each section along each lateral axis, m.
        """
        engagements, slots = np.nonzero(np.where(control_is_over[:, None], feasible, left))
        labels = labels_m[engagements, slots]
        misses = misses_m[:, :, engagements, slots]

        leaves = left[engagements, slots]
        leaving = engagements[leaves]
        self.left[leaving] = True
        np.maximum.at(self.published_m, leaving, _max(misses)[leaves])

        counts = ~self._is_over[engagements]
        self._has_ended[engagements[counts]] = True
        self._engagements = np.concatenate((self._engagements, engagements[counts]))
        self._labels_m = np.concatenate((self._labels_m, labels[counts]))
        self._misses_m = np.concatenate((self._misses_m, misses[:, :, counts]), axis=2)
        self._is_over = self._is_over | control_is_over

    def any_state_miss_m(self, results: Results) -> Floats:
        """Return the maximum miss of a state that the set contained when control ended for its
        label, m, shape (B,).

        The true state is such a state if it was always inside its section. Where the set became
        empty, or no section has ended, only the true state counts.
        """
        ended = self._has_ended & ~results.set_emptied
        truth_m = np.where(ended & ~results.truth_kept, 0.0, results.miss_m)
        misses_m = self._true_misses_m()
        sections_m = np.zeros_like(self.published_m)
        np.maximum.at(sections_m, self._engagements, misses_m)
        return np.maximum(np.where(ended, sections_m, 0.0), truth_m)

    def _true_misses_m(self) -> Floats:
        """Return the maximum true miss of each section, m."""
        scale = self._scale(self._labels_m)
        aim_m = self._model.lateral_aim_m[:, None]
        if not aim_m.any():
            return np.asarray(_max(self._misses_m) * scale)
        # The aim point is a true length already.
        return _max((self._misses_m - aim_m) * scale + aim_m)

    def _scale(self, labels: Floats) -> Floats:
        """Return the maximum of 1 + eta for each label: the ratio of true lengths to the model's.

        A label is the true range at t = 0 divided by 1 + eta.
        """
        model = self._model
        if not model.is_guaranteed:
            return np.ones_like(labels)
        # The range by the label is 1 + eta of the mean closing speed. At the arrival eta may be
        # greater, by at most the change by gravity.
        farthest = model.bounds.x_m[1] * (1.0 + model.gravity_speed_change) / labels
        return np.asarray(np.minimum(1.0 + model.speed_error, farthest))


def _max(misses: Floats) -> Floats:
    """Return the maximum modulus, shape (...), of misses between two ends, shape (2, C, ...)."""
    lower, upper = misses
    return np.asarray(np.hypot.reduce(np.maximum(upper, -lower), axis=0))
