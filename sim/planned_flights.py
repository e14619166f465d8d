"""What nature intends in engagements that an adversary searches among, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from guidance import GameNoise, LineOfSight, Measurement, TieRule
from guidance.scripted_noise import errors_made, measure_with_errors
from guidance.switching_noise import SwitchingNoise
from infoset import InformationSetView

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Counts = NDArray[np.int64]
ANGLE, RANGE, RATE = range(3)


@dataclass(frozen=True)
class Plans:
    """What nature intends in each of n engagements.

    Parameters
    ----------
    start : ndarray, shape (n, 4)
        z, x, V_z, V_x at t = 0, m and m/s.
    sequence : ndarray, shape (n, 3, steps)
        For angle, range and rate: errors in units of their bounds.
    given : ndarray of bool, shape (n, steps)
        Whether the errors of a step are those of the sequence. Elsewhere the upper extreme of the predicted miss is
        kept where the angle's element is not negative, the lower one where it is.
    lineage, changes : ndarray of int, shape (n,)
        From which first plan it comes, and by how many changes.
    """

    start: Floats
    sequence: Floats
    given: Flags
    lineage: Counts
    changes: Counts

    def __len__(self) -> int:
        return len(self.start)

    def take(self, which: Counts | slice) -> Plans:
        """Copies of some of them."""
        return Plans(*(getattr(self, each.name)[which].copy() for each in fields(self)))

    def join(self, other: Plans) -> Plans:
        """These and others."""
        return Plans(*(np.concatenate([getattr(each, of.name) for each in (self, other)]) for of in fields(self)))


@dataclass
class PlannedNoise:
    """Measures as planned, and notes the errors made: what is measured is what the noted error gives.

    Parameters
    ----------
    plans : Plans
    tie : TieRule or None
        How equals are told apart where an extreme is kept; None lets every step choose its side (`SwitchingNoise`).

    Attributes
    ----------
    errors : ndarray, shape (n, 3, steps)
        Made so far, in units of their bounds.
    """

    plans: Plans
    tie: TieRule | None
    errors: Floats = field(init=False)

    def __post_init__(self) -> None:
        sequence = self.plans.sequence
        self.errors = np.zeros_like(sequence)
        tie = TieRule.RANDOM if self.tie is None else self.tie
        self._keeping = (SwitchingNoise if self.tie is None else GameNoise)(tie, sequence[:, ANGLE])

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurement:
        """Return what this step measures, shape (n,) each; where nothing is planned the set is looked at."""
        step = sight.step
        kept = np.stack(errors_made(sight, self._keeping.measure(sight, predicted)), axis=1)
        errors = np.where(self.plans.given[:, None, step], self.plans.sequence[:, :, step], kept)
        # What is not measured in this step has no error, whatever was planned.
        if sight.range_error is None:
            errors[:, RANGE] = 0.0
        if sight.rate_error_rad_s is None:
            errors[:, RATE] = 0.0
        self.errors[:, :, step] = errors
        return measure_with_errors(sight, errors[:, ANGLE], errors[:, RANGE], errors[:, RATE])


@dataclass(frozen=True)
class Flown:
    """Plans with what came of them.

    Parameters
    ----------
    plans : Plans
    value : ndarray, shape (n,)
        The miss, m, or -inf where the engagement does not count.
    errors : ndarray, shape (n, 3, steps)
        Made in units of their bounds.
    outcomes : ndarray of Outcome, shape (n,)
    truth_kept : ndarray of bool, shape (n,)
    """

    plans: Plans
    value: Floats
    errors: Floats
    outcomes: NDArray[np.object_]
    truth_kept: Flags

    def take(self, which: Counts | slice) -> Flown:
        """Some of them."""
        return Flown(self.plans.take(which), *(getattr(self, each.name)[which] for each in fields(self)[1:]))

    def join(self, other: Flown) -> Flown:
        """These and others."""
        both = (np.concatenate([getattr(each, of.name) for each in (self, other)]) for of in fields(self)[1:])
        return Flown(self.plans.join(other.plans), *both)
