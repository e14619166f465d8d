"""Replanning: every period the rest of the problem is solved anew from where the craft truly is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rendezvous.reachability.blocks import split
from rendezvous.reachability.optimal_controls import OptimalControls
from rendezvous.reachability.optimum import EmptyTubeError, block_optimum
from rendezvous.reachability.problem import InadmissibleStartError, ReachabilityProblem
from rendezvous.reachability.selection import minimum_energy

Floats = NDArray[np.float64]

Truth = Callable[[int, Floats, Floats], Floats]
"""Takes a period, the true state and the control, and returns the true state a period later."""
Observer = Callable[[int, Floats], Floats]
"""Takes a period and the true state, and returns the one that is believed."""

_MORE = 1.001
_LEAST_RELAXATION = 1e-9
_MOST_RELAXATION = 1e3


@dataclass(frozen=True, eq=False)
class Flight:
    """A flight in closed loop.

    Parameters
    ----------
    states : ndarray, shape (T + 1, n)
        True ones.
    controls : ndarray, shape (T, m)
        Those applied.
    expected_misses : ndarray, shape (T,)
        The least terminal norm that each plan expected, in the units of the states.
    relaxations : ndarray, shape (T,)
        By which fraction all constraints on states had to be relaxed to have a plan; 0 where they held.
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
    problem: ReachabilityProblem, truth: Truth, observe: Observer | None = None, *, relative: bool = False
) -> Flight:
    """Fly a problem with a new plan every period: of all optimal controls the one of least energy.

    Parameters
    ----------
    problem : ReachabilityProblem
        The model that plans are made with.
    truth : callable
    observe : callable or None
        None sees the true state.
    relative : bool
        Whether plans that cannot reach zero, as those of the last period, minimise the norm of states divided by their
        bounds, and not in the units of the problem.

    Returns
    -------
    Flight

    Notes
    -----
    T optima and as many quadratic programs. A state from which no control keeps the constraints gets a plan with all
    of them relaxed alike, by as little as helps.
    """
    state = problem.initial
    states, controls, misses, relaxations = [state], [], [], []
    for t in range(problem.periods):
        believed = state if observe is None else observe(t, state)
        optimal, relaxation = _plan(problem, t, believed, relative)
        control = minimum_energy(optimal)[0]
        state = truth(t, state, control)
        states.append(state)
        controls.append(control)
        misses.append(optimal.miss)
        relaxations.append(relaxation)
    return Flight(np.array(states), np.array(controls), np.array(misses), np.array(relaxations))


def relaxed(problem: ReachabilityProblem, fraction: float) -> ReachabilityProblem:
    """Return a problem with every constraint on states relaxed.

    Parameters
    ----------
    problem : ReachabilityProblem
    fraction : float
        Of the bounds on states.

    Returns
    -------
    ReachabilityProblem
    """
    offsets = problem.offsets
    if problem.normals is not None and offsets is not None:
        offsets = offsets + fraction * np.linalg.norm(problem.normals * problem.state_bounds, axis=1)
    return replace(problem, state_bounds=problem.state_bounds * (1.0 + fraction), offsets=offsets)


def _plan(problem: ReachabilityProblem, start: int, believed: Floats, relative: bool) -> tuple[OptimalControls, float]:
    fraction = 0.0
    while True:
        wider = relaxed(problem, fraction) if fraction else problem
        try:
            rest = wider.rest(start, believed)
            return OptimalControls(
                rest, tuple(block_optimum(each, relative=relative) for each in split(rest))
            ), fraction
        except InadmissibleStartError as error:
            sizes = [*problem.state_bounds]
            if problem.normals is not None:
                sizes += [*np.linalg.norm(problem.normals * problem.state_bounds, axis=1)]
            missing = max(excess for _, excess in error.broken) / min(sizes)
            fraction = max(2.0 * fraction, min(missing, _worst(problem, start, believed)) * _MORE, _LEAST_RELAXATION)
        except EmptyTubeError as error:
            fraction = (fraction + error.relaxation * (1.0 + fraction)) * _MORE + _LEAST_RELAXATION
        if fraction > _MOST_RELAXATION:
            raise ArithmeticError(f"no plan from period {start}: the state is far outside every constraint")


def _worst(problem: ReachabilityProblem, time: int, state: Floats) -> float:
    """By which fraction constraints must be relaxed to hold a state."""
    worst = float((np.abs(state) / problem.state_bounds).max()) - 1.0
    if problem.normals is not None and problem.offsets is not None:
        sizes = np.linalg.norm(problem.normals * problem.state_bounds, axis=1)
        worst = max(worst, float(((problem.normals @ state - problem.offsets[time]) / sizes).max()))
    return worst
