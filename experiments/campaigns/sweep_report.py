"""The report of a sweep: its table, its figure, and the values that meet a requirement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from rich.console import Console
from rich.table import Table
from rich.text import Text

from experiments.campaigns.samples import heading, sample_json
from experiments.campaigns.sweep_figures import draw_sweep
from experiments.campaigns.sweep_table import SHOWN, SweepTable, answers, sweep_table, unit_of
from experiments.common.errors import InputError
from experiments.common.output import Output
from experiments.common.screen import number
from sim import QuantileName, Requirement
from sim.storage import CampaignFolder

TABLE = "sweep.parquet"
FIGURE = "figure-sweep"
MOST_SHOWN = 8
MOST_LINES = 40


@dataclass(frozen=True)
class SweepReport:
    """The stored runs of a sweep, their quantiles, and a requirement.

    Parameters
    ----------
    folder : CampaignFolder
        The sweep, finished or not.
    table : SweepTable
        The quantiles of its cells.
    required : Requirement
        Bound of a quantile.
    shown : sequence of QuantileName
        Quantiles that the figure shows.
    """

    folder: CampaignFolder
    table: SweepTable
    required: Requirement
    shown: Sequence[QuantileName]

    @property
    def is_drawn(self) -> bool:
        """Whether there is a figure."""
        return len(self.table.axes) <= 2

    def to_json(self, elapsed_s: float | None = None) -> dict[str, object]:
        """Return the report as JSON values; `elapsed_s` is the time of the simulation, or None."""
        table = self.table
        return {
            **heading(self.folder),
            **({} if elapsed_s is None else {"elapsed_s": elapsed_s}),
            "axes": [
                {"key": axis.key, "unit": unit_of(axis.key), "scale": axis.scale, "values": list(axis.values)}
                for axis in table.axes
            ],
            "require": str(self.required),
            "answers": [
                {"noise": noise, "at": at, "met": met}
                for noise in table.noises
                for at, met in answers(table, noise, self.required)
            ],
            "cells": [
                {
                    "values": self.folder.manifest.values_of(cell),
                    "samples": [sample_json(sample) for sample in samples],
                }
                for cell, samples in enumerate(table.cells)
            ],
        }

    def save(self, written: Output) -> None:
        """Write the table, and the figure of one or two axes, into the output's folder."""
        written.save(TABLE, self.folder.table_file(*self.table.columns()))
        if self.is_drawn and written.folder is not None:
            written.figure(FIGURE, draw_sweep(self.table, self.shown, self.required))

    def show(self, console: Console) -> None:
        """Print where the requirement is met and, for a sweep with one axis, the required quantile of every cell."""

        def line(text: str) -> None:
            console.print(Text(text), soft_wrap=True)

        folder, table, required = self.folder, self.table, self.required
        first = table.axes[0]
        line(
            f"{folder.manifest.scenario.name}, {len(table.cells)} cells, {folder.finished_runs} of "
            f"{folder.wanted_runs} runs"
        )
        for noise in table.noises:
            lines = answers(table, noise, required)
            line(f"{noise} noise: {required} is met for these values of {first.key}:")
            for at, met in lines[:MOST_LINES]:
                line(f"  {met}{f' (at {at})' if at else ''}")
            if len(lines) > MOST_LINES:
                line(f"  {len(lines) - MOST_LINES} more lines are in the JSON report (--json)")
        if len(table.axes) != 1:
            return
        shown = Table(first.key, "noise", box=None, pad_edge=False)
        for title in ("lower limit", str(required.quantile), "upper limit"):
            shown.add_column(title, justify="right")
        for noise in table.noises:
            for cell, value in enumerate(first.values):
                estimate = table.estimate(cell, noise, required.quantile)
                ends = (None,) * 3 if estimate is None else (estimate.lower, estimate.value, estimate.upper)
                shown.add_row(f"{value:g}", noise, *map(number, ends))
        console.print(shown)


def quantile_options(require: str, show: str | None) -> tuple[Requirement, tuple[QuantileName, ...]]:
    """Read the values of --require and --show; the required quantile is always among those shown."""
    try:
        required = Requirement.parse(require)
    except ValueError as error:
        raise InputError(f"--require: {error}") from None
    try:
        chosen = SHOWN if show is None else tuple(QuantileName.parse(text) for text in show.split(","))
    except ValueError as error:
        raise InputError(f"--show: {error}") from None
    if len(chosen) > MOST_SHOWN:
        raise InputError(f"--show: at most {MOST_SHOWN} quantiles can be drawn, found {len(chosen)}; leave some out")
    return required, tuple(dict.fromkeys((*chosen, required.quantile)))


def sweep_report(folder: CampaignFolder, quantiles: tuple[Requirement, tuple[QuantileName, ...]]) -> SweepReport:
    """Summarise a sweep, finished or not, for the quantiles of `quantile_options`."""
    required, shown = quantiles
    return SweepReport(folder, sweep_table(folder, shown), required, shown)
