"""What a study reports about the sets and the hits of its runs, next to its quantiles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.common.screen import some_runs
from infoset import Bias, Model
from infoset.arrays import Flags
from sim import HitEstimate, Results, Scenario

QUANTILES = {"p10": 0.1, "p50": 0.5, "p90": 0.9, "p99": 0.99, "max": 1.0}
"""Levels of the quantiles in tables and JSON, by name."""


@dataclass(frozen=True)
class SetCounts:
    """Numbers of runs: all, with the true state inside the set at every step, with an empty set, and with a failed set.

    A set has failed if it became empty or lost the true state.
    """

    runs: int = 0
    truth_kept: int = 0
    set_emptied: int = 0
    failed: int = 0

    def __add__(self, other: SetCounts) -> SetCounts:
        return SetCounts(*(mine + more for mine, more in zip(vars(self).values(), vars(other).values(), strict=True)))

    def __str__(self) -> str:
        kept, emptied = (f"{count} of {some_runs(self.runs)}" for count in (self.truth_kept, self.set_emptied))
        return (
            f"true state inside the set at every step: {kept} ({percent(self.truth_kept / self.runs)}); "
            f"set became empty: {emptied} ({percent(self.set_emptied / self.runs)})"
        )


def set_counts(truth_kept: Flags, set_emptied: Flags) -> SetCounts:
    """Return the counts of some runs, from arrays of shape (N,)."""
    failed = ~truth_kept | set_emptied
    return SetCounts(len(truth_kept), int(truth_kept.sum()), int(set_emptied.sum()), int(failed.sum()))


def set_warnings(model: Model, counts: SetCounts) -> list[str]:
    """Return a warning if sets failed in some runs: the quantiles then describe the failures of the model too."""
    if not counts.failed:
        return []
    failures = f"in {counts.failed} of {some_runs(counts.runs)} the set lost the true state or became empty"
    if model is Model.PAPER:
        return [
            f"warning: model paper: {failures}; the quantiles include these failures of the model; for quantiles "
            "without them, use --model guaranteed"
        ]
    return [
        f"warning: model guaranteed: {failures}, so the scenario exceeds an assumption of the model; to find it, use "
        "infoset scenarios check FILE"
    ]


def scenario_title(scenario: Scenario) -> str:
    """Return the name of a scenario, with its range sensor and its model."""
    meter = "with" if scenario.range_sensor is not None else "without"
    return f"{scenario.name}, {meter} range sensor, model {scenario.information_set.model.value}"


def study_title(scenario: Scenario, strategy: str, seed: int) -> str:
    """Return what the numbers of a study rest on: scenario, model, strategy and seed, and a line with its settings."""
    head = f"{scenario_title(scenario)}, strategy {strategy}, seed {seed}"
    return "\n".join(line for line in (head, scenario.description) if line)


def game_note(scenario: Scenario, rule: str | None = None) -> str:
    """Return a line about what a result with game noise is; `rule` is its tie rule, None that of the scenario."""
    bound = "; no errors within the bounds give a miss above Phi" if scenario.set_model.is_guaranteed else ""
    return (
        f"game noise ({rule or f'tie rule {scenario.tie.value}'}) is one adversary, not the worst case: infoset bound "
        f"--budget 0 prints a miss, from the worst start, that no strategy can prevent{bound}"
    )


def random_note(scenario: Scenario) -> str:
    """Return a line about what a result with random noise is."""
    constant = scenario.set_model.angle_sensor.bias is Bias.CONSTANT
    return (
        "random noise (uniform errors within the bounds, independent from one measurement to the next"
        f"{', with a constant centroid error' if constant else ''}) is one model of many: a decision holds for it only"
    )


def hit_text(hits: HitEstimate | None, scenario: Scenario) -> str:
    """Return the share of hits with its interval; an empty text if the body has no size."""
    if hits is None or scenario.body is None:
        return ""
    return (
        f"hit (miss at most {scenario.body.radius_m:g} m): {hits.hits} of {some_runs(hits.runs)} "
        f"({percent(hits.probability)}), 95 % CI {percent(hits.lower)} to {percent(hits.upper)}"
    )


def max_guarantee_m(results: Results) -> float | None:
    """Return the maximum guaranteed miss of runs, m; None if a run has no guarantee."""
    bounds = results.guaranteed_miss_m
    known = results.guarantees and not np.ma.getmaskarray(bounds).any()
    return float(bounds.max()) if known else None


def percent(share: float) -> str:
    """Return a share as a percentage with four digits; only the shares 0 and 1 become 0 % and 100 %."""
    text = f"{100.0 * share:.4g}"
    return f"{f'{100.0 * share:.12g}' if text == '100' and share < 1.0 else text} %"
