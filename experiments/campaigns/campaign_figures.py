"""Figures of a campaign: distributions with bands, convergence of quantiles, and the miss over the initial state."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from experiments.campaigns.campaign_columns import CampaignColumns
from experiments.campaigns.samples import noise_flags
from experiments.common.figure_style import CURVE_LOOKS, INK, LIMIT, new_figure, place_axes, separate_labels, style
from experiments.common.screen import some_runs
from experiments.interception.figures.b_plane import Cloud, draw_b_plane, max_guarantee
from experiments.interception.figures.distributions import MAX_POINTS, Sample, axis_limit, beyond, draw_samples
from infoset.arrays import Floats
from sim import estimate_quantiles
from sim.statistics import level_name, shows
from sim.storage import CampaignFolder

CONVERGING = (0.5, 0.9, 0.99)
RUNS_A_BIN = 100
"""Minimum mean number of runs in a bin of the median and the 90 % quantile over the initial state."""
_LOOKS = 28
_BINS = 24
_SMALL_KM_S = 0.01
"""Extent of a velocity below which its axis is in m/s."""
_START_LABELS = {
    "y_km": "initial y, km",
    "z_km": "initial z, km",
    "x_km": "initial x, km",
    "vy_km_s": "initial V$_y$, km/s",
    "vz_km_s": "initial V$_z$, km/s",
    "vx_km_s": "initial V$_x$, km/s",
}


def draw_all(folder: CampaignFolder, columns: Sequence[CampaignColumns]) -> Iterator[Figure]:
    """Draw the figures of a campaign, one after the other; in space also the misses across the approach."""
    yield draw_campaign_distributions(columns)
    yield draw_convergence(columns)
    yield draw_dispersion(columns)
    if folder.manifest.scenario.is_spatial:
        yield draw_b_plane(_clouds(folder), folder.manifest.scenario.radius_m)


def draw_campaign_distributions(columns: Sequence[CampaignColumns]) -> Figure:
    """Draw the distribution functions of the noises, at least one, with `draw_samples`."""
    samples = []
    for column in columns:
        meter = "with" if column.range_sensor else "no"
        bound = "guaranteed miss" if column.guarantees else "the paper's $\\Phi$ (not a bound here)"
        samples.append(
            Sample(
                f"{column.noise} noise, {meter} range sensor, {some_runs(column.miss_m.size)}",
                _look(column),
                column.miss_m,
                column.impulse_m_s,
                column.guaranteed_miss_m,
                f"{column.noise} noise: {bound}",
            )
        )
    return draw_samples(samples, columns[0].radius_m)


def _clouds(folder: CampaignFolder) -> list[Cloud]:
    miss_m = folder.numbers("miss_m").data
    across_m = np.column_stack([folder.numbers(name).data for name in ("miss_y_m", "miss_z_m")])
    bounds_m = folder.numbers("guaranteed_miss_m").filled(np.inf)
    guaranteed = folder.manifest.scenario.set_model.is_guaranteed
    clouds = []
    for noise, rows in noise_flags(folder).items():
        bound_m = max_guarantee(bounds_m[rows].tolist()) if guaranteed else None
        clouds.append(Cloud(f"{noise} noise, {some_runs(len(miss_m[rows]))}", across_m[rows], miss_m[rows], bound_m))
    return [each for each in clouds if len(each.miss_m)]


def draw_convergence(columns: Sequence[CampaignColumns]) -> Figure:
    """Draw quantiles of the miss and the impulse of the first n runs over n, with their confidence intervals.

    A quantile is drawn from the number of runs on that shows it (`sim.statistics.shows`). Each noise has a row.
    """
    with style():
        figure = new_figure(height_mm=58.0 * len(columns) + 14.0 * len(columns) + 10.0)
        rows = place_axes(figure, len(columns), 2, margins_mm=(16.0, 4.0, 21.0, 7.0), gaps_mm=(14.0, 17.0))
        letter = iter("abcdefghijkl")
        drawn: set[float] = set()
        banded: set[float] = set()
        for row, column in zip(rows, columns, strict=True):
            for axes, label, sample in zip(
                row, ("miss, m", "impulse spent, m/s"), (column.miss_m, column.impulse_m_s), strict=True
            ):
                _convergence(axes, sample, _look(column)["color"], drawn, banded)
                axes.set_title(f"({next(letter)}) {label.split(',')[0]}, {column.noise} noise")
                axes.set_xlabel("runs")
                axes.set_ylabel(label)
                separate_labels(axes)
        _convergence_legend(figure, drawn, banded)
    return figure


def draw_dispersion(columns: Sequence[CampaignColumns]) -> Figure:
    """Draw the miss over each component of the initial state: the runs, their median and their 90 % quantile.

    Each noise has a row, in space one of positions and one of velocities.
    """
    names = [*columns[0].start]
    lines = [names] if len(names) == 4 else [names[:3], names[3:]]
    rows = [(column, line) for column in columns for line in lines]
    with style():
        figure = new_figure(height_mm=44.0 * len(rows) + 15.0 * len(rows) + 6.0)
        grid = place_axes(figure, len(rows), len(lines[0]), margins_mm=(17.0, 6.0, 20.0, 7.0), gaps_mm=(9.0, 15.0))
        letter = iter("abcdefghijkl")
        binned = False
        for row, (column, line) in zip(grid, rows, strict=True):
            limit = axis_limit([column.miss_m])
            for axes, name in zip(row, line, strict=True):
                label, values = _START_LABELS[name], column.start[name]
                if label.endswith("km/s") and 0.0 < np.ptp(values) < _SMALL_KM_S:
                    label, values = label.replace("km/s", "m/s"), 1e3 * values
                binned |= _cloud(axes, values, column.miss_m, _look(column)["color"])
                axes.set_xlabel(label)
                axes.ticklabel_format(axis="x", useOffset=False)
                axes.set_ylim(0.0, 1.04 * limit or 1.0)
                axes.locator_params(axis="x", nbins=3)
                axes.tick_params(labelleft=axes is row[0])
                axes.set_title(f"({next(letter)}) {column.noise} noise")
                separate_labels(axes)
            row[0].set_ylabel(
                "\n".join(["miss, m", *filter(None, [beyond("runs", [column.miss_m], row[0].get_ylim()[1])])])
            )
        most = max(column.miss_m.size for column in columns)
        runs = f"runs (at most {MAX_POINTS} drawn)" if most > MAX_POINTS else "runs"
        handles = [Line2D([], [], linestyle="", marker=".", color=LIMIT, label=runs)]
        if binned:
            handles += [
                Line2D([], [], color=INK, label="median"),
                Line2D([], [], color=INK, linestyle=_line(1), label="p90"),
            ]
        note = None if binned else f"too few runs for median and p90 ({2 * RUNS_A_BIN} of a noise are needed)"
        figure.legend(handles=handles, loc="lower center", ncols=3, title=note, title_fontsize=7.5)
    return figure


def _convergence_legend(figure: Figure, drawn: set[float], banded: set[float]) -> None:
    handles: list[Any] = []
    labels = []
    for index, level in enumerate(CONVERGING):
        if level in drawn:
            line = Line2D([], [], color=INK, linewidth=1.2, linestyle=_line(index))
            handles.append((Patch(facecolor=LIMIT, alpha=0.3), line) if level in banded else line)
            labels.append(f"{level_name(level)}{' and its 95 % confidence interval' if level in banded else ''}")
    hidden = [level_name(level) for level in CONVERGING if level not in drawn]
    figure.legend(
        handles,
        labels,
        loc="lower center",
        ncols=max(1, len(handles)),
        title=f"too few runs for {', '.join(hidden)}" if hidden else None,
        title_fontsize=7.5,
        handler_map={tuple: HandlerTuple(ndivide=1)},
    )


def _convergence(axes: Axes, sample: Floats, colour: str, drawn: set[float], banded: set[float]) -> None:
    """Draw the quantiles over the number of runs, and add the levels that are drawn, with and without interval."""
    minimum = min(10, sample.size)
    counts = np.unique(np.geomspace(minimum, sample.size, _LOOKS).astype(np.int64))
    looks = [estimate_quantiles(sample[:count], CONVERGING) for count in counts.tolist()]
    for index, level in enumerate(CONVERGING):
        known = [(runs, look[index]) for runs, look in zip(counts.tolist(), looks, strict=True) if shows(runs, level)]
        if not known:
            continue
        drawn.add(level)
        values = [estimate.value for _, estimate in known]
        axes.plot([runs for runs, _ in known], values, color=colour, linestyle=_line(index), zorder=3.0)
        intervals = [(runs, estimate.lower, estimate.upper) for runs, estimate in known if estimate.width is not None]
        if intervals:
            banded.add(level)
            runs, lower, upper = zip(*intervals, strict=True)
            axes.fill_between(runs, lower, upper, facecolor=colour, alpha=0.18, linewidth=0.0, zorder=1.5 + 0.1 * index)
            for edge in (lower, upper):
                axes.plot(runs, edge, color=colour, linestyle=_line(index), linewidth=0.5, alpha=0.6, zorder=2.0)
    if sample.size >= 10 * minimum:
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    else:
        axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.xaxis.set_major_formatter(
        FuncFormatter(lambda tick, _: f"{tick:,.0f}".replace(",", "\N{NARROW NO-BREAK SPACE}"))
    )
    axes.xaxis.set_minor_formatter(NullFormatter())
    if minimum < sample.size:
        axes.set_xlim(minimum, sample.size)
    bottom, top = axes.get_ylim()
    axes.set_ylim(bottom if bottom > 0.5 * top else 0.0, top)


def _cloud(axes: Axes, start: Floats, miss: Floats, colour: str) -> bool:
    """Draw the runs, and their median and 90 % quantile if they are enough; return whether these are drawn."""
    step = -(-miss.size // MAX_POINTS)
    size = min(2.2, (MAX_POINTS / miss.size) ** 0.25) if step == 1 else 1.0
    look: dict[str, Any] = {"color": colour, "alpha": 0.4 * size, "markersize": 2.5 * size, "markeredgewidth": 0.0}
    axes.plot(start[::step], miss[::step], ".", zorder=2.0, rasterized=True, **look)
    minimum, maximum = float(start.min()), float(start.max())
    bins = min(_BINS, miss.size // RUNS_A_BIN)
    if bins < 2 or maximum <= minimum:
        return False
    bin_of = np.minimum(((start - minimum) / (maximum - minimum) * bins).astype(np.int64), bins - 1)
    middle = minimum + (np.arange(bins) + 0.5) * (maximum - minimum) / bins
    for order, level in enumerate((0.5, 0.9)):
        filled = np.unique(bin_of)
        values = [np.quantile(miss[bin_of == number], level) for number in filled]
        axes.plot(middle[filled], values, color=INK, linestyle=_line(order), zorder=3.0)
    return True


def _line(index: int) -> Any:
    return ("-", (0, (5, 1.5)), (0, (1.5, 1.2)))[index]


def _look(column: CampaignColumns) -> dict[str, Any]:
    """Return the line style: dark and solid, or light and dashed, which differ also without colours."""
    return CURVE_LOOKS[1 if column.noise == "random" else 4]
