"""Sets of an observer of which at least one never sees a wrong measurement.

Theorem 4 of docs/estimation.md: the measurements are dealt into G classes, measurement number
modulo G, and each member of the cover leaves out the measurements of q classes. At most q wrong
measurements lie in at most q classes, so one member uses none of them, and contains the true state.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from infoset.arrays import Flags, Floats, Integers
from infoset.covered_set import classes_left_out
from infoset.limits import WRONG, Limits
from infoset.model import MAX_SETS

Values = TypeVar("Values", Floats, Integers)

_NEVER = np.iinfo(np.int64).max
"""Step of a member that is not empty, later than all steps."""


@dataclass(frozen=True, eq=False)
class Detection:
    """What the measurements prove about wrong ones, if at most q measurements are wrong.

    A single run has no axis B. R is the number of members, and G the number of classes.

    Parameters
    ----------
    step : ndarray of int, shape () or (B,)
        Step at which the first member became empty: a wrong measurement of this step or of an
        earlier one is proved. -1 if no member is empty.
    refuted : ndarray of bool, shape (R,) or (B, R)
        Whether each member is empty: a measurement that it uses is wrong.
    suspected : ndarray of bool, shape (G,) or (B, G)
        Whether each class may contain the wrong measurement that is proved: some member that is not
        refuted leaves it out. None is before the proof, or if all members are refuted.
    """

    step: Integers
    refuted: Flags
    suspected: Flags


@dataclass(frozen=True, eq=False)
class Cover:
    """The members of a cover: R sets for each run, one ordinary set if no measurement is wrong.

    Arrays of all sets have an axis B R, the members of a run one after the other.

    Parameters
    ----------
    left_out : ndarray of bool, shape (R, G)
        Classes of measurements that each member leaves out.
    """

    left_out: Flags

    @classmethod
    def of(cls, wrong_measurements: int, measurement_classes: int | None) -> Cover:
        """Return the cover of at most q wrong measurements; None is 2 q + 2 classes.

        Raises
        ------
        TypeError, ValueError
            If a number is not possible.
        """
        WRONG.need("wrong_measurements", wrong_measurements)
        if wrong_measurements == 0:
            if measurement_classes is not None:
                raise ValueError(
                    "measurement_classes belongs to wrong_measurements, which is 0: leave "
                    "measurement_classes out, or set wrong_measurements"
                )
            # One member, which leaves out no class.
            return cls(classes_left_out(0, 1))

        if measurement_classes is None:
            return cls(classes_left_out(wrong_measurements, 2 * wrong_measurements + 2))
        # With q + 1 classes each member would use the measurements of one class only.
        minimum = wrong_measurements + 2
        Limits(minimum=minimum, whole=True).need("measurement_classes", measurement_classes)
        sets = math.comb(measurement_classes, wrong_measurements)
        if sets > MAX_SETS:
            raise ValueError(
                f"measurement_classes must give at most {MAX_SETS} sets: {measurement_classes} "
                f"classes with {wrong_measurements} wrong measurements give {sets}"
            )
        return cls(classes_left_out(wrong_measurements, measurement_classes))

    @property
    def members(self) -> int:
        """Number R of members."""
        return len(self.left_out)

    @property
    def classes(self) -> int:
        """Number G of classes."""
        return len(self.left_out.T)

    @cached_property
    def _nan_if_left_out(self) -> Floats:
        """NaN where a member leaves a class out, otherwise zero, shape (G, R, 1)."""
        return np.where(self.left_out, np.nan, 0.0).T[:, :, None].copy()

    def repeated(self, values: Values) -> Values:
        """Return values of the runs, shape (B, ...), for all sets, (B R, ...)."""
        if self.members == 1:
            return values
        return np.repeat(values, self.members, axis=0)

    def used(self, y: Floats, numbers: Integers) -> Floats:
        """Return the measurements that each set uses, shape (B R, q); NaN for the others.

        `y`, shape (B, q), are those of the runs, and `numbers`, shape (B,), their numbers.
        """
        marks = self._nan_if_left_out.take(numbers % self.classes, axis=0)
        return (y[:, None, :] + marks).reshape(-1, y.shape[1])

    def last_emptied(self, steps: Integers, excess: Floats) -> NDArray[np.intp]:
        """Return the set of each run that became empty last, with the least excess, shape (B,).

        It is a set that is not empty if there is one; of equal sets it is the first. `steps`, shape
        (B R,), are the steps at which the sets became empty, -1 for a set that is not empty.
        """
        emptied = self._emptied(steps)
        is_last = emptied == emptied.max(axis=1, keepdims=True)
        needed = np.where(is_last, excess.reshape(emptied.shape), np.inf)
        return np.asarray(np.arange(len(emptied)) * self.members + needed.argmin(axis=1))

    def detection(self, steps: Integers) -> Detection:
        """Return what is proved by the steps at which the sets became empty, shape (B R,)."""
        emptied = self._emptied(steps)
        refuted = emptied != _NEVER
        first = emptied.min(axis=1)
        is_proved = refuted.any(axis=1) & ~refuted.all(axis=1)
        possible = (~refuted[:, :, None] & self.left_out).any(axis=1)
        return Detection(
            np.where(first == _NEVER, -1, first), refuted, possible & is_proved[:, None]
        )

    def _emptied(self, steps: Integers) -> Integers:
        """Return the steps at which the members became empty, shape (B, R); `_NEVER` if not."""
        return np.asarray(np.where(steps < 0, _NEVER, steps).reshape(-1, self.members))
