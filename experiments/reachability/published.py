"""Numbers of Shorikov and Goranov (2021): rendezvous through reachable sets, tables 1 to 3."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from experiments.common.hill_axes import from_paper, to_paper
from experiments.common.printed_numbers import Ours, Progress, Reproduction, read_paper
from experiments.reachability.file import load_rendezvous
from experiments.reachability.printed_tables import (
    PAPER,
    PROBLEM,
    PrintedTable,
    TableComparison,
    compare_published,
    numbers_of,
)
from experiments.reachability.report import fly_members
from infoset.arrays import Floats
from rendezvous.reachability import NonlinearMotion, ReachabilityProblem, solve
from rendezvous.relative_motion import EllipticOrbit
from sim.storage.codec import fingerprint

PUBLISHED_RADIUS_M = 90e3
"""Radius of the orbit of the nonlinear columns: 9000 km, the radius at perigee, with two digits lost."""
_CONTROL_ROUNDING = 0.5e-4
_STATE_ROUNDING = np.array([0.05, 0.05, 0.05, 0.005, 0.005, 0.005])


def reproduce(progress: Progress) -> Reproduction:
    """Compute the numbers."""
    rendezvous = load_rendezvous(PROBLEM)
    problem, paper = rendezvous.problem, read_paper(PAPER)
    solution = solve(problem)
    progress(0.5)
    comparisons = compare_published(rendezvous, solution)
    first, second, third = comparisons
    shown = (first.ours.controls, _implied(problem, second.table), third.ours.controls)
    flown, names = flown_controls(problem, comparisons), [each.name for each in comparisons]
    own = fly_members(rendezvous, names, flown)
    other = fly_members(rendezvous, names, flown, published_motion(rendezvous.ellipse))
    states = np.tile(_state_rounding(problem).ravel(), 2)
    implied = _implied_rounding(problem).ravel()
    # Controls, linear and nonlinear states, and the norm.
    beyond = np.zeros((3, 61))
    beyond[1, :12], beyond[1:, 12:60] = implied, states
    ours = {}
    for name, controls, one, two, rounding in zip(names, shown, own, other, beyond, strict=True):
        pairs = zip(numbers_of(replace(one, controls=controls)), numbers_of(two), rounding, strict=True)
        ours[name] = [
            Ours(value, other=published if place >= 36 else None, beyond=float(added))
            for place, (value, published, added) in enumerate(pairs)
        ]
    progress(1.0)
    return Reproduction(paper, ((rendezvous.name, fingerprint(rendezvous)),), paper.compare(ours))


def published_motion(orbit: EllipticOrbit, radius_m: float = PUBLISHED_RADIUS_M) -> NonlinearMotion:
    """Return the motion of the nonlinear columns: about a circle of `radius_m`, with the rate of `orbit` at t = 0.

    Equation (1) with e = 0 and w^2 radius^3 in place of the gravitational parameter.
    """
    rate_rad_s = orbit.semi_latus_rate_rad_s * (1.0 + orbit.eccentricity * np.cos(orbit.true_anomaly_rad)) ** 2
    return NonlinearMotion(EllipticOrbit(float(rate_rad_s)), radius_m)


def flown_controls(problem: ReachabilityProblem, comparisons: Sequence[TableComparison]) -> Floats:
    """Return the controls to which the states of tables 1 to 3 belong, in Hill's axes, shape (3, 4, 3).

    Table 1: the control of minimum energy, which is an independent computation. Tables 2 and 3: the printed controls
    with corrections; controls of table 2 that its states contradict are those that the states imply.
    """
    first, second, third = comparisons
    implied = to_paper(_implied(problem, second.table))
    controls = np.where(second.table.contradicted, implied, second.table.controls)
    return np.array([first.ours.controls, from_paper(controls), third.printed.controls])


def _implied(problem: ReachabilityProblem, table: PrintedTable) -> Floats:
    """Return the controls that the linear states of a table imply, in Hill's axes, shape (4, 3)."""
    pairs = pairwise(from_paper(np.vstack([to_paper(problem.initial), table.linear])))
    return np.array([_inverse(problem) @ (after - problem.transition[0] @ before) for before, after in pairs])


def _inverse(problem: ReachabilityProblem) -> Floats:
    return np.asarray(np.linalg.pinv(problem.control[0] / problem.state_bounds[:, None]) / problem.state_bounds)


def _implied_rounding(problem: ReachabilityProblem) -> Floats:
    """Return the effect of the rounding of the states before and after a control on the control that they imply.

    The first state and the last one are known. In the paper's axes, shape (4, 3).
    """
    before, after = np.tile(np.abs(problem.transition[0]) @ _STATE_ROUNDING, (4, 1)), np.tile(_STATE_ROUNDING, (4, 1))
    before[0], after[-1] = 0.0, 0.0
    return np.abs(to_paper((before + after) @ np.abs(_inverse(problem)).T))


def _state_rounding(problem: ReachabilityProblem) -> Floats:
    """Return the effect of the rounding of the controls on the states, in the paper's axes, shape (4, 6)."""
    powers = [np.linalg.matrix_power(problem.transition[0], power) @ problem.control[0] for power in range(4)]
    return _CONTROL_ROUNDING * np.abs(to_paper(np.cumsum([np.abs(each).sum(axis=1) for each in powers], axis=0)))
