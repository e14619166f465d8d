"""The encounter of several craft: trajectories (the paper's figure), controls, the Pareto set and front, costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from experiments.common.display_units import length_unit
from experiments.common.figure_style import INK, LIMIT, SET_EDGE, SET_FILL, new_figure, place_axes, style
from rendezvous.pareto import (
    Coalitions,
    DurationSweep,
    EncounterSolution,
    distances,
    front_of_two,
    pareto_set,
    simplex_weights,
)

Floats = NDArray[np.float64]

LOOKS: tuple[dict[str, Any], ...] = (
    {"color": "#08306b", "linestyle": "-", "marker": "o"},
    {"color": "#e6842a", "linestyle": (0, (5, 1.5)), "marker": "s"},
    {"color": "#7f2704", "linestyle": (0, (1.2, 1.0)), "marker": "^"},
    {"color": "#5a9bd4", "linestyle": (0, (5, 1, 1, 1)), "marker": "D"},
    {"color": "#4d4d4d", "linestyle": (0, (3, 1, 1, 1, 1, 1)), "marker": "v"},
)
_AXES = ("x (against the motion)", "y (outward)", "z (normal)")
_PLANES = ((0, 1), (0, 2), (1, 2))
_POINTS = 241
_MARKS = 4
_LEAST_WEIGHT = 1e-9
_SET_POINTS = 1200
_CHOICES = {
    "least_group_loss": ("*", "least group loss"),
    "least_sum_of_costs": ("P", "least sum of costs"),
    "least_greatest_excess": ("X", "least greatest excess"),
    "preferred": ("h", "nearest to the preferred"),
}
_MOST_NAMED = 8


def draw_trajectories(solution: EncounterSolution) -> Figure:
    """Draw the flights in space and in the three planes.

    Parameters
    ----------
    solution : EncounterSolution

    Returns
    -------
    Figure
        A drawing in space and three planes.
    """
    with style():
        figure = new_figure(height_mm=150.0)
        axes = place_axes(figure, 2, 2, margins_mm=(14.0, 4.0, 12.0, 6.0), gaps_mm=(17.0, 15.0))
        space: Any = figure.add_axes(_grown(axes[0][0].get_position().bounds), projection="3d")
        axes[0][0].remove()
        flights = [solution.plan(index).sample(_POINTS).state[:, :3] for index in range(len(solution.costs))]
        unit, per_m = length_unit(max(float(np.abs(flight).max()) for flight in flights))
        flights, meeting = [flight * per_m for flight in flights], solution.meeting_state()[:3] * per_m
        planes = (axes[0][1], axes[1][0], axes[1][1])
        for index, flight in enumerate(flights):
            look, every = _look(index), (_POINTS - 1) // (_MARKS - 1)
            label = solution.costs[index].craft.name
            space.plot(*flight.T, markevery=every, markersize=3.0, **look)
            for plane, (first, second) in zip(planes, _PLANES, strict=True):
                plane.plot(flight[:, first], flight[:, second], markevery=every, markersize=3.0, label=label, **look)
        space.plot(
            *([value] for value in meeting),
            label="the meeting",
            marker="*",
            markersize=9.0,
            color=INK,
            linestyle="none",
        )
        space.set_xlabel(f"x, {unit}", labelpad=-4.0)
        space.set_ylabel(f"y, {unit}", labelpad=-3.0)
        space.set_zlabel(f"z, {unit}", labelpad=-2.0)
        space.tick_params(pad=-2.0, labelsize=6.5)
        for axis in (space.xaxis, space.yaxis, space.zaxis):
            axis.set_major_locator(MaxNLocator(4))
        figure.text(0.012, 0.975, f"(a) in space; {_marks(solution)}", fontsize=8.5)
        for plane, (first, second), letter in zip(planes, _PLANES, "bcd", strict=True):
            plane.plot(meeting[first], meeting[second], marker="*", markersize=9.0, color=INK, linestyle="none",
                       label="the meeting")  # fmt: skip
            plane.set_xlabel(f"{_AXES[first]}, {unit}")
            plane.set_ylabel(f"{_AXES[second]}, {unit}")
            plane.set_title(f"({letter})", loc="left")
            plane.margins(0.08)
        if len(flights) <= _MOST_NAMED:
            planes[0].legend(loc="best")
    return figure


def draw_controls(solution: EncounterSolution, bound_m_s2: float | None = None) -> Figure:
    """Draw the controls' components and sizes against time.

    Parameters
    ----------
    solution : EncounterSolution
    bound_m_s2 : float or None
        A bound on their size.

    Returns
    -------
    Figure
        Four axes.
    """
    with style():
        figure = new_figure(height_mm=116.0)
        axes = place_axes(figure, 2, 2, margins_mm=(16.0, 4.0, 11.0, 6.0), gaps_mm=(18.0, 13.0))
        panels = [*axes[0], *axes[1]]
        for index, cost in enumerate(solution.costs):
            samples = solution.plan(index).sample(_POINTS)
            look = {**_look(index), "marker": "none"}
            for axis in range(3):
                panels[axis].plot(samples.time_s, samples.control_m_s2[:, axis], label=cost.craft.name, **look)
            panels[3].plot(samples.time_s, np.linalg.norm(samples.control_m_s2, axis=1), **look)
        if bound_m_s2 is not None:
            panels[3].axhline(bound_m_s2, color=LIMIT, linewidth=0.9, linestyle=(0, (2, 2)))
            panels[3].annotate(
                "bound", (1.0, bound_m_s2), xycoords=("axes fraction", "data"), xytext=(-2, 2),
                textcoords="offset points", ha="right", color=LIMIT,
            )  # fmt: skip
        names = ("$u_x$, m/s$^2$", "$u_y$, m/s$^2$", "$u_z$, m/s$^2$", "$|u|$, m/s$^2$")
        for panel, name, letter in zip(panels, names, "abcd", strict=True):
            panel.set_ylabel(name)
            panel.set_title(f"({letter})", loc="left")
            panel.margins(x=0.0)
        panels[3].set_ylim(bottom=0.0)
        for panel in axes[1]:
            panel.set_xlabel("time, s")
        if len(solution.costs) <= _MOST_NAMED:
            panels[0].legend(loc="best")
    return figure


def draw_front(solution: EncounterSolution, selections: Mapping[str, Floats], sweep: DurationSweep) -> Figure:
    """Draw the Pareto set with the choices in it, the front of the excesses, and costs against the duration.

    Parameters
    ----------
    solution : EncounterSolution
    selections : mapping of str to ndarray, shape (f,)
        Meetings chosen in several ways.
    sweep : DurationSweep

    Returns
    -------
    Figure
        Three axes.
    """
    with style():
        figure = new_figure(height_mm=78.0)
        ((left, middle, right),) = place_axes(figure, 1, 3, margins_mm=(16.0, 3.0, 23.0, 6.0), gaps_mm=(19.0, 0.0))
        sampled = pareto_set(solution, simplex_weights(len(solution.costs), _SET_POINTS))
        _draw_set(left, solution, sampled.points, selections)
        _draw_excesses(middle, solution, sampled.excess, selections)
        _draw_sweep(right, solution, sweep)
        handles, labels = left.get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=4, bbox_to_anchor=(0.5, 0.0))
    return figure


def draw_costs(solution: EncounterSolution, coalitions: Coalitions | None, impulses_m_s: Sequence[float]) -> Figure:
    """Draw what the meeting costs each craft, as bars and as a table.

    Parameters
    ----------
    solution : EncounterSolution
    coalitions : Coalitions or None
        For the Shapley values.
    impulses_m_s : sequence of float
        Total impulses of the craft.

    Returns
    -------
    Figure
        Bars, and a table below.
    """
    count = len(solution.costs)
    with style():
        figure = new_figure(height_mm=70.0 + 5.0 * (count + 2))
        height = figure.get_figheight() * 25.4
        below = 5.0 * (count + 2)
        bars = figure.add_axes((0.09, (below + 8.0) / height, 0.88, 1.0 - (below + 13.0) / height))
        places = np.arange(count)
        ideal = np.array([each.ideal_cost_squared for each in solution.costs])
        excess, names = solution.excess(), [each.craft.name for each in solution.costs]
        bars.bar(places, ideal, 0.55, color=SET_EDGE, label="its own cheapest meeting, $J^{*2}$")
        bars.bar(
            places, excess, 0.55, bottom=ideal, color=SET_FILL, edgecolor=SET_EDGE, hatch="///", linewidth=0.6,
            label="excess of the common one",
        )  # fmt: skip
        bars.set_xticks(places, names, rotation=0 if count <= _MOST_NAMED else 90)
        bars.set_ylabel("$J^2$, m$^2$/s$^3$")
        bars.grid(axis="x", visible=False)
        bars.legend(loc="best")
        table = figure.add_axes((0.03, 1.0 / height, 0.94, below / height))
        table.axis("off")
        shares = ["\N{EN DASH}"] * count if coalitions is None else [f"{each:.5g}" for each in coalitions.shapley]
        owed = (
            ["\N{EN DASH}"] * count
            if coalitions is None
            else [f"{each:+.5g}".replace("-", "\N{MINUS SIGN}") for each in coalitions.transfers]
        )
        rows = [
            [names[each], f"{ideal[each]:.6g}", f"{ideal[each] + excess[each]:.6g}", f"{excess[each]:.6g}",
             f"{impulses_m_s[each]:.5g}", shares[each], owed[each]]
            for each in range(count)
        ]  # fmt: skip
        heads = ["craft", "$J^{*2}$, m$^2$/s$^3$", "$J^2$, m$^2$/s$^3$", "excess, m$^2$/s$^3$", "impulse, m/s",
                 "Shapley, m$^2$/s$^3$", "owed, m$^2$/s$^3$"]  # fmt: skip
        drawn = table.table(cellText=rows, colLabels=heads, loc="center", cellLoc="center", edges="horizontal")
        drawn.auto_set_font_size(False)
        drawn.set_fontsize(7.5)
        for cell in drawn.get_celld().values():
            cell.set_linewidth(0.4)
    return figure


def _look(index: int) -> dict[str, Any]:
    return dict(LOOKS[index % len(LOOKS)])


def _grown(bounds: Sequence[float]) -> tuple[float, float, float, float]:
    """Give a drawing in space more room, for its axes stand inside."""
    left, bottom, width, height = bounds
    return left - 0.07, bottom - 0.05, width + 0.05, height + 0.05


def _draw_set(axes: Axes, solution: EncounterSolution, points: Floats, selections: Mapping[str, Floats]) -> None:
    """The set in the plane of the first two free components; against the first alone where there is one."""
    free = [each.name.lower() for each in solution.encounter.free]
    units = ["m" if name in ("x", "y", "z") else "m/s" for name in free]
    flat = len(free) == 1
    second = np.zeros(len(points)) if flat else points[:, 1]
    if len(solution.costs) > 2 and not flat and (corners := _hull(solution)) is not None:
        axes.fill(corners[:, 0], corners[:, 1], facecolor=SET_FILL, edgecolor=SET_EDGE, linewidth=0.8, zorder=1)
    elif len(solution.costs) > 2 and not flat:
        axes.plot(points[:, 0], second, linestyle="none", marker=".", markersize=2.0, color=SET_FILL, zorder=1)
    else:
        order = np.argsort(points[:, 0])
        axes.plot(points[order, 0], second[order], color=SET_EDGE, zorder=1)
    for index, cost in enumerate(solution.costs):
        where = (cost.ideal[0], 0.0 if flat else cost.ideal[1])
        name = f"ideal of {cost.craft.name}" if len(solution.costs) <= _MOST_NAMED else None
        look = {"color": _look(index)["color"], "marker": _look(index)["marker"]}
        axes.plot(*where, linestyle="none", markersize=4.5, label=name, **look)
    for name, point in selections.items():
        marker, label = _CHOICES[name]
        where = (float(point[0]), 0.0 if flat else float(point[1]))
        axes.plot(*where, linestyle="none", marker=marker, markersize=7.0, color="white", markeredgecolor=INK,
                  label=label, zorder=5)  # fmt: skip
    axes.set_xlabel(f"{free[0]} of the meeting, {units[0]}")
    if flat:
        axes.set_yticks([])
    else:
        axes.set_ylabel(f"{free[1]} of the meeting, {units[1]}")
    axes.set_title("(a) the Pareto set", loc="left")
    axes.margins(0.1)


def _hull(solution: EncounterSolution) -> Floats | None:
    """Corners of the hull of the ideals in the plane of the first two free components; None where it has no area."""
    if not solution.same_matrix:
        return None
    ideals = solution.ideals[:, :2]
    try:
        return np.asarray(ideals[ConvexHull(ideals).vertices])
    except QhullError:
        return None


def _draw_excesses(axes: Axes, solution: EncounterSolution, excess: Floats, selections: Mapping[str, Floats]) -> None:
    """The front: e2 against e1 of two, with e3 as a shade of three; ranges of the excesses of one, or of more."""
    names = [each.craft.name for each in solution.costs]
    chosen = {name: solution.excess(point) for name, point in selections.items()}
    if len(names) == 2 and solution.same_matrix:
        between = float(distances(solution)[0, 1])
        along = np.linspace(0.0, between**2, _POINTS)
        axes.plot(along, front_of_two(between, along), color=SET_EDGE)
    if len(names) in (2, 3):
        first, second = _widest_pair(excess)
        if len(names) == 3:
            third = 3 - first - second
            for edge in _edges(solution):
                axes.plot(edge[:, first], edge[:, second], color=LIMIT, linewidth=0.6, zorder=1)
            shade = axes.scatter(excess[:, first], excess[:, second], c=excess[:, third], s=4.0, cmap="cividis")
            left, bottom, width, height = axes.get_position().bounds
            axes.set_position((left, bottom, 0.86 * width, height))
            bar = axes.figure.colorbar(shade, cax=axes.inset_axes((1.04, 0.0, 0.05, 1.0)))
            bar.set_label(f"$e$ of {names[third]}, m$^2$/s$^3$", fontsize=7.0, labelpad=2.0)
            bar.ax.tick_params(labelsize=6.5, pad=1.0, length=2.0)
        elif not solution.same_matrix:
            axes.plot(excess[:, 0], excess[:, 1], color=SET_EDGE)
        for name, values in chosen.items():
            axes.plot(values[first], values[second], linestyle="none", marker=_CHOICES[name][0], markersize=7.0,
                      color="white", markeredgecolor=INK, zorder=5)  # fmt: skip
        axes.set_xlabel(f"excess $e$ of {names[first]}, m$^2$/s$^3$")
        axes.set_ylabel(f"$e$ of {names[second]}, m$^2$/s$^3$")
    else:
        places = np.arange(len(names))
        axes.vlines(places, excess.min(axis=0), excess.max(axis=0), color=SET_FILL, linewidth=4.0)
        for name, values in chosen.items():
            axes.plot(places, values, linestyle="none", marker=_CHOICES[name][0], markersize=6.0, color="white",
                      markeredgecolor=INK)  # fmt: skip
        axes.set_xticks(places, names, rotation=90)
        axes.set_ylabel("excess, m$^2$/s$^3$")
    axes.set_title("(b) the front", loc="left")


def _edges(solution: EncounterSolution) -> list[Floats]:
    """Excesses on the edges of the set of three, where a craft has next to no weight: they bound the front."""
    share = np.linspace(0.0, 1.0, _POINTS)
    out = []
    for without in range(3):
        weights = np.insert(np.column_stack([share, 1.0 - share]), without, 0.0, axis=1)
        out.append(np.asarray(pareto_set(solution, np.clip(weights, _LEAST_WEIGHT, None)).excess))
    return out


def _marks(solution: EncounterSolution) -> str:
    """Return how far apart in time the marks on flights are."""
    spans = [solution.encounter.meeting_s - each.craft.start_s for each in solution.costs]
    if np.ptp(spans) > 1e-9 * max(spans):
        return "marks at each third of a craft's time"
    return f"marks every {spans[0] / (_MARKS - 1):.4g} s"


def _widest_pair(excess: Floats) -> tuple[int, int]:
    """Which two excesses show the front best: those that are least one another's shadow."""
    count = excess.shape[1]
    if count < 3:
        return 0, 1
    pairs = [(first, second) for first in range(count) for second in range(first + 1, count)]
    related = np.abs(np.corrcoef(excess.T))
    return min(pairs, key=lambda pair: float(related[pair]))


