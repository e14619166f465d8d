"""`infoset compare`: simulation, files and tables."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np
from rich.table import Table

from infoset.experiments.common.output import hit_key
from infoset.experiments.common.screen import (
    Part,
    figure_files,
    number,
    number_table,
    parts_of,
    quantile_notes,
    show,
    some_runs,
)
from infoset.experiments.interception.command import Compare
from infoset.experiments.interception.runs.shared import b_plane_figures, simulate_all, work_of
from infoset.experiments.interception.scenario_file import study_scenario
from infoset.experiments.interception.strategies import chosen_noises, chosen_strategies
from infoset.experiments.interception.study import (
    QUANTILES,
    Comparison,
    SetCounts,
    compared_scenarios,
    comparisons,
    miss_text,
    noise_notes,
    percent,
    scenario_title,
    set_counts,
    set_warnings,
    summary,
)
from infoset.guidance import NoiseKind
from infoset.sim import Scenario
from infoset.sim.columns import Cell, csv_text
from infoset.sim.parallel import Task

FIGURE = "figure-comparison"
NEAR = 0.1
"""Relative difference of quantiles up to which strategies count as equally good."""
TIES = "for each run, the worst of the four tie rules"
ACROSS = ("miss_y_m", "miss_z_m", "b_dot_t_m", "b_dot_r_m")
COLUMNS = (
    "run",
    "miss_m",
    "impulse_m_s",
    "outcome",
    "truth_kept",
    "set_emptied",
    "hit",
    "cause",
    *ACROSS,
)


def run(options: Compare) -> None:
    """Simulate the strategies, write the files and print the table."""
    scenario, notes = study_scenario(options)
    strategies = chosen_strategies(scenario, options.strategies)
    noises = chosen_noises(options.noise)
    figures = [FIGURE, *b_plane_figures(scenario, noises)]
    with work_of(options, scenario, ["results.csv", *figure_files(*figures)], notes=notes) as work:
        wanted = compared_scenarios(scenario, strategies, noises)
        each = len(wanted) // len(strategies)
        reports = [report for name in strategies for report in parts_of(work.begin(name), each)]
        tasks = [
            Task(
                *(flown, range(options.runs), options.seed),
                noise=noises[flight[1]],
                strategy=strategies[flight[0]],
                progress=report,
            )
            for (flight, flown), report in zip(wanted.items(), reports, strict=True)
        ]
        compared = comparisons(dict(zip(wanted, simulate_all(tasks), strict=True)))
        work.save(
            {
                "seed": options.seed,
                "runs": options.runs,
                "strategies": [_summary(comparison) for comparison in compared],
                "notes": noise_notes(scenario, noises, TIES),
            }
        )
        work.written.save("results.csv", _csv(compared), "--csv")
        if options.out is not None:
            from infoset.experiments.interception.figures.commands import draw_compared

            work.written.draw(figures, draw_compared(scenario, compared), work.begin("figure"))
    show(_parts(scenario, compared), options.quiet or work.written.stdout_taken)


def _summary(comparison: Comparison) -> dict[str, object]:
    outcomes = Counter(
        outcome.value for results in comparison.results.values() for outcome in results.outcomes
    )
    phi_held = comparison.worst("phi_held")
    return {
        "name": comparison.strategy,
        "noise": comparison.noise,
        **{name: summary(comparison.worst(name)) for name in ("miss_m", "impulse_m_s")},
        **hit_key(comparison.hits, comparison.missed),
        **{name: int(comparison.worst(name).sum()) for name in ("truth_kept", "set_emptied")},
        "phi_held": int(phi_held.sum()) if phi_held.count() else None,
        "outcomes": dict(outcomes),
        "ties": {
            tie.value: {
                "miss_m": summary(results.miss_m),
                "impulse_m_s": summary(results.impulse_m_s),
            }
            for tie, results in comparison.results.items()
            if tie is not None
        },
    }


def _csv(compared: Sequence[Comparison]) -> str:
    rows: list[list[Cell]] = []
    (known,) = {
        tuple(results.to_dict())
        for comparison in compared
        for results in comparison.results.values()
    }
    names = [name for name in COLUMNS if name in known]
    for comparison in compared:
        for tie, results in comparison.results.items():
            columns = results.to_dict()
            head = [comparison.strategy, comparison.noise, None if tie is None else tie.value]
            rows += [
                [*head, *values] for values in zip(*(columns[name] for name in names), strict=True)
            ]
    return csv_text(("strategy", "noise", "tie", *names), rows)


def _parts(scenario: Scenario, compared: Sequence[Comparison]) -> Iterator[Part]:
    table = number_table("noise", "strategy", "quantity", *QUANTILES, left=3)
    titles = ["true state in the\nset at every step", "set became\nempty"]
    if scenario.body is not None:
        titles += [f"hit: miss at\nmost {scenario.body.radius_m:g} m", "95 % CI\nof a hit"]
    sets = number_table("noise", "strategy", *titles, left=2)
    total = SetCounts()
    noises = list(dict.fromkeys(comparison.noise for comparison in compared))
    for comparison in sorted(compared, key=lambda each: noises.index(each.noise)):
        head = (comparison.noise, comparison.strategy)
        table.add_row(*head, "miss, m", *map(number, summary(comparison.worst("miss_m")).values()))
        table.add_row(
            "", "", "impulse, m/s", *map(number, summary(comparison.worst("impulse_m_s")).values())
        )
        counts = set_counts(*map(comparison.worst, ("truth_kept", "set_emptied")))
        hits = comparison.hits
        total += counts
        shares = [
            f"{count} ({percent(count / counts.runs)})"
            for count in (counts.truth_kept, counts.set_emptied)
        ]
        if hits is not None:
            shares += [
                f"{hits.hits} ({percent(hits.probability)})",
                f"{percent(hits.lower)} to {percent(hits.upper)}",
            ]
        sets.add_row(*head, *shares)
    runs = len(compared[0].worst("miss_m"))
    ties = f"; game noise: {TIES}" if NoiseKind.GAME.value in noises else ""
    yield f"{scenario_title(scenario)}: quantiles of {some_runs(runs)}{ties}"
    yield table
    yield from ("", f"of the {some_runs(runs)}:", sets)
    for comparison in compared:
        if comparison.hits is not None and (causes := miss_text(comparison.missed, runs, scenario)):
            yield f"{comparison.noise} noise, {comparison.strategy}: {causes}"
    if len(noises) > 1:
        yield from (
            "",
            "what depends on the noise, 90 % quantile of the miss, m:",
            _by_noise(compared, noises),
        )
        yield _best(compared, noises)
    yield from noise_notes(scenario, noises, TIES)
    yield from quantile_notes(runs, [*QUANTILES.values()])
    yield from set_warnings(scenario.information_set.model, total)


def _by_noise(compared: Sequence[Comparison], noises: Sequence[str]) -> Table:
    """Return a table of the 90 % quantile of the miss by strategy and noise, with the ratio of its
    extremes.
    """
    table = number_table("strategy", *noises, "maximum / minimum")
    for name in dict.fromkeys(comparison.strategy for comparison in compared):
        values = [
            summary(each.worst("miss_m"))["p90"] for each in compared if each.strategy == name
        ]
        known = [value for value in values if value is not None]
        ratio = max(known) / min(known) if known and min(known) > 0.0 else None
        table.add_row(name, *map(number, (*values, ratio)))
    return table


def _best(compared: Sequence[Comparison], noises: Sequence[str]) -> str:
    """Return a line with the strategies whose 90 % quantile of the miss is near the least one, for
    each noise.
    """
    near = {}
    for noise in noises:
        quantiles = {
            each.strategy: np.quantile(each.worst("miss_m"), 0.9)
            for each in compared
            if each.noise == noise
        }
        near[noise] = [
            name
            for name, value in quantiles.items()
            if value <= (1.0 + NEAR) * min(quantiles.values())
        ]
    always = [name for name in near[noises[0]] if all(name in names for names in near.values())]
    within = f"within {NEAR:.0%} of the least in these runs"
    if always:
        return f"{within} with every noise: {', '.join(always)}"
    by_noise = "; ".join(f"{', '.join(names)} with {noise}" for noise, names in near.items())
    return f"the best strategy depends on the noise; {within}: {by_noise}"
