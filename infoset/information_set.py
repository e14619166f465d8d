"""The information set that a person handles: all states that agree with everything measured and done."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from infoset import section_life
from infoset.guaranteed_miss import GuaranteedMiss
from infoset.history import History
from infoset.information_set_view import Flags, Floats, InformationSetView, SetStatus
from infoset.limits import COUNT, NOT_NEGATIVE, PART, flags, real_array, shown
from infoset.location import refine_all
from infoset.model import InitialSet, Recovery, SetModel
from infoset.replays import workspace
from infoset.section_law import BOUND_SLACK, section_law
from infoset.section_life import steepest_angle
from infoset.section_stack import SectionStack


class InformationSet(InformationSetView):
    """All states (alpha, omega, x) that agree with everything measured and done, for a batch of engagements.

    Parameters
    ----------
    model : SetModel
        What is known and assumed.
    batch : int
        Number of engagements B; one by default.
    guarantee : bool
        Whether to keep the guaranteed miss Phi: only the guaranteed model, started from a box, has one. It takes about
        as long as the rest.

    Raises
    ------
    TypeError, ValueError
        If the model is of another type, the batch is no count, or the model has no labels.

    Examples
    --------
    >>> from infoset import AngleSensor, InformationSet, SetModel, StateBox
    >>> known = StateBox(z_m=(-10e3, 10e3), x_m=(5.3e6, 6.3e6), vz_m_s=(-100.0, 100.0), vx_m_s=(-59e3, -57e3))
    >>> sensor = AngleSensor(0.5, 0.00015, 0.00023, nominal_range_m=5.8e6)
    >>> information = InformationSet(SetModel(58e3, 0.5, known, sensor, disturbance_m_s2=0.005, sections=3))
    >>> information
    <InformationSet at t = 0 s: 3 sections, range 5300 to 6300 km, predicted miss -2.105e+04 to 2.105e+04 m>
    >>> information.measure_angle(0.0004)
    >>> information.shift(2.0)
    >>> information.predict()
    >>> information.sections()[0].polygon
    <hexagon, area 8.33e+05>

    Notes
    -----
    The order inside one step: `measure_range`, `measure_angle`, `measure_rate`, `shift`, `drop_below_threshold`,
    `predict`.
    """

    def __init__(self, model: SetModel, batch: int = 1, *, guarantee: bool = True) -> None:
        if not isinstance(model, SetModel):
            raise TypeError(f"model must be a SetModel: got {shown(model)}")
        COUNT.need("batch", batch)
        least, greatest = model.label_limits_m
        slots = max(model.sections, 2 * model.fewest_sections + 1)
        labels = np.full((batch, slots), greatest)
        labels[:, : model.sections] = (
            np.linspace(least, greatest, model.sections) if model.sections > 1 else 0.5 * (least + greatest)
        )
        super().__init__(
            model,
            SectionStack(section_law(model), labels, np.full(batch, model.sections)),
            History(batch),
            (np.full(batch, least), np.full(batch, greatest)),
            np.full(batch, SetStatus.TRACKING.value, dtype=np.int64),
        )
        if guarantee and model.is_guaranteed and model.initial_set is InitialSet.BOX:
            self._phi = GuaranteedMiss(self._stack.law, batch, model.speed_error)

    def guaranteed_miss(self) -> tuple[Floats, Flags]:
        """The guaranteed miss Phi: whatever the truth is and did within its bounds, its miss is no more.

        Returns
        -------
        phi_m : ndarray, shape (B,)
            m; zero where no label has left yet.
        exists : ndarray of bool, shape (B,)
            Whether it holds: some label has left, the model guarantees, and no measurement broke its bounds.

        Notes
        -----
        It is of the labels that have left below the threshold; the truth is among them by the time it arrives.
        """
        if self._phi is None:
            return np.zeros(self.batch), np.zeros(self.batch, dtype=bool)
        return self._phi.bound_m, self._phi.exists & ~self.inconsistent

    def view(self) -> InformationSetView:
        """A read-only view of this set: it follows the set and cannot change it."""
        limits = self._lower_label, self._upper_label
        view = InformationSetView(self.model, self._stack, self._history, limits, self._status)
        # All of these are only ever changed in place.
        view._some_left, view._phi = self._some_left, self._phi
        view._lost_step, view._lost_label = self._lost_step, self._lost_label
        return view

    def measure_range(
        self,
        range_m: ArrayLike,
        relative_error: float,
        where: ArrayLike = True,
        *,
        alpha_rad: ArrayLike | None = None,
    ) -> None:
        """Keep the ranges that a range measurement allows: x_m/(1 + b) <= x <= x_m/(1 - b).

        Parameters
        ----------
        range_m : array_like, shape () or (B,)
            Measured range x_m, m.
        relative_error : float
            Bound b, in [0, 1).
        where : array_like of bool, shape () or (B,)
            Which engagements have measured.
        alpha_rad : array_like, shape () or (B,), or None
            Angle measured at the same moment: in the guaranteed model the distance measured is x / cos(alpha). Without
            it alpha is bounded by how far the object can have gone.

        Raises
        ------
        TypeError, ValueError
            If a value is not finite, the range is negative, or the error bound is not in [0, 1).

        Notes
        -----
        A range measurement cuts no polygon: it narrows the interval of labels.
        """
        PART.need("relative_error", relative_error)
        measured = self._spread(range_m, "range_m")
        if (measured < 0.0).any():
            raise ValueError(f"range_m must not be negative: got {shown(range_m)}")
        active = self._active(where)
        travelled = self.model.closing_speed_m_s * self.time_s
        slack = section_life.CUT_SLACK * (measured + travelled)
        eta = self.model.speed_error
        nearer = np.cos(self._greatest_alpha(alpha_rad)) if self.model.is_guaranteed else 1.0
        lower = measured * nearer / ((1.0 + relative_error) * (1.0 + eta)) + travelled - slack
        upper = measured / ((1.0 - relative_error) * (1.0 - eta)) + travelled + slack
        before = self._lower_label.copy(), self._upper_label.copy()
        self._lower_label[active] = np.maximum(self._lower_label, lower)[active]
        self._upper_label[active] = np.minimum(self._upper_label, upper)[active]
        _, removed = self._stack.keep_labels(self._lower_label, self._upper_label, active)
        if removed:
            emptied = self._keep_enough(active, emptied=SetStatus.EMPTY)
            self._recover(emptied, None, *before)

    def _greatest_alpha(self, measured_rad: ArrayLike | None) -> Floats:
        """Bound of |alpha| now, rad, shape (B,): from a measured one, or from the fastest the object can go."""
        law, travelled = self._stack.law, self.model.closing_speed_m_s * self.time_s
        if measured_rad is not None:
            farthest = law.label_greatest - travelled
            return np.array(
                [steepest_angle(alpha, farthest, law) for alpha in self._spread(measured_rad, "alpha_rad").tolist()]
            )
        box = self.model.bounds
        impulses = self._history.total_impulse() * (1.0 + self.model.execution_error_relative)
        fastest = impulses + max(abs(v) for v in box.vz_m_s) + law.disturbance * self.time_s
        offset = max(abs(z) for z in box.z_m) + fastest * self.time_s
        nearest = np.maximum((self._lower_label - travelled) * (1.0 - self.model.speed_error), 0.0)
        return np.asarray(np.arctan2(offset, nearest))

    def measure_angle(self, alpha_rad: ArrayLike, where: ArrayLike = True) -> None:
        """Cut every section by a line-of-sight angle measurement: |alpha - alpha_m| <= a + h(x).

        Parameters
        ----------
        alpha_rad : array_like, shape () or (B,)
            Measured angle alpha_m, rad.
        where : array_like of bool, shape () or (B,)
            Which engagements have measured.
        """
        measured = self._spread(alpha_rad, "alpha_rad")
        active = self._active(where)
        event = self._history.record(section_life.ANGLE, measured, active)
        before = self._lower_label.copy(), self._upper_label.copy()
        if self._stack.measure_angle(active, measured, self._history.elapsed, event):
            emptied = self._keep_enough(active, emptied=SetStatus.EMPTY)
            self._recover(emptied, event, *before)

    def measure_rate(self, omega_rad_s: ArrayLike, error_rad_s: float, where: ArrayLike = True) -> None:
        """Cut every section by a measurement of the line of sight's rate: |omega - omega_m| <= error.

        Parameters
        ----------
        omega_rad_s : array_like, shape () or (B,)
            Measured rate, rad/s.
        error_rad_s : float
            Its error bound, rad/s.
        where : array_like of bool, shape () or (B,)
            Which engagements have measured.

        References
        ----------
        Kumkov and Patsko (2001).
        """
        NOT_NEGATIVE.need("error_rad_s", error_rad_s)
        measured = self._spread(omega_rad_s, "omega_rad_s")
        active = self._active(where)
        error = error_rad_s * (1.0 + BOUND_SLACK)
        event = self._history.record(section_life.RATE, measured, active, error)
        before = self._lower_label.copy(), self._upper_label.copy()
        if self._stack.measure_rate(active, measured, error, self._history.elapsed, event, self._history):
            emptied = self._keep_enough(active, emptied=SetStatus.EMPTY)
            self._recover(emptied, event, *before)

    def shift(self, impulse_m_s: ArrayLike, where: ArrayLike = True) -> None:
        """Shift every section by an impulse: V becomes V - k, that is omega becomes omega - k/x.

        Parameters
        ----------
        impulse_m_s : array_like, shape () or (B,)
            Impulse k along z, m/s.
        where : array_like of bool, shape () or (B,)
            Which engagements have fired.
        """
        impulse = self._spread(impulse_m_s, "impulse_m_s")
        active = self._followed & flags("where", where, (self.batch,)) & (impulse != 0.0)
        if self._phi is not None:
            self._phi.fire(np.where(active, impulse, 0.0), self._history.elapsed)
        self._history.record(section_life.IMPULSE, impulse, active)
        self._stack.shift(active, impulse, self._history.elapsed)

    def drop_below_threshold(self) -> Flags:
        """Let the sections leave whose range will be below the threshold after the next step.

        Returns
        -------
        ndarray of bool, shape (B, S)
            Which stored sections left.
        """
        active, least_label = self.tracking, self._least_label_next()
        followed = self._followed
        if self._phi is not None:
            leaving_below = np.minimum(self._upper_label, least_label)
            self._phi.leave(followed, self._lower_label, leaving_below, self._stack, self._history)
        if self.model.is_guaranteed:
            # A label may have left though none that is stored has; whether Phi is kept must not change what is flown.
            self._some_left |= active & (self._lower_label < least_label)
        np.maximum(self._lower_label, least_label, out=self._lower_label, where=followed)
        if self._stack.least_label >= least_label:
            return np.zeros(self._stack.labels.shape, dtype=bool)
        left, removed = self._stack.keep_labels(self._lower_label, self._upper_label, active)
        if removed:
            self._some_left |= left.any(axis=1)
            self._keep_enough(active, emptied=SetStatus.FINISHED)
        return left

    def sections_are_leaving(self) -> bool:
        """Whether `drop_below_threshold` would let any stored section leave now."""
        least_label = self._least_label_next()
        if self._stack.least_label >= least_label:
            return False
        return bool(((self._stack.labels < least_label) & self.living).any())

    def _least_label_next(self) -> float:
        """Least label whose range will not be below the threshold after the next step, m."""
        elapsed = self.model.step_s * (self._history.elapsed + 1)
        return self.model.least_range_m + self.model.closing_speed_m_s * elapsed

    def predict(self) -> None:
        """Move the set one step on, under every disturbance within its bound.

        Notes
        -----
        The exact disturbance is a thin lens in (V, z); as in the paper it is the segment between its ends.
        """
        active = self.tracking
        self._history.record(section_life.PREDICTION)
        self._stack.predict(active, self._history.elapsed)

    @property
    def _followed(self) -> Flags:
        """Which engagements Phi follows: also those in which no label above the threshold was found to live."""
        return np.asarray((self._status != SetStatus.STOPPED.value) & (self._status != SetStatus.EMPTY.value))

    def stop(self, where: ArrayLike) -> None:
        """Follow engagements no longer: nothing is computed from now on for those `where` is true, shape () or (B,)."""
        self._status[flags("where", where, (self.batch,))] = SetStatus.STOPPED.value

    def _spread(self, value: ArrayLike, name: str) -> Floats:
        return real_array(name, value, (self.batch,))

    def _active(self, where: ArrayLike) -> Flags:
        return np.asarray(self.tracking & flags("where", where, (self.batch,)))

    def _keep_enough(self, active: Flags, emptied: SetStatus) -> Flags:
        """Re-grid where fewer than the fewest sections are left; note, and return, where nothing lives any more."""
        empty = active & (self.section_counts < self.model.fewest_sections)
        if not empty.any():
            return empty
        self._regrid(empty, 2 * self.model.fewest_sections + 1)
        empty &= self.section_counts == 0
        self._status[empty] = emptied.value
        if emptied is SetStatus.EMPTY:
            self._status[empty & self._some_left] = SetStatus.REFUTED.value
            empty &= ~self._some_left
        return empty

    def _recover(self, empty: Flags, event: int | None, lower: Floats, upper: Floats) -> None:
        """Go on without the measurement that emptied a set: the last consistent set, predicted to now and widened.

        Parameters
        ----------
        empty : ndarray of bool, shape (B,)
            Which sets.
        event : int or None
            The measurement; None for one of range, which is no event.
        lower, upper : ndarray, shape (B,)
            Limits of the labels before it.
        """
        if not empty.any():
            return
        history = self._history
        for b in np.flatnonzero(empty & (self._lost_step < 0)):
            self._lost_step[b] = history.elapsed
            self._lost_label[b] = self._nearest_to_living(int(b), event, lower[b], upper[b])
        if self.model.recovery is Recovery.NONE:
            return
        if event is not None:
            history.retract(event, empty)
        history.record(section_life.WIDENING, applies=empty)
        # Those that this measurement killed live again; their polygons are made anew below.
        sections = self._stack.sections
        stored = np.arange(sections.labels.shape[1]) < sections.used[:, None]
        killed = (sections.died == section_life.ALIVE) | (sections.died == (-1 if event is None else event))
        sections.living[empty] = (stored & killed)[empty]
        self._lower_label[empty], self._upper_label[empty] = lower[empty], upper[empty]
        self._status[empty] = SetStatus.TRACKING.value
        self._regrid(empty, 2 * self.model.fewest_sections + 1)
        self._status[empty & (self.section_counts == 0)] = SetStatus.EMPTY.value

    def _nearest_to_living(self, b: int, event: int | None, lower: float, upper: float) -> float:
        """Label that came nearest to living through a measurement, within the limits of labels before it."""
        used = self._stack.sections.used[b]
        killed = self._stack.sections.died[b, :used] == event
        if event is not None and killed.any():
            overlaps = np.where(killed, self._stack.sections.overlaps[b, :used], -np.inf)
            return float(self._stack.labels[b, overlaps.argmax()])
        middle = 0.5 * (self._lower_label[b] + self._upper_label[b])
        return float(min(max(middle, lower), upper))

    def _regrid(self, wanted: Flags, sections: int) -> None:
        tape, stack = self._history, self._stack
        stack.make_room_for_new(wanted, sections)
        spare = refine_all(
            wanted,
            sections,
            tape.elapsed,
            self._lower_label,
            self._upper_label,
            tape.tapes,
            tape.errors_if_any,
            stack.sections,
            stack.law,
            workspace(tape.events, stack.labels.shape[1]),
        )
        stack.note_new(spare)
