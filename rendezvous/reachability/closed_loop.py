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
"""A function (period, true state, control) that returns the true state one period later."""
Observer = Callable[[int, Floats], Floats]
"""A function (period, true state) that returns the estimated state."""

_MORE = 1.001
"""Factor of a relaxation above the smallest sufficient one, which could fail by rounding. Chosen:
0.1 % of a relaxation is not noticed."""
_MIN_RELAXATION = 1e-9
"""Minimum increase of a relaxation, as a fraction of the bounds: the violation of a constraint that
is accepted (`conic.MAX_VIOLATION`)."""
_MAX_RELAXATION = 1e3
"""Maximum relaxation, as a fraction of the bounds: at a state a thousand bounds away the simulation
has failed."""


@dataclass(frozen=True, eq=False)
class ClosedLoopFlight:
    """Simulation in closed loop.

    `states`, shape (T + 1, n), are the true states, and `controls`, shape (T, m), the controls
    applied. `expected_misses`, shape (T,), are the minimum terminal norms of the plans, in the
    units of the states. `relaxations`, shape (T,), are the fractions by which constraints on states
    were relaxed for each plan, mostly 0.
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
    """Simulate a problem in closed loop.

    Every period applies the first control of the optimal plan of minimum energy from the estimated
    state. `observe` is None for exact estimates. If a plan cannot reach zero, for example in the
    last period, it minimises the norm of the states in the units of the problem, or divided by
    their bounds if `relative`.

    A simulation solves T optima and T quadratic programs. If no control satisfies the constraints
    from a state, all constraints on states are relaxed by the minimum sufficient fraction.
    """
    states = [problem.initial]
    controls = []
    misses = []
    relaxations = []
    for t in range(problem.periods):
        state = states[-1]
        estimated = state if observe is None else observe(t, state)
        optimal, relaxation = _plan(problem, t, estimated, relative)
        control = minimum_energy(optimal)[0]
        states.append(truth(t, state, control))
        controls.append(control)
        misses.append(optimal.miss)
        relaxations.append(relaxation)

    return ClosedLoopFlight(
        np.vstack(states), np.array(controls), np.array(misses), np.array(relaxations)
    )


def relaxed(problem: ReachabilityProblem, fraction: float) -> ReachabilityProblem:
    """Return a problem with all constraints on states relaxed by a fraction of the bounds."""
    offsets = problem.offsets
    if offsets is not None:
        offsets = offsets + fraction * _sizes(problem)
    return replace(problem, state_bounds=problem.state_bounds * (1.0 + fraction), offsets=offsets)


def _sizes(problem: ReachabilityProblem) -> Floats:
    """Sizes of the further constraints, in which they are relaxed."""
    return np.asarray(np.linalg.norm(problem.further[0] * problem.state_bounds, axis=1))


def _plan(
    problem: ReachabilityProblem, start: int, estimated: Floats, relative: bool
) -> tuple[OptimalControls, float]:
    """Return the optimal controls from a period on, and the relaxation that they needed."""
    fraction = 0.0
    while True:
        wider = relaxed(problem, fraction) if fraction else problem
        try:
            return optimal_controls(wider.rest(start, estimated), relative=relative), fraction
        except InadmissibleStartError:
            needed = _relaxation_for_start(problem, start, estimated)
            # Doubled, so that the search ends where rounding makes `needed` too small.
            fraction = max(2.0 * fraction, needed * _MORE, _MIN_RELAXATION)
        except EmptyTubeError as error:
            # The error's relaxation is a part of the bounds that were relaxed already.
            fraction = (fraction + error.relaxation * (1.0 + fraction)) * _MORE + _MIN_RELAXATION

        if fraction > _MAX_RELAXATION:
            raise ArithmeticError(
                f"no plan from period {start}: the state is far outside the constraints"
            )


def _relaxation_for_start(problem: ReachabilityProblem, start: int, estimated: Floats) -> float:
    """Return the smallest relaxation with which an estimated state is admissible, to rounding."""
    normals, offsets = problem.further
    beyond_bounds = float((np.abs(estimated) / problem.state_bounds).max()) - 1.0
    excess = (normals @ estimated - offsets[start]) / _sizes(problem)
    return max(beyond_bounds, float(excess.max(initial=-np.inf)))
