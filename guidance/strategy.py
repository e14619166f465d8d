"""The contract of a guidance strategy."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from guidance.situation import Situation
from infoset.limits import shown


def checked_impulses(wanted: object, tracking: NDArray[np.bool_], strategy: object, step: int) -> NDArray[np.float64]:
    """Return the impulses that a strategy wants, if they are real numbers, one an engagement, and finite.

    Parameters
    ----------
    wanted : object
        What it returned.
    tracking : ndarray of bool, shape (B,)
        Engagements that have a set; elsewhere an impulse need not be finite.
    strategy : object
        The strategy, for the message.
    step : int

    Returns
    -------
    ndarray, shape (B,)
        m/s.

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
    """A rule that turns what is known into impulses, for a whole batch at once.

    A strategy says what it wants; the thruster gives what it can. Where an engagement has no set left
    (`situation.predicted_miss.exists` is False) what is wanted is ignored.
    """

    def start(self, batch: int) -> Any:
        """State of the strategy's own for a `batch` of so many engagements; None if it needs none."""

    def decide(self, situation: Situation, state: Any) -> NDArray[np.float64]:
        """Decide on the impulses of a step.

        Parameters
        ----------
        situation : Situation
            What is known on board.
        state : object
            What `start` returned; it may be changed.

        Returns
        -------
        ndarray, shape (B,)
            Wanted impulses along z, m/s.
        """
