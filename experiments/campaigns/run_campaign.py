"""`infoset campaign`: simulation, summary and tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.table import Table

from experiments.campaigns.command import Campaign as Options
from experiments.campaigns.flight import RESUME_HINT, SCENARIO_FILE, Flown, campaign_errors, duration, fly, scenario_of
from experiments.campaigns.samples import game_notes, heading, sample_json, samples, samples_table, stop_notes, title
from experiments.common.errors import input_errors
from experiments.common.output import Output, output_of, to_json
from experiments.common.screen import Part, show
from experiments.interception.choices import own_strategy
from sim import Campaign, CampaignNoise, StoppingRule
from sim.storage import need_arrow

SUMMARY = "summary.json"


def run(options: Options) -> None:
    """Simulate the campaign, write its summary and print the tables."""
    with campaign_errors(RESUME_HINT), output_of(options) as written:
        need_arrow()
        scenario, model_notes = scenario_of(options)
        with input_errors("--until"):
            rule = None if options.until is None else StoppingRule.parse(options.until)
        campaign = Campaign(
            scenario,
            options.runs,
            options.out,
            seed=options.seed,
            noise=None if options.noise is None else CampaignNoise(options.noise),
            strategy=own_strategy(options.strategy, scenario),
            guarantee=options.guarantee,
            chunk=options.chunk,
            until=rule,
        )
        flown = fly(campaign, options, model_notes)
        stored = flown.result.folder
        by_noise = samples(stored)
        results = {
            **heading(stored),
            **({"warnings": flown.warnings} if flown.warnings else {}),
            "elapsed_s": flown.elapsed_s,
            "redone": [{"file": damage.file.name, "reason": damage.reason} for damage in flown.result.redone],
            "samples": [sample_json(sample) for sample in by_noise],
        }
        table, notes = samples_table(by_noise, stored.manifest.scenario)
        summary = to_json(results)
        folder = Output(options.out, {}, overwrite=True)
        folder.save(SUMMARY, summary)
        written.written += [options.out / "shards", options.out / SCENARIO_FILE, *folder.written]
        written.deliver("--json", summary)
    show(_parts(flown, table, notes), options.quiet, stdout_taken=written.stdout_taken)


def _parts(flown: Flown, table: Table, notes: Sequence[str]) -> Iterator[Part]:
    folder, manifest = flown.result.folder, flown.result.folder.manifest
    stopped = "" if manifest.stopped_after is None else f" of {manifest.runs}, stopped by the rule {manifest.until}"
    runs = f"{folder.finished_runs} runs{stopped}, {duration(flown.elapsed_s)}"
    yield title(folder)
    yield f"{runs}; quantiles with {'' if stopped else '95 % '}confidence limits"
    yield table
    yield from (*notes, *game_notes(folder), *stop_notes(manifest))
    if manifest.until is not None and manifest.stopped_after is None:
        yield f"the rule {manifest.until} is not met; continue with --resume and a greater --runs"
    yield f"to see the results: infoset report {folder.path}"
