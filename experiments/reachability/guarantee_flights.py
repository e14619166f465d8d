"""Simulated flights of a rendezvous with bounded errors, about a central body if it asks for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.reachability.command import Reach
from infoset.experiments.reachability.file import Rendezvous
from infoset.rendezvous.reachability import (
    IMPULSE,
    AffinePlan,
    Move,
    PlanFlights,
    ReachabilityProblem,
    ReplannedFlights,
    ReplannedPlan,
    fly_plan,
    fly_replanned,
    linear_motion,
)

FLIGHTS = 100
"""Number of simulated flights without the option --flights; chosen."""
REPLANNED_FLIGHTS = 10
"""Number of flights with --replan without the option --flights: one of six states takes about ten
seconds."""


def affine_flights(rendezvous: Rendezvous, plan: AffinePlan, options: Reach) -> PlanFlights:
    """Return flights of an affine plan."""
    count = FLIGHTS if options.flights is None else options.flights
    problem = flown_problem(rendezvous)
    move = motion_of_flights(rendezvous)
    return fly_plan(problem, plan, rendezvous.errors, count, options.seed, move)


def replanned_flights(
    rendezvous: Rendezvous,
    before: ReplannedPlan,
    options: Reach,
    progress: Callable[[float], None],
) -> ReplannedFlights:
    """Return flights that are planned again after each measurement."""
    count = REPLANNED_FLIGHTS if options.flights is None else options.flights
    problem = flown_problem(rendezvous)
    move = motion_of_flights(rendezvous)
    return fly_replanned(problem, before, rendezvous.errors, count, options.seed, move, progress)


def flown_problem(rendezvous: Rendezvous) -> ReachabilityProblem:
    """Return the problem with the instants of each coast at which its constraints are checked."""
    if rendezvous.path_limits is None:
        return rendezvous.problem
    return replace(rendezvous.problem, between=rendezvous.instants)


def motion_of_flights(rendezvous: Rendezvous) -> Move:
    """Return the motion by the matrices of the problem, or integrated about a central body."""
    problem = flown_problem(rendezvous)
    if not rendezvous.nonlinear:
        return linear_motion(problem, rendezvous.errors)
    acceleration_m_s2 = np.zeros(3)
    if rendezvous.disturbance is not None:
        acceleration_m_s2 = np.array(rendezvous.disturbance.acceleration_m_s2)
    # The instants within a period at which constraints are checked, and its end.
    parts = 1 if problem.between is None else problem.between.shape[1] + 1
    since_start_s = rendezvous.period_s * np.arange(1, parts + 1) / parts

    def move(time: int, states: Floats, acting: Floats, pushes: Floats) -> Floats:
        start_s = rendezvous.period_s * time
        held_m_s2 = np.zeros((len(states), 3))
        if rendezvous.disturbance is not None:
            held_m_s2 = pushes * acceleration_m_s2
        return rendezvous.truth.paths(
            start_s, states + acting @ IMPULSE.T, held_m_s2, start_s + since_start_s
        )

    return move
