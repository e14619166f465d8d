"""The burns of a schedule in many runs: the sizes of the impulses at each time, and their shares."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from experiments.common.screen import number, number_table
from experiments.interception.curves import Curve
from sim import Results, Scenario
from sim.statistics import shown_quantiles

LEVELS = {"p50_m_s": 0.5, "p99_m_s": 0.99}
"""Levels of the quantiles of a burn, by key in JSON."""


def burns_key(scenario: Scenario, results: Results) -> dict[str, list[dict[str, float | None]]]:
    """Return the key `burns` of a curve in JSON: for each burn its time, quantiles of its size, and its share.

    The share is that of all impulses of all runs; None without any impulse. No key without a schedule.
    """
    if results.burns_m_s is None:
        return {}
    whole = float(results.burns_m_s.sum())
    arrival_s, step_s = scenario.nominal_arrival_s, scenario.set_model.step_s
    steps = scenario.thruster.impulse_steps(arrival_s, step_s) or []
    return {
        "burns": [
            {
                "before_arrival_s": arrival_s - step * step_s,
                **dict(zip(LEVELS, shown_quantiles(sizes, [*LEVELS.values()]), strict=True)),
                "share": float(sizes.sum()) / whole if whole > 0.0 else None,
            }
            for step, sizes in zip(steps, results.burns_m_s.T, strict=True)
        ]
    }


def burn_table(scenario: Scenario, curves: Sequence[Curve]) -> Table:
    """Return the table of the burns of all curves."""
    table = number_table("curve", "burn, s before arrival", "p50, m/s", "p99, m/s", "share of impulse, %", left=1)
    for curve in curves:
        for burn in burns_key(scenario, curve.results).get("burns", []):
            share = burn["share"]
            table.add_row(
                f"{curve.number} {curve.noise.value}{' + range meter' if curve.range_meter else ''}",
                f"{burn['before_arrival_s']:g}",
                *(number(burn[key]) for key in LEVELS),
                number(None if share is None else 100.0 * share),
            )
    return table
