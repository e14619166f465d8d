"""infoset report: what a campaign or a sweep comes to, from its files alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.campaigns.options import SCENARIO_FILE
from experiments.campaigns.sweep import Required, ShownQuantiles
from experiments.common.options import Json, Out, Overwrite, Quiet

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from experiments.campaigns.campaign_figures import CampaignColumns
    from experiments.campaigns.samples import Sample, WorstRun
    from sim.storage import CampaignFolder

FIGURES = ("figure-distributions", "figure-convergence", "figure-dispersion")


def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="What infoset campaign or infoset sweep has filled.")],
    require: Required = "miss_m p99<10",
    show: ShownQuantiles = None,
    out: Out = None,
    json_: Json = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Report on a campaign or a sweep, finished or not, from its files alone.

    Of a campaign: quantiles with 95 % intervals, how the runs ended, the correlation of the miss with the initial
    state, and the worst ten runs with the command that flies each again; with --out figures of the distributions, of
    the convergence of the quantiles, and of the miss over the initial state. Of a sweep: where the requirement is met,
    with --out the table and the figure. --require and --show are for sweeps. Without --out or --json nothing is
    written.
    """
    from experiments.campaigns.options import campaign_errors, need_campaign_extra
    from experiments.campaigns.sweep import FIGURE as SWEEP_FIGURE
    from experiments.common.errors import InputError
    from experiments.common.output import checked_destinations
    from experiments.common.screen import figure_files, say

    need_campaign_extra()
    from experiments.campaigns.sweep_table import TABLE
    from sim.storage import CampaignFolder

    with campaign_errors():
        if not folder.is_dir():
            raise InputError(
                f"{folder}: there is no such folder; name what infoset campaign or infoset sweep has filled"
            )
        found = CampaignFolder.read(folder)
        for damage in found.damaged:
            say(f"warning: {damage.file}: {damage.reason}; left out, redo it with --resume", quiet)
        if not found.finished_runs:
            raise InputError(f"{folder}: no run is stored in it yet; go on with: infoset campaign --resume")
        if not found.complete:
            say(f"warning: {found.finished_runs} of {found.wanted_runs} runs are stored; the others are missing", quiet)
        sweep = bool(found.manifest.axes)
        figures = [*figure_files(SWEEP_FIGURE), TABLE] if sweep else figure_files(*FIGURES)
        names = [*figures, "report.json", SCENARIO_FILE]
        with checked_destinations(folder=out, names=names, files={"--json": json_}, overwrite=overwrite):
            if sweep:
                _report_sweep(found, require, show, out, json_, overwrite, quiet)
            else:
                _report_campaign(found, out, json_, overwrite, quiet)


def _report_sweep(
    found: CampaignFolder,
    require: str,
    show: str | None,
    out: Path | None,
    json_: Path | None,
    overwrite: bool,
    quiet: bool,
) -> None:
    from experiments.campaigns.sweep import chosen_quantiles, draw_into, requirement, show_sweep, sweep_summary
    from experiments.campaigns.sweep_table import TABLE, sweep_table
    from experiments.common.output import STDOUT, to_json, write_file
    from experiments.common.screen import table_console

    required = requirement(require)
    shown = chosen_quantiles(show, required)
    table = sweep_table(found, [*shown, required.quantile])
    text = to_json(sweep_summary(found, table, required, None))
    _write(found, text, out, json_, overwrite)
    if out is not None:
        write_file(out / TABLE, found.table_file(*table.columns()), overwrite=overwrite)
        draw_into(table, shown, required, out)
    if not quiet:
        show_sweep(table_console(str(json_) == STDOUT), found, table, required)


def _report_campaign(found: CampaignFolder, out: Path | None, json_: Path | None, overwrite: bool, quiet: bool) -> None:
    from experiments.campaigns.campaign_figures import correlations
    from experiments.campaigns.samples import heading, samples, to_json, worst_runs
    from experiments.common.output import STDOUT
    from experiments.common.output import to_json as to_json_text
    from experiments.common.screen import table_console

    columns = _columns(found)
    told, worst = samples(found), worst_runs(found, _scenario_file(found, out))
    related = {each.noise: correlations(each) for each in columns}
    text = to_json_text(
        {
            **heading(found),
            "damaged": [{"file": each.file.name, "reason": each.reason} for each in found.damaged],
            "samples": [to_json(each) for each in told],
            "correlation_with_miss": related,
            "worst": [
                {
                    "run": each.run,
                    "noise": each.noise,
                    "outcome": each.outcome,
                    "miss_m": each.miss_m,
                    "impulse_m_s": each.impulse_m_s,
                    "replay": each.replay,
                }
                for each in worst
            ],
        }
    )
    _write(found, text, out, json_, overwrite)
    if out is not None:
        _draw(columns, out)
    if not quiet:
        _show(table_console(str(json_) == STDOUT), found, told, related, worst)


