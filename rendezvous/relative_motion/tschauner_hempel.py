"""Motion about an elliptic orbit (Tschauner and Hempel)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rendezvous._arrays import Floats
from rendezvous.relative_motion.elliptic_orbit import EllipticOrbit
from rendezvous.relative_motion.linear_motion import even_breaks
from rendezvous.relative_motion.time_varying import CollocatedMotion


@dataclass(frozen=True)
class TschaunerHempel(CollocatedMotion):
    """Relative motion about an elliptic `orbit`, from e = 0 on, collocated in the eccentric anomaly."""

    orbit: EllipticOrbit

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A(t), shape (..., 6, 6)."""
        return self.orbit.dynamics(time_s)

    def _clock(self, start_s: Floats, end_s: Floats, position: Floats) -> tuple[Floats, Floats]:
        """Return times at equal steps of the eccentric anomaly, see `CollocatedMotion`: t' = (1 - e cos E) / n."""
        first, last = self.orbit.eccentric_anomaly(start_s), self.orbit.eccentric_anomaly(end_s)
        anomaly = last - (last - first) * position
        speed = (last - first) * (1.0 - self.orbit.eccentricity * np.cos(anomaly)) / self.orbit.mean_motion_rad_s
        return self.orbit.time_of_eccentric(anomaly), speed

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, inclusive, a radian of the eccentric anomaly apart at most.

        The motion has poles at cos E = 1 / e; panels are no longer than the distance to them.
        """
        first, last = (float(anomaly) for anomaly in self.orbit.eccentric_anomaly(np.array([start_s, end_s])))
        e = self.orbit.eccentricity
        widest_rad = 1.0 if e < 0.6 else min(1.0, float(np.arccosh(1.0 / e)))
        times = self.orbit.time_of_eccentric(even_breaks(first, last, (last - first) / widest_rad))
        times[0], times[-1] = start_s, end_s
        return np.maximum.accumulate(np.minimum(times, end_s))
