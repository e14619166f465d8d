"""Results of `infoset multipoint`: the path with its targets, JSON, CSV and a table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.hill_axes import AXES, AXIS_TITLES, INERTIAL_TITLES
from infoset.experiments.common.problem_command import trajectories_csv
from infoset.experiments.common.screen import Part, number_table
from infoset.experiments.common.units import Unit, time_unit
from infoset.experiments.multipoint.file import MultipointProblem
from infoset.rendezvous.multipoint import BestOrder, Grid, Path, Tour

_POINTS = 1601
"""Number of equally spaced times of a path; chosen for smooth curves."""
_ENOUGH_A_REVOLUTION = 20.0
"""Times of a grid in a revolution below which a note says that it is coarse.

With fewer times its lowest costs may be in other valleys than the minima. Chosen: the grid has 25
unless their number is limited. Within a revolution there is no note: a grid has at least 32 times.
"""


@dataclass(frozen=True)
class ImposedBound:
    """A bound on the control, m/s^2, that the minimum-energy control without it exceeds.

    `least_m_s2` is the smallest bound with which the visits are possible at the times without the
    bound; `cost_without` (m^2/s^3) and `peak_without_m_s2` belong to the path without it.
    """

    max_m_s2: float
    least_m_s2: float
    cost_without: float
    peak_without_m_s2: float


@dataclass(frozen=True, eq=False)
class MultipointReport:
    """Results of one command; `peak_m_s2` is the largest control. Axes are Hill's or inertial.

    There is no `imposed` bound if the problem has none, or the minimum-energy control without it
    keeps it.
    """

    problem: MultipointProblem
    order_chosen: Literal["given", "best"]
    times_chosen: Literal["given", "best"]
    best: BestOrder
    peak_m_s2: float
    imposed: ImposedBound | None = None

    @property
    def hill(self) -> bool:
        """Whether the axes are Hill's axes."""
        return self.problem.orbit_rate_rad_s is not None

    @property
    def path(self) -> Path:
        """The path of the chaser."""
        return self.best.path

    @property
    def names(self) -> list[str]:
        """Return the names of the targets in the order of the visits."""
        return [self.problem.tour.targets[target].name for target in self.best.order]

    @property
    def axis_titles(self) -> tuple[str, str, str]:
        """Return the titles of the axes."""
        return AXIS_TITLES if self.hill else INERTIAL_TITLES

    @property
    def axes_text(self) -> str:
        """Return the directions of the axes."""
        return AXES if self.hill else "inertial, those of the problem file"

    @property
    def end_s(self) -> float:
        """Return the time of the last visit."""
        return float(self.path.nodes.arrive_s[-1])

    @property
    def time_unit(self) -> Unit:
        """Return the unit in which times are shown."""
        return time_unit(self.end_s - self.problem.tour.start_s)

    @cached_property
    def times(self) -> Floats:
        """Return equally spaced times, and the times on both sides of each visit."""
        nodes = self.path.nodes
        even = np.linspace(self.problem.tour.start_s, self.end_s, _POINTS)
        before = np.nextafter(nodes.arrive_s, -np.inf)
        return np.unique(np.concatenate([even, nodes.arrive_s, before, nodes.leave_s[:-1]]))

    def target_path(self, visit: int, times_s: Floats) -> Floats:
        """Return the positions of the target of a visit, shape (n, 3)."""
        targets = np.full(len(times_s), self.best.order[visit])
        return np.asarray(self.problem.tour.target_states(targets, times_s)[:, :3])

    @property
    def notes(self) -> list[str]:
        """Return how the order and the times were chosen, and how sure it is that they are best."""
        notes = []
        if self.order_chosen == "best":
            notes.append(self._order_note())
        if self.imposed is not None:
            notes += self._bound_notes(self.imposed)
        search = self.best.time_search
        if search is None:
            return notes

        note = (
            f"the times are a local minimum, the lowest one found by {search.followed} descents "
            f"from the best of {search.starts} starting points"
        )
        if search.grid is not None:
            notes.append(f"{note} on a grid of {self._grid_text(search.grid)}")
            if self.revolutions > 1.0 and self.per_revolution(search.grid) < _ENOUGH_A_REVOLUTION:
                notes.append("the grid is coarse, and minima between its times can be lower")
            return notes

        notes.append(note)
        if self.revolutions > 1.0:
            notes.append(
                f"over {self.revolutions:.2g} revolutions there are many local minima, and others "
                "are often lower: compare the costs from different time_s"
            )
        return notes

    def _bound_notes(self, imposed: ImposedBound) -> list[str]:
        notes = [
            f"the bound of {imposed.max_m_s2:g} m/s^2 is imposed: without it the cost is "
            f"{imposed.cost_without:.8g} m^2/s^3 and the peak {imposed.peak_without_m_s2:.4g} "
            f"m/s^2; the smallest possible bound is {imposed.least_m_s2:.6g} m/s^2"
        ]
        if self.order_chosen == "best":
            notes.append("the order was chosen without the bound")
        if self.times_chosen == "best":
            notes.append("the best times without the bound were improved with it")
        return notes

    def _order_note(self) -> str:
        search = self.best.order_search
        if search is not None:
            return (
                f"all orders were compared on a grid of {self._grid_text(search.grid)}, and the "
                f"best {search.orders} searched again: the order is the best one found"
            )
        # Branch and bound of linear motion at given times leaves out no order.
        linear = isinstance(self.problem.tour, Tour)
        if linear and self.times_chosen == "given" and not self.best.lost:
            return "no order that fits the times costs less"
        return "the order is the best one found"

    def _grid_text(self, grid: Grid) -> str:
        return f"{grid.times} times, {self.per_revolution(grid):.2g} a revolution"

    @property
    def revolutions(self) -> float:
        """Return the number of revolutions until the latest time.

        They are revolutions of the reference orbit, or of a circular orbit through the start.
        """
        latest_s = self.problem.latest_s
        return self._revolutions_until(self.end_s if latest_s is None else latest_s)

    def per_revolution(self, grid: Grid) -> float:
        """Return the number of times of a grid in a revolution."""
        return grid.times / self._revolutions_until(grid.until_s)

    def _revolutions_until(self, time_s: float) -> float:
        """Return the revolutions from the start to a time; in inertial axes those of the circular
        orbit at the distance of the start.
        """
        problem = self.problem
        rate_rad_s = problem.orbit_rate_rad_s
        if rate_rad_s is None:
            assert problem.gravitational_parameter_m3_s2 is not None
            radius_m = float(np.linalg.norm(problem.tour.start_state[:3]))
            rate_rad_s = float(np.sqrt(problem.gravitational_parameter_m3_s2 / radius_m**3))
        return rate_rad_s * (time_s - problem.tour.start_s) / (2.0 * np.pi)


