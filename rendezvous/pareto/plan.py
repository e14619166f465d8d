"""One craft's minimum-energy flight to a meeting: control and trajectory at any time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rendezvous._arrays import Floats
from rendezvous.pareto.encounter import Craft
from rendezvous.relative_motion import TimeVaryingMotion


@dataclass(frozen=True)
class PlanSamples:
    """A flight sampled at k times: `state`, shape (k, 6), in m and m/s, and the control u, shape (k, 3)."""

    time_s: Floats
    state: Floats
    control_m_s2: Floats


@dataclass(frozen=True, eq=False)
class Plan:
    """The minimum-energy flight of one craft from its start to the meeting; `costate`, shape (6,), is at the
    meeting.
    """

    craft: Craft
    meeting_s: float
    costate: Floats

    def control(self, time_s: ArrayLike) -> Floats:
        """Return u(t) = B' Phi(T, t)' lambda, m/s^2, shape (..., 3): (2.1) of the paper."""
        times = np.asarray(time_s, dtype=np.float64)
        costate = self._costate_at(times)
        return np.asarray(np.einsum("...ai,...a->...i", self.craft.motion.input_map(times), costate))

    def state(self, time_s: ArrayLike) -> Floats:
        """Return x(t) = Phi x0 + drift + G(t, t0) Phi(T, t)' lambda, m and m/s, shape (..., 6): (2.5) of the paper."""
        times = np.asarray(time_s, dtype=np.float64)
        segment = self.craft.motion.segment(np.full(times.shape, self.craft.start_s), times)
        forced = np.einsum("...ab,...b->...a", segment.gramian, self._costate_at(times))
        return np.asarray(segment.transition @ self.craft.state + segment.drift + forced)

    def sample(self, count: int) -> PlanSamples:
        """Return the flight at `count` >= 2 equally spaced times, both ends included."""
        times = np.linspace(self.craft.start_s, self.meeting_s, count)
        return PlanSamples(times, self.state(times), self.control(times))

    def effects(self, time_s: Floats) -> Floats:
        """Return Phi(T, t) B(t), shape (k, 6, 3), the effect of a unit control for a second on the terminal state."""
        return np.asarray(self._to_meeting(time_s) @ self.craft.motion.input_map(time_s))

    def breaks(self) -> Floats:
        """Return times from start to meeting between which the motion turns by about a radian at most, s."""
        return self.craft.motion.breaks(self.craft.start_s, self.meeting_s)

    def _costate_at(self, times: Floats) -> Floats:
        return np.asarray(np.einsum("...ba,b->...a", self._to_meeting(times), self.costate))

    def _to_meeting(self, times: Floats) -> Floats:
        """Phi(T, t), shape (..., 6, 6)."""
        motion = self.craft.motion
        if not isinstance(motion, TimeVaryingMotion):
            return motion.transition(times, np.full(times.shape, self.meeting_s))
        # From each time to the next one: long intervals of a motion that varies are expensive.
        order = np.argsort(times, axis=None, kind="stable")
        grid = np.append(times.ravel()[order], self.meeting_s)
        steps = motion.transition(grid[:-1], grid[1:])
        matrices, ahead = np.empty((times.size, 6, 6)), np.eye(6)
        for index in range(times.size - 1, -1, -1):
            ahead = ahead @ steps[index]
            matrices[order[index]] = ahead
        return matrices.reshape(*times.shape, 6, 6)
