"""infoset compare: strategies side by side, under random and game noise."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from experiments.common.options import Csv, Json, Out, Overwrite, Quiet, Seed, whole_number
from experiments.interception.options import MOST_RUNS, ModelName, RangeMeter, ScenarioName, Strategies

if TYPE_CHECKING:
    from pathlib import Path

    from experiments.common.output import Cell
    from experiments.interception.comparison import Comparison
    from guidance import Strategy, TieRule
    from sim import Results, Scenario

FIGURE = "figure-comparison"
COLUMNS = ("strategy", "noise", "tie", "run", "miss_m", "impulse_m_s", "outcome", "truth_kept")


def compare(
    scenario: ScenarioName = "asteroid-1997",
    strategies: Strategies = None,
    runs: Annotated[int, typer.Option("--runs", metavar="N", help="Engagements a strategy and noise.")] = 50,
    seed: Seed = 0,
    model: ModelName = None,
    range_meter: RangeMeter = None,
    out: Out = None,
    json_: Json = None,
    csv: Csv = None,
    overwrite: Overwrite = False,
    quiet: Quiet = False,
) -> None:
    """Compare strategies: the miss and the impulse spent, under random noise and under game noise.

    Every strategy meets the same starts and errors, run by run. Game noise is flown with each of its four tie rules,
    and each run counts with the worst of them. Run K is the same engagement as: infoset engage --run K.
    Without --out, --json or --csv nothing is written.
    """
    from experiments.common.output import STDOUT, checked_destinations, deliver, to_csv, to_json
    from experiments.common.screen import figure_files, say_warnings, tell_of_compiling
    from experiments.interception.choices import chosen_strategies, scenario_with
    from experiments.interception.scenario_file import scenario_warnings

    whole_number("--runs", runs, 1, MOST_RUNS, 50)
    whole_number("--seed", seed, 0, None, 0)
    given = scenario_with(scenario, model=model, range_meter=range_meter)
    chosen = chosen_strategies(given, strategies)
    files = ("scenario.toml", "results.json", "results.csv", *figure_files(FIGURE))
    with checked_destinations(folder=out, names=files, files={"--json": json_, "--csv": csv}, overwrite=overwrite):
        warnings = scenario_warnings(given)
        say_warnings(warnings, quiet)
        tell_of_compiling(quiet)
        compared, elapsed_s = _fly(given, chosen, runs, seed, quiet)
        json_text = to_json(_summary(given, runs, seed, elapsed_s, compared, warnings))
        csv_text = to_csv(COLUMNS, _rows(compared)) if csv is not None or out is not None else ""
        deliver(json_, json_text, overwrite=overwrite)
        deliver(csv, csv_text, overwrite=overwrite)
        if out is not None:
            _fill(out, given, compared, json_text, csv_text, overwrite)
    if not quiet:
        _show(given, compared, STDOUT in (str(json_), str(csv)))


def _fly(
    scenario: Scenario, chosen: Mapping[str, Strategy | None], runs: int, seed: int, quiet: bool
) -> tuple[list[Comparison], float]:
    from concurrent.futures import ThreadPoolExecutor
    from threading import Event
    from time import perf_counter

    from experiments.common.screen import need_finite, progress_bar
    from experiments.interception.comparison import flights, gather
    from sim import simulate

    began_s = perf_counter()
    stopped = Event()
    wanted = flights(scenario, chosen)
    with progress_bar(quiet) as begin:
        reports = {name: begin(name) for name in chosen}
        done = {name: {tie: 0.0 for each, tie, _ in wanted if each == name} for name in chosen}

        def fly(name: str, tie: TieRule | None, flown: Scenario) -> tuple[str, TieRule | None, Results]:
            def progress(share: float) -> None:
                if stopped.is_set():
                    raise InterruptedError
                done[name][tie] = share
                reports[name](sum(done[name].values()) / len(done[name]))

            results = simulate(flown, runs, seed=seed, strategy=chosen[name], progress=progress)
            need_finite(results)
            return name, tie, results

        # Flights are independent and the kernels release the interpreter: a thread a core.
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            try:
                flown = list(pool.map(fly, *zip(*wanted, strict=True)))
            except BaseException:
                stopped.set()
                raise
    return gather(flown), perf_counter() - began_s


def _summary(
    scenario: Scenario, runs: int, seed: int, elapsed_s: float, compared: Sequence[Comparison], warnings: Sequence[str]
) -> dict[str, object]:
    from experiments.common.output import library_version
    from experiments.interception.comparison import summary
    from experiments.interception.scenario_file import scenario_hash

    return {
        "version": library_version(),
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        **({"warnings": list(warnings)} if warnings else {}),
        "model": scenario.set_model.kind.value,
        "range_meter": scenario.range_sensor is not None,
        "seed": seed,
        "runs": runs,
        "elapsed_s": elapsed_s,
        "strategies": [
            {
                "name": each.strategy,
                "noise": each.noise.value,
                "miss_m": summary(each.miss_m),
                "impulse_m_s": summary(each.impulse_m_s),
                "truth_kept": int(each.truth_kept.sum()),
                "phi_held": None if each.phi_held.mask.all() else int(each.phi_held.filled(False).sum()),
                "outcomes": _outcomes(each),
                "ties": {
                    tie.value: {"miss_m": summary(results.miss_m), "impulse_m_s": summary(results.impulse_m_s)}
                    for tie, results in each.results.items()
                    if tie is not None
                },
            }
            for each in compared
        ],
    }


def _outcomes(compared: Comparison) -> dict[str, int]:
    """How many engagements ended in which way, over all tie rules."""
    from collections import Counter

    return dict(Counter(outcome.value for results in compared.results.values() for outcome in results.outcomes))


def _rows(compared: Sequence[Comparison]) -> list[list[Cell]]:
    return [
        [
            each.strategy,
            each.noise.value,
            None if tie is None else tie.value,
            int(results.runs[i]),
            float(results.miss_m[i]),
            float(results.impulse_m_s[i]),
            results.outcomes[i].value,
            bool(results.truth_kept[i]),
        ]
        for each in compared
        for tie, results in each.results.items()
        for i in range(len(results))
    ]


def _fill(
    folder: Path, scenario: Scenario, compared: Sequence[Comparison], json_text: str, csv_text: str, overwrite: bool
) -> None:
    from experiments.common.figure_style import save_figure
    from experiments.common.output import reporting_failures, write_file
    from experiments.interception.figures.comparison import draw_comparison
    from experiments.interception.scenario_file import scenario_to_toml

    write_file(folder / "scenario.toml", scenario_to_toml(scenario), overwrite=overwrite)
    write_file(folder / "results.json", json_text, overwrite=overwrite)
    write_file(folder / "results.csv", csv_text, overwrite=overwrite)
    figure = draw_comparison(compared)
    with reporting_failures(folder):
        save_figure(figure, folder, FIGURE)


def _show(scenario: Scenario, compared: Sequence[Comparison], stdout_taken: bool) -> None:
    """Print one table: quantiles of each strategy under both noises, the worst of all runs at the end."""
    from rich.table import Table
    from rich.text import Text

    from experiments.common.screen import number, table_console
    from experiments.interception.comparison import QUANTILES, summary
    from guidance import NoiseKind

    runs = len(compared[0].miss_m)
    table = Table("noise", box=None, pad_edge=False)
    table.add_column("strategy", no_wrap=True)
    table.add_column("quantity", no_wrap=True)
    for level in QUANTILES.values():
        table.add_column("worst" if level == 1.0 else f"{level:.0%}", justify="right")
    table.add_column("truth\nkept", justify="right")
    for noise in (NoiseKind.RANDOM, NoiseKind.GAME):
        for index, each in enumerate(every for every in compared if every.noise is noise):
            miss, impulse = summary(each.miss_m), summary(each.impulse_m_s)
            kept = str(int(each.truth_kept.sum()))
            first = noise.value if index == 0 else ""
            table.add_row(first, each.strategy, "miss, m", *(number(value) for value in miss.values()), kept)
            table.add_row("", "", "impulse, m/s", *(number(value) for value in impulse.values()))
    meter = "with" if scenario.range_sensor is not None else "without"
    console = table_console(stdout_taken)
    console.print(
        Text(f"{scenario.name}, {meter} range meter, model {scenario.set_model.kind.value}, {runs} runs; quantiles"),
        soft_wrap=True,
    )
    console.print(table)
    console.print(Text("game noise: the worst of its four tie rules, run by run"), soft_wrap=True)
