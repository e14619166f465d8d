"""Kumkov and Patsko (1997): the interception, single engagements and the distributions of figure
4.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from infoset.arrays import Floats
from infoset.experiments.common.printed_numbers import Ours, Progress, read_paper
from infoset.experiments.common.screen import parts_of
from infoset.experiments.interception.runs.shared import simulate_all
from infoset.experiments.interception.scenario_file import load_scenario
from infoset.experiments.interception.study import OF_PAPER, curve_scenarios
from infoset.guidance import NoiseKind, TieRule
from infoset.model import Recovery
from infoset.sim import Results
from infoset.sim.parallel import Task

PAPER = "interception"
MANY, SINGLE = OF_PAPER
ONE_RUN = "section 8, one run"
"""Miss and impulse of the two engagements from z = -8 km, without a range sensor."""
RUNS = 200
"""A curve of figure 4, or runs of one engagement with random errors."""


def compute(progress: Progress) -> dict[str, Sequence[Ours | float]]:
    """Compute the numbers by source; for the game of one run, with each tie rule that does not
    draw.
    """
    single = replace(load_scenario(SINGLE), range_sensor=None)
    many = load_scenario(MANY)
    # The published procedure: a set that became empty stays lost.
    lost = replace(many, information_set=replace(many.information_set, recovery=Recovery.NONE))
    curves = [
        (number, flown) for number, flown in curve_scenarios(many) if flown.range_sensor is None
    ]
    curves += [
        (number, flown) for number, flown in curve_scenarios(lost) if flown.range_sensor is not None
    ]
    ties = [
        replace(single, noise=NoiseKind.GAME, tie=tie)
        for tie in TieRule
        if tie is not TieRule.RANDOM
    ]
    runs = [(single, RUNS), *((tie, 1) for tie in ties), *((flown, RUNS) for _, flown in curves)]
    results = simulate_all(
        [
            Task(scenario, range(count), 0, guarantee=False, progress=report)
            for (scenario, count), report in zip(runs, parts_of(progress, len(runs)), strict=True)
        ]
    )
    both = results[:1], results[1 : 1 + len(ties)]
    one_run = [
        _median(values) for found in both for values in zip(*map(_values, found), strict=True)
    ]
    figure_4 = {
        f"figure 4, curve {number}": [
            *np.quantile(found.miss_m, (0.5, 0.9)),
            np.quantile(found.impulse_m_s, 0.5),
        ]
        for (number, _), found in zip(curves, results[1 + len(ties) :], strict=True)
    }
    return {ONE_RUN: one_run, **figure_4}


def printed_single_runs() -> dict[str, tuple[float, float]]:
    """Return the printed miss (m) and impulse (m/s) by noise."""
    values = [number.value for number in read_paper(PAPER).tables[ONE_RUN]]
    return {"random": (values[0], values[1]), "game": (values[2], values[3])}


def _values(results: Results) -> tuple[Floats, Floats]:
    return results.miss_m, results.impulse_m_s


def _median(runs: Sequence[Floats]) -> Ours:
    """Return the median of the medians, with the extremes of the 5 and 95 % quantiles."""
    low, middle, high = np.array([np.quantile(values, (0.05, 0.5, 0.95)) for values in runs]).T
    return Ours(float(np.median(middle)), spread=(float(low.min()), float(high.max())))
