"""What every linear relative motion can tell: A(t), the transition matrix, the Gramian, what a held control does."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rendezvous.relative_motion.frames import Frame, StateOrder

Floats = NDArray[np.float64]

MOST_PANELS = 200_000


@dataclass(frozen=True)
class Segment:
    """What happens between two times: x(end) = transition x(start) + drift + what the control does.

    Parameters
    ----------
    transition, gramian : ndarray, shape (..., 6, 6)
        Of states in m and m/s.
    drift : ndarray, shape (..., 6)
        m and m/s.
    """

    transition: Floats
    gramian: Floats
    drift: Floats


class LinearMotion(Protocol):
    """x' = A(t) x + B(t) u + w(t), x = (position, velocity).

    Times are scalars or arrays, in seconds, broadcast against each other; the results have their shape in front.
    """

    @property
    def frame(self) -> Frame:
        """The frame that states and controls are in."""

    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A(t), shape (..., 6, 6)."""

    def input_map(self, time_s: ArrayLike) -> Floats:
        """B(t), shape (..., 6, 3)."""

    def forcing(self, time_s: ArrayLike) -> Floats:
        """w(t), shape (..., 6)."""

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start."""

    def gramian(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Gramian, int Phi(end, t) B B' Phi(end, t)' dt from start to end, shape (..., 6, 6); end >= start."""

    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> Segment:
        """Transition, Gramian and drift at once; end >= start."""

    def held_input(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Effect at the end of a unit control held from the start, int Phi(end, t) B dt, shape (..., 6, 3)."""

    def drift(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Where the drift alone leads from the origin, int Phi(end, t) w dt, shape (..., 6)."""

    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, both among them, between which the motion turns by about a radian at most."""


def checked_durations(start_s: ArrayLike, end_s: ArrayLike) -> Floats:
    """Return end - start.

    Parameters
    ----------
    start_s, end_s : array_like
        Times, s.

    Returns
    -------
    ndarray
        Durations, s, none negative.

    Raises
    ------
    ValueError
        If a time is not finite, or an end is before its start.
    """
    durations = np.asarray(end_s, dtype=np.float64) - np.asarray(start_s, dtype=np.float64)
    if not np.isfinite(durations).all():
        raise ValueError("a time is not finite")
    if (durations < 0.0).any():
        raise ValueError(f"the end is {-durations.min():g} s before the start; a Gramian needs start <= end")
    return durations


def checked_rate(rate_rad_s: float) -> None:
    """Refuse an orbit rate that is not positive and finite.

    Parameters
    ----------
    rate_rad_s : float

    Raises
    ------
    ValueError
        If it is not positive and finite.
    """
    if not (np.isfinite(rate_rad_s) and rate_rad_s > 0.0):
        raise ValueError(f"the orbit rate must be positive and finite, found {rate_rad_s!r} rad/s")


def checked_frame(frame: Frame) -> None:
    """Refuse a frame whose states have no position before velocity.

    Parameters
    ----------
    frame : Frame

    Raises
    ------
    ValueError
        If the frame interleaves positions and velocities.
    """
    if frame.order is not StateOrder.POSITION_THEN_VELOCITY:
        raise ValueError(f"frame {frame.name}: motions have position before velocity; convert their results")


def even_breaks(start_s: float, end_s: float, radians: float) -> Floats:
    """Return times that divide an interval into panels of equal length, of at most one radian each.

    Parameters
    ----------
    start_s, end_s : float
    radians : float
        The angle by which the motion turns from start to end, rad.

    Returns
    -------
    ndarray, shape (P + 1,)
        s.

    Raises
    ------
    ValueError
        If there are more than 200 000 panels.
    """
    if not radians <= MOST_PANELS:
        raise ValueError(
            f"the motion turns by {radians:.3g} rad from {start_s:g} s to {end_s:g} s; at most {MOST_PANELS} rad can "
            "be divided into panels; check the units"
        )
    return np.linspace(start_s, end_s, max(1, int(np.ceil(radians))) + 1)


def velocity_input(shape: tuple[int, ...]) -> Floats:
    """Return B = (0, 1)', the acceleration that acts on the velocity.

    Parameters
    ----------
    shape : tuple of int
        What stands in front.

    Returns
    -------
    ndarray, shape (*shape, 6, 3)
    """
    found = np.zeros((*shape, 6, 3))
    found[..., 3, 0] = found[..., 4, 1] = found[..., 5, 2] = 1.0
    return found
