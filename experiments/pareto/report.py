"""Results of `infoset pareto`, as JSON and as tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import AXES
from infoset.experiments.common.problem_command import trajectories_csv
from infoset.experiments.common.screen import Part, number, number_table
from infoset.experiments.pareto.file import TERMINAL, ParetoProblem
from infoset.rendezvous.bounded_control import BoundedFlight
from infoset.rendezvous.pareto import (
    BoundedEncounter,
    Coalitions,
    EncounterSolution,
    Plan,
    distances,
    peak_control,
    total_impulse,
)

SAMPLES = 31
"""Number of times in a trajectory of the CSV file, chosen: about one in 3 % of the flight."""
CHOICES = {
    "min_group_loss": "minimum group loss",
    "min_sum_of_costs": "minimum sum of costs",
    "minimax_excess": "minimax excess",
    "preferred": "nearest to the preferred meeting",
}
"""Names in print of the rules of `ParetoReport.selections`."""
_ZERO = 1e-9
"""Part of the largest component of a meeting below which components are printed as zero.

They are rounding errors of the minimisation, and far below the six digits that are printed.
"""


@dataclass(frozen=True, eq=False)
class ImposedBound:
    """The meeting with a bound on the control that a minimum-energy control without it exceeds.

    `least_m_s2` is the smallest bound with which any meeting is possible, and `peaks_without_m_s2`
    are the maximum controls to the meeting without the bound.
    """

    encounter: BoundedEncounter
    least_m_s2: float
    peaks_without_m_s2: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class ParetoReport:
    """Results of one command.

    `solution`, `selections`, `coalitions` and `sweep` do not depend on a bound on the control; the
    meeting, its costs and its flights do. `selections` are Pareto-optimal meetings, shape (f,), by
    the rule of their choice. There are no `coalitions` if there are too many craft, and there is no
    `imposed` bound if the problem has none, or it changes nothing. `sweep` has other times of the
    meeting.
    """

    problem: ParetoProblem
    solution: EncounterSolution
    selections: Mapping[str, Floats]
    coalitions: Coalitions | None
    imposed: ImposedBound | None
    sweep: tuple[EncounterSolution, ...]

    @cached_property
    def point(self) -> Floats:
        """Free values of the meeting, shape (f,)."""
        return self.solution.point if self.imposed is None else self.imposed.encounter.point

    @cached_property
    def flights(self) -> tuple[Plan | BoundedFlight, ...]:
        """Flights of the craft to the meeting."""
        if self.imposed is not None:
            return self.imposed.encounter.flights
        return self.solution.plans()

    @cached_property
    def cost_squared(self) -> Floats:
        """J_i^2 of the flights, m^2/s^3, shape (n,)."""
        if self.imposed is None:
            return self.solution.cost_squared()
        return self.imposed.encounter.cost_squared

    @cached_property
    def excess(self) -> Floats:
        """J_i^2 - J_i*^2 of the flights, m^2/s^3, shape (n,); J_i* is the cost without a bound."""
        if self.imposed is None:
            return self.solution.excess()
        ideal = [cost.ideal_cost_squared for cost in self.solution.costs]
        return np.asarray(self.imposed.encounter.cost_squared - ideal)

    @cached_property
    def group_loss(self) -> float:
        """Weighted sum of the excesses, m^2/s^3."""
        return float(self.excess @ self.solution.encounter.weights)

    @cached_property
    def peaks_m_s2(self) -> tuple[float, ...]:
        """Maximum |u| of the flights."""
        return tuple(peak_control(flight) for flight in self.flights)

    @cached_property
    def impulses_m_s(self) -> tuple[float, ...]:
        """Total impulse of the flights."""
        return tuple(total_impulse(flight) for flight in self.flights)


def report_json(report: ParetoReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`."""
    solution = report.solution
    encounter = report.problem.encounter
    same_matrix = solution.same_matrix
    values: dict[str, object] = {
        "units": {
            "axes": AXES,
            "costate_at_meeting": "m/s^3 of the position's three, m/s^2 of the velocity's",
            "matrix": "m^2/s^3 over the units of two free components",
            "distances": "m/s^1.5",
        },
        "meeting_time_s": encounter.meeting_s,
        "meet": encounter.meeting,
        "free": [component.name.lower() for component in encounter.free],
        "meeting": _named_state(solution, report.point),
        "craft": [_craft_json(report, index) for index in range(len(solution.costs))],
        "group_loss_m2_s3": report.group_loss,
        "imposed_bound": _imposed_json(report),
        # One matrix if all craft have the same.
        "matrix": [cost.matrix for cost in solution.costs[: 1 if same_matrix else None]],
    }
    if same_matrix:
        values["distances"] = distances(solution)
    values["selections"] = {
        name: {
            "meeting": _named_state(solution, point),
            "cost_squared_m2_s3": solution.cost_squared(point),
            "excess_m2_s3": solution.excess(point),
            "group_loss_m2_s3": solution.group_loss(point),
        }
        for name, point in report.selections.items()
    }
    values |= _coalitions_json(report.coalitions, [cost.craft.name for cost in solution.costs])
    values["sweep"] = {
        "meeting_time_s": [other.encounter.meeting_s for other in report.sweep],
        "group_loss_m2_s3": [other.group_loss() for other in report.sweep],
        "cost_squared_m2_s3": [other.cost_squared() for other in report.sweep],
        "ideal_cost_squared_m2_s3": [
            [cost.ideal_cost_squared for cost in other.costs] for other in report.sweep
        ],
    }
    return values


