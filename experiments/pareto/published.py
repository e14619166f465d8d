"""Barseghyan and Stepanyan (2008): the encounter of three craft.

Printed numbers, and those compared with them, are in the paper's axes; the problem and its solution
are in Hill's.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import to_paper
from infoset.experiments.common.input_file import read_file
from infoset.experiments.common.printed_numbers import Paper, PrintedNumber, Progress, read_paper
from infoset.experiments.pareto.file import ParetoProblem
from infoset.rendezvous.pareto import EncounterSolution, Plan, solve_encounter
from infoset.rendezvous.relative_motion import ClohessyWiltshire

PROBLEM = "pareto-2008"
STARTS = "section 3, x(0), found from results"
"""Its settings are the rate and the start velocities from which the printed numbers follow."""
_CONTROLS, _LAWS = "u in section 3", "x(t) in section 3"
_CRAFT = ("first", "second", "third")
_COMPONENTS = {"u_1": 0, "u_2": 1, "u_3": 2, "x_1": 0, "x_3": 1, "x_5": 2}
_TIMES_S = (10.0, 20.0, 30.0)
"""Times of the printed positions."""


def compute(_progress: Progress) -> dict[str, Sequence[float]]:
    """Compute the numbers by source."""
    paper = read_paper("pareto")
    encounter = read_file(ParetoProblem, PROBLEM, paper.options[STARTS]["settings"]).encounter
    starts = np.array([to_paper(craft.state[3:]) for craft in encounter.craft])
    return {STARTS: starts.ravel().tolist(), **results(solve_encounter(encounter), paper)}


def results(solution: EncounterSolution, paper: Paper) -> dict[str, Sequence[float]]:
    """Return our numbers of a solution by source."""
    # The problem frees x (beta) and z (alpha), in this order; (3.1) has alpha^2, alpha, beta^2,
    # beta and 1.
    quadratics = []
    for cost in solution.costs:
        slope = -2.0 * cost.matrix @ cost.ideal
        rest = cost.ideal_cost_squared + float(cost.excess(np.zeros(2)))
        quadratics.append([cost.matrix[1, 1], slope[1], cost.matrix[0, 0], slope[0], rest])
    ideal = [cost.ideal_cost_squared for cost in solution.costs]
    norm = np.sum(quadratics, axis=0)
    norm[-1] -= sum(ideal)
    positions = [
        to_paper(solution.plan(craft).state(time_s))[:3]
        for time_s in _TIMES_S
        for craft in range(3)
    ]
    return {
        "(3.1)": np.ravel(quadratics).tolist(),
        "(3.2)": norm.tolist(),
        "section 3, J*": ideal,
        "section 3": solution.point[::-1].tolist(),
        "section 3, J": solution.cost_squared().tolist(),
        _CONTROLS: _fitted(solution, paper.tables[_CONTROLS]),
        _LAWS: _fitted(solution, paper.tables[_LAWS]),
        "table": np.ravel(positions).tolist(),
    }


def _fitted(solution: EncounterSolution, numbers: Sequence[PrintedNumber]) -> list[float]:
    """Return coefficients of the paper's controls and laws of motion, fitted to ours at 200 times.

    The times are from 0 to two orbits, beyond the flight: in its 30 s the terms are nearly
    dependent, and their coefficients have no digits. The name of a number is ``CRAFT, QUANTITY,
    TERM``.
    """
    # All craft have one motion. The number of times, chosen, is far above that of the terms.
    motion = solution.encounter.craft[0].motion
    assert isinstance(motion, ClohessyWiltshire)
    times = np.linspace(0.0, 4.0 * np.pi / motion.rate_rad_s, 200)
    known = _terms(times, motion.rate_rad_s)
    found: list[float] = []
    for (craft, quantity), members in groupby(numbers, lambda number: number.name.split(", ")[:2]):
        basis = np.stack([known[number.name.split(", ")[2]] for number in members], axis=1)
        sampled = Plan.control if quantity.startswith("u") else Plan.state
        vectors = to_paper(sampled(solution.plan(_CRAFT.index(craft)), times))
        values = vectors[:, _COMPONENTS[quantity]]
        size = np.abs(basis).max(axis=0)
        found += (np.linalg.lstsq(basis / size, values, rcond=None)[0] / size).tolist()
    return found


def _terms(times: Floats, rate_rad_s: float) -> dict[str, Floats]:
    """Return the terms of the paper's controls and laws of motion, each of shape (times,)."""
    angle = rate_rad_s * times
    return {
        "1": np.ones_like(times),
        "t": times,
        "t^2": times**2,
        "t^3": times**3,
        "cos": np.cos(angle),
        "sin": np.sin(angle),
        "t cos": times * np.cos(angle),
        "t sin": times * np.sin(angle),
        "sin^2 half": np.sin(angle / 2.0) ** 2,
    }
