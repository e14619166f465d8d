"""Information sets of which at least one never sees a wrong image.

Theorem 9 of docs/guarantee-wrong-images.md: the images are dealt into G classes, image number
modulo G, and each member of the cover leaves out the images of q classes. At most q wrong images
lie in at most q classes, so one member uses none of them: it contains the true state, and its
guaranteed miss bounds the miss.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset.arrays import Flags, Floats, some
from infoset.engine.predicted_miss import ExtremePoints, PredictedMiss
from infoset.engine.set_state import SetState, SetStatus
from infoset.information_set import InformationSet, InformationSetView
from infoset.limits import COUNT, Limits, flags, real_array, shown
from infoset.model import SetModel
from infoset.set_queries import MaskedFloats, MaskedIntegers, Section, SetQueries
from infoset.suspects import Suspects


def information_set(model: SetModel, batch: int = 1, *, guarantee: bool = True) -> InformationSet:
    """Return the set of a model: an ordinary one, or a cover if images may be wrong."""
    if model.wrong_images == 0:
        return InformationSet(model, batch, guarantee=guarantee)
    return CoveredSet(model, batch, guarantee=guarantee)


class CoveredSetView(InformationSetView):
    """Read-only view of a `CoveredSet`. It follows the set and cannot change it.

    Sections of all members stand side by side, with an empty one after each member, so that a
    strategy that interpolates between neighbouring sections does not do so between members.

    Attributes
    ----------
    left_out : ndarray of bool, shape (R, G)
        Classes of images that each member leaves out until a wrong image is proved.
    """

    def __init__(
        self, members: InformationSet, model: SetModel, left_out: Flags, suspects: Suspects
    ) -> None:
        # Queries of the base class that are not replaced below (axes, time) read the members.
        SetQueries.__init__(self, members._state)
        self.model = model
        self.left_out = left_out
        self._members = members
        self._suspects = suspects
        self._batch = members.batch // len(left_out)

    def copy(self) -> CoveredSet:
        """Return an independent set that starts from the state of this one."""
        twin = CoveredSet.__new__(CoveredSet)
        members = self._members.copy()
        CoveredSetView.__init__(twin, members, self.model, self.left_out, self._suspects.copy())
        return twin

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return self._batch

    def _by_member(self, values: NDArray[Any], axis: int = 0) -> NDArray[Any]:
        """Return an array with an axis of B R rows as one with two axes, B and R."""
        shape = (*values.shape[:axis], self._batch, len(self.left_out), *values.shape[axis + 1 :])
        return values.reshape(shape)

    def _members_status(self) -> NDArray[np.int64]:
        """Values of `SetStatus` of the members, shape (B, R)."""
        return np.asarray(self._by_member(self._state.status), dtype=np.int64)

    @property
    def emptied(self) -> Flags:
        """Whether each member became empty before a label left, shape (B, R)."""
        return np.asarray(self._by_member(self._members.inconsistent), dtype=bool)

    @property
    def refuted(self) -> Flags:
        """Whether it is proved that each member became empty before a label left, shape (B, R).

        A wrong image outside the classes that the member leaves out is then proved, if no other
        assumption is broken. After a split, members that are not in use count as refuted.
        """
        return self.emptied & ~self._unproved

    @property
    def _unproved(self) -> Flags:
        """Whether the emptiness of each member, if it is empty, is not proved, shape (B, R)."""
        return np.asarray(self._by_member(self._state.sections.unproved), dtype=bool)

    @property
    def proof_step(self) -> MaskedIntegers:
        """Step at which the first member was refuted, which proves a wrong image, shape (B,);
        masked before.
        """
        step = self._suspects.proof_step
        return np.ma.MaskedArray(step.copy(), mask=step < 0)

    def suspected_steps(self, engagement: int = 0) -> list[int]:
        """Return the steps of the images at least one of which is wrong.

        They are the images that some member that is not refuted leaves out, until the last
        refutation. There are none before a wrong image is proved, and if all members are refuted.
        """
        self._need_engagement(engagement)
        return self._suspects.steps(engagement, self._state)

    def groups(self, engagement: int = 0) -> dict[int, tuple[int, ...]] | None:
        """Return the steps of the images that each member that is not refuted leaves out, after a
        split; None before, when members leave out the classes in `left_out`.
        """
        self._need_engagement(engagement)
        return self._suspects.groups(engagement, self._state)

    @property
    def status(self) -> list[SetStatus]:
        """Status of each set: the first of TRACKING, REFUTED, FINISHED and STOPPED that a member
        has, otherwise EMPTY.
        """
        return [_status_of(row) for row in self._members_status().tolist()]

    @property
    def tracking(self) -> Flags:
        """Whether some member contains states above the range threshold, shape (B,)."""
        return np.asarray((self._members_status() == SetStatus.TRACKING.value).any(axis=1))

    @property
    def inconsistent(self) -> Flags:
        """Whether all members became empty: more images are wrong than assumed, shape (B,)."""
        return np.asarray(self.emptied.all(axis=1))

    @property
    def inconsistency(self) -> tuple[MaskedIntegers, MaskedFloats]:
        """Step at which the last member became empty, and its label closest to feasible, m; masked
        if some member never did.
        """
        state = self._state
        steps = np.asarray(self._by_member(state.lost_step))
        labels = np.asarray(self._by_member(state.lost_label))
        last = steps.argmax(axis=1)
        rows = np.arange(self.batch)
        never = ~self.inconsistent
        return (
            np.ma.MaskedArray(steps[rows, last], mask=never),
            np.ma.MaskedArray(labels[rows, last], mask=never),
        )

    def _side_by_side(self, values: NDArray[Any], gap: bool | float) -> NDArray[Any]:
        """Return an array of sections, shape (..., B R, S), as (..., B, R (S + 1))."""
        padded = np.empty((*values.shape[:-1], values.shape[-1] + 1), dtype=values.dtype)
        padded[..., :-1] = values
        padded[..., -1] = gap
        return padded.reshape(*values.shape[:-2], self._batch, -1)

    @property
    def feasible(self) -> Flags:
        """Whether each stored section is not empty, shape (B, R (S + 1))."""
        return np.asarray(self._side_by_side(self._members.feasible, False))

    @property
    def labels_m(self) -> Floats:
        """Labels of all stored sections, m, shape (B, R (S + 1))."""
        return np.asarray(self._side_by_side(self._members.labels_m, 0.0))

    @property
    def ranges_m(self) -> Floats:
        """Ranges of all stored sections now, m, shape (B, R (S + 1))."""
        return np.asarray(self._side_by_side(self._members.ranges_m, 0.0))

    @property
    def section_counts(self) -> NDArray[np.int64]:
        """Number of nonempty sections of all members, shape (B,)."""
        return np.asarray(self.feasible.sum(axis=1), dtype=np.int64)

    def stored_range_interval_m(self) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum range of the nonempty sections, m, or zeros."""
        ranges = self.ranges_m
        feasible = self.feasible
        tracked = feasible.any(axis=1)
        minimum = np.where(feasible, ranges, np.inf).min(axis=1)
        maximum = np.where(feasible, ranges, -np.inf).max(axis=1)
        return np.where(tracked, minimum, 0.0), np.where(tracked, maximum, 0.0)

    def min_and_max_alpha(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the minimum and the maximum angle of all members, and their ranges."""
        minimum, maximum, of_min, of_max = self._by_member(self._state.extreme_angles(), axis=2)
        counts = self._nonempty_members()
        lowest = np.where(counts, minimum, np.inf).argmin(axis=2)
        highest = np.where(counts, maximum, -np.inf).argmax(axis=2)
        # Members without a nonempty section have zeros.
        return (
            _of_member(minimum, lowest),
            _of_member(maximum, highest),
            _of_member(of_min, lowest),
            _of_member(of_max, highest),
        )

    def _nonempty_members(self) -> Flags:
        """Whether each member has a nonempty section, shape (B, R)."""
        return self._by_member(np.asarray(self._members.feasible.any(axis=1)))

    def predicted_miss(self, pending: Sequence[tuple[float, Floats]] = ()) -> PredictedMiss:
        """Return the smallest interval that contains the possible misses of all members."""
        members = len(self.left_out)
        repeated = [(time_s, np.repeat(impulse, members, axis=1)) for time_s, impulse in pending]
        exists, ends = self._state.widest(repeated)
        counts = self._by_member(exists)
        # An end is the predicted miss, and the state that reaches it; zeros without a section.
        # The axis of the two ends is moved to the front: (2, C, B, R, 4).
        lower_ends, upper_ends = self._by_member(np.moveaxis(ends, 2, 0), axis=2)
        lowest = np.where(counts, lower_ends[..., 0], np.inf).argmin(axis=2)
        highest = np.where(counts, upper_ends[..., 0], -np.inf).argmax(axis=2)
        lower = _of_member(lower_ends, lowest)
        upper = _of_member(upper_ends, highest)
        known = np.asarray(counts.any(axis=1))
        aim_m = self._aim_of(known)
        return PredictedMiss(
            known,
            lower[..., 0] + aim_m,
            upper[..., 0] + aim_m,
            ExtremePoints(lower[..., 1], lower[..., 2], lower[..., 3]),
            ExtremePoints(upper[..., 1], upper[..., 2], upper[..., 3]),
        )

    def predicted_miss_by_section_m(self) -> tuple[Floats, Floats]:
        """Return minimum and maximum predicted miss of each section, m, each (C, B, R (S + 1));
        zeros if it is empty.
        """
        lower, upper = self._members.predicted_miss_by_section_m()
        return self._side_by_side(lower, 0.0), self._side_by_side(upper, 0.0)

    def predicted_miss_by_member(self) -> tuple[Floats, Floats, Flags]:
        """Return minimum and maximum predicted miss of each member, m, each (C, B, R), and where
        the member has a nonempty section, (B, R).
        """
        miss = self._members.predicted_miss()
        return (
            np.asarray(self._by_member(miss.lower_m, axis=1)),
            np.asarray(self._by_member(miss.upper_m, axis=1)),
            self._nonempty_members(),
        )

    def sections(self, engagement: int = 0) -> list[Section]:
        """Return the nonempty sections of all members, one member after the other.

        Those of a member are in order of increasing range.
        """
        self._need_engagement(engagement)
        first = engagement * len(self.left_out)
        members = np.flatnonzero(self._nonempty_members()[engagement])
        return [
            replace(section, member=member)
            for member in members.tolist()
            for section in self._members.sections(first + member)
        ]

    def section_at(self, label_m: float, engagement: int = 0, member: int = 0) -> Section:
        """Return the section of one member at any label, computed by replaying the history."""
        self._need_engagement(engagement)
        Limits(minimum=0, maximum=len(self.left_out) - 1, whole=True).need("member", member)
        section = self._members.section_at(label_m, engagement * len(self.left_out) + member)
        return replace(section, member=member)


class CoveredSet(CoveredSetView, InformationSet):
    """Information sets of a batch of engagements in which at most q images of a flight are wrong.

    It has the methods of `InformationSet`. A member that is proved to be empty before a label of it
    has left is refuted, and stays empty if another one is in use, which tracks or has labels that
    have left. For q = 1 the others are then split into members that leave out as few images as
    possible, see `Suspects`. If none is in use, more than q images are wrong, and the members that
    became empty last recover as an `InformationSet` does.

    Parameters
    ----------
    model : SetModel
        `wrong_images` is q, and `image_classes` is G.

    Raises
    ------
    TypeError, ValueError
        As `InformationSet`.

    Notes
    -----
    C(G, q) ordinary sets, in one batch.
    """

    def __init__(self, model: SetModel, batch: int = 1, *, guarantee: bool = True) -> None:
        if not isinstance(model, SetModel):
            raise TypeError(f"model must be a SetModel: got {shown(model)}")
        COUNT.need("batch", batch)
        left_out = classes_left_out(model.wrong_images, model.classes)
        ordinary = replace(model, wrong_images=0, image_classes=None)
        # Without its constructor, which makes a state of sets that do not belong together.
        members = InformationSet.__new__(InformationSet)
        state = SetState(ordinary, batch * len(left_out), guarantee, members=len(left_out))
        SetQueries.__init__(members, state)
        CoveredSetView.__init__(self, members, model, left_out, Suspects(batch, left_out))

    def view(self) -> InformationSetView:
        """Return a read-only view of this set; it follows the set."""
        return CoveredSetView(self._members, self.model, self.left_out, self._suspects)

    def guaranteed_miss(self) -> tuple[Floats, Flags]:
        """Return the guaranteed miss: the maximum over the members that did not become empty before
        a label of them left.

        It does not exist if it is not proved that each of the others is empty.
        """
        state = self._state
        if state.phi is None:
            return np.zeros(self.batch), np.zeros(self.batch, dtype=bool)
        # No label of an emptied member has left, unless all are empty and some have recovered.
        phi_m, exists = state.phi.bound(state.table, state.history)
        is_proved = ~(self.emptied & self._unproved).any(axis=1)
        return phi_m, np.asarray(exists & is_proved & ~self.inconsistent)

    def measure_angle(self, alpha_rad: ArrayLike, where: ArrayLike = True) -> None:
        """Cut the members that use this image.

        The number of the image, which gives its class, is the number of periods of the camera since
        the start: it also counts images that were not taken.
        """
        state = self._state
        every = self.model.steps_in(self.model.angle_sensor.period_s)
        image_class = (state.elapsed // every) % self.left_out.shape[1]
        wanted = self._where(where)
        # Before the cut, which appends the event of this image to the history.
        self._suspects.record_image(state, image_class, wanted & self.tracking)

        uses = ~self.left_out[:, image_class] | self._suspects.is_split[:, None]
        active = wanted[:, None] & uses
        measured = real_array("alpha_rad", alpha_rad, (len(self.axes), self.batch))
        self._state.measure_angle(self._lateral_of_members(measured), active.ravel())
        self._split_if_refuted()

    def measure_range(
        self,
        range_m: ArrayLike,
        relative_error: float,
        where: ArrayLike = True,
        *,
        alpha_rad: ArrayLike | None = None,
        wrong_measurements: int = 0,
    ) -> None:
        """Remove the ranges that contradict a range measurement.

        `alpha_rad` is not used, because the image may be wrong: the distance is compared with x by
        the maximum possible displacement across it.
        """
        del alpha_rad
        measured = real_array("range_m", range_m, (self.batch,))
        self._members.measure_range(
            np.repeat(np.broadcast_to(measured, (self.batch,)), len(self.left_out)),
            relative_error,
            self._where_of_members(where),
            wrong_measurements=wrong_measurements,
        )
        self._split_if_refuted()

    def measure_rate(
        self, omega_rad_s: ArrayLike, error_rad_s: float, where: ArrayLike = True
    ) -> None:
        """Refuse: `SetModel` with wrong images has no sensor of rates.

        Raises
        ------
        ValueError
            Always.
        """
        raise ValueError("a set with wrong_images cannot be cut by rates: set wrong_images = 0")

    def shift(self, impulse_m_s: ArrayLike, where: ArrayLike = True) -> None:
        """Shift every section of every member by an impulse."""
        impulse = real_array("impulse_m_s", impulse_m_s, (len(self.axes), self.batch))
        self._state.shift(self._lateral_of_members(impulse), self._where_of_members(where))

    def drop_below_threshold(self) -> Flags:
        """Remove the sections whose range will be below the threshold after the next step.

        Returns
        -------
        ndarray of bool, shape (B, R (S + 1))
            Stored sections that were removed.
        """
        return np.asarray(self._side_by_side(self._state.drop_below_threshold(), False))

    def sections_are_leaving(self) -> bool:
        """Return whether `drop_below_threshold` would remove a stored section now."""
        return self._members.sections_are_leaving()

    def predict(self) -> None:
        """Predict all members over one step."""
        self._members.predict()

    def stop(self, where: ArrayLike) -> None:
        """Stop the computation in the engagements where `where`, shape () or (B,), is true."""
        self._members.stop(self._where_of_members(where))

    def _lateral_of_members(self, values: Floats) -> Floats:
        """Return values of shape (C, B) for all members, (C, B R)."""
        every = np.broadcast_to(values, (len(self.axes), self.batch))
        return np.repeat(every, len(self.left_out), axis=1)

    def _where(self, where: ArrayLike) -> Flags:
        return np.broadcast_to(flags("where", where, (self.batch,)), (self.batch,))

    def _where_of_members(self, where: ArrayLike) -> Flags:
        return np.repeat(self._where(where), len(self.left_out))

    def _split_if_refuted(self) -> None:
        """Note refuted members, and split the others of their engagements."""
        if some(self.emptied):
            self._suspects.update(self._state, self.model.wrong_images)


def classes_left_out(wrong_images: int, image_classes: int) -> Flags:
    """Return the classes that each member of the cover leaves out, shape (C(G, q), G)."""
    members = list(combinations(range(image_classes), wrong_images))
    left_out = np.zeros((len(members), image_classes), dtype=bool)
    for member, classes in enumerate(members):
        left_out[member, list(classes)] = True
    return left_out


def _of_member(values: Floats, member: NDArray[np.intp]) -> Floats:
    """Return the values, shape (C, B, R, ...), of one member for each axis and engagement."""
    axes, engagements = member.shape
    return np.asarray(values[np.arange(axes)[:, None], np.arange(engagements), member])


def _status_of(members: list[int]) -> SetStatus:
    """Return the status of a set from the values of its members' status."""
    for status in (SetStatus.TRACKING, SetStatus.REFUTED, SetStatus.FINISHED, SetStatus.STOPPED):
        if status.value in members:
            return status
    return SetStatus.EMPTY
