"""What the rows of a campaign come to: a sample a noise, quantiles with their intervals, the worst runs."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from experiments.output import library_version
from guidance import NoiseKind
from sim import Outcome, QuantileEstimate, estimate_quantiles
from sim.fingerprint import scenario_hash
from sim.stopping_rule import QUANTITIES, level_name
from sim.storage import CampaignFolder

Floats = NDArray[np.float64]

LEVELS = (0.1, 0.5, 0.9, 0.99, 0.999)
START = ("z_km", "x_km", "vz_km_s", "vx_km_s")
WORST = 10
OUTCOMES = tuple(each.value for each in Outcome)
NOISES = tuple(each.value for each in NoiseKind)


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
    return [folder.manifest.noise] if folder.manifest.noise in NOISES else list(NOISES)


def noise_flags(folder: CampaignFolder, cell: int | None = None) -> dict[str, NDArray[np.bool_] | slice]:
    """Return which rows are of which noise; a slice where all are."""
    noises = noises_of(folder)
    if len(noises) == 1:
        return {noises[0]: slice(None)}
    codes = folder.codes("noise", noises, cell)
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
    One column is in memory at a time, 8 bytes an engagement, and a sorted copy of it.
    """
    flags = noise_flags(folder, cell)
    outcomes = folder.codes("outcome", OUTCOMES, cell)
    runs = {noise: int(np.size(outcomes[rows])) for noise, rows in flags.items()}
    counted = {noise: np.bincount(outcomes[rows], minlength=len(OUTCOMES)) for noise, rows in flags.items()}
    quantiles: dict[str, dict[str, list[QuantileEstimate]]] = {noise: {} for noise in flags}
    worst: dict[str, dict[str, float]] = {noise: {} for noise in flags}
    margin = folder.numbers("truth_margin", cell)
    kept = {noise: int((margin[rows].filled(0.0) >= 0.0).sum()) for noise, rows in flags.items()}
    del margin
    held = _held(folder, flags, cell)
    for quantity in QUANTITIES:
        values = folder.numbers(quantity, cell)
        for noise, rows in flags.items():
            known = values[rows].compressed()
            if known.size:
                quantiles[noise][quantity] = estimate_quantiles(known, levels)
                worst[noise][quantity] = float(known.max())
            del known
        del values  # before the next is read, not after
    return [
        Sample(
            noise,
            runs[noise],
            quantiles[noise],
            worst[noise],
            {name: int(count) for name, count in zip(OUTCOMES, counted[noise], strict=True) if count},
            kept[noise],
            *held[noise],
        )
        for noise in flags
        if runs[noise]
    ]


def _held(
    folder: CampaignFolder, flags: Mapping[str, NDArray[np.bool_] | slice], cell: int | None
) -> dict[str, tuple[int, int]]:
    """How many guaranteed misses held, and how many there are, by noise."""
    if not (folder.manifest.guarantee and folder.manifest.scenario.set_model.is_guaranteed):
        return dict.fromkeys(flags, (0, 0))
    miss, guaranteed = folder.numbers("miss_m", cell).data, folder.numbers("guaranteed_miss_m", cell)
    known = ~np.ma.getmaskarray(guaranteed)
    within = known & (miss <= guaranteed.data)
    return {noise: (int(within[rows].sum()), int(known[rows].sum())) for noise, rows in flags.items()}


def heading(folder: CampaignFolder) -> dict[str, Any]:
    """Return what every JSON of a campaign or a sweep begins with."""
    manifest = folder.manifest
    return {
        "version": library_version(),
        "kind": "sweep" if manifest.axes else "campaign",
        "scenario": manifest.scenario.name,
        "scenario_hash": scenario_hash(manifest.scenario),
        "model": manifest.scenario.set_model.kind.value,
        "strategy": manifest.strategy,
        "noise": manifest.noise,
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


def worst_runs(folder: CampaignFolder, scenario_file: Path, count: int = WORST) -> list[WorstRun]:
    """Return the runs of a campaign that missed by most, the worst first, each with how to fly it again.

    Parameters
    ----------
    folder : CampaignFolder
    scenario_file : Path
        Of the campaign's scenario.
    count : int
        How many, if there are as many.

    Returns
    -------
    list of WorstRun
    """
    miss = folder.numbers("miss_m").data
    count = min(count, miss.size)
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
