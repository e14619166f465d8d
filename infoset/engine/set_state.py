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
from infoset.engine.history import ANGLE, IMPULSE, PREDICTION, RATE, WIDENING, History
from infoset.engine.location import refine_all
from infoset.engine.rate_passes import measure_rate_all
from infoset.engine.section_law import (
    BOUND_SLACK,
    SectionLaw,
    change_of_miss,
    law_table,
    section_laws,
)
from infoset.engine.section_life import CUT_SLACK, NEVER_EMPTIED
from infoset.engine.section_passes import MOVED, NO_EVENT, SUMMARISED, WITH_HEIGHTS, Sections
from infoset.engine.workspace import past_of
from infoset.model import LONGEST_BURN, Recovery, SetModel

MAX_DISCARDED = 3
"""Maximum number of images that a member discards because it is not proved that they make it
empty: as many as may be wrong. A member in which a wrong image was not noticed contradicts nearly
all later ones: one discarded 358 in `deep-impact-2005`, and guidance followed it.
"""


class SetStatus(Enum):
    """Status of an information set."""

    TRACKING = 0
    """The set contains states above the range threshold."""
    EMPTY = 1
    """No state agrees with the data, no section has passed below the threshold, and the set was not
    recovered; or the set was ended because others of its engagement contain it.
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

    Only the methods of this class change the state, and they take checked arguments. Predictions
    and summaries of the stored sections are postponed to the next measurement or query, so that one
    pass over the memory does both; a query therefore may write the sections, but changes no result.

    `members` sets in a row belong to one engagement; usually it is 1. A set that becomes empty is
    recovered only if no other one of its engagement is in use: a set is in use unless its status is
    EMPTY, that is, while it tracks, if a label of it has passed below the threshold, or if it is
    stopped. If another one is in use and the emptiness is not proved, the set discards the image
    that made it empty, up to `MAX_DISCARDED` images.

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
        Step at which the set first became empty with no label below the threshold; -1 if it never
        did.
    lost_label : ndarray, shape (B,)
        Label closest to feasibility at that step, m.
    phi : GuaranteedMiss or None
        The guaranteed miss; None if it is not computed.
    """

    def __init__(self, model: SetModel, batch: int, guarantee: bool, members: int = 1) -> None:
        self.model = model
        self._members = members
        self.laws = section_laws(model)
        self.table = law_table(self.laws)

        minimum, maximum = model.label_limits_m
        # Labels of a new grid of `refine`, for which the slots have room. Chosen: more than half of
        # them can become empty before the next one is needed. With k + 1 to 8 k + 1 labels the
        # medians of the miss in asteroid-1997 differ by 3 %, and as many sets become empty.
        self._grid = 2 * model.fewest_sections + 1
        labels = np.full((batch, max(model.sections, self._grid)), maximum)
        if model.sections > 1:
            labels[:, : model.sections] = np.linspace(minimum, maximum, model.sections)
        else:
            labels[:, 0] = 0.5 * (minimum + maximum)
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
        # Phi reads label limits, closing speed, step and range threshold here: all axes have the
        # same ones.
        self.phi: GuaranteedMiss | None = None
        if has_phi:
            self.phi = GuaranteedMiss(self.laws[0], batch, model.speed_error, members)

        # If q measured ranges may be wrong: the q + 1 largest lower limits of the label by ranges,
        # and of the upper ones with a minus sign, increasing, shape (2, q + 1, B), m.
        self._range_limits = np.empty((2, 0, batch))
        # Images that each set has discarded because it was not proved to be empty, shape (B,).
        self._discarded = np.zeros(batch, dtype=np.int64)
        self._none = np.zeros(batch, dtype=bool)
        self._no_angles = np.empty((len(self.laws), 0))
        # Vertices that every section may still gain.
        self._spare = 0
        section_passes.start_all(self.sections, self.table)
        self.min_label = self._min_label()

    @property
    def law(self) -> SectionLaw:
        """Constants of the last axis, for those that all axes have in common."""
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
    def tracking(self) -> Flags:
        """Whether each set contains states above the range threshold, shape (B,)."""
        return np.asarray(self.status == SetStatus.TRACKING.value)

    @property
    def computes_phi(self) -> Flags:
        """Engagements in which Phi is updated, also without feasible labels above the threshold."""
        is_stopped = self.status == SetStatus.STOPPED.value
        is_empty = self.status == SetStatus.EMPTY.value
        return np.asarray(~is_stopped & ~is_empty)

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
    def travelled(self) -> float:
        """Decrease of the nominal range since t = 0, m."""
        return self.law.closing_speed * (self.law.step * self.elapsed)

    @property
    def ranges(self) -> Floats:
        """Range of every slot now, m, shape (B, S)."""
        return self.labels - self.travelled

    @property
    def min_label_next(self) -> float:
        """Minimum label, m, whose range is not below the threshold after the next step."""
        elapsed_s = self.model.step_s * (self.elapsed + 1)
        return self.model.min_range_m + self.model.closing_speed_m_s * elapsed_s

    def measure_angle(self, alpha: Floats, where: Flags) -> None:
        """Cut every section by measured angles of shape (C, B), rad."""
        self._check_no_burn()
        active = self.tracking & where
        event = self.history.record(ANGLE, alpha, active)
        before = (self.lower_label.copy(), self.upper_label.copy())
        # Members that do not use this image are summarised in the same pass.
        wanted = MOVED if self._members == 1 else SUMMARISED
        newly_emptied = section_passes.step_all(
            active, alpha, event, self.elapsed, wanted, self.sections, self.table
        )
        if newly_emptied:
            self._handle_emptied(active, event, *before)

    def measure_rate(self, omega: Floats, error: float, where: Flags) -> None:
        """Cut every section by measured rates of shape (C, B), rad/s, with an error bound."""
        self._check_no_burn()
        active = self.tracking & where
        error = error * (1.0 + BOUND_SLACK)
        history = self.history
        event = history.record(RATE, omega, active, error)
        before = (self.lower_label.copy(), self.upper_label.copy())

        self._catch_up()
        self._make_room(active)
        points = chain_storage.working_room()
        newly_emptied = measure_rate_all(
            history.log, error, history.seen, history.sights, self.sections, self.table, points
        )
        history.seen = history.events
        if newly_emptied:
            self._handle_emptied(active, event, *before)

    def measure_range(
        self,
        measured: Floats,
        relative_error: float,
        alpha: Floats | None,
        where: Flags,
        wrong: int = 0,
    ) -> None:
        """Keep the labels that agree with measured ranges of shape (B,), m.

        `alpha` are angles of shape (C, B), rad, measured at the same time, or None. At most `wrong`
        of all measured ranges are wrong.
        """
        active = self.tracking & where
        travelled = self.travelled
        slack = CUT_SLACK * (measured + travelled)
        eta = self.model.speed_error
        # A label is the range x now plus the distance travelled. The true distance is from
        # (1 - eta) x to (1 + eta) x / `nearer`.
        nearer = self._min_cosine(alpha) if self.model.is_guaranteed else 1.0
        lower = measured * nearer / ((1.0 + relative_error) * (1.0 + eta)) + travelled - slack
        upper = measured / ((1.0 - relative_error) * (1.0 - eta)) + travelled + slack

        earlier = self._range_limits
        if wrong:
            earlier = self._earlier_range_limits(wrong)
            lower, upper = self._limits_of_right_ranges(earlier, lower, upper, active)

        before = (self.lower_label.copy(), self.upper_label.copy())
        self.lower_label[active] = np.maximum(self.lower_label, lower)[active]
        self.upper_label[active] = np.minimum(self.upper_label, upper)[active]
        _, removed = self._keep_labels(active)
        if removed:
            recovered = self._handle_emptied(active, None, *before)
            if wrong and some(recovered):
                self._range_limits[..., recovered] = earlier[..., recovered]

    def _earlier_range_limits(self, wrong: int) -> Floats:
        """Return the stored limits by earlier ranges, of which at most `wrong` are wrong."""
        if self._range_limits.shape[1] == 0:
            return np.full((2, wrong + 1, self.batch), -np.inf)
        return self._range_limits

    def _limits_of_right_ranges(
        self, earlier: Floats, lower: Floats, upper: Floats, active: Flags
    ) -> tuple[Floats, Floats]:
        """Return the limits of the label by all measured ranges, each of shape (B,), m: Theorem
        10 of docs/guarantee-wrong-images.md.

        A label below the (q + 1)-th largest of the lower limits contradicts more than q ranges.
        """
        new = np.where(active, np.stack((lower, -upper)), -np.inf)
        ordered = np.sort(np.concatenate((earlier, new[:, None]), axis=1), axis=1)
        # Of q + 2 limits the smallest is dropped; where none was measured, minus infinity. The
        # first of the others is the (q + 1)-th largest.
        self._range_limits = ordered[:, 1:]
        return self._range_limits[0, 0], -self._range_limits[1, 0]

    def _min_cosine(self, alpha: Floats | None) -> Floats:
        """Lower bound of x over the distance, shape (B,): from measured angles, or from the maximum
        velocity.
        """
        travelled = self.travelled
        if alpha is not None:
            steepest = np.empty((2, self.batch))
            farthest = self.law.label_max - travelled
            section_passes.steepest_all(alpha, farthest, self.table, steepest)
            return np.asarray(np.cos(steepest[0]) * np.cos(steepest[1]))
        box = self.model.bounds
        elapsed_s = self.elapsed * self.model.step_s
        impulses = self.history.total_impulse() * (1.0 + self.model.execution_error_relative)
        disturbance = float(np.hypot.reduce([law.disturbance for law in self.laws]))
        fastest = impulses + box.lateral_speed_m_s + disturbance * elapsed_s
        offset = box.offset_m + fastest * elapsed_s
        nearest = (self.lower_label - travelled) * (1.0 - self.model.speed_error)
        return np.asarray(np.cos(np.arctan2(offset, np.maximum(nearest, 0.0))))

    def _keep_labels(self, active: Flags) -> tuple[Flags, int]:
        """Remove the feasible sections with labels beyond the limits; return a mask of them and
        their number.
        """
        removed = np.zeros(self.labels.shape, dtype=bool)
        number = section_passes.keep_labels_all(
            active, self.lower_label, self.upper_label, self.sections, removed
        )
        return removed, number

    def _handle_emptied(
        self, active: Flags, event: int | None, lower: Floats, upper: Floats
    ) -> Flags:
        """Refine the sets that a measurement has left with few sections, and recover the sets that
        it has made empty. Return which were recovered, shape (B,).

        `event` is the number of the measurement, None for a range, which the history does not
        contain. `lower` and `upper`, shape (B,), are the limits of the labels before it, m.
        """
        empty = self._refine_if_few(active)
        is_below_threshold = empty & self.some_left
        # First, so that an empty set does not count as living below.
        self.status[empty] = SetStatus.EMPTY.value
        self.status[is_below_threshold] = SetStatus.REFUTED.value
        lost = empty & ~is_below_threshold
        if self._members > 1 and event is not None:
            # A set without this image contains the set with it.
            doubtful = lost & self.sections.unproved & self._engagement_in_use()
            doubtful &= self._discarded < MAX_DISCARDED
            if some(doubtful):
                self._discarded += doubtful
                self._discard(doubtful, event, lower, upper)
                lost &= self.status == SetStatus.EMPTY.value
        if not some(lost):
            return lost

        for b in np.flatnonzero(lost & (self.lost_step < 0)):
            self.lost_step[b] = self.elapsed
            self.lost_label[b] = self._nearest_to_feasible(int(b), event, lower[b], upper[b])
        if self.model.recovery is Recovery.NONE:
            return self._none
        lost &= ~self._engagement_in_use()
        if some(lost):
            self._recover(lost, event, lower, upper)
        return lost

    def _engagement_in_use(self) -> Flags:
        """Whether a set of the same engagement, or the set itself, is in use, shape (B,)."""
        in_use = self.status != SetStatus.EMPTY.value
        of_engagement = in_use.reshape(-1, self._members).any(axis=1)
        return np.repeat(of_engagement, self._members)

    def _refine_if_few(self, active: Flags) -> Flags:
        """Make a new grid where too few sections are left; return which sets are empty."""
        few = active & (self.section_counts < self.model.fewest_sections)
        if some(few):
            self.refine(few, self._grid)
            few &= ~self.feasible.any(axis=1)
        return few

    def _nearest_to_feasible(self, b: int, event: int | None, lower: float, upper: float) -> float:
        """Label, m, whose section was closest to the band of a measurement that emptied the set.

        If no stored section was emptied by it, or for a range, it is the middle of the limits of
        the labels now, moved into the limits before the measurement, `lower` and `upper`.
        """
        slots = self.sections.slots[b, : self.sections.used[b]]
        emptied_now = slots["emptied_at"] == event
        if event is not None and emptied_now.any():
            return float(slots["label"][np.where(emptied_now, slots["overlap"], -np.inf).argmax()])
        middle = 0.5 * (self.lower_label[b] + self.upper_label[b])
        return float(min(max(middle, lower), upper))

    def _recover(self, empty: Flags, event: int | None, lower: Floats, upper: Floats) -> None:
        """Discard the measurement that made sets empty, and enlarge the last consistent sets. The
        arguments are explained in `_handle_emptied`.
        """
        # First, because the replays of `_discard` apply it.
        self.history.record(WIDENING, applies=empty)
        self._discard(empty, event, lower, upper)

    def _discard(self, empty: Flags, event: int | None, lower: Floats, upper: Floats) -> None:
        """Discard the measurement that made sets empty: compute the sets without it, by replay. A
        set without a feasible label is empty again. The arguments are explained in
        `_handle_emptied`.
        """
        if event is not None:
            self.history.retract(event, empty)

        # The labels that this measurement has emptied or removed are feasible again. Their polygons
        # are not restored: the refinement below computes others.
        slots = self.sections.slots
        is_used = np.arange(slots.shape[1]) < self.sections.used[:, None]
        was_feasible = slots["emptied_at"] == NEVER_EMPTIED
        if event is not None:
            was_feasible |= slots["emptied_at"] == event
        slots["feasible"][empty] = (is_used & was_feasible)[empty]

        self.lower_label[empty] = lower[empty]
        self.upper_label[empty] = upper[empty]
        self.status[empty] = SetStatus.TRACKING.value
        self.refine(empty, self._grid)
        self.status[empty & (self.section_counts == 0)] = SetStatus.EMPTY.value

    def refine(self, wanted: Flags, number: int) -> None:
        """Replace the sections of the wanted engagements by a grid over their feasible labels,
        found by replay.
        """
        self._catch_up()
        # Room for two rings of the greatest size for each new section: `copy_section` may need it.
        new = number * int(np.count_nonzero(wanted)) * len(self.laws)
        self._add_room(2 * (2 * chains.CAPACITY + chain_storage.LINE) * new)
        limits = (self.lower_label, self.upper_label)
        past = past_of(self.history, self.table, self.labels.shape[1])
        self._spare = min(self._spare, refine_all(wanted, number, limits, past, self.sections))
        self.min_label = self._min_label()

    def replace(self, row: int, source: int, applies: Flags) -> bool:
        """Replace the set of engagement `row` by the set of other measurements of engagement
        `source`, computed by replay; return whether it is not empty. An empty one is ended.

        `applies`, shape (events,), says which events of the history apply. The new set must be a
        part of the set of `source`, whose limits of the labels it takes over. No label of either
        set may have left, and no rate may be measured.
        """
        self.history.replace(row, source, applies)
        self.lower_label[row] = self.lower_label[source]
        self.upper_label[row] = self.upper_label[source]
        self._range_limits[..., row] = self._range_limits[..., source]
        self._discarded[row] = self._discarded[source]
        self.status[row] = SetStatus.TRACKING.value
        self.lost_step[row] = -1

        # The stored labels became empty with other measurements: the search must not use them.
        self.sections.slots["feasible"][row] = False
        self.sections.used[row] = 0
        self.sections.unproved[row] = False
        wanted = self._none.copy()
        wanted[row] = True
        self.refine(wanted, self._grid)
        if self.feasible[row].any():
            return True
        self.refute(row)
        self.status[row] = SetStatus.EMPTY.value
        return False

    def refute(self, row: int) -> None:
        """Note that the set of an engagement does not contain the true state."""
        self.lost_step[row] = self.elapsed
        self.lost_label[row] = 0.5 * (self.lower_label[row] + self.upper_label[row])

    def retire(self, row: int) -> None:
        """End the set of an engagement, because others of the same engagement contain it."""
        self.refute(row)
        self.status[row] = SetStatus.EMPTY.value
        self.sections.slots["feasible"][row] = False
        self.sections.unproved[row] = False
        self.min_label = self._min_label()

    def _min_label(self) -> float:
        return float(np.where(self.feasible, self.labels, np.inf).min())

    def shift(self, impulse: Floats, where: Flags) -> None:
        """Shift the feasible sections and their summaries by impulses of shape (C, B), m/s."""
        active = self.computes_phi & where & impulse.any(axis=0)
        if not some(active):
            return

        self._check_burns(impulse[:, active], active)
        self.history.record(IMPULSE, impulse, active)
        self._catch_up()
        if self.law.burn_time > 0.0:
            # A burn turns the level, as a step does.
            self._make_room(active)
        section_passes.shift_all(active, impulse, self.elapsed, self.sections, self.table)

    def _check_burns(self, impulse: Floats, active: Flags) -> None:
        """Refuse burns that may not end within the step or before the nearest label arrives, and a
        second burn in a step: both would begin at its start, and `MAX_ADDED` counts one.
        """
        size_m_s = float(np.hypot.reduce(impulse, axis=0).max())
        longest_s = self.model.burn_s(size_m_s)
        if longest_s == 0.0:
            return
        arrival_s = self.law.label_min / self.law.closing_speed - self.law.step * self.elapsed
        if longest_s > LONGEST_BURN * min(self.model.step_s, arrival_s):
            raise ValueError(
                f"a burn must end within the step of {self.model.step_s:g} s, and before the "
                f"earliest possible arrival in {arrival_s:.6g} s: {size_m_s:g} m/s may last "
                f"{longest_s:.6g} s"
            )
        if (self.history.shifted_in_step() & active).any():
            raise ValueError(
                "a step has one burn: add the impulses, or call predict between the burns"
            )

    def _check_no_burn(self) -> None:
        """Refuse a measurement after the burn of a step: the set is that after its end."""
        if self.law.burn_time > 0.0 and self.history.ends_with(IMPULSE):
            raise ValueError("a measurement must precede the burn of its step: call predict first")

    def drop_below_threshold(self) -> Flags:
        """Remove the sections whose range will be below the threshold after the next step; return a
        mask of them, shape (B, S).
        """
        active = self.tracking
        min_label = self.min_label_next
        computes_phi = self.computes_phi
        if self.phi is not None:
            # Before the lower limits are raised: the labels between have not left yet.
            limits = (self.lower_label, self.upper_label)
            self.phi.leave(computes_phi, *limits, self.sections, self.history)
        if self.model.is_guaranteed:
            # A label between the stored ones may pass the threshold. The status must not depend on
            # whether Phi is computed.
            self.some_left |= active & (self.lower_label < min_label)

        np.maximum(self.lower_label, min_label, out=self.lower_label, where=computes_phi)
        if self.min_label >= min_label:
            return np.zeros(self.labels.shape, dtype=bool)

        left, number = self._keep_labels(active)
        if number:
            self.some_left |= left.any(axis=1)
            self.status[self._refine_if_few(active)] = SetStatus.FINISHED.value
        return left

    def predict(self) -> None:
        """Move the feasible sections one step; the move is postponed."""
        active = self.tracking
        self._catch_up()
        self._make_room(active)
        self.history.record(PREDICTION)
        self.sections.behind[:] = active
        self.sections.stale[active] = True

    def stop(self, where: Flags) -> None:
        """Stop the computation of some engagements."""
        self.status[where] = SetStatus.STOPPED.value

    def _catch_up(self) -> None:
        """Move the sections that are behind to the present step."""
        if some(self.sections.behind):
            self._update(MOVED)

    def _update(self, wanted: int) -> None:
        """Bring the sections and summaries up to date that `wanted` names, see `step_all`."""
        section_passes.step_all(
            self._none, self._no_angles, NO_EVENT, self.elapsed, wanted, self.sections, self.table
        )

    def _make_room(self, active: Flags) -> None:
        """Give each feasible section room for the vertices that one step adds, before the step.

        Only the active engagements change, but the others may use their room later without another
        count.
        """
        self._spare -= chains.MAX_ADDED
        if self._spare >= 0:
            return
        floats, spare = self._room(active, widen=False)
        if floats or spare < chains.MAX_ADDED:
            self._add_room(floats)
            _, spare = self._room(active, widen=True)
        self._spare = spare - chains.MAX_ADDED

    def _room(self, active: Flags, widen: bool) -> tuple[int, int]:
        """Return the floats of the new rings of feasible sections without room for `ROOM_AHEAD`
        more vertices (whole rings: the old ones are not used again), and the vertices that every
        section can gain now.

        With `widen`, enlarge the rings, for which `_add_room` has allocated, and reduce the crowded
        sections of the `active` engagements, whose emptiness is then unproved.
        """
        points = chain_storage.working_room()
        added = chain_storage.ROOM_AHEAD
        return section_passes.make_room_all(
            active, added, self.elapsed, self.sections, self.table, points, widen
        )

    def _add_room(self, floats: int) -> None:
        """Allocate `floats` more floats of the rings."""
        records, rings = self.sections.chains
        wider = Chains(records, chain_storage.with_room(rings, floats))
        self.sections = self.sections._replace(chains=wider)

    def summaries(self) -> Floats:
        """Return the summaries of the feasible sections, shape (C, B, S, columns). The columns of z
        may be out of date.
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
        summaries = self.summaries()
        if not pending:
            return summaries
        summaries = summaries.copy()
        to_go = self.ranges / self.law.closing_speed
        for time_s, impulse in pending:
            lever = np.maximum(to_go - time_s, 0.0)
            for channel, law in enumerate(self.laws):
                change = change_of_miss(impulse, lever, law)
                summaries[channel, ..., section_life.UPPER_MISS] -= change.least
                summaries[channel, ..., section_life.LOWER_MISS] -= change.greatest
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
        time_to_go = (label - self.travelled) / self.law.closing_speed
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
