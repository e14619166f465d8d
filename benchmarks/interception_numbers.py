"""Numbers of the 1997 interception, to compare with the published ones: the tables of
docs/interception.md.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import numpy as np

from infoset import AngleSensor, InitialSet
from infoset.experiments import load_scenario
from infoset.experiments.interception.study import curve_scenarios
from infoset.guidance import NoiseKind, TieRule
from infoset.sim import Results, Scenario, simulate
from infoset.sim.scenario import of_model

SINGLE_LEVELS = (0.05, 0.5, 0.95, 1.0)
CURVE_LEVELS = (0.1, 0.5, 0.9, 0.99)
VARIANT_RUNS = 50


def line(title: str, results: Results, levels: tuple[float, ...]) -> str:
    """Return a line: quantiles of miss and impulse, and the share of runs with the true state
    always in the set.
    """
    miss = " / ".join(f"{value:.2f}" for value in np.quantile(results.miss_m, levels))
    impulse = " / ".join(f"{value:.0f}" for value in np.quantile(results.impulse_m_s, levels))
    return (
        f"{title}: miss {miss} m, impulse {impulse} m/s, true state in the set "
        f"{results.truth_kept.mean():.1%}"
    )


def variants(single: Scenario) -> dict[str, Scenario]:
    """Return the changes of the single engagement that were tried to explain the printed
    impulses.
    """
    model = single.set_model
    angle = model.angle_sensor
    assert isinstance(angle, AngleSensor)
    near = angle.error_at_zero_range_rad
    far = angle.error_at_nominal_range_rad
    halved = {
        "step_s": 0.5 * model.step_s,
        "angle_sensor": replace(angle, period_s=0.5 * angle.period_s),
    }
    exchanged = replace(angle, error_at_nominal_range_rad=near, error_at_zero_range_rad=far)
    sets: dict[str, dict[str, Any]] = {
        "as published": {},
        "disturbance x 10": {"disturbance_m_s2": 10.0 * model.disturbance_m_s2},
        "disturbance x 100": {"disturbance_m_s2": 100.0 * model.disturbance_m_s2},
        "initial set: box": {"initial_set": InitialSet.BOX},
        "101 sections": {"sections": 101},
        "range threshold 100 km": {"range_threshold_m": 100e3},
        "half steps": halved,
        "error bounds exchanged": {"angle_sensor": exchanged},
        "1.5 mrad at the initial range": {
            "angle_sensor": replace(angle, error_at_nominal_range_rad=1.5e-3)
        },
    }
    engines: dict[str, dict[str, Any]] = {
        "no dead zone": {"min_impulse_m_s": 0.0},
        "delay of one step": {"delay_steps": 1},
    }
    changed = {
        name: replace(single, **of_model(replace(model, **fields))) for name, fields in sets.items()
    }
    return changed | {
        name: replace(single, thruster=replace(single.thruster, **fields))
        for name, fields in engines.items()
    }


def variant_line(name: str, scenario: Scenario) -> str:
    """Return a line: median miss and impulse with random errors, and those of the four tie rules of
    game noise.
    """
    random = simulate(scenario, VARIANT_RUNS, guarantee=False)
    # Except for the random tie rule all runs are equal.
    games = [
        simulate(
            replace(scenario, noise=NoiseKind.GAME, tie=tie),
            VARIANT_RUNS if tie is TieRule.RANDOM else 1,
        )
        for tie in TieRule
    ]
    miss = " / ".join(f"{np.median(each.miss_m):.1f}" for each in games)
    impulse = " / ".join(f"{np.median(each.impulse_m_s):.0f}" for each in games)
    return (
        f"{name}: random {np.median(random.miss_m):.1f} m, {np.median(random.impulse_m_s):.0f} "
        f"m/s; game {miss} m, {impulse} m/s"
    )


def main() -> None:
    """Simulate and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=1000, help="engagements per curve")
    parser.add_argument(
        "--single-runs", type=int, default=300, help="runs of the single engagement per noise"
    )
    options = parser.parse_args()
    single = replace(load_scenario("asteroid-1997-single"), range_sensor=None)
    lines = [
        (
            "single engagement, published: random 4.3 m for 244.7 m/s, game 9.5 m for 521.7 m/s; "
            "5/50/95/100 %"
        )
    ]
    lines.append(line("random", simulate(single, options.single_runs), SINGLE_LEVELS))
    for tie in TieRule:
        game = replace(single, noise=NoiseKind.GAME, tie=tie)
        lines.append(line(f"game, {tie.value}", simulate(game, options.single_runs), SINGLE_LEVELS))
    lines.append(
        f"variants, medians of {VARIANT_RUNS} runs; game: {', '.join(tie.value for tie in TieRule)}"
    )
    lines += [variant_line(name, scenario) for name, scenario in variants(single).items()]
    lines.append("figure 4, 10/50/90/99 %")
    for number, scenario in curve_scenarios(load_scenario("asteroid-1997")):
        lines.append(line(f"curve {number}", simulate(scenario, options.runs), CURVE_LEVELS))
    print("\n".join(lines))


if __name__ == "__main__":
    main()
