"""infoset sweep: what values of a scenario meet a requirement."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.campaigns.options import (
    SCENARIO_FILE,
    CampaignOut,
    Chunk,
    Dask,
    NoiseName,
    Processes,
    Resume,
    Workers,
)
from experiments.common.options import Json, Overwrite, Quiet, Seed, whole_number
from experiments.interception.options import MOST_RUNS, ModelName, RangeMeter, ScenarioName, StrategyName, TieName

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from experiments.campaigns.options import Crew
    from experiments.campaigns.sweep_table import SweepTable
    from sim import CampaignResult, QuantileName, Requirement, Sweep
    from sim.storage import CampaignFolder

FIGURE = "figure-sweep"
ASK_FROM = 1_000_000
"""Engagements from which on a sweep is begun only when told so."""

MOST_SHOWN = 8
MOST_LINES = 40

ShownQuantiles = Annotated[
    str | None,
    typer.Option(
        "--show",
        metavar="QUANTILES",
        help='What is drawn, separated by commas, for example "miss_m p99,impulse_m_s p90"; '
        "p50 and p99 of miss and impulse by default.",
    ),
]
Required = Annotated[
    str,
    typer.Option("--require", metavar="RULE", help="What is required of a quantile: its contour, and the answer."),
]


def sweep(
    scenario: ScenarioName = "asteroid-1997",
    *,
    vary: Annotated[
        str,
        typer.Option(
            "--vary",
            metavar="KEY=FROM:TO:COUNT,...",
            help="Numeric keys of the scenario file, in its units; KEY=log:FROM:TO:COUNT spaces them evenly in the "
            "logarithm. Of a pair KEY.least or KEY.greatest is varied.",
        ),
    ],
    runs: Annotated[int, typer.Option("--runs", metavar="N", help="Engagements a cell and, if mixed, both noises.")],
    out: CampaignOut,
    require: Required = "miss_m p99<10",
    show: ShownQuantiles = None,
    noise: NoiseName = None,
    seed: Seed = 0,
    strategy: StrategyName = None,
    model: ModelName = None,
    tie: TieName = None,
    range_meter: RangeMeter = None,
    guarantee: Annotated[
        bool,
        typer.Option("--guarantee/--no-guarantee", help="Whether the model guaranteed keeps its guaranteed miss Phi."),
    ] = False,
    chunk: Chunk = None,
    workers: Workers = None,
    processes: Processes = None,
    dask: Dask = None,
    resume: Resume = False,
    yes: Annotated[
        bool, typer.Option("--yes", help="Do not ask before a sweep of more than a million engagements.")
    ] = False,
    json_: Json = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Sweep values of a scenario: which sensor, which engine is needed for 99 % of the runs under 10 m?

    Every combination of the values is flown with the same starts and errors, and stored as a campaign is. DIR gets one
    table, sweep.parquet, a row a cell; a figure of lines (one key) or heat maps (two); and the runs themselves.
    """
    from experiments.campaigns.options import (
        MOST_AT_ONCE,
        campaign_errors,
        checked_noise,
        crew,
        need_campaign_extra,
    )
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_json, write_file
    from experiments.common.screen import figure_files, say, say_warnings, tell_of_compiling
    from experiments.interception.choices import scenario_with

    whole_number("--runs", runs, 1, MOST_RUNS, 200)
    whole_number("--seed", seed, 0, None, 0)
    if chunk is not None:
        whole_number("--chunk", chunk, 1, MOST_AT_ONCE, 1024)
    need_campaign_extra()
    from experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
    from experiments.campaigns.sweep_table import TABLE, sweep_table
    from experiments.interception.scenario_file import scenario_warnings
    from sim import CampaignNoise, Sweep
    from sim.storage import need_free

    required = requirement(require)
    shown = chosen_quantiles(show, required)
    named = checked_noise(noise)
    given = scenario_with(scenario, strategy=strategy, model=model, tie=tie, range_meter=range_meter)
    axes = sweep_axes(vary, given)
    asked = Sweep(
        given,
        axes,
        sweep_cells(given, axes),
        runs,
        out,
        seed=seed,
        noise=None if named is None else CampaignNoise(named),
        guarantee=guarantee,
        chunk=chunk,
    )
    hint = "; what is stored is whole: go on with --resume"
    with checked_destinations(files={"--json": json_}, overwrite=overwrite), campaign_errors(hint):
        need_free(out, resume=resume)
        if not yes:
            _ask(asked)
        warnings = list(dict.fromkeys(line for cell in asked.cells for line in scenario_warnings(cell)))
        say_warnings(warnings[:5], quiet)
        with crew(dask, workers, processes, quiet) as flying:
            tell_of_compiling(quiet)
            result, elapsed_s = _fly(asked, flying, resume, quiet)
        table = sweep_table(result.folder, [*shown, required.quantile])
        write_file(out / TABLE, result.folder.table_file(*table.columns()), overwrite=True)
        summary = to_json(sweep_summary(result.folder, table, required, elapsed_s))
        write_file(out / "summary.json", summary, overwrite=True)
        draw_into(table, shown, required, out)
        deliver(json_, summary, overwrite=overwrite)
    if not quiet:
        from experiments.common.screen import table_console

        show_sweep(table_console(str(json_) == STDOUT), result.folder, table, required)
        drawn = f", {', '.join(figure_files(FIGURE))}" if len(axes) <= 2 else "; three keys and more are not drawn"
        say(f"in {out}: sweep.parquet, summary.json{drawn}", quiet)