def _scenario_file(found: CampaignFolder, out: Path | None) -> Path:
    """Where the scenario can be read: in the folder, else where the report puts it."""
    there = found.path / SCENARIO_FILE
    return there if there.is_file() or out is None else out / SCENARIO_FILE


def _write(found: CampaignFolder, text: str, out: Path | None, json_: Path | None, overwrite: bool) -> None:
    from experiments.common.output import deliver, write_file
    from experiments.interception.scenario_file import scenario_to_toml

    deliver(json_, text, overwrite=overwrite)
    if out is not None:
        write_file(out / "report.json", text, overwrite=overwrite)
        write_file(out / SCENARIO_FILE, scenario_to_toml(found.manifest.scenario), overwrite=overwrite)


def _columns(found: CampaignFolder) -> list[CampaignColumns]:
    """All rows, a noise after the other; without noises that have none yet."""
    from experiments.campaigns.campaign_figures import CampaignColumns
    from experiments.campaigns.samples import START, noise_flags

    scenario = found.manifest.scenario
    miss, impulse, guaranteed = (found.numbers(name) for name in ("miss_m", "impulse_m_s", "guaranteed_miss_m"))
    start = {name: found.numbers(name).data for name in START}
    columns = [
        CampaignColumns(
            noise,
            scenario.range_sensor is not None,
            miss.data[rows],
            impulse.data[rows],
            guaranteed[rows].compressed(),
            {name: values[rows] for name, values in start.items()},
            scenario.set_model.is_guaranteed,
        )
        for noise, rows in noise_flags(found).items()
    ]
    return [each for each in columns if each.miss_m.size]


def _draw(columns: Sequence[CampaignColumns], out: Path) -> None:
    from experiments.campaigns.campaign_figures import draw_campaign_distributions, draw_convergence, draw_dispersion
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures

    for name, draw in zip(FIGURES, (draw_campaign_distributions, draw_convergence, draw_dispersion), strict=True):
        figure = draw(columns)
        with reporting_failures(out):
            save_figure(figure, out, name)


def _show(
    console: Console,
    found: CampaignFolder,
    told: Sequence[Sample],
    related: dict[str, dict[str, dict[str, float | None]]],
    worst: Sequence[WorstRun],
) -> None:
    from rich.table import Table
    from rich.text import Text

    from experiments.campaigns.screen import show_samples
    from experiments.common.screen import number

    manifest = found.manifest
    stopped = "" if manifest.stopped_after is None else f", stopped by {manifest.until}"
    console.print(
        Text(f"{manifest.scenario.name}, {found.finished_runs} runs{stopped}; quantiles, 95 % intervals"),
        soft_wrap=True,
    )
    show_samples(console, told, manifest.scenario.set_model.kind.value)
    console.print()
    table = Table("correlation of the miss with", box=None, pad_edge=False)
    names = list(next(iter(related.values())))
    for noise in related:
        table.add_column(f"{noise}\nPearson", justify="right")
        table.add_column("\nSpearman", justify="right")
    for name in names:
        values = [each[name][kind] for each in related.values() for kind in ("pearson", "spearman")]
        table.add_row(name, *(("-" if value is None else f"{value:+.2f}") for value in values))
    console.print(table)
    console.print()
    console.print(Text("the worst runs:"))
    for each in worst:
        console.print(
            Text(f"  {number(each.miss_m)} m for {number(each.impulse_m_s)} m/s, {each.outcome}: {each.replay}"),
            soft_wrap=True,
        )
    if not (found.path / SCENARIO_FILE).is_file():
        console.print(
            Text(f"(there is no {SCENARIO_FILE} in the folder: with --out the report writes one)"), soft_wrap=True
        )
