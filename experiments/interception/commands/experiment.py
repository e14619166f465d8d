"""infoset experiment: many engagements a curve, and the paper's figure 4."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.options import Csv, Json, Out, Overwrite, Quiet, Seed, whole_number
from experiments.interception.options import MOST_RUNS, ModelName, ScenarioName, StrategyName, TieName

if TYPE_CHECKING:
    from pathlib import Path

    from experiments.common.output import Cell
    from experiments.interception.curves import Curve
    from guidance import Strategy
    from sim import Scenario

FIGURE = "figure-4-distributions"
LEVELS = (0.1, 0.5, 0.9, 0.99)


def experiment(
    scenario: ScenarioName = "asteroid-1997",
    runs: Annotated[int, typer.Option("--runs", metavar="N", help="Engagements a curve.")] = 50,
    seed: Seed = 0,
    strategy: StrategyName = None,
    model: ModelName = None,
    tie: TieName = None,
    sections: Annotated[
        int | None, typer.Option("--sections", metavar="N", help="Sections at the start, in place of the scenario's.")
    ] = None,
    out: Out = None,
    json_: Json = None,
    csv: Csv = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Fly many engagements a curve: random and game noise, each without and with the range meter.

    The curves share their starts and errors run by run. Run K is the same engagement as: infoset engage --run K.
    Without --out, --json or --csv nothing is written.
    """
    from experiments.common.output import checked_destinations
    from experiments.common.screen import figure_files, tell_of_compiling
    from experiments.interception.choices import own_strategy, scenario_with

    whole_number("--runs", runs, 1, MOST_RUNS, 50)
    whole_number("--seed", seed, 0, None, 0)
    given = scenario_with(scenario, strategy=strategy, model=model, tie=tie, sections=sections)
    own = own_strategy(strategy)
    names = ("scenario.toml", "results.json", "results.csv", *figure_files(FIGURE))
    with checked_destinations(folder=out, names=names, files={"--json": json_, "--csv": csv}, overwrite=overwrite):
        warnings = _warn(given, quiet)
        tell_of_compiling(quiet)
        curves, elapsed_s = _fly(given, own, runs, seed, quiet)
        from experiments.common.output import STDOUT, deliver, to_json

        json_text = to_json(_summary(given, runs, seed, elapsed_s, curves, warnings))
        csv_text = _to_csv(curves) if csv is not None or out is not None else ""
        deliver(json_, json_text, overwrite=overwrite)
        deliver(csv, csv_text, overwrite=overwrite)
        if out is not None:
            _fill(out, given, curves, json_text, csv_text, overwrite)
    if not quiet:
        _show(given, curves, STDOUT in (str(json_), str(csv)))


def _warn(scenario: Scenario, quiet: bool) -> list[str]:
    from experiments.common.screen import say, say_warnings
    from experiments.interception.scenario_file import scenario_warnings

    warnings = scenario_warnings(scenario)
    say_warnings(warnings, quiet)
    if scenario.range_sensor is None:
        say(f"{scenario.name} has no [range_sensor]: there are curves 1 and 3 only", quiet)
    return warnings


def _fly(scenario: Scenario, own: Strategy | None, runs: int, seed: int, quiet: bool) -> tuple[list[Curve], float]:
    from concurrent.futures import ThreadPoolExecutor
    from threading import Event
    from time import perf_counter

    from experiments.common.screen import need_finite, progress_bar
    from experiments.interception.curves import Curve, curve_scenarios
    from sim import simulate

    began_s = perf_counter()
    stopped = Event()
    with progress_bar(quiet) as begin:

        def fly(number: int, flown: Scenario) -> Curve:
            report = begin(f"curve {number}: {flown.noise.value}{' + range meter' if flown.range_sensor else ''}")

            def progress(share: float) -> None:
                if stopped.is_set():
                    raise InterruptedError
                report(share)

            results = simulate(flown, runs, seed=seed, strategy=own, progress=progress)
            need_finite(results)
            return Curve(number, flown.noise, flown.range_sensor is not None, results)

        # Curves are independent and the kernels release the interpreter: a thread a core. The slowest goes first.
        flights = sorted(curve_scenarios(scenario), key=lambda flight: -flight[0])
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            try:
                curves = list(pool.map(fly, *zip(*flights, strict=True)))
            except BaseException:
                stopped.set()
                raise
    return sorted(curves, key=lambda curve: curve.number), perf_counter() - began_s


