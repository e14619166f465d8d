"""State of a batch of information sets: stored sections, history, limits of the labels, and status."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from infoset.arrays import Flags, Floats, Integers
from infoset.engine.guaranteed_miss import GuaranteedMiss
from infoset.engine.history import History
from infoset.engine.location import refine_all
from infoset.engine.replays import past_of
from infoset.engine.section_stack import SectionStack
from infoset.model import SetModel


class SetStatus(Enum):
    """Status of an information set."""

    TRACKING = 0
    """The set contains states above the range threshold."""
    EMPTY = 1
    """No state agrees with the data, no section has passed below the threshold, and the set was not recovered."""
    FINISHED = 2
    """All sections have passed below the range threshold."""
    REFUTED = 3
    """The data exclude all states above the threshold; the true state has passed below it."""
    STOPPED = 4
    """The caller stopped the computation."""


@dataclass
class SetState:
    """State of B information sets. A set and its read-only views share one object.

    Parameters
    ----------
    lower_label, upper_label : ndarray, shape (B,)
        Limits of the labels, m.
    status : ndarray of int, shape (B,)
        Values of `SetStatus`.
    some_left : ndarray of bool, shape (B,)
        Whether some label has passed below the range threshold.
    lost_step : ndarray of int, shape (B,)
        Step at which the set first became empty; -1 if it never did.
    lost_label : ndarray, shape (B,)
        Label closest to living at that step, m.
    phi : GuaranteedMiss or None
        The guaranteed miss; None if it is not computed.
    """

    model: SetModel
    stack: SectionStack
    history: History
    lower_label: Floats
    upper_label: Floats
    status: Integers
    some_left: Flags
    lost_step: Integers
    lost_label: Floats
    phi: GuaranteedMiss | None

    def refine(self, wanted: Flags, sections: int) -> None:
        """Replace the sections of the wanted engagements by a grid over their living labels, found by replay."""
        stack, history = self.stack, self.history
        stack.make_room_for_new(wanted, sections)
        limits = self.lower_label, self.upper_label
        past = past_of(history, stack.table, stack.labels.shape[1])
        spare = refine_all(wanted, sections, limits, past, stack.sections)
        stack.note_new(spare)

    def copy(self) -> SetState:
        """Return an independent copy."""
        return SetState(
            self.model,
            self.stack.copy(),
            self.history.copy(),
            self.lower_label.copy(),
            self.upper_label.copy(),
            self.status.copy(),
            self.some_left.copy(),
            self.lost_step.copy(),
            self.lost_label.copy(),
            None if self.phi is None else self.phi.copy(),
        )
