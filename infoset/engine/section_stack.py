"""Stored sections of a batch of engagements, and the operations on them."""

from __future__ import annotations

import copy
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats
from infoset.engine import chain_storage, chains, section_life, section_passes
from infoset.engine.chain_storage import Chains
from infoset.engine.history import History
from infoset.engine.section_law import SectionLaw, law_table
from infoset.engine.section_passes import MOVED, NO_EVENT, SUMMARISED, WITH_HEIGHTS, Sections


class SectionStack:
    """B engagements x S slots for one section each, in the plane of each of C lateral axes, updated in place.

    Parameters
    ----------
    labels : ndarray, shape (B, S)
        Label of each slot, m; the slots in use are first, with increasing labels.
    used : ndarray of int, shape (B,)
        Number of slots in use.

    Attributes
    ----------
    min_label : float
        Lower bound of the labels of living sections, m.
    """

    def __init__(self, laws: tuple[SectionLaw, ...], labels: Floats, used: NDArray[np.int64]) -> None:
        self.laws = laws
        self.table = law_table(laws)
        self.sections = section_passes.room_for_sections(len(laws), labels, used.astype(np.int64))
        self._none, self._no_angles = np.zeros(self.batch, dtype=bool), np.empty((len(laws), 0))
        # Vertices that every section may still gain, and the present step.
        self._spare = self._elapsed = 0
        section_passes.start_all(self.sections, self.table)
        self.min_label = self._min_label()

    @property
    def law(self) -> SectionLaw:
        """Constants of the model that all axes have in common, in those of one axis."""
        return self.laws[-1]

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return len(self.sections.used)

    @property
    def labels(self) -> Floats:
        """Label of every slot, m, shape (B, S)."""
        return self.sections.slots["label"]

    @property
    def living(self) -> Flags:
        """Whether each slot contains a living section, shape (B, S)."""
        return self.sections.slots["living"]

    @property
    def summaries(self) -> Floats:
        """Summaries of the living sections, shape (C, B, S, columns). The columns of z may be out of date."""
        self._summarise()
        return self.sections.summaries

    def extreme_angles(self, elapsed: int) -> Floats:
        """Return the extreme angles of the living sections in the format of `section_passes.extreme_angles_all`."""
        # The predicted misses are usually needed next: one pass computes both.
        self._update(WITH_HEIGHTS)
        extremes = np.zeros((4, len(self.laws), self.batch))
        section_passes.extreme_angles_all(elapsed, self.sections, self.table, extremes)
        return extremes

    def _summarise(self) -> None:
        """Bring the sections and the predicted misses in their summaries up to date."""
        if self.sections.stale.any():
            self._update(SUMMARISED)

    def _catch_up(self) -> None:
        """Move the sections that are behind to the present step."""
        if self.sections.behind.any():
            self._update(MOVED)

    def _update(self, wanted: int) -> None:
        section_passes.step_all(self._none, self._no_angles, NO_EVENT, self._elapsed, wanted, self.sections, self.table)

    def ranges(self, elapsed: int) -> Floats:
        """Return the range of every slot after a number of steps, m, shape (B, S)."""
        return self.labels - self.law.closing_speed * (self.law.step * elapsed)

    def _make_room(self, active: Flags) -> None:
        """Give each living section room for the vertices that one step adds.

        Only the active engagements change, but the others may use their room later without another count.
        """
        self._spare -= chains.MAX_ADDED
        if self._spare >= 0:
            return
        elapsed, points = self._elapsed, chain_storage.working_room()
        make_room = section_passes.make_room_all
        floats, spare = make_room(active, chain_storage.ROOM_AHEAD, elapsed, self.sections, self.table, points, False)
        if floats or spare < chains.MAX_ADDED:
            self._add_room(floats)
            _, spare = make_room(active, chain_storage.ROOM_AHEAD, elapsed, self.sections, self.table, points, True)
        self._spare = spare - chains.MAX_ADDED

    def _add_room(self, floats: int) -> None:
        """Allocate `floats` more floats of the rings."""
        records, rings = self.sections.chains
        self.sections = self.sections._replace(chains=Chains(records, chain_storage.with_room(rings, floats)))

    def make_room_for_new(self, wanted: Flags, number: int) -> None:
        """Allocate room for `number` sections of any size in each of the wanted engagements."""
        self._catch_up()
        new = number * int(np.count_nonzero(wanted)) * len(self.laws)
        floats = 2 * (2 * chains.CAPACITY + chain_storage.LINE) * new
        self._add_room(floats)

    def note_new(self, spare: int) -> None:
        """Register new sections, each of which may gain at least `spare` vertices."""
        self._spare = min(self._spare, spare)
        self.min_label = self._min_label()

    def _min_label(self) -> float:
        return float(np.where(self.living, self.labels, np.inf).min())

    def measure_rate(self, error: float, history: History) -> int:
        """Cut the living sections by the rates of the latest event; return the number of labels that became empty."""
        self._catch_up()
        self._make_room(history.applies[history.events - 1])
        deaths = section_passes.measure_rate_all(
            history.log, error, history.seen, history.sights, self.sections, self.table, chain_storage.working_room()
        )
        history.seen = history.events
        return deaths

    def shift(self, active: Flags, impulse: Floats, elapsed: int) -> None:
        """Shift the living sections and their summaries by impulses of shape (C, B), m/s."""
        self._catch_up()
        section_passes.shift_all(active, impulse, elapsed, self.sections, self.table)

    def predict(self, active: Flags, elapsed: int) -> None:
        """Move the living sections to step `elapsed`.

        The move is postponed to the next measurement or query, so that one pass over the memory does both.
        """
        self._catch_up()
        self._make_room(active)
        self.sections.behind[:] = active
        self.sections.stale[active] = True
        self._elapsed = elapsed

    def keep_labels(self, minimum: Floats, maximum: Floats, active: Flags) -> tuple[Flags, int]:
        """Remove the living sections with labels outside [minimum, maximum]; return a mask of them and their number."""
        removed = np.zeros(self.labels.shape, dtype=bool)
        return removed, section_passes.keep_labels_all(active, minimum, maximum, self.sections, removed)

    def widest(self, elapsed: int, pending: Sequence[tuple[float, Floats]] = ()) -> tuple[Flags, Floats]:
        """Return the predicted-miss interval of each engagement in the format of `section_passes.widest_all`.

        `pending` are later impulses that count as given: time from now, s, and impulse, m/s, shape (C, B).
        """
        self._summarise()
        exists, ends = np.zeros(self.batch, dtype=bool), np.zeros((len(self.laws), self.batch, 2, 4))
        sections = self.sections
        if pending:
            sections = sections._replace(summaries=self._summaries_after(pending, elapsed))
        section_passes.widest_all(elapsed, sections, self.table, exists, ends)
        return exists, ends

    def _summaries_after(self, pending: Sequence[tuple[float, Floats]], elapsed: int) -> Floats:
        """Return the summaries with the predicted misses after later impulses, as `shift` would change them."""
        summaries, to_go = self.sections.summaries.copy(), self.ranges(elapsed) / self.law.closing_speed
        for time_s, impulse in pending:
            lever = np.maximum(to_go - time_s, 0.0)
            doubt = np.stack([impulse_doubts(impulse, law) for law in self.laws])
            summaries[..., section_life.UPPER_MISS] += (doubt - impulse)[..., None] * lever
            summaries[..., section_life.LOWER_MISS] -= (doubt + impulse)[..., None] * lever
        return summaries

    def polygon(self, channel: int, engagement: int, slot: int, elapsed: int) -> Floats:
        """Return the vertices (V, z) of a living section, counter-clockwise, shape (n, 2)."""
        self._catch_up()
        row = (channel * self.batch + engagement) * self.labels.shape[1] + slot
        return outline(self.sections.chains, row, float(self.labels[engagement, slot]), elapsed, self.law)

    def copy(self) -> SectionStack:
        """Return an independent copy."""
        twin = copy.copy(self)
        records, rings = self.sections.chains
        arrays = {name: array.copy() for name, array in self.sections._asdict().items() if name != "chains"}
        chains = Chains(records.copy(), chain_storage.copy_of_rings(rings, rings.size))
        twin.sections = Sections(**arrays, chains=chains)
        return twin


def impulse_doubts(impulse: Floats, law: SectionLaw) -> Floats:
    """Return the error bounds of impulses of shape (C, B) along an axis, m/s, shape (B,), as `impulse_doubt` does."""
    along = np.abs(impulse[law.channel])
    if law.pointing_across == 0.0:
        return np.asarray(law.impulse_error * along)
    size = np.hypot.reduce(impulse, axis=0)
    return np.asarray(law.impulse_error * along + (law.pointing_along * along + law.pointing_across * size))


def outline(section: Chains, row: int, label: float, elapsed: int, law: SectionLaw) -> Floats:
    """Return the vertices (V, z) of a section, counter-clockwise, shape (n, 2)."""
    points = chain_storage.working_room()
    time_to_go = (label - law.closing_speed * (law.step * elapsed)) / law.closing_speed
    return points[: section_passes.write_outline(section, row, time_to_go, points)].copy()
