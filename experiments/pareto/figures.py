"""Figures of an encounter: trajectories (as in the paper), controls, Pareto set and front.

Heights of figures, mm, and sizes of lines, marks and letters are chosen by eye.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull, QhullError

from infoset.arrays import Floats
from infoset.experiments.common.figure_style import (
    BOUND,
    EVENT,
    INK,
    LIMIT,
    LINE_LOOKS,
    SET,
    SET_EDGE,
    SET_FILL,
    label_axes,
    legend_below,
    letters,
    new_figure,
    style,
    subplots,
)
from infoset.experiments.common.hill_axes import AXIS_TITLES, component_titles
from infoset.experiments.common.units import length_unit
from infoset.experiments.pareto.report import CHOICES, ParetoReport
from infoset.rendezvous.bounded_control import BoundedFlight
from infoset.rendezvous.pareto import (
    BoundedEncounter,
    EncounterSolution,
    Plan,
    pareto_set,
    simplex_weights,
)

_VIEWS: tuple[tuple[int, ...], ...] = ((1, 0), (0, 1, 2), (1, 2), (0, 2))
"""Axes of the panels: three planes, and space in the second one."""
_POINTS = 241
"""Number of times of a curve: a multiple of three, and one, for marks at thirds of the time."""
_MARKS = 4
"""Number of marks on a trajectory: at the ends and at each third of the time."""
_SET_POINTS = 1200
"""Number of points of a Pareto set; chosen: they cover the set at the size of the figure."""
_MARKERS = {"min_group_loss": "*", "min_sum_of_costs": "P", "minimax_excess": "X", "preferred": "h"}
_MEETING: dict[str, Any] = {
    "label": "meeting",
    "marker": "*",
    "markersize": 9.0,
    "color": INK,
    "linestyle": "none",
}
_HOLLOW: dict[str, Any] = {
    "linestyle": "none",
    "color": "white",
    "markeredgecolor": INK,
    "zorder": 5,
}
_COST = "m$^2$/s$^3$"


def _look(index: int, **more: Any) -> dict[str, Any]:
    return {**LINE_LOOKS[index % len(LINE_LOOKS)], **more}


def _names(solution: EncounterSolution) -> list[str]:
    return [cost.craft.name for cost in solution.costs]


def draw_all(report: ParetoReport) -> Iterator[Figure]:
    """Draw the figures of a report, one after the other."""
    bounded = None if report.imposed is None else report.imposed.encounter
    yield draw_trajectories(report.solution, bounded)
    yield draw_controls(report)
    yield draw_front(report)


@style()
def draw_trajectories(
    solution: EncounterSolution, bounded: BoundedEncounter | None = None
) -> Figure:
    """Draw the trajectories to the meeting in space and in three planes.

    They are those of minimum group loss without a bound on the control, or the `bounded` ones.
    """
    figure = new_figure(150.0)
    panels = figure.subplot_mosaic("ab;cd", per_subplot_kw={"b": {"projection": "3d"}})

    point: Floats
    flights: tuple[Plan | BoundedFlight, ...]
    if bounded is None:
        point = solution.point
        flights = solution.plans()
    else:
        point = bounded.point
        flights = bounded.flights

    paths = [flight.state(flight.times(_POINTS))[:, :3] for flight in flights]
    unit, per_m = length_unit(max(float(np.abs(path).max()) for path in paths))
    meeting = solution.meeting_state(point)[:3] * per_m
    titles = [f"{title}, {unit}" for title in AXIS_TITLES]
    for panel, axes in zip(panels.values(), _VIEWS, strict=True):
        for index, (name, path) in enumerate(zip(_names(solution), paths, strict=True)):
            line = _look(index, label=name, markevery=(_POINTS - 1) // (_MARKS - 1), markersize=3.0)
            panel.plot(*(path[:, axes] * per_m).T, **line)
        panel.plot(*meeting[list(axes)][:, None], **_MEETING)
        label_axes(panel, [titles[axis] for axis in axes])
    space: Any = panels["b"]
    space.set_box_aspect(None, zoom=0.9)
    letters([*panels.values()], ["marks at each third of the time"])
    legend_below(figure, 4)
    return figure


@style()
def draw_controls(report: ParetoReport) -> Figure:
    """Draw the components and the magnitude of the controls against time, with a bound."""
    figure, grid = subplots(120.0, 2, 2, sharex=True)
    panels = [*grid.flat]
    for index, (name, flight) in enumerate(
        zip(_names(report.solution), report.flights, strict=True)
    ):
        times = flight.times(_POINTS)
        control = flight.control(times)
        for axes, values in zip(panels, (*control.T, np.linalg.norm(control, axis=1)), strict=True):
            axes.plot(times, values, **_look(index, marker="none", label=name))
    bound_m_s2 = report.problem.max_control_m_s2
    if bound_m_s2 is not None:
        panels[3].axhline(bound_m_s2, label="bound of the control", **BOUND)
    for axes, quantity in zip(panels, (*component_titles("u"), "$|u|$"), strict=True):
        axes.set_ylabel(f"{quantity}, m/s$^2$")
        axes.margins(x=0.0)
    panels[3].set_ylim(bottom=0.0)
    for axes in grid[1]:
        axes.set_xlabel("time, s")
    letters(panels)
    legend_below(figure, 4)
    return figure


@style()
def draw_front(report: ParetoReport) -> Figure:
    """Draw the Pareto set with the chosen meetings, the front, and costs against the duration."""
    figure, (panels,) = subplots(105.0, 1, 3)
    solution = report.solution
    selections = report.selections
    points = pareto_set(solution, simplex_weights(len(solution.costs), _SET_POINTS))
    _draw_set(panels[0], solution, points, selections)
    _draw_excesses(panels[1], solution, solution.excess(points), selections)
    _draw_sweep(panels[2], report)
    letters(panels, ["Pareto set", "Pareto front", "costs against time"])
    legend_below(figure, 3)
    return figure


def _draw_set(
    axes: Axes, solution: EncounterSolution, points: Floats, selections: Mapping[str, Floats]
) -> None:
    """Draw the set against the first two free components, or against the only one."""
    # Names of positions have one letter, those of velocities two.
    free = [component.name.lower() for component in solution.encounter.free]
    labels = [f"{name} of the meeting, {'m' if len(name) == 1 else 'm/s'}" for name in free]
    flat = len(free) == 1  # the set is a line

    def position(point: Floats) -> tuple[float, float]:
        return float(point[0]), 0.0 if flat else float(point[1])

    # An area as a polygon or, with different M, as points; that of two craft is a curve.
    positions = np.array([position(point) for point in points])
    if len(solution.costs) > 2 and not flat and (corners := _hull(solution)) is not None:
        axes.fill(corners[:, 0], corners[:, 1], zorder=1, **SET)
    elif len(solution.costs) > 2 and not flat:
        axes.plot(
            *positions.T, linestyle="none", marker=".", markersize=2.0, color=SET_FILL, zorder=1
        )
    else:
        axes.plot(*positions[np.argsort(points[:, 0])].T, color=SET_EDGE, zorder=1)
    for index, cost in enumerate(solution.costs):
        ideal = _look(
            index, linestyle="none", markersize=4.5, label=f"ideal meeting of {cost.craft.name}"
        )
        axes.plot(*position(cost.ideal), **ideal)
    for choice, point in selections.items():
        marker = _MARKERS[choice]
        label = CHOICES[choice]
        axes.plot(*position(point), marker=marker, markersize=7.0, label=label, **_HOLLOW)
    label_axes(axes, [labels[0], "" if flat else labels[1]])
    if flat:
        axes.set_yticks([])


def _hull(solution: EncounterSolution) -> Floats | None:
    """Return the convex hull of the ideal meetings in the first two free components.

    It is None if it has no area, or if the craft have different M: the Pareto set is not the hull.
    """
    if not solution.same_matrix:
        return None
    ideals = solution.ideals[:, :2]
    try:
        return np.asarray(ideals[ConvexHull(ideals).vertices])
    except QhullError:
        return None


def _draw_excesses(
    axes: Axes, solution: EncounterSolution, excess: Floats, selections: Mapping[str, Floats]
) -> None:
    """Draw the front of two craft, or of three: the two least correlated excesses as axes, and the
    third as a colour.

    For other numbers of craft, draw the ranges of the excesses.
    """
    names = _names(solution)
    chosen = {choice: solution.excess(point) for choice, point in selections.items()}
    if len(names) not in (2, 3):
        columns = np.arange(len(names))
        axes.vlines(columns, excess.min(axis=0), excess.max(axis=0), color=SET_FILL, linewidth=4.0)
        for choice, values in chosen.items():
            axes.plot(columns, values, marker=_MARKERS[choice], markersize=6.0, **_HOLLOW)
        axes.set_xticks(columns, names, rotation=90)
        axes.set_ylabel(f"excess, {_COST}")
        return
    shown = _least_correlated_pair(excess)
    if len(names) == 3:
        (third,) = {0, 1, 2} - set(shown)
        shade = axes.scatter(
            excess[:, shown[0]], excess[:, shown[1]], c=excess[:, third], s=4.0, cmap="cividis"
        )
        axes.figure.colorbar(
            shade, ax=axes, location="top", label=f"$e$ of {names[third]}, {_COST}"
        )
    else:
        axes.plot(*excess[:, list(shown)].T, color=SET_EDGE)
    for choice, values in chosen.items():
        axes.plot(*values[list(shown)], marker=_MARKERS[choice], markersize=7.0, **_HOLLOW)
    label_axes(
        axes, [f"excess $e$ of {name}, {_COST}" for name in (names[index] for index in shown)]
    )


def _least_correlated_pair(excess: Floats) -> tuple[int, int]:
    """Return the two craft of two or three whose excesses are least correlated, in their order.

    Over a strongly correlated pair the front would look like a line.
    """
    pairs = list(combinations(range(excess.shape[1]), 2))
    correlation = np.abs(np.corrcoef(excess.T))
    return min(pairs, key=lambda pair: float(correlation[pair]))


def _draw_sweep(axes: Axes, report: ParetoReport) -> None:
    times_s = [solution.encounter.meeting_s for solution in report.sweep]
    costs = np.array([solution.cost_squared() for solution in report.sweep])
    for index, name in enumerate(_names(report.solution)):
        axes.plot(times_s, costs[:, index], **_look(index, marker="none", label=f"$J^2$ of {name}"))
    losses = [solution.group_loss() for solution in report.sweep]
    axes.plot(times_s, losses, color=LIMIT, linewidth=2.0, label="group loss")
    axes.axvline(
        report.solution.encounter.meeting_s, label="time of the meeting in (a) and (b)", **EVENT
    )
    axes.set(yscale="log", xlabel="time of the meeting, s", ylabel=f"$J^2$ and group loss, {_COST}")
    axes.margins(x=0.0)
