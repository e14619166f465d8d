"""Simulated flights of a rendezvous with bounded errors, by an affine plan or planned in flight.

The motion is that of the problem, or one that the caller gives, such as the nonlinear one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from infoset.rendezvous._arrays import Flags, Floats
from infoset.rendezvous.reachability.bounded_errors import ErrorBounds
from infoset.rendezvous.reachability.guided import Acceptance, Cuts, GuidedCraft
from infoset.rendezvous.reachability.independent_parts import ProblemPart
from infoset.rendezvous.reachability.line_of_sight import SightSensor
from infoset.rendezvous.reachability.outputs import AffinePlan, OutputProblem
from infoset.rendezvous.reachability.problem import ReachabilityProblem, ThrustShape

Move = Callable[[int, Floats, Floats, Floats], Floats]
"""A function (period, states, controls with their errors, disturbances) of N flights.

It returns the states after the control at the instants within the period at which constraints are
checked, and at its end, shape (N, s + 1, n). The disturbances, shape (N, p), are fractions of their
bounds."""
_ROUNDING = 1e-9
"""Part of a guarantee and of the end of a constraint up to which flights may exceed them: states of
a flight are sums of terms that are up to 1e5 times their result, each rounded to 1e-16."""


class PlanFlights(NamedTuple):
    """Simulated flights of an affine plan.

    `distances`, shape (N,), are |x(T) - target| in the norm of the goal. `outside` is the number of
    flights that exceed the guarantee or break a constraint by more than rounding.
    """

    distances: Floats
    outside: int


class ReplannedFlights(NamedTuple):
    """Simulated flights that are planned again after each output.

    `guarantees`, shape (N, T + 1), are the promises before the flight and after each output, and
    `distances`, shape (N,), are |x(T) - target|, both in the norm of the goal. `outside` is the
    number of flights that exceed their last promise, or break a constraint, by more than rounding,
    and of those whose outputs contradict the bounds of the errors.
    """

    guarantees: Floats
    distances: Floats
    outside: int


def linear_motion(problem: ReachabilityProblem, errors: ErrorBounds) -> Move:
    """Return the motion of the problem."""

    def move(time: int, states: Floats, acting: Floats, pushes: Floats) -> Floats:
        end = states @ problem.transition[time].T + acting @ problem.control[time].T
        if errors.disturbance is not None:
            end = end + pushes @ errors.disturbance[time].T
        path = []
        if problem.between is not None:
            both = np.hstack([states, acting])
            path = [both @ matrix.T for matrix in problem.between[time]]
        return np.stack([*path, end], axis=1)

    return move


def fly_plan(
    problem: ReachabilityProblem,
    plan: AffinePlan,
    errors: ErrorBounds,
    flights: int,
    seed: int,
    move: Move | None = None,
) -> PlanFlights:
    """Simulate flights with uniform errors, and every second one with errors at their bounds.

    The matrices are those of the problem, not those of the plan's certificate; directions and
    ranges are those of the true positions, without linearisation. `move` replaces the motion of the
    problem. Limits of the control are those of the control that is commanded.
    """
    draw = _Draw(np.random.default_rng(seed), np.arange(flights) % 2 == 1)
    affine = _AffineFlights(plan, flights)
    move = move or linear_motion(problem, errors)
    flown = _fly(problem, plan.problem.output, errors, draw, affine, move)
    distances = _distances(plan.problem, flown.states)
    outside = flown.broken | (distances > plan.guarantee * (1.0 + _ROUNDING))
    return PlanFlights(distances, int(outside.sum()))


@dataclass(frozen=True, eq=False)
class ReplannedPart:
    """A part of a problem, its plan before the flight, and what new plans must prove beyond it.

    `accepts` is as in `GuidedCraft`. With directions that are cuts the part is the whole problem.
    """

    part: ProblemPart
    plan: AffinePlan
    accepts: Acceptance | None = None


@dataclass(frozen=True, eq=False)
class ReplannedPlan:
    """A plan before the flight whose parts are planned again in flight.

    Parameters
    ----------
    plan : AffinePlan
        The plan of the whole problem.
    parts : sequence of ReplannedPart
        Its independent parts and their plans; what is in no part rests.
    window : int or None
        As in `GuidedCraft`.
    """

    plan: AffinePlan
    parts: Sequence[ReplannedPart]
    window: int | None = None


def fly_replanned(
    problem: ReachabilityProblem,
    before: ReplannedPlan,
    errors: ErrorBounds,
    flights: int,
    seed: int,
    move: Move | None = None,
    progress: Callable[[float], None] = lambda _done: None,
) -> ReplannedFlights:
    """Simulate flights that are planned again after each output (Theorem 6).

    The errors and `move` are as in `fly_plan`; each flight has its own random numbers, so that
    the first flights do not depend on the number of flights. After each of them `progress` is
    called with the share of the flights that are done.
    """
    move = move or linear_motion(problem, errors)
    output = before.plan.problem.output
    guarantees = np.zeros((flights, problem.periods + 1))
    distances = np.zeros(flights)
    outside = 0
    for flight in range(flights):
        sequence = np.random.SeedSequence(entropy=seed, spawn_key=(flight,))
        draw = _Draw(np.random.default_rng(sequence), np.array([flight % 2 == 1]))
        crafts = _PartCrafts(before, errors.sight)
        flown = _fly(problem, output, errors, draw, crafts, move)

        guarantees[flight] = crafts.guarantees
        distances[flight] = _distances(before.plan.problem, flown.states)[0]
        is_kept = distances[flight] <= guarantees[flight, -1] * (1.0 + _ROUNDING)
        outside += not (is_kept and crafts.is_consistent and not flown.broken[0])
        progress((flight + 1) / flights)
    return ReplannedFlights(guarantees, distances, outside)


class _Sights(NamedTuple):
    """Measured directions, shape (N, d), and ranges, shape (N,), of N flights."""

    directions: Floats
    ranges: Floats


class _Measured(NamedTuple):
    """Outputs of N flights, shape (N, q), and what they were computed from if it is a sight."""

    outputs: Floats
    sights: _Sights | None


class _Strategy(Protocol):
    def control(self, measured: _Measured) -> Floats:
        """Return the controls of a period, shape (N, m), after its measurements."""


class _AffineFlights:
    """Flights of an affine plan."""

    def __init__(self, plan: AffinePlan, flights: int) -> None:
        self._plan = plan
        self._predicted = np.tile(plan.problem.centre, (flights, 1))
        self._shown = np.zeros((plan.problem.periods, flights, plan.problem.output.shape[1]))
        self._time = 0

    def control(self, measured: _Measured) -> Floats:
        plan = self._plan
        problem = plan.problem
        t = self._time
        self._shown[t] = measured.outputs - self._predicted @ problem.output[t].T
        # Gains of later outputs are zero, and so are these outputs until they are shown.
        control = plan.nominal[t] + np.einsum("sjq,sfq->fj", plan.gains[t], self._shown)
        moved = self._predicted @ problem.transition[t].T
        self._predicted = moved + control @ problem.control[t].T
        self._time += 1
        return np.asarray(control)


class _PartCrafts:
    """One flight, each of whose parts has its own set of possible states and kept plan."""

    def __init__(self, before: ReplannedPlan, sensor: SightSensor | None) -> None:
        self._controls = before.plan.problem.controls
        self._sensor = sensor
        self._crafts = [
            (each.part, GuidedCraft(each.plan, window=before.window, accepts=each.accepts))
            for each in before.parts
        ]
        self.guarantees = [self._guarantee]
        self.is_consistent = True

    @property
    def _guarantee(self) -> float:
        return max((craft.guarantee for _, craft in self._crafts), default=0.0)

    def control(self, measured: _Measured) -> Floats:
        control = np.zeros((1, self._controls))
        cuts = self._cuts(measured.sights)
        for part, craft in self._crafts:
            craft.measure(measured.outputs[0, part.outputs], cuts)
            self.is_consistent &= not craft.observer.estimate().is_empty
            control[0, part.controls] = craft.control()
        self.guarantees.append(self._guarantee)
        return control

    def _cuts(self, sights: _Sights | None) -> Cuts | None:
        """Return half-spaces of the states of the whole problem, if the sensor shows them."""
        if sights is None or self._sensor is None:
            return None
        # Positions and velocities.
        states = 2 * sights.directions.shape[1]
        return self._sensor.cuts(sights.directions[0], float(sights.ranges[0]), states)


class _Draw:
    """Random errors of N flights within bounds; those of `extreme` flights are at the bounds."""

    def __init__(self, generator: np.random.Generator, extreme: Flags) -> None:
        self._generator = generator
        self._extreme = extreme

    def __call__(self, bounds: Floats) -> Floats:
        """Return errors of all flights, shape (N, k), within bounds of shape (k,)."""
        values = self._generator.uniform(-1.0, 1.0, (len(self._extreme), len(bounds)))
        values[self._extreme] = np.sign(values[self._extreme])
        return np.asarray(values * bounds)

    def measured(self, states: Floats, output: Floats, errors: ErrorBounds) -> _Measured:
        """Return the measurements of true states, shape (N, n), for a matrix of outputs."""
        if errors.sight is None:
            return _Measured(states @ output.T + self(errors.measured), None)
        # The other half of the states are velocities.
        size = states.shape[1] // 2
        sights = _Sights(*errors.sight.simulated(states[:, :size], self._generator, self._extreme))
        positions = sights.ranges[:, None] * sights.directions
        return _Measured(positions @ output[:, :size].T, sights)


class _Flown(NamedTuple):
    """States at the end, shape (N, n), and which flights broke a constraint, shape (N,)."""

    states: Floats
    broken: Flags


def _fly(
    problem: ReachabilityProblem,
    output: Floats,
    errors: ErrorBounds,
    draw: _Draw,
    strategy: _Strategy,
    move: Move,
) -> _Flown:
    """Return the ends of flights whose outputs have the matrices `output`, shape (T, q, n)."""
    states = problem.initial + draw(errors.start)
    pushes = 0 if errors.disturbance is None else errors.disturbance.shape[2]
    broken = np.zeros(len(states), dtype=bool)
    for t in range(problem.periods):
        control = strategy.control(draw.measured(states, output[t], errors))
        acting = control + draw(np.ones(problem.controls)) * (
            errors.execution + errors.relative * np.abs(control)
        )
        path = move(t, states, acting, draw(np.ones(pushes)))
        broken |= _breaks(problem, t, states, control, acting)
        # States within a period obey the constraints of its start; the last one is its end.
        for inner in range(path.shape[1] - 1):
            broken |= _exceeds(problem, t, path[:, inner])
        states = path[:, -1]
    broken |= _exceeds(problem, problem.periods, states)
    return _Flown(states, broken)


def _distances(problem: OutputProblem, states: Floats) -> Floats:
    """Return |x(T) - target| in the norm of the goal, shape (N,)."""
    return np.asarray(np.abs((states - problem.aim) @ problem.goal.T).max(axis=1))


def _breaks(
    problem: ReachabilityProblem, time: int, states: Floats, control: Floats, acting: Floats
) -> Flags:
    """Return which flights, (N,), break a constraint before, at or just after a control.

    `acting`, shape (N, m), is the `control` with its error.
    """
    normals, offsets = problem.limits
    slack = _ROUNDING * (np.abs(normals) @ problem.control_bounds)
    broken = (np.abs(control) > problem.control_bounds * (1.0 + _ROUNDING)).any(axis=1)
    broken |= (control @ normals.T > offsets[time] + slack).any(axis=1)
    if problem.thrust is ThrustShape.BALL:
        norms = np.linalg.norm(control, axis=1)
        broken |= norms > problem.control_bounds[0] * (1.0 + _ROUNDING)
    broken |= _exceeds(problem, time, states)
    if problem.jump is not None:
        broken |= _exceeds(problem, time, states + acting @ problem.jump.T)
    return np.asarray(broken)


def _exceeds(problem: ReachabilityProblem, time: int, states: Floats) -> Flags:
    """Return which states, (N,), break a constraint of a time."""
    normals, offsets = problem.further
    slack = _ROUNDING * (np.abs(normals) @ problem.state_bounds)
    beyond = (np.abs(states) > problem.state_bounds * (1.0 + _ROUNDING)).any(axis=1)
    return np.asarray(beyond | (states @ normals.T > offsets[time] + slack).any(axis=1))
