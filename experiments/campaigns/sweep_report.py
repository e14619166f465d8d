"""The report of a sweep: its table, its figure, and the values that meet a requirement."""

from __future__ import annotations

import itertools
import zlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from experiments.campaigns.samples import game_notes, heading, sample_json
from experiments.campaigns.sweep_axes import unit_of
from experiments.campaigns.sweep_table import (
    QUANTITY_NAMES,
    SHOWN,
    SHOWN_WITH_HITS,
    TABLE,
    SweepTable,
    answers,
    value_text,
    values_text,
)
from experiments.common.errors import InputError, input_errors
from experiments.common.output import Output, hit_key
from experiments.common.screen import Part, number, number_table, some_runs
from experiments.interception.study import SetCounts, random_note, set_warnings, study_title
from guidance import NoiseKind
from sim import QuantileName, Requirement
from sim.requirement import CONFIDENCE, AnyRequirement, Decision, Verdict, parse_requirement
from sim.storage import CampaignFolder

MAX_SHOWN = 8
MAX_LINES = 40
FIXED = "a fixed number of runs"
"""Condition under which the confidence of an interval holds: no runs are added after a look at the results."""


def figure_names(noises: Sequence[str]) -> list[str]:
    """Return the name of the figure of each noise."""
    return ["figure-sweep"] if len(noises) == 1 else [f"figure-sweep-{noise}" for noise in noises]


