"""The figure of results or records, as `experiments.plot` draws it."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure

from experiments.common.figure_style import CURVE_LOOKS
from experiments.common.screen import some_runs
from experiments.interception.figures.distributions import Sample, draw_samples
from experiments.interception.figures.process import draw_process
from sim import Record, Results


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
    return draw_samples([Sample(some_runs(len(results)), CURVE_LOOKS[1], results.miss_m, results.impulse_m_s)])
