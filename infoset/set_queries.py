"""Queries of an information set: the part of its interface that changes nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from infoset import section_life
from infoset.chains import empty_sections, working_room
from infoset.convex_polygons import ConvexPolygons
from infoset.limits import NUMBER, POSITIVE, WHOLE
from infoset.pictures import sections_svg
from infoset.predicted_miss import ExtremePoints, PredictedMiss
from infoset.replays import replay_section
from infoset.section_stack import outline
from infoset.set_state import Flags, Floats, SetState, SetStatus

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

MaskedFloats = np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]
MaskedIntegers = np.ma.MaskedArray[tuple[int], np.dtype[np.int64]]


@dataclass(frozen=True)
class Section:
    """One x-section of an information set.

    Parameters
    ----------
    label_m : float
        Range at t = 0, m: the hypothesis of the section.
    range_m : float
        Range now, m.
    closing_speed_m_s : float
        Nominal closing speed e, m/s.
    polygon : ConvexPolygons
        All (V, z) that agree with the history, m/s and m.
    """

    label_m: float
    range_m: float
    closing_speed_m_s: float
    polygon: ConvexPolygons

    @property
    def omega_alpha(self) -> ConvexPolygons:
        """The section in the (omega, alpha) plane, rad/s and rad."""
        return to_omega_alpha(self.polygon, self.range_m, self.closing_speed_m_s)

    def _repr_svg_(self) -> str:
        return sections_svg([self.omega_alpha.polygon()], f"section at x = {self.range_m / 1e3:.6g} km")


def to_omega_alpha(polygon: ConvexPolygons, range_m: float, closing_speed_m_s: float) -> ConvexPolygons:
    """Map polygons from the (V, z) plane to the (omega, alpha) plane at a range.

    Parameters
    ----------
    polygon : ConvexPolygons
        Polygons of (V, z), m/s and m.
    range_m, closing_speed_m_s : float
        Range x, m, and closing speed e, m/s.

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


