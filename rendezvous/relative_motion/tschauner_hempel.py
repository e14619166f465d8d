"""Motion about an elliptic orbit (Tschauner and Hempel) by the closed form of Yamanaka and Ankersen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from rendezvous._arrays import Flags, Floats
from rendezvous.relative_motion.elliptic_orbit import EllipticOrbit
from rendezvous.relative_motion.linear_motion import LinearMotion, checked_durations, even_breaks
from rendezvous.relative_motion.time_varying import TimeVaryingMotion

_OfIntervals = Callable[[Floats, Floats], Floats]

SHORT_RAD = 0.1
_NODES, _WEIGHTS = (rule.astype(np.float64) for rule in np.polynomial.legendre.leggauss(20))


@dataclass(frozen=True)
class TschaunerHempel(LinearMotion):
    """Relative motion about an elliptic `orbit`.

    Yamanaka and Ankersen (2002), which holds from e = 0 on. Its two factors cancel over short times, where the
    equations are collocated instead. Gramians by Gauss and Legendre's rule in the eccentric anomaly.
    """

    orbit: EllipticOrbit

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A(t), shape (..., 6, 6)."""
        return self.orbit.dynamics(time_s)

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start."""
        return self._by_length(
            start_s, end_s, self._collocated.transition, lambda starts, ends: _closed(self.orbit, starts, ends)
        )

    def gramian(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Gramian, shape (..., 6, 6); end >= start."""
        checked_durations(start_s, end_s)
        return self._by_length(start_s, end_s, self._collocated.gramian, self._integrals("kai,kbi,k->ab", 2))

    def held_input(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Effect at the end of a unit control held from the start, shape (..., 6, 3)."""
        checked_durations(start_s, end_s)
        return self._by_length(start_s, end_s, self._collocated.held_input, self._integrals("kai,k->ai", 1))

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, inclusive, a radian of the eccentric anomaly apart at most.

        The motion has poles at cos E = 1 / e; panels are no longer than the distance to them.
        """
        first, last = (float(anomaly) for anomaly in self.orbit.eccentric_anomaly(np.array([start_s, end_s])))
        times = self.orbit.time_of_eccentric(even_breaks(first, last, (last - first) / self._widest_rad))
        times[0], times[-1] = start_s, end_s
        return np.maximum.accumulate(np.minimum(times, end_s))

    @property
    def _widest_rad(self) -> float:
        e = self.orbit.eccentricity
        return 1.0 if e < 0.6 else min(1.0, float(np.arccosh(1.0 / e)))

    @property
    def _collocated(self) -> TimeVaryingMotion:
        return TimeVaryingMotion(self.orbit.dynamics)

    def _short(self, starts: Floats, ends: Floats) -> Flags:
        anomalies = self.orbit.true_anomaly(starts), self.orbit.true_anomaly(ends)
        return np.asarray(np.abs(anomalies[1] - anomalies[0]) < SHORT_RAD)

    def _by_length(self, start_s: ArrayLike, end_s: ArrayLike, of_short: _OfIntervals, of_long: _OfIntervals) -> Floats:
        """Matrices of intervals: those of short and of long intervals by two methods."""
        starts, ends = np.broadcast_arrays(np.asarray(start_s, dtype=np.float64), np.asarray(end_s, dtype=np.float64))
        shape, starts, ends = starts.shape, starts.ravel(), ends.ravel()
        short = self._short(starts, ends)
        if short.all():
            matrices = of_short(starts, ends)
        else:
            long = of_long(starts[~short], ends[~short])
            matrices = np.empty((len(starts), *long.shape[1:]))
            matrices[~short] = long
            if short.any():
                matrices[short] = of_short(starts[short], ends[short])
        return matrices.reshape(*shape, *matrices.shape[1:])

    def _integrals(self, product: str, power: int) -> _OfIntervals:
        """Integrals over intervals of a product of Phi(end, t) B, given as subscripts of `einsum`."""

        def integrals(starts: Floats, ends: Floats) -> Floats:
            nodes = (self._effects(start, end) for start, end in zip(starts, ends, strict=True))
            return np.array([np.einsum(product, *[effect] * power, weights) for effect, weights in nodes])

        return integrals

    def _effects(self, start_s: float, end_s: float) -> tuple[Floats, Floats]:
        """Phi(end, t) B at the nodes, shape (k, 6, 3), and their weights in time, s."""
        first, last = (float(anomaly) for anomaly in self.orbit.eccentric_anomaly(np.array([start_s, end_s])))
        e = self.orbit.eccentricity
        panels = max(1, int(np.ceil((last - first) / self._widest_rad)))
        half = 0.5 * (last - first) / panels
        middles = first + half * (2.0 * np.arange(panels) + 1.0)
        anomalies = (middles[:, None] + half * _NODES).ravel()
        weights = np.tile(half * _WEIGHTS, panels) * (1.0 - e * np.cos(anomalies)) / self.orbit.mean_motion_rad_s
        times = self.orbit.time_of_eccentric(anomalies)
        near = self._short(times, np.full_like(times, end_s))
        effect = np.empty((len(times), 6, 3))
        effect[~near] = _closed(self.orbit, times[~near], np.full(int((~near).sum()), end_s))[..., 3:]
        if near.any():
            effect[near] = self._collocated.transition(times[near], end_s)[..., 3:]
        return effect, weights


def _closed(orbit: EllipticOrbit, starts: Floats, ends: Floats) -> Floats:
    """Phi(end, start), shape (n, 6, 6): their equations (79) to (88)."""
    e, k2 = orbit.eccentricity, orbit.semi_latus_rate_rad_s
    at_start, at_end = orbit.true_anomaly(starts), orbit.true_anomaly(ends)
    in_plane = np.zeros((len(starts), 6, 6))
    rho = 1.0 + e * np.cos(at_start)
    s, c = rho * np.sin(at_start), rho * np.cos(at_start)
    # Constants of the motion from (along, -radial) and their scaled rates.
    plane = np.zeros((len(starts), 4, 4))
    plane[:, 0, 0] = 1.0 - e * e
    plane[:, 0, 1] = 3.0 * e * (s / rho) * (1.0 + 1.0 / rho)
    plane[:, 0, 2], plane[:, 0, 3] = -e * s * (1.0 + 1.0 / rho), -e * c + 2.0
    plane[:, 1, 1], plane[:, 1, 2] = -3.0 * (s / rho) * (1.0 + e * e / rho), s * (1.0 + 1.0 / rho)
    plane[:, 1, 3] = c - 2.0 * e
    plane[:, 2, 1], plane[:, 2, 2] = -3.0 * (c / rho + e), c * (1.0 + 1.0 / rho) + e
    plane[:, 2, 3] = -s
    plane[:, 3, 1], plane[:, 3, 2], plane[:, 3, 3] = 3.0 * rho + e * e - 1.0, -(rho**2), e * s
    plane /= 1.0 - e * e
    from_state = _scaling(rho, -e * np.sin(at_start), 1.0 / (k2 * rho))

    rho = 1.0 + e * np.cos(at_end)
    s, c = rho * np.sin(at_end), rho * np.cos(at_end)
    s_slope, c_slope = np.cos(at_end) + e * np.cos(2.0 * at_end), -(np.sin(at_end) + e * np.sin(2.0 * at_end))
    passed = k2 * (ends - starts)
    later = np.zeros((len(starts), 4, 4))
    later[:, 0, 0] = 1.0
    later[:, 0, 1], later[:, 0, 2] = -c * (1.0 + 1.0 / rho), s * (1.0 + 1.0 / rho)
    later[:, 0, 3] = 3.0 * rho**2 * passed
    later[:, 1, 1], later[:, 1, 2], later[:, 1, 3] = s, c, 2.0 - 3.0 * e * s * passed
    later[:, 2, 1], later[:, 2, 2], later[:, 2, 3] = 2.0 * s, 2.0 * c - e, 3.0 * (1.0 - 2.0 * e * s * passed)
    later[:, 3, 1], later[:, 3, 2] = s_slope, c_slope
    later[:, 3, 3] = -3.0 * e * (s_slope * passed + s / rho**2)
    # From the order (along, -radial, and their rates) to that of Hill: radial 0, along 1, rates 3 and 4.
    signs, order = np.array([1.0, -1.0, 1.0, -1.0]), np.array([1, 0, 4, 3])
    in_plane[:, order[:, None], order] = (later @ plane) * np.outer(signs, signs)
    turn = at_end - at_start
    in_plane[:, 2, 2] = in_plane[:, 5, 5] = np.cos(turn)
    in_plane[:, 2, 5], in_plane[:, 5, 2] = np.sin(turn), -np.sin(turn)
    return _scaling(1.0 / rho, k2 * e * np.sin(at_end), k2 * rho) @ in_plane @ from_state


def _scaling(position: Floats, mixed: Floats, velocity: Floats) -> Floats:
    """The map from (r, v) to (position r, mixed r + velocity v), shape (n, 6, 6)."""
    matrix = np.zeros((len(position), 6, 6))
    for axis in range(3):
        matrix[:, axis, axis], matrix[:, 3 + axis, axis], matrix[:, 3 + axis, 3 + axis] = position, mixed, velocity
    return matrix
