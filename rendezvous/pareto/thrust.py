"""Peak control and total impulse of a flight."""

from __future__ import annotations

from typing import Protocol

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.piecewise import integral_of_size, max_control


class Flight(Protocol):
    """A flight with a control u, m/s^2, shape (k, 3) at k times, smooth between `breaks`, s."""

    def control(self, time_s: Floats) -> Floats:
        """Return u."""

    def breaks(self) -> Floats:
        """Return times from start to meeting, s."""


def peak_control(flight: Flight) -> float:
    """Return the maximum |u| of a `flight`, m/s^2."""
    return max_control(flight.control, flight.breaks())


def total_impulse(flight: Flight) -> float:
    """Return int |u| dt of a `flight`, m/s, to 1e-9, relative."""
    return integral_of_size(flight.control, flight.breaks())