def chosen_quantiles(show: str | None, required: Requirement) -> list[QuantileName]:
    """Read which quantiles are to be drawn.

    Parameters
    ----------
    show : str or None
        Separated by commas; None is the usual ones.
    required : Requirement
        Its quantile is drawn too.

    Returns
    -------
    list of QuantileName

    Raises
    ------
    InputError
        If there is no such quantile.
    """
    from experiments.campaigns.sweep_table import SHOWN
    from experiments.common.errors import InputError
    from sim import QuantileName

    if show is None:
        return list(dict.fromkeys((*SHOWN, required.quantile)))
    try:
        chosen = [QuantileName.parse(each) for each in show.split(",")]
    except ValueError as error:
        raise InputError(f"--show: {error}") from None
    if len(chosen) > MOST_SHOWN:
        raise InputError(f"--show: at most {MOST_SHOWN} quantiles can be drawn, found {len(chosen)}; leave some out")
    return list(dict.fromkeys((*chosen, required.quantile)))


def requirement(require: str) -> Requirement:
    """Read what is required.

    Parameters
    ----------
    require : str

    Returns
    -------
    Requirement

    Raises
    ------
    InputError
        If it is written otherwise.
    """
    from experiments.common.errors import InputError
    from sim import Requirement

    try:
        return Requirement.parse(require)
    except ValueError as error:
        raise InputError(f"--require: {error}") from None


def _ask(asked: Sweep) -> None:
    """Ask before a sweep that takes long; refuse where nobody can answer."""
    from experiments.common.errors import InputError

    engagements = asked.runs * len(asked.cells)
    if engagements <= ASK_FROM:
        return
    said = f"{len(asked.cells)} cells of {asked.runs} runs are {engagements} engagements, more than a million"
    if not (sys.stdin.isatty() and sys.stderr.isatty()):
        raise InputError(f"{said}; give --yes if that is meant, or fewer --runs or values")
    if not typer.confirm(f"{said}. Go on?", err=True):
        raise InputError("not begun; give fewer --runs or values")


