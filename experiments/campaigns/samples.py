"""Summaries of the rows of a campaign: quantiles with their intervals for each noise, and the worst runs."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from experiments.common.output import hit_key
from experiments.common.screen import Part, number, number_table, quantile_notes, some_runs
from experiments.interception.runs.shared import bound_name
from experiments.interception.study import SetCounts, game_note, hit_text, set_counts, set_warnings
from guidance import NoiseKind
from infoset.arrays import Flags, Integers
from sim import HitEstimate, Outcome, QuantileEstimate, estimate_hits, estimate_quantiles
from sim.statistics import level_name, shows
from sim.stopping_rule import QUANTITIES
from sim.storage import CampaignFolder, fingerprint
from sim.versions import versions

LEVELS = (0.1, 0.5, 0.9, 0.99, 0.999)
WORST = 10
OUTCOMES = tuple(outcome.value for outcome in Outcome)


@dataclass(frozen=True)
class Sample:
    """The engagements of one noise.

    Parameters
    ----------
    quantiles : mapping of str to sequence of QuantileEstimate
        Quantiles by quantity; without the guaranteed miss if it is not known in any run.
    worst : mapping of str to float
        Largest value of each quantity.
    outcomes : mapping of str to int
        Number of runs with each outcome.
    hits : HitEstimate or None
        Probability of a hit; None if the body has no size.
    phi_held, phi_known : int
        Runs whose miss is at most Phi, and runs with a Phi; 0 in a model without a guarantee.
    known : mapping of str to int
        Runs with a value of each quantity.
    """

    noise: str
    runs: int = 0
    quantiles: Mapping[str, Sequence[QuantileEstimate]] = field(default_factory=dict)
    worst: Mapping[str, float] = field(default_factory=dict)
    outcomes: Mapping[str, int] = field(default_factory=dict)
    sets: SetCounts = field(default_factory=SetCounts)
    hits: HitEstimate | None = None
    phi_held: int = 0
    phi_known: int = 0
    known: Mapping[str, int] = field(default_factory=dict)


def noises_of(folder: CampaignFolder) -> list[str]:
    """Return the noises of a campaign."""
    return [kind.value for kind in folder.manifest.noise.kinds]


def noise_flags(folder: CampaignFolder) -> dict[str, Flags | slice]:
    """Return the rows of each noise as flags, or as a slice if there is one noise."""
    noises = noises_of(folder)
    if len(noises) == 1:
        return {noises[0]: slice(None)}
    codes = folder.codes("noise", noises)
    return {noise: codes == code for code, noise in enumerate(noises)}


def samples(folder: CampaignFolder, cell: int | None = None, levels: Sequence[float] = LEVELS) -> list[Sample]:
    """Return a summary of the stored rows, of one cell or of all, for each noise with rows.

    One quantity of one noise is in memory at a time, with 8 bytes per engagement, and a sorted copy of it.
    """
    noises = noises_of(folder)
    counts = {noise: _Counts() for noise in noises}
    guarantees = folder.manifest.guarantee and folder.manifest.scenario.set_model.is_guaranteed
    columns = ["truth_margin_m", "set_emptied", "hit", *(("miss_m", "guaranteed_miss_m") if guarantees else ())]
    for numbers, codes in folder.shards(columns, {"noise": noises, "outcome": OUTCOMES}, cell):
        for code, count in enumerate(counts.values()):
            rows = codes["noise"] == code
            count.outcomes += np.bincount(codes["outcome"][rows], minlength=len(OUTCOMES))
            kept, emptied = numbers["truth_margin_m"][rows].filled(0.0) >= 0.0, numbers["set_emptied"][rows].data > 0.0
            count.sets += set_counts(kept, emptied)
            count.hits += int(numbers["hit"][rows].sum() or 0)
            count.sized += int(numbers["hit"][rows].count())
            if guarantees:
                guaranteed = numbers["guaranteed_miss_m"][rows]
                count.phi_known += int(guaranteed.count())
                count.phi_held += int((numbers["miss_m"][rows].data <= guaranteed.filled(-np.inf)).sum())
    quantiles: dict[str, dict[str, list[QuantileEstimate]]] = {noise: {} for noise in noises}
    worst: dict[str, dict[str, float]] = {noise: {} for noise in noises}
    sizes: dict[str, dict[str, int]] = {noise: {} for noise in noises}
    for quantity in QUANTITIES:
        for noise in noises:
            known = folder.sample(quantity, noise, cell)
            if known.size:
                quantiles[noise][quantity] = estimate_quantiles(known, levels)
                worst[noise][quantity], sizes[noise][quantity] = float(known.max()), known.size
            del known  # free the memory before the next quantity is read
    return [
        Sample(
            noise,
            int(count.outcomes.sum()),
            quantiles[noise],
            worst[noise],
            {name: int(runs) for name, runs in zip(OUTCOMES, count.outcomes, strict=True) if runs},
            count.sets,
            estimate_hits(count.hits, count.sized) if count.sized else None,
            count.phi_held,
            count.phi_known,
            sizes[noise],
        )
        for noise, count in counts.items()
        if count.outcomes.any()
    ]


@dataclass
class _Counts:
    """Counts over the rows of a noise."""

    outcomes: Integers = field(default_factory=lambda: np.zeros(len(OUTCOMES), dtype=np.int64))
    sets: SetCounts = field(default_factory=SetCounts)
    hits: int = 0
    sized: int = 0
    phi_held: int = 0
    phi_known: int = 0


def heading(folder: CampaignFolder) -> dict[str, Any]:
    """Return the keys with which every JSON file of a campaign or a sweep begins."""
    manifest = folder.manifest
    return {
        "versions": versions(),
        "kind": manifest.kind,
        "scenario": manifest.scenario.name,
        "scenario_hash": fingerprint(manifest.scenario),
        "model": manifest.scenario.information_set.model.value,
        "strategy": manifest.strategy,
        "noise": manifest.noise.value,
        "range_sensor": manifest.scenario.range_sensor is not None,
        "seed": manifest.seed,
        "runs": folder.finished_runs,
        "wanted_runs": folder.wanted_runs,
        "complete": folder.complete,
        "until": manifest.until,
        "stopped_after": manifest.stopped_after,
        **({"notes": notes} if (notes := game_notes(folder)) else {}),
    }


def game_notes(folder: CampaignFolder) -> list[str]:
    """Return a line about what results with game noise are; no line without game noise."""
    return [game_note(folder.manifest.scenario)] if NoiseKind.GAME.value in noises_of(folder) else []


def worst_runs(folder: CampaignFolder, scenario_file: Path) -> list[dict[str, Any]]:
    """Return the runs of a campaign with the largest miss, the worst first; `replay` is the command that repeats it."""
    # The manifest's name of a strategy in a file: mine.py:Mine sha256:...
    file, _, version = folder.manifest.strategy.rpartition(" sha256:")
    own = f" --strategy {shlex.quote(file)}" if version and file else ""
    miss = folder.numbers("miss_m").data
    count = min(WORST, miss.size)
    indices = np.argpartition(-miss, count - 1)[:count] if count else np.zeros(0, dtype=np.int64)
    indices = indices[np.lexsort((indices, -miss[indices]))]
    return [
        {key: row[key] for key in ("run", "noise", "outcome", "hit", "miss_m", "impulse_m_s")}
        | {"replay": replay_line(scenario_file, row["run"], folder.manifest.seed, row["noise"]) + own}
        for row in folder.at(indices.tolist())
    ]


def replay_line(scenario_file: Path, run: int, seed: int, noise: str) -> str:
    """Return the command that simulates a run of a campaign again and shows its steps."""
    return f"infoset engage {shlex.quote(str(scenario_file))} --noise {noise} --seed {seed} --run {run}"


def sample_json(sample: Sample) -> dict[str, Any]:
    """Return a sample as JSON values."""
    return {
        "noise": sample.noise,
        "runs": sample.runs,
        "outcomes": dict(sample.outcomes),
        **hit_key(sample.hits),
        "truth_kept": sample.sets.truth_kept,
        "set_emptied": sample.sets.set_emptied,
        "phi_held": sample.phi_held if sample.phi_known else None,
        "phi_known": sample.phi_known,
        **{
            quantity: {
                **{
                    level_name(estimate.level): {
                        "value": shown_value(sample, quantity, estimate),
                        "lower": estimate.lower,
                        "upper": estimate.upper,
                    }
                    for estimate in estimates
                },
                "max": sample.worst[quantity],
            }
            for quantity, estimates in sample.quantiles.items()
        },
    }


def shown_value(sample: Sample, quantity: str, estimate: QuantileEstimate) -> float | None:
    """Return the value of a quantile; None if the runs with a value of the quantity do not show it."""
    return estimate.value if shows(sample.known[quantity], estimate.level) else None


def sample_parts(folder: CampaignFolder, by_noise: Sequence[Sample]) -> Iterator[Part]:
    """Yield the quantiles with their intervals, a block for each noise, and lines about hits, sets and outcomes.

    There must be at least one sample.
    """
    scenario = folder.manifest.scenario
    phi = bound_name(scenario)
    names = {"miss_m": "miss, m", "impulse_m_s": "impulse, m/s", "guaranteed_miss_m": phi}
    table = number_table("noise", "quantity", "quantile", "value", "95 % CI", left=2)
    notes = []
    for sample in by_noise:
        label = sample.noise
        for quantity, estimates in sample.quantiles.items():
            name = names[quantity]
            for estimate in estimates:
                value = shown_value(sample, quantity, estimate)
                interval = f"{number(estimate.lower)} to {number(estimate.upper)}"
                table.add_row(label, name, level_name(estimate.level), number(value), interval)
                label = name = ""
            table.add_row("", "", "max", number(sample.worst[quantity]), "")
        notes += [f"{sample.noise} noise: {text}" for text in quantile_notes(sample.runs, LEVELS, len(by_noise))]
        outcomes = ", ".join(f"{count} {name}" for name, count in sample.outcomes.items())
        held = (
            f"; miss within the bound Phi: {sample.phi_held} of {some_runs(sample.phi_known)}"
            if sample.phi_known
            else ""
        )
        hits = hit_text(sample.hits, scenario)
        notes += [
            f"{sample.noise} noise: {text}" for text in (hits, f"{sample.sets}{held}; outcomes: {outcomes}") if text
        ]
    yield table
    yield from notes
    yield from set_warnings(scenario.information_set.model, sum((sample.sets for sample in by_noise), SetCounts()))
    yield from game_notes(folder)
    if folder.manifest.stopped_after is not None:
        yield (
            "the intervals are computed with 95 % confidence for a fixed number of runs; the campaign stopped when an "
            "interval was narrow, so their confidence is about 92 to 95 %"
        )
