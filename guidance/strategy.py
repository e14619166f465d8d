"""The contract of a guidance strategy."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from guidance.situation import Situation
from infoset.limits import shown


def checked_impulses(wanted: object, tracking: NDArray[np.bool_], strategy: object, step: int) -> NDArray[np.float64]:
    """Return the impulses of a strategy as an array of shape (B,), if they are real and finite.

    Parameters
    ----------
    tracking : ndarray of bool, shape (B,)
        Engagements that have a set; elsewhere an impulse need not be finite.

    Raises
    ------
    ValueError
        If they are not.
    """
    values = np.asarray(wanted)
    real = values.dtype.kind in "fiu" and not isinstance(wanted, np.ma.MaskedArray)
    if not real or values.shape != tracking.shape or not np.isfinite(values[tracking]).all():
        raise ValueError(
            f"strategy {type(strategy).__name__} must return {len(tracking)} finite impulses (m/s), one an engagement, "
            f"real and not masked: at step {step} it returned shape {values.shape}, {shown(wanted)}"
        )
    return values.astype(np.float64, copy=False)


class Strategy(Protocol):
    """A rule that computes the impulses of a batch of engagements from what is known on board.

    The thruster limits the impulses that a strategy returns. Where an engagement has no set
    (`situation.predicted_miss.exists` is False) they are ignored.
    """

    def start(self, batch: int) -> Any:
        """Return the state of the strategy for `batch` engagements, or None."""

    def decide(self, situation: Situation, state: Any) -> NDArray[np.float64]:
        """Return the impulses of a step along z, m/s, shape (B,).

        The state is the return value of `start`; it may be changed.
        """
