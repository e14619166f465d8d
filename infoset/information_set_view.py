"""What may be asked of an information set: all that strategies and noises see of it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoset import section_life, section_passes
from infoset.chains import empty_sections, working_room
from infoset.convex_polygons import ConvexPolygons
from infoset.guaranteed_miss import GuaranteedMiss
from infoset.history import History
from infoset.limits import NUMBER, POSITIVE, WHOLE
from infoset.model import SetModel
from infoset.pictures import sections_svg
from infoset.predicted_miss import ExtremePoints, PredictedMiss
from infoset.section_stack import SectionStack, outline

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

    from infoset.information_set import InformationSet

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
MaskedFloats = np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]
MaskedIntegers = np.ma.MaskedArray[tuple[int], np.dtype[np.int64]]


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
        return sections_svg([self.omega_alpha.polygon()], f"section at x = {self.range_m / 1e3:.6g} km")


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
    POSITIVE.need("range_m", range_m)
    POSITIVE.need("closing_speed_m_s", closing_speed_m_s)
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
    def inconsistency(self) -> tuple[MaskedIntegers, MaskedFloats]:
        """Step at which each set emptied first, and the label (m) that came nearest to living on; masked: never."""
        never = ~self.inconsistent
        return (
            np.ma.MaskedArray(self._lost_step.copy(), mask=never),
            np.ma.MaskedArray(self._lost_label.copy(), mask=never),
        )

    @property
    def living(self) -> Flags:
        """Which stored sections live, shape (B, S)."""
        living = self._stack.living.view()
        living.flags.writeable = False
        return living

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
        return np.asarray(np.count_nonzero(self._stack.living, axis=1))

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
        ranges = self.ranges_m
        # Dead or unused slots may stand at any range, and so may sections of engagements that are followed no longer.
        living = self.living & (ranges != 0.0)
        rows = np.arange(self.batch)
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
        worst = np.maximum(summaries[:, :, section_life.UPPER_MISS], -summaries[:, :, section_life.LOWER_MISS])
        return np.where(self.living, worst, 0.0)

    def predicted_miss_by_section_m(self) -> tuple[Floats, Floats]:
        """Least and greatest predicted miss of each stored section, m, each (B, S); zeros where none lives."""
        summaries, living = self._stack.summaries, self.living
        lower, upper = summaries[:, :, section_life.LOWER_MISS], summaries[:, :, section_life.UPPER_MISS]
        return np.where(living, lower, 0.0), np.where(living, upper, 0.0)

    def sections(self, engagement: int = 0) -> list[Section]:
        """Living sections of one engagement, in rising order of range."""
        self._need_engagement(engagement)
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
        NUMBER.need("label_m", label_m)
        self._need_engagement(engagement)
        tape, law, label = self._history, self._stack.law, float(label_m)
        section = empty_sections(1)
        died = section_passes.replay_section(
            label, tape.tape(engagement), tape.errors_if_any, law, *section, 0, np.empty(tape.events), working_room()
        )
        vertices = outline(section, 0, label, tape.elapsed, law) if died == section_life.ALIVE else np.empty((0, 2))
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
        NUMBER.need("alpha_rad", alpha_rad)
        NUMBER.need("omega_rad_s", omega_rad_s)
        section = self.section_at(label_m, engagement)
        x, e = section.range_m, section.closing_speed_m_s
        scaled = section.polygon.linear_map(np.array([[x / e, 0.0], [0.0, 1.0]]))
        z, v = alpha_rad * x, omega_rad_s * x - e * alpha_rad
        return float(scaled.margin(np.array([v * x / e, z])))

    def _need_engagement(self, engagement: int) -> None:
        WHOLE.need("engagement", engagement)
        if engagement >= self.batch:
            raise IndexError(f"engagement must be less than {self.batch}, their number: got {engagement}")

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
        from infoset.information_set import InformationSet

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
        which = "" if self.batch == 1 else f", the first of {self.batch} engagements"
        outlines = [section.omega_alpha.polygon() for section in self.sections()]
        return sections_svg(outlines, f"{self.section_counts[0]} sections at t = {self.time_s:g} s{which}")

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


def _as_polygon(vertices: Floats) -> ConvexPolygons:
    return ConvexPolygons(vertices, np.asarray(len(vertices)))
