"""`infoset compare`: simulation, files and tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from time import perf_counter

from rich.console import Console
from rich.table import Table

from experiments.common.output import Cell, output_of, to_csv, to_json
from experiments.common.screen import (
    figure_files,
    number,
    print_lines,
    progress_bar,
    say_warnings,
    table_console,
)
from experiments.interception.choices import chosen_strategies, scenario_with
from experiments.interception.commands.compare import Compare
from experiments.interception.comparison import QUANTILES, Comparison, flights, gather, summary
from experiments.interception.figures.comparison import draw_comparison
from experiments.interception.runs.shared import Progress, simulate_in_threads, summary_head
from experiments.interception.scenario_file import scenario_to_toml, scenario_warnings
from guidance import NoiseKind, Strategy, TieRule
from sim import Scenario

FIGURE = "figure-comparison"
COLUMNS = ("strategy", "noise", "tie", "run", "miss_m", "impulse_m_s", "outcome", "truth_kept")


def run(options: Compare) -> None:
    """Simulate the strategies, write the files and print the table."""
    scenario = scenario_with(options.scenario, model=options.model, range_meter=options.range_meter)
    strategies = chosen_strategies(scenario, options.strategies)
    with (
        output_of(options, ("scenario.toml", "results.json", "results.csv", *figure_files(FIGURE))) as written,
        progress_bar(options.quiet) as begin,
    ):
        say_warnings(scenario_warnings(scenario), options.quiet)
        began_s = perf_counter()
        reports = {name: begin(name) for name in strategies}
        compared = _simulate(scenario, strategies, options.runs, options.seed, reports)
        result = {
            **summary_head(scenario),
            "model": scenario.set_model.kind.value,
            "range_meter": scenario.range_sensor is not None,
            "seed": options.seed,
            "runs": options.runs,
            "elapsed_s": perf_counter() - began_s,
            "strategies": [_summary(comparison) for comparison in compared],
        }
        written.save("scenario.toml", scenario_to_toml(scenario))
        written.save("results.json", to_json(result), "--json")
        if written.wants("--csv"):
            written.save("results.csv", to_csv(COLUMNS, _rows(compared)), "--csv")
        if options.out is not None:
            written.figure(FIGURE, draw_comparison(compared))
    if not options.quiet:
        _show(table_console(written.stdout_taken), scenario, compared)


def _simulate(
    scenario: Scenario,
    strategies: Mapping[str, Strategy | None],
    runs: int,
    seed: int,
    reports: Mapping[str, Progress],
) -> list[Comparison]:
    wanted = flights(scenario, strategies)
    done: dict[str, dict[TieRule | None, float]] = {name: dict.fromkeys((None, *TieRule), 0.0) for name in strategies}

    def progress_of(name: str, tie: TieRule | None) -> Progress:
        def progress(share: float) -> None:
            done[name][tie] = share
            reports[name](sum(done[name].values()) / len(done[name]))

        return progress

    jobs = [(flown, strategies[name], progress_of(name, tie)) for name, tie, flown in wanted]
    results = simulate_in_threads(jobs, runs, seed)
    return gather([(name, tie, result) for (name, tie, _), result in zip(wanted, results, strict=True)])


def _summary(comparison: Comparison) -> dict[str, object]:
    outcomes = Counter(outcome.value for results in comparison.results.values() for outcome in results.outcomes)
    phi_held = comparison.phi_held
    return {
        "name": comparison.strategy,
        "noise": comparison.noise.value,
        "miss_m": summary(comparison.miss_m),
        "impulse_m_s": summary(comparison.impulse_m_s),
        "truth_kept": int(comparison.truth_kept.sum()),
        "phi_held": None if phi_held.mask.all() else int(phi_held.filled(False).sum()),
        "outcomes": dict(outcomes),
        "ties": {
            tie.value: {"miss_m": summary(results.miss_m), "impulse_m_s": summary(results.impulse_m_s)}
            for tie, results in comparison.results.items()
            if tie is not None
        },
    }


def _rows(compared: Sequence[Comparison]) -> list[list[Cell]]:
    return [
        [
            comparison.strategy,
            comparison.noise.value,
            None if tie is None else tie.value,
            int(results.runs[i]),
            float(results.miss_m[i]),
            float(results.impulse_m_s[i]),
            results.outcomes[i].value,
            bool(results.truth_kept[i]),
        ]
        for comparison in compared
        for tie, results in comparison.results.items()
        for i in range(len(results))
    ]


def _show(console: Console, scenario: Scenario, compared: Sequence[Comparison]) -> None:
    table = Table("noise", box=None, pad_edge=False)
    table.add_column("strategy", no_wrap=True)
    table.add_column("quantity", no_wrap=True)
    for level in QUANTILES.values():
        table.add_column("worst" if level == 1.0 else f"{level:.0%}", justify="right")
    table.add_column("runs with true\nstate in the set", justify="right")
    for noise in (NoiseKind.RANDOM, NoiseKind.GAME):
        title = noise.value
        for comparison in compared:
            if comparison.noise is not noise:
                continue
            miss, impulse = summary(comparison.miss_m), summary(comparison.impulse_m_s)
            kept = str(int(comparison.truth_kept.sum()))
            table.add_row(title, comparison.strategy, "miss, m", *(number(value) for value in miss.values()), kept)
            table.add_row("", "", "impulse, m/s", *(number(value) for value in impulse.values()))
            title = ""
    meter = "with" if scenario.range_sensor is not None else "without"
    runs = len(compared[0].miss_m)
    print_lines(
        console,
        [f"{scenario.name}, {meter} range meter, model {scenario.set_model.kind.value}: quantiles of {runs} runs"],
    )
    console.print(table)
    print_lines(console, ["game noise: for each run, the worst of its four tie rules"])
