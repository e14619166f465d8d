"""Motion about an elliptic orbit (Tschauner and Hempel)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.relative_motion.elliptic_orbit import EllipticOrbit
from infoset.rendezvous.relative_motion.linear_motion import (
    HeldMotion,
    HeldSegment,
    even_breaks,
    need_panels,
)
from infoset.rendezvous.relative_motion.yamanaka_ankersen import (
    Ellipse,
    fill_integrals,
    fill_transitions,
)

MAX_ECCENTRICITY = 1.0 - 1e-6
"""A time has 16 digits of a revolution, and the motion at perigee takes the share (1 - e)^(3/2) of
it.
"""
LONGEST_PANEL_RAD = 1.0
"""Longest panel of eccentric anomaly where the poles of the motion are farther away."""
NODES, WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(16))
"""Gauss and Legendre's rule of a panel. The nearest pole is at least the panel's length d away from
its middle: the half-axes of the ellipse through it, whose foci are the ends of the panel, have a
sum of (2 + sqrt(5)) d / 2, so that the error decreases as 4.24^(-2 n), which is 9e-21 for 16 nodes.
With 12, 9e-16, the order of the pole is seen."""


class _Intervals(NamedTuple):
    """n intervals: the shape of the arrays of times, starts, E at the starts, what passes of it,
    and durations.
    """

    shape: tuple[int, ...]
    starts_s: Floats
    starts_rad: Floats
    passed_rad: Floats
    durations_s: Floats


@dataclass(frozen=True)
class TschaunerHempel(HeldMotion):
    """Relative motion about an elliptic `orbit`, from e = 0 on.

    Transitions are those of Yamanaka and Ankersen (2002), in closed form: about 1 microsecond each.
    The Gramian and the effect of a held control are integrals of Phi(end, t) B by Gauss and
    Legendre's rule of 16 nodes, on panels of eccentric anomaly that are at most a radian long, and
    not longer than the distance from the poles of the motion at cos E = 1 / e: about 4 microseconds
    a panel.

    Raises
    ------
    ValueError
        If the eccentricity is above 0.999999.
    """

    orbit: EllipticOrbit

    def __post_init__(self) -> None:
        if self.orbit.eccentricity > MAX_ECCENTRICITY:
            raise ValueError(
                f"the eccentricity must be at most {MAX_ECCENTRICITY:g}, found "
                f"{self.orbit.eccentricity!r}: the motion at perigee is too short a part of a "
                "revolution for the digits of a time"
            )

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A(t), shape (..., 6, 6)."""
        return self.orbit.dynamics(time_s)

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start."""
        return self._transitions(self._intervals(start_s, end_s))

    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> HeldSegment:
        """Transition, Gramian and the effect of a held control together; end >= start.

        Raises
        ------
        ValueError
            If an interval has more than 200 000 panels.
        """
        intervals = self._intervals(start_s, end_s)
        count = len(intervals.durations_s)
        if count:
            longest = int(np.argmax(intervals.passed_rad))
            start = float(intervals.starts_s[longest])
            end = start + float(intervals.durations_s[longest])
            need_panels(start, end, float(intervals.passed_rad[longest]) / self._panel_rad)

        gramians = np.zeros((count, 6, 6))
        helds = np.zeros((count, 6, 3))
        fill_integrals(
            self._ellipse, *intervals[2:], self._panel_rad, NODES, WEIGHTS, gramians, helds
        )
        return HeldSegment(
            self._transitions(intervals),
            gramians.reshape(*intervals.shape, 6, 6),
            helds.reshape(*intervals.shape, 6, 3),
        )

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, inclusive, a radian of the eccentric anomaly apart at most.

        The motion has poles at cos E = 1 / e; panels are no longer than the distance to them.
        """
        first, last = (
            float(anomaly) for anomaly in self.orbit.eccentric_anomaly(np.array([start_s, end_s]))
        )
        times = self.orbit.time_of_eccentric(
            even_breaks(first, last, (last - first) / self._panel_rad)
        )
        times[0] = start_s
        times[-1] = end_s
        return np.maximum.accumulate(np.minimum(times, end_s))

    def _intervals(self, start_s: ArrayLike, end_s: ArrayLike) -> _Intervals:
        starts, ends = np.broadcast_arrays(
            np.asarray(start_s, dtype=np.float64), np.asarray(end_s, dtype=np.float64)
        )
        starts_rad = self.orbit.eccentric_anomaly(starts.ravel())
        ends_rad = self.orbit.eccentric_anomaly(ends.ravel())
        return _Intervals(
            starts.shape, starts.ravel(), starts_rad, ends_rad - starts_rad, (ends - starts).ravel()
        )

    def _transitions(self, intervals: _Intervals) -> Floats:
        matrices = np.zeros((len(intervals.durations_s), 6, 6))
        fill_transitions(self._ellipse, *intervals[2:], matrices)
        return matrices.reshape(*intervals.shape, 6, 6)

    @property
    def _ellipse(self) -> Ellipse:
        n = self.orbit.mean_motion_rad_s
        e = self.orbit.eccentricity
        # 1 - e^2 would lose the digits that 1 - e has.
        root = math.sqrt((1.0 - e) * (1.0 + e))
        return Ellipse(n, e, root, n / root**3)

    @property
    def _panel_rad(self) -> float:
        e = self.orbit.eccentricity
        return LONGEST_PANEL_RAD if e < 0.6 else min(LONGEST_PANEL_RAD, math.acosh(1.0 / e))