class SetQueries:
    """Queries of B information sets; the leading axis of every result is the engagement.

    Parameters
    ----------
    state : SetState
        The state to read. It may be shared with the set that changes it.

    Attributes
    ----------
    model : SetModel
        Known constants and assumptions.
    """

    def __init__(self, state: SetState) -> None:
        self.model = state.model
        self._state = state

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return int(self._state.stack.batch)

    @property
    def time_s(self) -> float:
        """Time now, s."""
        return self._state.history.elapsed * self.model.step_s

    @property
    def status(self) -> list[SetStatus]:
        """Status of each set."""
        return [SetStatus(value) for value in self._state.status]

    @property
    def tracking(self) -> Flags:
        """Whether each set contains states above the range threshold, shape (B,)."""
        return np.asarray(self._state.status == _TRACKING)

    @property
    def inconsistent(self) -> Flags:
        """Whether the data contradicted the model, so that the set became empty at some step, shape (B,)."""
        return np.asarray(self._state.lost_step >= 0)

    @property
    def inconsistency(self) -> tuple[MaskedIntegers, MaskedFloats]:
        """Step at which each set first became empty, and its label closest to living, m; masked if it never did."""
        never = ~self.inconsistent
        return (
            np.ma.MaskedArray(self._state.lost_step.copy(), mask=never),
            np.ma.MaskedArray(self._state.lost_label.copy(), mask=never),
        )

    @property
    def living(self) -> Flags:
        """Whether each stored section lives, that is, is not empty, shape (B, S)."""
        living = self._state.stack.living.view()
        living.flags.writeable = False
        return living

    @property
    def labels_m(self) -> Floats:
        """Labels of all stored sections, m, shape (B, S)."""
        labels = self._state.stack.labels.view()
        labels.flags.writeable = False
        return labels

    @property
    def ranges_m(self) -> Floats:
        """Ranges of all stored sections now, m, shape (B, S)."""
        return self._state.stack.ranges(self._state.history.elapsed)

    @property
    def section_counts(self) -> NDArray[np.int64]:
        """Number of living sections, shape (B,)."""
        return np.asarray(np.count_nonzero(self._state.stack.living, axis=1))

    def stored_range_interval_m(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest range of the living sections, m; zeros where none lives."""
        ranges, living = self.ranges_m, self.living
        tracked = living.any(axis=1)
        least = np.where(living, ranges, np.inf).min(axis=1)
        greatest = np.where(living, ranges, -np.inf).max(axis=1)
        return np.where(tracked, least, 0.0), np.where(tracked, greatest, 0.0)

    def least_and_greatest_alpha(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the least and the greatest line-of-sight angle of the living sections, and their ranges.

        Returns
        -------
        alpha_least, alpha_greatest, range_of_least, range_of_greatest : ndarray, shape (B,)
            rad and m; zeros where no section lives.
        """
        ranges = self.ranges_m
        # Empty or unused slots may have any range, and so may the sections of stopped engagements.
        living = self.living & (ranges != 0.0)
        rows = np.arange(self.batch)
        least, greatest = self._state.stack.heights
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
        """Return the predicted-miss interval of each engagement and the states that reach its ends.

        References
        ----------
        Kumkov and Patsko (1997), equations (13) and (14).
        """
        exists, ends = self._state.stack.widest(self._state.history.elapsed)
        lower, upper = ends[:, 0].T, ends[:, 1].T
        return PredictedMiss(exists, lower[0], upper[0], ExtremePoints(*lower[1:]), ExtremePoints(*upper[1:]))

    def worst_predicted_miss_m(self) -> Floats:
        """Return the greatest |predicted miss| in each stored section, m, shape (B, S); zero for empty sections."""
        summaries = self._state.stack.summaries
        worst = np.maximum(summaries[:, :, section_life.UPPER_MISS], -summaries[:, :, section_life.LOWER_MISS])
        return np.where(self.living, worst, 0.0)

    def predicted_miss_by_section_m(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest predicted miss of each section, m, each (B, S); zeros if it is empty."""
        summaries, living = self._state.stack.summaries, self.living
        lower, upper = summaries[:, :, section_life.LOWER_MISS], summaries[:, :, section_life.UPPER_MISS]
        return np.where(living, lower, 0.0), np.where(living, upper, 0.0)

    def sections(self, engagement: int = 0) -> list[Section]:
        """Return the living sections of one engagement in order of increasing range."""
        self._need_engagement(engagement)
        ranges = self.ranges_m[engagement]
        return [
            Section(
                float(self._state.stack.labels[engagement, s]),
                float(ranges[s]),
                self.model.closing_speed_m_s,
                _as_polygon(self._state.stack.polygon(engagement, int(s), self._state.history.elapsed)),
            )
            for s in np.flatnonzero(self.living[engagement])
        ]

    def section_at(self, label_m: float, engagement: int = 0) -> Section:
        """Return the section at any label, computed by replaying the history.

        Parameters
        ----------
        label_m : float
            Range at t = 0, m.
        engagement : int
            Number of the engagement.

        Returns
        -------
        Section
            Its polygon is empty if the data exclude the label.

        Notes
        -----
        About 30 ns per event of the history.
        """
        NUMBER.need("label_m", label_m)
        self._need_engagement(engagement)
        tape, law, label = self._state.history, self._state.stack.law, float(label_m)
        section = empty_sections(1)
        died = replay_section(
            label, tape.tape(engagement), tape.errors_if_any, law, *section, 0, np.empty(tape.events), working_room()
        )
        vertices = outline(section, 0, label, tape.elapsed, law) if died == section_life.ALIVE else np.empty((0, 2))
        x = label - law.closing_speed * (law.step * tape.elapsed)
        return Section(label, x, self.model.closing_speed_m_s, _as_polygon(vertices))

    def margin(self, label_m: float, alpha_rad: float, omega_rad_s: float, engagement: int = 0) -> float:
        """Return the signed distance of a state to the boundary of its section: positive inside, negative outside.

        Parameters
        ----------
        label_m : float
            Range at t = 0 of the state, m.
        alpha_rad, omega_rad_s : float
            Line-of-sight angle, rad, and its rate, rad/s, now.
        engagement : int
            Number of the engagement.

        Returns
        -------
        float
            Distance in the plane of V x/e and z, m; -inf if the section is empty.
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
            raise IndexError(f"engagement must be less than {self.batch}, the number of engagements: got {engagement}")

    def living_range_interval_m(self) -> tuple[Floats, Floats]:
        """Return the least and the greatest range, m, that agree with the history, to rounding.

        Returns
        -------
        least, greatest : ndarray, shape (B,)
            m; zeros where no range agrees.

        Notes
        -----
        The ends are located between the stored sections by about ten replays each.
        """
        refined = self._state.copy()
        refined.refine(self.tracking, 2)
        return SetQueries(refined).stored_range_interval_m()

    def to_shapely(self, engagement: int = 0) -> list[BaseGeometry]:
        """Return the living sections of one engagement as shapely geometries of (omega, alpha), rad/s and rad."""
        from infoset.shapes import to_shapely

        return [to_shapely(section.omega_alpha) for section in self.sections(engagement)]

    def _repr_svg_(self) -> str:
        which = "" if self.batch == 1 else f", the first of {self.batch} engagements"
        outlines = [section.omega_alpha.polygon() for section in self.sections()]
        return sections_svg(outlines, f"{self.section_counts[0]} sections at t = {self.time_s:g} s{which}")

    def __repr__(self) -> str:
        head = f"{type(self).__name__} at t = {self.time_s:g} s"
        if self.batch > 1:
            counts = np.bincount(self._state.status, minlength=len(SetStatus))
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
