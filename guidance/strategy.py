"""The contract of a guidance strategy."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.guidance.situation import Situation
from infoset.limits import shown


def checked_impulses(
    wanted: object, situation: Situation, tracking: Flags, strategy: object
) -> Floats:
    """Return the impulses of a strategy as an array; raise ValueError unless real and finite.

    The impulses of engagements that are not `tracking`, shape (B,), need not be finite.
    """
    values = np.asarray(wanted)
    shape = situation.last_impulse_m_s.shape
    # Numbers that are not bool, complex, text or objects.
    is_real = values.dtype.kind in "fiu" and not isinstance(wanted, np.ma.MaskedArray)
    if is_real and values.shape == shape:
        finite = np.isfinite(values)
        if finite.all() or (finite | ~tracking).all():
            return values.astype(np.float64, copy=False)
    raise ValueError(
        f"strategy {type(strategy).__name__} must return finite impulses (m/s) of the shape "
        f"{shape}, one for each lateral axis and engagement, real and not masked: at step "
        f"{situation.step} it returned shape {values.shape}, {shown(wanted)}"
    )


class Strategy(Protocol):
    """A rule that computes the impulses of a batch of engagements from what is known on board.

    The thruster limits the impulses that a strategy returns. Where an engagement has no set
    (`situation.predicted_miss.exists` is False) they are ignored.

    Arrays have the shape (C, B): C lateral axes, z in a plane, y and z in space, and B engagements.
    """

    def start(self, shape: tuple[int, int]) -> Any:
        """Return the state of the strategy for impulses of a shape (C, B), or None."""

    def decide(self, situation: Situation, state: Any) -> Floats:
        """Return the impulses of a step along the lateral axes, m/s, shape (C, B).

        An impulse is subtracted from the lateral velocity: a positive one decreases the (signed)
        miss.
        The state is the return value of `start`; it may be changed.
        """