def _named_state(solution: EncounterSolution, point: Floats) -> dict[str, float]:
    """Return the common components of a meeting by name; of an intercept, only the position."""
    return dict(
        zip(
            TERMINAL.values(),
            solution.meeting_state(point)[: solution.encounter.common],
            strict=False,
        )
    )


def _craft_json(report: ParetoReport, index: int) -> dict[str, object]:
    solution = report.solution
    cost = solution.costs[index]
    return {
        "name": cost.craft.name,
        "weight": cost.craft.weight,
        "ideal": _named_state(solution, cost.ideal),
        "ideal_cost_squared_m2_s3": cost.ideal_cost_squared,
        "cost_squared_m2_s3": report.cost_squared[index],
        "excess_m2_s3": report.excess[index],
        "impulse_m_s": report.impulses_m_s[index],
        "peak_control_m_s2": report.peaks_m_s2[index],
        "costate_at_meeting": report.flights[index].costate,
    }


def _imposed_json(report: ParetoReport) -> dict[str, object] | None:
    imposed = report.imposed
    solution = report.solution
    if imposed is None:
        return None
    return {
        "max_control_m_s2": imposed.encounter.max_m_s2,
        "smallest_possible_m_s2": imposed.least_m_s2,
        "without": {
            "meeting": _named_state(solution, solution.point),
            "cost_squared_m2_s3": solution.cost_squared(),
            "peak_control_m_s2": imposed.peaks_without_m_s2,
            "group_loss_m2_s3": solution.group_loss(),
        },
    }


def _coalitions_json(coalitions: Coalitions | None, names: list[str]) -> dict[str, object]:
    """Return the keys of the coalitions; an empty table if there are too many craft for them."""
    if coalitions is None:
        return {"coalitions": {}}
    return {
        "coalitions": {
            "+".join(names[member] for member in coalition.members): {
                "excess_m2_s3": coalition.excess,
                "regret_m2_s3": coalition.regret,
            }
            for coalition in coalitions.coalitions
        },
        "shapley_m2_s3": coalitions.shapley,
        "transfers_m2_s3": coalitions.transfers,
        "core": {"verdict": coalitions.core, "reason": coalitions.core.reason},
    }


def trajectories(report: ParetoReport) -> str:
    """Return the trajectories as CSV."""
    tracks = [
        ([cost.craft.name], [times, flight.state(times), flight.control(times)])
        for cost, flight in zip(report.solution.costs, report.flights, strict=True)
        for times in [flight.times(SAMPLES)]
    ]
    return trajectories_csv(["craft"], tracks)


def imposed_text(report: ParetoReport, imposed: ImposedBound) -> str:
    """Return a text about the changes by the bound, and the results that do not depend on it."""
    peak = max(imposed.peaks_without_m_s2)
    bound = imposed.encounter.max_m_s2
    return (
        f"the bound of {bound:g} m/s^2 is imposed: without it the controls reach {peak:.4g} m/s^2, "
        f"and the group loss is {float(report.solution.group_loss()):.6g} in place of "
        f"{report.group_loss:.6g} m^2/s^3; the smallest possible bound is {imposed.least_m_s2:.6g} "
        "m/s^2. Ideals, choices, coalitions and other meeting times are without the bound"
    )


def report_lines(report: ParetoReport) -> Iterator[Part]:
    """Yield the meeting, the costs, the choices and the coalitions, for the screen."""
    solution = report.solution
    encounter = report.problem.encounter
    names = [cost.craft.name for cost in solution.costs]
    meeting = ", ".join(
        f"{key} = {value:.6g}" for key, value in _named_state(solution, report.point).items()
    )
    kind = encounter.meeting.value
    yield f"{report.problem.name}: {kind} at {encounter.meeting_s:g} s: {meeting}"
    yield f"axes: {AXES}"

    table = number_table(
        "craft",
        "ideal J*^2\nm^2/s^3",
        "J^2\nm^2/s^3",
        "excess\nm^2/s^3",
        "impulse\nm/s",
        "peak |u|\nm/s^2",
    )
    ideal = [cost.ideal_cost_squared for cost in solution.costs]
    columns = (ideal, report.cost_squared, report.excess, report.impulses_m_s, report.peaks_m_s2)
    for name, *row in zip(names, *columns, strict=True):
        table.add_row(name, *(number(float(value)) for value in row))
    yield table
    if report.imposed is not None:
        yield imposed_text(report, report.imposed)

    # Names of positions have one letter, those of velocities two.
    free = [component.name.lower() for component in encounter.free]
    titles = [f"{name}, {'m' if len(name) == 1 else 'm/s'}" for name in free]
    chosen = number_table("choice", *titles, "group loss\nm^2/s^3")
    scale = max(float(abs(point).max()) for point in report.selections.values())
    for rule, point in report.selections.items():
        values = (f"{value if abs(value) > _ZERO * scale else 0.0:.6g}" for value in point)
        chosen.add_row(CHOICES[rule], *values, number(float(solution.group_loss(point))))
    yield from ("", chosen)

    if report.coalitions is None:
        yield "the coalitions are not computed: there are too many craft"
        return
    pairs = zip(names, report.coalitions.shapley, strict=True)
    shares = ", ".join(f"{name} {number(float(value))}" for name, value in pairs)
    yield f"Shapley value of the excess, m^2/s^3: {shares}"
    yield report.coalitions.core.reason
