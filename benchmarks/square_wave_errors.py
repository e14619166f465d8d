"""Print how strategies stand errors that are no game: always at their bound, changing sides at fixed times.

    python benchmarks/square_wave_errors.py --model guaranteed --runs 50

A row a strategy: the median and the greatest miss over the starts, each start counting with the worst of all square
waves (half-periods from one measurement to the whole flight, either sign first). The range meter, if there is one,
measures without error.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.asked_scenario import asked_scenario, title
from guidance import make_strategy, strategy_names
from guidance.scripted_noise import ScriptedNoise
from sim import Scenario
from sim.draws import draw
from sim.engagement import Engagements

HALF_PERIODS = (1, 2, 3, 4, 6, 10, 20, 40, 80, 1000)
"""In steps; the last one is a bias that never changes."""


def worst(scenario: Scenario, name: str, runs: int, seed: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Greatest miss (m) and greatest impulse (m/s) of each start over all square waves."""
    draws = draw(scenario, range(runs), seed)
    steps = draws.steps
    misses, impulses = [], []
    for half_period in HALF_PERIODS:
        wave = np.where(np.arange(steps) // half_period % 2 == 0, 1.0, -1.0)
        for sign in (1.0, -1.0):
            noise = ScriptedNoise({"angle": np.tile(sign * wave, (runs, 1))})
            flight = Engagements(scenario, draws, make_strategy(name), noise=noise)
            while flight.flying:
                flight.advance()
            results = flight.results(np.arange(runs))
            misses.append(results.miss_m)
            impulses.append(results.impulse_m_s)
    return np.max(misses, axis=0), np.max(impulses, axis=0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print a row a strategy."""
    scenario, runs, seed = asked_scenario(__doc__, arguments, runs=50, seed=0)
    sys.stdout.write(f"{title(scenario)}, {runs} starts, ")
    sys.stdout.write(f"seed {seed}: the worst of {2 * len(HALF_PERIODS)} square waves\n")
    sys.stdout.write(f"{'':18}{'miss, m':^20}{'impulse, m/s':^20}\n")
    sys.stdout.write(f"{'strategy':18}{'median':>10}{'worst':>10}{'median':>10}{'worst':>10}\n")
    for name in strategy_names():
        miss, impulse = worst(scenario, name, runs, seed)
        values = (np.median(miss), miss.max(), np.median(impulse), impulse.max())
        sys.stdout.write(f"{name:18}{''.join(f'{value:10.1f}' for value in values)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
