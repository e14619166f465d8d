"""Kumkov and Patsko (1997): the interception, single engagements and the distributions of figure 4."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from experiments.common.printed_numbers import Ours, Progress, read_paper
from experiments.interception.scenario_file import load_scenario
from experiments.interception.study import curve_scenarios
from guidance import NoiseKind, TieRule
from infoset import Recovery
from infoset.arrays import Floats
from sim import Results, Scenario, simulate

PAPER = "interception"
SINGLE, MANY = "asteroid-1997-single", "asteroid-1997"
ONE_RUN = "section 8, one run"
"""Miss and impulse of the two engagements from z = -8 km, without a range sensor."""
RUNS = 200
"""A curve of figure 4, or runs of one engagement with random errors."""


def compute(progress: Progress) -> dict[str, Sequence[Ours | float]]:
    """Compute the numbers by source."""
    single, many = load_scenario(SINGLE), load_scenario(MANY)
    ours = {ONE_RUN: _single(replace(single, range_sensor=None), lambda done: progress(0.3 * done))}
    return {**ours, **_figure_4(many, lambda done: progress(0.3 + 0.7 * done))}


def printed_single_runs() -> dict[str, tuple[float, float]]:
    """Return the printed miss (m) and impulse (m/s) by noise."""
    values = [number.value for number in read_paper(PAPER).tables[ONE_RUN]]
    return {"random": (values[0], values[1]), "game": (values[2], values[3])}


def _single(scenario: Scenario, progress: Progress) -> list[Ours]:
    """Return medians for random errors, and for the game with each tie rule that does not draw: one run each."""
    game = replace(scenario, noise=NoiseKind.GAME)
    random = simulate(scenario, RUNS, guarantee=False, progress=lambda done: progress(0.5 * done))
    ties = [tie for tie in TieRule if tie is not TieRule.RANDOM]
    games = [simulate(replace(game, tie=tie), 1, guarantee=False) for tie in ties]
    progress(1.0)
    return [_median(values) for flown in ([random], games) for values in zip(*map(_values, flown), strict=True)]


def _values(results: Results) -> tuple[Floats, Floats]:
    return results.miss_m, results.impulse_m_s


def _median(runs: Sequence[Floats]) -> Ours:
    """Return the median of the medians, with the extremes of the 5 and 95 % quantiles."""
    low, middle, high = np.array([np.quantile(values, (0.05, 0.5, 0.95)) for values in runs]).T
    return Ours(float(np.median(middle)), spread=(float(low.min()), float(high.max())))


def _figure_4(scenario: Scenario, progress: Progress) -> dict[str, list[float]]:
    # The published procedure: a set that became empty stays lost.
    lost = replace(scenario, information_set=replace(scenario.information_set, recovery=Recovery.NONE))
    plain = {number: flown for number, flown in curve_scenarios(scenario) if flown.range_sensor is None}
    ranging = {number: flown for number, flown in curve_scenarios(lost) if flown.range_sensor is not None}
    done = dict.fromkeys((1, 2, 3, 4), 0.0)

    def fly(number: int) -> Results:
        def report(share: float) -> None:
            done[number] = share
            progress(sum(done.values()) / len(done))

        return simulate({**plain, **ranging}[number], RUNS, guarantee=False, progress=report)

    # The slowest first; kernels release the interpreter.
    with ThreadPoolExecutor(2) as pool:
        flown = zip((4, 3, 2, 1), pool.map(fly, (4, 3, 2, 1)), strict=True)
    return {
        f"figure 4, curve {number}": [*np.quantile(results.miss_m, (0.5, 0.9)), np.quantile(results.impulse_m_s, 0.5)]
        for number, results in flown
    }
