"""Measured directions to the target, and ranges, without linearisation.

The section "Range and direction" of `docs/guaranteed-rendezvous.md`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from infoset.rendezvous._arrays import Flags, Floats
from infoset.rendezvous.reachability.coasting import UnboundedCoastError
from infoset.rendezvous.reachability.conic import NoSolutionError
from infoset.rendezvous.reachability.guaranteed import (
    MAX_ROUNDS,
    MIN_GAIN,
    NoRobustPlanError,
    affine_plan,
)
from infoset.rendezvous.reachability.guided import Cuts, LinearTruth
from infoset.rendezvous.reachability.independent_parts import independent_parts, plan_of_parts
from infoset.rendezvous.reachability.outputs import AffinePlan, OutputProblem, PathRows, joined

_CONE_FACES = 8
"""Half-spaces that replace the cone about a measured direction in space: the edges of the pyramid
are 8.2 % farther from its axis than the cone."""


class SightRows(NamedTuple):
    """Axes along and across the line of sight of a plan without errors, and its distances.

    The shapes are (T, d, n), rows for states, and (T,).
    """

    axes: Floats
    distances: Floats


@dataclass(frozen=True)
class SightSensor:
    """The line of sight from the target, and the range, measured in each period.

    The first two or three states of a problem are the position, and the target is at the origin.

    Parameters
    ----------
    angle_error_rad : float
        Largest angle between the measured and the true line of sight, below a quarter turn.
    range_error : float or None
        Largest error of the range, in units of the position; None if no range is measured.
    """

    angle_error_rad: float
    range_error: float | None = None

    def error_bounds(self, sight: SightRows, caps: Floats) -> Floats:
        """Return bounds of the errors of measured positions along the axes, shape (T, d).

        The position differs from that of `sight` by at most `caps`, shape (T, d), along the axes.
        """
        assert self.range_error is not None
        along = caps[:, 0]
        across = np.linalg.norm(caps[:, 1:], axis=1)
        largest = np.hypot(sight.distances + along, across)
        turned = np.arctan2(across, sight.distances - along) + self.angle_error_rad
        # `turned` bounds the angle between the axis and any measured direction.
        sine = np.where(turned < 0.5 * np.pi, np.sin(turned), 1.0)
        by_angle = largest * self.angle_error_rad
        bounds = np.empty_like(caps)
        bounds[:, 0] = self.range_error + by_angle * sine
        bounds[:, 1:] = (self.range_error * sine + by_angle)[:, None]
        return bounds

    def cuts(self, direction: Floats, distance: float, states: int) -> Cuts:
        """Return half-spaces of the states that agree with a measured direction and range.

        `direction` is a unit vector of two or three components, and `distance` the measured range,
        in units of the position, which is not used without a range sensor.
        """
        tangents = _tangents(direction)
        # Across the direction a position is at most tan(angle error) times what it is along it.
        rows = tangents - np.tan(self.angle_error_rad) * direction
        lower = np.full(len(rows), -np.inf)
        upper = np.zeros(len(rows))
        if self.range_error is not None:
            rows = np.vstack([rows, direction])
            # Along the measured direction a true position is its range times a cosine.
            nearest = (distance - self.range_error) * np.cos(self.angle_error_rad)
            lower = np.append(lower, max(0.0, nearest))
            upper = np.append(upper, distance + self.range_error)
        normals = np.pad(rows, ((0, 0), (0, states - len(direction))))
        return Cuts(normals, lower, upper)

    def simulated(
        self, positions: Floats, generator: np.random.Generator, at_bounds: Flags
    ) -> tuple[Floats, Floats]:
        """Return measured directions, (N, d), and ranges, (N,), of true positions, shape (N, d).

        The errors are uniform, or at their bounds where `at_bounds`, shape (N,), says so. Without
        a range sensor the ranges are the true ones.
        """
        count, size = positions.shape
        errors = generator.uniform(-1.0, 1.0, (2, count))
        errors[:, at_bounds] = np.sign(errors[:, at_bounds])
        distances = np.linalg.norm(positions, axis=1)
        directions = positions / distances[:, None]
        across = generator.normal(size=(count, size))
        across -= np.einsum("nd,nd->n", across, directions)[:, None] * directions
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        angles = (self.angle_error_rad * errors[0])[:, None]
        return (
            np.cos(angles) * directions + np.sin(angles) * across,
            # None counts as no error.
            distances + (self.range_error or 0.0) * errors[1],
        )


def _tangents(direction: Floats) -> Floats:
    """Return unit vectors across a direction: both in a plane, eight in space."""
    axes = axes_of(direction[None, :])[0]
    if len(direction) == 2:
        return np.vstack([axes[1], -axes[1]])
    angles = 2.0 * np.pi * np.arange(_CONE_FACES) / _CONE_FACES
    return np.outer(np.cos(angles), axes[1]) + np.outer(np.sin(angles), axes[2])


def axes_of(positions: Floats) -> Floats:
    """Return unit vectors along and across the directions of positions, (T, d), shape (T, d, d).

    No position is zero. In space the second one is in the plane of the first two coordinates.
    """
    along = positions / np.linalg.norm(positions, axis=1, keepdims=True)
    across = np.zeros_like(along)
    flat = np.linalg.norm(along[:, :2], axis=1)
    # Along the third coordinate any direction is across it.
    across[:, 1] = 1.0
    np.divide(-along[:, 1], flat, out=across[:, 0], where=flat > 0.0)
    np.divide(along[:, 0], flat, out=across[:, 1], where=flat > 0.0)
    axes = [along, across]
    if positions.shape[1] == 3:
        axes.append(np.cross(along, across))
    return np.stack(axes, axis=1)


def sight_of(plan: AffinePlan, size: int) -> SightRows:
    """Return the lines of sight of a plan without errors; positions have `size` components."""
    # Nothing is measured at the time T.
    positions = plan.nominal_states[:-1, :size]
    rows = np.zeros((len(positions), size, plan.problem.states))
    rows[:, :, :size] = axes_of(positions)
    return SightRows(rows, np.linalg.norm(positions, axis=1))


def sighted(
    problem: OutputProblem, sensor: SightSensor, sight: SightRows, plan: AffinePlan
) -> OutputProblem:
    """Return the problem with measured positions along and across lines of sight.

    The largest distances of a `plan` from the lines of sight are further constraints, for which the
    bounds of the errors are valid.
    """
    periods, size, _ = sight.axes.shape
    rows = PathRows(
        np.repeat(np.arange(periods), size),
        sight.axes.reshape(periods * size, -1),
        np.zeros((periods * size, problem.controls)),
        np.full(periods * size, -np.inf),
        np.full(periods * size, np.inf),
    )
    middle = np.zeros((periods, size))
    # Without errors the position is on its line of sight: zero across it.
    middle[:, 0] = sight.distances
    ranges = plan.ranges_of(rows)
    above = ranges.upper.reshape(periods, size) - middle
    below = middle - ranges.lower.reshape(periods, size)
    caps = np.maximum(above, below)
    rows = rows._replace(lower=(middle - caps).ravel(), upper=(middle + caps).ravel())

    noise = sensor.error_bounds(sight, caps)
    return replace(
        problem,
        output=sight.axes,
        noise=noise[:, :, None] * np.eye(size),
        # No plan changes the start.
        path=joined(problem.path, rows.chosen(rows.times > 0)),
    )


def sighted_plan(
    problem: OutputProblem,
    sensor: SightSensor,
    size: int,
    solve: Callable[[OutputProblem], AffinePlan] = affine_plan,
) -> AffinePlan:
    """Return an affine plan with measured directions and ranges, certified for all errors.

    The outputs of the problem are not used. Its plan has the outputs y(t) = C(t) r with the
    measured positions r, of `size` components. `solve` returns a plan for a problem with outputs.
    The first lines of sight and distances from them are those of the best plan without outputs and
    constraints of the path, then those of the last plan, until the guarantee stays. The guarantee
    holds in every round, but may be a local optimum.

    Raises
    ------
    NoRobustPlanError, NoSolutionError, UnboundedCoastError
        As `solve`, in the first round.
    """
    blind = replace(
        problem,
        output=np.zeros((problem.periods, size, problem.states)),
        noise=np.zeros((problem.periods, size, 0)),
    )
    free = replace(blind, path=None)
    parts = [(part, affine_plan(part.problem)) for part in independent_parts(free)]
    first = plan_of_parts(free, parts)
    sight = sight_of(first, size)
    best = solve(sighted(blind, sensor, sight, first))
    for _ in range(MAX_ROUNDS):
        renewed = sight_of(best, size)
        found = _smaller(best, sighted(blind, sensor, renewed, best), solve)
        if found is None:
            # Along the same lines the last plan remains feasible, with smaller errors.
            renewed = sight
            found = _smaller(best, sighted(blind, sensor, sight, best), solve)
        if found is None:
            return best
        gain = best.guarantee - found.guarantee
        best = found
        sight = renewed
        if gain <= MIN_GAIN * best.guarantee:
            return best
    return best


def _smaller(
    best: AffinePlan, problem: OutputProblem, solve: Callable[[OutputProblem], AffinePlan]
) -> AffinePlan | None:
    """Return the plan of a problem if its guarantee is smaller, or None."""
    try:
        found = solve(problem)
    except (NoRobustPlanError, NoSolutionError, UnboundedCoastError):
        return None
    return found if found.guarantee < best.guarantee else None


class SightTruth:
    """The linear motion of a problem, whose directions and ranges are measured with errors.

    Parameters
    ----------
    motion : LinearTruth
        The motion; its measurement errors are not used.
    sensor : SightSensor
        The sensor.
    size : int
        Number of components of the position.
    generator : numpy.random.Generator
        Of the measurement errors.
    at_bounds : bool
        Whether these errors are at their bounds.
    """

    def __init__(
        self,
        motion: LinearTruth,
        sensor: SightSensor,
        size: int,
        generator: np.random.Generator,
        *,
        at_bounds: bool,
    ) -> None:
        self.motion = motion
        self._sensor = sensor
        self._size = size
        self._generator = generator
        self._at_bounds = np.array([at_bounds])
        self._seen: tuple[Floats, float] | None = None

    def _measurement(self) -> tuple[Floats, float]:
        """Return the direction and the range of this period, measured once."""
        if self._seen is None:
            position = self.motion.state[None, : self._size]
            found = self._sensor.simulated(position, self._generator, self._at_bounds)
            self._seen = found[0][0], float(found[1][0])
        return self._seen

    def measured(self) -> Floats:
        """Return the measured position along the axes of the problem; zero if it has none."""
        direction, distance = self._measurement()
        problem = self.motion.problem
        return np.asarray(problem.output[self.motion.time, :, : self._size] @ direction * distance)

    def cuts(self) -> Cuts:
        """Return half-spaces of the states that agree with the measurement."""
        direction, distance = self._measurement()
        return self._sensor.cuts(direction, distance, self.motion.problem.states)

    def move(self, control: Floats) -> None:
        """Apply the control u(t), shape (m,), with its errors."""
        self.motion.move(control)
        self._seen = None
