"""The information set, and its read-only view for strategies and noises."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from infoset.arrays import Flags, Floats, some
from infoset.engine import section_life, section_passes
from infoset.engine.history import ANGLE, IMPULSE, RATE, WIDENING
from infoset.engine.section_law import BOUND_SLACK
from infoset.engine.set_state import SetState, SetStatus
from infoset.limits import COUNT, NOT_NEGATIVE, PART, flags, real_array, shown
from infoset.model import Recovery, SetModel
from infoset.set_queries import SetQueries


class InformationSetView(SetQueries):
    """Read-only view of an information set. It follows the set and cannot change it."""

    def copy(self) -> InformationSet:
        """Return an independent information set that starts from the state of this one."""
        twin = InformationSet.__new__(InformationSet)
        SetQueries.__init__(twin, self._state.copy())
        return twin


class InformationSet(InformationSetView):
    """All states (alpha, omega, x) that agree with the measurements and impulses so far.

    It is a batch of such sets, one for each engagement.

    Parameters
    ----------
    guarantee : bool
        Whether to compute the guaranteed miss Phi. Only the guaranteed model with a box as initial
        set has one. A run takes 1.1 to 1.9 times as long, with a rate sensor 1.4 to 9 times.

    Raises
    ------
    TypeError, ValueError
        If the model is not a `SetModel`, the batch is not a positive whole number, or the model has
        no labels.

    Examples
    --------
    >>> from infoset import AngleSensor, InformationSet, SetModel, StateBox
    >>> known = StateBox(
    ...     z_m=(-10e3, 10e3), x_m=(5.3e6, 6.3e6), vz_m_s=(-100.0, 100.0), vx_m_s=(-59e3, -57e3)
    ... )
    >>> sensor = AngleSensor(0.5, 0.00015, 0.00023, nominal_range_m=5.8e6)
    >>> model = SetModel(58e3, 0.5, known, sensor, disturbance_m_s2=0.005, sections=5)
    >>> information = InformationSet(model)
    >>> information
    <InformationSet of 1 at t = 0 s>
    >>> information.measure_angle(0.0004)
    >>> information.shift(2.0)
    >>> information.predict()
    >>> information.sections()[0].polygons
    ConvexPolygons(shape=(1,), counts=[6])

    Notes
    -----
    The order inside one step: `measure_range`, `measure_angle`, `measure_rate`, `shift`,
    `drop_below_threshold`, `predict`.
    """

    def __init__(self, model: SetModel, batch: int = 1, *, guarantee: bool = True) -> None:
        if not isinstance(model, SetModel):
            raise TypeError(f"model must be a SetModel: got {shown(model)}")
        COUNT.need("batch", batch)
        super().__init__(SetState(model, batch, guarantee))

    def guaranteed_miss(self) -> tuple[Floats, Flags]:
        """Return the guaranteed miss Phi, an upper bound of the true miss.

        It holds if all errors are within their bounds.

        Returns
        -------
        phi_m : ndarray, shape (B,)
            m; zero while no label has passed below the range threshold.
        exists : ndarray of bool, shape (B,)
            Whether the bound is valid: some label has passed below the threshold, the model is
            guaranteed, and the data never contradicted it.

        Notes
        -----
        Phi bounds the miss of the labels below the threshold. At arrival the label of the true
        state is below it.
        """
        state = self._state
        if state.phi is None:
            return np.zeros(self.batch), np.zeros(self.batch, dtype=bool)
        phi_m, exists = state.phi.bound(state.table, state.history)
        return phi_m, exists & ~self.inconsistent

    def view(self) -> InformationSetView:
        """Return a read-only view of this set; it follows the set."""
        return InformationSetView(self._state)

    def measure_range(
        self,
        range_m: ArrayLike,
        relative_error: float,
        where: ArrayLike = True,
        *,
        alpha_rad: ArrayLike | None = None,
    ) -> None:
        """Keep the ranges that agree with a measurement: x_m/(1 + b) <= x <= x_m/(1 - b).

        Parameters
        ----------
        range_m : array_like, shape () or (B,)
            Measured range x_m, m.
        relative_error : float
            Bound b, in [0, 1).
        where : array_like of bool, shape () or (B,)
            Engagements with a measurement.
        alpha_rad : array_like, shape () or (C, B), or None
            Angles measured at the same time. In the guaranteed model the measured distance is x /
            cos(alpha); without a measured angle, alpha is bounded by the maximum possible
            displacement across x.

        Raises
        ------
        TypeError, ValueError
            If a value is not finite, the range is negative, or the error bound is not in [0, 1).

        Notes
        -----
        A range measurement narrows the interval of labels and leaves the polygons of the others
        unchanged.
        """
        PART.need("relative_error", relative_error)
        measured = real_array("range_m", range_m, (self.batch,))
        if some(measured < 0.0):
            raise ValueError(f"range_m must not be negative: got {shown(range_m)}")

        state = self._state
        active = self._active(where)
        travelled = self.model.closing_speed_m_s * self.time_s
        slack = section_life.CUT_SLACK * (measured + travelled)
        eta = self.model.speed_error
        nearer = self._min_cosine(alpha_rad) if self.model.is_guaranteed else 1.0
        lower = measured * nearer / ((1.0 + relative_error) * (1.0 + eta)) + travelled - slack
        upper = measured / ((1.0 - relative_error) * (1.0 - eta)) + travelled + slack

        before = state.lower_label.copy(), state.upper_label.copy()
        state.lower_label[active] = np.maximum(state.lower_label, lower)[active]
        state.upper_label[active] = np.minimum(state.upper_label, upper)[active]
        _, removed = state.keep_labels(active)
        if removed:
            emptied = self._refine_if_few(active, emptied=SetStatus.EMPTY)
            self._recover(emptied, None, *before)

    def _min_cosine(self, measured_rad: ArrayLike | None) -> Floats:
        """Return a lower bound of x over the distance, shape (B,).

        It follows from measured angles, or from the maximum velocity.
        """
        state = self._state
        travelled = self.model.closing_speed_m_s * self.time_s
        if measured_rad is not None:
            alpha = self._lateral("alpha_rad", measured_rad)
            steepest = np.empty((2, self.batch))
            section_passes.steepest_all(
                alpha, state.law.label_max - travelled, state.table, steepest
            )
            return np.asarray(np.cos(steepest[0]) * np.cos(steepest[1]))

        box = self.model.bounds
        impulses = state.history.total_impulse() * (1.0 + self.model.execution_error_relative)
        disturbance = float(np.hypot.reduce([law.disturbance for law in state.laws]))
        fastest = impulses + box.lateral_speed_m_s + disturbance * self.time_s
        offset = box.offset_m + fastest * self.time_s
        min_range = (state.lower_label - travelled) * (1.0 - self.model.speed_error)
        nearest = np.maximum(min_range, 0.0)
        return np.asarray(np.cos(np.arctan2(offset, nearest)))

    def measure_angle(self, alpha_rad: ArrayLike, where: ArrayLike = True) -> None:
        """Cut every section by a line-of-sight angle measurement: |alpha - alpha_m| <= a + h(x).

        Parameters
        ----------
        alpha_rad : array_like, shape () or (C, B)
            Measured angle alpha_m along each lateral axis, rad.
        where : array_like of bool, shape () or (B,)
            Engagements with a measurement.
        """
        measured = self._lateral("alpha_rad", alpha_rad)

        state = self._state
        active = self._active(where)
        event = state.history.record(ANGLE, measured, active)
        before = state.lower_label.copy(), state.upper_label.copy()
        elapsed = state.history.elapsed
        sections = state.sections
        laws = state.table
        if section_passes.step_all(
            active, measured, event, elapsed, section_passes.MOVED, sections, laws
        ):
            emptied = self._refine_if_few(active, emptied=SetStatus.EMPTY)
            self._recover(emptied, event, *before)

    def measure_rate(
        self, omega_rad_s: ArrayLike, error_rad_s: float, where: ArrayLike = True
    ) -> None:
        """Cut every section by a measurement of the line-of-sight rate: |omega - omega_m| <= error.

        Parameters
        ----------
        omega_rad_s : array_like, shape () or (C, B)
            Measured rate of the plane angle along each lateral axis, rad/s.
        error_rad_s : float
            Error bound of the rate, rad/s.
        where : array_like of bool, shape () or (B,)
            Engagements with a measurement.

        References
        ----------
        Kumkov and Patsko (2001).
        """
        NOT_NEGATIVE.need("error_rad_s", error_rad_s)
        measured = self._lateral("omega_rad_s", omega_rad_s)

        state = self._state
        active = self._active(where)
        error = error_rad_s * (1.0 + BOUND_SLACK)
        event = state.history.record(RATE, measured, active, error)
        before = state.lower_label.copy(), state.upper_label.copy()
        if state.measure_rate(error):
            emptied = self._refine_if_few(active, emptied=SetStatus.EMPTY)
            self._recover(emptied, event, *before)

    def shift(self, impulse_m_s: ArrayLike, where: ArrayLike = True) -> None:
        """Shift every section by an impulse k: V becomes V - k, and omega becomes omega - k/x.

        Parameters
        ----------
        impulse_m_s : array_like, shape () or (C, B)
            Impulse k along each lateral axis, m/s.
        where : array_like of bool, shape () or (B,)
            Engagements with an impulse.
        """
        impulse = self._lateral("impulse_m_s", impulse_m_s)
        state = self._state
        active = self._computes_phi & flags("where", where, (self.batch,)) & impulse.any(axis=0)
        if some(active):
            state.history.record(IMPULSE, impulse, active)
            state.shift(active, impulse)

    def drop_below_threshold(self) -> Flags:
        """Remove the sections whose range will be below the threshold after the next step.

        Returns
        -------
        ndarray of bool, shape (B, S)
            Stored sections that were removed.
        """
        state = self._state
        active = self.tracking
        min_label = self._min_label_next()
        computes_phi = self._computes_phi

        if state.phi is not None:
            state.phi.leave(
                computes_phi, state.lower_label, state.upper_label, state.sections, state.history
            )
        if self.model.is_guaranteed:
            # A label between the stored ones may pass the threshold. The status must not depend on
            # whether Phi is computed.
            state.some_left |= active & (state.lower_label < min_label)
        np.maximum(state.lower_label, min_label, out=state.lower_label, where=computes_phi)

        if state.min_label >= min_label:
            return np.zeros(state.labels.shape, dtype=bool)
        left, removed = state.keep_labels(active)
        if removed:
            state.some_left |= left.any(axis=1)
            self._refine_if_few(active, emptied=SetStatus.FINISHED)
        return left

    def sections_are_leaving(self) -> bool:
        """Return whether `drop_below_threshold` would remove a stored section now."""
        min_label = self._min_label_next()
        if self._state.min_label >= min_label:
            return False
        return bool(((self._state.labels < min_label) & self.feasible).any())

    def _min_label_next(self) -> float:
        """Minimum label, m, whose range is not below the threshold after the next step."""
        elapsed = self.model.step_s * (self._state.history.elapsed + 1)
        return self.model.min_range_m + self.model.closing_speed_m_s * elapsed

    def predict(self) -> None:
        """Predict the set over one step, for all disturbances within the bound.

        The exact set of disturbances is a thin lens in (V, z). As in the paper, it is replaced by
        the segment between its ends.
        """
        self._state.predict(self.tracking)

    @property
    def _computes_phi(self) -> Flags:
        """Engagements in which Phi is updated, also without feasible labels above the threshold."""
        status = self._state.status
        return np.asarray((status != SetStatus.STOPPED.value) & (status != SetStatus.EMPTY.value))

    def stop(self, where: ArrayLike) -> None:
        """Stop the computation in the engagements where `where`, shape () or (B,), is true."""
        self._state.status[flags("where", where, (self.batch,))] = SetStatus.STOPPED.value

    def _lateral(self, name: str, value: ArrayLike) -> Floats:
        """Return values along each axis, shape (C, B)."""
        return np.ascontiguousarray(real_array(name, value, (len(self.axes), self.batch)))

    def _active(self, where: ArrayLike) -> Flags:
        return np.asarray(self.tracking & flags("where", where, (self.batch,)))

    def _refine_if_few(self, active: Flags, emptied: SetStatus) -> Flags:
        """Make a new grid where too few sections are left; return where to recover.

        The status of sets that are empty is set.
        """
        empty = active & (self.section_counts < self.model.fewest_sections)
        if not some(empty):
            return empty
        self._state.refine(empty, 2 * self.model.fewest_sections + 1)
        empty &= ~self.feasible.any(axis=1)
        self._state.status[empty] = emptied.value
        if emptied is SetStatus.EMPTY:
            self._state.status[empty & self._state.some_left] = SetStatus.REFUTED.value
            empty &= ~self._state.some_left
        return empty

    def _recover(self, empty: Flags, event: int | None, lower: Floats, upper: Floats) -> None:
        """Discard the measurement that emptied a set: restore the last consistent set, predict and
        enlarge it.

        `event` is None for a range, which the history does not contain. `lower` and `upper`, shape
        (B,), are the limits of the labels before the measurement, m.
        """
        if not some(empty):
            return
        state = self._state
        history = self._state.history
        for b in np.flatnonzero(empty & (state.lost_step < 0)):
            state.lost_step[b] = history.elapsed
            state.lost_label[b] = self._nearest_to_feasible(int(b), event, lower[b], upper[b])
        if self.model.recovery is Recovery.NONE:
            return
        if event is not None:
            history.retract(event, empty)
        history.record(WIDENING, applies=empty)
        # The labels that this measurement emptied are feasible again; the refinement below
        # recomputes their polygons.
        slots = state.sections.slots
        stored = np.arange(slots.shape[1]) < state.sections.used[:, None]
        feasible_before = (slots["emptied_at"] == section_life.NEVER_EMPTIED) | (
            slots["emptied_at"] == (-1 if event is None else event)
        )
        slots["feasible"][empty] = (stored & feasible_before)[empty]
        state.lower_label[empty], state.upper_label[empty] = lower[empty], upper[empty]
        state.status[empty] = SetStatus.TRACKING.value
        state.refine(empty, 2 * self.model.fewest_sections + 1)
        state.status[empty & (self.section_counts == 0)] = SetStatus.EMPTY.value

    def _nearest_to_feasible(self, b: int, event: int | None, lower: float, upper: float) -> float:
        """Label, m, whose section was closest to the band of a measurement that emptied the set."""
        state = self._state
        sections = self._state.sections
        slots = sections.slots[b, : sections.used[b]]
        emptied_now = slots["emptied_at"] == event
        if event is not None and emptied_now.any():
            return float(slots["label"][np.where(emptied_now, slots["overlap"], -np.inf).argmax()])
        middle = 0.5 * (state.lower_label[b] + state.upper_label[b])
        return float(min(max(middle, lower), upper))
