"""Barseghyan and Stepanyan (2008): the encounter of three craft.

Printed numbers, and those compared with them, are in the paper's axes; the problem and its solution are in Hill's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from experiments.common.hill_axes import from_paper, to_paper
from experiments.common.printed_numbers import Paper, PrintedNumber, Progress, Reproduction, last_digit, read_paper
from experiments.pareto.file import load_pareto
from infoset.arrays import Floats
from rendezvous.pareto import Encounter, EncounterSolution, Plan, solve_encounter
from rendezvous.relative_motion import ClohessyWiltshire
from sim.storage.codec import fingerprint

PAPER = "pareto"
PROBLEM = "pareto-2008"
RATE_RAD_S = 0.00117689
"""The rate used in the paper, printed below its controls; its text says 0.001176."""
_STARTS, _CONTROLS, _LAWS = "section 3, x(0), found from results", "u in section 3", "x(t) in section 3"
_IDENTIFYING = (_LAWS, "(3.1)", "table")
_DECIMALS = 1e-4
"""The last digit of the printed velocities."""
_STEPS = 2
_CRAFT = ("first", "second", "third")
_COMPONENTS = {"u_1": 0, "u_2": 1, "u_3": 2, "x_1": 0, "x_3": 1, "x_5": 2}
_TIMES_S = (10.0, 20.0, 30.0)


def reproduce(progress: Progress) -> Reproduction:
    """Compute the numbers."""
    problem, paper = load_pareto(PROBLEM), read_paper(PAPER)
    starts = _identified(problem.encounter, paper, progress)
    numbers = paper.compare({_STARTS: starts.ravel(), **_results(_solved(problem.encounter, starts), paper)})
    progress(1.0)
    return Reproduction(paper, ((problem.name, fingerprint(problem)),), numbers)


def _solved(encounter: Encounter, velocities: Floats) -> EncounterSolution:
    """Solve the encounter with the paper's rate and other start velocities, shape (3, 3), in the paper's axes."""
    motion = ClohessyWiltshire(RATE_RAD_S)
    craft = tuple(
        replace(member, motion=motion, state=np.concatenate([member.state[:3], velocity]))
        for member, velocity in zip(encounter.craft, from_paper(velocities), strict=True)
    )
    return solve_encounter(replace(encounter, craft=craft))


def _identified(encounter: Encounter, paper: Paper, progress: Progress) -> Floats:
    """Return the start velocities that the printed numbers follow from, by the Gauss-Newton method.

    Each number has the weight of its last digit. Laws and positions are linear in the velocities and (3.1) is nearly
    linear, so two steps suffice.
    """

    def misses(shift: Floats) -> Floats:
        ours = _results(_solved(encounter, printed + _DECIMALS * shift.reshape(3, 3)), paper)
        return np.array(
            [
                (value - number.value) / last_digit(number.printed)
                for source in _IDENTIFYING
                for number, value in zip(paper.tables[source], ours[source], strict=True)
                if number.corrected is None
            ]
        )

    printed = np.reshape([number.value for number in paper.tables[_STARTS]], (3, 3))
    shift = np.zeros(9)
    for step in range(_STEPS):
        at = misses(shift)
        slopes = []
        for column in range(9):
            slopes.append(misses(shift + np.eye(9)[column]) - at)
            progress((step + (column + 1) / 9) / _STEPS)
        shift = shift - np.linalg.lstsq(np.stack(slopes, axis=1), at, rcond=None)[0]
    return np.asarray(printed + _DECIMALS * shift.reshape(3, 3))


def _results(solution: EncounterSolution, paper: Paper) -> dict[str, Sequence[float]]:
    """Return our numbers of a solution by source."""
    # The problem frees x (beta) and z (alpha), in this order; (3.1) has alpha^2, alpha, beta^2, beta and 1.
    quadratics = []
    for cost in solution.costs:
        slope = -2.0 * cost.matrix @ cost.ideal
        rest = cost.ideal_cost_squared + float(cost.excess(np.zeros(2)))
        quadratics.append([cost.matrix[1, 1], slope[1], cost.matrix[0, 0], slope[0], rest])
    ideal = [cost.ideal_cost_squared for cost in solution.costs]
    norm = np.sum(quadratics, axis=0)
    norm[-1] -= sum(ideal)
    positions = [to_paper(solution.plan(craft).state(time_s))[:3] for time_s in _TIMES_S for craft in range(3)]
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
    """Return coefficients fitted over two orbits: in the 30 s of the flight the terms are nearly dependent.

    The name of a number is ``CRAFT, QUANTITY, TERM (SI)``.
    """
    times = np.linspace(0.0, 4.0 * np.pi / RATE_RAD_S, 200)
    found: list[float] = []
    for (craft, quantity), members in groupby(numbers, lambda number: number.name.split(", ")[:2]):
        basis = _basis([number.name.split(", ")[2].removesuffix(" (SI)") for number in members], times)
        sampled = Plan.control if quantity.startswith("u") else Plan.state
        values = to_paper(sampled(solution.plan(_CRAFT.index(craft)), times))[:, _COMPONENTS[quantity]]
        size = np.abs(basis).max(axis=0)
        found += (np.linalg.lstsq(basis / size, values, rcond=None)[0] / size).tolist()
    return found


def _basis(terms: Sequence[str], times: Floats) -> Floats:
    """Return the terms of the paper's controls and laws of motion, shape (times, terms)."""
    angle = RATE_RAD_S * times
    known = {
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
    return np.stack([known[term] for term in terms], axis=1)