def report_json(report: MultipointReport) -> dict[str, object]:
    """Return the results for `infoset.experiments.common.output.to_json`."""
    path = report.path
    return {
        "units": f"m, s; axes: {report.axes_text}",
        "order_chosen": report.order_chosen,
        "times_chosen": report.times_chosen,
        "cost_m2_s3": path.cost,
        "cost_with_price_m2_s3": report.best.objective,
        "order": report.names,
        "times_s": path.nodes.arrive_s,
        "time_gradient_m2_s4": path.time_gradient,
        "nodes": [_node_json(report, index) for index in range(len(report.names))],
        "costate0": {
            "position_m_s3": path.costate_start[:3],
            "velocity_m_s2": path.costate_start[3:],
        },
        "peak_control_m_s2": report.peak_m_s2,
        "imposed_bound": _imposed_json(report.imposed),
        "evaluations": report.best.evaluations,
        "orders_begun": report.best.nodes,
        "orders_left_out": len(report.best.lost),
        "order_search": _order_search_json(report),
        "time_search": _time_search_json(report),
        "notes": report.notes,
    }


def _imposed_json(imposed: ImposedBound | None) -> dict[str, object] | None:
    if imposed is None:
        return None
    return {
        "max_control_m_s2": imposed.max_m_s2,
        "smallest_possible_m_s2": imposed.least_m_s2,
        "cost_without_m2_s3": imposed.cost_without,
        "peak_control_without_m_s2": imposed.peak_without_m_s2,
    }


