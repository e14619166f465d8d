"""Tables of stored runs: their summary, correlations with the start, and the worst runs."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from rich.table import Table

from infoset.experiments.campaigns.sample_rows import Step, fits, noises_of, rows_of_samples
from infoset.experiments.campaigns.sweep_axes import tied_keys
from infoset.experiments.common.screen import Part, number, number_table, quantile_notes
from infoset.experiments.interception.runs.shared import bound_name, certificate
from infoset.experiments.interception.study import (
    SetCounts,
    hit_text,
    miss_text,
    noise_notes,
    outlook_text,
    redrawn_text,
    set_warnings,
)
from infoset.sim import (
    CampaignNoise,
    HitEstimate,
    Outcome,
    Results,
    Scenario,
    estimate_hits,
    estimate_quantiles,
)
from infoset.sim.columns import columns_of
from infoset.sim.miss_cause import EXPLAINED, MissCause, max_of_cause
from infoset.sim.statistics import average_ranks, correlation_interval, level_name, shows
from infoset.sim.stopping_rule import QUANTITIES
from infoset.sim.storage import CampaignFolder, fingerprint
from infoset.sim.versions import versions

LEVELS = (0.1, 0.5, 0.9, 0.99, 0.999)
"""Levels of the quantiles: the central ones, and the tails that large campaigns are run for."""
WORST = 10
"""Number of the runs with the largest miss that are listed: they fit a screen."""
OUTCOMES = {outcome.value.replace("-", "_"): outcome.value for outcome in Outcome}
"""Columns of the numbers of runs with each outcome."""
_SIGNED_ONLY = ("start_x_m", "start_vx_m_s")
"""Components along the approach: the correlations of their moduli are not computed."""
CI = ("95 % CI\nfrom", "\nto")
"""Titles of the ends of an interval in a table for the screen."""


def summary(
    folder: CampaignFolder, levels: Sequence[float] = LEVELS, more: Sequence[Step] = ()
) -> pd.DataFrame:
    """Return a table with a row for each cell and noise, followed by the keys of `more` steps.

    The columns are the varied keys; the numbers of all runs, of those with each outcome, and of
    those in which the sets and the bound Phi held; the share of hits; the misses by cause, and what
    explains them; the share of starts drawn again; and for each quantity the maximum and the
    quantiles at some levels. The share of hits and the quantiles have the ends of their 95 %
    confidence intervals. NaN is unknown: the share of hits of a body without a size, a quantile
    that so few runs do not show, and the results of a cell without runs.
    """
    steps = [
        Step(("outcome", "hit", "truth_kept", "set_emptied", "phi_held"), _counts),
        Step(("cause",), _causes),
    ]
    for name, (_, column) in EXPLAINED.items():
        steps.append(Step(("cause", column), partial(_explained, name)))
    steps.append(Step(("redraws",), _redrawn_share))
    for quantity in QUANTITIES:
        steps.append(Step((quantity,), partial(_quantiles, levels=levels)))
    steps += more

    rows = []
    for row in rows_of_samples(folder, steps):
        values = folder.manifest.values_of(row["cell"])
        varied = {key: value for name, value in values.items() for key in tied_keys(name)}
        rows.append({"cell": row["cell"], **varied, **row})

    return pd.DataFrame(rows).astype({"hits": "Int64"})


def _counts(runs: pd.DataFrame) -> dict[str, Any]:
    """Return the numbers of runs by outcome, set and bound Phi, and the hits.

    `phi_known` is the number of runs with a bound, among which `phi_held` are counted.
    """
    row: dict[str, Any] = {"runs": len(runs)}
    for name, outcome in OUTCOMES.items():
        row[name] = int((runs["outcome"] == outcome).sum())
    row["truth_kept"] = int(runs["truth_kept"].sum())
    row["set_emptied"] = int(runs["set_emptied"].sum())
    row["set_failed"] = int((runs["set_emptied"] | ~runs["truth_kept"]).sum())
    row["phi_known"] = int(runs["phi_held"].count())
    row["phi_held"] = int(runs["phi_held"].sum())
    return row | _hits(runs["hit"])


def _hits(hit: pd.Series[bool]) -> dict[str, Any]:
    """Return the number of hits, and their share with its interval.

    All are NaN if it is not known of any run whether it hit (a body without a size, or no runs).
    """
    sized = int(hit.count())
    if not sized:
        return dict.fromkeys(("hits", "hit_probability", "hit_lower", "hit_upper"), math.nan)
    estimate = estimate_hits(int(hit.sum()), sized)
    return {
        "hits": estimate.hits,
        "hit_probability": estimate.probability,
        "hit_lower": estimate.lower,
        "hit_upper": estimate.upper,
    }


def _causes(runs: pd.DataFrame) -> dict[str, Any]:
    return {
        f"missed_{cause.value}": int((runs["cause"] == cause.value).sum()) for cause in MissCause
    }


def _explained(name: str, runs: pd.DataFrame) -> dict[str, float]:
    cause, column = EXPLAINED[name]
    maximum = max_of_cause(runs["cause"].to_numpy(), runs[column].to_numpy(), cause)
    return {f"missed_{name}": or_nan(maximum)}


def _redrawn_share(runs: pd.DataFrame) -> dict[str, float]:
    """Return the share of all drawn starts that were drawn again; no key for uniform starts."""
    if not runs["redraws"].count():
        return {}
    redraws = runs["redraws"].sum()
    return {"redrawn_share": redraws / (len(runs) + redraws)}


def _quantiles(runs: pd.DataFrame, levels: Sequence[float]) -> dict[str, float]:
    """Return the quantiles of the only column with their intervals, and its maximum.

    NaN is a quantile that the sample does not show, and an end beyond the sample.
    """
    (quantity,) = runs
    known = runs[quantity].dropna().to_numpy()
    names = [f"{quantity}_{level_name(level)}" for level in levels]
    if not known.size:
        columns = [f"{name}{end}" for name in names for end in ("", "_lower", "_upper")]
        return dict.fromkeys([*columns, f"{quantity}_max"], math.nan)

    row = {}
    estimates = estimate_quantiles(known, levels)
    for name, level, estimate in zip(names, levels, estimates, strict=True):
        row[name] = estimate.value
        if not shows(known.size, level):
            row[name] = math.nan
        row[f"{name}_lower"] = or_nan(estimate.lower)
        row[f"{name}_upper"] = or_nan(estimate.upper)

    row[f"{quantity}_max"] = float(known.max())
    return row


def start_columns(scenario: Scenario) -> tuple[str, ...]:
    """Return the columns of the components of the initial state; in a plane without y."""
    columns = [column for column in columns_of(Results) if column.name.startswith("start_")]
    return tuple(column.name for column in columns if scenario.is_spatial or not column.optional)


def correlations(folder: CampaignFolder) -> pd.DataFrame:
    """Return the correlations of the miss with the components of the initial state.

    The table has a row for each noise and component, with Pearson's and Spearman's correlation and
    the ends of their 95 % confidence intervals. The moduli of the lateral components are included,
    for example `|start_z_m|`. A correlation is NaN where the component or the miss does not vary,
    and the ends are NaN with fewer than 4 runs.
    """
    # Components of one step share the ranks of the miss.
    start = start_columns(folder.manifest.scenario)
    groups: list[tuple[str, ...]] = [(name,) for name in start]
    if fits(("miss_m", *start), folder.finished_runs):
        groups = [start]
    steps = [Step(("miss_m", *names), _correlations_with_miss) for names in groups]

    rows = []
    for sample in rows_of_samples(folder, steps):
        noise = sample.pop("noise")
        size = sample.pop("runs")
        del sample["cell"]
        for component in sorted(sample, key=lambda name: name.startswith("|")):  # moduli last
            row = {"noise": noise, "component": component}
            for kind, value in sample[component].items():
                lower, upper = correlation_interval(value, size, ranks=kind == "spearman")
                row |= {kind: value, f"{kind}_lower": lower, f"{kind}_upper": upper}
            rows.append(row)

    return pd.DataFrame(rows)


def _correlations_with_miss(runs: pd.DataFrame) -> dict[str, Any]:
    """Return the number of runs, and the correlations of components and their moduli."""
    miss_m = runs["miss_m"]
    ranks = pd.Series(average_ranks(miss_m.to_numpy()))

    def related(component: pd.Series[float]) -> dict[str, float]:
        component_ranks = pd.Series(average_ranks(component.to_numpy()))
        with np.errstate(invalid="ignore", divide="ignore"):  # a component that does not vary
            return {"pearson": miss_m.corr(component), "spearman": ranks.corr(component_ranks)}

    found: dict[str, Any] = {"runs": len(runs)}
    for name in runs.columns.drop("miss_m"):
        if not runs[name].count():
            continue
        found[name] = related(runs[name])
        if name not in _SIGNED_ONLY:
            found[f"|{name}|"] = related(runs[name].abs())

    return found


def worst_runs(folder: CampaignFolder, scenario_file: Path) -> pd.DataFrame:
    """Return the `WORST` runs of a campaign with the largest miss, the worst first.

    The column `replay` has the command that simulates the run again.
    """
    manifest = folder.manifest
    # The manifest's name of a strategy or a noise in a file: mine.py:Mine sha256:...
    # A built-in strategy needs no option: it is in the scenario file.
    file, _, version = manifest.strategy.rpartition(" sha256:")
    strategy = ""
    if version and file:
        strategy = f" --strategy {shlex.quote(file)}"
    own_noise = shlex.quote((manifest.own_noise or "").partition(" sha256:")[0])

    worst = _rows_of_worst(folder)
    noises = worst["noise"].astype(str).replace(CampaignNoise.OWN.value, own_noise)
    scenario = shlex.quote(str(scenario_file))
    replay = [
        f"infoset engage {scenario} --noise {noise} --seed {manifest.seed} --run {run}{strategy}"
        for noise, run in zip(noises, worst["run"], strict=True)
    ]
    return worst.assign(replay=replay)


def _rows_of_worst(folder: CampaignFolder) -> pd.DataFrame:
    """Return some columns of the runs with the largest miss, from the files that contain them.

    The folder is of a campaign, which has one cell.
    """
    (chunks,) = folder.stored_chunks()
    miss_m = folder.read_chunks(chunks, ["miss_m"])["miss_m"]
    positions = miss_m.nlargest(WORST).index.to_numpy()

    # Find the run at each position; position 0 is the first run of the first file.
    ends = np.cumsum([len(runs) for _, runs in chunks])
    files = np.searchsorted(ends, positions, side="right")
    numbers = []
    for file, position in zip(files, positions, strict=True):
        _, runs = chunks[file]
        # The first run of the file is at the position `ends[file] - len(runs)`.
        numbers.append(runs[position - ends[file] + len(runs)])

    columns = ["run", "noise", "outcome", "hit", "cause", "miss_m", "impulse_m_s"]
    read = folder.read_chunks([chunks[file] for file in np.unique(files)], columns)
    # In the order of the misses, not of the files.
    return read.set_index("run", drop=False).loc[numbers]


def heading(folder: CampaignFolder) -> dict[str, Any]:
    """Return the keys with which every JSON file of a campaign or a sweep begins."""
    manifest = folder.manifest
    keys: dict[str, Any] = {
        "versions": versions(),
        "kind": manifest.kind,
        "scenario": manifest.scenario.name,
        "scenario_hash": fingerprint(manifest.scenario),
        "model": manifest.scenario.information_set.model.value,
        "strategy": manifest.strategy,
        "noise": manifest.noise.value,
    }
    if manifest.own_noise:
        keys["own_noise"] = manifest.own_noise
    keys |= {
        "range_sensor": manifest.scenario.range_sensor is not None,
        "seed": manifest.seed,
        "runs": folder.finished_runs,
        "wanted_runs": folder.wanted_runs,
        "complete": folder.complete,
        "until": manifest.until,
        "stopped_after": manifest.stopped_after,
    }
    notes = campaign_notes(folder)
    if notes:
        keys["notes"] = notes
    return keys


def campaign_notes(folder: CampaignFolder) -> list[str]:
    """Return lines that say how the results are to be read, at most one for each noise."""
    return noise_notes(folder.manifest.scenario, noises_of(folder))


def summary_parts(folder: CampaignFolder, table: pd.DataFrame) -> Iterator[Part]:
    """Yield the summary of a campaign for the screen: quantiles, hits, sets and outcomes."""
    manifest = folder.manifest
    samples = [row for row in records(table) if row["runs"]]
    yield screen_table(_quantile_table(samples, bound_name(manifest.scenario)), 2)

    sets = SetCounts()
    for row in samples:
        counts = SetCounts(row["runs"], row["truth_kept"], row["set_emptied"], row["set_failed"])
        for text in _notes(folder, row, counts, len(samples)):
            yield f"{row['noise']} noise: {text}"
        sets += counts

    yield from set_warnings(manifest.scenario.information_set, sets)
    yield from campaign_notes(folder)
    if manifest.stopped_after is not None:
        # The same numbers are in docs/campaigns.md.
        yield (
            "the intervals are computed with 95 % confidence for a fixed number of runs; the "
            "campaign stopped when an interval was narrow, so their confidence is about 92 to 95 %"
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


def _notes(
    folder: CampaignFolder, row: Mapping[str, Any], sets: SetCounts, noises: int
) -> Iterator[str]:
    """Yield lines about hidden quantiles, hits, sets and outcomes of a noise."""
    yield from quantile_notes(row["runs"], LEVELS, noises)

    if row["hits"] is not None:
        hits = HitEstimate(
            row["runs"], row["hits"], row["hit_probability"], row["hit_lower"], row["hit_upper"]
        )
        yield hit_text(hits, folder.manifest.scenario)
        if outlook := outlook_text(hits):
            yield outlook
        missed = {
            name.removeprefix("missed_"): value
            for name, value in row.items()
            if name.startswith("missed_")
        }
        if causes := miss_text(missed, row["runs"], folder.manifest.scenario):
            yield causes

    if started := redrawn_text(row.get("redrawn_share")):
        yield started
    outcomes = ", ".join(
        f"{row[name]} {outcome}" for name, outcome in OUTCOMES.items() if row[name]
    )
    yield f"{certificate(sets, row['phi_held'], row['phi_known'])}; outcomes: {outcomes}"


def records(table: pd.DataFrame) -> list[dict[str, Any]]:
    """Return the rows of a table as JSON values, NaN as None."""
    values: list[dict[str, Any]] = (
        table.astype(object).where(table.notna(), None).to_dict("records")
    )
    return values


def screen_table(table: pd.DataFrame, left: int) -> Table:
    """Return a table for the screen, numbers rounded; NaN is `-`.

    The first `left` columns are text.
    """
    printed = number_table(*table.columns, left=left)
    for row in records(table):
        printed.add_row(*map(_cell, row.values()))
    return printed


def _cell(value: str | float | None) -> str:
    if isinstance(value, str):
        return value
    return number(value)


def or_nan(value: float | None) -> float:
    """Return a number for a table; NaN if it is unknown."""
    if value is None:
        return math.nan
    return value
