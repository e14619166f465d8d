"""Tables of a `reachable-rendezvous` file with bounded errors, and its problem.

A file with `[sensor]` or `[initial_error]` asks for a guarantee: see
`docs/guaranteed-rendezvous.md`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.reachability.vectors import Bound, HalfWidth, Vector
from infoset.limits import Limits, Positive
from infoset.rendezvous.reachability import ReachabilityProblem, SightSensor

MAX_GUARANTEED_PERIODS = 60
"""Maximum number of periods with bounded errors; chosen: the programs of 60 take a minute."""
NO_ERROR = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class InitialError:
    """Half-widths of the set of the active craft at t = 0, about `[initial]`."""

    position_m: HalfWidth = NO_ERROR
    velocity_m_s: HalfWidth = NO_ERROR


@dataclass(frozen=True, kw_only=True)
class ExecutionError:
    """Error of a control along each axis: at most a constant plus a part of the control.

    The constant is `absolute_m_s` for impulses and `absolute_m_s2` for held thrust.
    """

    absolute_m_s: HalfWidth | None = None
    absolute_m_s2: HalfWidth | None = None
    relative: Annotated[float, Limits(minimum=0.0, below=1.0)] = 0.0


@dataclass(frozen=True, kw_only=True)
class Sensor:
    """What is measured at t = 0..T - 1 before the control, with the largest errors.

    Either the position, and the velocity if it has an error, along each axis; or the line of sight
    from the target, and the range if it has an error. The error of the line of sight is its angle
    from the true one.
    """

    position_error_m: HalfWidth | None = None
    velocity_error_m_s: HalfWidth | None = None
    range_error_m: Annotated[float, Limits(minimum=0.0)] | None = None
    angle_error_rad: Annotated[float, Limits(above=0.0, below=0.5 * math.pi)] | None = None

    def __post_init__(self) -> None:
        if self.position_error_m is None and self.angle_error_rad is None:
            raise ValueError(
                "position_error_m: is missing; without it the sensor needs angle_error_deg"
            )
        if self.position_error_m is None and self.velocity_error_m_s is not None:
            raise ValueError("velocity_error_m_s: needs position_error_m")
        if self.position_error_m is not None and self.angle_error_rad is not None:
            raise ValueError("angle_error_deg: must be omitted with position_error_m")
        if self.angle_error_rad is None and self.range_error_m is not None:
            raise ValueError("range_error_m: needs angle_error_deg")

    @property
    def sight(self) -> SightSensor | None:
        """The sensor of lines of sight; None if the position is measured."""
        if self.angle_error_rad is None:
            return None
        return SightSensor(self.angle_error_rad, self.range_error_m)

    @property
    def acts_before_flight(self) -> bool:
        """Whether a plan made before the flight can react to the measurements.

        It cannot to lines of sight without ranges: they only cut the set of states, in flight.
        """
        return self.position_error_m is not None or self.range_error_m is not None


@dataclass(frozen=True, kw_only=True)
class Goal:
    """A hold point at t = T, and half-widths of the box about it.

    The size of this box that contains the craft for all errors is minimised, with the proportions
    of the box. Without `velocity_box_m_s` the velocity is free.
    """

    position_m: Vector = NO_ERROR
    velocity_m_s: Vector = NO_ERROR
    position_box_m: Bound
    velocity_box_m_s: Bound | None = None


@dataclass(frozen=True, kw_only=True)
class PassiveSafetyTable:
    """If the engines fail after an impulse, the drift stays outside a ball about the target.

    The engines may fail after each impulse until that of `until_period`, None for the last one, and
    the drift is that of the next `drift_periods` periods.
    """

    keep_out_m: Positive
    drift_periods: Annotated[int, Limits(minimum=1, maximum=MAX_GUARANTEED_PERIODS, whole=True)]
    until_period: Annotated[int, Limits(minimum=0, whole=True)] | None = None


def check_starts(problem: ReachabilityProblem, error: Floats) -> None:
    """Raise `ValueError` if a start within half-widths, shape (6,), breaks a constraint of t = 0.

    Constraints that the errors do not reach are left out: the start itself was checked already.
    """
    normals, offsets = problem.further
    spread = np.concatenate([error, np.abs(normals) @ error])
    states = np.concatenate([np.abs(problem.initial), normals @ problem.initial])
    # The first offsets are those of t = 0.
    over = states + spread - np.concatenate([problem.state_bounds, offsets[0]])
    # The start itself was checked, to rounding.
    broken = np.flatnonzero((spread > 0.0) & (over > 0.0)).tolist()
    if not broken:
        return

    listed = []
    for row in broken:
        if row < problem.states:
            name = problem.state_name(row)
        else:
            name = problem.name_of(row - problem.states)
        listed.append(f"{name} by {over[row]:.6g}")
    raise ValueError(
        f"initial_error: starts within it are outside their constraints: {', '.join(listed)}"
    )
