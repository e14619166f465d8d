"""The stored sections of a batch of engagements, and the passes over them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from infoset import section_kernels as kernels
from infoset.section_kernels import SectionLaw

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

ROOM_AT_START = 64
MOST_ADDED_A_STEP = 4


class SectionStack:
    """B engagements x S slots of one polygon of (V, z) each, carried in place.

    Parameters
    ----------
    law : SectionLaw
    labels : ndarray, shape (B, S)
        Label of each slot, m; the slots in use come first, in rising order.
    used : ndarray of int, shape (B,)
        Number of slots in use.
    """

    def __init__(self, law: SectionLaw, labels: Floats, used: NDArray[np.int64]) -> None:
        self.law = law
        self.labels = labels
        self.used = used.astype(np.int64)
        self.batch, slots = labels.shape
        self.vertices = np.empty((self.batch, slots, ROOM_AT_START, 2))
        self.counts = np.zeros((self.batch, slots), dtype=np.int64)
        self.died = np.full((self.batch, slots), kernels.ALIVE, dtype=np.int64)
        self.overlaps = np.zeros((self.batch, slots))
        self._summaries = np.zeros((self.batch, slots, kernels.SUMMARY_COLUMNS))
        self._stale = np.ones(self.batch, dtype=bool)
        self._elapsed = 0
        kernels.start_all(self.labels, self.used, law, self.vertices, self.counts)

    @property
    def living(self) -> Flags:
        """Which slots hold a living section, shape (B, S)."""
        return self.counts > 0

    def ranges(self, elapsed: int) -> Floats:
        """Range of every slot after a number of steps, m, shape (B, S)."""
        return self.labels - self.law.closing_speed * (self.law.step * elapsed)

    @property
    def summaries(self) -> Floats:
        """Summary of each living section, shape (B, S, columns), brought up to date where it is stale."""
        if self._stale.any():
            kernels.summarise_all(
                self._stale,
                self._elapsed,
                self.labels,
                self.used,
                self.law,
                self.vertices,
                self.counts,
                self._summaries,
            )
            self._stale[:] = False
        return self._summaries

    def written_summaries(self, where: Flags) -> Floats:
        """The summaries, for a caller that writes those of some engagements itself."""
        self._stale &= ~where
        return self._summaries

    def make_room(self, vertices: int) -> None:
        """See that every slot has room for so many vertices; small slots lie closer together in the cache."""
        room = self.vertices.shape[2]
        if room < vertices:
            wider = np.empty((*self.counts.shape, min(max(vertices, 2 * room), kernels.VERTEX_CAPACITY), 2))
            wider[:, :, :room] = self.vertices
            self.vertices = wider

    def _make_room_for_a_step(self) -> None:
        self.make_room(min(int(self.counts.max()) + MOST_ADDED_A_STEP, kernels.VERTEX_CAPACITY))

    def measure_angle(self, active: Flags, alpha: Floats, elapsed: int, event: int) -> None:
        """Cut the living sections by angle measurements (rad)."""
        self._make_room_for_a_step()
        kernels.measure_all(
            active,
            alpha,
            elapsed,
            event,
            self.labels,
            self.used,
            self.law,
            self.vertices,
            self.counts,
            self.died,
            self.overlaps,
            self.written_summaries(active),
        )

    def shift(self, active: Flags, impulse: Floats, elapsed: int) -> None:
        """Shift the living sections, and their summaries, by impulses (m/s)."""
        kernels.shift_all(
            active, impulse, elapsed, self.labels, self.used, self.law, self.vertices, self.counts, self._summaries
        )

    def predict(self, active: Flags, elapsed: int) -> None:
        """Move the living sections to step `elapsed`."""
        self._make_room_for_a_step()
        kernels.predict_all(active, self.used, self.law, self.vertices, self.counts)
        self._stale |= active
        self._elapsed = elapsed

    def keep_labels(self, least: Floats, greatest: Floats, active: Flags) -> Flags:
        """Remove the living sections whose labels are outside [least, greatest]; return which."""
        outside = (self.labels < least[:, None]) | (self.labels > greatest[:, None])
        removed = outside & self.living & active[:, None]
        self.counts[removed] = 0
        return removed

    def margins(self, v: Floats, z: Floats, elapsed: int) -> Floats:
        """Signed margin of states (V, z) in the first slot of each engagement, m."""
        return kernels.margins_all(v, z, elapsed, self.labels, self.law, self.vertices, self.counts)

    def copy(self) -> SectionStack:
        """A stack of its own with the same sections."""
        twin = SectionStack.__new__(SectionStack)
        twin.law, twin.batch = self.law, self.batch
        twin.labels, twin.used, twin.vertices = self.labels.copy(), self.used.copy(), self.vertices.copy()
        twin.counts, twin.died, twin.overlaps = self.counts.copy(), self.died.copy(), self.overlaps.copy()
        twin._summaries, twin._stale, twin._elapsed = self._summaries.copy(), self._stale.copy(), self._elapsed
        return twin
