"""`infoset campaign`: simulation, summary and tables."""

from __future__ import annotations

from dataclasses import replace

from infoset.experiments.campaigns.command import CampaignOptions
from infoset.experiments.campaigns.flight import (
    RESUME_HINT,
    SCENARIO_FILE,
    campaign_errors,
    fly,
    needed_runs,
    noise_of,
    noises_at_once,
    scenario_of,
)
from infoset.experiments.campaigns.run_tables import heading, records, summary, summary_parts
from infoset.experiments.common.errors import input_errors
from infoset.experiments.common.input_file import to_toml
from infoset.experiments.common.output import output_of, to_json
from infoset.experiments.common.screen import show, some_runs
from infoset.experiments.common.units import duration_text
from infoset.experiments.interception.command import NEEDED
from infoset.experiments.interception.strategies import own_strategy
from infoset.experiments.interception.study import USUAL_REQUIREMENT, needed_notes, study_title
from infoset.sim import Campaign, RunsUntil, StoppingRule

SUMMARY = "summary.json"


def run(options: CampaignOptions) -> None:
    """Simulate the campaign, write its summary and print the tables."""
    with campaign_errors(RESUME_HINT), output_of(options) as written:
        if options.runs == NEEDED:
            options = replace(options, runs=needed_runs(options, USUAL_REQUIREMENT))
        scenario, notes = scenario_of(options)
        if scenario.body is not None:
            # The number of runs of each noise.
            notes += needed_notes(USUAL_REQUIREMENT, options.runs // noises_at_once(options))
        with input_errors("--until"):
            runs: int | RunsUntil = options.runs
            if options.until is not None:
                runs = RunsUntil(StoppingRule.parse(options.until), max_runs=options.runs)
        campaign = Campaign(
            scenario,
            runs,
            options.out,
            seed=options.seed,
            noise=noise_of(options),
            strategy=own_strategy(options.strategy),
            guarantee=options.guarantee,
            chunk=options.chunk,
        )
        stored, warnings, elapsed_s = fly(campaign, options, notes)
        manifest = stored.manifest
        table = summary(stored)
        results = heading(stored)
        if warnings:
            results["warnings"] = warnings
        results["elapsed_s"] = elapsed_s
        # A campaign has one cell, whose number says nothing.
        results["samples"] = records(table.drop(columns="cell"))

        flown = some_runs(stored.finished_runs)
        limits = "95 % confidence limits"
        if manifest.stopped_after is not None:
            flown += f" of {manifest.runs}, stopped by the rule {manifest.until}"
            limits = "confidence limits"  # less than 95 %: see the note of the summary
        parts = [
            study_title(manifest.scenario, manifest.strategy, manifest.seed),
            f"{flown}, {duration_text(elapsed_s)}; quantiles with {limits}",
            *summary_parts(stored, table),
        ]
        if manifest.until is not None and manifest.stopped_after is None:
            parts.append(
                f"the rule {manifest.until} is not met; continue with --resume and a greater --runs"
            )

        written.enter(options.out, "shards")
        written.save(SCENARIO_FILE, to_toml(scenario))
        written.save(SUMMARY, to_json(results), "--json")
        written.deliver("--csv", table.drop(columns="cell").to_csv(index=False))

    parts.append(f"to see the results: infoset report {stored.path}")
    show(parts, options.quiet or written.stdout_taken)
