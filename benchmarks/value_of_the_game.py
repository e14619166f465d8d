"""Print the lower bound, the worst misses found and the misses with random errors, for strategies on the set.

    python -m benchmarks.value_of_the_game                                          # asteroid-1997, five seeds
    python -m benchmarks.value_of_the_game --scenarios all --budget 2000 --seeds 1

Starts are anywhere in the set of the scenario for the searches, and in its dispersion for the random errors. The model
is `guaranteed`.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np

from experiments import load_scenario
from infoset import InitialSet, Model
from sim import NothingCountsError, Scenario, find_worst, lower_bound, simulate

BUILT_IN = ("asteroid-1997", "comet-fast", "asteroid-1997-space", "dart-2022", "deep-impact-2005", "haiv-2013")
STRATEGIES = ("symmetric-miss", "least-effort", "patient")
RUNS = 100


def guaranteed(name: str, *, has_range_sensor: bool) -> Scenario:
    """Return a built-in scenario in the guaranteed model, with or without its range sensor."""
    scenario = load_scenario(name)
    model = replace(scenario.set_model, kind=Model.GUARANTEED, initial_set=InitialSet.BOX)
    return replace(scenario, set_model=model, range_sensor=scenario.range_sensor if has_range_sensor else None)


def row(scenario: Scenario, strategy: str, budget: int, seeds: int) -> str:
    """Return the figures of one strategy: random errors, and the greatest misses of any state found, by seed."""
    random = simulate(scenario, RUNS, strategy=strategy, guarantee=False)
    worst = []
    for seed in range(seeds):
        try:
            worst.append(
                f"{find_worst(scenario, strategy=strategy, budget=budget, seed=seed, keep_set=True).value_m:.4g}"
            )
        except NothingCountsError:
            worst.append("-")
    median, most = np.quantile(random.miss_m, (0.5, 0.9))
    impulse, large = np.quantile(random.impulse_m_s, (0.5, 0.9))
    return (
        f"  {strategy:15s} random: {median:.3g} / {most:.3g} m, {impulse:.3g} / {large:.3g} m/s   worst found: "
        f"{', '.join(worst)} m"
    )


def main() -> None:
    """Print the figures of each scenario, with and without its range sensor."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenarios", default="asteroid-1997", help="a built-in scenario, or all")
    parser.add_argument("--budget", type=int, default=8000, help="engagements of a search")
    parser.add_argument("--seeds", type=int, default=5, help="number of searches")
    parser.add_argument("--strategies", nargs="*", default=STRATEGIES)
    options = parser.parse_args()
    for name in BUILT_IN if options.scenarios == "all" else (options.scenarios,):
        sensors = (False, True) if load_scenario(name).range_sensor is not None else (False,)
        for has_range_sensor in sensors:
            scenario = guaranteed(name, has_range_sensor=has_range_sensor)
            which = "with" if has_range_sensor else "without"
            bound_m = lower_bound(scenario).bound_m
            sys.stdout.write(f"{name}, {which} range sensor: no strategy guarantees less than {bound_m:.4g} m\n")
            for strategy in options.strategies:
                sys.stdout.write(row(scenario, strategy, options.budget, options.seeds) + "\n")
                sys.stdout.flush()


if __name__ == "__main__":
    main()
