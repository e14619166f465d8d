"""`infoset sweep`: simulation, table, figure and the values that meet the requirement."""

from __future__ import annotations

from dataclasses import replace

from infoset.experiments.campaigns.command import Sweep as Options
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
from infoset.experiments.campaigns.sweep_axes import sweep_axes, sweep_cells
from infoset.experiments.campaigns.sweep_report import SweepReport, read_requirement
from infoset.experiments.campaigns.sweep_table import sweep_table
from infoset.experiments.common.errors import InputError
from infoset.experiments.common.input_file import to_toml
from infoset.experiments.common.output import output_of, to_json
from infoset.experiments.common.screen import say, show
from infoset.experiments.interception.command import NEEDED
from infoset.experiments.interception.strategies import own_strategy
from infoset.experiments.interception.study import needed_notes
from infoset.sim import Campaign, RunsUntil
from infoset.sim.requirement import AnyRequirement

MAX_RUNS_A_CELL = 2000
"""Default of --max-runs with --until decided: the runs after which a cell stays undecided.

If a share of hits of 95 % is required, cells with shares from 93.0 to 96.5 % then stay undecided,
after 400 runs (the default of --runs) those from 90.5 to 97.7 %, after 10 000 from 94.1 to 95.7 %.
"""


def run(options: Options) -> None:
    """Simulate the sweep, write its table and figure, and print where the requirement is met."""
    with campaign_errors(RESUME_HINT), output_of(options) as written:
        scenario, notes = scenario_of(options)
        axes = sweep_axes(",".join(options.vary), scenario)
        cells = sweep_cells(scenario, axes)
        # All cells have the same tables; the scenario may lack a table of which a key is varied.
        required = read_requirement(options.require, has_size=cells[0].body is not None)
        if options.runs == NEEDED:
            options = replace(options, runs=needed_runs(options, required))
        runs = _runs(options, required)
        noises = noises_at_once(options)
        if isinstance(runs, RunsUntil):
            notes += needed_notes(required, runs.max_runs // noises, "--max-runs")
        else:
            notes += needed_notes(required, runs // noises)
        swept = Campaign(
            scenario,
            runs,
            options.out,
            axes=axes,
            cells=cells,
            seed=options.seed,
            noise=noise_of(options),
            strategy=own_strategy(options.strategy),
            guarantee=options.guarantee or required.quantity == "guaranteed_miss_m",
            chunk=options.chunk,
            require=required,
        )
        folder, _, elapsed_s = fly(swept, options, notes)
        report = SweepReport(folder, sweep_table(folder, required))
        summary = to_json(report.to_json(elapsed_s))
        written.enter(options.out, "shards")
        written.save(SCENARIO_FILE, to_toml(scenario))
        report.save(written)
        written.save("summary.json", summary, "--json")

    show(report.parts(), options.quiet or written.stdout_taken)
    if not report.is_drawn:
        say("no figure: a figure can show one or two keys only", options.quiet)


def _runs(options: Options, required: AnyRequirement) -> int | RunsUntil:
    """Return the number of runs of a cell; with --until, the requirement with the limits.

    The default of --max-runs is at least --runs. Raise `InputError` if a given one is less.
    """
    if options.until is None:
        if options.max_runs is not None:
            raise InputError("--max-runs is the limit of --until; add --until decided, or omit it")
        return options.runs

    max_runs = options.max_runs
    if max_runs is None:
        max_runs = max(MAX_RUNS_A_CELL, options.runs)
    if max_runs < options.runs:
        raise InputError(
            f"--max-runs: must be at least --runs, {options.runs}, found {max_runs}; give a "
            "greater --max-runs or a smaller --runs"
        )
    return RunsUntil(required, max_runs, min_runs=options.runs)
