"""Information sets of which at least one never sees a wrong image.

Theorem A of docs/wrong-images.md: the images are dealt into G classes, image number modulo G, and
each member of the cover leaves out the images of q classes. At most q wrong images lie in at most q
classes, so one member uses none of them: it contains the true state, and its guaranteed miss bounds
the miss.
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
from infoset.engine.set_state import SetStatus
from infoset.information_set import InformationSet, InformationSetView
from infoset.limits import COUNT, flags, real_array, shown
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

    def copy(self) -> CoveredSet:
        """Return an independent set that starts from the state of this one."""
        twin = CoveredSet.__new__(CoveredSet)
        members = self._members.copy()
        CoveredSetView.__init__(twin, members, self.model, self.left_out, self._suspects.copy())
        return twin

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return self._members.batch // len(self.left_out)

    def _by_member(self, values: NDArray[Any], axis: int = 0) -> NDArray[Any]:
        """Return an array with an axis of B R rows as one with two axes, B and R."""
        shape = (*values.shape[:axis], self.batch, len(self.left_out), *values.shape[axis + 1 :])
        return values.reshape(shape)

    def _members_status(self) -> NDArray[np.int64]:
        """Values of `SetStatus` of the members, shape (B, R)."""
        return np.asarray(self._by_member(self._members._state.status), dtype=np.int64)

    @property
    def refuted(self) -> Flags:
        """Whether each member became empty before a label left, shape (B, R).

        A wrong image outside the classes that the member leaves out is then proved, if no other
        assumption is broken. After a split, members that are not in use count as refuted.
        """
        return np.asarray(self._by_member(self._members.inconsistent), dtype=bool)

    @property
    def proof_step(self) -> MaskedIntegers:
        """Step at which the first member was refuted, which proves a wrong image, shape (B,);
        masked before.
        """
        step = self._suspects.proof_step
        return np.ma.MaskedArray(step.copy(), mask=step < 0)

    def suspected_steps(self, engagement: int = 0) -> list[int]:
        """Return the steps of the images at least one of which is wrong.

        They are the images before the last refutation that some member without one leaves out.
        There are none before a wrong image is proved, and if all members are refuted.
        """
        self._need_engagement(engagement)
        return self._suspects.steps(engagement, self._members._state)

    def groups(self, engagement: int = 0) -> dict[int, tuple[int, ...]] | None:
        """Return the steps of the images that each member leaves out that is not refuted, after a
        split; None before, when members leave out the classes in `left_out`.
        """
        self._need_engagement(engagement)
        return self._suspects.groups(engagement, self._members._state)

    @property
    def status(self) -> list[SetStatus]:
        """Status of each set: that of its members if they agree."""
        return [_status_of(row) for row in self._members_status().tolist()]

    @property
    def tracking(self) -> Flags:
        """Whether some member contains states above the range threshold, shape (B,)."""
        return np.asarray((self._members_status() == SetStatus.TRACKING.value).any(axis=1))

    @property
    def inconsistent(self) -> Flags:
        """Whether all members became empty: more images are wrong than assumed, shape (B,)."""
        return np.asarray(self.refuted.all(axis=1))

    @property
    def inconsistency(self) -> tuple[MaskedIntegers, MaskedFloats]:
        """Step at which the last member became empty, and its label closest to feasible, m; masked
        if some member never did.
        """
        state = self._members._state
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
        ends = np.full((*values.shape[:-1], 1), gap, dtype=values.dtype)
        padded = np.concatenate((values, ends), axis=-1)
        return padded.reshape(*values.shape[:-2], self.batch, -1)

    @property
    def feasible(self) -> Flags:
        """Whether each stored section is not empty, shape (B, R (S + 1))."""
        return np.asarray(self._side_by_side(self._members.feasible & self._counted(), False))

    def _counted(self) -> Flags:
        """Whether each member counts, shape (B R, 1): a refuted one that was stopped does not."""
        stopped = self._members._state.status == SetStatus.STOPPED.value
        return np.asarray(~(stopped & self._members.inconsistent))[:, None]

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
        minimum, maximum, of_min, of_max = (
            self._by_member(values, axis=1) for values in self._members.min_and_max_alpha()
        )
        counts = self._nonempty_members()
        lowest = np.where(counts, minimum, np.inf).argmin(axis=2)[..., None]
        highest = np.where(counts, maximum, -np.inf).argmax(axis=2)[..., None]

        def chosen(values: NDArray[Any], member: NDArray[np.intp]) -> Floats:
            picked = np.take_along_axis(values, member, axis=2)[..., 0]
            return np.asarray(np.where(counts.any(axis=1), picked, 0.0))

        return (
            chosen(minimum, lowest),
            chosen(maximum, highest),
            chosen(of_min, lowest),
            chosen(of_max, highest),
        )

    def _nonempty_members(self) -> Flags:
        """Whether each member has a nonempty section that counts, shape (B, R)."""
        nonempty = np.asarray((self._members.feasible & self._counted()).any(axis=1))
        return self._by_member(nonempty)

    def predicted_miss(self, pending: Sequence[tuple[float, Floats]] = ()) -> PredictedMiss:
        """Return the smallest interval that contains the possible misses of all members."""
        members = len(self.left_out)
        repeated = [(time_s, np.repeat(impulse, members, axis=1)) for time_s, impulse in pending]
        miss = self._members.predicted_miss(repeated)
        counts = self._nonempty_members()
        lower = np.where(counts, self._by_member(miss.lower_m, axis=1), np.inf)
        upper = np.where(counts, self._by_member(miss.upper_m, axis=1), -np.inf)
        lowest = lower.argmin(axis=2)[..., None]
        highest = upper.argmax(axis=2)[..., None]
        exists = np.asarray(counts.any(axis=1))

        def chosen(values: Floats, member: NDArray[np.intp]) -> Floats:
            picked = np.take_along_axis(self._by_member(values, axis=1), member, axis=2)[..., 0]
            return np.asarray(np.where(exists, picked, 0.0))

        def points(of: ExtremePoints, member: NDArray[np.intp]) -> ExtremePoints:
            return ExtremePoints(
                chosen(of.alpha_rad, member),
                chosen(of.omega_rad_s, member),
                chosen(of.range_m, member),
            )

        return PredictedMiss(
            exists,
            chosen(miss.lower_m, lowest),
            chosen(miss.upper_m, highest),
            points(miss.lower_point, lowest),
            points(miss.upper_point, highest),
        )

    def predicted_miss_by_section_m(self) -> tuple[Floats, Floats]:
        """Return minimum and maximum predicted miss of each section, m, each (C, B, R (S + 1));
        zeros if it is empty.
        """
        feasible = self.feasible
        lower, upper = (
            np.where(feasible, self._side_by_side(values, 0.0), 0.0)
            for values in self._members.predicted_miss_by_section_m()
        )
        return lower, upper

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
        """Return the nonempty sections of all members that count, one member after the other."""
        self._need_engagement(engagement)
        rows = engagement * len(self.left_out) + np.flatnonzero(
            self._nonempty_members()[engagement]
        )
        return [section for row in rows.tolist() for section in self._members.sections(row)]

    def section_at(self, label_m: float, engagement: int = 0, member: int = 0) -> Section:
        """Return the section of one member at any label, computed by replaying the history."""
        self._need_engagement(engagement)
        return self._members.section_at(label_m, engagement * len(self.left_out) + member)


class CoveredSet(CoveredSetView, InformationSet):
    """Information sets of a batch of engagements in which at most q images of a flight are wrong.

    It has the methods of `InformationSet`. A member that becomes empty before a label has left is
    refuted, and stops if another one is not. For q = 1 the others are then split into members that
    leave out as few images as possible, see `Suspects`. If all are refuted, more than q images are
    wrong, and the last ones recover as an `InformationSet` does.

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
        members = InformationSet(ordinary, batch * len(left_out), guarantee=guarantee)
        CoveredSetView.__init__(self, members, model, left_out, Suspects(batch, left_out))

    def view(self) -> InformationSetView:
        """Return a read-only view of this set; it follows the set."""
        return CoveredSetView(self._members, self.model, self.left_out, self._suspects)

    def guaranteed_miss(self) -> tuple[Floats, Flags]:
        """Return the guaranteed miss: the maximum over the members that are not refuted."""
        phi_m, exists = self._members.guaranteed_miss()
        exists_of = np.asarray(self._by_member(exists), dtype=bool)
        phi_of = np.where(exists_of, self._by_member(phi_m), 0.0)
        return np.asarray(phi_of.max(axis=1)), np.asarray(exists_of.any(axis=1))

    def measure_angle(self, alpha_rad: ArrayLike, where: ArrayLike = True) -> None:
        """Cut the members that use this image. Its number is the number of periods so far."""
        state = self._members._state
        every = self.model.steps_in(self.model.angle_sensor.period_s)
        image_class = (state.elapsed // every) % self.left_out.shape[1]
        wanted = self._where(where)
        self._suspects.record_image(state, image_class, wanted & self.tracking)

        uses = ~self.left_out[:, image_class] | self._suspects.is_split[:, None]
        active = wanted[:, None] & uses
        measured = real_array("alpha_rad", alpha_rad, (len(self.axes), self.batch))
        self._members.measure_angle(self._lateral_of_members(measured), active.ravel())
        self._stop_refuted()

    def measure_range(
        self,
        range_m: ArrayLike,
        relative_error: float,
        where: ArrayLike = True,
        *,
        alpha_rad: ArrayLike | None = None,
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
        )
        self._stop_refuted()

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
        self._members.shift(self._lateral_of_members(impulse), self._where_of_members(where))

    def drop_below_threshold(self) -> Flags:
        """Remove the sections whose range will be below the threshold after the next step.

        Returns
        -------
        ndarray of bool, shape (B, R (S + 1))
            Stored sections that were removed.
        """
        counted = self._counted()
        removed = self._members.drop_below_threshold() & counted
        return np.asarray(self._side_by_side(removed, False))

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
        return np.repeat(
            np.broadcast_to(values, (len(self.axes), self.batch)), len(self.left_out), axis=1
        )

    def _where(self, where: ArrayLike) -> Flags:
        return np.broadcast_to(flags("where", where, (self.batch,)), (self.batch,))

    def _where_of_members(self, where: ArrayLike) -> Flags:
        return np.repeat(self._where(where), len(self.left_out))

    def _stop_refuted(self) -> None:
        """Stop the refuted members of engagements in which another member is not refuted."""
        refuted = self.refuted
        stopping = refuted & ~self.inconsistent[:, None]
        if some(stopping):
            self._members.stop(stopping.ravel())
        if some(refuted):
            self._suspects.update(self._members._state, self.model.wrong_images)


def classes_left_out(wrong_images: int, image_classes: int) -> Flags:
    """Return the classes that each member of the cover leaves out, shape (C(G, q), G)."""
    members = list(combinations(range(image_classes), wrong_images))
    left_out = np.zeros((len(members), image_classes), dtype=bool)
    for member, classes in enumerate(members):
        left_out[member, list(classes)] = True
    return left_out


def _status_of(members: list[int]) -> SetStatus:
    """Return the status of a set from the values of its members' status."""
    for status in (SetStatus.TRACKING, SetStatus.REFUTED, SetStatus.FINISHED, SetStatus.STOPPED):
        if status.value in members:
            return status
    return SetStatus.EMPTY
