"""Adversary plans (start, errors and target of each engagement) and their outcomes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from guidance import GameNoise, LineOfSight, TieRule
from guidance.game_noise import SwitchingNoise
from guidance.scripted_noise import errors_made, measure_with_errors
from infoset import InformationSetView
from infoset.arrays import Flags, Floats, Integers
from infoset.sensors import Measurements, Sensor
from sim.scenario import Manoeuvre, Scenario, corners
from sim.target import amplitudes_m_s2

ROWS = ("angle", "range", "rate")
"""Sensors of the first rows of a sequence, also if absent: the random numbers of a search depend on the row count."""
ANGLE = 0


@dataclass(frozen=True)
class Plans:
    """Plans of n engagements.

    Parameters
    ----------
    start : ndarray, shape (n, 4) or (n, 6)
        (z, x, V_z, V_x) at t = 0, m and m/s; (y, z, x, V_y, V_z, V_x) in space.
    sequence : ndarray, shape (n, rows, axes, steps)
        Errors in units of their bounds, one row per sensor, `ROWS` first, for each lateral axis. A sensor that does not
        measure by axis uses the first.
    prescribed : ndarray of bool, shape (n, steps)
        Whether the errors of a step are those of the sequence. Otherwise the noise keeps, along each axis, the upper
        extreme of the predicted miss if the element of the angle is not negative, and the lower one if it is.
    sides : ndarray, shape (n, axes, steps)
        Sign of the target's acceleration, 1 or -1; 0 is the sign of the true predicted miss, which it increases.
    lineage, changes : ndarray of int, shape (n,)
        Index of the first plan from which a plan was derived, and number of changes since then.
    """

    start: Floats
    sequence: Floats
    prescribed: Flags
    sides: Floats
    lineage: Integers
    changes: Integers

    def __len__(self) -> int:
        return len(self.start)

    def take(self, which: Integers | slice) -> Plans:
        """Return copies of some plans."""
        return Plans(*(getattr(self, field.name)[which].copy() for field in fields(self)))

    def join(self, other: Plans) -> Plans:
        """Return these plans and others."""
        return Plans(*(np.concatenate([getattr(part, of.name) for part in (self, other)]) for of in fields(self)))


@dataclass
class PlannedNoise:
    """Noise of planned engagements that stores its errors: the stored errors reproduce the measurements.

    Parameters
    ----------
    names : sequence of str
        Sensors of the rows of a sequence.
    tie : TieRule or None
        Tie rule of game noise; None keeps the extreme that the plan prescribes for each step (`SwitchingNoise`).
    shift_m, target_side : ndarray or None
        Shift of game noise in each step, m, and the sign of a constant acceleration of the target (`GameNoise`).

    Attributes
    ----------
    errors : ndarray, shape (n, rows, axes, steps)
        Errors made so far, in units of their bounds; zero where nothing was measured.
    """

    plans: Plans
    tie: TieRule | None
    names: Sequence[str]
    shift_m: Floats | None = None
    target_side: Floats | None = None
    errors: Floats = field(init=False)

    def __post_init__(self) -> None:
        sequence = self.plans.sequence
        self.errors = np.zeros_like(sequence)
        draws = by_axis(sequence[:, ANGLE])
        self._keeping = (
            SwitchingNoise(TieRule.RANDOM, draws)
            if self.tie is None
            else GameNoise(self.tie, draws, self.shift_m, self.target_side)
        )

    def measure(self, sight: LineOfSight, predicted: InformationSetView) -> Measurements:
        """Return the measurements of this step: with planned errors, or those that keep an extreme of the set."""
        step, prescribed = sight.step, self.plans.prescribed[:, sight.step]
        kept = errors_made(sight, self._keeping.measure(sight, predicted))
        errors = {}
        for row, name in enumerate(self.names):
            if name in sight.sensors:
                sensor = sight.sensors[name]
                planned = by_axis(self.plans.sequence[:, row, :, step], sensor)
                errors[name] = sensor.limited(np.where(prescribed, planned, kept[name]))
                self.errors[:, row, :, step] = np.atleast_2d(errors[name]).T
        return measure_with_errors(sight, errors)


@dataclass
class PlannedTarget:
    """Targets of planned engagements that accelerate at their bound, and store their accelerations.

    Parameters
    ----------
    bound_m_s2 : ndarray, shape (axes,)
        Maximum acceleration along each lateral axis, m/s^2.

    Attributes
    ----------
    accelerations_m_s2 : ndarray, shape (n, axes, steps)
        Accelerations so far, m/s^2.
    """

    plans: Plans
    bound_m_s2: Floats
    accelerations_m_s2: Floats = field(init=False)

    def __post_init__(self) -> None:
        sides = self.plans.sides
        self.accelerations_m_s2 = np.zeros_like(sides)
        self._planned, self._increases = self.bound_m_s2[:, None] * sides, sides == 0.0
        self._increases_any = self._increases.any(axis=(0, 1))

    def acceleration_m_s2(self, step: int, predicted_miss_m: Floats) -> Floats:
        """Return the acceleration over a step, m/s^2, shape (C, B)."""
        chosen = self._planned[:, :, step]
        if self._increases_any[step]:
            increasing = np.copysign(self.bound_m_s2, predicted_miss_m.T)
            chosen = np.where(self._increases[:, :, step], increasing, chosen)
        self.accelerations_m_s2[:, :, step] = chosen
        return by_axis(chosen)


@dataclass(frozen=True)
class PlanSpace:
    """What the plans of a scenario consist of, and what they may change.

    Parameters
    ----------
    names : tuple of str
        Sensors of the rows of a sequence.
    lower, upper : ndarray, shape (4,) or (6,)
        Limits of the starts.
    acceleration_m_s2 : ndarray, shape (axes,)
        Maximum acceleration of the target along each axis, m/s^2; zero if the target is that of the scenario.
    """

    scenario: Scenario
    steps: int
    names: tuple[str, ...]
    lower: Floats
    upper: Floats
    acceleration_m_s2: Floats

    @staticmethod
    def of(scenario: Scenario, steps: int) -> PlanSpace:
        """Return the space of a scenario with flights of a number of steps.

        In the guaranteed model the target accelerates up to the bound of the model, or up to that of the scenario's
        target if that is greater. In the model `paper` the disturbance is fictitious.
        """
        model, target = scenario.set_model, scenario.target
        most = np.zeros(len(model.axes))
        if model.is_guaranteed:
            most = np.array([model.axis(axis).disturbance_m_s2 for axis in model.axes])
            if target is not None and target.manoeuvre is not Manoeuvre.NONE:
                most = np.maximum(most, amplitudes_m_s2(target, len(most)))
        lower, upper = corners(model.bounds)
        return PlanSpace(scenario, steps, tuple(dict.fromkeys((*ROWS, *scenario.sensors))), lower, upper, most)

    @property
    def axes(self) -> int:
        """Number of lateral axes."""
        return len(self.acceleration_m_s2)

    @property
    def has_accelerations(self) -> bool:
        """Whether a plan chooses the accelerations of the target."""
        return bool(self.acceleration_m_s2.any())


def range_m(start: Floats) -> Floats:
    """Return the range x of starts, m; the last of the positions."""
    return np.asarray(start[..., start.shape[-1] // 2 - 1])


def by_axis(values: Floats, sensor: Sensor | None = None) -> Floats:
    """Return values of shape (n, C, ...) as a sensor uses them: (C, n, ...) if it measures by axis, otherwise (n, ...).

    None is the angle sensor.
    """
    return np.moveaxis(values, 1, 0) if sensor is None or sensor.is_lateral else values[:, 0]


@dataclass(frozen=True)
class Flown:
    """Plans with their outcomes, arrays of shape (n,).

    Parameters
    ----------
    value : ndarray
        What the search maximises, m; -inf if the engagement does not count.
    miss_m, any_state_miss_m : ndarray
        Miss of the true state, and maximum miss of a state of the set, m.
    errors : ndarray, shape (n, rows, axes, steps)
        Errors made, in units of their bounds.
    accelerations_m_s2 : ndarray, shape (n, axes, steps)
        Accelerations of the target, m/s^2; zero if the target is that of the scenario.
    lateral_miss_m : ndarray, shape (n, axes)
        Lateral position at the closest approach, m.
    """

    plans: Plans
    value: Floats
    miss_m: Floats
    any_state_miss_m: Floats
    errors: Floats
    accelerations_m_s2: Floats
    outcomes: NDArray[np.object_]
    set_emptied: Flags
    truth_kept: Flags
    lateral_miss_m: Floats

    def take(self, which: Integers | slice) -> Flown:
        """Return some plans with their outcomes."""
        return Flown(self.plans.take(which), *(getattr(self, field.name)[which] for field in fields(self)[1:]))

    def join(self, other: Flown) -> Flown:
        """Return these plans with their outcomes, and others."""
        both = (np.concatenate([getattr(part, of.name) for part in (self, other)]) for of in fields(self)[1:])
        return Flown(self.plans.join(other.plans), *both)
