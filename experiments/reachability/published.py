"""Numbers of Shorikov and Goranov (2021): rendezvous through reachable sets, tables 1 to 3.

A table has u(t), t = 0..3, the linear and nonlinear x(t), t = 1..4, and the nonlinear norm of x(4).
All are in the paper's axes; problems, controls and states are in Hill's.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from infoset.arrays import Flags, Floats
from infoset.experiments.common.hill_axes import from_paper, to_paper
from infoset.experiments.common.input_file import read_file
from infoset.experiments.common.printed_numbers import Ours, PrintedNumber, Progress, read_paper
from infoset.experiments.reachability.file import Rendezvous
from infoset.experiments.reachability.report import ChosenControl
from infoset.experiments.reachability.run import fly_members
from infoset.rendezvous.reachability import (
    NonlinearMotion,
    ReachabilityProblem,
    minimum_energy,
    nearest,
    solve,
)
from infoset.rendezvous.relative_motion import EllipticOrbit

PROBLEM = "rendezvous-2021"
PUBLISHED_RADIUS_M = 90e3
"""Radius of the orbit of the nonlinear columns.

It is 9000 km, the radius at perigee, with two digits lost.
"""
_U = slice(0, 12)
"""Numbers of a table that are controls, 4 rows of 3."""
_LINEAR = slice(12, 36)
"""Numbers of a table that are states of the linear model, 4 rows of 6."""
_NONLINEAR = slice(36, 60)
"""Numbers of a table that are states of the nonlinear model, 4 rows of 6."""
_CONTROL_ROUNDING = 0.5e-4
"""Half a unit of the last printed digit of a control."""
_STATE_ROUNDING = np.array([0.05, 0.05, 0.05, 0.005, 0.005, 0.005])
"""Half a unit of the last printed digit of each component of a state."""


class PrintedTable(NamedTuple):
    """A table of the paper, with misprints corrected.

    The controls have shape (4, 3), and the linear states have shape (4, 6). `contradicted`, shape
    (4, 3), are the controls that the states contradict. They stay as printed; the states imply
    values near zero (`_implied`). The `nonlinear` states, shape (4, 6), are as printed.
    """

    numbers: tuple[PrintedNumber, ...]
    contradicted: Flags
    controls: Floats
    linear: Floats
    nonlinear: Floats


@cache
def printed_tables() -> tuple[PrintedTable, ...]:
    """Return tables 1 to 3.

    A control with the correction 0.0000 is `contradicted`: this is how the file marks it.
    """
    tables = []
    for numbers in read_paper("reachability").tables.values():
        printed = np.array([number.value for number in numbers])
        corrected = np.array([float(number.corrected or number.printed) for number in numbers])
        contradicted = (corrected == 0.0) & (printed != 0.0)
        controls = np.where(contradicted, printed, corrected)[_U]
        tables.append(
            PrintedTable(
                numbers,
                contradicted[_U].reshape(4, 3),
                controls.reshape(4, 3),
                corrected[_LINEAR].reshape(4, 6),
                printed[_NONLINEAR].reshape(4, 6),
            )
        )
    return tuple(tables)


def compute(progress: Progress) -> dict[str, Sequence[Ours]]:
    """Compute the numbers by source."""
    rendezvous = read_file(Rendezvous, PROBLEM)
    problem = rendezvous.problem
    tables = printed_tables()
    optimal = solve(problem).optimal
    progress(0.5)
    energy = minimum_energy(optimal)
    implied = _implied(problem, tables[1])
    shown = (energy, implied, nearest(optimal, from_paper(tables[2].controls)))
    flown = flown_controls(rendezvous, energy)
    own = fly_members(rendezvous, list(read_paper("reachability").tables), flown)
    other = fly_members(
        rendezvous, [each.name for each in own], flown, published_motion(rendezvous.ellipse)
    )
    # Added to the tolerance: the rounding of the printed numbers from which ours follow.
    # The 60 numbers of the slices, and the norm.
    beyond = np.zeros((3, 61))
    beyond[1, _U] = _implied_rounding(problem).ravel()
    beyond[1:, 12:60] = np.tile(_state_rounding(problem).ravel(), 2)
    return {
        one.name: [
            Ours(value, other=published if place >= _NONLINEAR.start else None, beyond=float(added))
            for place, (value, published, added) in enumerate(
                zip(_numbers(one, controls), _numbers(two, controls), rounding, strict=True)
            )
        ]
        for controls, one, two, rounding in zip(shown, own, other, beyond, strict=True)
    }


def _numbers(member: ChosenControl, controls: Floats) -> list[float]:
    """Return controls and the states of a member in the order of a table."""
    parts = (controls, member.linear[1:], member.nonlinear[1:])
    return [
        *np.concatenate([to_paper(part).ravel() for part in parts]).tolist(),
        member.nonlinear_miss,
    ]


def published_motion(orbit: EllipticOrbit, radius_m: float = PUBLISHED_RADIUS_M) -> NonlinearMotion:
    """Return the motion of the nonlinear columns: about a circle of `radius_m`.

    Its rate is the rate of `orbit` at t = 0. Equation (1) with e = 0 and w^2 radius^3 in place of
    the gravitational parameter.
    """
    rate_rad_s = (
        orbit.semi_latus_rate_rad_s
        * (1.0 + orbit.eccentricity * np.cos(orbit.true_anomaly_rad)) ** 2
    )
    return NonlinearMotion(EllipticOrbit(float(rate_rad_s)), radius_m)


def flown_controls(rendezvous: Rendezvous, energy: Floats) -> Floats:
    """Return the controls of the states in tables 1 to 3, in Hill's axes, shape (3, 4, 3).

    Table 1: the control of minimum energy, `energy`, which is an independent computation. Tables 2
    and 3: the printed controls with corrections; controls of table 2 that its states contradict are
    those that the states imply.
    """
    _, second, third = printed_tables()
    implied = to_paper(_implied(rendezvous.problem, second))
    controls = np.where(second.contradicted, implied, second.controls)
    return np.array([energy, from_paper(controls), from_paper(third.controls)])


def _implied(problem: ReachabilityProblem, table: PrintedTable) -> Floats:
    """Return the controls that the linear states of a table imply, in Hill's axes, shape (4, 3)."""
    pairs = pairwise(from_paper(np.vstack([to_paper(problem.initial), table.linear])))
    return np.array(
        [_inverse(problem) @ (after - problem.transition[0] @ before) for before, after in pairs]
    )


def _inverse(problem: ReachabilityProblem) -> Floats:
    return np.asarray(
        np.linalg.pinv(problem.control[0] / problem.state_bounds[:, None]) / problem.state_bounds
    )


def _implied_rounding(problem: ReachabilityProblem) -> Floats:
    """Return the effect of rounded states on the control that they imply.

    The states are the ones before and after the control. The first state and the last one are
    known. In the paper's axes, shape (4, 3).
    """
    before = np.tile(np.abs(problem.transition[0]) @ _STATE_ROUNDING, (4, 1))
    after = np.tile(_STATE_ROUNDING, (4, 1))
    before[0], after[-1] = 0.0, 0.0
    return np.abs(to_paper((before + after) @ np.abs(_inverse(problem)).T))


def _state_rounding(problem: ReachabilityProblem) -> Floats:
    """Return the effect of rounded controls on the states, in the paper's axes, shape (4, 6)."""
    powers = [
        np.linalg.matrix_power(problem.transition[0], power) @ problem.control[0]
        for power in range(4)
    ]
    return _CONTROL_ROUNDING * np.abs(
        to_paper(np.cumsum([np.abs(each).sum(axis=1) for each in powers], axis=0))
    )
