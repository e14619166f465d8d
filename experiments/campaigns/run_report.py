"""`infoset report`: report on a campaign or a sweep from its files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import pandas as pd

from infoset.experiments.campaigns.command import ReportOptions
from infoset.experiments.campaigns.flight import SCENARIO_FILE, campaign_errors
from infoset.experiments.campaigns.run_tables import (
    correlations,
    heading,
    records,
    screen_table,
    summary,
    summary_parts,
    worst_runs,
)
from infoset.experiments.campaigns.sample_rows import noises_of
from infoset.experiments.campaigns.sweep_report import (
    TABLE,
    SweepReport,
    figure_names,
    read_requirement,
)
from infoset.experiments.campaigns.sweep_table import sweep_table
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import to_toml
from infoset.experiments.common.output import Output, output_of, to_json
from infoset.experiments.common.screen import (
    Part,
    figure_files,
    number,
    progress_bar,
    say,
    show,
    some_runs,
)
from infoset.experiments.interception.study import study_title
from infoset.sim.results import ending
from infoset.sim.storage import CampaignFolder


def run(options: ReportOptions) -> None:
    """Read the folder, write the files and print the tables."""
    with campaign_errors():
        folder = _read(options)
        swept = bool(folder.manifest.axes)
        if swept:
            files = [*figure_files(*figure_names(noises_of(folder))), TABLE]
        else:
            files = figure_files(*_figures(folder))

        with output_of(options, [*files, "report.json", SCENARIO_FILE]) as written:
            if swept:
                parts = _report_sweep(folder, options, written)
            else:
                parts = _report_campaign(folder, options, written)
            written.save(SCENARIO_FILE, to_toml(folder.manifest.scenario))
            show(parts, options.quiet or written.stdout_taken)


def _figures(folder: CampaignFolder) -> Sequence[str]:
    names = ["figure-distributions", "figure-convergence", "figure-dispersion"]
    if folder.manifest.scenario.is_spatial:
        names.append("figure-b-plane")
    return names


def _read(options: ReportOptions) -> CampaignFolder:
    """Return the folder of a campaign or a sweep; `InputError` if it has no runs."""
    path = options.folder
    if not path.is_dir():
        raise InputError(
            f"{path}: is no folder; name the folder of infoset campaign or infoset sweep"
        )

    folder = CampaignFolder.read(path)
    if not folder.finished_runs:
        raise InputError(
            f"{path}: contains no runs yet; continue with: infoset {folder.manifest.kind} --resume"
        )

    if not folder.complete:
        wanted = f"{folder.wanted_runs} runs"
        if folder.manifest.until:
            wanted = f"at most {wanted}"
        stored = f"{folder.finished_runs} of {wanted} are stored"
        say(f"warning: {stored}; --resume adds runs", options.quiet)
    return folder


def _report_sweep(
    folder: CampaignFolder, options: ReportOptions, written: Output
) -> Iterator[Part]:
    """Write the files of a sweep, and return the parts for the screen.

    The body has a size if of any run it is known whether it hit: cells can differ in their bodies.
    """
    scenario = folder.manifest.scenario
    sized = bool(folder.runs(["hit"])["hit"].count())
    required = read_requirement(options.require or folder.manifest.require, has_size=sized)
    if (
        required.quantity == "guaranteed_miss_m"
        and scenario.set_model.is_guaranteed
        and not folder.manifest.guarantee
    ):
        raise InputError(
            f"--require {required}: this sweep was simulated without the bound Phi; simulate it in "
            "a new folder with infoset sweep --guarantee, or give a bound of miss_m"
        )

    report = SweepReport(folder, sweep_table(folder, required))
    written.save("report.json", to_json(report.to_json()), "--json")
    written.deliver("--csv", report.table.rows.to_csv(index=False))
    report.save(written)
    return report.parts()


def _report_campaign(
    folder: CampaignFolder, options: ReportOptions, written: Output
) -> Iterator[Part]:
    if options.require is not None:
        raise InputError(
            f"--require: is only for a sweep, and {folder.path} is a campaign; omit it"
        )

    table = summary(folder)
    related = correlations(folder)
    scenario_file = _scenario_file(folder, options.out)
    worst = worst_runs(folder, scenario_file)
    report = {
        **heading(folder),
        "samples": records(table.drop(columns="cell")),
        "correlation_with_miss": records(related),
        "worst": records(worst),
    }
    written.save("report.json", to_json(report), "--json")
    written.deliver("--csv", table.drop(columns="cell").to_csv(index=False))
    if options.out is not None:
        from infoset.experiments.campaigns.campaign_figures import draw_all

        with progress_bar(options.quiet) as begin:
            written.draw(_figures(folder), draw_all(folder), begin("figures"))
    return _parts(folder, table, related, worst, scenario_file)


def _scenario_file(folder: CampaignFolder, out: Path | None) -> Path:
    """Return the scenario file that the commands of single runs name.

    It is the file of the folder or, if that is missing, the file that the report writes. Without
    --out it writes none; the file of the folder is then named although it is missing.
    """
    stored = folder.path / SCENARIO_FILE
    if out is None or stored.is_file():
        return stored
    return out / SCENARIO_FILE


def _parts(
    folder: CampaignFolder,
    table: pd.DataFrame,
    related: pd.DataFrame,
    worst: pd.DataFrame,
    scenario_file: Path,
) -> Iterator[Part]:
    """Yield the report for the screen.

    `scenario_file` is the file that the commands of the worst runs name; a file that the report
    writes exists when the last line is yielded.
    """
    manifest = folder.manifest
    runs = some_runs(folder.finished_runs)
    if manifest.stopped_after is not None:
        runs += f", stopped by the rule {manifest.until}"
    yield study_title(manifest.scenario, manifest.strategy, manifest.seed)
    yield runs
    yield from summary_parts(folder, table)

    yield ""
    yield "correlation of the miss with the initial state (95 % CI by Fisher's z):"
    # Two lines for pearson_lower and the like.
    yield screen_table(
        related.rename(columns=lambda name: name.replace("_l", "\nl").replace("_u", "\nu")), 2
    )

    yield ""
    yield "the worst runs, each with the command that simulates it again:"
    for row in records(worst):
        miss = number(row["miss_m"])
        impulse = number(row["impulse_m_s"])
        how = ending(row["outcome"], row["hit"], row["cause"])
        yield f"  miss {miss} m, impulse {impulse} m/s, {how}: {row['replay']}"

    if not scenario_file.is_file():
        yield f"(the folder has no {SCENARIO_FILE}, which these commands need; --out writes one)"
