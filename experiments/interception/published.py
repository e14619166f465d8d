"""Kumkov and Patsko (1997): single engagements and the distributions of figure 4."""

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
"""Miss and impulse of the two engagements from `ONE_RUN_START`, without a range sensor."""
ONE_RUN_START = "z = \N{MINUS SIGN}8 km"
"""Start of these engagements, as text for a legend."""
RUNS = 200
"""Number of runs of a curve of figure 4, and of one engagement with random errors; chosen: twenty
of them are above the 90 % quantile, the highest one that is compared.
"""


def compute(progress: Progress) -> dict[str, Sequence[Ours | float]]:
    """Compute the numbers of the paper by source.

    The game of one run is computed with each tie rule that does not draw.
    """
    # One engagement without a range sensor, with random errors and with the game noise.
    single = replace(load_scenario(SINGLE), range_sensor=None)
    games = [
        replace(single, noise=NoiseKind.GAME, tie=tie)
        for tie in TieRule
        if tie is not TieRule.RANDOM
    ]

    # Figure 4 by the published procedure: with a range sensor, a set that became empty stays lost.
    many = load_scenario(MANY)
    lost = replace(many, information_set=replace(many.information_set, recovery=Recovery.NONE))
    curves = [each for each in curve_scenarios(many) if each[1].range_sensor is None]
    curves += [each for each in curve_scenarios(lost) if each[1].range_sensor is not None]

    runs = [(single, RUNS), *((game, 1) for game in games), *((flown, RUNS) for _, flown in curves)]
    # Without Phi, which is not compared; seed 0.
    tasks = [
        Task(scenario, range(count), 0, guarantee=False, progress=report)
        for (scenario, count), report in zip(runs, parts_of(progress, len(runs)), strict=True)
    ]
    of_random, *others = simulate_all(tasks)
    of_games = others[: len(games)]
    of_curves = others[len(games) :]

    numbers: dict[str, Sequence[Ours | float]] = {
        ONE_RUN: [*_medians([of_random]), *_medians(of_games)]
    }
    for (number, _), found in zip(curves, of_curves, strict=True):
        numbers[f"figure 4, curve {number}"] = [
            *np.quantile(found.miss_m, (0.5, 0.9)),
            np.quantile(found.impulse_m_s, 0.5),
        ]

    return numbers


def printed_single_runs() -> dict[str, tuple[float, float]]:
    """Return the printed miss (m) and impulse (m/s) by noise."""
    # In the file: miss and impulse with random errors, then with the game noise.
    values = [number.value for number in read_paper(PAPER).tables[ONE_RUN]]
    return {"random": (values[0], values[1]), "game": (values[2], values[3])}


def _medians(runs: Sequence[Results]) -> list[Ours]:
    """Return the median of the miss and the median of the impulse."""
    return [
        _median([results.miss_m for results in runs]),
        _median([results.impulse_m_s for results in runs]),
    ]


def _median(runs: Sequence[Floats]) -> Ours:
    """Return the median of the medians, with the extremes of the 5 and 95 % quantiles."""
    low, middle, high = np.array([np.quantile(values, (0.05, 0.5, 0.95)) for values in runs]).T
    return Ours(float(np.median(middle)), spread=(float(low.min()), float(high.max())))