def _summary(
    scenario: Scenario, runs: int, seed: int, elapsed_s: float, curves: Sequence[Curve], warnings: Sequence[str]
) -> dict[str, object]:
    from experiments.common.output import library_version, outcome_columns
    from experiments.interception.scenario_file import scenario_hash

    return {
        "version": library_version(),
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        **({"warnings": list(warnings)} if warnings else {}),
        "seed": seed,
        "runs": runs,
        "elapsed_s": elapsed_s,
        "curves": [
            {
                "published_curve": curve.number,
                "noise": curve.noise.value,
                "range_meter": curve.range_meter,
                **outcome_columns(curve.results),
            }
            for curve in curves
        ],
    }


def _to_csv(curves: Sequence[Curve]) -> str:
    from experiments.common.output import to_csv

    columns = [curve.results.to_dict() for curve in curves]
    rows: list[list[Cell]] = [
        [curve.number, curve.noise.value, curve.range_meter, *values]
        for curve, by_name in zip(curves, columns, strict=True)
        for values in zip(*by_name.values(), strict=True)
    ]
    return to_csv(("published_curve", "noise", "range_meter", *columns[0]), rows)


def _fill(
    folder: Path, scenario: Scenario, curves: Sequence[Curve], json_text: str, csv_text: str, overwrite: bool
) -> None:
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures, write_file
    from experiments.interception.figures.distributions import draw_distributions
    from experiments.interception.scenario_file import scenario_to_toml

    write_file(folder / "scenario.toml", scenario_to_toml(scenario), overwrite=overwrite)
    write_file(folder / "results.json", json_text, overwrite=overwrite)
    write_file(folder / "results.csv", csv_text, overwrite=overwrite)
    figure = draw_distributions(curves)
    with reporting_failures(folder):
        save_figure(figure, folder, FIGURE)


def _show(scenario: Scenario, curves: Sequence[Curve], stdout_taken: bool) -> None:
    """Print quantiles a curve, and what else came out."""
    from rich.table import Table
    from rich.text import Text

    from experiments.common.screen import (
        allowance,
        certificate,
        guaranteed_miss_name,
        number,
        table_console,
    )
    from experiments.interception.published import MANY, PRINTED_SINGLE_RUN, SINGLE
    from infoset import Recovery
    from sim import Outcome, quantiles

    table = Table("curve", "quantity", box=None, pad_edge=False)
    for level in LEVELS:
        table.add_column(f"{level:.0%}", justify="right")
    went_on = scenario.set_model.recovery is Recovery.WIDENED
    others_say = {
        Outcome.SET_LOST: f"with a set that emptied{' and went on widened' if went_on else ''} (set-lost)",
        Outcome.BUDGET_SPENT: "with too little left to correct (budget-spent)",
        Outcome.DIVERGED: "farther at the closest approach than the nominal range (diverged)",
    }
    notes = []
    for curve in curves:
        results = curve.results
        name, meter = f"{curve.number} {curve.noise.value}", "  + range meter" if curve.range_meter else ""
        finished = results.guaranteed_miss_m.compressed()
        median = number(float(quantiles(finished, 0.5))) if len(finished) else "-"
        for first, quantity, values in (
            (name, "miss, m", results.miss_m),
            (meter, "impulse, m/s", results.impulse_m_s),
        ):
            table.add_row(first, quantity, *(number(float(each)) for each in quantiles(values, LEVELS)))
        table.add_row("", f"{guaranteed_miss_name(scenario.set_model.kind.value)}, m", "", median)
        others = Counter(each for each in results.outcomes if each is not Outcome.INTERCEPTED)
        said = [f"{count} {others_say[outcome]}" for outcome, count in others.items()]
        notes.append(f"curve {curve.number}: " + "; ".join([certificate(results), *said]))
    console = table_console(stdout_taken)
    console.print(Text(f"{scenario.name}, {len(curves[0].results)} runs a curve; quantiles"), soft_wrap=True)
    console.print(table)
    allowed = allowance(scenario)
    for note in [*notes, *([allowed] if allowed else [])]:
        console.print(Text(note), soft_wrap=True)
    if scenario.name in (MANY, SINGLE):
        figures = ", ".join(f"{noise} {miss} m for {fuel} m/s" for noise, (miss, fuel) in PRINTED_SINGLE_RUN.items())
        console.print(Text(f"paper, one run from z = -8 km, no range meter: {figures}"), soft_wrap=True)
