"""What came of a batch of engagements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from infoset.information_set_view import MaskedFloats

Floats = NDArray[np.float64]


class Outcome(Enum):
    """How an engagement ended."""

    INTERCEPTED = "intercepted"
    """Flown to the closest approach with a set, or with none needed any more."""
    SET_LOST = "set-lost"
    """The set emptied while no hypothesis had left it: measurements and model disagree.

    With recovery the engagement goes on from the last consistent set, widened; without it no impulse is given after.
    """
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
        In the guaranteed model Phi, which the true miss cannot exceed, over all labels; masked where it is not known:
        no label has left, the set did not start as a box, or the data broke their bounds. In the model `paper` the
        published payoff over the stored sections, which is no guarantee; masked where no label finished. m.
    outcomes : tuple of Outcome
    truth_kept : ndarray of bool, shape (B,)
        Whether the truth was inside its own section after every measurement.
    truth_margin_m : masked array, shape (B,)
        Least signed margin of the truth in its section, m; masked where nothing was measured.
    position_m, velocity_m_s : ndarray, shape (B, 2)
        Where the truth started: (z, x) and (V_z, V_x).
    guarantees : bool
        Whether `guaranteed_miss_m` is a guarantee.
    """

    runs: NDArray[np.int64]
    miss_m: Floats
    impulse_m_s: Floats
    guaranteed_miss_m: MaskedFloats
    outcomes: tuple[Outcome, ...]
    truth_kept: NDArray[np.bool_]
    truth_margin_m: MaskedFloats
    position_m: Floats
    velocity_m_s: Floats
    guarantees: bool = False

    @property
    def phi_held(self) -> np.ma.MaskedArray[tuple[int], np.dtype[np.bool_]]:
        """Whether the true miss stayed within the guaranteed one, shape (B,); masked where nothing was guaranteed."""
        unknown = np.ma.getmaskarray(self.guaranteed_miss_m) | (not self.guarantees)
        return np.ma.MaskedArray(self.miss_m <= self.guaranteed_miss_m.filled(np.inf), mask=unknown)

    def __len__(self) -> int:
        return len(self.runs)

    def _repr_html_(self) -> str:
        from sim.pictures import results_html

        return results_html(self)

    def __repr__(self) -> str:
        miss, fuel = np.median(self.miss_m), np.median(self.impulse_m_s)
        return f"<{len(self)} engagements: median miss {miss:.3g} m for {fuel:.4g} m/s>"


def join(parts: Sequence[Results]) -> Results:
    """Results of several batches as one, in their order."""
    return Results(
        np.concatenate([part.runs for part in parts]),
        np.concatenate([part.miss_m for part in parts]),
        np.concatenate([part.impulse_m_s for part in parts]),
        _joined([part.guaranteed_miss_m for part in parts]),
        tuple(outcome for part in parts for outcome in part.outcomes),
        np.concatenate([part.truth_kept for part in parts]),
        _joined([part.truth_margin_m for part in parts]),
        np.concatenate([part.position_m for part in parts]),
        np.concatenate([part.velocity_m_s for part in parts]),
        all(part.guarantees for part in parts),
    )


def _joined(parts: Sequence[MaskedFloats]) -> MaskedFloats:
    return np.ma.MaskedArray(
        np.concatenate([part.data for part in parts]), mask=np.concatenate([np.ma.getmaskarray(part) for part in parts])
    )