def _order_search_json(report: MultipointReport) -> dict[str, object] | None:
    search = report.best.order_search
    if search is None:
        return None
    return {"grid": _grid_json(report, search.grid), "orders_searched_again": search.orders}


def _time_search_json(report: MultipointReport) -> dict[str, object] | None:
    search = report.best.time_search
    if search is None:
        return None
    return {
        "starts": search.starts,
        "followed": search.followed,
        "revolutions": report.revolutions,
        "grid": None if search.grid is None else _grid_json(report, search.grid),
    }


def _grid_json(report: MultipointReport, grid: Grid) -> dict[str, object]:
    return {
        "times": grid.times,
        "until_s": grid.until_s,
        "per_revolution": report.per_revolution(grid),
    }


def _node_json(report: MultipointReport, index: int) -> dict[str, object]:
    nodes = report.path.nodes
    jump = report.path.jumps[index]
    state = report.path.arrival_states[index]
    rendezvous = bool(nodes.rendezvous[index])
    values: dict[str, object] = {
        "name": report.names[index],
        "meet": "rendezvous" if rendezvous else "flyby",
        "position_m": state[:3],
        "velocity_m_s": state[3:],
        "target_velocity_m_s": nodes.arrive[index, 3:],
        "leave_s": nodes.leave_s[index],
        "jump_m_s3": jump[:3],
    }
    if rendezvous:
        values["velocity_jump_m_s2"] = jump[3:]
    return values


def trajectories(report: MultipointReport) -> str:
    """Return the trajectories of the chaser and the targets as CSV; targets have no control."""
    times = report.times
    none = np.full((len(times), 3), np.nan)
    tracks: list[tuple[list[str], list[Floats]]] = [
        (["chaser"], [times, report.path.state(times), report.path.control(times)])
    ]
    for index, target in enumerate(report.problem.tour.targets):
        states = report.problem.tour.target_states(np.full(len(times), index), times)
        tracks.append(([target.name], [times, states, none]))
    return trajectories_csv(["craft"], tracks)


def report_lines(report: MultipointReport) -> Iterator[Part]:
    """Yield the cost, the visits and the extent of the search, for the screen."""
    path = report.path
    nodes = report.path.nodes
    yield (
        f"{report.problem.name}: cost I = {path.cost:.8g} m^2/s^3, peak |u| {report.peak_m_s2:.4g} "
        "m/s^2"
    )
    yield f"axes: {report.axes_text}"
    if report.best.objective > path.cost:
        yield f"cost including the price of time = {report.best.objective:.8g} m^2/s^3"

    unit, per_s = report.time_unit
    table = number_table(
        "target",
        "meet",
        f"time\n{unit}",
        "relative speed\nm/s",
        "dI/dt\nm^2/s^4",
        "costate jump\nm/s^3",
        left=2,
    )
    relative = np.linalg.norm(path.arrival_states[:, 3:] - nodes.arrive[:, 3:], axis=1)
    for index, name in enumerate(report.names):
        rendezvous = bool(nodes.rendezvous[index])
        table.add_row(
            name,
            "rendezvous" if rendezvous else "flyby",
            f"{nodes.arrive_s[index] * per_s:.10g}",
            f"{0.0 if rendezvous else relative[index]:.5g}",
            f"{path.time_gradient[index]:.4g}",
            f"{np.linalg.norm(path.jumps[index, :3]):.4g}",
        )
    yield table

    if "best" not in (report.order_chosen, report.times_chosen):
        yield from report.notes
        return
    text = f"{report.best.evaluations} paths computed"
    if report.order_chosen == "best":
        if report.best.order_search is None:
            text += f", {report.best.nodes} partial orders examined"
        if report.best.lost:
            text += f", {len(report.best.lost)} left out because no trajectory was found"
    yield "; ".join([text, *report.notes])
