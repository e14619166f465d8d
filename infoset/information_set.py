"""The information set that a person handles: all states that agree with everything measured and done."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from infoset import section_kernels as kernels
from infoset.chains import empty_sections, working_room
from infoset.convex_polygons import ConvexPolygons
from infoset.guaranteed_miss import GuaranteedMiss
from infoset.history import History
from infoset.location import refine_all, workspace
from infoset.model import InitialSet, Interval, Recovery, SetModel
from infoset.predicted_miss import ExtremePoints, PredictedMiss
from infoset.section_stack import SectionStack, outline

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

BOUND_SLACK = 1e-9
"""Relative, of bounds that the guaranteed model computes: what rounding may take from them is far less."""


class SetStatus(Enum):
    """What has become of an information set."""

    TRACKING = 0
    """Some state agrees with everything, above the range threshold."""
    EMPTY = 1
    """No state agrees, none had left below the threshold, and no recovery was possible."""
    FINISHED = 2
    """Every hypothesis has left below the threshold."""
    REFUTED = 3
    """The hypotheses above the threshold are refuted, so the truth is among those that have left."""
    STOPPED = 4
    """No longer followed, at its owner's word."""


@dataclass(frozen=True)
class Section:
    """One x-section of an information set.

    Parameters
    ----------
    label_m : float
        Range at t = 0 under this hypothesis, m.
    range_m : float
        Range now, m.
    closing_speed_m_s : float
        The nominal closing speed e, m/s.
    polygon : ConvexPolygons
        All (V, z) that agree with the history, m/s and m.
    """

    label_m: float
    range_m: float
    closing_speed_m_s: float
    polygon: ConvexPolygons

    @property
    def omega_alpha(self) -> ConvexPolygons:
        """The section as people look at it: (omega, alpha), rad/s and rad."""
        return to_omega_alpha(self.polygon, self.range_m, self.closing_speed_m_s)

    def _repr_svg_(self) -> str:
        from infoset.pictures import sections_svg

        return sections_svg([self], f"section at x = {self.range_m / 1e3:.6g} km")


def to_omega_alpha(polygon: ConvexPolygons, range_m: float, closing_speed_m_s: float) -> ConvexPolygons:
    """Image of a polygon of (V, z) in the (omega, alpha) plane at a range.

    Parameters
    ----------
    polygon : ConvexPolygons
        Polygons of (V, z), m/s and m.
    range_m, closing_speed_m_s : float
        Range x and closing speed e.

    Returns
    -------
    ConvexPolygons
        omega = (V + e z/x)/x in rad/s, alpha = z/x in rad.
    """
    x, e = range_m, closing_speed_m_s
    return polygon.linear_map(np.array([[1.0 / x, e / x**2], [0.0, 1.0 / x]]))


_TRACKING = SetStatus.TRACKING.value


