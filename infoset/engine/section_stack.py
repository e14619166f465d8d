"""Stored sections of a batch of engagements, and the operations on them."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats
from infoset.engine import chain_storage, chains, section_life, section_passes
from infoset.engine.chain_storage import Chains
from infoset.engine.history import History
from infoset.engine.section_law import SectionLaw, law_table
from infoset.engine.section_passes import Sections

NO_EVENT = -1


class Freshness(IntEnum):
    """Which parts of a stack are up to date. Each state includes those before it."""

    BEHIND = 0
    """Some sections are one step behind."""
    MOVED = 1
    """All sections are at the present step; some summaries are out of date."""
    SUMMARISED = 2
    """The extremes of the predicted miss are up to date."""
    WITH_HEIGHTS = 3
    """The minimum and the maximum z are up to date too."""


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
        self._none = np.zeros(self.batch, dtype=bool)
        self._freshness = Freshness.MOVED
        # Engagements with sections one step behind, and those with summaries out of date.
        self._behind, self._stale = self._none, np.ones(self.batch, dtype=bool)
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
        self._summarise(Freshness.SUMMARISED)
        return self.sections.summaries

    def extreme_angles(self, elapsed: int) -> Floats:
        """Return the extreme angles of the living sections in the format of `section_passes.extreme_angles_all`."""
        # The predicted misses are usually needed next: one pass computes both.
        self._summarise(Freshness.WITH_HEIGHTS)
        extremes = np.zeros((4, len(self.laws), self.batch))
        section_passes.extreme_angles_all(elapsed, self.sections, self.table, extremes)
        return extremes

    def _summarise(self, wanted: Freshness) -> None:
        """Update the sections and the summaries."""
        if self._freshness < wanted:
            self._update(self._stale, wanted is Freshness.WITH_HEIGHTS)
            self._stale, self._freshness = self._none, wanted

    def _catch_up(self) -> None:
        """Move the sections that are behind to the present step."""
        if self._freshness is Freshness.BEHIND:
            self._update(self._none, False)
            self._freshness = Freshness.MOVED

    def _update(self, stale: Flags, heights_wanted: bool) -> None:
        """Move the sections that are behind, and summarise the stale ones."""
        alpha = np.empty((len(self.laws), 0))
        section_passes.step_all(
            self._behind, self._none, stale, heights_wanted, alpha, self._elapsed, NO_EVENT, self.sections, self.table
        )
        self._behind = self._none

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
            self.sections = self.sections._replace(rings=chain_storage.with_room(self.sections.rings, floats))
            _, spare = make_room(active, chain_storage.ROOM_AHEAD, elapsed, self.sections, self.table, points, True)
        self._spare = spare - chains.MAX_ADDED

    def make_room_for_new(self, wanted: Flags, number: int) -> None:
        """Allocate room for `number` sections of any size in each of the wanted engagements."""
        self._catch_up()
        self._freshness = min(self._freshness, Freshness.SUMMARISED)
        new = number * int(np.count_nonzero(wanted)) * len(self.laws)
        floats = 2 * (2 * chains.CAPACITY + chain_storage.LINE) * new
        self.sections = self.sections._replace(rings=chain_storage.with_room(self.sections.rings, floats))

    def note_new(self, spare: int) -> None:
        """Register new sections, each of which may gain at least `spare` vertices."""
        self._spare = min(self._spare, spare)
        self.min_label = self._min_label()

    def _min_label(self) -> float:
        return float(np.where(self.living, self.labels, np.inf).min())

    def measure_angle(self, active: Flags, alpha: Floats, elapsed: int, event: int) -> int:
        """Cut the living sections by angles of shape (C, B), rad; return the number of labels that became empty."""
        deaths = section_passes.step_all(
            self._behind, active, self._none, False, alpha, elapsed, event, self.sections, self.table
        )
        self._behind = self._none
        self._set_summarised(active)
        return deaths

    def measure_rate(
        self, active: Flags, omega: Floats, error: float, elapsed: int, event: int, history: History
    ) -> int:
        """Cut the living sections by rates of shape (C, B), rad/s; return the number of labels that became empty."""
        self._catch_up()
        self._make_room(active)
        deaths = section_passes.measure_rate_all(
            active,
            omega,
            error,
            elapsed,
            event,
            history.tapes,
            history.seen,
            history.sights,
            self.sections,
            self.table,
            chain_storage.working_room(),
        )
        history.seen = history.events
        self._set_summarised(active)
        return deaths

    def _set_summarised(self, active: Flags) -> None:
        """Register that a cut has updated the summaries of the active engagements, except the heights."""
        if self._freshness < Freshness.SUMMARISED:
            self._stale = self._stale & ~active
        self._freshness = Freshness.MOVED if self._stale.any() else Freshness.SUMMARISED

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
        self._behind = active.copy()
        self._stale = self._stale | active if self._freshness < Freshness.SUMMARISED else self._behind
        self._freshness = Freshness.BEHIND
        self._elapsed = elapsed

    def keep_labels(self, minimum: Floats, maximum: Floats, active: Flags) -> tuple[Flags, int]:
        """Remove the living sections with labels outside [minimum, maximum]; return a mask of them and their number."""
        removed = np.zeros(self.labels.shape, dtype=bool)
        return removed, section_passes.keep_labels_all(active, minimum, maximum, self.sections, removed)

    def widest(self, elapsed: int, pending: Sequence[tuple[float, Floats]] = ()) -> tuple[Flags, Floats]:
        """Return the predicted-miss interval of each engagement in the format of `section_passes.widest_all`.

        `pending` are later impulses that count as given: time from now, s, and impulse, m/s, shape (C, B).
        """
        self._summarise(Freshness.SUMMARISED)
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
        section = Chains(self.sections.records, self.sections.rings)
        return outline(section, row, float(self.labels[engagement, slot]), elapsed, self.law)

    def copy(self) -> SectionStack:
        """Return an independent copy."""
        twin = copy.copy(self)
        arrays = {name: array.copy() for name, array in self.sections._asdict().items() if name != "rings"}
        twin.sections = Sections(
            **arrays, rings=chain_storage.copy_of_rings(self.sections.rings, self.sections.rings.size)
        )
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
    return points[: section_passes.write_outline(*section, row, time_to_go, points)].copy()
