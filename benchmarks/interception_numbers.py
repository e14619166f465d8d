"""Numbers of the 1997 interception, to compare with the published ones: the tables of docs/interception.md."""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np

from experiments import load_scenario
from experiments.interception.curves import curve_scenarios
from guidance import NoiseKind, TieRule
from sim import Results, simulate

SINGLE_LEVELS = (0.05, 0.5, 0.95, 1.0)
CURVE_LEVELS = (0.1, 0.5, 0.9, 0.99)


def line(title: str, results: Results, levels: tuple[float, ...]) -> str:
    """Return a line: quantiles of miss and impulse, and the share of runs with the true state always in the set."""
    miss = " / ".join(f"{value:.2f}" for value in np.quantile(results.miss_m, levels))
    impulse = " / ".join(f"{value:.0f}" for value in np.quantile(results.impulse_m_s, levels))
    return f"{title}: miss {miss} m, impulse {impulse} m/s, true state in the set {results.truth_kept.mean():.1%}"


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="engagements per curve")
    parser.add_argument("--single-runs", type=int, default=300, help="runs of the single engagement per noise")
    options = parser.parse_args()
    single = replace(load_scenario("asteroid-1997-single"), range_sensor=None)
    lines = ["single engagement, published: random 4.3 m for 244.7 m/s, game 9.5 m for 521.7 m/s; 5/50/95/100 %"]
    lines.append(line("random", simulate(single, options.single_runs), SINGLE_LEVELS))
    for tie in TieRule:
        game = replace(single, noise=NoiseKind.GAME, tie=tie)
        lines.append(line(f"game, {tie.value}", simulate(game, options.single_runs), SINGLE_LEVELS))
    lines.append("figure 4, 10/50/90/99 %")
    for number, scenario in curve_scenarios(load_scenario("asteroid-1997")):
        lines.append(line(f"curve {number}", simulate(scenario, options.runs), CURVE_LEVELS))
    print("\n".join(lines))  # noqa: T201


if __name__ == "__main__":
    main()
