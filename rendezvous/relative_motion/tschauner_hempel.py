"""Motion about an elliptic orbit (Tschauner and Hempel) by the closed form of Yamanaka and Ankersen."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.relative_motion.elliptic_orbit import EllipticOrbit
from rendezvous.relative_motion.frames import HILL, Frame
from rendezvous.relative_motion.linear_motion import (
    Segment,
    checked_durations,
    checked_frame,
    even_breaks,
    velocity_input,
)
from rendezvous.relative_motion.time_varying import TimeVaryingMotion

Floats = NDArray[np.float64]

SHORT_RAD = 0.1
_NODES, _WEIGHTS = (each.astype(np.float64) for each in np.polynomial.legendre.leggauss(20))


@dataclass(frozen=True)
class TschaunerHempel:
    """Relative motion about an elliptic orbit.

    Parameters
    ----------
    orbit : EllipticOrbit
    frame : Frame
        Of states and controls; position before velocity.

    Raises
    ------
    ValueError
        If the frame interleaves positions and velocities.

    Notes
    -----
    Yamanaka and Ankersen (2002), which holds from e = 0 on. Its two factors cancel over short times, where the
    equations are collocated instead. Gramians by Gauss and Legendre's rule in the eccentric anomaly.
    """

    orbit: EllipticOrbit
    frame: Frame = HILL

    def __post_init__(self) -> None:
        checked_frame(self.frame)

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A(t), shape (..., 6, 6)."""
        return HILL.matrices_to(self.frame, self.orbit.dynamics(time_s))

    def input_map(self, time_s: ArrayLike) -> Floats:
        """B, shape (..., 6, 3)."""
        return velocity_input(np.shape(time_s))

    def forcing(self, time_s: ArrayLike) -> Floats:
        """Zero, shape (..., 6)."""
        return np.zeros((*np.shape(time_s), 6))

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start.

        Raises
        ------
        ValueError
            If a time is not finite.
        """
        starts, ends = _pairs(start_s, end_s)
        if not (np.isfinite(starts).all() and np.isfinite(ends).all()):
            raise ValueError("a time is not finite")
        short = self._short(starts, ends)
        matrix = np.empty((len(starts), 6, 6))
        if short.any():
            matrix[short] = self._collocated.transition(starts[short], ends[short])
        if not short.all():
            matrix[~short] = _closed(self.orbit, starts[~short], ends[~short])
        return HILL.matrices_to(self.frame, matrix.reshape(*_shape(start_s, end_s), 6, 6))

    def gramian(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Gramian, int Phi(end, t) B B' Phi(end, t)' dt from start to end, shape (..., 6, 6); end >= start."""
        checked_durations(start_s, end_s)
        starts, ends = _pairs(start_s, end_s)
        short = self._short(starts, ends)
        matrix = np.empty((len(starts), 6, 6))
        if short.any():
            matrix[short] = self._collocated.gramian(starts[short], ends[short])
        for row in np.flatnonzero(~short):
            effect, weights = self._effects(starts[row], ends[row])
            matrix[row] = np.einsum("kai,kbi,k->ab", effect, effect, weights)
        return HILL.matrices_to(self.frame, matrix.reshape(*_shape(start_s, end_s), 6, 6))

    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> Segment:
        """Transition, Gramian and drift at once; end >= start."""
        return Segment(self.transition(start_s, end_s), self.gramian(start_s, end_s), self.drift(start_s, end_s))

    def held_input(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Effect at the end of a unit control held from the start, int Phi(end, t) B dt, shape (..., 6, 3)."""
        checked_durations(start_s, end_s)
        starts, ends = _pairs(start_s, end_s)
        short = self._short(starts, ends)
        matrix = np.empty((len(starts), 6, 3))
        if short.any():
            matrix[short] = self._collocated.held_input(starts[short], ends[short])
        for row in np.flatnonzero(~short):
            effect, weights = self._effects(starts[row], ends[row])
            matrix[row] = np.einsum("kai,k->ai", effect, weights)
        conversion, turn = HILL.conversion_to(self.frame), self.frame.rotation @ HILL.rotation.T
        return np.asarray(conversion @ matrix.reshape(*_shape(start_s, end_s), 6, 3) @ turn.T)

    def drift(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Zero, shape (..., 6)."""
        return np.zeros((*_shape(start_s, end_s), 6))

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, both among them, a radian of the eccentric anomaly apart at most.

        Notes
        -----
        The motion has poles at cos E = 1 / e; panels are no longer than the distance to them.
        """
        first, last = (float(each) for each in self.orbit.eccentric_anomaly(np.array([start_s, end_s])))
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

    def _short(self, starts: Floats, ends: Floats) -> NDArray[np.bool_]:
        anomalies = self.orbit.true_anomaly(starts), self.orbit.true_anomaly(ends)
        return np.asarray(np.abs(anomalies[1] - anomalies[0]) < SHORT_RAD)

    def _effects(self, start_s: float, end_s: float) -> tuple[Floats, Floats]:
        """Phi(end, t) B at the nodes, shape (k, 6, 3), and their weights in time, s."""
        first, last = (float(each) for each in self.orbit.eccentric_anomaly(np.array([start_s, end_s])))
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


def _shape(start_s: ArrayLike, end_s: ArrayLike) -> tuple[int, ...]:
    return np.broadcast_shapes(np.shape(start_s), np.shape(end_s))


def _pairs(start_s: ArrayLike, end_s: ArrayLike) -> tuple[Floats, Floats]:
    starts, ends = np.broadcast_arrays(np.asarray(start_s, dtype=np.float64), np.asarray(end_s, dtype=np.float64))
    return starts.ravel(), ends.ravel()


def _closed(orbit: EllipticOrbit, starts: Floats, ends: Floats) -> Floats:
    """Phi(end, start) in axes of Hill, shape (n, 6, 6): their equations (79) to (88)."""
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
    from_state = _scaled_states(rho, np.sin(at_start), e, k2)

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
    # Of (along, -radial, and their rates) in the order of Hill: radial 0, along 1, rates 3 and 4.
    signs, places = np.array([1.0, -1.0, 1.0, -1.0]), np.array([1, 0, 4, 3])
    in_plane[:, places[:, None], places] = (later @ plane) * np.outer(signs, signs)
    turn = at_end - at_start
    in_plane[:, 2, 2] = in_plane[:, 5, 5] = np.cos(turn)
    in_plane[:, 2, 5], in_plane[:, 5, 2] = np.sin(turn), -np.sin(turn)
    return _states_of_scaled(rho, np.sin(at_end), e, k2) @ in_plane @ from_state


def _scaled_states(rho: Floats, sine: Floats, e: float, k2: float) -> Floats:
    """(r, v) to (rho r, -e sin(nu) r + v / (k^2 rho)), shape (n, 6, 6)."""
    matrix = np.zeros((len(rho), 6, 6))
    for axis in range(3):
        matrix[:, axis, axis] = rho
        matrix[:, 3 + axis, axis] = -e * sine
        matrix[:, 3 + axis, 3 + axis] = 1.0 / (k2 * rho)
    return matrix


def _states_of_scaled(rho: Floats, sine: Floats, e: float, k2: float) -> Floats:
    """The inverse of `_scaled_states`."""
    matrix = np.zeros((len(rho), 6, 6))
    for axis in range(3):
        matrix[:, axis, axis] = 1.0 / rho
        matrix[:, 3 + axis, axis] = k2 * e * sine
        matrix[:, 3 + axis, 3 + axis] = k2 * rho
    return matrix
