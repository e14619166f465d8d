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
"""Maximum eccentricity: the motion at perigee takes the share (1 - e)^(3/2) = 1e-9 of a revolution,
and a time has 16 digits of a revolution.
"""
LONGEST_PANEL_RAD = 1.0
"""Maximum panel of eccentric anomaly if the poles of the motion are farther away: a panel of a
radian contains no more than a sixth of a period of the sines and cosines in the integrand.
"""


class _Intervals(NamedTuple):
    """n intervals between two times, from arrays of times of a `shape`.

    `starts_rad` are the eccentric anomalies E at the starts, and `passed_rad` the changes of E.
    """

    shape: tuple[int, ...]
    starts_s: Floats
    starts_rad: Floats
    passed_rad: Floats
    durations_s: Floats


@dataclass(frozen=True)
class TschaunerHempel(HeldMotion):
    """Relative motion about an elliptic `orbit`, from e = 0 on.

    Transitions have the closed form of Yamanaka and Ankersen (2002): about 1 microsecond each.
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
            self._ellipse,
            intervals.starts_rad,
            intervals.passed_rad,
            intervals.durations_s,
            self._panel_rad,
            gramians,
            helds,
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

        panels = (last - first) / self._panel_rad
        need_panels(start_s, end_s, panels)
        times = self.orbit.time_of_eccentric(even_breaks(first, last, panels))
        # Kepler's equation rounds the ends, and may move neighbours beyond them.
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
        fill_transitions(
            self._ellipse,
            intervals.starts_rad,
            intervals.passed_rad,
            intervals.durations_s,
            matrices,
        )
        return matrices.reshape(*intervals.shape, 6, 6)

    @property
    def _ellipse(self) -> Ellipse:
        n = self.orbit.mean_motion_rad_s
        e = self.orbit.eccentricity
        # Computed as 1 - e^2 it would lose digits near e = 1.
        root = math.sqrt((1.0 - e) * (1.0 + e))
        return Ellipse(n, e, root, n / root**3)

    @property
    def _panel_rad(self) -> float:
        e = self.orbit.eccentricity
        if e == 0.0:  # no poles
            return LONGEST_PANEL_RAD
        return min(LONGEST_PANEL_RAD, math.acosh(1.0 / e))
