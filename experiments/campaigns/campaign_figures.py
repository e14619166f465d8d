"""Figures of a campaign: distributions, convergence of quantiles, and miss over the start.

Sizes and margins without a reason were chosen by eye (`figure_style`).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from infoset.arrays import Floats
from infoset.experiments.campaigns.run_tables import start_columns
from infoset.experiments.campaigns.sample_rows import samples_of
from infoset.experiments.common.figure_style import (
    CURVE_LOOKS,
    HALO,
    INK,
    TICKS,
    legend_below,
    letters,
    plain_ticks,
    style,
    subplots,
)
from infoset.experiments.common.screen import some_runs
from infoset.experiments.interception.figures.b_plane import Cloud, draw_b_plane
from infoset.experiments.interception.figures.distributions import (
    MAX_POINTS,
    Sample,
    axis_limit,
    draw_samples,
)
from infoset.sim import estimate_quantiles
from infoset.sim.statistics import level_name, shows
from infoset.sim.storage import CampaignFolder

CONVERGING = {0.5: "-", 0.9: (0, (5, 1.5)), 0.99: (0, (1.5, 1.2))}
"""Levels of the quantiles over the number of runs, with their lines."""
RUNS_A_BIN = 100
"""Minimum mean number of runs in a bin of the initial state: on average ten of them are above the
90 % quantile that is drawn for the bin.
"""
_BINNED = (0.5, 0.9)
"""Levels of the quantiles in the bins."""
_BINS = 24
"""Maximum number of bins of the initial state: narrower ones cannot be seen in a panel."""
_LOOKS = 28
"""Number of sizes n of the first n runs whose quantiles are drawn, at equal ratios from 10 to all
runs; chosen: more points change a line of 70 mm no more.
"""
_DECADES_FROM = 1000
"""Number of runs from which the axis of the number of runs has labels at powers of ten only: from
there on it has three of them, 10, 100 and 1000; a shorter axis has labels at 2 and 5, too.
"""
_QUANTITIES = {"miss_m": "miss, m", "impulse_m_s": "impulse spent, m/s"}


def draw_all(folder: CampaignFolder) -> Iterator[Figure]:
    """Draw the figures of a campaign, one after the other.

    In space the misses across the approach are the last figure. Only the columns of one figure are
    in memory.
    """
    scenario = folder.manifest.scenario
    yield draw_samples(_distributions(folder), scenario.body)
    yield draw_convergence(samples_of(folder, tuple(_QUANTITIES)))
    yield draw_dispersion(samples_of(folder, ("miss_m", *start_columns(scenario))))
    if scenario.is_spatial:
        yield draw_b_plane(_clouds(folder), scenario.body)


def _distributions(folder: CampaignFolder) -> list[Sample]:
    """Return the samples of the distributions, one for each noise."""
    scenario = folder.manifest.scenario
    sensor = "no" if scenario.range_sensor is None else "with"
    bound = "the paper's $\\Phi$ (not a bound here)"
    if scenario.set_model.is_guaranteed:
        bound = "guaranteed miss"

    samples = []
    for noise, runs in samples_of(folder, (*_QUANTITIES, "guaranteed_miss_m")).items():
        samples.append(
            Sample(
                name=f"{noise} noise, {sensor} range sensor, {some_runs(len(runs))}",
                look=_look(noise),
                miss_m=runs["miss_m"].to_numpy(),
                impulse_m_s=runs["impulse_m_s"].to_numpy(),
                guaranteed_miss_m=runs["guaranteed_miss_m"].dropna().to_numpy(),
                guaranteed_name=f"{noise} noise: {bound}",
            )
        )

    return samples


def _clouds(folder: CampaignFolder) -> list[Cloud]:
    """Return the misses of each noise across the approach."""
    scenario = folder.manifest.scenario
    t_rad = scenario.b_plane_t_rad
    across = ["b_dot_t_m", "b_dot_r_m"] if t_rad is not None else ["miss_y_m", "miss_z_m"]

    clouds = []
    for noise, runs in samples_of(folder, ("miss_m", "guaranteed_miss_m", "hit", *across)).items():
        bounds_m = runs["guaranteed_miss_m"]
        guaranteed_m = None
        if scenario.set_model.is_guaranteed and bounds_m.notna().all():
            guaranteed_m = float(bounds_m.max())
        clouds.append(
            Cloud(
                title=f"{noise} noise, {some_runs(len(runs))}",
                across_m=runs[across].to_numpy(),
                miss_m=runs["miss_m"].to_numpy(),
                guaranteed_m=guaranteed_m,
                t_rad=t_rad,
                hits=int(runs["hit"].sum()) if runs["hit"].count() else None,
            )
        )

    return clouds


@style()
def draw_convergence(by_noise: dict[str, pd.DataFrame]) -> Figure:
    """Draw quantiles of the first n runs over n, with their confidence intervals.

    The quantities are the miss and the impulse. A quantile is drawn from the number of runs on that
    shows it (`infoset.sim.statistics.shows`). Each noise has a row.
    """
    # Millimetres: a row of panels, and the legend; chosen.
    figure, panels = subplots(62.0 * len(by_noise) + 14.0, len(by_noise), 2)
    for row, (noise, runs) in zip(panels, by_noise.items(), strict=True):
        for axes, (quantity, label) in zip(row, _QUANTITIES.items(), strict=True):
            _draw_quantiles(axes, runs[quantity].to_numpy(), _look(noise)["color"])
            axes.set(xlabel="runs", ylabel=label)

    letters(panels.flat, [f"{noise} noise" for noise in by_noise for _ in _QUANTITIES])

    title = "bands: 95 % confidence intervals"
    most = max(map(len, by_noise.values()))
    hidden = [level_name(level) for level in CONVERGING if not shows(most, level)]
    if hidden:
        title += f"; too few runs for {', '.join(hidden)}"
    legend_below(figure, 3, title=title)
    return figure


def _draw_quantiles(axes: Axes, sample: Floats, colour: str) -> None:
    """Draw the quantiles of the first n values over n, with their confidence intervals."""
    # Quantiles of fewer than ten runs are not of interest: only the median would be known.
    counts = np.unique(
        np.geomspace(min(10, sample.size), sample.size, _LOOKS).astype(np.int64)
    ).tolist()
    looks = [estimate_quantiles(sample[:count], [*CONVERGING]) for count in counts]

    for index, (level, dashes) in enumerate(CONVERGING.items()):
        found = pd.DataFrame([look[index] for look in looks], index=counts, dtype=np.float64)
        found = found[[shows(count, level) for count in counts]]
        line: dict[str, Any] = {"color": colour, "linestyle": dashes, "zorder": 3.0}
        if len(found):
            axes.plot([], [], color=INK, linestyle=dashes, label=level_name(level))
        if len(found) == 1:
            # A line of one point is invisible.
            line |= {"marker": "o", "markersize": 3.0}
        axes.plot(found.index, found["value"], **line)
        axes.fill_between(
            found.index, found["lower"], found["upper"], color=colour, alpha=0.18, linewidth=0.0
        )

    # A tenth of room at both ends, so that a single point is not on the frame; chosen.
    axes.set(xlim=(0.9 * counts[0], 1.1 * counts[-1]), xscale="log")
    plain_ticks(axes.xaxis, TICKS if sample.size < _DECADES_FROM else TICKS[:1])
    # From zero, unless the quantiles would be in the upper half of the axis.
    bottom, top = axes.get_ylim()
    if bottom <= 0.5 * top:
        bottom = 0.0
    axes.set_ylim(bottom, top)


@style()
def draw_dispersion(by_noise: dict[str, pd.DataFrame]) -> Figure:
    """Draw the miss of the runs over each component of the initial state.

    Lines show the median and the 90 % quantile of the miss. Each noise has a row, in space one row
    of positions and one of velocities.
    """
    start = next(iter(by_noise.values())).filter(like="start_").dropna(axis="columns", how="all")
    # In a plane x, z and their rates; in space three positions above three velocities.
    columns = 4 if start.shape[1] == 4 else 3
    rows = len(by_noise) * (start.shape[1] // columns)
    # Millimetres: a row of panels, and the legend; chosen.
    figure, panels = subplots(50.0 * rows + 12.0, rows, columns, sharey="row")

    over = [(noise, name) for noise in by_noise for name in start]
    for axes, (noise, name) in zip(panels.flat, over, strict=True):
        _draw_cloud(axes, name, by_noise[noise], _look(noise)["color"])
    letters(panels.flat, [f"{noise} noise" for noise, _ in over])
    for row in panels:
        row[0].set_ylabel("miss, m")
    legend_below(
        figure,
        3,
        title=f"at most {MAX_POINTS} runs are drawn; quantiles of {RUNS_A_BIN} and more runs",
    )
    return figure


def _draw_cloud(axes: Axes, name: str, runs: pd.DataFrame, colour: str) -> None:
    """Draw the miss over a component of the start, with quantiles if the runs are enough."""
    letter = name.removeprefix("start_").split("_")[0]
    miss_m = runs["miss_m"].to_numpy()
    if letter.startswith("v"):
        start = runs[name].to_numpy()
        axes.set_xlabel(f"initial $V_{letter[1:]}$, m/s")
    else:
        start = runs[name].to_numpy() * 1e-3
        axes.set_xlabel(f"initial ${letter}$, km")
    axes.ticklabel_format(axis="x", useOffset=False)
    axes.locator_params(axis="x", nbins=3)
    axes.tick_params(axis="x", pad=7.0)  # apart from the lowest label of the miss
    limit = 1.04 * axis_limit([miss_m]) or 1.0
    axes.set_ylim(0.0, limit)
    _note_beyond(axes, int((miss_m > limit).sum()))

    # At most `MAX_POINTS` runs are drawn, every `step`-th one. Fewer points are larger and darker,
    # by the fourth root of their number and at most 2.2 times (0.4 * 2.2 is still not opaque);
    # chosen.
    step = -(-miss_m.size // MAX_POINTS)
    size = 1.0
    if step == 1:
        size = min(2.2, (MAX_POINTS / miss_m.size) ** 0.25)
    look: dict[str, Any] = {
        "color": colour,
        "alpha": 0.4 * size,
        "markersize": 2.5 * size,
        "markeredgewidth": 0.0,
    }
    axes.plot(start[::step], miss_m[::step], ".", rasterized=True, zorder=2.0, label="runs", **look)
    _draw_bins(axes, start, miss_m)


def _note_beyond(axes: Axes, count: int) -> None:
    """Write in the upper right corner of a panel how many runs are above its axis, if any are."""
    if not count:
        return
    place: dict[str, Any] = {
        "xycoords": "axes fraction",
        "ha": "right",
        "va": "top",
        "path_effects": HALO,
    }
    text = "1 run above" if count == 1 else f"{count} runs above"
    # Clear of the frame; chosen.
    axes.annotate(text, (0.97, 0.97), fontsize="small", **place)


def _draw_bins(axes: Axes, start: Floats, miss_m: Floats) -> None:
    """Draw quantiles of the miss in bins of a component of the start."""
    bins = min(_BINS, miss_m.size // RUNS_A_BIN)
    # One bin shows no dependence, and equal values have no bins.
    if bins < 2 or not np.ptp(start) > 0.0:
        return
    by_bin = pd.Series(miss_m).groupby(pd.cut(start, bins), observed=True)
    for level in _BINNED:
        values = by_bin.quantile(level)
        middles = [each.mid for each in values.index]
        line: dict[str, Any] = {"color": INK, "linestyle": CONVERGING[level], "zorder": 3.0}
        axes.plot(middles, values, label=level_name(level), **line)


def _look(noise: str) -> dict[str, Any]:
    """Return the line style of a noise.

    Game noise is light and dashed, the others are dark and solid: they differ without colours too.
    """
    return CURVE_LOOKS[4 if noise == "game" else 1]
