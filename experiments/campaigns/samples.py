"""What the rows of a campaign come to: a sample a noise, quantiles with their intervals, the worst runs."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.common.output import library_version
from sim import Outcome, QuantileEstimate, estimate_quantiles
from sim.stopping_rule import QUANTITIES, level_name
from sim.storage import CampaignFolder, scenario_hash

Floats = NDArray[np.float64]

LEVELS = (0.1, 0.5, 0.9, 0.99, 0.999)
START = ("z_km", "x_km", "vz_km_s", "vx_km_s")
WORST = 10
OUTCOMES = tuple(each.value for each in Outcome)


@dataclass(frozen=True)
class Sample:
    """The engagements of one noise.

    Parameters
    ----------
    noise : str
    runs : int
    quantiles : mapping of str to sequence of QuantileEstimate
        By quantity, those of `LEVELS`; without the guaranteed miss where it is never known.
    worst : mapping of str to float
        The greatest of each quantity.
    outcomes : mapping of str to int
    truth_kept : int
        Runs whose truth stayed in its own section.
    phi_held, phi_known : int
        Runs whose miss stayed within the guaranteed one, and runs that have one; 0 in a model that guarantees nothing.
    """

    noise: str
    runs: int
    quantiles: Mapping[str, Sequence[QuantileEstimate]]
    worst: Mapping[str, float]
    outcomes: Mapping[str, int]
    truth_kept: int
    phi_held: int
    phi_known: int


def noises_of(folder: CampaignFolder) -> list[str]:
    """Return the noises that a campaign flies."""
    return [kind.value for kind in folder.manifest.noise.kinds]


def noise_flags(folder: CampaignFolder) -> dict[str, NDArray[np.bool_] | slice]:
    """Return which rows are of which noise; a slice where all are."""
    noises = noises_of(folder)
    if len(noises) == 1:
        return {noises[0]: slice(None)}
    codes = folder.codes("noise", noises)
    return {noise: codes == place for place, noise in enumerate(noises)}


def samples(folder: CampaignFolder, cell: int | None = None, levels: Sequence[float] = LEVELS) -> list[Sample]:
    """Summarise what is stored, a sample a noise.

    Parameters
    ----------
    folder : CampaignFolder
    cell : int or None
        Of a sweep; None is all rows.
    levels : sequence of float
        Of the quantiles.

    Returns
    -------
    list of Sample
        Without those of which there is no row yet.

    Notes
    -----
    One quantity of one noise is in memory at a time, 8 bytes an engagement, and a sorted copy of it.
    """
    noises = noises_of(folder)
    told = {noise: _Tally() for noise in noises}
    guarantees = folder.manifest.guarantee and folder.manifest.scenario.set_model.is_guaranteed
    columns = ["truth_margin_m", *(("miss_m", "guaranteed_miss_m") if guarantees else ())]
    for numbers, codes in folder.shards(columns, {"noise": noises, "outcome": OUTCOMES}, cell):
        for place, tally in enumerate(told.values()):
            rows = codes["noise"] == place
            tally.outcomes += np.bincount(codes["outcome"][rows], minlength=len(OUTCOMES))
            tally.truth_kept += int((numbers["truth_margin_m"][rows].filled(0.0) >= 0.0).sum())
            if guarantees:
                guaranteed = numbers["guaranteed_miss_m"][rows]
                tally.phi_known += int(guaranteed.count())
                tally.phi_held += int((numbers["miss_m"][rows].data <= guaranteed.filled(-np.inf)).sum())
    quantiles: dict[str, dict[str, list[QuantileEstimate]]] = {noise: {} for noise in noises}
    worst: dict[str, dict[str, float]] = {noise: {} for noise in noises}
    for quantity in QUANTITIES:
        for noise in noises:
            known = folder.sample(quantity, noise, cell)
            if known.size:
                quantiles[noise][quantity] = estimate_quantiles(known, levels)
                worst[noise][quantity] = float(known.max())
            del known  # before the next is read, not after
    return [
        Sample(
            noise,
            int(tally.outcomes.sum()),
            quantiles[noise],
            worst[noise],
            {name: int(count) for name, count in zip(OUTCOMES, tally.outcomes, strict=True) if count},
            tally.truth_kept,
            tally.phi_held,
            tally.phi_known,
        )
        for noise, tally in told.items()
        if tally.outcomes.any()
    ]


@dataclass
class _Tally:
    """What is counted of the rows of a noise, shard by shard."""

    outcomes: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(OUTCOMES), dtype=np.int64))
    truth_kept: int = 0
    phi_held: int = 0
    phi_known: int = 0


def heading(folder: CampaignFolder) -> dict[str, Any]:
    """Return what every JSON of a campaign or a sweep begins with."""
    manifest = folder.manifest
    return {
        "version": library_version(),
        "kind": manifest.kind,
        "scenario": manifest.scenario.name,
        "scenario_hash": scenario_hash(manifest.scenario),
        "model": manifest.scenario.set_model.kind.value,
        "strategy": manifest.strategy,
        "noise": manifest.noise.value,
        "range_meter": manifest.scenario.range_sensor is not None,
        "seed": manifest.seed,
        "runs": folder.finished_runs,
        "wanted_runs": folder.wanted_runs,
        "complete": folder.complete,
        "until": manifest.until,
        "stopped_after": manifest.stopped_after,
    }


@dataclass(frozen=True)
class WorstRun:
    """One of the runs that missed by most.

    Parameters
    ----------
    run : int
    noise, outcome : str
    miss_m, impulse_m_s : float
    replay : str
        The command that flies it again.
    """

    run: int
    noise: str
    outcome: str
    miss_m: float
    impulse_m_s: float
    replay: str


def worst_runs(folder: CampaignFolder, scenario_file: Path) -> list[WorstRun]:
    """Return the runs of a campaign that missed by most, the worst first, each with how to fly it again.

    Parameters
    ----------
    folder : CampaignFolder
    scenario_file : Path
        Of the campaign's scenario.

    Returns
    -------
    list of WorstRun
    """
    miss = folder.numbers("miss_m").data
    count = min(WORST, miss.size)
    places = np.argpartition(-miss, count - 1)[:count] if count else np.zeros(0, dtype=np.int64)
    places = places[np.lexsort((places, -miss[places]))]
    return [
        WorstRun(
            row["run"],
            row["noise"],
            row["outcome"],
            row["miss_m"],
            row["impulse_m_s"],
            replay_line(scenario_file, row["run"], folder.manifest.seed, row["noise"]),
        )
        for row in folder.at(places.tolist())
    ]


def replay_line(scenario_file: Path, run: int, seed: int, noise: str) -> str:
    """Return the command that flies a run of a campaign again, step by step."""
    return f"infoset engage {shlex.quote(str(scenario_file))} --noise {noise} --seed {seed} --run {run}"


def to_json(found: Sample) -> dict[str, Any]:
    """Return a sample as JSON values."""
    return {
        "noise": found.noise,
        "runs": found.runs,
        "outcomes": dict(found.outcomes),
        "truth_kept": found.truth_kept,
        "phi_held": found.phi_held if found.phi_known else None,
        "phi_known": found.phi_known,
        **{
            quantity: {
                **{
                    level_name(each.level): {"value": each.value, "lower": each.lower, "upper": each.upper}
                    for each in estimates
                },
                "max": found.worst[quantity],
            }
            for quantity, estimates in found.quantiles.items()
        },
    }
