"""`infoset adversary`: search, files and table."""

from __future__ import annotations

import os
from time import perf_counter

from rich.console import Console
from rich.table import Table

from experiments.common.display_units import M_PER_KM
from experiments.common.errors import InputError
from experiments.common.output import output, to_json
from experiments.common.screen import number, print_lines, progress_bar, say_warnings, table_console
from experiments.interception.choices import own_strategy, scenario_with
from experiments.interception.commands.adversary import Adversary
from experiments.interception.record_file import record_path, write_record
from experiments.interception.runs.shared import summary_head
from experiments.interception.scenario_file import scenario_warnings
from sim import Outcome, Scenario
from sim.adversary import NothingCountsError, WorstEngagement, find_worst
from sim.scenario import strategy_name


def run(options: Adversary) -> None:
    """Search, write the files and print the table."""
    if options.record is not None:
        record_path("--record", options.record)
    scenario = scenario_with(
        options.scenario, strategy=options.strategy, model=options.model, range_meter=options.range_meter
    )
    own = own_strategy(options.strategy)
    with (
        output(
            files={"--json": options.json, "--record": options.record},
            overwrite=options.overwrite,
            quiet=options.quiet,
        ) as written,
        progress_bar(options.quiet) as begin,
    ):
        say_warnings(scenario_warnings(scenario), options.quiet)
        began_s = perf_counter()
        try:
            worst = find_worst(
                scenario,
                strategy=own,
                budget=options.budget,
                seed=options.seed,
                keep_set=options.keep_set,
                threads=os.cpu_count() or 1,
                progress=begin(f"worst against {strategy_name(scenario, own)}"),
            )
        except NothingCountsError as error:
            raise InputError(
                f"{scenario.name}: {error}; {'omit --keep-set, or ' if options.keep_set else ''}check the units "
                "of the scenario with: infoset scenarios check FILE"
            ) from None
        elapsed_s = perf_counter() - began_s
        if options.record is not None:
            write_record(worst.record(own), options.record, overwrite=options.overwrite)
            written.add(options.record)
        summary = {**summary_head(scenario), **_summary(scenario, worst, options, elapsed_s)}
        written.deliver("--json", to_json(summary))
    if not options.quiet:
        _show(table_console(written.stdout_taken), scenario, worst, options, elapsed_s)


def _summary(scenario: Scenario, worst: WorstEngagement, options: Adversary, elapsed_s: float) -> dict[str, object]:
    return {
        "seed": worst.seed,
        "model": scenario.set_model.kind.value,
        "range_meter": scenario.range_sensor is not None,
        "elapsed_s": elapsed_s,
        "strategy": worst.strategy,
        "keep_set": options.keep_set,
        "worst_miss_m": worst.miss_m,
        "outcome": worst.outcome.value,
        "truth_kept": worst.truth_kept,
        "evaluations": worst.evaluations,
        "record": None if options.record is None else str(options.record),
        "found_from": worst.construction,
        "changes": worst.changes,
        "start": {
            "z_m": float(worst.position_m[0]),
            "x_m": float(worst.position_m[1]),
            "vz_m_s": float(worst.velocity_m_s[0]),
            "vx_m_s": float(worst.velocity_m_s[1]),
        },
        "history": [{"evaluations": evaluations, "worst_miss_m": miss_m} for evaluations, miss_m in worst.history],
    }


def _show(console: Console, scenario: Scenario, worst: WorstEngagement, options: Adversary, elapsed_s: float) -> None:
    meter = "with" if scenario.range_sensor is not None else "without"
    z, x = worst.position_m / M_PER_KM
    vz, vx = worst.velocity_m_s / M_PER_KM
    halfway_m = max((miss for count, miss in worst.history if 2 * count <= worst.evaluations), default=None)
    table = Table("", "", box=None, pad_edge=False, show_header=False)
    for row in (
        ("strategy", worst.strategy),
        ("worst miss, m", number(worst.miss_m)),
        ("outcome", worst.outcome.value),
        ("true state inside the set at every step", "yes" if worst.truth_kept else "no"),
        ("initial z, x, km", f"{z:.4g}, {x:.6g}"),
        ("initial V_z, V_x, km/s", f"{vz:.4g}, {vx:.6g}"),
        ("errors of the first candidate", worst.construction),
        ("rounds of changes to it", str(worst.changes)),
        ("worst miss after half the budget, m", number(halfway_m)),
        (
            "simulated engagements",
            f"{worst.evaluations}, {number(worst.evaluations / max(elapsed_s, 1e-9))} per second",
        ),
    ):
        table.add_row(*row)
    print_lines(console, [f"{scenario.name}, {meter} range meter, model {scenario.set_model.kind.value}"])
    console.print(table)
    notes = ["this miss was simulated: the strategy cannot guarantee a smaller one, and greater misses may exist"]
    if worst.outcome is Outcome.SET_LOST and not options.keep_set:
        notes.append(
            "set-lost: a measurement contradicted all states of the set; to exclude such engagements, use --keep-set"
        )
    if options.record is not None:
        notes.append(f"to draw it: infoset replay {options.record} --out DIR")
    print_lines(console, notes)
