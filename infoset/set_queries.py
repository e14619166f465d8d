"""Queries of an information set: the part of its interface that changes nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats
from infoset.engine import section_life
from infoset.engine.predicted_miss import ExtremePoints, PredictedMiss
from infoset.engine.replays import replay_label
from infoset.engine.set_state import SetState, SetStatus
from infoset.engine.workspace import LAST_REPLAY, ROWS, past_of
from infoset.geometry.convex_polygons import ConvexPolygons
from infoset.limits import NUMBER, WHOLE, Limits

MaskedFloats = np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]
MaskedIntegers = np.ma.MaskedArray[tuple[int], np.dtype[np.int64]]

MIN_RANGE_M = 1e-25
"""Minimum range of a section mapped to (omega, alpha).

e/x^2 is then less than `infoset.limits.MAXIMUM`, 1e60, up to the speed of light.
"""


@dataclass(frozen=True)
class Section:
    """One x-section of an information set.

    Parameters
    ----------
    label_m, range_m : float
        Range at t = 0, the hypothesis of the section, and range now, m.
    closing_speed_m_s : float
        Nominal closing speed e, m/s.
    polygons : ConvexPolygons, shape (C,)
        Velocities and offsets along each lateral axis that agree with the history, m/s and m: (V,
        z) in a plane, (V_y, y) and (V, z) in space, where the section is the product of both.
    member : int
        Member of a set that allows for wrong images (`CoveredSet`); 0 in any other set.
    """

    label_m: float
    range_m: float
    closing_speed_m_s: float
    polygons: ConvexPolygons
    member: int = 0

    @property
    def omega_alpha(self) -> ConvexPolygons:
        """The section in the plane of omega and alpha of each axis, shape (C,).

        omega = (V + e z/x)/x, rad/s, and alpha = z/x, rad. The range x must be at least
        `MIN_RANGE_M`.
        """
        x = self.range_m
        e = self.closing_speed_m_s
        Limits(minimum=MIN_RANGE_M).need("range_m", x)
        return self.polygons.linear_map(np.array([[1.0 / x, e / x**2], [0.0, 1.0 / x]]))


class SetQueries:
    """Queries of B information sets with C lateral axes: z in a plane, y and z in space.

    Results have the shape (B, ...), or (C, B, ...) if they belong to the lateral axes.

    Parameters
    ----------
    state : SetState
        The state to read. It may be shared with the set that changes it.
    """

    def __init__(self, state: SetState) -> None:
        self.model = state.model
        self._state = state

    @property
    def axes(self) -> tuple[str, ...]:
        """Lateral axes: ("z",) in a plane, ("y", "z") in space."""
        return self.model.axes

    @property
    def batch(self) -> int:
        """Number of engagements B."""
        return int(self._state.batch)

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
        return self._state.tracking

    @property
    def inconsistent(self) -> Flags:
        """Whether each set became empty before a label of it had left, shape (B,): the data
        contradict the model.
        """
        return np.asarray(self._state.lost_step >= 0)

    @property
    def inconsistency(self) -> tuple[MaskedIntegers, MaskedFloats]:
        """First step at which each set became empty, and its label closest to the data, m.

        Both are masked for sets that are not `inconsistent`.
        """
        never = ~self.inconsistent
        return (
            np.ma.MaskedArray(self._state.lost_step.copy(), mask=never),
            np.ma.MaskedArray(self._state.lost_label.copy(), mask=never),
        )

    @property
    def feasible(self) -> Flags:
        """Whether each stored section is feasible, that is, not empty, shape (B, S)."""
        feasible = self._state.feasible.view()
        feasible.flags.writeable = False
        return feasible

    @property
    def labels_m(self) -> Floats:
        """Labels of all stored sections, feasible or not, m, shape (B, S)."""
        labels = self._state.labels.view()
        labels.flags.writeable = False
        return labels

    @property
    def ranges_m(self) -> Floats:
        """Ranges of all stored sections now, m, shape (B, S)."""
        return self._state.ranges

    @property
    def section_counts(self) -> NDArray[np.int64]:
        """Number of feasible sections, shape (B,)."""
        return self._state.section_counts

    def stored_range_interval_m(self) -> tuple[Floats, Floats]:
        """Return the minimum and the maximum range of the feasible sections, m.

        They are zero where no section is feasible.
        """
        ranges = self.ranges_m
        feasible = self.feasible
        tracked = feasible.any(axis=1)
        rows = np.arange(len(ranges))
        # The labels increase with the slot; the last feasible slot is counted from the end.
        minimum = ranges[rows, feasible.argmax(axis=1)]
        maximum = ranges[rows, -1 - feasible[:, ::-1].argmax(axis=1)]
        return np.where(tracked, minimum, 0.0), np.where(tracked, maximum, 0.0)

    def min_and_max_alpha(self) -> tuple[Floats, Floats, Floats, Floats]:
        """Return the minimum and the maximum angle of the feasible sections, and their ranges.

        Returns
        -------
        alpha_min, alpha_max, range_of_min, range_of_max : ndarray, shape (C, B)
            rad and m; zeros where no section is feasible.
        """
        minimum, maximum, of_min, of_max = self._state.extreme_angles()
        return minimum, maximum, of_min, of_max

    def predicted_miss(self, pending: Sequence[tuple[float, Floats]] = ()) -> PredictedMiss:
        """Return the predicted-miss interval of each engagement and the states that reach its ends.

        Parameters
        ----------
        pending : sequence of (float, ndarray)
            Later impulses that count as given: time from now, s, and impulse, m/s, shape (C, B).

        References
        ----------
        Kumkov and Patsko (1997), equations (13) and (14).
        """
        exists, ends = self._state.widest(pending)
        aim_m = self._aim_of(exists)
        # An end is the predicted miss, and the state that reaches it.
        lower = ends[..., 0, :]
        upper = ends[..., 1, :]
        return PredictedMiss(
            exists,
            lower[..., 0] + aim_m,
            upper[..., 0] + aim_m,
            ExtremePoints(lower[..., 1], lower[..., 2], lower[..., 3]),
            ExtremePoints(upper[..., 1], upper[..., 2], upper[..., 3]),
        )

    def predicted_miss_by_section_m(self) -> tuple[Floats, Floats]:
        """Return minimum and maximum predicted miss of each section, m, each (C, B, S).

        They are zero for an empty section.
        """
        summaries = self._state.summaries()
        feasible = self.feasible
        aim_m = self.model.lateral_aim_m[:, None, None]
        lower = summaries[..., section_life.LOWER_MISS] + aim_m
        upper = summaries[..., section_life.UPPER_MISS] + aim_m
        return np.where(feasible, lower, 0.0), np.where(feasible, upper, 0.0)

    def _aim_of(self, exists: Flags) -> Floats:
        """Return the aim point where a predicted miss exists, m, shape (C, B), elsewhere zero."""
        return np.where(exists, self.model.lateral_aim_m[:, None], 0.0)

    def sections(self, engagement: int = 0) -> list[Section]:
        """Return the feasible sections of one engagement in order of increasing range."""
        self._need_engagement(engagement)

        state = self._state
        axes = range(len(self.axes))
        labels = state.labels[engagement].tolist()
        ranges = self.ranges_m[engagement].tolist()
        sections = []
        for s in np.flatnonzero(self.feasible[engagement]).tolist():
            outlines = [state.polygon(axis, engagement, s) for axis in axes]
            sections.append(self._section(labels[s], ranges[s], outlines))
        return sections

    def _section(self, label_m: float, range_m: float, outlines: list[Floats]) -> Section:
        """Return a section from the vertices along each axis."""
        polygons = [
            ConvexPolygons.unchecked(vertices, np.array(len(vertices))) for vertices in outlines
        ]
        return Section(
            label_m, range_m, self.model.closing_speed_m_s, ConvexPolygons.stack(polygons)
        )

    def section_at(self, label_m: float, engagement: int = 0) -> Section:
        """Return the section at any label, computed by replaying the history.

        Parameters
        ----------
        label_m : float
            Range at t = 0, m.

        Returns
        -------
        Section
            Its polygons are empty if the data exclude the label.

        Notes
        -----
        About 30 ns per event of the history and axis if no rate was measured.
        """
        NUMBER.need("label_m", label_m)
        self._need_engagement(engagement)

        state = self._state
        label = float(label_m)
        past = past_of(state.history, state.table)
        emptied_at = replay_label(label, engagement, past)
        outlines = [np.empty((0, 2)) for _ in self.axes]
        if emptied_at == section_life.NEVER_EMPTIED:
            rows = [ROWS * axis + LAST_REPLAY for axis in range(len(self.axes))]
            outlines = [state.outline(past.room.chains, row, label) for row in rows]

        x = label - state.law.closing_speed * (state.law.step * state.elapsed)
        return self._section(label, x, outlines)

    def _need_engagement(self, engagement: int) -> None:
        WHOLE.need("engagement", engagement)
        if engagement >= self.batch:
            raise IndexError(
                f"engagement must be less than {self.batch}, the number of engagements: got "
                f"{engagement}"
            )

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {self.batch} at t = {self.time_s:g} s>"
