"""The history of a batch of engagements: what was measured and done, in order."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from infoset.section_life import IMPULSE, NO_WINDOW, PREDICTION, RATE, Flags, Floats, Integers, Tape

ROOM_AT_START = 64


class Tapes(NamedTuple):
    """The histories of a batch, as kernels take them: the fields of `Tape`, values and applies of shape (events, B)."""

    kinds: Integers
    values: Floats
    applies: Flags
    events: int


class History:
    """A tape of events shared by a batch: the kinds are common, the values one an engagement.

    Parameters
    ----------
    batch : int
        Number of engagements B.

    Attributes
    ----------
    kinds : ndarray of int, shape (>= events,)
        Kind of each event: an angle, an impulse, a prediction, a rate or a widening.
    errors : ndarray, shape (>= events,)
        Error bound of each measured rate, rad/s; zero for the other kinds.
    values : ndarray, shape (>= events, B)
        Measured angle (rad), impulse (m/s) or measured rate (rad/s); nothing for the other kinds.
    applies : ndarray of bool, shape (>= events, B)
        Whether the event concerned the engagement; a prediction concerns all.
    events : int
        Number of events.
    elapsed : int
        Number of predictions among them.
    """

    def __init__(self, batch: int) -> None:
        self.kinds = np.zeros(ROOM_AT_START, dtype=np.int64)
        self.errors = np.zeros(ROOM_AT_START)
        self.values = np.zeros((ROOM_AT_START, batch))
        self.applies = np.zeros((ROOM_AT_START, batch), dtype=bool)
        self.events = 0
        self.elapsed = 0
        self._has_rates = False

    def record(self, kind: int, values: Floats | None = None, applies: Flags | bool = True, error: float = 0.0) -> int:
        """Add an event; return its number."""
        event = self.events
        if event == self.kinds.size:
            self.kinds = np.concatenate((self.kinds, np.zeros_like(self.kinds)))
            self.errors = np.concatenate((self.errors, np.zeros_like(self.errors)))
            self.values = np.concatenate((self.values, np.zeros_like(self.values)))
            self.applies = np.concatenate((self.applies, np.zeros_like(self.applies)))
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
        """Let an event not have concerned some engagements."""
        self.applies[event, where] = False

    def total_impulse(self) -> Floats:
        """Sum of the moduli of all impulses of each engagement, m/s, shape (B,)."""
        fired = self.applies[: self.events] & (self.kinds[: self.events] == IMPULSE)[:, None]
        return np.asarray(np.where(fired, np.abs(self.values[: self.events]), 0.0).sum(axis=0))

    @property
    def tapes(self) -> Tapes:
        """The histories of the whole batch."""
        return Tapes(self.kinds, self.values, self.applies, self.events)

    def tape(self, engagement: int) -> Tape:
        """The history of one engagement."""
        values, applies = self.values[:, engagement].copy(), self.applies[:, engagement].copy()
        return Tape(self.kinds, values, applies, self.events, *NO_WINDOW)

    @property
    def errors_if_any(self) -> Floats | None:
        """The errors, or None if no rate was measured, as replays take them."""
        return self.errors if self._has_rates else None

    def copy(self) -> History:
        """A history of its own that starts from this one."""
        twin = History.__new__(History)
        twin.kinds, twin.errors = self.kinds.copy(), self.errors.copy()
        twin.values, twin.applies = self.values.copy(), self.applies.copy()
        twin.events, twin.elapsed, twin._has_rates = self.events, self.elapsed, self._has_rates
        return twin
