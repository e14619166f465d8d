"""Closed loop: in every period the remaining problem is solved again from the estimated state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from infoset.rendezvous._arrays import Floats
from infoset.rendezvous.reachability.optimum import EmptyTubeError
from infoset.rendezvous.reachability.problem import InadmissibleStartError, ReachabilityProblem
from infoset.rendezvous.reachability.selection import minimum_energy
from infoset.rendezvous.reachability.solve import OptimalControls, optimal_controls

Truth = Callable[[int, Floats, Floats], Floats]
"""A function of the period, the true state and the control that returns the true state one period
later.
"""
Observer = Callable[[int, Floats], Floats]
"""A function of the period and the true state that returns the estimated state."""

_MORE = 1.001
_MIN_RELAXATION = 1e-9
_MAX_RELAXATION = 1e3


@dataclass(frozen=True, eq=False)
class ClosedLoopFlight:
    """Simulation in closed loop: true states, shape (T + 1, n), and the controls applied, shape (T,
    m).

    `expected_misses`, shape (T,), are the minimum terminal norms of the plans, in the units of the
    states. `relaxations`, shape (T,), are the fractions by which constraints on states were relaxed
    for each plan; otherwise 0.
    """

    states: Floats
    controls: Floats
    expected_misses: Floats
    relaxations: Floats

    @property
    def miss(self) -> float:
        """The terminal norm."""
        return float(np.linalg.norm(self.states[-1]))


def replan(
    problem: ReachabilityProblem,
    truth: Truth,
    observe: Observer | None = None,
    *,
    relative: bool = False,
) -> ClosedLoopFlight:
    """Simulate a problem in closed loop: in every period apply the first control of the optimal
    plan of minimum energy.

    `truth` returns the true state one period later from the period, the true state and the control;
    `observe` returns the estimated state from the period and the true state, and is None for exact
    estimates. If a plan cannot reach zero, for example in the last period, it minimises the norm of
    the states in the units of the problem, or divided by their bounds if `relative`.

    T optima and T quadratic programs. If no control satisfies the constraints from a state, all of
    them are relaxed by the minimum sufficient fraction.
    """
    state = problem.initial
    steps = []
    for t in range(problem.periods):
        estimated = state if observe is None else observe(t, state)
        optimal, relaxation = _plan(problem, t, estimated, relative)
        control = minimum_energy(optimal)[0]
        state = truth(t, state, control)
        steps.append((state, control, optimal.miss, relaxation))
    states, controls, misses, relaxations = (
        np.array(column) for column in zip(*steps, strict=True)
    )
    return ClosedLoopFlight(np.vstack([problem.initial, states]), controls, misses, relaxations)


def relaxed(problem: ReachabilityProblem, fraction: float) -> ReachabilityProblem:
    """Return a problem with every constraint on states relaxed by a fraction of the bounds on
    states.
    """
    offsets = None if problem.offsets is None else problem.offsets + fraction * _sizes(problem)
    return replace(problem, state_bounds=problem.state_bounds * (1.0 + fraction), offsets=offsets)


def _sizes(problem: ReachabilityProblem) -> Floats:
    return np.asarray(np.linalg.norm(problem.further[0] * problem.state_bounds, axis=1))


def _plan(
    problem: ReachabilityProblem, start: int, estimated: Floats, relative: bool
) -> tuple[OptimalControls, float]:
    fraction = 0.0
    while True:
        wider = relaxed(problem, fraction) if fraction else problem
        try:
            return optimal_controls(wider.rest(start, estimated), relative=relative), fraction
        except InadmissibleStartError as error:
            missing = max(excess for _, excess in error.broken) / min(
                [*problem.state_bounds, *_sizes(problem)]
            )
            normals, offsets = problem.further
            beyond = ((normals @ estimated - offsets[start]) / _sizes(problem)).max(initial=-np.inf)
            worst = max(
                float((np.abs(estimated) / problem.state_bounds).max()) - 1.0, float(beyond)
            )
            fraction = max(2.0 * fraction, min(missing, worst) * _MORE, _MIN_RELAXATION)
        except EmptyTubeError as error:
            fraction = (fraction + error.relaxation * (1.0 + fraction)) * _MORE + _MIN_RELAXATION
        if fraction > _MAX_RELAXATION:
            raise ArithmeticError(
                f"no plan from period {start}: the state is far outside the constraints"
            )