@dataclass(frozen=True)
class SweepReport:
    """The stored runs of a sweep, the decisions about a requirement, and the quantiles that the figure shows."""

    folder: CampaignFolder
    table: SweepTable
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
            **({"notes": notes} if (notes := self._notes()) else {}),
            **({} if elapsed_s is None else {"elapsed_s": elapsed_s}),
            "axes": [
                {"key": axis.key, "unit": unit_of(axis.key), "scale": axis.scale, "values": list(axis.values)}
                for axis in table.axes
            ],
            "require": str(table.required),
            "confidence": CONFIDENCE,
            "confidence_holds": {
                "requirement": "any number of runs" if self.folder.manifest.is_watched else FIXED,
                "hit": FIXED,
                "quantiles": FIXED,
            },
            "answers": [
                {"noise": noise, "at": answer.at, "met": answer.met, "limits": [vars(limit) for limit in answer.limits]}
                for noise in table.noises
                for answer in answers(table, noise)
            ],
            "cells": [
                {
                    "values": self.folder.manifest.values_of(cell),
                    "requirement": table.decision(cell).value,
                    **hit_key(table.hits[cell]),
                    "samples": [
                        {**sample_json(sample), "requirement": _verdict_json(table.verdict(cell, sample.noise))}
                        for sample in samples
                    ],
                }
                for cell, samples in enumerate(table.cells)
            ],
        }

    def save(self, written: Output) -> None:
        """Write the table, and for one or two axes a figure of each noise, into the output's folder."""
        written.save(TABLE, self.folder.table_file(*self.table.columns()))
        if self.is_drawn and written.folder is not None:
            from experiments.campaigns.sweep_figures import draw_sweep

            for noise, name in zip(self.table.noises, figure_names(self.table.noises), strict=True):
                written.figure(name, draw_sweep(self.table, self.shown, noise))

    def parts(self) -> Iterator[Part]:
        """Yield the decision of every cell, and the limits of the values that meet the requirement, for the screen."""
        folder, table = self.folder, self.table
        manifest = folder.manifest
        watched = " although runs were added" if manifest.is_watched else ""
        if manifest.until:
            watched = " although runs are added until it is made"
        yield study_title(manifest.scenario, manifest.strategy, manifest.seed)
        yield f"{len(table.cells)} cells, {some_runs(folder.finished_runs)}"
        yield (
            f"the decision in each cell has a confidence of at least 95 %{watched}; this holds for each cell, and for "
            "all cells along a key together only if the outcome of every run is monotone in it"
        )
        for noise in table.noises:
            verdicts = [table.verdict(cell, noise) for cell in range(len(table.cells))]
            counts = Counter(verdict.decision for verdict in verdicts if verdict is not None)
            is_bounded = table.required.quantity in ("miss_m", "hit")  # game noise is one adversary
            against = " against this adversary" if noise == NoiseKind.GAME.value and is_bounded else ""
            words = {Decision.MET: f"met{against}"}
            decisions = ", ".join(f"{words.get(decision, decision)} in {counts[decision]}" for decision in Decision)
            yield f"{noise} noise: {table.required} is {decisions} of {len(verdicts)} cells"
            yield from self._answer_lines(noise)
            yield from _decision_tables(table, noise)
            yield from _unknown_notes(verdicts, table.required)
            yield from self._undecided_notes(noise)
        sets = sum((sample.sets for samples in table.cells for sample in samples), SetCounts())
        yield from self._notes()
        yield f"all cells: {sets}"
        yield from set_warnings(manifest.scenario.information_set.model, sets)

    def _notes(self) -> list[str]:
        """Return lines about keys without an effect, and about what results with random noise and game noise are."""
        lines = []
        shape = [len(axis.values) for axis in self.table.axes]
        digests = np.array([_digest(self.folder, cell) for cell in range(len(self.table.cells))]).reshape(shape)
        for number_of_axis, axis in enumerate(self.table.axes):
            first = digests.take([0], axis=number_of_axis)
            if len(axis.values) > 1 and (digests == first).all():
                which = f"all {len(axis.values)} cells" if len(shape) == 1 else "all cells that differ only in it"
                lines.append(f"{axis.key} has no effect: {which} have the same results")
        if NoiseKind.RANDOM.value in self.table.noises:
            lines.append(random_note(self.folder.manifest.scenario))
        return lines + game_notes(self.folder)

    def _undecided_notes(self, noise: str) -> list[str]:
        """Return a line about the runs of the undecided cells, and how many more may decide them."""
        manifest, noises = self.folder.manifest, len(self.table.noises)
        undecided = [
            (sum(sample.runs for sample in samples), verdict.runs_needed)
            for samples, verdicts in zip(self.table.cells, self.table.verdicts, strict=True)
            for verdict in (verdicts.get(noise),)
            if verdict is not None and verdict.decision is Decision.UNDECIDED
        ]
        if not undecided:
            return []
        text = "1 cell is undecided" if len(undecided) == 1 else f"{len(undecided)} cells are undecided"
        runs = [count for count, _ in undecided]
        after = _range(min(runs), max(runs), str)
        text += f" after {after} {'run' if after == '1' else 'runs'}"
        if noises > 1:
            text += " per cell with all noises"
        more = [needed - count for count, needed in undecided if needed is not None]
        if more:
            which = "" if len(more) == len(undecided) else f" in {len(more)} of them"
            text += f"; about {_range(min(more), max(more), _about)} more runs per cell would decide{which}"
        if len(more) < len(undecided):
            where = f" in {len(undecided) - len(more)} of them" if more else ""
            text += f"; the estimate is at the bound{where}: the number of runs that would decide is not known yet"
        hint = (
            f"a greater --max-runs than {manifest.runs}"
            if manifest.until
            else "--until decided (--max-runs, by default 2000)"
        )
        return [text, f"to add runs to these cells: repeat infoset sweep with --resume and {hint}"]

    def _answer_lines(self, noise: str) -> Iterator[str]:
        lines = answers(self.table, noise)
        yield f"along {self.table.axes[0].key}:"
        for answer in lines[:MAX_LINES]:
            yield f"  {answer.met}{f' (at {answer.at})' if answer.at else ''}"
        if len(lines) > MAX_LINES:
            yield f"  {len(lines) - MAX_LINES} more lines are in the JSON report (--json)"


def _digest(folder: CampaignFolder, cell: int) -> int:
    """Return a checksum of the misses, impulses and bounds of a cell."""
    names = ("miss_m", "impulse_m_s", "guaranteed_miss_m")
    return zlib.crc32(b"".join(folder.numbers(name, cell).filled(-1.0).tobytes() for name in names))


def _verdict_json(verdict: Verdict | None) -> dict[str, object] | None:
    if verdict is None:
        return None
    names = ("value", "lower", "upper", "known", "runs_needed")
    return {"decision": verdict.decision.value, **{name: getattr(verdict, name) for name in names}}


