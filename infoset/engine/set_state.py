"""State of a batch of information sets: stored sections, history, limits of the labels, and
status.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from enum import Enum

import numpy as np

from infoset.arrays import Flags, Floats, Integers, some
from infoset.engine import chain_storage, chains, section_life, section_passes
from infoset.engine.chain_storage import Chains
from infoset.engine.guaranteed_miss import GuaranteedMiss
from infoset.engine.history import PREDICTION, History
from infoset.engine.location import refine_all
from infoset.engine.replays import past_of
from infoset.engine.section_law import SectionLaw, impulse_doubts, law_table, section_laws
from infoset.engine.section_passes import MOVED, NO_EVENT, SUMMARISED, WITH_HEIGHTS, Sections
from infoset.model import SetModel


class SetStatus(Enum):
    """Status of an information set."""

    TRACKING = 0
    """The set contains states above the range threshold."""
    EMPTY = 1
    """No state agrees with the data, no section has passed below the threshold, and the set was not
    recovered.
    """
    FINISHED = 2
    """All sections have passed below the range threshold."""
    REFUTED = 3
    """The data exclude all states above the threshold; the true state has passed below it."""
    STOPPED = 4
    """The caller stopped the computation."""


class SetState:
    """State of B information sets, updated in place. A set and its read-only views share one
    object.

    Attributes
    ----------
    sections : Sections
        The stored sections: S slots for each engagement, in the plane of each of C lateral axes.
    history : History
        The events so far.
    min_label : float
        Lower bound of the labels of feasible sections, m.
    lower_label, upper_label : ndarray, shape (B,)
        Limits of the labels, m.
    status : ndarray of int, shape (B,)
        Values of `SetStatus`.
    some_left : ndarray of bool, shape (B,)
        Whether some label has passed below the range threshold.
    lost_step : ndarray of int, shape (B,)
        Step at which the set first became empty; -1 if it never did.
    lost_label : ndarray, shape (B,)
        Label closest to feasibility at that step, m.
    phi : GuaranteedMiss or None
        The guaranteed miss; None if it is not computed.
    """

    def __init__(self, model: SetModel, batch: int, guarantee: bool) -> None:
        self.model = model
        self.laws = section_laws(model)
        self.table = law_table(self.laws)
        minimum, maximum = model.label_limits_m
        labels = np.full((batch, max(model.sections, 2 * model.fewest_sections + 1)), maximum)
        labels[:, : model.sections] = (
            np.linspace(minimum, maximum, model.sections)
            if model.sections > 1
            else 0.5 * (minimum + maximum)
        )
        used = np.full(batch, model.sections)
        self.sections = section_passes.room_for_sections(len(self.laws), labels, used)
        self.history = History(len(self.laws), batch)
        self.lower_label = np.full(batch, minimum)
        self.upper_label = np.full(batch, maximum)
        self.status = np.full(batch, SetStatus.TRACKING.value, dtype=np.int64)
        self.some_left = np.zeros(batch, dtype=bool)
        self.lost_step = np.full(batch, -1, dtype=np.int64)
        self.lost_label = np.zeros(batch)
        has_phi = guarantee and model.is_guaranteed
        self.phi = GuaranteedMiss(self.laws[0], batch, model.speed_error) if has_phi else None
        self._none, self._no_angles = np.zeros(batch, dtype=bool), np.empty((len(self.laws), 0))
        # Vertices that every section may still gain.
        self._spare = 0
        section_passes.start_all(self.sections, self.table)
        self.min_label = self._min_label()

    @property
    def law(self) -> SectionLaw:
        """Constants of the model that all axes have in common, in those of one axis."""
        return self.laws[-1]

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return len(self.status)

    @property
    def elapsed(self) -> int:
        """Number of steps so far."""
        return self.history.elapsed

    @property
    def labels(self) -> Floats:
        """Label of every slot, m, shape (B, S)."""
        return self.sections.slots["label"]

    @property
    def feasible(self) -> Flags:
        """Whether each slot contains a feasible section, shape (B, S)."""
        return self.sections.slots["feasible"]

    @property
    def section_counts(self) -> Integers:
        """Number of feasible sections, shape (B,)."""
        counts = np.empty(self.batch, dtype=np.int64)
        section_passes.count_all(self.sections, counts)
        return counts

    @property
    def ranges(self) -> Floats:
        """Range of every slot now, m, shape (B, S)."""
        return self.labels - self.law.closing_speed * (self.law.step * self.elapsed)

    @property
    def summaries(self) -> Floats:
        """Summaries of the feasible sections, shape (C, B, S, columns). The columns of z may be out
        of date.
        """
        if some(self.sections.stale):
            self._update(SUMMARISED)
        return self.sections.summaries

    def extreme_angles(self) -> Floats:
        """Return the extreme angles of the feasible sections in the format of
        `section_passes.extreme_angles_all`.
        """
        # The predicted misses are usually needed next: one pass computes both.
        self._update(WITH_HEIGHTS)
        extremes = np.zeros((4, len(self.laws), self.batch))
        section_passes.extreme_angles_all(self.elapsed, self.sections, self.table, extremes)
        return extremes

    def _catch_up(self) -> None:
        """Move the sections that are behind to the present step."""
        if some(self.sections.behind):
            self._update(MOVED)

    def _update(self, wanted: int) -> None:
        section_passes.step_all(
            self._none, self._no_angles, NO_EVENT, self.elapsed, wanted, self.sections, self.table
        )

    def _make_room(self, active: Flags) -> None:
        """Give each feasible section room for the vertices that one step adds.

        Only the active engagements change, but the others may use their room later without another
        count.
        """
        self._spare -= chains.MAX_ADDED
        if self._spare >= 0:
            return
        points = chain_storage.working_room()
        added = chain_storage.ROOM_AHEAD
        make_room = section_passes.make_room_all
        floats, spare = make_room(
            active, added, self.elapsed, self.sections, self.table, points, False
        )
        if floats or spare < chains.MAX_ADDED:
            self._add_room(floats)
            _, spare = make_room(
                active, added, self.elapsed, self.sections, self.table, points, True
            )
        self._spare = spare - chains.MAX_ADDED

    def _add_room(self, floats: int) -> None:
        """Allocate `floats` more floats of the rings."""
        records, rings = self.sections.chains
        self.sections = self.sections._replace(
            chains=Chains(records, chain_storage.with_room(rings, floats))
        )

    def refine(self, wanted: Flags, number: int) -> None:
        """Replace the sections of the wanted engagements by a grid over their feasible labels,
        found by replay.
        """
        self._catch_up()
        new = number * int(np.count_nonzero(wanted)) * len(self.laws)
        self._add_room(2 * (2 * chains.CAPACITY + chain_storage.LINE) * new)
        limits = (self.lower_label, self.upper_label)
        past = past_of(self.history, self.table, self.labels.shape[1])
        self._spare = min(self._spare, refine_all(wanted, number, limits, past, self.sections))
        self.min_label = self._min_label()

    def _min_label(self) -> float:
        return float(np.where(self.feasible, self.labels, np.inf).min())

    def measure_rate(self, error: float) -> int:
        """Cut the feasible sections by the rates of the latest event; return the number of labels
        that became empty.
        """
        history = self.history
        self._catch_up()
        self._make_room(history.applies[history.events - 1])
        points = chain_storage.working_room()
        newly_emptied = section_passes.measure_rate_all(
            history.log, error, history.seen, history.sights, self.sections, self.table, points
        )
        history.seen = history.events
        return newly_emptied

    def shift(self, active: Flags, impulse: Floats) -> None:
        """Shift the feasible sections and their summaries by impulses of shape (C, B), m/s."""
        self._catch_up()
        section_passes.shift_all(active, impulse, self.elapsed, self.sections, self.table)

    def predict(self, active: Flags) -> None:
        """Move the feasible sections one step.

        The move is postponed to the next measurement or query, so that one pass over the memory
        does both.
        """
        self._catch_up()
        self._make_room(active)
        self.history.record(PREDICTION)
        self.sections.behind[:] = active
        self.sections.stale[active] = True

    def keep_labels(self, active: Flags) -> tuple[Flags, int]:
        """Remove the feasible sections with labels beyond the limits; return a mask of them and
        their number.
        """
        removed = np.zeros(self.labels.shape, dtype=bool)
        lower = self.lower_label
        upper = self.upper_label
        return removed, section_passes.keep_labels_all(active, lower, upper, self.sections, removed)

    def widest(self, pending: Sequence[tuple[float, Floats]] = ()) -> tuple[Flags, Floats]:
        """Return the predicted-miss interval of each engagement in the format of
        `section_passes.widest_all`.

        `pending` are later impulses that count as given: time from now, s, and impulse, m/s, shape
        (C, B).
        """
        exists = np.zeros(self.batch, dtype=bool)
        ends = np.zeros((len(self.laws), self.batch, 2, 4))
        sections = self.sections._replace(summaries=self._summaries_after(pending))
        section_passes.widest_all(self.elapsed, sections, self.table, exists, ends)
        return exists, ends

    def _summaries_after(self, pending: Sequence[tuple[float, Floats]]) -> Floats:
        """Return the summaries with the predicted misses after later impulses, as `shift` would
        change them.
        """
        if not pending:
            return self.summaries
        summaries = self.summaries.copy()
        to_go = self.ranges / self.law.closing_speed
        for time_s, impulse in pending:
            lever = np.maximum(to_go - time_s, 0.0)
            doubt = np.stack([impulse_doubts(impulse, law) for law in self.laws])
            summaries[..., section_life.UPPER_MISS] += (doubt - impulse)[..., None] * lever
            summaries[..., section_life.LOWER_MISS] -= (doubt + impulse)[..., None] * lever
        return summaries

    def polygon(self, channel: int, engagement: int, slot: int) -> Floats:
        """Return the vertices (V, z) of a feasible section, counter-clockwise, shape (n, 2)."""
        self._catch_up()
        row = (channel * self.batch + engagement) * self.labels.shape[1] + slot
        return self.outline(self.sections.chains, row, float(self.labels[engagement, slot]))

    def outline(self, sections: Chains, row: int, label: float) -> Floats:
        """Return the vertices (V, z) of a section at the present step, counter-clockwise, shape (n,
        2).
        """
        points = chain_storage.working_room()
        time_to_go = (
            label - self.law.closing_speed * (self.law.step * self.elapsed)
        ) / self.law.closing_speed
        return points[: section_passes.write_outline(sections, row, time_to_go, points)].copy()

    def copy(self) -> SetState:
        """Return an independent copy."""
        twin = copy.copy(self)
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray | History | GuaranteedMiss):
                setattr(twin, name, value.copy())
        records, rings = self.sections.chains
        arrays = {
            name: array.copy()
            for name, array in self.sections._asdict().items()
            if name != "chains"
        }
        own = Chains(records.copy(), chain_storage.copy_of_rings(rings, rings.size))
        twin.sections = Sections(**arrays, chains=own)
        return twin
