"""Tables of the stored runs of a campaign or a sweep: their summary, correlations with the start, the worst runs."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.table import Table

from infoset.experiments.campaigns.sweep_axes import tied_keys
from infoset.experiments.common.screen import Part, number, number_table, quantile_notes
from infoset.experiments.interception.runs.shared import bound_name, certificate
from infoset.experiments.interception.study import (
    SetCounts,
    hit_text,
    miss_text,
    noise_notes,
    redrawn_text,
    set_warnings,
)
from infoset.sim import CampaignNoise, HitEstimate, Outcome, estimate_hits, estimate_quantiles
from infoset.sim.miss_cause import count_causes
from infoset.sim.statistics import correlation_interval, level_name, shows
from infoset.sim.stopping_rule import QUANTITIES
from infoset.sim.storage import CampaignFolder, fingerprint
from infoset.sim.versions import versions

LEVELS = (0.1, 0.5, 0.9, 0.99, 0.999)
WORST = 10
OUTCOMES = {outcome.value.replace("-", "_"): outcome.value for outcome in Outcome}
"""Columns of the numbers of runs with each outcome."""


CAUSE = ("cause", "unguided_miss_m", "engine_corrects_m", "last_possible_m")
"""Columns of the runs that say why they missed."""
COLUMNS = ("cell", "noise", "outcome", "hit", *CAUSE, "truth_kept", "set_emptied", "phi_held", "redraws", *QUANTITIES)
"""Columns of the runs that `summary` needs."""
CI = ("95 % CI\nfrom", "\nto")
"""Titles of the ends of an interval in a table for the screen."""


def noises_of(folder: CampaignFolder) -> list[str]:
    """Return the noises of a campaign."""
    return [kind.value for kind in folder.manifest.noise.kinds]


def groups(folder: CampaignFolder, runs: pd.DataFrame) -> Iterator[tuple[int, str, pd.DataFrame]]:
    """Yield the runs of each cell and noise, which may be none; a campaign has one cell."""
    stored = dict(list(runs.groupby(["cell", "noise"], observed=True)))
    for cell in range(folder.manifest.cells):
        for noise in noises_of(folder):
            yield cell, noise, stored.get((cell, noise), runs.iloc[:0])


def summary(folder: CampaignFolder, runs: pd.DataFrame, levels: Sequence[float] = LEVELS) -> pd.DataFrame:
    """Return a table with a row for each cell and noise.

    The columns are the varied keys; the numbers of all runs, of those with each outcome, and of those in which the
    sets and the bound Phi held; the share of hits; the misses by cause, and what explains them; and for each quantity
    the maximum and the quantiles at some levels. Shares and quantiles have the ends of their 95 % confidence intervals.
    NaN is unknown: the share of hits of a body without a size, and a quantile that so few runs do not show.
    """
    rows = []
    for cell, noise, chosen in groups(folder, runs):
        varied = {key: value for name, value in folder.manifest.values_of(cell).items() for key in tied_keys(name)}
        row = {"cell": cell, **varied, "noise": noise, **_counts(chosen)}
        for quantity in QUANTITIES:
            row |= _quantiles(quantity, chosen[quantity].dropna().to_numpy(), levels)
        rows.append(row)
    return pd.DataFrame(rows).astype({"hits": "Int64"})


def _counts(runs: pd.DataFrame) -> dict[str, Any]:
    sized = int(runs["hit"].count())
    hits = vars(estimate_hits(int(runs["hit"].sum()), sized)) if sized else {}
    missed = count_causes(*(runs[name].to_numpy() for name in CAUSE))
    redraws = runs["redraws"].sum()
    return {
        "runs": len(runs),
        **{name: int((runs["outcome"] == outcome).sum()) for name, outcome in OUTCOMES.items()},
        "truth_kept": int(runs["truth_kept"].sum()),
        "set_emptied": int(runs["set_emptied"].sum()),
        "set_failed": int((runs["set_emptied"] | ~runs["truth_kept"]).sum()),
        "phi_known": int(runs["phi_held"].count()),
        "phi_held": int(runs["phi_held"].sum()),
        "hits": hits.get("hits", math.nan),
        **{f"hit_{name}": hits.get(name, math.nan) for name in ("probability", "lower", "upper")},
        **{f"missed_{name}": or_nan(value) for name, value in missed.items()},
        **({"redrawn_share": redraws / (len(runs) + redraws)} if runs["redraws"].count() else {}),
    }


def _quantiles(quantity: str, known: Any, levels: Sequence[float]) -> dict[str, float]:
    row = {}
    estimates = estimate_quantiles(known, levels) if known.size else [None] * len(levels)
    for level, estimate in zip(levels, estimates, strict=True):
        name = f"{quantity}_{level_name(level)}"
        row[name] = estimate.value if estimate is not None and shows(known.size, level) else math.nan
        row |= {f"{name}_{end}": or_nan(getattr(estimate, end, None)) for end in ("lower", "upper")}
    return row | {f"{quantity}_max": float(known.max()) if known.size else math.nan}


def correlations(folder: CampaignFolder, runs: pd.DataFrame) -> pd.DataFrame:
    """Return Pearson's and Spearman's correlation of the miss with each component of the initial state, by noise.

    Each has the ends of its 95 % confidence interval. The moduli of the lateral components are included, for example
    `|start_z_m|`. A correlation is NaN where the component or the miss does not vary, and so are its ends with fewer
    than 4 runs.
    """
    rows = []
    for _, noise, chosen in groups(folder, runs):
        start = chosen.filter(like="start_").dropna(axis="columns", how="all")
        moduli = start.drop(columns=["start_x_m", "start_vx_m_s"], errors="ignore").abs()
        components = pd.concat([start, moduli.add_prefix("|").add_suffix("|")], axis="columns")
        with np.errstate(invalid="ignore", divide="ignore"):  # a component that does not vary
            both = {
                "pearson": components.corrwith(chosen["miss_m"]),
                "spearman": components.rank().corrwith(chosen["miss_m"].rank()),
            }
        for component in components:
            row = {"noise": noise, "component": component}
            for kind, found in both.items():
                value = found[component]
                ends = correlation_interval(value, len(chosen), ranks=kind == "spearman")
                row |= {kind: value, f"{kind}_lower": ends[0], f"{kind}_upper": ends[1]}
            rows.append(row)
    return pd.DataFrame(rows)


def worst_runs(folder: CampaignFolder, runs: pd.DataFrame, scenario_file: Path) -> pd.DataFrame:
    """Return the runs with the largest miss, the worst first; `replay` is the command that simulates a run again."""
    # The manifest's name of a strategy or a noise in a file: mine.py:Mine sha256:...
    file, _, version = folder.manifest.strategy.rpartition(" sha256:")
    own = f" --strategy {shlex.quote(file)}" if version and file else ""
    own_noise = shlex.quote((folder.manifest.own_noise or "").partition(" sha256:")[0])
    worst = runs.nlargest(WORST, "miss_m")[["run", "noise", "outcome", "hit", "cause", "miss_m", "impulse_m_s"]]
    command = f"infoset engage {shlex.quote(str(scenario_file))} --noise {{}} --seed {folder.manifest.seed} --run {{}}"
    noises = worst["noise"].astype(str).replace(CampaignNoise.OWN.value, own_noise)
    replay = [command.format(noise, run) + own for noise, run in zip(noises, worst["run"], strict=True)]
    return worst.assign(replay=replay)


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
        **({"own_noise": manifest.own_noise} if manifest.own_noise else {}),
        "range_sensor": manifest.scenario.range_sensor is not None,
        "seed": manifest.seed,
        "runs": folder.finished_runs,
        "wanted_runs": folder.wanted_runs,
        "complete": folder.complete,
        "until": manifest.until,
        "stopped_after": manifest.stopped_after,
        **({"notes": notes} if (notes := campaign_notes(folder)) else {}),
    }


def campaign_notes(folder: CampaignFolder) -> list[str]:
    """Return a line for each noise about what its results are; none for random noise."""
    return noise_notes(folder.manifest.scenario, noises_of(folder))


def summary_parts(folder: CampaignFolder, table: pd.DataFrame) -> Iterator[Part]:
    """Yield the summary of a campaign for the screen: the quantiles, and lines about hits, sets and outcomes."""
    manifest = folder.manifest
    samples = [row for row in records(table) if row["runs"]]
    yield screen_table(_quantile_table(samples, bound_name(manifest.scenario)), 2)
    sets = SetCounts()
    for row in samples:
        counts = SetCounts(row["runs"], row["truth_kept"], row["set_emptied"], row["set_failed"])
        for text in _notes(folder, row, counts, len(samples)):
            yield f"{row['noise']} noise: {text}"
        sets += counts
    yield from set_warnings(manifest.scenario.information_set.model, sets)
    yield from campaign_notes(folder)
    if manifest.stopped_after is not None:
        yield (
            "the intervals are computed with 95 % confidence for a fixed number of runs; the campaign stopped when an "
            "interval was narrow, so their confidence is about 92 to 95 %"
        )


def _quantile_table(samples: Sequence[Mapping[str, Any]], phi: str) -> pd.DataFrame:
    """Return the quantiles and the maxima as a table for the screen, one row each."""
    names = {"miss_m": "miss, m", "impulse_m_s": "impulse, m/s", "guaranteed_miss_m": phi}
    rows = []
    for row in samples:
        known = [quantity for quantity in names if row[f"{quantity}_max"] is not None]
        for quantity in known:
            for level in (*map(level_name, LEVELS), "max"):
                column = f"{quantity}_{level}"
                ends = (row.get(f"{column}_lower"), row.get(f"{column}_upper"))
                rows.append((row["noise"], names[quantity], level, row[column], *ends))
    return pd.DataFrame(rows, columns=["noise", "quantity", "quantile", "value", *CI])


def _notes(folder: CampaignFolder, row: Mapping[str, Any], sets: SetCounts, noises: int) -> Iterator[str]:
    """Yield lines about the quantiles that are not shown, hits, sets and outcomes of a noise."""
    yield from quantile_notes(row["runs"], LEVELS, noises)
    if row["hits"] is not None:
        ends = (row["hit_probability"], row["hit_lower"], row["hit_upper"])
        yield hit_text(HitEstimate(row["runs"], row["hits"], *ends), folder.manifest.scenario)
        missed = {name.removeprefix("missed_"): value for name, value in row.items() if name.startswith("missed_")}
        if causes := miss_text(missed, row["runs"], folder.manifest.scenario):
            yield causes
    if started := redrawn_text(row.get("redrawn_share")):
        yield started
    outcomes = ", ".join(f"{row[name]} {outcome}" for name, outcome in OUTCOMES.items() if row[name])
    yield f"{certificate(sets, row['phi_held'], row['phi_known'])}; outcomes: {outcomes}"


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table as JSON values, NaN as None."""
    values: list[dict[str, Any]] = table.astype(object).where(table.notna(), None).to_dict("records")
    return values


def screen_table(table: pd.DataFrame, left: int) -> Table:
    """Return a table for the screen, with the first `left` columns as text and numbers rounded; NaN is `-`."""
    printed = number_table(*table.columns, left=left)
    for row in records(table):
        printed.add_row(*(value if isinstance(value, str) else number(value) for value in row.values()))
    return printed


def or_nan(value: float | None) -> float:
    """Return a number for a table, NaN if it is unknown."""
    return math.nan if value is None else value
