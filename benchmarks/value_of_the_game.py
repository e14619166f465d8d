"""Print lower bounds, worst misses found, and misses with random and game errors, for strategies on
the set.

    python -m benchmarks.value_of_the_game
    python -m benchmarks.value_of_the_game --scenarios built-in --budget 2000 --seeds 1
    python -m benchmarks.value_of_the_game --scenarios variants --budget 2000 --seeds 1
    python -m benchmarks.value_of_the_game --scenarios random --budget 2000 --seeds 1

The first line is `asteroid-1997` with five searches for each strategy.

Searches start anywhere in the uncertainty of the scenario, the other runs in its dispersion. The
model is `guaranteed`. Each row has the maximum value found, that of any state of the set, and the
miss of the truth of that engagement.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.random_scenarios import random_scenario
from infoset import Model
from infoset.experiments import load_scenario
from infoset.guidance import NoiseKind
from infoset.sim import NothingCountsError, Scenario, find_worst, lower_bound, simulate

BUILT_IN = (
    "asteroid-1997",
    "comet-fast",
    "asteroid-1997-space",
    "dart-2022",
    "deep-impact-2005",
    "haiv-2013",
)
STRATEGIES = ("symmetric-miss", "least-effort", "patient")
RUNS = 100
RANDOM = 10
VARIANTS = {
    "weak engine, 2.5 m/s": ["thruster.max_impulse_m_s=2.5"],
    "closing speed 52 to 64 km/s": ["uncertainty.vx_km_s=[-64, -52]"],
    "precise sensor, 1 % of the errors": [
        "angle_sensor.error_at_nominal_range_rad=1.5e-6",
        "angle_sensor.error_at_zero_range_rad=2.3e-6",
        "information_set.disturbance_m_s2=5e-5",
    ],
    "target with 0.4 of 0.5 m/s^2": [
        "information_set.disturbance_m_s2=0.5",
        "target.manoeuvre=bang-bang",
        "target.acceleration_m_s2=0.4",
    ],
    "budget 150 m/s, narrow start": [
        "thruster.budget_m_s=150",
        "uncertainty.z_km=[-1, 1]",
        "uncertainty.vz_km_s=[-0.01, 0.01]",
        "dispersion.vz_km_s=[-0.01, 0.01]",
    ],
    "budget 300 m/s": ["thruster.budget_m_s=300"],
    "delay of 2 steps, cut-off 2 s": ["thruster.delay_steps=2", "thruster.last_impulse_s=2"],
}
"""Variants of `asteroid-1997` without its range sensor, where `least-effort` could be weak."""


def scenarios(choice: str) -> Iterator[tuple[str, Scenario]]:
    """Yield scenarios in the guaranteed model: with and without the range sensor, variants, or
    random ones.
    """
    if choice == "random":
        number = found = 0
        while found < RANDOM:
            scenario = guaranteed(random_scenario(number, rate_sensor=False))
            if scenario is not None and not scenario.is_spatial:
                yield f"random {number}", scenario
                found += 1
            number += 1
        return
    for name in (
        BUILT_IN
        if choice == "built-in"
        else ("asteroid-1997",)
        if choice == "variants"
        else (choice,)
    ):
        for variant, settings in VARIANTS.items() if choice == "variants" else [("", [])]:
            scenario = guaranteed(load_scenario(name, settings))
            assert scenario is not None
            yield f"{name} {variant}, no range sensor", replace(scenario, range_sensor=None)
            if scenario.range_sensor is not None and not variant:
                yield f"{name}, range sensor", scenario


def guaranteed(scenario: Scenario) -> Scenario | None:
    """Return a scenario in the guaranteed model; None if that has no labels."""
    try:
        settings = replace(scenario.information_set, model=Model.GUARANTEED, initial_set=None)
        return replace(scenario, information_set=settings)
    except ValueError:
        return None


def row(scenario: Scenario, strategy: str, budget: int, seeds: int) -> str:
    """Return the figures of one strategy."""
    texts = []
    for noise in (NoiseKind.RANDOM, NoiseKind.GAME):
        results = simulate(replace(scenario, noise=noise), RUNS, strategy=strategy, guarantee=False)
        (median, most), impulse = (
            np.quantile(results.miss_m, (0.5, 0.9)),
            np.median(results.impulse_m_s),
        )
        texts.append(f"{noise.value} {median:.3g} / {most:.3g} m, {impulse:.3g} m/s")
    worst = []
    for seed in range(seeds):
        try:
            found = find_worst(scenario, strategy=strategy, budget=budget, seed=seed, keep_set=True)
            worst.append(f"{found.value_m:.4g} ({found.miss_m:.4g})")
        except NothingCountsError:
            worst.append("-")
    return f"  {strategy:15s} {'; '.join(texts)}; worst found {', '.join(worst)} m"


def main() -> None:
    """Print the figures of each scenario."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--scenarios", default="asteroid-1997", help="a name, or built-in, variants or random"
    )
    parser.add_argument("--budget", type=int, default=8000, help="engagements of a search")
    parser.add_argument("--seeds", type=int, default=5, help="number of searches")
    parser.add_argument("--strategies", nargs="*", default=STRATEGIES)
    options = parser.parse_args()
    for name, scenario in scenarios(options.scenarios):
        sys.stdout.write(
            f"{name}: no strategy guarantees less than {lower_bound(scenario).bound_m:.4g} m\n"
        )
        for strategy in options.strategies:
            sys.stdout.write(row(scenario, strategy, options.budget, options.seeds) + "\n")
            sys.stdout.flush()


if __name__ == "__main__":
    main()
