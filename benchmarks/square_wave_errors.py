"""Print the miss of all strategies with square-wave errors: always at the bound, with sign changes
at fixed times.

    python benchmarks/square_wave_errors.py --model guaranteed --runs 50

The table has a row for each strategy: median and maximum miss and impulse over the starts, with the
worst square wave of each start (half-periods from one measurement to the whole flight, both signs).
Range sensors measure without error.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.asked_scenario import asked_scenario
from infoset.experiments.interception.study import scenario_title
from infoset.guidance import make_strategy, strategy_names
from infoset.guidance.scripted_noise import ScriptedNoise
from infoset.sim import Scenario
from infoset.sim.draws import draw
from infoset.sim.engagement import Engagements

HALF_PERIODS = (1, 2, 3, 4, 6, 10, 20, 40, 80, 1000)
"""Half-periods in steps; the last one is a constant bias."""


def worst(
    scenario: Scenario, name: str, runs: int, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the maximum miss (m) and the maximum impulse (m/s) of each start over all square
    waves.
    """
    draws = draw(scenario, range(runs), seed)
    steps = draws.steps
    misses = []
    impulses = []
    for half_period in HALF_PERIODS:
        wave = np.where(np.arange(steps) // half_period % 2 == 0, 1.0, -1.0)
        for sign in (1.0, -1.0):
            noise = ScriptedNoise({"angle": np.tile(sign * wave, (1, runs, 1))})
            flight = Engagements(scenario, draws, make_strategy(name), noise=noise)
            while flight.flying:
                flight.advance()
            results = flight.results(np.arange(runs))
            misses.append(results.miss_m)
            impulses.append(results.impulse_m_s)
    return np.max(misses, axis=0), np.max(impulses, axis=0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    scenario, runs, seed = asked_scenario(__doc__, arguments, runs=50, seed=0)
    sys.stdout.write(f"{scenario_title(scenario)}, {runs} starts, ")
    sys.stdout.write(f"seed {seed}: the worst of {2 * len(HALF_PERIODS)} square waves\n")
    sys.stdout.write(f"{'':26}{'miss, m':^20}{'impulse, m/s':^20}\n")
    sys.stdout.write(f"{'strategy':26}{'median':>10}{'worst':>10}{'median':>10}{'worst':>10}\n")
    for name in strategy_names():
        miss, impulse = worst(scenario, name, runs, seed)
        values = (np.median(miss), miss.max(), np.median(impulse), impulse.max())
        sys.stdout.write(f"{name:26}{''.join(f'{value:10.1f}' for value in values)}\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
