"""The report of a sweep: its table, its figures, and the values that meet a requirement."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import pandas as pd
from rich.table import Table

from infoset.experiments.campaigns.run_tables import (
    CI,
    campaign_notes,
    heading,
    records,
    screen_table,
)
from infoset.experiments.campaigns.sweep_axes import unit_of
from infoset.experiments.campaigns.sweep_table import SweepTable, limits
from infoset.experiments.common.errors import InputError, input_errors
from infoset.experiments.common.output import Output
from infoset.experiments.common.screen import Part, some_runs
from infoset.experiments.interception.study import SetCounts, random_note, set_warnings, study_title
from infoset.guidance import NoiseKind
from infoset.sim import QuantileName, Requirement
from infoset.sim.requirement import (
    CONFIDENCE,
    MAX_RUNS_NEEDED,
    AnyRequirement,
    Decision,
    parse_requirement,
)
from infoset.sim.storage import CampaignFolder

TABLE = "sweep.parquet"
SHOWN = tuple(
    QuantileName(quantity, level) for quantity in ("miss_m", "impulse_m_s") for level in (0.5, 0.99)
)
"""Quantiles in figures, after the required one."""
MAX_ROWS = 100
"""Maximum number of cells that are printed for each noise: a map of 10 x 10 values."""
_FIXED = "a fixed number of runs"
"""Condition under which the confidence of an interval holds: no runs are added after a look at the
results.
"""


def figure_names(noises: Sequence[str]) -> list[str]:
    """Return the name of the figure of each noise."""
    if len(noises) == 1:
        return ["figure-sweep"]
    return [f"figure-sweep-{noise}" for noise in noises]


@dataclass(frozen=True)
class SweepReport:
    """The stored runs of a sweep, and the decisions about a requirement."""

    folder: CampaignFolder
    table: SweepTable

    @property
    def is_drawn(self) -> bool:
        """Whether there is a figure."""
        return len(self.table.axes) <= 2

    def to_json(self, elapsed_s: float | None = None) -> dict[str, object]:
        """Return the report as JSON values; `elapsed_s` is the time of the simulation, or None."""
        keys = heading(self.folder)
        # These notes include the notes of the heading.
        notes = self._notes()
        if notes:
            keys["notes"] = notes
        if elapsed_s is not None:
            keys["elapsed_s"] = elapsed_s

        holds_for = _FIXED
        if self.folder.manifest.is_watched:
            holds_for = "any number of runs"
        axes = [
            {
                "key": axis.key,
                "unit": unit_of(axis.key),
                "scale": axis.scale,
                "values": list(axis.values),
            }
            for axis in self.table.axes
        ]

        return {
            **keys,
            "axes": axes,
            "require": str(self.table.required),
            "confidence": CONFIDENCE,
            "confidence_holds": {"requirement": holds_for, "hit": _FIXED, "quantiles": _FIXED},
            "limits": records(limits(self.table)),
            "cells": records(self.table.rows),
        }

    def save(self, written: Output) -> None:
        """Write the table into the output's folder, and a figure of each noise if there is one."""
        written.save(TABLE, self.table.rows.to_parquet(index=False))
        if not self.is_drawn or written.folder is None:
            return

        from infoset.experiments.campaigns.sweep_figures import draw_sweep

        required = self.table.required
        # For maps of two keys: the decisions come first, then each quantile but the required one.
        # With a required share the median impulse is left out, so that there are four maps.
        shown = [*SHOWN[:2], SHOWN[3]]
        if isinstance(required, Requirement):
            shown = [*dict.fromkeys((required.quantile, *SHOWN))]
        for noise, name in zip(self.table.noises, figure_names(self.table.noises), strict=True):
            written.figure(name, draw_sweep(self.table, shown, noise))

    def parts(self) -> Iterator[Part]:
        """Yield the decisions of all cells, and the limits of the varied values, for the screen."""
        manifest = self.folder.manifest
        yield study_title(manifest.scenario, manifest.strategy, manifest.seed)
        yield f"{manifest.cells} cells, {some_runs(self.folder.finished_runs)}"

        confidence = f"{100 * CONFIDENCE:g} %"
        if manifest.is_watched:
            confidence += " although runs were added"
        yield (
            f"the decision in each cell has a confidence of at least {confidence}; this holds for "
            "each cell, and for all cells along a key together only if the outcome of every run is "
            "monotone in it"
        )
        for noise in self.table.noises:
            yield from self._decisions(noise)

        rows = self.table.rows
        sets = SetCounts(
            runs=int(rows["runs"].sum()),
            truth_kept=int(rows["truth_kept"].sum()),
            set_emptied=int(rows["set_emptied"].sum()),
            failed=int(rows["set_failed"].sum()),
        )
        yield from self._notes()
        yield f"all cells: {sets}"
        yield from set_warnings(manifest.scenario.information_set, sets)

    def _decisions(self, noise: str) -> Iterator[Part]:
        """Yield the numbers of decisions, and tables of the limits and of the decisions."""
        rows = self.table.of_noise(noise)
        counts = Counter(rows["requirement"])
        yield self._count_text(noise, counts, len(rows))

        found = limits(self.table)
        found = found[found["noise"] == noise].drop(columns="noise")
        if len(found):
            titles = {"met": "met at", "not_met": "not met at", "interpolated": "by interpolation"}
            yield ""
            yield f"limits along {self.table.axes[0].key}:"
            yield self._screen_table(found.rename(columns=titles))

        yield ""
        yield "decisions:"
        yield self._screen_table(self._printed(rows.head(MAX_ROWS)))
        if len(rows) > MAX_ROWS:
            yield f"{len(rows) - MAX_ROWS} more cells are in {TABLE} and in the file of --json"

        runs = int(rows["runs"].sum())
        known = int(rows["required_known"].sum())
        if known < runs:
            yield (
                f"{known} of {runs} runs have a value of {self.table.required.quantity}; the "
                "others do not satisfy the bound"
            )

        if counts[Decision.UNDECIDED.value]:
            more = "--until decided (--max-runs, by default 2000)"
            if self.folder.manifest.until:
                more = f"a greater --max-runs than {self.folder.manifest.runs}"
            yield (
                "to add runs to the undecided cells: repeat infoset sweep with --resume and " + more
            )

    def _count_text(self, noise: str, counts: Counter[str], cells: int) -> str:
        """Return a line with the number of cells of each decision.

        Game noise is one adversary: a bound of the miss is then met only against this adversary.
        """
        required = self.table.required
        met = str(Decision.MET)
        if noise == NoiseKind.GAME.value and required.quantity in ("miss_m", "hit", "cause"):
            met += " against this adversary"
        decisions = ", ".join(
            f"{met if decision is Decision.MET else decision} in {counts[decision.value]}"
            for decision in Decision
        )
        return f"{noise} noise: {required} is {decisions} of {cells} cells"

    def _screen_table(self, table: pd.DataFrame) -> Table:
        """Return a table for the screen; its first columns are keys.

        The names of a key and of its table are in two lines.
        """
        keys = {key: key.replace(".", ".\n", 1) for key in self.table.keys if key in table}
        return screen_table(table.rename(columns=keys), len(keys))

    def _printed(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Return the decisions as a table for the screen, the values of the keys as text."""
        required = self.table.required
        if isinstance(required, Requirement):
            name = str(required.quantile)
        else:
            name = required.name
        printed = rows[self.table.keys].map("{:.6g}".format)
        printed["decision"] = rows["requirement"].fillna("not simulated").str.replace("-", " ")
        printed["runs"] = rows["runs"].astype(str)
        printed[name] = rows["required_value"]
        printed[list(CI)] = rows[["required_lower", "required_upper"]]

        undecided = rows["requirement"] == Decision.UNDECIDED.value
        if undecided.any():
            needed = rows["runs_needed"]
            text = needed.astype(str).mask(needed.isna(), f"> {MAX_RUNS_NEEDED}")
            printed["runs\nneeded"] = text.where(undecided, "")
        return printed

    def _notes(self) -> list[str]:
        """Return lines about keys without an effect, and about the noises."""
        rows = self.table.rows
        keys = self.table.keys
        # `limit_bound` is no result: it may be the radius of the body, which a key can vary.
        results = rows.columns[rows.columns.get_loc("noise") + 1 :].drop(["limit_bound"])
        lines = []

        for axis, key in zip(self.table.axes, keys, strict=True):
            others = [other for other in keys if other != key]
            # Cells without runs would have the same results, all NaN: `all` excludes them.
            fixed = rows.groupby(["noise", *others])[[*results]]
            if rows["runs"].all() and (fixed.nunique(dropna=False) == 1).all(axis=None):
                lines.append(
                    f"{axis.key} has no effect: cells that differ only in it have the same results"
                )

        if NoiseKind.RANDOM.value in self.table.noises:
            lines.append(random_note(self.folder.manifest.scenario))
        return lines + campaign_notes(self.folder)


def read_requirement(text: str | None, *, has_size: bool) -> AnyRequirement:
    """Read the value of --require.

    The default is a hit if the body has a size, else a bound of the miss.
    """
    if not text:
        text = "hit>=0.95" if has_size else "miss_m p99<10"
    with input_errors("--require"):
        required = parse_requirement(text)
    if required.quantity in ("hit", "cause") and not has_size:
        raise InputError(
            f"--require {required}: the scenario has no [body] with a radius; give a bound of the "
            "miss, for example miss_m p99<10"
        )
    return required
