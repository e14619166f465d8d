"""`infoset report`: report on a campaign or a sweep from its files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from experiments.campaigns.campaign_columns import campaign_columns, correlations
from experiments.campaigns.command import Report
from experiments.campaigns.flight import SCENARIO_FILE, campaign_errors
from experiments.campaigns.samples import (
    Sample,
    heading,
    noises_of,
    sample_json,
    sample_parts,
    samples,
    worst_runs,
)
from experiments.campaigns.sweep_report import SweepReport, default_requirement, figure_names, quantile_options
from experiments.campaigns.sweep_table import TABLE, sweep_table
from experiments.common.errors import InputError
from experiments.common.input_file import to_toml
from experiments.common.output import Output, output_of, to_json
from experiments.common.screen import (
    BeginProgress,
    Part,
    figure_files,
    number,
    number_table,
    progress_bar,
    say,
    show,
    some_runs,
)
from experiments.interception.study import study_title
from sim.results import ending
from sim.storage import CampaignFolder, need_arrow

Correlations = Mapping[str, Mapping[str, Mapping[str, float | None]]]


def run(options: Report) -> None:
    """Read the folder, write the files and print the tables."""
    with campaign_errors():
        need_arrow()
        folder = _read(options)
        swept = bool(folder.manifest.axes)
        figures = [*figure_files(*figure_names(noises_of(folder))), TABLE] if swept else figure_files(*_figures(folder))
        with output_of(options, [*figures, "report.json", SCENARIO_FILE]) as written:
            with progress_bar(options.quiet) as begin:
                parts = (_report_sweep if swept else _report_campaign)(folder, options, written, begin)
                written.save(SCENARIO_FILE, to_toml(folder.manifest.scenario))
            show(parts, options.quiet, stdout_taken=written.stdout_taken)


def _figures(folder: CampaignFolder) -> Sequence[str]:
    """Return the names of the figures of a campaign."""
    names = ("figure-distributions", "figure-convergence", "figure-dispersion", "figure-b-plane")
    return names if folder.manifest.scenario.is_spatial else names[:-1]


def _read(options: Report) -> CampaignFolder:
    path = options.folder
    if path.is_file():
        raise InputError(f"{path}: is a file; name the folder of a campaign or of a sweep")
    if not path.is_dir():
        raise InputError(f"{path}: there is no such folder; name the folder of infoset campaign or infoset sweep")
    folder = CampaignFolder.read(path)
    for damage in folder.damaged:
        say(
            f"warning: {damage.file}: {damage.reason}; its runs are omitted; simulate them again with --resume",
            options.quiet,
        )
    if not folder.finished_runs:
        raise InputError(f"{path}: contains no runs yet; continue with: infoset {folder.manifest.kind} --resume")
    if not folder.complete:
        stopped = folder.manifest.axes and folder.manifest.until
        say(
            f"warning: {folder.finished_runs} of {'at most ' if stopped else ''}{folder.wanted_runs} runs are stored; "
            f"{'--resume adds runs to the undecided cells' if stopped else 'the others are missing'}",
            options.quiet,
        )
    return folder


def _report_sweep(folder: CampaignFolder, options: Report, written: Output, begin: BeginProgress) -> Iterator[Part]:
    sized = bool(folder.numbers("hit").count())
    default = folder.manifest.require or default_requirement(has_size=sized)
    required, shown = quantile_options(options.require, options.show, default)
    if required.quantity == "hit" and not sized:
        raise InputError(f"--require {required}: the body of this sweep has no size; give a bound of the miss instead")
    if (
        required.quantity == "guaranteed_miss_m"
        and folder.manifest.scenario.set_model.is_guaranteed
        and not folder.manifest.guarantee
    ):
        raise InputError(
            f"--require {required}: this sweep was simulated without the bound Phi; simulate it in a new folder with "
            "infoset sweep --guarantee, or give a bound of miss_m"
        )
    progress = begin("report")
    report = SweepReport(folder, sweep_table(folder, required, shown), shown)
    progress(0.5)
    written.save("report.json", to_json(report.to_json()), "--json")
    if options.out is not None:
        report.save(written)
    progress(1.0)
    return report.parts()


def _report_campaign(folder: CampaignFolder, options: Report, written: Output, begin: BeginProgress) -> Iterator[Part]:
    for option, value in (("--require", options.require), ("--show", options.show)):
        if value is not None:
            raise InputError(f"{option}: is only for a sweep, and {folder.path} is a campaign; omit it")
    progress = begin("quantiles")
    columns = campaign_columns(folder)
    progress(0.3)
    by_noise = samples(folder)
    progress(1.0)
    # The commands that repeat runs name the scenario file in the folder, or the one that the report writes.
    scenario_file = folder.path / SCENARIO_FILE
    if options.out is not None and not scenario_file.is_file():
        scenario_file = options.out / SCENARIO_FILE
    worst = worst_runs(folder, scenario_file)
    related = {column.noise: correlations(column) for column in columns}
    report = {
        **heading(folder),
        "damaged": [{"file": damage.file.name, "reason": damage.reason} for damage in folder.damaged],
        "samples": [sample_json(sample) for sample in by_noise],
        "correlation_with_miss": related,
        "worst": worst,
    }
    written.save("report.json", to_json(report), "--json")
    if options.out is not None:
        from experiments.campaigns.campaign_figures import draw_all

        written.draw(_figures(folder), draw_all(folder, columns), begin("figures"))
    return _parts(folder, by_noise, related, worst)


def _parts(
    folder: CampaignFolder, by_noise: Sequence[Sample], related: Correlations, worst: Sequence[Mapping[str, Any]]
) -> Iterator[Part]:
    manifest = folder.manifest
    stopped = "" if manifest.stopped_after is None else f", stopped by the rule {manifest.until}"
    yield study_title(manifest.scenario, manifest.strategy, manifest.seed)
    yield f"{some_runs(folder.finished_runs)}{stopped}"
    yield from sample_parts(folder, by_noise)
    yield ""
    runs = ", ".join(f"{some_runs(sample.runs)} of {sample.noise} noise" for sample in by_noise)
    yield f"correlation of the miss with the initial state ({runs}; CI by Fisher's z):"
    table = number_table("noise", "component", "Pearson", "95 % CI", "Spearman", "95 % CI", left=2)
    for noise, components in related.items():
        label = noise
        for name, values in components.items():
            table.add_row(label, name, *_correlation_cells(values, "pearson"), *_correlation_cells(values, "spearman"))
            label = ""
    yield table
    yield from ("", "the worst runs, each with the command that simulates it again:")
    for row in worst:
        miss, impulse = number(row["miss_m"]), number(row["impulse_m_s"])
        yield f"  miss {miss} m, impulse {impulse} m/s, {ending(row['outcome'], row['hit'])}: {row['replay']}"
    if not (folder.path / SCENARIO_FILE).is_file():
        yield f"(the folder has no {SCENARIO_FILE}, which these commands need; --out writes one)"


def _correlation_cells(values: Mapping[str, float | None], kind: str) -> tuple[str, str]:
    value, lower, upper = (values[key] for key in (kind, f"{kind}_lower", f"{kind}_upper"))
    interval = "-" if lower is None or upper is None else f"{lower:+.2f} to {upper:+.2f}"
    return "-" if value is None else f"{value:+.2f}", interval
