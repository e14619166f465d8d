"""History of a batch of engagements: measurements, impulses and predictions in order."""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats, Integers

ANGLE, IMPULSE, PREDICTION, RATE, WIDENING = range(5)
"""Kinds of events."""
ROOM_AT_START = 64
"""Initial room of a history, in events; it is doubled when it is full. Chosen: it changes only how
often the arrays are copied."""


class EventLog(NamedTuple):
    """Events of a batch of B engagements in order, as kernels take them: the arrays and counts of
    `History`.

    Parameters
    ----------
    kinds : ndarray of int, shape (>= number,)
        Kind of each event.
    values : ndarray, shape (>= number, C, B)
        Angle, rad, impulse, m/s, or rate, rad/s, along each lateral axis.
    applies : ndarray of bool, shape (>= number, B)
        Whether the event applies to the engagement.
    number, elapsed : int
        Number of events, and of the predictions among them.
    """

    kinds: Integers
    values: Floats
    applies: Flags
    number: int
    elapsed: int


class LastSight(NamedTuple):
    """The last angle measurement of a history, and the impulses so far.

    Parameters
    ----------
    known : bool
        Whether an angle was measured. If not, the initial box bounds the angle.
    alpha, across : float
        The measured angles of this axis and of the other one, rad.
    steps : int
        Steps since the measurement.
    fired : float
        Sum over all impulses of the size along the axis and of the error by the direction of the
        engine, m/s.
    """

    known: bool
    alpha: float
    across: float
    steps: int
    fired: float


NO_SIGHT = LastSight(False, 0.0, 0.0, 0, 0.0)


class History:
    """Events of a batch of B engagements. All engagements have the same kinds of events, each with
    values of its own.

    Attributes
    ----------
    kinds, values, applies, events, elapsed : ndarray or int
        The fields of `EventLog`; a prediction applies to all engagements.
    errors : ndarray, shape (>= events,)
        Error bound of each measured rate, rad/s; zero for the other kinds.
    sights : ndarray, shape (C, B, columns)
        Fields of the last sight of each axis and engagement after the first `seen` events, for
        measured rates.
    seen : int
        Number of events up to the latest measured rate, including it. The sight after them is
        final: `retract` removes only the latest measurement, and a rate is no sight.
    """

    def __init__(self, channels: int, batch: int) -> None:
        self.kinds = np.zeros(ROOM_AT_START, dtype=np.int64)
        self.errors = np.zeros(ROOM_AT_START)
        self.values = np.zeros((ROOM_AT_START, channels, batch))
        self.applies = np.zeros((ROOM_AT_START, batch), dtype=bool)
        self.events = 0
        self.elapsed = 0
        self.sights = np.zeros((channels, batch, len(NO_SIGHT)))
        self.seen = 0
        self._has_rates = False
        self._fired = np.zeros(batch)
        self._summed = 0

    def record(
        self,
        kind: int,
        values: Floats | None = None,
        applies: Flags | bool = True,
        error: float = 0.0,
    ) -> int:
        """Append an event, with values of shape (C, B), and return its number."""
        event = self.events
        if event == self.kinds.size:
            self.kinds = _doubled(self.kinds)
            self.errors = _doubled(self.errors)
            self.values = _doubled(self.values)
            self.applies = _doubled(self.applies)

        self.kinds[event] = kind
        self.errors[event] = error
        self._has_rates |= kind == RATE
        if values is not None:
            self.values[event] = values
        self.applies[event] = applies
        self.events += 1
        self.elapsed += kind == PREDICTION
        return event

    def retract(self, event: int, where: Flags) -> None:
        """Remove an event from the history of some engagements."""
        self.applies[event, where] = False

    def replace(self, row: int, source: int, applies: Flags) -> None:
        """Give engagement `row` the events of engagement `source`, but `applies`, shape (events,),
        says which ones apply. Only for histories without rates.
        """
        # `total_impulse` sums each event once: before the values of the row change.
        self.total_impulse()
        self._fired[row] = self._fired[source]
        self.values[: self.events, :, row] = self.values[: self.events, :, source]
        self.applies[: self.events, row] = applies

    def ends_with(self, kind: int) -> bool:
        """Whether the latest event is of a kind."""
        return self.events > 0 and bool(self.kinds[self.events - 1] == kind)

    def shifted_in_step(self) -> Flags:
        """Return which engagements have had an impulse since the last prediction, shape (B,)."""
        shifted = np.zeros(self.applies.shape[1], dtype=bool)
        for event in range(self.events - 1, -1, -1):
            if self.kinds[event] == PREDICTION:
                break
            if self.kinds[event] == IMPULSE:
                shifted |= self.applies[event]
        return shifted

    def total_impulse(self) -> Floats:
        """Return the sum of the impulses' magnitudes in each engagement, m/s, shape (B,)."""
        new = self._summed + np.flatnonzero(self.kinds[self._summed : self.events] == IMPULSE)
        for event in new:
            # With one axis `reduce` returns the value itself, with its sign.
            modulus = np.abs(np.hypot.reduce(self.values[event]))
            self._fired = self._fired + np.where(self.applies[event], modulus, 0.0)
        self._summed = self.events
        return self._fired

    @property
    def log(self) -> EventLog:
        """The events for kernels."""
        return EventLog(self.kinds, self.values, self.applies, self.events, self.elapsed)

    @property
    def errors_if_any(self) -> Floats | None:
        """Error bounds for `replay`: None if no rate was measured."""
        return self.errors if self._has_rates else None

    def copy(self) -> History:
        """Return an independent copy."""
        twin = copy.copy(self)
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                setattr(twin, name, value.copy())
        return twin


def _doubled(array: NDArray[Any]) -> NDArray[Any]:
    """Return a copy of an array with twice as many rows; the new ones are zero."""
    return np.concatenate((array, np.zeros_like(array)))
