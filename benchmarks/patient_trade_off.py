"""Print what the patient strategy's one parameter trades: miss against impulse spent.

    python benchmarks/patient_trade_off.py --model guaranteed --runs 200 --seed 100

Random noise, and game noise with the worst of its four tie rules, run by run. The seed is not that of the published
figures, so that the default may be chosen from what is printed here.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from benchmarks.asked_scenario import asked_scenario, title
from guidance import NoiseKind, Patient, Strategy, SymmetricMiss, TieRule
from sim import Scenario, simulate

SHARES = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


def figures(scenario: Scenario, strategy: Strategy, runs: int, seed: int) -> list[float]:
    """Miss (m) and impulse (m/s) at 50 %, 90 % and worst: under random noise, then under the worst tie rule."""
    random = [simulate(replace(scenario, noise=NoiseKind.RANDOM), runs, seed=seed, strategy=strategy, guarantee=False)]
    game = [
        simulate(replace(scenario, noise=NoiseKind.GAME, tie=tie), runs, seed=seed, strategy=strategy, guarantee=False)
        for tie in TieRule
    ]
    found: list[float] = []
    for results in (random, game):
        for samples in ([each.miss_m for each in results], [each.impulse_m_s for each in results]):
            worst: NDArray[np.float64] = np.max(samples, axis=0)
            found += [float(value) for value in np.quantile(worst, (0.5, 0.9, 1.0))]
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the curve."""
    scenario, runs, seed = asked_scenario(__doc__, arguments, runs=200, seed=100)
    line = sys.stdout.write
    line(f"{title(scenario)}, {runs} runs, seed {seed}\n")
    line(f"{'':15}{'random noise':^48}{'game noise, worst tie rule':^48}\n")
    line(f"{'share':15}" + 2 * f"{'miss, m':^24}{'impulse, m/s':^24}" + "\n")
    line(f"{'':15}" + 4 * f"{'50 %':>7}{'90 %':>7}{'worst':>7}   " + "\n")
    strategies: list[tuple[str, Strategy]] = [("symmetric-miss", SymmetricMiss())]
    strategies += [(f"{share:g}", Patient(share)) for share in SHARES]
    for name, strategy in strategies:
        found = figures(scenario, strategy, runs, seed)
        cells = [f"{value:7.1f}" + ("   " if index % 3 == 2 else "") for index, value in enumerate(found)]
        line(f"{name:15}{''.join(cells)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
