"""The contract of a guidance strategy."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from guidance.situation import Situation


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