def _draw_sweep(axes: Axes, solution: EncounterSolution, sweep: DurationSweep) -> None:
    for index, cost in enumerate(solution.costs):
        look = {**_look(index), "marker": "none"}
        axes.plot(sweep.meeting_s, sweep.cost_squared[:, index], label=f"$J^2$ of {cost.craft.name}", **look)
    axes.plot(sweep.meeting_s, sweep.group_loss, color=LIMIT, linewidth=2.0, label="group loss")
    meeting_s = solution.encounter.meeting_s
    axes.axvline(meeting_s, color=LIMIT, linewidth=0.7, linestyle=(0, (2, 2)))
    axes.annotate(
        f"at {meeting_s:g} s: (a), (b)", (meeting_s, 0.03), xycoords=("data", "axes fraction"), xytext=(-2, 0),
        textcoords="offset points", rotation=90.0, ha="right", va="bottom", fontsize=6.0, color=LIMIT,
    )  # fmt: skip
    axes.set_yscale("log")
    axes.set_xlabel("time of the meeting, s")
    axes.set_ylabel("$J^2$ and group loss, m$^2$/s$^3$")
    axes.margins(x=0.0)
    if len(solution.costs) <= _MOST_NAMED:
        axes.legend(loc="best", fontsize=6.5)
    axes.set_title("(c) costs against time", loc="left")
