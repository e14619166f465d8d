"""Print miss and impulse of the strategy `patient` as functions of its parameter.

    python benchmarks/patient_trade_off.py --model guaranteed --runs 200 --seed 100

The table has random noise, and game noise with the worst of its four tie rules in each run. The
seed is not that of the published figures, so that the default of the parameter can be chosen from
this table.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.asked_scenario import asked_scenario
from infoset.experiments.interception.study import scenario_title
from infoset.guidance import NoiseKind, Patient, Strategy, SymmetricMiss, TieRule
from infoset.sim import Scenario, simulate

SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


def figures(scenario: Scenario, strategy: Strategy, runs: int, seed: int) -> list[float]:
    """Return miss (m) and impulse (m/s), 50 %, 90 % and maximum: with random noise, then with the
    worst tie rule.
    """
    random = [
        simulate(
            replace(scenario, noise=NoiseKind.RANDOM),
            runs,
            seed=seed,
            strategy=strategy,
            guarantee=False,
        )
    ]
    game = [
        simulate(
            replace(scenario, noise=NoiseKind.GAME, tie=tie),
            runs,
            seed=seed,
            strategy=strategy,
            guarantee=False,
        )
        for tie in TieRule
    ]
    quantiles: list[float] = []
    for results in (random, game):
        for samples in (
            [result.miss_m for result in results],
            [result.impulse_m_s for result in results],
        ):
            worst: NDArray[np.float64] = np.max(samples, axis=0)
            quantiles += [float(value) for value in np.quantile(worst, (0.5, 0.9, 1.0))]
    return quantiles


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    scenario, runs, seed = asked_scenario(__doc__, arguments, runs=200, seed=100)
    line = sys.stdout.write
    line(f"{scenario_title(scenario)}, {runs} runs, seed {seed}\n")
    line(f"{'':15}{'random noise':^48}{'game noise, worst tie rule':^48}\n")
    line(f"{'share':15}" + 2 * f"{'miss, m':^24}{'impulse, m/s':^24}" + "\n")
    line(f"{'':15}" + 4 * f"{'50 %':>7}{'90 %':>7}{'worst':>7}   " + "\n")
    strategies: list[tuple[str, Strategy]] = [("symmetric-miss", SymmetricMiss())]
    strategies += [(f"{share:g}", Patient(share)) for share in SHARES]
    for name, strategy in strategies:
        values = figures(scenario, strategy, runs, seed)
        cells = [
            f"{value:7.1f}" + ("   " if index % 3 == 2 else "")
            for index, value in enumerate(values)
        ]
        line(f"{name:15}{''.join(cells)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