def _unknown_notes(verdicts: Sequence[Verdict | None], required: AnyRequirement) -> list[str]:
    """Return a line about the runs without the required quantity; no line if all have it."""
    stored = [verdict for verdict in verdicts if verdict is not None]
    runs, known = sum(verdict.runs for verdict in stored), sum(verdict.known for verdict in stored)
    if runs == known:
        return []
    return [f"{known} of {runs} runs have a value of {required.quantity}; the others do not satisfy the bound"]


def _range(minimum: int, most: int, name: Callable[[int], str]) -> str:
    return " to ".join(dict.fromkeys((name(minimum), name(most))))


def _about(count: int) -> str:
    """Return a number of runs with two digits, rounded up."""
    step = 10 ** max(0, len(str(count)) - 2)
    return str(-(-count // step) * step)


def _decision_tables(table: SweepTable, noise: str) -> Iterator[Part]:
    """Yield decisions and estimates as tables with titles: a row for each value of an axis, or a grid of two axes.

    With more axes there is a grid for each combination of the other values, at most `MAX_LINES` grids.
    """
    first, *others = table.axes
    if not others:
        unit = unit_of(first.key)
        titles = (f"value, {unit}" if unit else "value", "decision", "runs", table.required.name, "95 % CI")
        shown = number_table(*titles, left=2)
        for cell, value in enumerate(first.values):
            verdict = table.verdict(cell, noise)
            if verdict is not None:
                shown.add_row(value_text(first, value), str(verdict.decision), str(verdict.runs), *_estimate(verdict))
        yield shown
        return
    second, *rest = others
    shape = [len(axis.values) for axis in table.axes]
    cells = np.arange(len(table.cells)).reshape(shape)
    for indices in itertools.islice(np.ndindex(*shape[2:]), MAX_LINES):
        grid = cells[(slice(None), slice(None), *indices)]
        at = values_text(rest, indices)
        shown = number_table("", *(value_text(second, value) for value in second.values))
        for row, value in enumerate(first.values):
            verdicts = [table.verdict(cell, noise) for cell in grid[row].tolist()]
            lines = [("-",) if one is None else (str(one.decision), *_estimate(one), str(one.runs)) for one in verdicts]
            shown.add_row(value_text(first, value), *map("\n".join, lines))
        keys = f"{first.key} (rows) and {second.key} (columns){f', at {at}' if at else ''}"
        units = {"rows": unit_of(first.key), "columns": unit_of(second.key)}
        unit_text = ", ".join(f"{name} in {unit}" for name, unit in units.items() if unit)
        unit = QUANTITY_NAMES[table.required.quantity].partition(", ")[2]
        estimate = f"{table.required.name} in {unit}" if unit else table.required.name
        cell_text = f"lines of a cell: decision, {estimate} (- if too few runs), its 95 % CI, number of runs"
        yield f"{keys}\n{unit_text}; {cell_text}" if unit_text else f"{keys}\n{cell_text}"
        yield shown


def _estimate(verdict: Verdict) -> tuple[str, str]:
    """Return the estimate of a decision and its interval as text."""
    return number(verdict.value), f"{number(verdict.lower)} to {number(verdict.upper)}"


def quantile_options(
    require: str | None, show: str | None, default: str
) -> tuple[AnyRequirement, tuple[QuantileName, ...]]:
    """Read the values of --require and --show; a required quantile is always the first of those shown."""
    with input_errors("--require"):
        required = parse_requirement(default if require is None else require)
    default_shown = SHOWN if isinstance(required, Requirement) else SHOWN_WITH_HITS
    with input_errors("--show"):
        chosen = default_shown if show is None else tuple(QuantileName.parse(text) for text in show.split(","))
    if len(chosen) > MAX_SHOWN:
        raise InputError(f"--show: at most {MAX_SHOWN} quantiles can be drawn, found {len(chosen)}; leave some out")
    first = (required.quantile,) if isinstance(required, Requirement) else ()
    return required, tuple(dict.fromkeys((*first, *chosen)))


def default_requirement(*, has_size: bool) -> str:
    """Return the requirement of a sweep without --require: a hit, if the body has a size."""
    return "hit>=0.95" if has_size else "miss_m p99<10"
