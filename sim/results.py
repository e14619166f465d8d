"""What came of a batch of engagements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Outcome(Enum):
    """How an engagement ended."""

    INTERCEPTED = "intercepted"
    """Flown to the closest approach with a set, or with none needed any more."""
    SET_LOST = "set-lost"
    """The set emptied while no hypothesis had left it: measurements and model disagree; no impulse after that."""
    BUDGET_SPENT = "budget-spent"
    """Less than the least impulse was left while the strategy wanted more."""
    DIVERGED = "diverged"
    """The closest approach was farther than the nominal range."""


@dataclass(frozen=True)
class Results:
    """Results of a batch of B engagements.

    Parameters
    ----------
    runs : ndarray of int, shape (B,)
        Numbers of the runs.
    miss_m : ndarray, shape (B,)
        Least distance between the centres of mass, m.
    impulse_m_s : ndarray, shape (B,)
        Sum of the moduli of the impulses, m/s.
    guaranteed_miss_m : masked array, shape (B,)
        The published payoff Phi over the stored sections, m; masked where no label finished. In the model `paper` it
        is no guarantee.
    outcomes : tuple of Outcome
    truth_kept : ndarray of bool, shape (B,)
        Whether the truth was inside its own section after every measurement.
    truth_margin_m : ndarray, shape (B,)
        Least signed margin of the truth in its section, m.
    position_m, velocity_m_s : ndarray, shape (B, 2)
        Where the truth started: (z, x) and (V_z, V_x).
    """

    runs: NDArray[np.int64]
    miss_m: Floats
    impulse_m_s: Floats
    guaranteed_miss_m: np.ma.MaskedArray[tuple[int], np.dtype[np.float64]]
    outcomes: tuple[Outcome, ...]
    truth_kept: NDArray[np.bool_]
    truth_margin_m: Floats
    position_m: Floats
    velocity_m_s: Floats

    def __len__(self) -> int:
        return len(self.runs)

    def __repr__(self) -> str:
        miss, fuel = np.median(self.miss_m), np.median(self.impulse_m_s)
        return f"<{len(self)} engagements: median miss {miss:.3g} m for {fuel:.4g} m/s>"


def join(parts: Sequence[Results]) -> Results:
    """Results of several batches as one, in their order."""
    return Results(
        np.concatenate([part.runs for part in parts]),
        np.concatenate([part.miss_m for part in parts]),
        np.concatenate([part.impulse_m_s for part in parts]),
        np.ma.MaskedArray(
            np.concatenate([part.guaranteed_miss_m.data for part in parts]),
            mask=np.concatenate([part.guaranteed_miss_m.mask for part in parts]),
        ),
        tuple(outcome for part in parts for outcome in part.outcomes),
        np.concatenate([part.truth_kept for part in parts]),
        np.concatenate([part.truth_margin_m for part in parts]),
        np.concatenate([part.position_m for part in parts]),
        np.concatenate([part.velocity_m_s for part in parts]),
    )
