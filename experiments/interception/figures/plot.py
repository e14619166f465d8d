"""The figure of results or records, as `experiments.plot` draws it."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from experiments.common.figure_style import INK, SET_EDGE, figure_grid, style
from experiments.common.screen import some_runs
from experiments.interception.figures.distributions import draw_band
from experiments.interception.figures.process import draw_process
from sim import Record, Results, empirical_distribution


def plot(results: Results | Record | Sequence[Record]) -> Figure:
    """Draw results, or the course of up to two engagements.

    Parameters
    ----------
    results : Results, Record or sequence of Record
        Results give the distributions of miss and impulse, each with its 95 % confidence band. Records give angle,
        rate, predicted miss and impulses over time (`draw_process`).
    """
    if not isinstance(results, Results):
        return draw_process([results] if isinstance(results, Record) else results)
    with style():
        figure, (left, right) = figure_grid(75.0, 1, 2, (14.0, 4.0, 12.0, 7.0), (9.0, 0.0))
        panels = ((left, "miss, m", results.miss_m), (right, "impulse spent, m/s", results.impulse_m_s))
        for axes, label, sample in panels:
            found = empirical_distribution(sample)
            draw_band(axes, found.values, found.lower, found.upper, SET_EDGE)
            axes.plot(found.values, found.probability, drawstyle="steps-post", color=INK)
            axes.set_xlabel(label)
        left.set_ylabel(f"share of {some_runs(len(results))}")
    return figure
