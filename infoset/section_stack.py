"""The stored sections of a batch of engagements, and the passes over them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from infoset import chains
from infoset import section_kernels as kernels
from infoset.section_kernels import SectionLaw, Sections

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class SectionStack:
    """B engagements x S slots of one section each, carried in place.

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
        self.sections = kernels.room_for_sections(labels, used.astype(np.int64))
        self._stale = np.ones(self.batch, dtype=bool)
        self._elapsed = 0
        self._fullest = 4
        kernels.start_all(self.sections, law)

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return int(self.sections.labels.shape[0])

    @property
    def labels(self) -> Floats:
        """Label of every slot, m, shape (B, S)."""
        return self.sections.labels

    @property
    def living(self) -> Flags:
        """Which slots hold a living section, shape (B, S)."""
        return self.sections.living

    @property
    def summaries(self) -> Floats:
        """Summary of each living section, shape (B, S, columns), brought up to date where it is stale."""
        self._refresh()
        return self.sections.summaries

    def _refresh(self) -> None:
        if self._stale.any():
            kernels.summarise_all(self._stale, self._elapsed, self.sections, self.law)
            self._stale[:] = False

    def ranges(self, elapsed: int) -> Floats:
        """Range of every slot after a number of steps, m, shape (B, S)."""
        return self.labels - self.law.closing_speed * (self.law.step * elapsed)

    def make_room(self, vertices: int) -> None:
        """See that each chain of every slot has room for so many vertices."""
        store, marks = self.sections.store, self.sections.marks
        room = (store.shape[2] - chains.VERTICES) // 2
        if room < vertices and room < chains.CAPACITY:
            while room < min(vertices, chains.CAPACITY):
                room *= 2
            wider, _ = chains.empty_sections(len(store), room)
            chains.move_to_wider_rings(store, marks, self.living.ravel(), wider)
            self.sections = self.sections._replace(store=wider)

    def measure_angle(self, active: Flags, alpha: Floats, elapsed: int, event: int) -> None:
        """Cut the living sections by angle measurements (rad)."""
        kernels.measure_all(active, alpha, elapsed, event, self.sections, self.law)
        self._stale &= ~active

    def measure_rate(self, active: Flags, omega: Floats, error: float, elapsed: int, event: int) -> None:
        """Cut the living sections by measured rates of the line of sight (rad/s)."""
        self.make_room(self._fullest + 2 * chains.MOST_ADDED)
        kernels.measure_rate_all(active, omega, error, elapsed, event, self.sections, self.law, chains.working_room())
        self._stale &= ~active
        self._fullest += chains.MOST_ADDED

    def shift(self, active: Flags, impulse: Floats, elapsed: int) -> None:
        """Shift the living sections, and their summaries, by impulses (m/s)."""
        kernels.shift_all(active, impulse, elapsed, self.sections, self.law)

    def predict(self, active: Flags, elapsed: int) -> None:
        """Move the living sections to step `elapsed`."""
        self.make_room(self._fullest + chains.MOST_ADDED)
        self._fullest = kernels.predict_all(active, elapsed, self.sections, self.law, chains.working_room())
        self._stale |= active
        self._elapsed = elapsed

    def keep_labels(self, least: Floats, greatest: Floats, active: Flags) -> Flags:
        """Remove the living sections whose labels are outside [least, greatest]; return which."""
        outside = (self.labels < least[:, None]) | (self.labels > greatest[:, None])
        removed = outside & self.living & active[:, None]
        self.living[removed] = False
        return removed

    def margins(self, v: Floats, z: Floats, elapsed: int) -> Floats:
        """Signed margin of states (V, z) in the first slot of each engagement, m."""
        margins = np.empty(self.batch)
        kernels.margins_all(v, z, elapsed, self.sections, self.law, chains.working_room(), margins)
        return margins

    def widest(self, elapsed: int) -> tuple[Flags, Floats]:
        """Predicted-miss interval of each engagement, as `section_kernels.widest_all` writes it."""
        self._refresh()
        exists, ends = np.zeros(self.batch, dtype=bool), np.zeros((self.batch, 2, 4))
        kernels.widest_all(elapsed, self.sections, self.law, exists, ends)
        return exists, ends

    def polygon(self, engagement: int, slot: int, elapsed: int) -> Floats:
        """Vertices (V, z) of a living section, counter-clockwise, shape (n, 2)."""
        store, marks = self.sections.store, self.sections.marks
        row = engagement * self.labels.shape[1] + slot
        return outline(store, marks, row, float(self.labels[engagement, slot]), elapsed, self.law)

    def copy(self) -> SectionStack:
        """A stack of its own with the same sections."""
        twin = SectionStack.__new__(SectionStack)
        twin.law = self.law
        twin.sections = Sections(**{name: array.copy() for name, array in self.sections._asdict().items()})
        twin._stale, twin._elapsed, twin._fullest = self._stale.copy(), self._elapsed, self._fullest
        return twin


def outline(store: Floats, marks: NDArray[np.int64], row: int, label: float, elapsed: int, law: SectionLaw) -> Floats:
    """Vertices (V, z) of a section, counter-clockwise, shape (n, 2)."""
    points = chains.working_room()
    time_to_go = (label - law.closing_speed * (law.step * elapsed)) / law.closing_speed
    return points[: chains.outline(store, marks, row, time_to_go, points)].copy()
