"""infoset adversary: a search for the engagement that a strategy stands worst."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.display_units import M_PER_KM
from experiments.common.options import Json, Overwrite, Quiet, Seed, whole_number
from experiments.interception.options import MOST_RUNS, ModelName, RangeMeter, ScenarioName, StrategyName

if TYPE_CHECKING:
    from guidance import Strategy
    from sim import Scenario
    from sim.adversary import WorstEngagement

DEFAULT_BUDGET = 2000


def adversary(
    scenario: ScenarioName = "asteroid-1997",
    strategy: StrategyName = None,
    model: ModelName = None,
    range_meter: RangeMeter = None,
    budget: Annotated[int, typer.Option("--budget", metavar="N", help="Engagements to fly.")] = DEFAULT_BUDGET,
    keep_set: Annotated[
        bool, typer.Option("--keep-set", help="Count only engagements in which the set was never lost.")
    ] = False,
    seed: Seed = 0,
    record: Annotated[
        Path | None, typer.Option("--record", metavar="FILE.npz", help="Write the record of the worst engagement.")
    ] = None,
    json_: Json = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Search for the start and the measurement errors that make a strategy miss the most.

    Starts are sought in all that the scenario holds for possible, errors within their bounds. What is found is a true
    miss, so no guarantee of the strategy can be below it; there may be worse ones. The same seed and budget find the
    same. Without --json or --record nothing is written.
    """
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_json
    from experiments.common.screen import say_warnings, tell_of_compiling
    from experiments.interception.choices import own_strategy, scenario_with
    from experiments.interception.record_file import record_path, write_record
    from experiments.interception.scenario_file import scenario_warnings

    whole_number("--budget", budget, 1, MOST_RUNS, DEFAULT_BUDGET)
    whole_number("--seed", seed, 0, None, 0)
    if record is not None:
        record_path("--record", record)
    given = scenario_with(scenario, strategy=strategy, model=model, range_meter=range_meter)
    own = own_strategy(strategy)
    with checked_destinations(files={"--json": json_, "--record": record}, overwrite=overwrite):
        warnings = scenario_warnings(given)
        say_warnings(warnings, quiet)
        tell_of_compiling(quiet)
        worst, elapsed_s = _search(given, own, budget, seed, keep_set, quiet)
        if record is not None:
            write_record(worst.record(own), record, overwrite=overwrite)
        if json_ is not None:
            text = to_json(_summary(given, worst, keep_set, record, elapsed_s, warnings))
            deliver(json_, text, overwrite=overwrite)
    if not quiet:
        _show(given, worst, keep_set, record, elapsed_s, str(json_) == STDOUT)


def _search(
    scenario: Scenario, own: Strategy | None, budget: int, seed: int, keep_set: bool, quiet: bool
) -> tuple[WorstEngagement, float]:
    import os
    from time import perf_counter

    from experiments.common.errors import InputError
    from experiments.common.screen import progress_bar
    from sim.adversary import NothingCountsError, find_worst
    from sim.scenario import strategy_name

    began_s = perf_counter()
    with progress_bar(quiet) as begin:
        try:
            worst = find_worst(
                scenario,
                strategy=own,
                budget=budget,
                seed=seed,
                keep_set=keep_set,
                threads=os.cpu_count() or 1,
                progress=begin(f"worst against {strategy_name(scenario, own)}"),
            )
        except NothingCountsError as error:
            raise InputError(
                f"{scenario.name}: {error}; {'leave --keep-set out, or ' if keep_set else ''}check the units of the "
                "scenario with: infoset scenarios check FILE"
            ) from None
    return worst, perf_counter() - began_s


def _summary(
    scenario: Scenario,
    worst: WorstEngagement,
    keep_set: bool,
    record: Path | None,
    elapsed_s: float,
    warnings: list[str],
) -> dict[str, object]:
    from experiments.common.output import library_version
    from experiments.interception.scenario_file import scenario_hash

    return {
        "version": library_version(),
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        **({"warnings": warnings} if warnings else {}),
        "seed": worst.seed,
        "model": scenario.set_model.kind.value,
        "range_meter": scenario.range_sensor is not None,
        "elapsed_s": elapsed_s,
        "strategy": worst.strategy,
        "keep_set": keep_set,
        "worst_miss_m": worst.miss_m,
        "outcome": worst.outcome.value,
        "truth_kept": worst.truth_kept,
        "evaluations": worst.evaluations,
        "record": None if record is None else str(record),
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


def _show(
    scenario: Scenario,
    worst: WorstEngagement,
    keep_set: bool,
    record: Path | None,
    elapsed_s: float,
    stdout_taken: bool,
) -> None:
    """Print the worst engagement, and how it was found."""
    from rich.table import Table
    from rich.text import Text

    from experiments.common.screen import number, table_console
    from sim import Outcome

    meter = " + range meter" if scenario.range_sensor is not None else ""
    z, x = worst.position_m / M_PER_KM
    vz, vx = worst.velocity_m_s / M_PER_KM
    halfway_m = max((miss for flown, miss in worst.history if 2 * flown <= worst.evaluations), default=None)
    table = Table("", "", box=None, pad_edge=False, show_header=False)
    for title, value in (
        ("strategy", worst.strategy),
        ("worst miss, m", number(worst.miss_m)),
        ("outcome", worst.outcome.value),
        ("truth kept in its section", "yes" if worst.truth_kept else "no"),
        ("start z, x, km", f"{z:.4g}, {x:.6g}"),
        ("start V_z, V_x, km/s", f"{vz:.4g}, {vx:.6g}"),
        ("found from", f"{worst.construction}, in {worst.changes} rounds of changes"),
        ("worst after half the budget, m", number(halfway_m)),
        ("engagements flown", f"{worst.evaluations}, {number(worst.evaluations / max(elapsed_s, 1e-9))} a second"),
    ):
        table.add_row(Text(title), Text(value))
    console = table_console(stdout_taken)
    console.print(Text(f"{scenario.name}, model {scenario.set_model.kind.value}{meter}"), soft_wrap=True)
    console.print(table)
    notes = ["a true miss: no guarantee of this strategy can be below it; there may be worse ones"]
    if worst.outcome is Outcome.SET_LOST and not keep_set:
        notes.append(
            "set-lost: some measurement left the model without a state; --keep-set counts only engagements in which "
            "that never happened"
        )
    if record is not None:
        notes.append(f"draw it with: infoset replay {record} --out DIR")
    for note in notes:
        console.print(Text(note), soft_wrap=True)
