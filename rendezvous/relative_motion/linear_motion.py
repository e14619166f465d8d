"""The base of linear relative motions: A(t), transition matrix, Gramian."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from infoset.rendezvous._arrays import Floats

MAX_PANELS = 200_000
"""Maximum number of panels of an interval, 30 000 revolutions: more are probably wrong units."""


@dataclass(frozen=True)
class Segment:
    """Motion between two times: x(end) = transition x(start) + the effect of the control.

    `transition` and `gramian` have shape (..., 6, 6), for states in m and m/s.
    """

    transition: Floats
    gramian: Floats


@dataclass(frozen=True)
class HeldSegment(Segment):
    """Motion between two times with the effect of a constant control.

    `held`, shape (..., 6, 3), is the effect at the end of a unit control.
    """

    held: Floats


class LinearMotion(ABC):
    """x' = A(t) x + B u, x = (position, velocity), with B = (0, 1)'.

    Times are scalars or arrays, in seconds, broadcast against each other; the results have their
    shape in front.
    """

    stationary: ClassVar[bool] = False
    """Whether a motion between two times depends on their difference only."""

    @abstractmethod
    def dynamics(self, time_s: ArrayLike) -> Floats:
        """A(t), shape (..., 6, 6)."""

    @abstractmethod
    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> Segment:
        """Transition and Gramian together; end >= start."""

    @abstractmethod
    def breaks(self, start_s: float, end_s: float) -> Floats:
        """Times from start to end, inclusive; between two the motion turns by about a radian."""

    def transition(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Phi(end, start), shape (..., 6, 6); the end may be before the start."""
        return self.segment(start_s, end_s).transition

    def gramian(self, start_s: ArrayLike, end_s: ArrayLike) -> Floats:
        """Gramian int Phi(end, t) B B' Phi(end, t)' dt, shape (..., 6, 6); end >= start."""
        return self.segment(start_s, end_s).gramian


class HeldMotion(LinearMotion):
    """A linear motion that also has the effect of a control that is constant between two times."""

    @abstractmethod
    def segment(self, start_s: ArrayLike, end_s: ArrayLike) -> HeldSegment:
        """Transition, Gramian and the effect of a held control together; end >= start."""


def state_scales(durations: Floats) -> Floats:
    """Return the scale (T, T, T, 1, 1, 1) of states, shape (..., 6), for durations T in s.

    T is 1 s for an empty interval.
    """
    scale = np.ones((*durations.shape, 6))
    scale[..., :3] = np.where(durations == 0.0, 1.0, np.abs(durations))[..., None]
    return scale


def even_breaks(start_s: float, end_s: float, radians: float) -> Floats:
    """Return the ends, s, of equal panels of at most one radian.

    The motion turns by `radians` >= 0 in all. Raise `ValueError` if there are more than 200 000
    panels.
    """
    need_panels(start_s, end_s, radians)
    return np.linspace(start_s, end_s, max(1, int(np.ceil(radians))) + 1)


def need_panels(start_s: float, end_s: float, panels: float) -> None:
    """Raise `ValueError` if a motion has more than 200 000 panels between two times."""
    if not panels <= MAX_PANELS:
        raise ValueError(
            f"the motion from {start_s:g} s to {end_s:g} s has {panels:.3g} panels of at most a "
            f"radian; at most {MAX_PANELS} are possible; check the units"
        )
