"""Figures of an encounter: trajectories (the figure of the paper), controls, the Pareto set and front, costs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.spatial import ConvexHull, QhullError

from experiments.common.display_units import length_unit
from experiments.common.figure_style import INK, LIMIT, LINE_LOOKS, SET_EDGE, SET_FILL, figure_grid, new_figure, style
from experiments.common.hill_axes import AXIS_TITLES, component_titles
from experiments.pareto.report import Report
from infoset.arrays import Floats
from rendezvous.pareto import (
    Coalitions,
    DurationSweep,
    EncounterSolution,
    distances,
    front_of_two,
    pareto_set,
    simplex_weights,
)

_PLANES = ((1, 0), (1, 2), (0, 2))
_POINTS = 241
_MARKS = 4
_MIN_WEIGHT = 1e-9
_SET_POINTS = 1200
_CHOICES = {
    "min_group_loss": ("*", "minimum group loss"),
    "min_sum_of_costs": ("P", "minimum sum of costs"),
    "minimax_excess": ("X", "minimax excess"),
    "preferred": ("h", "nearest to the preferred meeting"),
}
_MAX_NAMED = 8
_MEETING: dict[str, Any] = {"label": "meeting", "marker": "*", "markersize": 9.0, "color": INK, "linestyle": "none"}
_HOLLOW: dict[str, Any] = {"linestyle": "none", "color": "white", "markeredgecolor": INK}
_DOTTED: dict[str, Any] = {"color": LIMIT, "linestyle": (0, (2, 2))}
_COST = "m$^2$/s$^3$"


def _look(index: int) -> dict[str, Any]:
    return LINE_LOOKS[index % len(LINE_LOOKS)]


def _line(index: int) -> dict[str, Any]:
    return {**_look(index), "marker": "none"}


def _names(solution: EncounterSolution) -> list[str]:
    return [cost.craft.name for cost in solution.costs]


def draw_all(report: Report) -> Iterator[Figure]:
    """Draw the figures of a report, one after the other."""
    solution = report.solution
    yield draw_trajectories(solution)
    yield draw_controls(solution, report.problem.max_control_m_s2)
    yield draw_front(solution, report.selections, report.sweep)
    yield draw_costs(solution, report.coalitions, report.impulses_m_s)


@style()
def draw_trajectories(solution: EncounterSolution) -> Figure:
    """Draw the trajectories in space and in three planes."""
    figure, (corner, *planes) = figure_grid(150.0, 2, 2, (14.0, 4.0, 12.0, 6.0), (17.0, 15.0))
    # The labels of axes in space lie inside the drawing, which therefore gets more room.
    left, bottom, width, height = corner.get_position().bounds
    space: Any = figure.add_axes((left - 0.07, bottom - 0.05, width + 0.05, height + 0.05), projection="3d")
    corner.remove()
    paths = [solution.plan(index).sample(_POINTS).state[:, :3] for index in range(len(solution.costs))]
    unit, per_m = length_unit(max(float(np.abs(path).max()) for path in paths))
    marks: dict[str, Any] = {"markevery": (_POINTS - 1) // (_MARKS - 1), "markersize": 3.0}
    for index, (name, path) in enumerate(zip(_names(solution), paths, strict=True)):
        space.plot(*(path * per_m).T, **marks, **_look(index))
        for plane, axes in zip(planes, _PLANES, strict=True):
            plane.plot(*(path[:, axes] * per_m).T, label=name, **marks, **_look(index))
    meeting = solution.meeting_state()[:3] * per_m
    space.plot(*meeting[:, None], **_MEETING)
    for name, title, pad in zip("xyz", AXIS_TITLES, (-4.0, -3.0, -2.0), strict=True):
        getattr(space, f"set_{name}label")(f"{title}, {unit}", labelpad=pad)
    space.tick_params(pad=-2.0, labelsize=6.5)
    for axis in (space.xaxis, space.yaxis, space.zaxis):
        axis.set_major_locator(MaxNLocator(4))
    figure.text(0.012, 0.975, f"(a) in space; {_spacing(solution)}", fontsize=8.5)
    for plane, (first, second), letter in zip(planes, _PLANES, "bcd", strict=True):
        plane.plot(meeting[first], meeting[second], **_MEETING)
        plane.set(xlabel=f"{AXIS_TITLES[first]}, {unit}", ylabel=f"{AXIS_TITLES[second]}, {unit}")
        plane.set_title(f"({letter})", loc="left")
        plane.margins(0.08)
    if len(paths) <= _MAX_NAMED:
        planes[0].legend(loc="best")
    return figure


def _spacing(solution: EncounterSolution) -> str:
    """Return the time between the marks on the trajectories."""
    spans_s = [solution.encounter.meeting_s - cost.craft.start_s for cost in solution.costs]
    if np.ptp(spans_s) > 1e-9 * max(spans_s):
        return "marks at each third of the duration"
    return f"marks every {spans_s[0] / (_MARKS - 1):.4g} s"


@style()
def draw_controls(solution: EncounterSolution, bound_m_s2: float | None = None) -> Figure:
    """Draw the components and the magnitude of the controls against time, with the bound if there is one."""
    figure, panels = figure_grid(116.0, 2, 2, (16.0, 4.0, 11.0, 6.0), (18.0, 13.0))
    for index, name in enumerate(_names(solution)):
        samples = solution.plan(index).sample(_POINTS)
        for axis in range(3):
            panels[axis].plot(samples.time_s, samples.control_m_s2[:, axis], label=name, **_line(index))
        panels[3].plot(samples.time_s, np.linalg.norm(samples.control_m_s2, axis=1), **_line(index))
    if bound_m_s2 is not None:
        panels[3].axhline(bound_m_s2, linewidth=0.9, **_DOTTED)
        panels[3].annotate(
            "bound", (1.0, bound_m_s2), xycoords=("axes fraction", "data"), xytext=(-2, 2),
            textcoords="offset points", ha="right", color=LIMIT,
        )  # fmt: skip
    for panel, quantity, letter in zip(panels, (*component_titles("u"), "$|u|$"), "abcd", strict=True):
        panel.set_ylabel(f"{quantity}, m/s$^2$")
        panel.set_title(f"({letter})", loc="left")
        panel.margins(x=0.0)
    panels[3].set_ylim(bottom=0.0)
    for panel in panels[2:]:
        panel.set_xlabel("time, s")
    if len(solution.costs) <= _MAX_NAMED:
        panels[0].legend(loc="best")
    return figure


@style()
def draw_front(solution: EncounterSolution, selections: Mapping[str, Floats], sweep: DurationSweep) -> Figure:
    """Draw the Pareto set with the chosen meetings, the Pareto front, and costs against the duration."""
    figure, (left, middle, right) = figure_grid(78.0, 1, 3, (16.0, 3.0, 23.0, 6.0), (19.0, 0.0))
    sampled = pareto_set(solution, simplex_weights(len(solution.costs), _SET_POINTS))
    _draw_set(left, solution, sampled.points, selections)
    _draw_excesses(middle, solution, sampled.excess, selections)
    _draw_sweep(right, solution, sweep)
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="lower center", ncols=4, bbox_to_anchor=(0.5, 0.0))
    return figure


def _draw_set(axes: Axes, solution: EncounterSolution, points: Floats, selections: Mapping[str, Floats]) -> None:
    """Draw the set against the first two free components, or against the only one."""
    free = [component.name.lower() for component in solution.encounter.free]
    labels = [f"{name} of the meeting, {'m' if len(name) == 1 else 'm/s'}" for name in free]
    flat = len(free) == 1

    def position(point: Floats) -> tuple[float, float]:
        return float(point[0]), 0.0 if flat else float(point[1])

    positions = np.array([position(point) for point in points])
    if len(solution.costs) > 2 and not flat and (corners := _hull(solution)) is not None:
        axes.fill(corners[:, 0], corners[:, 1], facecolor=SET_FILL, edgecolor=SET_EDGE, linewidth=0.8, zorder=1)
    elif len(solution.costs) > 2 and not flat:
        axes.plot(*positions.T, linestyle="none", marker=".", markersize=2.0, color=SET_FILL, zorder=1)
    else:
        axes.plot(*positions[np.argsort(points[:, 0])].T, color=SET_EDGE, zorder=1)
    for index, cost in enumerate(solution.costs):
        name = f"ideal meeting of {cost.craft.name}" if len(solution.costs) <= _MAX_NAMED else None
        axes.plot(*position(cost.ideal), label=name, markersize=4.5, **{**_look(index), "linestyle": "none"})
    for choice, point in selections.items():
        marker, label = _CHOICES[choice]
        axes.plot(*position(point), marker=marker, markersize=7.0, label=label, zorder=5, **_HOLLOW)
    axes.set_xlabel(labels[0])
    if flat:
        axes.set_yticks([])
    else:
        axes.set_ylabel(labels[1])
    axes.set_title("(a) Pareto set", loc="left")
    axes.margins(0.1)


def _hull(solution: EncounterSolution) -> Floats | None:
    """Return the convex hull of the ideal meetings in the first two free components; None if it has no area."""
    if not solution.same_matrix:
        return None
    ideals = solution.ideals[:, :2]
    try:
        return np.asarray(ideals[ConvexHull(ideals).vertices])
    except QhullError:
        return None


def _draw_excesses(axes: Axes, solution: EncounterSolution, excess: Floats, selections: Mapping[str, Floats]) -> None:
    """Draw the front of two or three craft, the third as a colour, or the ranges of the excesses of other numbers."""
    names = _names(solution)
    chosen = {choice: solution.excess(point) for choice, point in selections.items()}
    axes.set_title("(b) Pareto front", loc="left")
    if len(names) not in (2, 3):
        columns = np.arange(len(names))
        axes.vlines(columns, excess.min(axis=0), excess.max(axis=0), color=SET_FILL, linewidth=4.0)
        for choice, values in chosen.items():
            axes.plot(columns, values, marker=_CHOICES[choice][0], markersize=6.0, **_HOLLOW)
        axes.set_xticks(columns, names, rotation=90)
        axes.set_ylabel(f"excess, {_COST}")
        return
    first, second = _widest_pair(excess)
    if len(names) == 3:
        third = 3 - first - second
        for edge in _edges(solution):
            axes.plot(edge[:, first], edge[:, second], color=LIMIT, linewidth=0.6, zorder=1)
        shade = axes.scatter(excess[:, first], excess[:, second], c=excess[:, third], s=4.0, cmap="cividis")
        left, bottom, width, height = axes.get_position().bounds
        axes.set_position((left, bottom, 0.86 * width, height))
        bar = axes.figure.colorbar(shade, cax=axes.inset_axes((1.04, 0.0, 0.05, 1.0)))
        bar.set_label(f"$e$ of {names[third]}, {_COST}", fontsize=7.0, labelpad=2.0)
        bar.ax.tick_params(labelsize=6.5, pad=1.0, length=2.0)
    elif solution.same_matrix:
        distance = float(distances(solution)[0, 1])
        along = np.linspace(0.0, distance**2, _POINTS)
        axes.plot(along, front_of_two(distance, along), color=SET_EDGE)
    else:
        axes.plot(excess[:, 0], excess[:, 1], color=SET_EDGE)
    for choice, values in chosen.items():
        axes.plot(values[first], values[second], marker=_CHOICES[choice][0], markersize=7.0, zorder=5, **_HOLLOW)
    axes.set(xlabel=f"excess $e$ of {names[first]}, {_COST}", ylabel=f"$e$ of {names[second]}, {_COST}")


def _edges(solution: EncounterSolution) -> list[Floats]:
    """Return the excesses where one of three craft has almost no weight: they bound the front."""
    share = np.linspace(0.0, 1.0, _POINTS)
    pairs = np.column_stack([share, 1.0 - share])
    weights = [np.clip(np.insert(pairs, without, 0.0, axis=1), _MIN_WEIGHT, None) for without in range(3)]
    return [np.asarray(pareto_set(solution, edge).excess) for edge in weights]


def _widest_pair(excess: Floats) -> tuple[int, int]:
    """Return the two craft whose excesses are least correlated: they show the front best."""
    if excess.shape[1] < 3:
        return 0, 1
    correlation = np.abs(np.corrcoef(excess.T))
    return min(((0, 1), (0, 2), (1, 2)), key=lambda pair: float(correlation[pair]))


def _draw_sweep(axes: Axes, solution: EncounterSolution, sweep: DurationSweep) -> None:
    for index, name in enumerate(_names(solution)):
        axes.plot(sweep.meeting_s, sweep.cost_squared[:, index], label=f"$J^2$ of {name}", **_line(index))
    axes.plot(sweep.meeting_s, sweep.group_loss, color=LIMIT, linewidth=2.0, label="group loss")
    meeting_s = solution.encounter.meeting_s
    axes.axvline(meeting_s, linewidth=0.7, **_DOTTED)
    axes.set_yscale("log")
    axes.set(
        xlabel=f"time of the meeting, s\n(dotted: {meeting_s:g} s, as in (a) and (b))",
        ylabel=f"$J^2$ and group loss, {_COST}",
    )
    axes.margins(x=0.0)
    if len(solution.costs) <= _MAX_NAMED:
        axes.legend(loc="best", fontsize=6.5)
    axes.set_title("(c) costs against time", loc="left")


@style()
def draw_costs(solution: EncounterSolution, coalitions: Coalitions | None, impulses_m_s: Sequence[float]) -> Figure:
    """Draw the costs of the meeting as bars and as a table."""
    count, names = len(solution.costs), _names(solution)
    table_mm = 5.0 * (count + 2)
    height_mm = 70.0 + table_mm
    figure = new_figure(height_mm=height_mm)
    bars = figure.add_axes((0.09, (table_mm + 8.0) / height_mm, 0.88, 1.0 - (table_mm + 13.0) / height_mm))
    columns, ideal, excess = np.arange(count), [cost.ideal_cost_squared for cost in solution.costs], solution.excess()
    bars.bar(columns, ideal, 0.55, color=SET_EDGE, label="cheapest meeting of the craft, $J^{*2}$")
    hatched: dict[str, Any] = {"color": SET_FILL, "edgecolor": SET_EDGE, "hatch": "///", "linewidth": 0.6}
    bars.bar(columns, excess, 0.55, bottom=ideal, label="excess of the common meeting", **hatched)
    bars.set_xticks(columns, names, rotation=0 if count <= _MAX_NAMED else 90)
    bars.set_ylabel(f"$J^2$, {_COST}")
    bars.grid(axis="x", visible=False)
    bars.legend(loc="best")
    table = figure.add_axes((0.03, 1.0 / height_mm, 0.94, table_mm / height_mm))
    table.axis("off")
    shares = transfers = ["\N{EN DASH}"] * count
    if coalitions is not None:
        shares = [f"{share:.5g}" for share in coalitions.shapley]
        transfers = [f"{transfer:+.5g}".replace("-", "\N{MINUS SIGN}") for transfer in coalitions.transfers]
    rows = [
        [name, f"{first:.6g}", f"{first + second:.6g}", f"{second:.6g}", f"{impulse:.5g}", *rest]
        for name, first, second, impulse, *rest in zip(
            names, ideal, excess, impulses_m_s, shares, transfers, strict=True
        )
    ]
    heads = [f"{head}, {_COST}" for head in ("$J^{*2}$", "$J^2$", "excess", "Shapley", "transfer")]
    heads = ["craft", *heads[:3], "impulse, m/s", *heads[3:]]
    drawn = table.table(cellText=rows, colLabels=heads, loc="center", cellLoc="center", edges="horizontal")
    drawn.auto_set_font_size(False)
    drawn.set_fontsize(7.5)
    for cell in drawn.get_celld().values():
        cell.set_linewidth(0.4)
    return figure