class InformationSetView:
    """What may be asked of an information set; nothing here changes it. Leading axis: B engagements.

    Parameters
    ----------
    model : SetModel
    stack : SectionStack
        The stored sections.
    history : History
        What was measured and done.
    label_limits : tuple of ndarray, shape (B,)
        Least and greatest label that may live, m.
    status : ndarray of int, shape (B,)
        Values of `SetStatus`.
    """

    def __init__(
        self,
        model: SetModel,
        stack: SectionStack,
        history: History,
        label_limits: tuple[Floats, Floats],
        status: NDArray[np.int64],
    ) -> None:
        self.model = model
        self._stack = stack
        self._history = history
        self._lower_label, self._upper_label = label_limits
        self._status = status
        self._some_left = np.zeros(stack.batch, dtype=bool)
        self._phi: GuaranteedMiss | None = None
        self._lost_step = np.full(stack.batch, -1, dtype=np.int64)
        self._lost_label = np.zeros(stack.batch)

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return int(self._stack.batch)

    @property
    def time_s(self) -> float:
        """Time now, s."""
        return self._history.elapsed * self.model.step_s

    @property
    def status(self) -> list[SetStatus]:
        """What has become of each set."""
        return [SetStatus(value) for value in self._status]

    @property
    def tracking(self) -> Flags:
        """Whether each set has states left above the threshold, shape (B,)."""
        return np.asarray(self._status == _TRACKING)

    @property
    def inconsistent(self) -> Flags:
        """Whether the data of each set have contradicted the model: it emptied, and was made anew. Shape (B,)."""
        return np.asarray(self._lost_step >= 0)

    @property
    def inconsistency(self) -> tuple[NDArray[np.int64], Floats]:
        """Step at which each set emptied first (-1: never), and the label (m) that came nearest to living on."""
        return self._lost_step.copy(), self._lost_label.copy()

    @property
    def living(self) -> Flags:
        """Which stored sections live, shape (B, S)."""
        return self._stack.living

    @property
    def labels_m(self) -> Floats:
        """Labels of the stored sections, living or not, m, shape (B, S)."""
        labels = self._stack.labels.view()
        labels.flags.writeable = False
        return labels

    @property
    def ranges_m(self) -> Floats:
        """Ranges of the stored sections now, m, shape (B, S)."""
        return self._stack.ranges(self._history.elapsed)

    @property
    def section_counts(self) -> NDArray[np.int64]:
        """Number of living sections, shape (B,)."""
        return np.asarray(self.living.sum(axis=1))

    def stored_range_interval_m(self) -> tuple[Floats, Floats]:
        """Least and greatest range of the living stored sections, m; zeros where there is none."""
        ranges, living = self.ranges_m, self.living
        tracked = living.any(axis=1)
        least = np.where(living, ranges, np.inf).min(axis=1)
        greatest = np.where(living, ranges, -np.inf).max(axis=1)
        return np.where(tracked, least, 0.0), np.where(tracked, greatest, 0.0)

    def least_and_greatest_alpha(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Least and greatest line-of-sight angle of the stored sections, with the ranges where they are reached.

        Returns
        -------
        alpha_least, alpha_greatest, range_of_least, range_of_greatest : ndarray, shape (B,)
            rad and m; zeros where no section lives.
        """
        living, ranges = self.living, self.ranges_m
        rows = np.arange(self.batch)
        # Dead or unused slots may stand at any range: divide only where a section lives.
        least, greatest = self._stack.heights
        alphas_least = np.divide(least, ranges, out=np.full(ranges.shape, np.inf), where=living)
        alphas_greatest = np.divide(greatest, ranges, out=np.full(ranges.shape, -np.inf), where=living)
        least_at, greatest_at = alphas_least.argmin(axis=1), alphas_greatest.argmax(axis=1)
        tracked = living.any(axis=1)
        return (
            np.where(tracked, alphas_least[rows, least_at], 0.0),
            np.where(tracked, alphas_greatest[rows, greatest_at], 0.0),
            np.where(tracked, ranges[rows, least_at], 0.0),
            np.where(tracked, ranges[rows, greatest_at], 0.0),
        )

    def predicted_miss(self) -> PredictedMiss:
        """Predicted-miss interval over the stored sections, with the points that reach its ends.

        Returns
        -------
        PredictedMiss
            One interval an engagement.

        References
        ----------
        Kumkov and Patsko (1997), equations (13) and (14).
        """
        exists, ends = self._stack.widest(self._history.elapsed)
        lower, upper = ends[:, 0].T, ends[:, 1].T
        return PredictedMiss(exists, lower[0], upper[0], ExtremePoints(*lower[1:]), ExtremePoints(*upper[1:]))

    def worst_predicted_miss_m(self) -> Floats:
        """Greatest modulus of the predicted miss in each stored section, m, shape (B, S); zero where none lives."""
        summaries = self._stack.summaries
        worst = np.maximum(summaries[:, :, kernels.UPPER_MISS], -summaries[:, :, kernels.LOWER_MISS])
        return np.where(self.living, worst, 0.0)

    def predicted_miss_by_section_m(self) -> tuple[Floats, Floats]:
        """Least and greatest predicted miss of each stored section, m, each (B, S); zeros where none lives."""
        summaries, living = self._stack.summaries, self.living
        lower, upper = summaries[:, :, kernels.LOWER_MISS], summaries[:, :, kernels.UPPER_MISS]
        return np.where(living, lower, 0.0), np.where(living, upper, 0.0)

    def sections(self, engagement: int = 0) -> list[Section]:
        """Living sections of one engagement, in rising order of range."""
        ranges = self.ranges_m[engagement]
        return [
            Section(
                float(self._stack.labels[engagement, s]),
                float(ranges[s]),
                self.model.closing_speed_m_s,
                _as_polygon(self._stack.polygon(engagement, int(s), self._history.elapsed)),
            )
            for s in np.flatnonzero(self.living[engagement])
        ]

    def section_at(self, label_m: float, engagement: int = 0) -> Section:
        """The section at any label, had by replaying the history.

        Parameters
        ----------
        label_m : float
            Range at t = 0 of the hypothesis, m.
        engagement : int
            Which of the batch.

        Returns
        -------
        Section
            Its polygon is empty if the label is refuted.

        Notes
        -----
        Some 30 ns an event of the history.
        """
        tape, law, label = self._history, self._stack.law, float(label_m)
        section = empty_sections(1)
        died = kernels.replay(
            label, tape.tape(engagement), tape.errors_if_any, law, *section, 0, np.empty(tape.events), working_room()
        )
        vertices = outline(section, 0, label, tape.elapsed, law) if died == kernels.ALIVE else np.empty((0, 2))
        x = label - law.closing_speed * (law.step * tape.elapsed)
        return Section(label, x, self.model.closing_speed_m_s, _as_polygon(vertices))

    def margin(self, label_m: float, alpha_rad: float, omega_rad_s: float, engagement: int = 0) -> float:
        """Signed margin of a state in the section at its label: positive inside, negative outside.

        Parameters
        ----------
        label_m : float
            Range at t = 0 of the state, m.
        alpha_rad, omega_rad_s : float
            Line-of-sight angle and its rate now.
        engagement : int
            Which of the batch.

        Returns
        -------
        float
            Distance to the boundary, m, with V counted as V x/e, the miss that it is worth; -inf if refuted.
        """
        section = self.section_at(label_m, engagement)
        x, e = section.range_m, section.closing_speed_m_s
        scaled = section.polygon.linear_map(np.array([[x / e, 0.0], [0.0, 1.0]]))
        z, v = alpha_rad * x, omega_rad_s * x - e * alpha_rad
        return float(scaled.margin(np.array([v * x / e, z])))

    def living_range_interval_m(self) -> tuple[Floats, Floats]:
        """Exact ends of the ranges that agree with the history, found by replay between the stored sections.

        Returns
        -------
        least, greatest : ndarray, shape (B,)
            m; zeros where no range agrees.

        Notes
        -----
        About ten replays an end, fewer where it is a limit known already.
        """
        copy = self._detached()
        copy._regrid(self.tracking, 2)
        return copy.stored_range_interval_m()

    def copy(self) -> InformationSet:
        """An information set of its own that starts from this one."""
        return self._detached()

    def _detached(self) -> InformationSet:
        twin = InformationSet.__new__(InformationSet)
        InformationSetView.__init__(
            twin,
            self.model,
            self._stack.copy(),
            self._history.copy(),
            (self._lower_label.copy(), self._upper_label.copy()),
            self._status.copy(),
        )
        twin._some_left = self._some_left.copy()
        twin._lost_step, twin._lost_label = self._lost_step.copy(), self._lost_label.copy()
        twin._phi = None if self._phi is None else self._phi.copy()
        return twin

    def to_shapely(self, engagement: int = 0) -> list[BaseGeometry]:
        """Living sections of one engagement as shapely geometries in the (omega, alpha) plane, rad/s and rad."""
        from infoset.shapes import to_shapely

        return [to_shapely(section.omega_alpha) for section in self.sections(engagement)]

    def _repr_svg_(self) -> str:
        from infoset.pictures import sections_svg

        which = "" if self.batch == 1 else f", the first of {self.batch} engagements"
        return sections_svg(self.sections(), f"{self.section_counts[0]} sections at t = {self.time_s:g} s{which}")

    def __repr__(self) -> str:
        head = f"{type(self).__name__} at t = {self.time_s:g} s"
        if self.batch > 1:
            counts = np.bincount(self._status, minlength=len(SetStatus))
            states = ", ".join(f"{counts[s.value]} {s.name.lower()}" for s in SetStatus if counts[s.value])
            if self.inconsistent.any():
                states += f", {np.count_nonzero(self.inconsistent)} of them inconsistent"
            return f"<{head}: {self.batch} engagements, {states}>"
        if not self.tracking[0]:
            return f"<{head}: {self.status[0].name.lower()}>"
        least, greatest = self.stored_range_interval_m()
        miss = self.predicted_miss()
        return (
            f"<{head}: {self.section_counts[0]} sections, range {least[0] / 1e3:.6g} to {greatest[0] / 1e3:.6g} km, "
            f"predicted miss {miss.lower_m[0]:.4g} to {miss.upper_m[0]:.4g} m>"
        )


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
    The order inside one step: `measure_range`, `measure_angle`, `shift`, `drop_below_threshold`, `predict`.
    """

    def __init__(self, model: SetModel, batch: int = 1, *, guarantee: bool = True) -> None:
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
            Bound b.
        where : array_like of bool, shape () or (B,)
            Which engagements have measured.
        alpha_rad : array_like, shape () or (B,), or None
            Angle measured at the same moment: in the guaranteed model the distance measured is x / cos(alpha). Without
            it alpha is bounded by how far the object can have gone.

        Notes
        -----
        A range measurement cuts no polygon: it narrows the interval of labels.
        """
        measured = self._spread(range_m, "range_m")
        active = self._active(where)
        travelled = self.model.closing_speed_m_s * self.time_s
        slack = kernels.CUT_SLACK * (measured + travelled)
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
        travelled = self.model.closing_speed_m_s * self.time_s
        if measured_rad is not None:
            sensor, farthest = self.model.angle_sensor, self.model.bounds.x_m[1]
            bound = max(sensor.error_bound(0.0), sensor.error_bound(farthest)) * (1.0 + BOUND_SLACK)
            return np.minimum(np.abs(self._spread(measured_rad, "alpha_rad")) + bound, 0.5 * np.pi)
        box, law = self.model.bounds, self._stack.law
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
        event = self._history.record(kernels.ANGLE, measured, active)
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
        measured = self._spread(omega_rad_s, "omega_rad_s")
        active = self._active(where)
        error = error_rad_s * (1.0 + BOUND_SLACK)
        event = self._history.record(kernels.RATE, measured, active, error)
        before = self._lower_label.copy(), self._upper_label.copy()
        if self._stack.measure_rate(active, measured, error, self._history.elapsed, event):
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
        active = self._active(where) & (impulse != 0.0)
        if self._phi is not None:
            self._phi.fire(np.where(self._active(where), impulse, 0.0), self._history.elapsed)
        self._history.record(kernels.IMPULSE, impulse, active)
        self._stack.shift(active, impulse, self._history.elapsed)

    def drop_below_threshold(self) -> Flags:
        """Let the sections leave whose range will be below the threshold after the next step.

        Returns
        -------
        ndarray of bool, shape (B, S)
            Which stored sections left.
        """
        active, least_label = self.tracking, self._least_label_next()
        if self._phi is not None:
            leaving_below = np.minimum(self._upper_label, least_label)
            self._phi.leave(active, self._lower_label, leaving_below, self._stack, self._history)
        np.maximum(self._lower_label, least_label, out=self._lower_label, where=active)
        if self._phi is not None:
            self._some_left |= self._phi.exists
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
        return self.model.range_threshold_m + self.model.closing_speed_m_s * elapsed

    def predict(self) -> None:
        """Move the set one step on, under every disturbance within its bound.

        Notes
        -----
        The exact disturbance is a thin lens in (V, z); as in the paper it is the segment between its ends.
        """
        active = self.tracking
        self._history.record(kernels.PREDICTION)
        self._stack.predict(active, self._history.elapsed)

    def stop(self, where: ArrayLike) -> None:
        """Follow engagements no longer: nothing is computed from now on for those `where` is true, shape () or (B,)."""
        self._status[self._active(where)] = SetStatus.STOPPED.value

    def _spread(self, value: ArrayLike, name: str) -> Floats:
        values = np.asarray(value, dtype=np.float64)
        if not np.isfinite(values).all():
            raise ValueError(f"{name} must be finite: got {value!r}")
        return values if values.shape == (self.batch,) else np.ascontiguousarray(np.broadcast_to(values, self.batch))

    def _active(self, where: ArrayLike) -> Flags:
        return np.asarray(self.tracking & np.asarray(where, dtype=bool))

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
            # The label that came nearest to living through it.
            died, overlaps = self._stack.sections.died[b], self._stack.sections.overlaps[b]
            last = event is not None and (died == event).any()
            nearest = np.where(died == event, overlaps, -np.inf).argmax() if last else len(died) // 2
            self._lost_step[b], self._lost_label[b] = history.elapsed, self._stack.labels[b, nearest]
        if self.model.recovery is Recovery.NONE:
            return
        if event is not None:
            history.retract(event, empty)
        history.record(kernels.WIDENING, applies=empty)
        # Those that this measurement killed live again; their polygons are made anew below.
        sections = self._stack.sections
        stored = np.arange(sections.labels.shape[1]) < sections.used[:, None]
        killed = (sections.died == kernels.ALIVE) | (sections.died == (-1 if event is None else event))
        sections.living[empty] = (stored & killed)[empty]
        self._lower_label[empty], self._upper_label[empty] = lower[empty], upper[empty]
        self._status[empty] = SetStatus.TRACKING.value
        self._regrid(empty, 2 * self.model.fewest_sections + 1)
        self._status[empty & (self.section_counts == 0)] = SetStatus.EMPTY.value

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


def _as_polygon(vertices: Floats) -> ConvexPolygons:
    return ConvexPolygons(vertices, np.asarray(len(vertices)))


def section_law(model: SetModel) -> kernels.SectionLaw:
    """The numbers of a model as the kernels take them.

    Notes
    -----
    Angles do not tell scale: a truth with closing speed e (1 + eta) looks like a motion of the model whose lengths,
    velocities and impulses are those of the truth divided by 1 + eta. So in the guaranteed model bounds of lengths and
    velocities grow outward by eta, an angle bound is the greatest over the ranges that a label can mean, and an
    impulse is known to within eta and the engine's error. See docs/guarantee.md.
    """
    box, sensor, eta = model.bounds, model.angle_sensor, model.speed_error
    slope, error = sensor.error_slope_rad_per_m, sensor.error_at_zero_range_rad
    half_v = model.acceleration_m_s2 * model.step_s
    guaranteed = model.is_guaranteed
    if guaranteed:
        slope *= (1.0 + math.copysign(eta, slope)) * (1.0 + BOUND_SLACK)
        error *= 1.0 + BOUND_SLACK
    z_least, z_greatest = _scaled_outward(box.z_m, eta)
    vz_least, vz_greatest = _scaled_outward(box.vz_m_s, eta)
    return kernels.SectionLaw(
        closing_speed=float(model.closing_speed_m_s),
        step=float(model.step_s),
        disturbance=float(model.acceleration_m_s2),
        half_v=float(half_v),
        # The exact disturbance is a thin lens. The paper takes the segment between its ends; a sound set takes half of
        # the change of V at the start of the step and half at its end, which together contain the lens.
        half_v_at_start=0.5 * float(half_v) if guaranteed else 0.0,
        disturbance_lead=0.0 if guaranteed else 0.5 * float(model.step_s),
        impulse_error=(1.0 + model.execution_error_relative) / (1.0 - eta) - 1.0 if guaranteed else 0.0,
        error_at_zero_range=float(error),
        error_slope=float(slope),
        exact_angles=guaranteed,
        label_least=float(model.label_limits_m[0]),
        label_greatest=float(model.label_limits_m[1]),
        z_least=z_least,
        z_greatest=z_greatest,
        vz_least=vz_least,
        vz_greatest=vz_greatest,
        vx_least=float(box.vx_m_s[0]),
        vx_greatest=float(box.vx_m_s[1]),
        rectangle=model.initial_set is InitialSet.RECTANGLE,
    )


def _scaled_outward(interval: Interval, eta: float) -> Interval:
    """Interval of all a / (1 + h) with a of the interval and |h| <= eta, an ulp or two wider if eta is not zero."""
    least, greatest = interval
    if eta == 0.0:
        return float(least), float(greatest)
    slack = 1.0 + BOUND_SLACK
    return (
        slack * least / (1.0 - eta) if least < 0.0 else least / (1.0 + eta) / slack,
        slack * greatest / (1.0 - eta) if greatest > 0.0 else greatest / (1.0 + eta) / slack,
    )