def _fly(asked: Sweep, flying: Crew, resume: bool, quiet: bool) -> tuple[CampaignResult, float]:
    from time import perf_counter

    from experiments.campaigns.screen import ESTIMATED_FROM, campaign_progress, estimate
    from experiments.common.screen import say
    from experiments.interception.scenario_file import scenario_to_toml

    if asked.engagements >= ESTIMATED_FROM:
        say(estimate(asked, flying.cores), quiet)
    began_s = perf_counter()
    with campaign_progress("sweep", quiet) as progress:
        result = asked.run(
            flying.executor,
            workers=flying.workers,
            resume=resume,
            progress=progress,
            beside={SCENARIO_FILE: scenario_to_toml(asked.manifest().scenario)},
        )
    for damage in result.redone:
        say(f"{damage.file}: {damage.reason}; flown again", quiet)
    return result, perf_counter() - began_s


def sweep_summary(
    folder: CampaignFolder, table: SweepTable, required: Requirement, elapsed_s: float | None
) -> dict[str, object]:
    """Return what a sweep comes to, as JSON.

    Parameters
    ----------
    folder : CampaignFolder
    table : SweepTable
    required : Requirement
    elapsed_s : float or None
        None where nothing was flown.

    Returns
    -------
    dict
    """
    from experiments.campaigns.samples import heading, to_json
    from experiments.campaigns.sweep_table import answers, unit_of

    return {
        **heading(folder),
        **({} if elapsed_s is None else {"elapsed_s": elapsed_s}),
        "axes": [
            {"key": axis.key, "unit": unit_of(axis.key), "scale": axis.scale, "values": list(axis.values)}
            for axis in table.axes
        ],
        "require": str(required),
        "answers": [
            {"noise": noise, "at": at, "met": met}
            for noise in table.noises
            for at, met in answers(table, noise, required)
        ],
        "cells": [
            {"values": folder.manifest.values_of(cell), "samples": [to_json(each) for each in found]}
            for cell, found in enumerate(table.cells)
        ],
    }


def draw_into(table: SweepTable, shown: Sequence[QuantileName], required: Requirement | None, folder: Path) -> None:
    """Draw a sweep of one or two axes into a folder."""
    if len(table.axes) > 2:
        return
    from experiments.campaigns.sweep_figures import draw_sweep
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures

    figure = draw_sweep(table, shown, required)
    with reporting_failures(folder):
        save_figure(figure, folder, FIGURE)


def show_sweep(console: Console, folder: CampaignFolder, table: SweepTable, required: Requirement) -> None:
    """Print where the requirement is met, and the quantile required in every cell if they are few.

    Parameters
    ----------
    console : Console
    folder : CampaignFolder
    table : SweepTable
    required : Requirement
    """
    from rich.table import Table
    from rich.text import Text

    from experiments.campaigns.sweep_table import answers
    from experiments.common.screen import number

    manifest = folder.manifest
    first = table.axes[0]
    console.print(
        Text(
            f"{manifest.scenario.name}, {len(table.cells)} cells, {folder.finished_runs} of {folder.wanted_runs} runs"
        ),
        soft_wrap=True,
    )
    for noise in table.noises:
        lines = answers(table, noise, required)
        console.print(Text(f"{noise} noise: {required} is met for {first.key}"), soft_wrap=True)
        for at, met in lines[:MOST_LINES]:
            console.print(Text(f"  {met}{f', where {at}' if at else ''}"), soft_wrap=True)
        if len(lines) > MOST_LINES:
            console.print(Text(f"  and {len(lines) - MOST_LINES} more lines in summary.json"))
    if len(table.axes) != 1:
        return
    shown = Table(first.key, "noise", box=None, pad_edge=False)
    for title in ("at least", str(required.quantile), "at most"):
        shown.add_column(title, justify="right")
    for noise in table.noises:
        for cell, value in enumerate(first.values):
            each = table.estimate(cell, noise, required.quantile)
            row = ("-", "-", "-") if each is None else tuple(map(number, (each.lower, each.value, each.upper)))
            shown.add_row(f"{value:g}", noise, *row)
    console.print(shown)
